"""Rods of drill-strings in bent holes, in motion from their equilibria, below pipe with friction at the wall."""

import math
from pathlib import Path

import numpy as np
import pytest
from ended_motions import Stopped, stop_at
from torsion_scenes import part

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.wall_friction import PipeFriction
from cosserat_fenicsx.models.action_terms import StationMotion

pytestmark = pytest.mark.serial
MESH = {"elements": 20, "degree": 2}


def well(length=300.0, turn=0.0, build=5.0):
    """Vertical for 100 m, then it builds 5 degrees every 30 m up to 40, and turns."""
    md = np.arange(0.0, length + 1, 10.0)
    pieces = np.clip((md - 100.0) / 30.0, 0.0, None)
    return cf.well.WellPath.from_survey(md, np.clip(build * pieces, 0.0, 40.0), turn * pieces, degrees=True)


def drilling(drive, *, friction=0.25, path=None, bit=None, parts=None, drag=None, hole=0.2159, **more):
    path = path or well(turn=3.0)
    collars, pipe = part(60.0, 0.1651, 0.05715, weight=1200.0), part(path.length - 60.0, 0.127, 0.10861, weight=250.0)
    section = cf.well.HoleSection(path.length, hole, friction)
    return cf.drilling.Drilling(
        cf.well.DrillString(parts or (collars, pipe)),
        cf.drilling.TopDrive(drive),
        bit,
        cf.well.Borehole(path, section, wall_stiffness=1e8),
        drag=drag and cf.drilling.ViscousDrag(drag, drag),
        **more,
    )


def imbalance(history):
    change = history.energy - history.work + history.dissipated
    return np.abs(change - change[0]).max() / max(history.energy.max(), history.dissipated.max())


@pytest.mark.parametrize("depth", [200.0, 25.0])
def test_at_rest_in_a_bent_hole_nothing_moves(depth):
    """The assembly, and the whole string, with the friction of the wall, which is not needed: to 1e-12 m."""
    mixed = cf.drilling.mixed_scene(drilling(0.0), depth)
    start = mixed.rest(**MESH)
    assert start.stable[0]
    history = cf.simulate(mixed.scene, 0.02, dt=2e-3, **MESH, start=start)
    for s in (1.0, 30.0, 60.0, 99.0):
        place = history.position(mixed.rod.at(s))
        assert np.abs(place - place[0]).max() < 1e-11
    assert history.kinetic.max() < 1e-9 * history.strain[0] and imbalance(history) < 1e-10
    pull = history.force(mixed.rod.start) @ mixed.above.down()
    assert pull == pytest.approx(mixed.above.tension, rel=1e-3)


CUTTING = cf.drilling.Cutting(0.108, 60e6, 0.6, 4, cf.drilling.Wear(60e6, 1.2e-3, 0.6))


@pytest.mark.parametrize(("law", "rock"), [(CUTTING, math.inf), (cf.drilling.Stribeck(0.3, 0.2, 2.0, 0.1), 5e7)])
def test_at_rest_on_a_bit_nothing_moves(law, rock):
    """Its weight on bit is that of the equilibrium; wear flats bear what they may."""
    bit = cf.drilling.BitOnRock(law, weight=20e3, inertia=10.0, rock_stiffness=rock)
    mixed = cf.drilling.mixed_scene(drilling(0.0, bit=bit), 200.0)
    history = cf.simulate(mixed.scene, 0.02, dt=2e-3, **MESH, start=mixed.rest(**MESH))
    for s in (1.0, 60.0, 100.0):
        place = history.position(mixed.rod.at(s))
        assert np.abs(place - place[0]).max() < 1e-8
    weight = mixed.as_drilling(history).weight_on_bit  # its first row has the first of all steps
    assert weight[1:] == pytest.approx(20e3, rel=1e-4) and weight.mean() == pytest.approx(20e3, rel=1e-4)
    assert imbalance(history) < 1e-10


