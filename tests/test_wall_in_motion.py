"""Rods that touch the wall of a hole in motion, against closed forms: impact, sliding, rolling, invariants."""

from itertools import pairwise

import numpy as np
import pytest
from conftest import COMM
from ended_motions import Stopped, stop_at
from moving_scenes import drift
from mpi4py import MPI
from scipy.integrate import simpson

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.walls import HoleRing, HoleWall
from cosserat_fenicsx.dynamics.contact import NodalContact
from cosserat_fenicsx.models.collocated import Collocated
from cosserat_fenicsx.models.moving import Moving

SCHEMES = ("momentum", "energy", "generalised-alpha")
STEEL = cf.Material(E=206e9, nu=0.3, density=7850.0)
#: radius of the rod, clearance in the hole, m; measured depth of its start, m; gravity, m/s^2
A, C, BEGIN, G = 0.085, 0.02, 5.0, 9.81
VERTICAL = cf.well.WellPath.from_survey([0, 20], [0, 0], [0, 0])
HORIZONTAL = cf.well.WellPath.from_survey([0, 20], [90, 90], [0, 0])
SMALL = {"elements": 2, "degree": 2}


def thick_rod(path):
    """A rod of 1 m on the axis of a hole, almost rigid, and its mass, kg."""
    rod = cf.Rod(cf.Line(path.position(BEGIN), path.position(BEGIN + 1)), cf.Circle(2 * A), STEEL, name="rod")
    return rod, STEEL.density * np.pi * A**2


def in_hole(path, linear, angular=(0, 0, 0), loads=(), **wall):
    """(rod, scene) of the rod with initial velocities of its start's rigid motion, and a wall."""
    rod, _ = thick_rod(path)
    wall = HoleWall(rod, path, A + C, A, begins=BEGIN, **wall)
    return rod, cf.Scene(
        [rod], [], [wall, *loads], velocities=[cf.InitialVelocity(rod, linear=linear, angular=angular)]
    )


def resting(path, stiffness, linear=(0, 0, 0), angle=0.0, **wall):
    """(rod, scene) of the rod on the low side of a horizontal hole in its weight, which is turned by an angle."""
    rod, mass = thick_rod(path)
    deep = C + mass * G / stiffness
    down = np.array([0, np.sin(angle), np.cos(angle)])
    place = path.position(BEGIN) + deep * np.array([0, 0, 1.0])
    rod = cf.Rod(cf.Line(place, place + path.tangent(BEGIN)), cf.Circle(2 * A), STEEL, name="rod")
    walls = HoleWall(rod, path, A + C, A, begins=BEGIN, stiffness=stiffness, **wall)
    loads = [walls, cf.LineForce(rod, tuple(mass * G * down))]
    return rod, cf.Scene([rod], [], loads, velocities=[cf.InitialVelocity(rod, linear=linear)]), deep


@pytest.mark.serial
@pytest.mark.parametrize("scheme", SCHEMES)
def test_an_impact_is_half_a_vibration_on_the_wall(scheme):
    """Penetration v sqrt(m/k) and duration pi sqrt(m/k); the rod flies back as fast."""
    stiffness, v = 1e6, 0.5
    rod, scene = in_hole(VERTICAL, (v, 0, 0), stiffness=stiffness)
    time = np.sqrt(thick_rod(VERTICAL)[1] / stiffness)
    history = cf.simulate(scene, 0.15, dt=2.5e-4, scheme=scheme, **SMALL)
    x, speed = history.position(rod.start)[:, 0], history.velocity(rod.start)[:, 0]
    assert x.max() - C == pytest.approx(v * time, rel=1e-3)
    out = np.flatnonzero(np.diff(np.sign(x - C)))
    first, last = (np.interp(C, *sorted_pair(x[k : k + 2], history.times[k : k + 2])) for k in out[:2])
    assert last - first == pytest.approx(np.pi * time, rel=2e-3)
    assert speed[out[1] + 5] == pytest.approx(-v, rel=1e-4 if scheme != "generalised-alpha" else 5e-3)


def sorted_pair(x, t):
    order = np.argsort(x)
    return x[order], t[order]


