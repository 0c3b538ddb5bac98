"""The exact rod in contact with its hole's wall, against references and against the soft string."""

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.walls import TubeRing, TubeWall
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models import formulation
from cosserat_fenicsx.models.formulation import found_traits, traits_of
from cosserat_fenicsx.statics.problem import solvers_of
from cosserat_fenicsx.statics.settling import settle, stages_from
from cosserat_fenicsx.well.rod.in_hole import NAMES, UNSEEN, RodErrors
from cosserat_fenicsx.well.rod.resultants import apart_mostly
from cosserat_fenicsx.well.rod.rod_in_hole import solve_in_hole
from cosserat_fenicsx.well.rod.string_scene import on_axis

FOLDER = Path(__file__).parent / "reference"
KNOWN = json.loads((FOLDER / "rod_in_hole.json").read_text(encoding="utf-8"))
WELLS = json.loads((FOLDER / "wells.json").read_text(encoding="utf-8"))
SLIP = {"out": (1.0, 0.0), "in": (-1.0, 0.0), "turning": (0.0, 1.0), "still": (0.0, 0.0)}
PIPE = cf.Stiffness((1.35359e8, 1.35359e8), 7.03868e8, (1228200.0, 1228200.0), 9.4e5)


def rigid(EI):
    return cf.Stiffness((1e12, 1e12), 1e12, (EI, EI), EI)


def built(case, **options):
    """A string in a vertical line, an arc and a straight line, see the reference."""
    given, alpha = case["input"], math.radians(case["input"]["alpha"])
    md = np.cumsum([0, given["h"], given["R"] * alpha, given["D"] + 50.0])
    path = cf.well.WellPath.from_survey(md, np.degrees([0, 0, alpha, alpha]), [0, 0, 0, 0])
    return solve_in_hole(
        path, [case["rod_length"]], rigid(given["EI"]), given["w"], 0.06, radius=0.06 + given["r"],
        friction=given["mu"], slip=(float(given["c"]), 0.0), bottom_tension=given["T0"], hinge=(0, 1, 0), has_arm=False,
        **options,
    )  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize("case", KNOWN["stiff build"], ids=lambda case: case["name"])
def test_a_string_crosses_from_wall_to_wall_of_a_build_section(case):
    answer, given = built(case), case["input"]
    hook = case["hook_load_vertical"]
    points = [case[f"point_force_{k}"] for k in (3, 2, 1)]
    lying = (given["D"] - case["lift_off_d_below_arc_end"]) * given["w"] * math.sin(math.radians(given["alpha"]))
    wall = case["contact_force_integral_inner_arc"] + sum(points) + lying
    assert abs(answer.hook_load - hook) < min(1e-6 * hook, answer.errors["hook_load"])
    assert abs(answer.wall_force - wall) < min(5e-6 * wall, answer.errors["wall_force"])
    assert answer.steps <= 40 and answer.error < 1e-4
    upper, arc, touch, lift, lower = answer.contacts
    assert [upper.force, touch.force, lift.force] == pytest.approx(points, rel=2e-3)
    at = case["rod_length"] - given["D"] + case["lift_off_d_below_arc_end"]
    assert lift.start == pytest.approx(at, abs=0.02)
    assert touch.start == pytest.approx(at - case["free_span_1"], abs=0.02)
    assert upper.start == pytest.approx(case["free_span_2"], abs=0.02)
    assert arc.force == pytest.approx(case["contact_force_integral_inner_arc"], rel=2e-4)
    assert lower.force == pytest.approx(lying, rel=1e-3)
    assert [abs(x.side) for x in answer.contacts] == pytest.approx([0, 0, 0, math.pi, math.pi], abs=1e-9)
    on_arc = (answer.s > 40) & (answer.s < 70)
    assert answer.bending_moment[on_arc] == pytest.approx(case["moment_in_contact"], rel=1e-5)


