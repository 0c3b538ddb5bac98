"""The protocol of actions: permanent loads, loads along rods, memory,
data that depend on the position, traits found from UFL."""

from dataclasses import dataclass

import numpy as np
import pytest
import ufl

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.walls import straight_wall
from cosserat_fenicsx.models.traits import traits_of
from cosserat_fenicsx.scene import action

SECTION = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 1.0), 0.8, mass=1.0, inertia=(1e-8, 1e-8, 2e-8))
ROD = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), SECTION, name="beam")


def test_permanent_loads_come_first():
    """Weight first, then the end force: the path begins under the
    weight, and ends where both applied together would."""
    weight = cf.LineForce(ROD, (0, 0, -2.0), permanent=True)
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [weight, cf.Force(ROD.end, (0, 1.5, 1.0))])
    both = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.LineForce(ROD, (0, 0, -2.0)), cf.Force(ROD.end, (0, 1.5, 1.0))])
    alone = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.LineForce(ROD, (0, 0, -2.0))])
    for options in ({"elements": 4}, {"tol": 1e-6}, {"elements": 4, "model": "spatial"}):
        path = cf.solve(scene, [0.0, 1.0], **options)
        together = cf.solve(both, [1.0], **options).displacement(ROD.end)[-1]
        np.testing.assert_allclose(path.displacement(ROD.end)[1], together, atol=2e-7)
        np.testing.assert_allclose(
            path.displacement(ROD.end)[0], cf.solve(alone, [1.0], **options).displacement(ROD.end)[0], atol=2e-7
        )
        np.testing.assert_allclose(path.force(ROD.start), [(0, 0, -2.0), (0, 1.5, -1.0)], atol=1e-7)
    assert path.model == "spatial" and "determinate" in cf.solve(scene, [1.0]).model


def test_loads_that_change_along_a_rod(tmp_path):
    """A triangular load q s/L on a cantilever: 11 q L^4/(120 EI), by a function, a table, a file; and pieces."""
    q = 1e-3
    (tmp_path / "load.csv").write_text(f"# s, fx, fy, fz\n0, 0, 0, 0\n1.0, 0, 0, {q}\n")
    kinds = [
        cf.signals.Along(lambda s: (0, 0, q * s)),
        cf.signals.AlongTable([0, 1.0], [(0, 0, 0), (0, 0, q)]),
        cf.signals.AlongTable(tmp_path / "load.csv"),
    ]
    for force in kinds:
        path = cf.solve(cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.LineForce(ROD, force)]), [1.0], elements=2)
        assert path.displacement(ROD.end)[0, 2] == pytest.approx(11 * q / 120, rel=1e-5)
        np.testing.assert_allclose(path.force(ROD.at(0.5))[0, 2], q * (1 - 0.25) / 2, rtol=1e-9)
    half = cf.LineForce(ROD, cf.signals.AlongPieces([(0.3, (0, 0, 0)), (0.7, (0, 0, q))]))
    path = cf.solve(cf.Scene([ROD], [cf.Clamp(ROD.start)], [half]), [1.0], elements=2)
    assert path.moment(ROD.start)[0, 1] == pytest.approx(-q * 0.4 * 0.5, rel=1e-9)
    for bad in (lambda: cf.signals.Along(3), lambda: cf.signals.AlongTable([1, 0], [(0, 0, 0)] * 2),
                lambda: cf.signals.AlongPieces([(0.0, (0, 0, 1))]),
                lambda: cf.signals.AlongTable("no.csv"),
                lambda: cf.LineForce(ROD, cf.signals.Along(lambda s: 1 / 0))):  # fmt: skip
        with pytest.raises(cf.SceneError):
            bad()


@dataclass(frozen=True)
class Slider(cf.PointAction):
    """A spring k that slips at the force limit; its memory is the distance slipped (along x)."""

    station: object
    stiffness: float
    limit: float

    scaled = False
    memory = (action.scalar(0.0, "m"),)

    def data(self, rod, s):
        return (action.scalar(self.stiffness, "N/m"), action.scalar(self.limit, "N"), action.vector((1.0, 0, 0), "1"))

    @staticmethod
    def _force(point, k, limit, along, slipped):
        return ufl.max_value(ufl.min_value(k * (ufl.dot(point.u, along) - slipped), limit), -limit)

    @staticmethod
    def work(point, test, k, limit, along, slipped):
        return -Slider._force(point, k, limit, along, slipped) * ufl.dot(along, test.phi_r)

    @staticmethod
    def evolve(point, k, limit, along, slipped):
        return [ufl.dot(point.u, along) - Slider._force(point, k, limit, along, slipped) / k]