@pytest.mark.serial
def test_damping_takes_what_hunt_and_crossley_say():
    """Restitution 1 - (2/3) damping v for small ones; the loss is booked."""
    damping, v = 0.05, 0.4
    rod, scene = in_hole(VERTICAL, (v, 0, 0), stiffness=1e6, damping=damping)
    history = cf.simulate(scene, 0.12, dt=5e-4, **SMALL)
    back = -history.velocity(rod.start)[-1, 0] / v
    assert 1 - back == pytest.approx(2 / 3 * damping * v, rel=0.03)
    assert history.dissipated[-1] == pytest.approx(history.kinetic[0] * (1 - back**2), rel=1e-3)


@pytest.mark.serial
def test_without_friction_energy_and_angular_momentum_stay():
    """Oblique impacts of a spinning rod on a stiff wall, in steps as long as an impact."""
    for scheme in ("momentum", "energy"):
        rod, scene = in_hole(VERTICAL, (0.9, 0.3, 0), (0, 0, 3.0), stiffness=1e9)
        history = cf.simulate(scene, 0.2, dt=1e-3, scheme=scheme, **SMALL)
        assert np.count_nonzero(np.diff(np.sign(history.work))) > 4  # several impacts
        assert np.abs(history.balance).max() < (1e-10 if scheme == "energy" else 1e-8) * history.kinetic[0]
        assert np.abs(history.dissipated).max() < 1e-9
        assert np.ptp(history.angular_momentum[:, 2]) < 1e-9 * np.abs(history.angular_momentum).max()


def test_friction_and_damping_are_no_source_of_energy():
    """Nor in the books of steps as long as an impact, where the schemes err: the balance alone shows that."""
    for scheme in SCHEMES:
        rod, scene = in_hole(VERTICAL, (0.9, 0.3, 0.4), (0.3, -0.5, 30.0), stiffness=1e9, friction=3.0, damping=0.05)
        history = cf.simulate(scene, 0.1, dt=1e-3, scheme=scheme, **SMALL)
        assert np.diff(history.dissipated).min() > -1e-12 * history.kinetic[0], scheme
        assert history.dissipated[-1] > 0.3 * history.kinetic[0]


@pytest.mark.serial
@pytest.mark.parametrize("scheme", SCHEMES)
def test_sliding_is_stopped_by_coulombs_friction(scheme):
    """It stops after v/(mu g), at v^2/(2 mu g), and stays there exactly."""
    mu, v = 0.3, 0.2
    rod, scene, _ = resting(HORIZONTAL, 1e8, linear=(v, 0, 0), friction=mu)
    stop = v / (mu * G)
    history = cf.simulate(scene, 2 * stop, dt=stop / 100, scheme=scheme, **SMALL)
    x = history.position(rod.start)[:, 0] - rod.curve.position(0.0)[0]
    sliding = history.times < 0.97 * stop
    expected = v * history.times - mu * G * history.times**2 / 2
    np.testing.assert_allclose(x[sliding], expected[sliding], atol=2e-3 * v * stop)
    assert x[-1] == pytest.approx(v * stop / 2, rel=2e-3)
    after = x[history.times > 1.1 * stop]
    assert np.ptp(after) < 1e-3 * x[-1]
    assert history.dissipated[-1] == pytest.approx(history.kinetic[0], rel=2e-2)


@pytest.mark.serial
def test_a_rod_rolls_in_the_hole_without_slip():
    """A cylinder that rolls in a trough: omega^2 = 2 g/(3 (R - a)), and nothing is dissipated."""
    stiffness, angle = 1e8, 0.1
    rod, scene, deep = resting(HORIZONTAL, stiffness, angle=angle, friction=0.3)
    period = 2 * np.pi * np.sqrt(1.5 * deep / G) * (1 + angle**2 / 16)
    history = cf.simulate(scene, 2 * period, dt=period / 200, **SMALL)
    y = history.position(rod.start)[:, 1]
    assert y.max() == pytest.approx(deep * np.sin(2 * angle), rel=1e-3)
    assert np.abs(y[200]) < 2e-3 * y.max()  # back after a period
    assert np.abs(y[100]) == pytest.approx(y.max(), rel=1e-3)
    spin, speed = history.angular_velocity(rod.start)[:, 0], history.velocity(rod.start)
    assert np.abs(A * spin - speed[:, 1]).max() < 0.02 * np.abs(speed[:, 1]).max()
    assert np.abs(history.dissipated).max() < 1e-6 * np.ptp(history.kinetic)