def test_a_frictionless_string_hangs_by_its_tension_and_its_depth():
    """The rod's Hamiltonian, n . r' + EI k^2/2 less the potentials, is the same at both ends."""
    (case,) = (case for case in KNOWN["stiff build"] if case["input"]["c"] == 0)
    answer, given = built(case, elements=2048), case["input"]
    fall = answer.position[-1, 2] - answer.position[0, 2]
    assert answer.tension[0] == pytest.approx(given["T0"] + given["w"] * fall, rel=1e-9)
    assert answer.stretch == pytest.approx(answer.s[-1] * 1.6e5 / 1e12, rel=0.1)


@pytest.mark.serial
@pytest.mark.parametrize("case", KNOWN["bottom-hole assembly"][1:3], ids=["bit", "stabiliser"])
def test_an_assembly_touches_the_low_side_at_its_tangency(case):
    exact, inc, length = case["exact_kirchhoff"], case["inclination_deg"], 60.0
    path = cf.well.WellPath.from_survey([0, length + 20], [inc, inc], [0, 0])
    rings = [(length, 0.0, 0.1)]
    if "stabiliser_at_arc_length" in case:
        rings.append((length - case["stabiliser_at_arc_length"], case["stabiliser_offset_low_side"], 0.1))
    answer = solve_in_hole(
        path, [length], rigid(case["EI"]), case["w"], 0.1, radius=0.1 + case["clearance"], bottom_tension=-case["WOB"],
        rings=rings, wall_stiffness=1e10,
    )  # fmt: skip
    inc = math.radians(inc)
    low = np.array([-math.cos(inc), 0.0, math.sin(inc)])
    assert -answer.ring_forces[0] @ low == pytest.approx(exact["bit_side_force"], rel=5e-5)
    if len(rings) > 1:
        assert answer.ring_forces[1] @ low == pytest.approx(exact["stabiliser_reaction_on_pipe"], rel=5e-5)
    above = [x for x in answer.contacts if x.start < length - 10]
    assert length - above[-1].start == pytest.approx(exact["arc_length_to_tangency"], abs=1e-3)
    assert above[-1].force == pytest.approx(exact["reaction_at_tangency"], rel=1e-3)
    assert answer.hook_load == pytest.approx(case["w"] * length * math.cos(inc) - case["WOB"], rel=1e-8)


@pytest.mark.serial
@pytest.mark.parametrize("case", KNOWN["capstan"], ids=lambda case: f"EI {case['EI']:g}, mu {case['mu']:g}")
def test_a_string_slips_round_an_arc(case):
    """The hole is wide but for the arc; its axis has the radius R plus the clearance, and the string leaves the arc at
    an angle to the axis, by which its angle of wrap is smaller."""
    EI, R, mu, angle, T = (case[name] for name in ("EI", "R", "mu", "Theta", "T1"))
    straight, clear, own = max(12 * math.sqrt(EI / T), 0.6 * R * angle), 1e-3 * R, 0.01 * R
    clear *= 10 if case["EI"] == 0.01 else 1
    md = np.cumsum([0.0, straight, (R + clear) * angle, straight])
    path = cf.well.WellPath.from_survey([*md[:3], md[3] + R], np.degrees([0, 0, angle, angle]), [0] * 4)
    answer = solve_in_hole(
        path, [md[3]], rigid(EI), 1e-9 * T / R, own, friction=mu, slip=(1.0, 0.0), bottom_tension=T, has_arm=False,
        radius=[(md[1], own + 0.3 * R), (md[2], own + clear), (md[3] + R, own + 0.3 * R)],
        wall_stiffness=1e7 * T / R**2,
    )  # fmt: skip
    force = answer.reaction[0]
    size = np.linalg.norm(force)
    missed = math.asin(np.linalg.norm(np.cross(force, path.tangent(0.0))) / size)
    assert size * math.exp(mu * missed) == pytest.approx(case["T2"], rel=2e-5)