LOBES = cf.drilling.Lobes(3, 2e-3, cf.drilling.Stribeck(1000.0, 600.0, 3.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "rock", "weight", "off"),
    [(cf.drilling.Cutting(0.108, 60e6, 0.6, 4), math.inf, 10e3, 5e-3), (CUTTING, math.inf, 20e3, 2e-2),
     (cf.drilling.RateLaw(3e6, 1000.0), math.inf, 10e3, 3e-2), (LOBES, 2e7, 20e3, 5e-3)],
)  # fmt: skip
def test_bits_at_a_rod_in_a_bend_are_those_of_the_axial_and_torsional_model(law, rock, weight, off):
    """Where the hole holds the string on its axis: speed of the bit to 1e-3 of its peak, torque and weight in the mean
    square, the energy that the bit takes, and the books."""
    parts = (part(30.0, 0.1651, 0.05715, weight=1000.0), part(120.0, 0.127, 0.10861))
    string = drilling(
        lambda t: 5.0 * (1 - math.cos(math.pi * min(t / 0.2, 1.0))),
        friction=0.0, path=well(150.0), parts=parts, hole=0.1652, drag=1.0,
        bit=cf.drilling.BitOnRock(law, weight=weight, inertia=20.0, rock_stiffness=rock),
    )  # fmt: skip
    mixed = cf.drilling.mixed_scene(string, 90.0)
    history = cf.simulate(mixed.scene, 0.4, dt=1e-3, elements=8, degree=2, start=mixed.rest(8, 2))
    found = mixed.as_drilling(history)
    whole = cf.drilling.simulate(string, 0.4, dt=2e-4, elements=300, model="axial and torsional")
    for name, norm, limit in (("bit_speed", np.max, 1.3e-3), ("surface_torque", _mean_square, 1e-3),
                              ("weight_on_bit", _mean_square, off)):  # fmt: skip
        true = np.interp(found.times - found.dt / 2, whole.times - whole.dt / 2, getattr(whole, name))
        assert norm(np.abs(getattr(found, name) - true)) < limit * np.abs(true).max(), name
    lost = ((found.weight_on_bit * found.bit_velocity + found.torque_on_bit * found.bit_speed) * found.dt).sum()
    assert lost == pytest.approx(whole.lost_at_bit[-1], rel=1e-2)
    assert history.dissipated[-1] > lost > 1000 and imbalance(history) < 1e-4


def _mean_square(values):
    return math.sqrt(np.mean(values**2))


def law_at_end(law, **bit):
    """The law of a bit at the end of a rod, at rest at the start."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, -1)), cf.Tube(0.2, 0.1), cf.Material(E=2e11, nu=0.3, density=7850.0))
    found = cf.drilling.BitAtEnd(rod.end, cf.drilling.BitOnRock(law, **bit)).delayed()
    still = np.zeros(3)
    found.begin(StationMotion(still, still, still, still, np.eye(3)))
    return found


def test_the_force_of_a_bit_is_that_of_its_law_on_the_compliance():
    """A sharp bit: N = K (cut + x_a/2) and a torque by the cut predicted; with wear flats nothing moves within them."""
    sharp, h, C = cf.drilling.Cutting(0.1, 50e6, 0.6, 4), 1e-3, np.array([[2e-9, 1e-9], [1e-9, 3e-7]])
    bit = law_at_end(sharp, weight=12e3)
    bit.start(h)
    free = np.array([1e-4, 2e-3])
    forces = bit.forces(free, C)
    moved = free - C @ forces
    assert forces[0] == pytest.approx(12e3 + sharp.axial_stiffness * moved[0] / 2, rel=1e-12)
    assert forces[1] == pytest.approx(sharp.torsional_stiffness * 12e3 / sharp.axial_stiffness, rel=1e-12)
    bit = law_at_end(cf.drilling.Cutting(0.1, 50e6, 0.6, 4, cf.drilling.Wear(60e6, 2e-3, 0.6)), weight=16e3)
    bit.start(h)
    free = C @ [15e3, 500.0]  # flats of 12 kN bear between 4 and 16 kN, friction holds the rotation
    assert bit.forces(free, C) == pytest.approx([15e3, 500.0], rel=1e-9)


def test_torsion_in_a_bend_that_holds_the_string_on_its_axis_is_that_of_the_straight_string():
    """Bit speed and surface torque while the bit sticks and slips, without friction at the wall: to 5e-4 of their
    peaks, of the string's waves and of its elements."""
    parts = (part(30.0, 0.1651, 0.05715), part(120.0, 0.127, 0.10861))
    string = drilling(
        lambda t: 5.0 * (1 - math.cos(math.pi * min(t / 0.2, 1.0))),
        friction=0.0, path=well(150.0), parts=parts, hole=0.1652, drag=1.0,
        bit=cf.drilling.BitOnRock(cf.drilling.Stribeck(1500.0, 900.0, 3.0), inertia=20.0),
    )  # fmt: skip
    mixed = cf.drilling.mixed_scene(string, 90.0)
    history = cf.simulate(mixed.scene, 0.3, dt=1e-3, elements=8, degree=2, start=mixed.rest(8, 2))
    found = mixed.as_drilling(history)
    middles = found.times - found.dt / 2
    for model, dt, delays in (("torsion", 1e-4, (0.0, 1e-4)), ("axial and torsional", 2.5e-4, (1.25e-4, 1.25e-4))):
        whole = cf.drilling.simulate(string, 0.3, dt=dt, model=model)
        for name, delay in zip(("bit_speed", "surface_torque"), delays, strict=True):
            true = np.interp(middles, whole.times - delay, getattr(whole, name))
            assert np.abs(getattr(found, name) - true).max() < 5e-4 * np.abs(true).max(), (model, name)
    assert found.bit_speed.max() > 5 and imbalance(history) < 5e-5