@pytest.mark.serial
def test_friction_does_not_act_where_nothing_touches():
    rod, scene = in_hole(VERTICAL, (0, 0, 1.0), (0, 0, 5.0), friction=0.5)
    history = cf.simulate(scene, 0.1, dt=1e-2, **SMALL)
    assert drift(history.linear_momentum) < 1e-12 and drift(history.angular_momentum) < 1e-12


@pytest.mark.serial
def test_a_ring_touches_alone():
    rod, mass = thick_rod(VERTICAL)
    ring = HoleRing(rod.at(0.5), VERTICAL, C, A, stiffness=1e5, friction=0.2, begins=BEGIN)
    scene = cf.Scene([rod], [], [ring], velocities=[cf.InitialVelocity(rod, linear=(0.5, 0, 0))])
    history = cf.simulate(scene, 0.16, dt=1e-3, **SMALL)
    deepest = history.position(rod.at(0.5))[:, 0].max() - C
    assert deepest == pytest.approx(0.5 * np.sqrt(mass / 1e5), rel=1e-3)


@pytest.mark.serial
def test_a_ring_in_gauge_is_met_in_steps_as_asked():
    """The direction of its force turns far in a step, while damping makes the force large: few are halved."""
    off = np.array([2e-4, 2e-4, 0.0])
    rod = cf.Rod(cf.Line(*(VERTICAL.position(BEGIN + x) + off for x in (0, 1))), cf.Circle(2 * A), STEEL, name="rod")
    ring = HoleRing(rod.end, VERTICAL, 0.0, A, stiffness=1e8, friction=0.25, begins=BEGIN, damping=20.0)
    velocity = cf.InitialVelocity(rod, linear=(0.5, 0, 0), angular=(0, 0, 5.0))
    history = cf.simulate(cf.Scene([rod], [], [ring], velocities=[velocity]), 0.02, dt=1e-3, **SMALL)
    assert history.steps[-1] < 25  # 20 but for those that are halved
    assert np.diff(history.dissipated).min() >= -1e-12 and history.dissipated[-1] > 0.01 * history.energy[0]


@pytest.mark.ranks
@pytest.mark.parametrize("elements", [4, 12])  # 9 nodes; 25, whose nearest neighbours alone respond
def test_all_numbers_of_ranks_agree(elements):
    def run(comm):
        rod, scene = in_hole(VERTICAL, (0.9, 0.3, 0), (0, 0, 3.0), stiffness=1e9, friction=0.3, damping=0.1)
        history = cf.simulate(scene, 0.05, dt=1e-3, elements=elements, degree=2, comm=comm)
        return history.position(rod.end)[-1], history.energy[-1]

    (place, energy), (alone, energy_alone) = run(COMM), run(MPI.COMM_SELF)
    np.testing.assert_allclose(place, alone, atol=1e-9)
    assert energy == pytest.approx(energy_alone, rel=1e-8)


@pytest.mark.serial
@pytest.mark.parametrize("scheme", SCHEMES)
def test_it_is_continued_to_the_same_digits(scheme, tmp_path, monkeypatch):
    _, scene = in_hole(VERTICAL, (0.9, 0.3, 0), (0, 0, 3.0), stiffness=1e9, friction=0.3, damping=0.1)
    asked = {"duration": 0.08, "dt": 1e-3, "scheme": scheme, **SMALL}
    whole = cf.simulate(scene, **asked)
    stop_at(monkeypatch, 50, 0.0, Collocated if scheme == "generalised-alpha" else Moving)
    with pytest.raises(Stopped):
        cf.simulate(scene, **asked, folder=tmp_path / "motion")
    monkeypatch.undo()
    history = cf.resume(tmp_path / "motion", scene)
    for name in ("kinetic", "strain", "work", "dissipated"):
        assert getattr(history, name).tobytes() == getattr(whole, name).tobytes(), name


@pytest.mark.serial
@pytest.mark.parametrize(("wrong", "word"), [
    ({"friction": -0.1}, "friction"),
    ({"damping": -1.0}, "damping"),
    ({"damping": np.inf}, "damping"),
    ({"stiffness": 0.0}, "stiffness"),
    ({"kinetic": 1.2}, "kinetic"),
    ({"speed": 0.0}, "speed"),
    ({"contact_radius": 0.2}, "less than the radius of the tube"),
])  # fmt: skip
def test_bad_numbers_are_refused(wrong, word):
    rod, _ = thick_rod(VERTICAL)
    with pytest.raises(cf.SceneError, match=word):
        HoleWall(rod, VERTICAL, **{"radius": A + C, "contact_radius": A, **wrong})