@pytest.mark.serial
def test_the_pressure_of_a_turning_string_is_smaller_than_its_weight():
    """Friction carries a part of it: |q|/sqrt(1 + mu^2), and the torque is that pressure times mu and the radius."""
    path, mu = cf.well.WellPath.from_survey([0, 500], [60, 60], [30, 30]), 0.4
    answer = solve_in_hole(path, [400], PIPE, 241.13, 0.0635, radius=0.108, friction=mu, slip=(0.0, 1.0))
    inside = (answer.s > 100) & (answer.s < 300)
    pressure = 241.13 * math.sin(math.radians(60)) / math.hypot(1, mu)
    assert answer.side_force[inside] == pytest.approx(pressure, rel=1e-6)
    climbed = math.atan(mu)
    assert abs(np.abs(answer.side[inside]) - math.pi) == pytest.approx(climbed, rel=1e-6)
    slope = np.polyfit(answer.s[inside], answer.torque[inside], 1)[0]
    assert slope == pytest.approx(-mu * pressure * 0.0635, rel=1e-6)
    assert answer.surface_torque == pytest.approx(mu * 0.0635 * answer.wall_force, rel=1e-5)
    whole = ((answer.torque[1:] + answer.torque[:-1]) / 2 * np.diff(answer.s)).sum()
    assert answer.twist == pytest.approx(whole / 9.4e5, rel=1e-4)


#: Hook loads of another program (a prototype, elements of 2 m, friction on the centreline), N.
FOUND = {("P", "out"): 907306.0, ("P", "in"): 379920.4, ("P", "turning"): 598622.0, ("F-12", "out"): 938745.5}


@pytest.mark.serial
@pytest.mark.parametrize("name, way", FOUND)
def test_whole_wells(name, way):
    stations = np.transpose(WELLS[name]["stations_md_inc_azi"])
    path = cf.well.WellPath.from_survey(*stations)
    given = {"radius": 0.0635 + 0.04445, "friction": 0.25, "slip": SLIP[way]}
    answer = solve_in_hole(path, [path.length], PIPE, 241.13, 0.0635, **given)
    assert answer.hook_load == pytest.approx(FOUND[name, way], rel=2e-5)  # friction's arm along the pipe: -1.5e-5
    assert answer.steps <= 55 and answer.error < 1e-4 and answer.balance < 0.1
    if way == "turning":  # half a per cent below the soft string's torque, by the clearance
        assert answer.surface_torque == pytest.approx(15290.84, rel=6e-3)


@pytest.mark.serial
def test_slender_strings_are_solved():
    """Beside the wall their pivots are zero to rounding; with less bending stiffness the hook load tends to a limit."""
    path = cf.well.WellPath.from_survey([0, 100, 300, 500], [0, 0, 40, 40], [20] * 4)
    given = {"radius": 0.108, "friction": 0.25, "slip": SLIP["out"], "elements": 256}
    stiffer, soft = (solve_in_hole(path, [500.0], rigid(EI), 241.13, 0.0635, **given).hook_load for EI in (1e3, 100.0))
    assert soft == pytest.approx(stiffer, rel=1e-6)


@pytest.mark.slow
@pytest.mark.serial
def test_drilling_with_weight_on_a_centred_bit():
    """The soft string's hook load and torque are 661 189 N and 9548 N m; the clearance takes 3.4 % of the torque."""
    path = cf.well.WellPath.from_survey(*np.transpose(WELLS["F-12"]["stations_md_inc_azi"]))
    answer = solve_in_hole(
        path, [path.length], PIPE, 241.13, 0.0635, radius=0.0635 + 0.04445, friction=0.25, slip=SLIP["turning"],
        bottom_tension=-8e4, bottom_torque=5e3, rings=[(path.length, 0.0, 0.1)],
    )  # fmt: skip
    assert answer.hook_load == pytest.approx(661189.3, rel=5e-5)
    assert answer.surface_torque == pytest.approx(5000 + 9547.85 * 0.966, rel=2e-3)
    assert answer.tension[-1] == pytest.approx(-8e4, rel=2e-4)  # along the string, which tilts there
    assert answer.distance[-1] < 1e-5 and answer.negative_modes == 0 and answer.error < 1e-4