@pytest.mark.slow
def test_the_torque_of_rotation_of_a_whole_string_is_that_of_the_rod_at_rest():
    """Of a steady speed, less the known drag, which makes the start short: to 2e-3; and the hook load."""
    parts = (part(40.0, 0.1651, 0.05715, weight=1200.0), part(160.0, 0.127, 0.10861, weight=250.0))
    rate, speed, mesh = 8.0, 0.5, {"elements": 34, "degree": 2}
    string = drilling(lambda t: speed * min(2 * t, 1.0), path=well(200.0, turn=3.0), parts=parts, drag=rate)
    mixed = cf.drilling.mixed_scene(string, 30.0)
    history = cf.simulate(mixed.scene, 1.5, dt=2e-3, **mesh, start=mixed.rest(**mesh), save_every=0.05)
    found = mixed.as_drilling(history)
    torque = found.surface_torque[-8:].mean() - rate * speed * sum(x.rhoJ * x.length for x in string.segments)
    rest = cf.well.torque_and_drag(string.hole, string.string, cf.well.RotateOffBottom(), mud=cf.well.Mud(0.0),
                                   model="rod", tol=2e-3)  # fmt: skip
    assert torque == pytest.approx(rest.surface_torque, rel=2e-3)
    assert found.hook_load[-1] == pytest.approx(rest.hook_load, rel=1e-3)
    assert imbalance(history) < 5e-5


def test_the_friction_of_a_turning_pipe_is_that_of_the_soft_string():
    string = drilling(0.0, path=well(200.0, turn=3.0), parts=(part(200.0, 0.127, 0.10861, weight=250.0),))
    law, impedances = PipeFriction(string, np.linspace(0.0, 200.0, 41)), (np.full(39, 7e3), np.full(39, 300.0))
    for _ in range(2):  # the second time the tension is known
        _, torques = law.holding(np.zeros(39), np.full(39, 1e4), *impedances)
    rest = cf.well.torque_and_drag(string.hole, string.string, cf.well.RotateOffBottom(), mud=cf.well.Mud(0.0),
                                   model="soft")  # fmt: skip
    assert torques.sum() == pytest.approx(rest.surface_torque, rel=1e-3)


def node(friction):
    """The friction of one node of a pipe that lies in a horizontal hole: 90 m of 100 N/m."""
    path = cf.well.WellPath.from_survey([0.0, 90.0], [90, 90], [0, 0], degrees=True)
    string = drilling(0.0, path=path, parts=(part(90.0, 0.127, 0.10861),), friction=friction)
    return PipeFriction(string, np.array([0.0, 45.0, 90.0])), 100.0 * 90.0


def test_friction_at_a_node_is_a_vector_against_its_slip():
    mu, r = 0.3, 0.127 / 2
    law, load = node(mu)
    A, B = np.array([7e3]), np.array([50.0])  # impedances, axial and torsional
    turning = mu * load / math.hypot(1.0, mu)  # the wall bears the friction around the hole too
    F, G = law.holding(np.array([0.0]), np.array([0.9 * turning * r]), A, B)  # it sticks
    assert F[0] == 0 and G[0] == pytest.approx(0.9 * turning * r, rel=1e-12)
    F, G = law.holding(np.array([0.0]), np.array([2.0 * turning * r]), A, B)
    assert G[0] == pytest.approx(turning * r, rel=1e-12)
    law, _ = node(mu)
    F, _ = law.holding(np.array([5 * load]), np.array([0.0]), A, B)
    assert F[0] == pytest.approx(mu * load, rel=1e-12)
    for _ in range(30):  # the direction is that of the step before
        F, G = law.holding(np.array([5 * load]), np.array([2 * load * r]), A, B)
    V, W = (5 * load - F[0]) / A[0], (2 * load * r - G[0]) / B[0] * r
    assert F[0] * W == pytest.approx(G[0] / r * V, rel=1e-9)
    assert math.hypot(F[0], G[0] / r) == pytest.approx(mu * math.sqrt(load**2 - (G[0] / r) ** 2), rel=1e-9)