@pytest.mark.serial
def test_equilibria_and_other_schemes_refuse_it():
    rod, scene = in_hole(VERTICAL, (0.5, 0, 0))
    with pytest.raises(cf.SceneError, match="HoleWall acts in motions alone"):
        cf.solve(scene, [1.0])
    with pytest.raises(cf.SceneError, match="expected no walls"):
        cf.simulate(scene, 0.1, dt=0.01, scheme="triple-jump")
    with pytest.raises(cf.SceneError, match="HoleWall"):
        cf.simulate(scene, 0.1, dt=0.01, model="planar")


@pytest.mark.serial
def test_forces_of_walls_are_told(tmp_path_all):
    """The weight of a rod that slides, and friction against it; from memory, a folder and a file alike."""
    mu, v = 0.3, 0.2
    rod, scene, _ = resting(HORIZONTAL, 1e8, linear=(v, 0, 0), friction=mu)
    wall, weight = scene.loads[0], thick_rod(HORIZONTAL)[1] * G
    history = cf.simulate(scene, 0.02, dt=5e-4, **SMALL)
    found = history.wall_forces(wall)
    assert found.normal.shape == (41, 5) and np.isnan(found.normal[0]).all()
    np.testing.assert_allclose(found.s, [0, 0.25, 0.5, 0.75, 1])
    assert found.normal[1:].sum(axis=1) == pytest.approx(weight, rel=1e-3)
    np.testing.assert_allclose(found.along[1:], -mu * found.normal[1:], rtol=1e-6)
    assert np.abs(found.around[1:]).max() < 1e-3 * weight
    cf.simulate(scene, 0.01, dt=5e-4, **SMALL, folder=tmp_path_all / "motion")
    stored = cf.resume(tmp_path_all / "motion", duration=0.02)  # with the wall that the folder says
    np.testing.assert_allclose(stored.wall_forces(stored.scene.loads[0]).along, found.along, rtol=1e-9)
    with pytest.raises(cf.SceneError, match="a wall of the scene"):
        history.wall_forces(scene.loads[1])


@pytest.mark.serial
def test_friction_is_weaker_in_slip():
    """v' = -mu(v) g until it stops; and a weight at tan = 0.25 moves it from rest where friction is 0.2, not 0.3."""
    mu, kinetic, speed, v = 0.3, 0.4, 0.05, 0.2
    rod, scene, _ = resting(HORIZONTAL, 1e8, linear=(v, 0, 0), friction=mu, kinetic=kinetic, speed=speed)
    v0 = np.linspace(0, v, 4001)
    rate = 1 / (mu * (kinetic + (1 - kinetic) * np.exp(-v0 / speed)) * G)
    stop, path = (simpson(values, x=v0) for values in (rate, rate * v0))
    history = cf.simulate(scene, 1.2 * stop, dt=stop / 400, **SMALL)
    x = history.position(rod.start)[:, 0] - rod.curve.position(0.0)[0]
    assert x[-1] == pytest.approx(path, rel=5e-3)
    for friction, slides in ((0.3, False), (0.2, True)):
        rod, scene, _ = resting(HORIZONTAL, 1e8, friction=friction, kinetic=0.5)
        pull = cf.Force(rod.start, (0.25 * thick_rod(HORIZONTAL)[1] * G, 0, 0))
        scene = cf.Scene([rod], [], [*scene.loads, pull])
        moved = cf.simulate(scene, 0.1, dt=1e-3, **SMALL).displacement(rod.start)[-1, 0]
        assert (moved > 1e-3) == slides and (slides or abs(moved) < 1e-6)


