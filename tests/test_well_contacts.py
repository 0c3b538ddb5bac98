"""Resultants of the wall's forces: forces at points told apart from pressure, through the public face and by moments.

The numbers in reference/rod_in_hole.json are of strong forms without any mesh, see test_rod_in_hole.py.
"""

import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from reference_wells import in_build_section

import cosserat_fenicsx as cf
from cosserat_fenicsx.numerics import lobatto_weights
from cosserat_fenicsx.well.rod.resultants import contacts_along
from cosserat_fenicsx.well.rod.rod_in_hole import solve_in_hole

pytestmark = pytest.mark.serial
KNOWN = json.loads((Path(__file__).parent / "reference" / "rod_in_hole.json").read_text(encoding="utf-8"))
LAYER = 0.25


def points_of(answer):
    return [contact for contact in answer.contacts if contact[0] == contact[1]]


def is_balanced(answer):
    """Whether forces at points and the distributed force are the wall's force, and so are all contacts."""
    solved = answer.solved
    distributed = float(answer.distributed_force @ solved.node_length)
    sums = sum(force for _, _, force, _ in points_of(answer)) + distributed, sum(x.force for x in solved.contacts)
    return sums == pytest.approx((solved.wall_force,) * 2, rel=1e-9)


@pytest.mark.parametrize("case", KNOWN["stiff build"], ids=lambda case: case["name"])
def test_a_build_section_through_the_public_face(case):
    given, alpha, found = case["input"], case["input"]["alpha"], in_build_section(case)
    lift = case["rod_length"] - given["D"] + case["lift_off_d_below_arc_end"]
    points = points_of(found)
    assert [md for md, *_ in points] == pytest.approx([case["free_span_2"], lift - case["free_span_1"], lift], abs=0.06)
    assert [x[2] for x in points] == pytest.approx([case[f"point_force_{k}"] for k in (3, 2, 1)], rel=1e-3)
    assert [x[3] for x in points] == ["high", "high", "low"] and is_balanced(found)
    assert not found.solved.rough and "ROUGH" not in str(found)
    # what is left is smooth: the pressure of an arc and of a straight hole, without a trace of the peaks
    assert found.side_force.max() > 6 * found.distributed_force.max()
    lying = given["w"] * math.sin(math.radians(alpha))
    below = (found.md > lift + 0.1) & (found.md < case["rod_length"] - 1)
    assert found.distributed_force[below] == pytest.approx(lying, rel=0.01)


@pytest.mark.parametrize("case", KNOWN["bottom-hole assembly"][:2], ids=["free", "thrust"])
def test_an_assembly_through_the_public_face(case):
    exact, length, r = case["exact_kirchhoff"], 60.0, 0.1
    path = cf.well.WellPath.from_survey([0, length + 20], [case["inclination_deg"]] * 2, [0, 0])
    wide = 2 * (r + case["clearance"])
    stiff = cf.Stiffness((1e12,) * 2, 1e12, (case["EI"],) * 2, case["EI"])
    bit = cf.well.Bit(wide, length=1e-3, body_diameter=2 * r, mass=case["w"] / 9.81)
    string = cf.well.DrillString([bit, cf.well.Component(None, stiff, case["w"], r)])
    found = cf.well.torque_and_drag(
        cf.well.Borehole(path, cf.well.HoleSection(length + 20, wide, 0.0)), string, cf.well.Static(weight=case["WOB"]),
        mud=cf.well.Mud(1e-3), depth=length, model="rod",
    )  # fmt: skip
    *_, tangency, at_bit = points_of(found)
    assert length - tangency[0] == pytest.approx(exact["arc_length_to_tangency"], abs=1e-3)
    assert tangency[2] == pytest.approx(exact["reaction_at_tangency"], rel=1e-4)
    assert at_bit[2] == pytest.approx(exact["bit_side_force"], rel=1e-4) and is_balanced(found)