@pytest.mark.slow
def test_resume_below_a_pipe_that_rubs_gives_identical_digits(tmp_path, monkeypatch):
    """With a bit that cuts, below two motors whose pumps start."""
    bit = cf.drilling.BitOnRock(CUTTING, weight=20e3, inertia=10.0)
    flow = cf.signals.Table((0.0, 0.02), (0.0, 0.04))
    motor = cf.well.MudMotor(21.0, outer_diameter=0.1715, displacement=0.0268, leakage=1.4e-8, flow=flow)
    pipe = [part(x, 0.127, 0.10861, weight=250.0) for x in (42.0, 30.0, 126.0)]
    parts = (part(60.0, 0.1651, 0.05715, weight=1200.0), pipe[0], motor, pipe[1], motor, pipe[2])
    string = drilling(lambda t: min(40 * t, 4.0), bit=bit, parts=parts, mud=cf.well.Mud(1200.0))
    mixed = cf.drilling.mixed_scene(string, 200.0)
    start = mixed.rest(**MESH)
    given = MESH | {"dt": 1.5e-3, "start": start, "save_every": 6e-3}
    whole = cf.simulate(mixed.scene, 0.03, **given)
    stop_at(monkeypatch, 16 * 13, 0.0)  # the pipe allows steps of 0.1 ms
    with pytest.raises(Stopped):
        cf.simulate(mixed.scene, 0.03, folder=tmp_path / "run", **given)
    history = cf.resume(tmp_path / "run", mixed.scene)
    for name in ("times", "energy", "work", "dissipated"):
        assert np.array_equal(getattr(history, name), getattr(whole, name))
    for action in (mixed.above, mixed.bit):
        assert np.array_equal(history.far_end(action), whole.far_end(action), equal_nan=True)
    assert mixed.as_drilling(history).motor_speeds[-1].min() > 1.0


def test_refusals():
    free = cf.drilling.Drilling(cf.well.DrillString((part(200.0, 0.127, 0.10861),)), cf.drilling.TopDrive(0.0))
    mixed = cf.drilling.mixed_scene(free, 100.0)
    with pytest.raises(cf.SceneError, match="hole = None: expected a Borehole for `rest`.* start=1.0"):
        mixed.rest(**MESH)
    history = cf.simulate(mixed.scene, 0.002, dt=1e-3, elements=2, degree=2, start=1.0)
    with pytest.raises(
        cf.SceneError, match="action = .*expected an action of the scene that depends on earlier motion"
    ):
        history.far_end(mixed.scene.loads[0])
    with pytest.raises(cf.SceneError, match="history = .*expected a motion of the `scene`"):
        cf.drilling.mixed_scene(free, 100.0).as_drilling(history)


def test_a_scene_file_asks_for_a_rod(tmp_path):
    """The example of the docs: the same numbers as in Python, without books; refusals."""
    text = (Path(__file__).parents[1] / "docs" / "pipe_above.md").read_text().split("```toml\n")[1].split("```")[0]
    file = tmp_path / "rod.toml"
    file.write_text(text)
    found = cf.read(file)
    assert "with about 80% of that" in " ".join(str(found).split()) and found.mixed.depth == 200.0
    history = found.run(duration=0.02, progress=False)
    same = cf.drilling.mixed_scene(found.scene, 200.0).run(0.02, dt=2e-3, elements=16)
    assert np.array_equal(history.surface_torque, same.surface_torque) and np.isnan(history.balance).all()
    for old, new, words in (
        ('dt = "2 ms"', 'model = "torsion"', "simulate.model = 'torsion': expected 'auto' beside"),
        ('dt = "2 ms"', "elements = 100", "simulate.elements = 100: expected None beside"),
        ("wall_damping = 10.0", "wall_damping = -1.0", "wall_damping"),
    ):
        file.write_text(text.replace(old, new))
        with pytest.raises(cf.SceneError, match=words):
            cf.read(file)
    with pytest.raises(cf.SceneError, match="folder: expected none beside .rod"):
        found.run(folder=tmp_path / "run")