def test_an_action_that_remembers():
    """A rod and a slider in parallel under cyclic load: the hysteresis of
    an elastic, ideally plastic element in closed form."""
    EA, k, limit = 100.0, 50.0, 1.0
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), cf.Stiffness((EA, EA), EA, (1.0, 1.0), 1.0, mass=1.0))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [Slider(rod.end, k, limit), cf.Force(rod.end, (4.0, 0, 0))])
    factors = [0.5, 1.0, 0.5, 0.0, -0.5, -1.0, 0.0, 1.0]
    slipped, expected = 0.0, []
    for eta in factors:
        F = 4.0 * eta
        u = (F + k * slipped) / (EA + k)
        for sign in (1, -1):
            if sign * k * (u - slipped) > limit:
                u = (F - sign * limit) / EA
                slipped = u - sign * limit / k
        expected.append(u)
    for options in ({"elements": 2}, {"tol": 1e-6}, {"elements": 2, "model": "spatial"}):
        path = cf.solve(scene, factors, **options)
        np.testing.assert_allclose(path.displacement(rod.end)[:, 0], expected, rtol=1e-9)
    assert abs(expected[3]) > 1e-3  # a displacement remains after unloading


@dataclass(frozen=True)
class RoundWall(cf.LineAction):
    """A wall around a circular axis, whose nearest point is computed at every iteration."""

    rod: object
    radius: float
    clearance: float
    stiffness: float

    scaled, at_nodes = False, True

    def data(self, rod, s):
        return self.refreshed(rod, s, rod.curve.position(s))

    def refreshed(self, rod, s, r):
        out = r / np.linalg.norm(r, axis=1, keepdims=True)
        return (
            action.vector(self.radius * out, "m from origin"),
            action.vector(np.cross((0, 1.0, 0), out), "1"),
            action.scalar(np.full(len(r), self.clearance), "m"),
            action.scalar(np.full(len(r), self.stiffness), "N/m^2"),
        )

    work = staticmethod(straight_wall)


@dataclass(frozen=True)
class Pressure(cf.LineAction):
    """A force that stays normal to a rod."""

    rod: object
    pressure: float

    follows = True
    work = staticmethod(lambda point, test, f: ufl.dot(point.R * f, test.phi_r))

    def data(self, rod, s):
        return (
            action.vector(
                self.pressure * rod.curve.position(s) / np.linalg.norm(rod.curve.position(s), axis=1)[:, None], "N/m"
            ),
        )


def test_data_that_follow_the_position():
    """A quarter of a ring, expanded by a pressure p against a round
    wall: p - EA u/R^2 = kp (u - clearance) for u << R."""
    R, c, EA, p, kp = 10.0, 1e-4, 90.0, 1e-4, 2.0
    section = cf.Stiffness((50.0, 50.0), EA, (1.0, 1.0), 0.7)
    rod = cf.Rod(cf.Arc((0, 0, 0), (R, 0, 0), np.pi / 2, axis=(0, 1.0, 0)), section)
    guides = [
        guide
        for station, tangent in ((rod.start, (0, 0, 1.0)), (rod.end, (1.0, 0, 0)))
        for guide in (
            cf.Roller(station, tangent),
            cf.Roller(station, (0, 1.0, 0)),
            cf.Prescribed(station, rotation=(0, 0, 0)),
        )
    ]
    scene = cf.Scene([rod], guides, [Pressure(rod, p), RoundWall(rod, R, c, kp)])
    for model in ("planar", "spatial"):
        path = cf.solve(scene, [1.0], elements=8, model=model)
        u = (p + kp * c) / (kp + EA / R**2)
        assert u > c
        for s in (0.0, 0.3, 0.5):
            place = path.position(rod.at(s * rod.length))[0]
            assert np.linalg.norm(place) - R == pytest.approx(u, rel=1e-4)


@dataclass(frozen=True)
class Lookup(cf.LineAction):
    """A bed about the x axis, whose force is evaluated from the position."""

    rod: object
    stiffness: float

    scaled = False
    work = staticmethod(lambda point, test, f: ufl.dot(f, test.phi_r))

    def data(self, rod, s):
        return self.refreshed(rod, s, rod.curve.position(s))

    def refreshed(self, rod, s, r):
        return (action.vector(-self.stiffness * np.asarray(r) * (0, 1.0, 1.0), "N/m"),)