@pytest.mark.serial
def test_two_sections_two_frictions_and_rings():
    path = cf.well.WellPath.from_survey(*np.transpose(WELLS["P"]["stations_md_inc_azi"]))
    collar = cf.Stiffness((1e9, 1e9), 5e9, (2e7, 2e7), 1.5e7)
    hole = {"radius": [(2500.0, 0.1112), (4700.0, 0.108)], "friction": [(2500.0, 0.2), (4700.0, 0.3)]}
    answer = solve_in_hole(
        path, [4500, 200], [PIPE, collar], [241.13, 1050.0], [0.0635, 0.0825], slip=[(0.6, 0.8), (0.8, 0.6)],
        rings=[(4700, 0.0, 0.1), (4680, 0.003, 0.1)], tol=2e-4, **hole,
    )  # fmt: skip
    assert answer.error < 2e-4 and answer.balance < 0.2
    assert answer.standoff.min() > -0.01 and answer.distance.max() < 0.1112 - 0.0635 + 1e-4
    assert answer.wall_force == pytest.approx(sum(x.force for x in answer.contacts), rel=1e-3)


@pytest.mark.serial
def test_a_string_on_the_axis_has_no_twist_and_no_jump_of_its_quaternion():
    path = cf.well.WellPath.from_survey([0, 100, 400, 700], [0, 30, 170, 20], [0, 0, 90, 300])
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 700)), PIPE)
    s = np.linspace(0, 700, 5001)
    r, q = np.split(on_axis(rod, path, s), [3], axis=1)
    assert np.abs(r - path.position(s)).max() == 0
    along = np.stack([2 * (q[:, 1] * q[:, 3] + q[:, 0] * q[:, 2]), 2 * (q[:, 2] * q[:, 3] - q[:, 0] * q[:, 1]),
                      q[:, 0] ** 2 - q[:, 1] ** 2 - q[:, 2] ** 2 + q[:, 3] ** 2], axis=1)  # fmt: skip
    assert np.abs(along - path.tangent(s)).max() < 1e-12
    assert np.linalg.norm(np.diff(q, axis=0), axis=1).max() < 0.001


@pytest.mark.serial
@pytest.mark.parametrize("arguments, word", [
    ({"radius": 0.05}, "contact_radius = 0.0635: expected less than the radius of the tube, 0.05 m"),
    ({"friction": -0.1}, "friction = -0.1"),
    ({"slip": (1.0, 1.0)}, "slip"),
    ({"slip": ((1.0, 0.0), (0.0, 1.0))}, "slip"),
    ({"elements": 0}, "elements"),
    ({"lengths": [400.0, 200.0]}, "no more than the length of the hole, 500 m"),
    ({"weight": 0.0}, "weight"),
    ({"stiffness": [PIPE, PIPE]}, "one Stiffness"),
    ({"rings": [(500.0, 0.0, 0.1)]}, "arc length"),
    ({"bottom_tension": math.nan}, "bottom_tension"),
])  # fmt: skip
def test_refusals(arguments, word):
    path = cf.well.WellPath.from_survey([0, 500], [60, 60], [30, 30])
    given = {"lengths": [400], "stiffness": PIPE, "weight": 241.13, "contact_radius": 0.0635, "radius": 0.108}
    with pytest.raises(cf.SceneError, match=word.replace("(", r"\(")):
        solve_in_hole(path, **{**given, **arguments})


@pytest.mark.serial
@pytest.mark.slow
def test_what_walls_tell_of_their_work_is_true(monkeypatch):
    monkeypatch.setattr(formulation, "_TRIED", 1)  # UFL takes seconds for each random state, all of which touch
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 10)), PIPE)
    wall = TubeWall(rod, cf.well.WellPath.from_survey([0, 20], [0, 0], [0, 0]), 0.1, 0.05)
    assert found_traits(wall, [rod]) == traits_of(wall, [rod])