def test_joined_rods_are_one():
    """A pipe that falls, slides and stops, with two contacts at each joint, and another wall at one of its nodes."""
    path, axis = cf.well.WellPath.from_survey([0, 400], [90, 90], [0, 0]), np.array([1.0, 0, 0])
    found = []
    for parts in (1, 3):
        ends = path.position(100) + 0.03 * np.array([0, 0, 1]) + np.outer(np.linspace(0, 60, parts + 1), axis)
        rods = [cf.Rod(cf.Line(*ends[i : i + 2]), cf.Tube(0.127, 0.1), STEEL, name=f"{i}") for i in range(parts)]
        walls = [HoleWall(rod, path, 0.1135, 0.0635, stiffness=1e7, friction=1.5, begins=100 + 60 * i / parts)
                 for i, rod in enumerate(rods)]  # fmt: skip
        ring = HoleRing(rods[0].at(12.0), path, 0.03, 0.08, stiffness=1e6, friction=1.5, begins=100)
        begun = [cf.InitialVelocity(rod, (0.5, 0.3, 0), 5 * axis, about=tuple(ends[0])) for rod in rods]
        joints = [cf.Joint(a.end, b.start) for a, b in pairwise(rods)]
        scene = cf.Scene(rods, [], [*walls, ring, cf.Weight((0, 0, G))], joints, velocities=begun)
        history = cf.simulate(scene, 0.07, dt=1e-3, elements=15 // parts, degree=2)
        assert history.steps[-1] == 70
        found.append((history.position(rods[-1].end)[-1], history.linear_momentum[-1], history.dissipated[-1]))
    for one, three in zip(*found, strict=True):
        np.testing.assert_allclose(three, one, rtol=1e-6)


@pytest.mark.serial
def test_a_pipe_at_rest_stays_there():
    """On the low side, from its equilibrium, in steps in which waves pass five nodes: no step is halved."""
    path = cf.well.WellPath.from_survey([0, 400], [90, 90], [0, 0])
    start = path.position(100) + np.array([0, 0, 0.0499])
    rod = cf.Rod(cf.Line(start, start + (30, 0, 0)), cf.Tube(0.127, 0.1), STEEL, name="pipe")
    sizes = {"path": path, "radius": 0.1135, "contact_radius": 0.0635, "stiffness": 1e6, "begins": 100}
    loads, mesh = [cf.Spring(rod.start, 1e3, 1e3), cf.Weight((0, 0, G))], {"elements": 15, "degree": 2}
    lying = cf.solve(cf.Scene([rod], [], [cf.well.TubeWall(rod, **sizes), *loads]), [1.0], **mesh)
    scene = cf.Scene([rod], [], [HoleWall(rod, friction=0.3, **sizes), *loads])
    history = cf.simulate(scene, 0.06, dt=1e-3, scheme="generalised-alpha", start=lying, **mesh)
    assert history.steps[-1] == 60
    assert np.abs(history.position(rod.end) - history.position(rod.end)[0]).max() < 1e-10


@pytest.mark.serial
@pytest.mark.parametrize(
    ("lengths", "degree", "elements"),
    [((500,), 1, 160), ((500,), 2, 80), ((500,), 3, 53), ((100,), 2, 120), ((60, 40), 4, 40)],
)
def test_the_response_to_contact_is_known(lengths, degree, elements, monkeypatch):
    """Pipes that turn and slide, with many nodes in contact: the compliance foretells their motion, and so four
    iterations are enough. (With nodes inside elements taken for ends of elements it was off by a tenth.) Where waves
    pass many nodes in a step, those that are loaded together move each other; pipes that are not joined do not."""
    path, missing, accept = cf.well.WellPath.from_survey([0, 800], [90, 90], [0, 0]), [], NodalContact.accept
    axis, rods, walls, begun, md = np.array([1.0, 0, 0]), [], [], [], 100.0
    for length in lengths:
        start = path.position(md) + np.array([0, 0, 0.0501])
        rods.append(cf.Rod(cf.Line(start, start + length * axis), cf.Tube(0.127, 0.1), STEEL, name=f"pipe {md:g}"))
        walls.append(HoleWall(rods[-1], path, 0.1135, 0.0635, stiffness=1e7, friction=0.25, begins=md))
        begun.append(cf.InitialVelocity(rods[-1], (0.5, 0, 0), 10 * axis, about=tuple(start)))
        md += length + 5
    scene = cf.Scene(rods, [], [*walls, cf.Weight((0, 0, G))], velocities=begun)
    monkeypatch.setattr(NodalContact, "accept", lambda self: (missing.append(self.c.missing), accept(self)))
    history = cf.simulate(scene, 0.02, dt=2e-3, elements=elements, degree=degree)
    assert len(missing) == history.steps[-1] == 10 and max(missing) < 0.01
    assert history.iterations.sum() <= 40