#: A slick assembly at 3 degrees with 250 kN, of small slopes (a beam without a mesh): EI, weight, clearance, distance
#: from the bit to the tangency, and force there.
SLICK = (1.7e7, 2050.0, 0.0508, 17.919140838675947, 1639.0117496314479)


@pytest.mark.parametrize("tol", [1e-4, 1e-6])
def test_a_force_behind_which_the_string_rises(tol):
    """In a stiff wall the contact splits behind it: the force is not that of the first part alone, 8 % more."""
    EI, weight, clearance, at, force = SLICK
    length, path = 120.0, cf.well.WellPath.from_survey([0, 140], np.radians([3.0, 3.0]), [0, 0], degrees=False)
    solved = solve_in_hole(
        path, [length], cf.Stiffness((1e12,) * 2, 1e12, (EI, EI), EI), weight, 0.1, radius=0.1 + clearance,
        bottom_tension=-250e3, rings=[(length, 0.0, 0.1)], tol=tol,
    )  # fmt: skip
    *_, tangency, at_bit = (x for x in solved.contacts if x.start == x.end)
    assert length - tangency.start == pytest.approx(at, abs=2e-3)
    assert abs(tangency.force - force) < min(tangency.error, 5e-4 * force) and tangency.error < 5e-3 * force
    assert at_bit.force == pytest.approx(283.51, rel=5e-3) and not solved.rough


#: An assembly at 88 degrees with 250 kN and three stabilisers: distances from the bit and clearances, m; forces at the
#: lower stabiliser and at the bit (a beam of small slopes in a rigid wall, 6000 elements).
STABILISED = ((29.0, 0.003), (11.0, 0.003), (2.0, 0.0016)), (3536.43, 4185.51)


def test_forces_of_rings_next_to_each_other():
    """No wall is between them whose softness would count: the next wall is 18 m away."""
    (rings, forces), (EI, weight, clearance, *_) = STABILISED, SLICK
    length, path = 120.0, cf.well.WellPath.from_survey([0, 140], [88.0, 88.0], [0, 0])
    solved = solve_in_hole(
        path, [length], cf.Stiffness((1e12,) * 2, 1e12, (EI, EI), EI), weight, 0.1, radius=0.1 + clearance,
        bottom_tension=-250e3, rings=[*((length - d, room, 0.1) for d, room in rings), (length, 0.0, 0.1)],
    )  # fmt: skip
    *_, stabiliser, at_bit = (x for x in solved.contacts if x.start == x.end)
    for found, force in zip((stabiliser, at_bit), forces, strict=True):
        assert abs(found.force - force) < found.error < 5e-3 * force and found not in solved.rough


@pytest.mark.parametrize("case", KNOWN["stiff build"][:2], ids=lambda case: case["name"])
def test_a_smaller_tol_makes_forces_at_points_more_accurate(case):
    """The wall is made stiffer, and the contact splits behind the forces."""
    given, alpha = case["input"], math.radians(case["input"]["alpha"])
    md = np.cumsum([0, given["h"], given["R"] * alpha, given["D"] + 50.0])
    path = cf.well.WellPath.from_survey(md, np.degrees([0, 0, alpha, alpha]), [0, 0, 0, 0])
    solved = solve_in_hole(
        path, [case["rod_length"]], cf.Stiffness((1e12,) * 2, 1e12, (given["EI"],) * 2, given["EI"]), given["w"], 0.06,
        radius=0.06 + given["r"], friction=given["mu"], slip=(float(given["c"]), 0.0), bottom_tension=given["T0"],
        hinge=(0, 1, 0), has_arm=False, wall_stiffness=1e12, elements=2048,
    )  # fmt: skip
    points = [x for x in solved.contacts if x.start == x.end]
    for point, k in zip(points, (3, 2, 1), strict=True):
        exact = case[f"point_force_{k}"]
        assert abs(point.force - exact) < min(2e-4 * exact, 3 * point.error) and point.error < 2e-2 * exact