@pytest.mark.serial
def test_walls_refuse_what_has_no_axis():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 10)), PIPE)
    with pytest.raises(cf.SceneError, match=r"path = .*expected WellPath"):
        TubeWall(rod, "straight", 0.1, 0.05)
    path = cf.well.WellPath.from_survey([0, 20], [0, 0], [0, 0])
    with pytest.raises(cf.SceneError, match="contact_radius"):
        TubeRing(rod.end, path, 0.01, 0.0)


def test_a_string_of_several_rods_is_the_same():
    path, length, weight = (
        cf.well.WellPath.from_survey([0, 60, 140, 260], [20, 20, 60, 60], [0, 0, 40, 40]),
        200.0,
        241.13,
    )
    pipe = cf.Stiffness((1.35e8, 1.35e8), math.inf, (1228200.0, 1228200.0), 1.2282e10)
    start, down, lines = path.position(0.0), path.tangent(0.0), []
    for ends in ([0.0, length], [0.0, 75.0, length]):
        rods = [cf.Rod(cf.Line(start + a * down, start + b * down), pipe) for a, b in itertools.pairwise(ends)]
        walls = [
            TubeWall(rod, path, 0.108, 0.0635, friction=0.2, slip=(0.6, 0.8), begins=a)
            for rod, a in zip(rods, ends, strict=False)
        ]
        pull = cf.Force(rods[-1].end, 5e4 * path.tangent(length))
        loads = [*(cf.LineForce(rod, (0, 0, weight)) for rod in rods), pull, *walls]
        joints = [cf.Joint(a.end, b.start) for a, b in itertools.pairwise(rods)]
        scene = cf.Scene(rods, [cf.Clamp(rods[0].start)], loads, joints=joints)
        layout = Layout(tuple(np.linspace(0, 1, round(0.4 * rod.length) + 1) for rod in rods))
        with solvers_of(scene, layout, degree=3) as (problem, _, _):
            model = problem.model
            problem.set_load_factor(1.0)
            places = zip(rods, ends, layout.node_s(model.nodes), strict=False)
            rq = np.concatenate([on_axis(rods[0], path, a + x * rod.length) for rod, a, x in places])
            rq[:, :3] = (rq[:, :3] - start) / model.scales.length
            problem.begin_at(model.unknowns_of(rq), np.zeros((80, 3, 3)), np.empty(0))
            stages = [wall.stage for wall in walls]
            settle(problem, stages, 0.0445 / model.scales.length, 1e-2 / model.scales.force, stages_from(1e-5))
            found = model.snapshot()[0][:, :3] * model.scales.length + start
        lines.append(np.delete(found, 91, axis=0) if len(rods) > 1 else found)
    assert np.abs(lines[0] - lines[1]).max() < 1e-9


@pytest.mark.serial
def test_side_force_and_moment_on_a_coarse_mesh():
    """They are near to those of a fine mesh, which the wall's forces at the nodes are not, and the estimates are above
    their errors."""
    path = cf.well.WellPath.from_survey([0, 300, 900, 1500], [0, 0, 40, 40], [20, 20, 20, 20])
    given = path, [1500], PIPE, 241.13, 0.0635
    coarse, fine = (solve_in_hole(*given, radius=0.108, friction=0.25, slip=(1.0, 0.0), wall_stiffness=1e9, elements=n)
                    for n in (64, 512))  # fmt: skip

    def apart(values, name):
        return apart_mostly(values, np.interp(coarse.s, fine.s, getattr(fine, name)), coarse.node_length)

    at_nodes = coarse.node_force / coarse.node_length
    assert 5 * apart(coarse.side_force, "side_force") < apart(at_nodes, "side_force")
    assert 5 * apart(coarse.distributed_force, "distributed_force") < apart(at_nodes, "distributed_force")
    for name, scale in (("side_force", 200.0), ("bending_moment", 1500.0)):
        error = apart(getattr(coarse, name), name)
        assert error < min(0.05 * scale, coarse.errors_along[name])
    assert coarse.side_force @ coarse.node_length == pytest.approx(coarse.node_force.sum(), rel=1e-12)


