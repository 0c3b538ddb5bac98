"""Rods that touch planes, cylinders and spheres, without and with friction: closed forms and solutions of boundary
value problems by another program."""

import dataclasses
import math
import warnings

import numpy as np
import pytest
from extensions.hardening import Hardening
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve, newton

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
RIGID = (math.inf, math.inf)


def rope(EI):
    """A section that only bends and twists."""
    return cf.Stiffness(shear=RIGID, axial=math.inf, bending=(EI, EI), torsion=EI)


def test_a_heavy_rod_is_lifted_from_a_plane(truth):
    """Its end is raised and held level: M^2 = 2 w EI h; the other numbers are those of a collocation in the suspended
    length."""
    w, EI, h, a = 10.0, 2.0, 0.5, 0.01
    rod = cf.Rod(cf.Line((0, 0, a), (3.0, 0, a)), rope(EI))
    floor = cf.Plane((0, 0, 0), (0, 0, 1), contact_radius=a)
    lifted = cf.Prescribed(rod.start, displacement=(0, 0, h), rotation=(0, 0, 0))
    path = cf.solve(cf.Scene([rod], [lifted], [floor, cf.LineForce(rod, (0, 0, -w), permanent=True)]), 1.0, tol=1e-4)
    lifting = np.linalg.norm(path.moment(rod.start)[-1])
    truth("rod lifted from a plane, moment at its level end", lifting, math.sqrt(2 * w * EI * h), 1e-5, most=1e-6)
    touch = path.contacts(floor)
    np.testing.assert_allclose(touch.force[-1], (0, 0, 3.0 * w - 11.378592833499974), atol=1e-5)
    lift_off = touch.s[np.argmax(touch.pressure[-1])]  # the reaction that is concentrated there
    assert lift_off == pytest.approx(1.679164392759859, abs=np.diff(touch.s).max())
    assert -1e-5 * h < touch.gap.min() < 0
    assert "Plane" in str(touch) and "touches from" in str(touch)


@pytest.mark.parametrize("obstacle", [cf.Sphere, cf.Cylinder])
def test_a_cantilever_on_a_post(obstacle):
    """Lowered by d, it is held up by a force 3 EI d/a^3; nodes beside the post alone do not see it."""
    a, d = 0.7, 1e-4
    rod = cf.Rod(cf.Line((0, 0, 0.07), (1, 0, 0.07)), rope(1.0))
    axis = {"direction": (0, 1, 0)} if obstacle is cf.Cylinder else {}
    post = obstacle((a, 0, 0), radius=0.05, contact_radius=0.02, **axis)
    scene = cf.Scene([rod], [cf.Prescribed(rod.start, displacement=(0, 0, -d), rotation=(0, 0, 0))], [post])
    path = cf.solve(scene, 1.0, elements=40)
    assert path.model == "planar" and path.force(rod.start)[-1, 2] == pytest.approx(3 * d / a**3, rel=1e-4)
    assert path.contacts(post).force[-1, 2] == pytest.approx(3 * d / a**3, rel=1e-4)