def test_errors_of_forces_at_points_are_with_the_contacts():
    case = KNOWN["stiff build"][0]
    found = in_build_section(case)
    for point, k in zip(points_of(found), (3, 2, 1), strict=True):
        assert abs(point.force - case[f"point_force_{k}"]) < point.error < 5e-3 * point.force
    assert all(np.isnan(x.error) for x in found.contacts if not x.at_point)
    assert pickle.loads(pickle.dumps(point)).error == point.error and len(point) == 4


def test_a_force_near_the_end_of_its_contact_says_so():
    """The part that is left behind it is shorter than what its peak and the rise behind it need."""
    EI, weight, clearance, _, force = SLICK
    length, path = 60.0, cf.well.WellPath.from_survey([0, 140], np.radians([3.0, 3.0]), [0, 0], degrees=False)
    solved = solve_in_hole(
        path, [length], cf.Stiffness((1e12,) * 2, 1e12, (EI, EI), EI), weight, 0.1, radius=0.1 + clearance,
        bottom_tension=-250e3, rings=[(length, 0.0, 0.1)],
    )  # fmt: skip
    tangency = [x for x in solved.contacts if x.start == x.end][-2]
    assert tangency in solved.rough and abs(tangency.force - force) < tangency.error < force


def wall(pressure, start=20.0, end=60.0, h=0.3):
    """What `contacts_along` finds of a pressure as a function of the arc length, and the sum of the pressure."""
    nodes = np.array([0.0, 0.5 - math.sqrt(0.05), 0.5 + math.sqrt(0.05), 1.0])
    ends = 20 + h * np.arange(-4, round((end - 20) / h) + 4)
    s = ends[:-1, None] + h * nodes
    sizes = np.broadcast_to(h * lobatto_weights(nodes), s.shape)
    p = np.where((s >= start) & (s <= end), pressure(s), 0.0)
    contacts, regular = contacts_along(s, sizes, p, np.zeros(s.shape), LAYER)
    return contacts, s, regular, sizes, float((p * sizes).sum())


def bump(s, at, force):
    """The pressure of an elastic wall on a beam that is pressed against it by a force at a point."""
    x = np.abs(s - at) / LAYER
    return force / (2 * LAYER) * np.exp(-x) * (np.cos(x) + np.sin(x))


def test_a_peak_inside_a_contact_is_a_force():
    """A peak on a pressure that grows and jumps; that the wall is elastic makes it 7 % larger than the force."""
    contacts, s, regular, sizes, total = wall(lambda s: 300 + 4 * (s - 20) + 200 * (s > 50) + bump(s, 35.0, 400.0))
    (point,) = (x for x in contacts if x.start == x.end)
    assert point.start == pytest.approx(35.0, abs=0.02) and point.force == pytest.approx(400, rel=0.1)
    inside = (s > 21) & (s < 59)
    assert np.abs(regular - 300 - 4 * (s - 20) - 200 * (s > 50))[inside].max() < 60
    assert point.force + (regular * sizes).sum() == pytest.approx(total, rel=1e-12)
    assert sum(x.force for x in contacts) == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize("h", [0.1, 2.4], ids=["the gap is seen", "a coarse mesh"])
def test_the_edge_of_a_wider_part_presses_alone(h):
    """A force at the edge, a gap, and pressure beyond it: the moments tell them apart where the mesh does not."""
    contacts, s, regular, sizes, total = wall(
        lambda s: np.where(s < 20.01, 100.0 / h, np.where(s < 22.2, 0.0, 5.0)), h=h, start=19.999, end=57.5
    )
    given = 100.0 / h * sizes[np.isclose(s, 20.0)].sum()
    edge, between, *_ = contacts
    assert edge.start == pytest.approx(20.0, abs=1e-9) and edge.force == pytest.approx(given, rel=0.05)
    assert between.start == pytest.approx(22.2, abs=0.25) and (regular < 8).all()
    points = sum(x.force for x in contacts if x.start == x.end)
    assert points + (regular * sizes).sum() == pytest.approx(total, rel=1e-12)