FREE = cf.Rod(
    cf.Line((0, 0, 0), (1.0, 0, 0)),
    cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=1.0, inertia=(1e-3, 1e-3, 2e-3)),
)


def slid(duration, k=100.0, limit=1.0, steps=100000):
    """Displacement of a mass of 1 kg at a slider, under 3 sin(2 pi t) N."""
    x = v = slipped = 0.0
    dt = duration / steps
    for i in range(steps):
        force = max(min(k * (x - slipped), limit), -limit)
        slipped = x - force / k
        v += dt * (3 * np.sin(2 * np.pi * i * dt) - force)
        x += dt * v
    return x


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_memory_and_refreshed_data_in_motion(scheme):
    scene = cf.Scene(
        [FREE], [], [Slider(FREE.at(0.5), 100.0, 1.0), cf.Force(FREE.at(0.5), cf.signals.Sine((3.0, 0, 0), 1.0))]
    )
    exact = slid(2.0)
    for options in ({"tol": 1e-3}, {"dt": 0.005}):
        history = cf.simulate(scene, 2.0, scheme=scheme, elements=1, degree=2, **options)
        assert history.displacement(FREE.at(0.5))[-1, 0] == pytest.approx(exact, abs=1e-3 * abs(exact) + 5e-4)
    pushed = [cf.InitialVelocity(FREE, linear=(0, 0, 1.0))]
    history = cf.simulate(
        cf.Scene([FREE], [], [Lookup(FREE, 4.0)], velocities=pushed), 0.7, dt=0.005, scheme=scheme, elements=2
    )
    assert history.displacement(FREE.end)[-1, 2] == pytest.approx(np.sin(1.4) / 2, rel=3e-5)


@dataclass(frozen=True)
class LateDamper(cf.PointAction):
    """A force against the velocity at the end of the step before, which is its memory."""

    station: object
    damping: float

    scaled = False
    memory = (action.vector((0.0, 0, 0), "m/s"),)

    def data(self, rod, s):
        return (action.scalar(self.damping, "N s/m"),)

    @staticmethod
    def work(point, test, damping, before):
        return -damping * ufl.dot(before, test.phi_r)

    @staticmethod
    def evolve(point, damping, before):
        return [point.r_t]


@pytest.mark.serial
@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_a_memory_of_velocities(scheme):
    """A mass of 1 kg with v' = -c v: it comes to (1 - exp(-c))/c after 1 s, up to the delay of one step."""
    c, dt = 2.0, 0.001
    pushed = [cf.InitialVelocity(FREE, linear=(1.0, 0, 0))]
    scene = cf.Scene([FREE], [], [LateDamper(FREE.at(0.5), c)], velocities=pushed)
    history = cf.simulate(scene, 1.0, scheme=scheme, dt=dt, elements=1, degree=2)
    assert history.displacement(FREE.at(0.5))[-1, 0] == pytest.approx((1 - np.exp(-c)) / c, abs=2 * c * dt)


def test_motions_without_a_place_for_memory():
    scene = cf.Scene([FREE], [], [Slider(FREE.end, 100.0, 1.0)])
    with pytest.raises(cf.SceneError, match="steps back in time: expected actions without memory"):
        cf.simulate(scene, 0.1, dt=0.05, scheme="triple-jump", elements=1)
    clamped = cf.Scene([FREE], [cf.Clamp(FREE.start)], [Slider(FREE.end, 100.0, 1.0), cf.Force(FREE.end, (1.0, 0, 0))])
    with pytest.raises(cf.SceneError, match="simulate.start: actions with a memory"):
        cf.simulate(clamped, 0.1, dt=0.05, start=1.0, elements=1)


@pytest.mark.serial
@pytest.mark.parametrize(("rows", "peak"), [(70, 56), (100, 81), (400, 201), (400, 324)])
def test_no_peak_of_a_long_table_is_missed(rows, peak):
    """It lies between all Gauss points of the first meshes; the tip moves by F a^2 (3 - a)/6, averaged over it."""
    s, values, F = np.linspace(0, 1, rows), np.zeros((rows, 3)), 1e-4
    values[peak, 2] = F * (rows - 1)
    a, variance = s[peak], 1 / (6 * (rows - 1) ** 2)
    tip = F * (3 * (a**2 + variance) - (a**3 + 3 * a * variance)) / 6
    section = cf.Stiffness((1e9, 1e9), 1e9, (1.0, 1.0), 1.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.LineForce(rod, cf.signals.AlongTable(s, values))])
    for accuracy, options in ((1e-7, {"tol": 1e-4}), (3e-2, {"elements": 3, "degree": 2}),
                              (1e-4, {"elements": 3, "model": "spatial"})):  # fmt: skip
        path = cf.solve(scene, [1.0], **options)
        assert path.displacement(rod.end)[0, 2] == pytest.approx(tip, rel=accuracy)
        assert path.force(rod.start)[0, 2] == pytest.approx(F, rel=1e-6)