class TestNothingPassesUnseen:
    """A rod that swings onto a thin post between two nodes."""

    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), rope(1.0), name="arm")
    post = cf.Cylinder((0.53, 0, -0.05), (0, 1, 0), 0.002, contact_radius=0.002)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [post, cf.Force(rod.end, (0, 0, -0.6))])

    def test_on_a_mesh_that_is_given(self, monkeypatch):
        monkeypatch.setattr(cf.Cylinder, "breaks", lambda self, rod: ())
        with pytest.raises(cf.NotConverged, match="rod 'arm' passes into Cylinder by .* expected more elements there"):
            cf.solve(self.scene, 1.0, elements=2)
        post = cf.Cylinder((0.556, 0, -0.073), (0, 1, 0), 0.02, contact_radius=0.0)
        scene = cf.Scene([self.rod], [cf.Clamp(self.rod.start)], [post, cf.Force(self.rod.end, (0, 0, -0.6))])
        with pytest.raises(cf.NotConverged, match="rod 'arm' passes into Cylinder"):
            cf.buckling(scene, load_factor=1.0, elements=2)

    @pytest.mark.slow
    def test_on_a_mesh_that_is_chosen(self):
        path = cf.solve(self.scene, 1.0, tol=1e-2)
        touch = path.contacts(self.post)
        assert touch.force[-1, 2] > 0.3 and touch.gap[-1].min() > -2e-5

    @pytest.mark.parametrize("dt", [1e-3, 2e-2])
    def test_in_motion(self, dt):
        """A rod that falls on the post, which it meets between two nodes, or leaps over in one step."""
        section = cf.Stiffness((1e4, 1e4), 1e4, (1.0, 1.0), 1.0, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
        rod = cf.Rod(cf.Line((0, 0, 0.1), (1, 0, 0.1)), section)
        scene = cf.Scene([rod], [], [self.post], velocities=[cf.InitialVelocity(rod, linear=(0, 0, -8.0))])
        with pytest.raises(cf.NotConverged, match="passes into Cylinder by .* expected more elements there") as raised:
            cf.simulate(scene, 0.06, dt=dt, elements=2, degree=2, model="planar")
        assert raised.value.path.position(rod.at(0.53))[-1, 2] > -0.06


def pulled_bar(EA=2e4):
    """(scene, its plane, w, mu, EA, F) of a bar on a rough plane."""
    w, mu, F = 10.0, 0.5, 20.0
    rod = cf.Rod(cf.Line((0, 0, 0), (8.0, 0, 0)), cf.Stiffness((1e4, 1e4), EA, (2.0, 2.0), 2.0))
    floor = cf.Plane((0, 0, 0), (0, 0, 1), friction=mu, contact_radius=0.0)
    loads = [floor, cf.LineForce(rod, (0, 0, -w), permanent=True), cf.Force(rod.end, (F, 0, 0))]
    return cf.Scene([rod], [cf.Prescribed(rod.start, rotation=(0, 0, 0))], loads), floor, w, mu, EA, F


def test_friction_is_that_of_a_long_step():
    """The first step moves the end of a soft bar so far that slopes at both of its ends are compared; between elements
    the edge of slip has a node with a part of its bound."""
    scene, floor, *_ = pulled_bar(EA=200.0)
    path = cf.solve(scene, 0.5, elements=40, model="planar", steps=cf.StepControl(first=0.5))
    assert path.steps[-1] < 8
    np.testing.assert_allclose(path.contacts(floor).force[:, 0], -10.0, rtol=1e-7)


def test_a_rod_that_an_obstacle_does_not_act_on():
    """It lies beyond a rough plane and moves along it, in many steps."""
    how = {"elements": 10, "steps": cf.StepControl(smallest=5e-3)}
    scene, floor, *_, F = pulled_bar()
    (rod,), load_factors = scene.rods, np.linspace(0.0, 1.0, 41)
    below = cf.Rod(cf.Line((0, 1, -1), (8, 1, -1)), rod.section, name="below")
    path = cf.solve(
        dataclasses.replace(
            scene,
            rods=[rod, below],
            supports=[*scene.supports, cf.Clamp(below.start)],
            loads=[dataclasses.replace(floor, rod=rod), *scene.loads[1:], cf.Force(below.end, (F, 0, 0))],
        ),
        load_factors,
        **how,
    )
    alone = cf.solve(scene, load_factors, **how)
    np.testing.assert_allclose(path.displacement(rod.end), alone.displacement(rod.end), rtol=0, atol=1e-9)
    np.testing.assert_allclose(path.displacement(below.end)[:, 0], load_factors * F * 8 / 2e4, rtol=1e-9, atol=1e-12)


def test_the_estimate_covers_a_release():
    """Meshes that tol chooses do not follow the edge of slip, which goes through elements: they agree by chance."""
    scene, _, w, mu, EA, F = pulled_bar()
    path = cf.solve(scene, [1.0, 0.25], tol=1e-2, model="planar")
    left = F**2 / (2 * EA * mu * w) * (1 - 0.75**2 / 2)
    error = abs(path.displacement(scene.rods[0].end)[1, 0] / left - 1)
    assert 1e-6 < error <= path.by_mesh[0, 1] < 30 * error


def test_a_bar_is_pulled_and_released(truth):
    """An elastic bar on a rough plane under F, then 0: it slides over F/(mu w), its end moves by F^2/(2 EA mu w), and
    half of that remains. The edge of slip is at an end of an element under F; on its way back it is inside elements,
    and pushes what is at its bound before it, unless it goes back in one step, to an end of an element, or elements are
    linear, in which nothing overshoots: then it has to be at an end of an element in the last state alone."""
    scene, floor, w, mu, EA, F = pulled_bar()
    rod = scene.rods[0]
    path = cf.solve(scene, [0.5, 1.0, 0.0], elements=40, model="planar")
    moved = F**2 / (2 * EA * mu * w)
    ends = path.displacement(rod.end)[:, 0]
    truth("bar pulled over a rough plane, end", ends[:2], np.array([moved / 4, moved]), 1e-6, of=moved)
    truth("bar pulled over a rough plane and released, end", ends[2], moved / 2, 1e-6, of=moved, most=4e-4,
          why="the edge of slip goes back through elements")  # fmt: skip
    assert path[2].iterations < 3000
    steps, how = [1.0, *np.linspace(1, 0, 8)[1:]], {"steps": cf.StepControl(adaptive=False), "model": "planar"}
    by_lines = cf.solve(scene, steps, elements=160, degree=1, **how).displacement(rod.end)[-1, 0]
    truth("bar pulled over a rough plane and released, linear elements", by_lines, moved / 2, 1e-6, of=moved)
    at_once = cf.solve(scene, [1.0, 0.0], elements=40, model="planar", steps=cf.StepControl(adaptive=False))
    left = at_once.displacement(rod.end)[1, 0]
    truth("bar pulled over a rough plane and released in one step, end", left, moved / 2, 1e-6, of=moved)
    touch = path.contacts(floor)
    np.testing.assert_allclose(touch.force[:, 0] / F, [-0.5, -1, 0], atol=1e-8)
    assert touch.sticks[1, touch.s < 3.9].all() and not touch.sticks[1, touch.s > 4.1].any()


@pytest.mark.slow
def test_a_stiff_rope_on_a_bollard(truth):
    """Half a turn around a cylinder: it slips at T_2/T_1, less than exp(pi mu), because it is stiff (1.8347 alone) and
    because friction acts on its surface, at a from its axis (shooting, with the stiff parts at both ends)."""
    mu, R, EI, half, tail, a, ratio = 0.2, 0.1, 0.001, math.pi / 2, 0.4, 0.01, 1.7383388423482828
    ends = [np.array((s * (R + a), 0, 0)) for s in (-1, 1)]
    down = np.array((0, 0, -tail))
    arc = cf.Rod(cf.Arc((0, 0, 0), ends[0], 2 * half, (0, 1, 0)), rope(EI))
    one, two = cf.Rod(cf.Line(ends[0] + down, ends[0]), rope(EI)), cf.Rod(cf.Line(ends[1], ends[1] + down), rope(EI))
    straight = cf.Actuation(arc, curvature=arc.curve.frame(0.0).T @ (0, -1 / (R + a), 0), permanent=True)
    pulls = [cf.Force(at, (0, 0, -1.0), permanent=True) for at in (one.start, two.end)]
    bollard = cf.Cylinder((0, 0, 0), (0, 1, 0), R, friction=mu, contact_radius=a)
    joints = [cf.Joint(one.end, arc.start), cf.Joint(arc.end, two.start)]
    scene = cf.Scene([one, arc, two], [], [bollard, straight, *pulls, cf.Force(two.end, (0, 0, -1.0))], joints)
    with pytest.raises(cf.NotConverged, match="Friction may not hold more") as told:
        cf.solve(scene, [ratio * (1 + k) - 1 for k in (-1e-3, 1e-3)], elements=20, model="planar")
    held = told.value.path.load_factors == ratio * (1 - 1e-3) - 1
    assert told.value.path.contacts(bollard).force[held, 2] == pytest.approx([ratio * (1 - 1e-3) + 1], rel=1e-6)
    slips = (told.value.path.load_factors.max() + 1 + ratio * (1 + 1e-3)) / 2  # between the last one and that refused
    truth("stiff capstan, ratio of tensions at which it slips", slips, ratio, 1e-3)


def slipping(w, mu, R, EI, pulled, ends):
    """The force at the second end of a heavy rope on a cylinder with which it slips, by the one at the first; ends:
    heights of both, m. Friction acts at the rope's axis, where what touches has no shear and the cylinder's curvature;
    beyond it are elasticas, and where they begin the cylinder presses with the shear force there."""

    def tail(force, height):
        """Where it lifts off, rad above the cylinder's axis, and the vertical force there: shot up from its end."""

        def climbed(size):
            def bends(u, y):
                return y[1], (force + w * u) * math.sin(y[0]) / EI, math.cos(y[0])

            def touches(u, y):
                return y[1] - 1 / R

            touches.terminal = True
            start = math.exp(size), 0.0, height
            found = solve_ivp(bends, (0, 9), start, "DOP853", events=touches, rtol=1e-9, atol=1e-30)
            return found.y[0, -1], force + w * found.t[-1], found.y[2, -1] - R * math.sin(found.y[0, -1])

        return climbed(brentq(lambda size: climbed(size)[2], -200, -1, xtol=1e-9))[:2]

    def left(force):
        (one, first), (two, last) = tail(pulled, ends[0]), tail(force, ends[1])
        start, around = first * (math.cos(one) + mu * math.sin(one)), (one, math.pi - two)

        def grows(angle, T):
            return R * w * np.cos(angle) + mu * (T + R * w * np.sin(angle))

        T = solve_ivp(grows, around, [start], "DOP853", rtol=1e-10, atol=1e-10).y[0, -1]
        return last * (math.cos(two) - mu * math.sin(two)) - T

    return newton(left, pulled * math.exp(math.pi * mu), tol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("elements", "nodes", "asked"), [(50, 200, 1e-3), (200, 800, 1e-4)])
def test_a_heavy_rope_on_a_bollard(truth, elements, nodes, asked):
    """Euler and Eytelwein's problem with weight and some stiffness: half a turn, and tails of which the second is
    pulled, against a spring that takes what friction does not hold."""
    w, mu, R, EI, tail, k, most = 10.0, 0.2, 0.5, 2.5e-3, 0.4, 1e4, 18.0
    string = solve_ivp(lambda a, h: R * np.cos(a) + mu * (h + R * np.sin(a)), (0, math.pi), [1.0], rtol=1e-10)
    limp = slipping(w, mu, R, EI / 10, w * (1 - tail), (-tail, -tail)) / w + tail
    assert [string.y[0, -1], limp] == pytest.approx([2.4272361044286725] * 2, rel=5e-5)  # of another program
    ends = [np.array((side * R, 0, 0)) for side in (-1, 1)]
    down = np.array((0, 0, -tail))
    arc = cf.Rod(cf.Arc((0, 0, 0), ends[0], math.pi, (0, 1, 0)), rope(EI))
    one, two = cf.Rod(cf.Line(ends[0] + down, ends[0]), rope(EI)), cf.Rod(cf.Line(ends[1], ends[1] + down), rope(EI))
    straight = cf.Actuation(arc, curvature=arc.curve.frame(0.0).T @ (0, -1 / R, 0), permanent=True)
    pulled = w * (1 - tail)
    bollard = cf.Cylinder((0, 0, 0), (0, 1, 0), R, friction=mu, contact_radius=0.0)
    loads = [bollard, straight, *(cf.LineForce(rod, (0, 0, -w), permanent=True) for rod in (one, arc, two)),
             *(cf.Force(at, (0, 0, -pulled), permanent=True) for at in (one.start, two.end)),
             cf.Spring(two.end, k, direction=(0, 0, 1)), cf.Force(two.end, (0, 0, -most))]  # fmt: skip
    joints = [cf.Joint(one.end, arc.start), cf.Joint(arc.end, two.start)]
    path = cf.solve(cf.Scene([one, arc, two], [], loads, joints), 1.0, elements=elements, model="planar")
    touch, heights = path.contacts(bollard), [path.position(at)[-1, 2] for at in (one.start, two.end)]
    on_arc = touch.rod == arc.name
    assert np.count_nonzero(touch.pressure[-1, on_arc]) > 0.95 * nodes and not touch.sticks[-1].any()
    found = pulled + most + k * path.displacement(two.end)[-1, 2] - w * heights[1]
    exact = slipping(w, mu, R, EI, pulled, heights) - w * heights[1]
    truth(f"heavy capstan, {nodes} nodes, tension at which it slips", found, exact, asked)


def test_a_ring_stands_on_a_plane(truth):
    """A heavy elastic ring, flat where it touches: shooting in the height, half the contact and the tension there."""
    w, EI, L = 1.0, 0.005, 1.0
    R = L / (2 * math.pi)

    def lifted(half, tension):
        rise = L / 2 - half  # from where it lifts off to the top

        def bends(s, y):
            cos, sin = math.cos(y[0]), math.sin(y[0])
            return y[1], (sin * tension + cos * w * (rise - s)) / EI, cos, sin

        return solve_ivp(bends, (0, rise), (0.0, 0.0, half, 0.0), "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]

    half, tension = fsolve(lambda z: lifted(*z)[[0, 2]] - (math.pi, 0.0), (0.03, -0.1), xtol=1e-12)
    _, curvature, _, height = lifted(half, tension)
    assert (2 * half, height) == pytest.approx((0.05684271639005901, 0.2398117590074941), rel=1e-7)  # another program
    one, two = (cf.Rod(cf.Arc((0, 0, R), (0, 0, 0), turn, (0, 1, 0)), rope(EI)) for turn in (-math.pi, math.pi))
    floor = cf.Plane((0, 0, 0), (0, 0, 1), contact_radius=0.0)
    held = [cf.Prescribed(one.start, rotation=(0, 0, 0)), *(cf.Roller(one.start, x) for x in ((1, 0, 0), (0, 1, 0)))]
    joints = [cf.Joint(one.start, two.start), cf.Joint(one.end, two.end)]
    loads = [floor, *(cf.LineForce(rod, (0, 0, -w)) for rod in (one, two))]
    with pytest.warns(cf.SceneWarning, match="unstable"):  # it is not held across its plane
        path = cf.solve(cf.Scene([one, two], held, loads, joints), 1.0, tol=1e-4, model="planar")
    truth("ring that stands on a plane, height", path.position(one.end)[-1, 2], height, 1e-5)
    bends = abs(path.moment(one.end)[-1, 1])
    truth("ring that stands on a plane, moment at the top", bends, EI * (1 / R - curvature), 1e-4)
    touch = path.contacts(floor)
    np.testing.assert_allclose(touch.force[-1], (0, 0, w * L), atol=1e-8)
    s, pressure = (x[..., touch.rod == one.name] for x in (touch.s, touch.pressure[-1]))
    assert s[np.argmax(pressure)] == pytest.approx(half, abs=np.diff(s).max())  # a force is concentrated there


def test_a_rod_on_two_rough_posts():
    """Pulled along its axis by nearly all that both hold, each by its own coefficient; and by more."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), cf.Stiffness((1e6, 1e6), 1e6, (1e5, 1e5), 1e5, mass=1.0))
    places = ((0.5, 0.2), (1.5, 0.4))
    posts = [cf.Cylinder((x, 0, -0.11), (0, 1, 0), 0.1, friction=mu, contact_radius=0.01) for x, mu in places]
    pull, held = cf.Force(rod.end, (0.3 * 2.0 * 9.81, 0, 0)), cf.Spring(rod.start, rotational=1e-3)  # its spin
    scene = cf.Scene([rod], [], [*posts, held, cf.Weight(permanent=True), pull])
    path = cf.solve(scene, [0.99], elements=8, model="planar")
    for post in posts:
        x, _, z = path.contacts(post).force[-1] / 9.81
        assert z == pytest.approx(1.0, rel=1e-2) and 0.96 * post.friction < -x / z < 1.001 * post.friction
    with pytest.raises(cf.NotConverged, match="Friction may not hold more"):
        cf.solve(scene, [1.01], elements=8, model="planar")


@pytest.mark.parametrize("friction, way", [(0.0, "move it upwards in one Stage"), (0.4, "sags: pull by a Force")])
def test_a_slack_cable_that_is_pressed_is_told_another_way(friction, way):
    rod = cf.Rod(cf.Line((0, 0, 0), (100, 0, 0)), cf.Circle(0.05), cf.Material(E=1e9, nu=0.3, density=2000.0))
    floor = cf.Plane((0, 0, 0), normal=(0, 0, 1), contact_radius=0.0, friction=friction)
    hold = [cf.Clamp(rod.start), cf.Prescribed(rod.end, displacement=(-4.0, 0, 8.0))]
    scene = cf.Scene([rod], hold, [floor, cf.Weight(permanent=True)])
    with pytest.raises(cf.NotConverged, match=way):
        cf.solve(scene, [1.0], elements=20, control="load", steps=cf.StepControl(smallest=0.2))


@pytest.mark.parametrize(
    "wall",
    [lambda rod: cf.Plane((0, 0, -0.1), (0, 0, 1), contact_radius=0.0, stiffness=1e4),
     lambda rod: cf.Plane((0, 0, -0.1), (0, 0, 1), contact_radius=0.0, stiffness=1e4, law=Hardening(1e9)),
     lambda rod: cf.well.TubeWall(rod, cf.well.WellPath.from_survey([0, 2], [90, 90], [0, 0]), 0.15, 0.05, 1e4)],
    ids=["plane", "law of pressure", "tube"],
)  # fmt: skip
def test_modes_about_a_rod_that_touches_along_a_part(wall):
    """A heavy cantilever whose end lies on a wall: frequencies by two-node elements of another program with a node at
    the edge of contact, extrapolated (1e-8). With nodes alone, which know the edge to their distance, the difference of
    two meshes was up to ten times below the error."""
    section = cf.Stiffness((1e4, 1e4), 2e4, (2.0, 2.0), 2.0, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0), d1=(0, 1, 0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [wall(rod), cf.LineForce(rod, (0, 0, -15.0), permanent=True)])
    for how, most in (({"elements": 32}, 2e-4), ({"tol": 1e-6}, 1e-6)):
        off, error = beside(cf.modes(scene, 8, **how), [4.838291867492, 11.706768593477])
        assert (off < most).all() and not (error < off).any()


def beside(found, truths):
    """Relative differences of squares of the frequencies nearest to others, and their estimates."""
    k = np.abs(found.frequencies[:, None] - truths).argmin(axis=0)
    return np.abs((found.frequencies[k] / truths) ** 2 - 1), found.error[k]


@pytest.mark.parametrize(
    ("height", "stiffness", "weight", "truths"),
    [(0.220191, 2265.77, 13.1134, (67.076455587, 79.067956396)),
     (0.121623942, 26649.9, 18.65368, (65.445339469, 113.4047))],
)  # fmt: skip
def test_buckling_of_a_rod_that_touches_along_a_part(height, stiffness, weight, truths):
    """Pressed along its axis beside what its weight holds on a plane; load factors in the plane as above, the last one
    out of it (512 elements). Two meshes may agree on others that are 2 % off, and nodes that begin to touch within a
    difference quotient made the first one 73.3."""
    section = cf.Stiffness((1e4, 1e4), 2e4, (2.0, 200.0), 50.0)
    rod = cf.Rod(cf.Line((0, 0, 0.3), (2, 0, 0.3), d1=(0, 1, 0)), section)
    floor = cf.Plane((0, 0, height), (0, 0, 1), contact_radius=0.0, stiffness=stiffness)
    loads = [floor, cf.LineForce(rod, (0, 0, -weight), permanent=True), cf.Force(rod.end, (-1.0, 0, 0))]
    found = cf.buckling(cf.Scene([rod], [cf.Clamp(rod.start)], loads), 2)
    off = np.abs(found.load_factors / truths - 1)
    assert off[0] < 1e-5 and off[1] < 1e-3 and off[0] < found.error[0] + 1e-7  # its difference quotient leaves 3e-8


def test_buckling_beside_a_plane_that_is_almost_touched():
    """No node touches it: as without it. A step of the difference quotient in which none begins to is 1e-7 m."""
    section = cf.Stiffness((1e4, 1e4), 2e4, (2.0, 200.0), 50.0)
    rod = cf.Rod(cf.Line((0, 0, 0.3), (2, 0, 0.3), d1=(0, 1, 0)), section)
    loads = [cf.LineForce(rod, (0, 0, -0.5), permanent=True), cf.Force(rod.end, (-1.0, 0, 0))]
    free = cf.buckling(cf.Scene([rod], [cf.Clamp(rod.start)], loads), 2, elements=8)
    height = free.equilibrium.position(rod)[-1, 2] - 1e-7
    floor = cf.Plane((0, 0, height), (0, 0, 1), contact_radius=0.0)
    found = cf.buckling(cf.Scene([rod], [cf.Clamp(rod.start)], [floor, *loads]), 2, elements=8)
    np.testing.assert_allclose(found.load_factors, free.load_factors, rtol=2e-6)  # rounding of its stiffness


def test_a_rod_slides_to_rest():
    """With the speed v on a rough plane: it stops after v/(mu g) on the way v^2/(2 mu g)."""
    mu, g, v = 0.3, 9.81, 2.0
    section = cf.Stiffness((1e5, 1e5), 1e5, (50.0, 50.0), 50.0, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section)
    floor = cf.Plane((0, 0, 0), (0, 0, 1), friction=mu, contact_radius=0.0)
    moving = [cf.InitialVelocity(rod, linear=(0.6 * v, 0.8 * v, 0))]
    scene = cf.Scene([rod], [], [floor, cf.Weight((0, 0, -g))], velocities=moving)
    moved = cf.simulate(scene, 0.8, dt=5e-3, elements=2, degree=2).displacement(rod.at(0.5))[-1]
    assert np.hypot(*moved[:2]) == pytest.approx(v**2 / (2 * mu * g), rel=1e-4)


def test_friction_begins_where_a_motion_starts():
    """From a path that turns a rod by 60 degrees and lays it down: it sticks there, and slides to rest as any other."""
    mu, g, v = 0.3, 9.81, 2.0
    section = cf.Stiffness((1e5, 1e5), 1e5, (50.0, 50.0), 50.0, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0.4), (1, 0, 0.4)), section)
    floor = cf.Plane((0, 0, 0), (0, 0, 1), friction=mu, contact_radius=0.0)
    laid = cf.Prescribed(rod.start, displacement=(0.2, 0, -0.4), rotation=(0, 0, math.pi / 3))
    loads = [floor, cf.Weight((0, 0, -g))]
    start = cf.solve(cf.Scene([rod], [laid]), 1.0, elements=2)
    still = cf.simulate(cf.Scene([rod], [], loads), 0.1, dt=5e-3, elements=2, degree=2, start=start)
    assert np.abs(still.position(rod.at(0.5)) - still.position(rod.at(0.5))[0]).max() < 1e-6
    moving = cf.Scene([rod], [], loads, velocities=[cf.InitialVelocity(rod, linear=(0.6 * v, 0.8 * v, 0))])
    moved = cf.simulate(moving, 0.8, dt=5e-3, elements=2, degree=2, start=start).position(rod.at(0.5))
    assert np.hypot(*(moved[-1] - moved[0])[:2]) == pytest.approx(v**2 / (2 * mu * g), rel=1e-4)
    pulled = cf.solve(cf.Scene([rod], [laid], loads), 1.0, elements=2)
    with pytest.raises(cf.SceneError, match="in which they have none, or that is without them, and friction"):
        cf.simulate(moving, 0.1, dt=5e-3, elements=2, start=pulled)


STEADY = cf.Stiffness((1e7, 1e7), 1e7, (1e4, 1e4), 1e4, mass=10.0, inertia=(2.5e-4, 2.5e-4, 5e-4))


def carried(rod, surface, *springs, pushed):
    """A motion of a rod on a moving surface, from where the surface without friction holds it against a force."""
    loads = [cf.LineForce(rod, (0, 0, -pushed / rod.length)), *springs]
    still = cf.Scene([rod], [], [surface.smooth, *loads, cf.Spring(rod.at(0.1), 1.0, 1.0)])
    start = cf.solve(still, 1.0, elements=1, degree=2)
    return cf.simulate(cf.Scene([rod], [], [surface, *loads]), 0.4, dt=1e-3, elements=1, degree=2, start=start)


def test_a_block_on_a_belt(truth):
    """On a spring it is carried along, sticks, slips where mu m g = k x, and swings with the amplitude V sqrt(m/k)."""
    m, k, mu, V, a = 2.0, 200.0, 0.4, 0.3, 0.01
    rod = cf.Rod(cf.Line((0, 0, a), (0.2, 0, a)), STEADY)
    belt = cf.Plane((0, 0, 0), (0, 0, 1), friction=mu, stick=1e8, contact_radius=a, velocity=(V, 0, 0))
    history = carried(rod, belt, cf.Spring(rod.at(0.1), k, direction=(1, 0, 0)), pushed=9.81 * m)
    x, v = history.displacement(rod.at(0.1))[:, 0], history.velocity(rod.at(0.1))[:, 0]
    sticks = np.flatnonzero(v > 0.999 * V)[0]
    assert history.times[sticks] == pytest.approx(0.08703056520629002, abs=1.1e-3)
    assert v.max() < 1.01 * V and np.abs(history.balance).max() < 1e-9 * history.kinetic.max()
    truth("block on a belt, largest way, m", x.max(), 0.03924 + 0.03, 1e-3)
    with pytest.raises(cf.SceneError, match="expected a surface without velocity or spin, or a motion"):
        cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [belt]), 1.0)


def test_a_roller_is_driven_by_the_drum_around_it():
    """Its spin grows by mu N a/J up to that of rolling."""
    mu, a, R, spin, pushed = 0.2, 0.01, 0.1, 5.0, 19.62
    rod = cf.Rod(cf.Line((0, -0.1, a - R), (0, 0.1, a - R)), STEADY)
    drum = cf.Cylinder((0, 0, 0), (0, 1, 0), R, mu, True, 1e7, 1e7, contact_radius=a, spin=spin)
    held = [cf.Spring(end, 1e6, direction=(1, 0, 0)) for end in (rod.start, rod.end)]
    history = carried(rod, drum, *held, pushed=pushed)
    w, rate = history.angular_velocity(rod.at(0.1))[:, 1], mu * pushed * a / (5e-4 * rod.length)
    assert np.polyfit(history.times[:60], w[:60], 1)[0] == pytest.approx(rate, rel=1e-4)
    assert w[history.times > 1.05 * R * spin / a / rate] == pytest.approx(R * spin / a, rel=0.01)
    assert np.abs(history.balance).max() < 1e-6 * history.kinetic.max()


def test_what_moving_surfaces_need():
    for given, words in (({"velocity": (1, 0, 0)}, "0 without friction"),
                         ({"velocity": (1, 0, 1), "friction": 0.1}, "a velocity in the plane")):  # fmt: skip
        with pytest.raises(cf.SceneError, match=words):
            cf.Plane((0, 0, 0), (0, 0, 1), **given)


class TestWhatAResultLeavesOpen:
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), cf.Stiffness((1e4, 1e4), 1e4, (1.0, 100.0), 1.0, mass=1.0,
                 inertia=(1e-3, 1e-3, 2e-3)), name="strut")  # fmt: skip
    floor = cf.Plane((0, 0, 0), (0, 0, 1), contact_radius=0.0)

    def test_a_strut_may_lift_off(self):
        """It touches without pressing: it buckles upwards at pi^2/4, which no linear theory of held rods sees, and is
        stable below with those nodes and without."""
        scene = cf.Scene([self.rod], [cf.Clamp(self.rod.start)], [self.floor, cf.Force(self.rod.end, (-10.0, 0, 0))])
        for linear in (cf.buckling, cf.modes):
            with pytest.raises(cf.SceneError, match="'strut' touches, at s = .* Plane without pressing on it, and may"):
                linear(scene, 1, elements=4)
        with pytest.warns(cf.SceneWarning, match="does not see that it may lift off"):
            path = cf.solve(scene, [0.246, 0.247, 1.0], elements=4)
        assert "undecided" in str(path) and "may lift off" in str(path) and "may lift off" in " ".join(path.why)
        assert path.negative_modes.tolist() == [0, -1, -1] and "may lift off" not in str(path[0])
        pressed = dataclasses.replace(scene, loads=[*scene.loads, cf.LineForce(self.rod, (0, 0, -1.0), permanent=True)])
        assert cf.buckling(pressed, 1, elements=4).load_factors[0] > 20  # as long as it presses
        rough = [dataclasses.replace(self.floor, friction=0.3), *pressed.loads[1:]]
        for linear in (cf.buckling, cf.modes):
            with pytest.warns(cf.SceneWarning, match="Plane has friction, and where rods cease to stick to it"):
                linear(dataclasses.replace(pressed, loads=rough), 1, elements=4)

    def test_on_a_plane_across_the_axes(self):
        """Gaps that are rounding, where nothing has moved, let nothing pass."""
        along, place = np.array([3.0, 5.0, 2.0]) / math.sqrt(38.0), np.array([0.13, 0.27, 0.41])
        rod = cf.Rod(cf.Line(place, place + along), self.rod.section, name="strut")
        floor = cf.Plane(place, np.cross(along, (0.1, 0.7, -0.4)), contact_radius=0.0)
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [floor, cf.Force(rod.end, -3.0 * along)])
        with pytest.raises(cf.SceneError, match="'strut' touches, at s = .* Plane without pressing on it, and may"):
            cf.modes(scene, 1, elements=3)
        with pytest.warns(cf.SceneWarning, match="does not see that it may lift off"):
            assert len(cf.solve(scene, [0.0, 1.0], elements=3)) == 2

    @pytest.mark.slow
    def test_a_post_beside_the_nodes(self):
        """A bent cantilever on a thin post: the force is across the rod, at 0.22 rad (shooting: 0.19849, 0.88747 N);
        that of a node beside the place has another direction by up to h/2R."""
        rod = cf.Rod(cf.Line((0, 0, 0.1), (1, 0, 0.1)), cf.Stiffness((1e4, 1e4), 1e4, (1.0, 1.0), 1.0))
        post = cf.Cylinder((0.7, 0, 0), (0, 1, 0), 0.02, contact_radius=0.0)
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [post, cf.Force(rod.end, (0, 0, -1.0))])
        with pytest.warns(cf.SceneWarning, match="Cylinder pushes along rods by up to 0.11 of its"):
            path = cf.solve(scene, 1.0, elements=40)
        assert any("pushes along rods" in sentence for sentence in path.why)
        path = cf.solve(scene, 1.0, tol=1e-3)
        np.testing.assert_allclose(path.contacts(post).force[-1], (0.19848653, 0, 0.88746699), atol=2e-4)
        assert "pushes along" not in str(path)

    def test_small_motions_beside_a_post(self):
        """Where its node alone touches it pushes the rod along, by which the first frequency is 4 % off: ends of
        elements go to both edges of contact (numbers: two-node elements, as above)."""
        section = cf.Stiffness((1e4, 1e4), 2e4, (2.0, 2.0), 2.0, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
        rod = cf.Rod(cf.Line((0, 0, 0.3), (2, 0, 0.3)), section)
        post = cf.Cylinder((1.3, 0, 0.25), (0, 1, 0), 0.05, contact_radius=0.0, stiffness=1e6)
        loads = [post, cf.LineForce(rod, (0, 0, -3.0), permanent=True), cf.Force(rod.end, (-1.0, 0, 0))]
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
        with pytest.warns(cf.SceneWarning, match="modes: Cylinder pushes along rods by up to 0.05"):
            cf.modes(scene, 1, elements=8)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            off, error = beside(cf.modes(scene, 4, tol=1e-3), [0.931311856143, 2.616325862586])
            assert (off < 1e-3).all() and (off < error).all()

    def test_stiffness_of_the_surface(self):
        """A rod under its weight, at a depth of w/k, and pulled by less than friction holds: it does not move."""
        floor = dataclasses.replace(self.floor, stiffness=1e4, friction=0.5)
        level = cf.Prescribed(self.rod.start, rotation=(0, 0, 0))
        scene = cf.Scene([self.rod], [level], [floor, cf.LineForce(self.rod, (2.0, 0, -10.0), permanent=True)])
        path = cf.solve(scene, 1.0, elements=4, model="planar")
        told = " ".join(str(path).split())
        assert "Plane lets rods in by up to 0.001 m, 1 of the largest displacement: its stiffness" in told
        assert "estimated errors do not contain it" in told and "may lift off" not in told
        assert abs(path.displacement(self.rod.end)[-1, 0]) < 1e-10 and path.stable.all()


@pytest.mark.parametrize("stiffness, told", [(1e8, "about 3 %"), (1e10, "about 0.1 %")])
def test_what_a_finite_stiffness_changes(stiffness, told):
    """A cantilever over a bollard at its middle, beside one on a rigid prop: 3.0 % and 0.12 % off."""
    EI, F = 210e9 * np.pi * 0.02**4 / 64, 20.0
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), cf.Circle(0.02), cf.Material(E=210e9, nu=0.3))
    bollard = cf.Cylinder((1, 0, -0.11), (0, 1, 0), 0.1, stiffness=stiffness)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", cf.SceneWarning)
        path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -F)), bollard]), [1.0])
    off = path.displacement(rod.end)[-1, 2] / -(F / (3 * EI) + F / (4 * EI)) - 1
    words = f"finite stiffness of Cylinder changes positions by {told} of the largest displacement"
    assert float(told.split()[1]) / 100 == pytest.approx(off, rel=0.2) and path.error < 1e-6
    assert words in " ".join(str(path).split()) and any(words in sentence for sentence in path.why)
    assert [words in str(x.message) for x in warned] == [True] * (stiffness == bollard.__class__.stiffness)


def test_a_motion_does_not_start_inside_an_obstacle():
    rod = TestWhatAResultLeavesOpen.rod
    bent = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -0.1))]), 1.0, elements=2)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [TestWhatAResultLeavesOpen.floor])
    with pytest.raises(cf.SceneError, match="start: rod 'strut' overlaps Plane by .* m at s = 1 m: expected a path of"):
        cf.simulate(scene, 0.01, dt=1e-3, start=bent, elements=2)


ROD = cf.Rod(cf.Line((0, 0, 0.01), (1, 0, 0.01)), cf.Circle(0.02), cf.Material(1e9, 0.3), name="rope")
BEAM = cf.Rod(cf.Line((0, 0, 1), (1, 0, 1)), cf.Rectangle(0.02, 0.03), cf.Material(1e9, 0.3), name="beam")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: cf.Plane((0, 0, 0), (0, 0, 0)), "Plane.normal = .*expected a direction"),
        (lambda: cf.Plane((0, 0, 0), (0, 0, 1), friction=-0.1), "Plane.friction = -0.1: expected"),
        (
            lambda: cf.solve(
                cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.Plane((0, 0, 0), (0, 0, 1), friction=0.1)]), control="arc"
            ),
            "expected load control and no branch, since an obstacle has friction",
        ),
        (lambda: cf.Sphere((0, 0, 0), 0.0), "Sphere.radius = 0.0: expected"),
        (lambda: cf.Scene([BEAM], [], [cf.Plane((0, 0, 0), (0, 0, 1))]), "contact_radius is missing.*rod 'beam'"),
        (
            lambda: cf.Scene([ROD], [], [cf.Plane((0, 0, 0.004), (0, 0, 1))]),
            "Plane: rod 'rope' lies beyond its surface at rest, at s = .* m by 0.004 m",
        ),
        (
            lambda: cf.Scene([ROD], [], [cf.Cylinder((0.5, 0, -0.03), (0, 1, 0), 0.032)]),
            "Cylinder: rod 'rope' lies beyond its surface at rest, at s = 0.5 m by 0.002 m",
        ),
    ],
)
def test_refusals(make, words):
    with pytest.raises(cf.SceneError, match=words):
        make()


def test_obstacles_in_a_scene_file(tmp_path):
    """Written and read again they are the same."""
    floor, post = cf.Plane((0, 0, 0), (0, 0, 2), friction=0.4), cf.Cylinder((0, 0, -1), (0, 1, 0), 0.5, inside=False)
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [floor, post])
    cf.write(scene, tmp_path / "scene.toml")
    assert cf.read(tmp_path / "scene.toml").loads == scene.loads