@pytest.mark.serial
def test_changes_that_are_small_by_chance_are_not_believed():
    """Three meshes: the last change is 1e-9, the one before 1e-4; the wall's softness is known from the first one."""
    scales, rounding = dict.fromkeys(NAMES, 2.0), dict.fromkeys(NAMES, 0.0)
    known = None
    for value, walls in ((2.0, (0.01, 0.1, 1.0)), (2.0002, (1.0,)), (2.0002 + 2e-9, (1.0,))):
        known = RodErrors({wall: dict.fromkeys(NAMES, value) for wall in walls}, scales, rounding, NAMES[:1], known)
    assert known.of_stiffness == pytest.approx(UNSEEN)
    assert known.error == pytest.approx(1.5e-4 / 10 + UNSEEN)


STIFF = cf.Stiffness((1.35359e8, 1.35359e8), 7.03868e8, (1228200.0, 1228200.0), 9.4e5)
SOFT_PIPE = cf.well.Component(None, STIFF, 241.13, 0.0635, name="pipe")
MUD = cf.well.Mud(1200.0)


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize(
    "operation", [cf.well.RotaryDrilling(80e3, 5e3), cf.well.Sliding(50e3), cf.well.TripOut()], ids=str
)
def test_a_soft_string_knows_that_bit_and_stabilisers_pry(operation):
    """A stabiliser near the bit: the span above it presses it down, and the bit up."""
    near_bit, upper = cf.well.Stabiliser(1.5, 0.2127, 0.165, 0.07), cf.well.Stabiliser(1.5, 0.2096, 0.165, 0.07)
    path = cf.well.WellPath.from_survey([0, 100, 300, 500], [0, 0, 40, 40], [20, 20, 20, 20])
    collars = cf.well.Collar(18, "NC46-65"), cf.well.Collar(60, "NC46-65")
    string = cf.well.DrillString([cf.well.Bit(0.2159), near_bit, collars[0], upper, collars[1], SOFT_PIPE])
    where = cf.well.Borehole(path, cf.well.HoleSection(500.0, 0.2159, 0.25))
    soft, rod = (cf.well.torque_and_drag(where, string, operation, mud=MUD, model=model) for model in ("soft", "rod"))
    sides = {side for start, end, force, side in rod.contacts if start == end > 495 and force > 9e3}
    assert sides == {"low", "high"}
    for name, scale in (
        ("hook_load", np.abs(soft.tension).max()),
        ("surface_torque", np.abs(soft.torque).max() or 1.0),
    ):
        if scale > 1.0:
            assert abs(getattr(rod, name) - getattr(soft, name)) < soft.model_error * scale


@pytest.mark.serial
@pytest.mark.parametrize(
    "inc, operation", [((60, 60, 60, 60), cf.well.TripIn()), ((0, 0, 90, 90), cf.well.TripOut())], ids=str
)
def test_a_soft_string_knows_what_clamps_and_sharp_bends_add(inc, operation):
    """A rod hangs on the axis of a hole that is inclined from the surface on; collars in a bend of 40 m radius."""
    path = cf.well.WellPath.from_survey([0, 100, 163, 300], inc, [0, 0, 0, 0])
    string = cf.well.DrillString([cf.well.Collar(60, "NC46-65"), SOFT_PIPE])
    where = cf.well.Borehole(path, cf.well.HoleSection(300.0, 0.2159, 0.25))
    given = {"mud": MUD, "depth": 180.0, "tol": 1e-3}
    soft, rod = (cf.well.torque_and_drag(where, string, operation, model=model, **given) for model in ("soft", "rod"))
    told, differs = soft.model_error * np.abs(soft.tension).max(), abs(rod.hook_load - soft.hook_load)
    assert 0.1 * told < differs < told