def test_a_function_may_change_between_calls():
    size = [1e-3]
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.LineForce(ROD, cf.signals.Along(lambda s: (0, 0, size[0])))])
    first = cf.solve(scene, [1.0], elements=4).displacement(ROD.end)[0, 2]
    size[0] = 2e-3
    assert cf.solve(scene, [1.0], elements=4).displacement(ROD.end)[0, 2] == pytest.approx(2 * first, rel=1e-6)


def test_what_ufl_tells():
    station = ROD.end
    told = {
        cf.Force(station, (0, 0, 1)): (True, True, False, True),
        cf.Moment(station, (0, 1, 0)): (True, True, False, True),
        cf.EccentricForce(station, (0, 0, 1), (0.1, 0)): (False, True, False, True),
        cf.FollowerForce(station, (0, 0, 1)): (False, False, False, True),
        cf.FollowerMoment(station, (0, 0, 1)): (False, True, False, True),
        cf.LineForce(ROD, (0, 0, 1)): (True, True, False, True),
        cf.Weight(): (True, True, False, True),
        cf.Foundation(ROD, 1.0): (False, False, False, True),
        cf.Spring(station, 1.0, 1.0): (False, False, False, True),
        cf.Dashpot(station, 1.0): (False, False, True, True),
        cf.Drag(ROD, 1.0): (False, False, True, True),
        cf.Wall(ROD, (0, 0, 0), (1, 0, 0), 0.1): (False, False, False, True),
        cf.PointMass(station, 1.0): (True, True, False, True),
    }
    for load, expected in told.items():
        traits = traits_of(load, [ROD])
        assert (traits.dead, traits.known_force, traits.rates, traits.flat) == expected, load

    @dataclass(frozen=True)
    class Own(cf.PointAction):
        station: object
        work = staticmethod(lambda point, test, F: ufl.dot(F, test.phi_r))

        def data(self, rod, s):
            return (action.vector((0, 0, 1.0), "N"),)

    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [Own(station)])
    assert cf.solve(scene, [0.1], elements=2).model == "determinate"  # a user-defined dead force is recognised as dead

    @dataclass(frozen=True)
    class Sideways(cf.PointAction):
        station: object
        work = staticmethod(lambda point, test: point.u[0] * test.phi_r[1] + 0.1 * test.phi_r[0])

    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [Sideways(station), cf.Force(station, (0, 0, 0.1))])
    path = cf.solve(scene, [0.1], elements=2)
    assert path.model == "spatial" and any("Sideways" in why for why in path.why)
    assert not traits_of(Sideways(station), [ROD]).turns


def test_actions_in_scene_files(tmp_path):
    (tmp_path / "load.csv").write_text("0, 0, 0, 0\n1.0, 0, 0, 1e-3\n")
    (tmp_path / "scene.toml").write_text("""
[[rods]]
name = "beam"
curve = { type = "Line", start = [0, 0, 0], end = [1, 0, 0] }
section = { type = "Stiffness", shear = [1e6, 1e6], axial = 1e6, bending = [1.0, 1.0], torsion = 1.0, mass = 1.0 }
[[supports]]
type = "Clamp"
station = "beam.start"
[[loads]]
type = "LineForce"
rod = "beam"
force = { type = "AlongTable", s = "load.csv" }
permanent = true
[[loads]]
type = "Spring"
station = "beam.end"
stiffness = 10.0
[[loads]]
type = "Force"
station = "beam.end"
force = [0, 0, 0.01]
""")
    scene = cf.read(tmp_path / "scene.toml").scene
    beam = scene.rods[0]
    path = cf.solve(scene, [0.0, 1.0], elements=4)
    # the end moves by (11 q/120 + F/3)/(1 + k/3)
    np.testing.assert_allclose(
        path.displacement(beam.end)[:, 2], [(11e-3 / 120 + f / 3) / (1 + 10 / 3) for f in (0, 0.01)], rtol=1e-4
    )
    with pytest.raises(cf.SceneError, match="did you mean 'Spring'"):
        (tmp_path / "wrong.toml").write_text((tmp_path / "scene.toml").read_text().replace('"Spring"', '"Sprig"'))
        cf.read(tmp_path / "wrong.toml")