def test_a_force_that_is_small_beside_the_pressure():
    """At the end of a contact."""
    contacts, s, regular, sizes, total = wall(lambda s: 500 + bump(s, 60.0, 600.0), h=0.1)
    between, end = contacts
    assert end.force + (regular * sizes).sum() == pytest.approx(total, rel=1e-12)
    assert end.start == pytest.approx(60, abs=0.2) and 300 < end.force < 400


def test_forces_that_the_mesh_does_not_resolve_are_told():
    """Those of a mesh that is fine enough for a rough hook load."""
    path = cf.well.WellPath.from_survey([0, 400, 1000, 2000], [0, 0, 60, 60], [0, 0, 40, 40])
    stiff = cf.Stiffness((1.35e8,) * 2, 7e8, (1228200.0,) * 2, 9.4e5)
    string = cf.well.DrillString([cf.well.Component(None, stiff, 241.13, 0.0635)])
    found = cf.well.torque_and_drag(
        cf.well.Borehole(path, cf.well.HoleSection(2000, 0.216, 0.25)), string, cf.well.TripIn(), model="rod", tol=5e-2
    )
    rough = found.solved.rough
    assert rough and "are ROUGH" in found.details() and is_balanced(found)
    assert {x.start for x in rough} <= {x.start for x in found.solved.contacts if x.start == x.end}


def test_resultants_of_any_pressure_add_up():
    """Of rough pressures with gaps and jumps, on elements of any length, in layers of any length."""
    rng, nodes = np.random.default_rng(0), np.array([0.0, 0.5 - math.sqrt(0.05), 0.5 + math.sqrt(0.05), 1.0])
    found = 0
    for _ in range(300):
        count = int(rng.integers(1, 200))
        h = np.full(count, 10 ** rng.uniform(-2, 1)) * rng.uniform(0.5, 1.5, count)
        s = np.cumsum(h)[:, None] + h[:, None] * (nodes - 1)
        sizes = h[:, None] * lobatto_weights(nodes)
        values = np.repeat(np.maximum(rng.normal(rng.uniform(-1, 1), 1, 3 * count + 1), 0), rng.integers(1, 9))
        pressure = (values[: 3 * count + 1] * rng.uniform(0.5, 1.5, 3 * count + 1))[
            np.arange(count)[:, None] * 3 + np.arange(4)
        ]
        contacts, regular = contacts_along(s, sizes, pressure, np.zeros(s.shape), 10 ** rng.uniform(-1.5, 0.5))
        points, total = [x.force for x in contacts if x.start == x.end], (pressure * sizes).sum()
        assert sum(x.force for x in contacts) == pytest.approx(total, rel=1e-12)
        assert sum(points) + (regular * sizes).sum() == pytest.approx(total, rel=1e-12) and regular.min() >= 0
        assert all(x.force > -1e-12 * total and x.start <= x.end for x in contacts)
        found += len(points)
    assert found > 300


def test_torque_does_not_alternate_at_the_edge_of_a_collar():
    """The wall's force is concentrated there: torque falls by its friction, and all the way down."""
    path = cf.well.WellPath.from_survey([0, 100, 300, 500], [0, 0, 40, 40], [20, 20, 20, 20])
    string = cf.well.DrillString(
        [cf.well.Collar(60, outer_diameter=0.2, inner_diameter=0.07), cf.well.DrillPipe(size="5 in 19.50 lb/ft")]
    )
    where = cf.well.Borehole(path, cf.well.HoleSection(500.0, 0.2159, 0.25))
    found = cf.well.torque_and_drag(
        where, string, cf.well.RotateOffBottom(), mud=cf.well.Mud(1200.0), model="rod", tol=1e-5
    )
    assert np.diff(found.torque).max() < 5e-3 * found.surface_torque
    assert found.torque[0] == pytest.approx(found.surface_torque, rel=1e-9)
