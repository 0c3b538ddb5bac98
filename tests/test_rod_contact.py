"""Rods that touch each other: solutions of boundary value problems by another program, refusals, and that none passes
through another."""

import json
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import cosserat_fenicsx as cf
from cosserat_fenicsx.files.read import schema_of_files
from cosserat_fenicsx.numerics import ElementRule
from cosserat_fenicsx.strands import Strands

pytestmark = pytest.mark.serial
RIGID = (math.inf, math.inf)


def crossing(lowered=0.15, **contact):
    """Two rods at right angles that touch in their middles; the ends of the upper one are lowered."""
    radius, E, nu = 0.01, 1e7, 0.3
    area, inertia = math.pi * radius**2, math.pi * radius**4 / 4
    G, factor = E / (2 * (1 + nu)), 0.8863636363636364
    section = cf.Stiffness((factor * G * area,) * 2, E * area, (E * inertia,) * 2, 2 * G * inertia, mass=0.3,
                           inertia=(1e-5, 1e-5, 2e-5))  # fmt: skip
    lower = cf.Rod(cf.Line((-0.5, 0, 0), (0.5, 0, 0)), section, name="lower")
    upper = cf.Rod(cf.Line((0, -0.5, 2 * radius), (0, 0.5, 2 * radius)), section, name="upper")
    moved = {"displacement": (0, 0, -lowered), "rotation": (0, 0, 0)}
    ends = [cf.Prescribed(upper.start, **moved), cf.Prescribed(upper.end, **moved)]
    touch = cf.RodContact(**{"radius": radius, **contact})
    return cf.Scene([lower, upper], [cf.Clamp(lower.start), cf.Clamp(lower.end), *ends], [touch])


@pytest.mark.parametrize(("elements", "begins", "node"), [(6, -0.06, 12), (7, -0.057, -1)])
def test_a_narrow_hook_on_few_elements_touches(elements, begins, node):
    """A catenary around a straight rod is as flat as a line in its middle alone: there, at a node or in a point."""
    scene, length, radius, bend = crossing(radius=0.0097), 0.12, 0.0097, 0.01992
    rule = ElementRule((1 + np.array([-1, -np.sqrt(3 / 7), 0, np.sqrt(3 / 7), 1])) / 2, np.array([0.5]), np.ones(1))
    places = np.unique((np.arange(elements)[:, None] + rule.nodes).round(14)) / elements * length
    across, none = bend * np.arcsinh((begins + places) / bend), 0 * places
    hook = np.c_[across, none, bend * (np.cosh(across / bend) - 1)]
    x = np.concatenate([hook, np.c_[none, places - length / 2, none + 1.99 * radius]])
    rods, first = np.repeat([0, 1], elements), np.arange(2 * elements)
    cells, starts = (4 * first + rods)[:, None] + np.arange(5), first % elements * length / elements
    apart = scene.rod_contact.apart(scene)
    sizes, radii = np.full((2, len(first)), [[length / elements], [radius]])
    strands = Strands(cells, rods, sizes, starts, radii, rule, apart)
    touches, closest = strands.near(x, radius / 2)
    assert touches.node.tolist() == [node] and closest < 0.996
    assert touches.gap == pytest.approx((closest - 1) * 2 * radius, rel=0.01)


@pytest.mark.slow
def test_crossing_rods(tmp_path, truth):
    """13.689149090107861 N of solve_bvp; they hold each other by the same force in tables, files and fields."""
    scene, force = crossing(), 13.689149090107861
    path = cf.solve(scene, [1.0], elements=20)
    found = path.contacts(scene.loads[0])
    truth("crossing rods, force", found.force, [force], 1e-6, most=2e-7)
    assert not found.line.any()
    np.testing.assert_allclose([found.s[0], found.other_s[0]], 0.5, atol=1e-9)
    np.testing.assert_allclose(found.point[0], (0, 0, -0.065), atol=1e-7)
    assert abs(found.gap[0]) < 1e-12 and "lower" in str(found) and path.stable[-1]
    lower, upper = path.scene.rods
    assert path.force(lower.at(0.25))[-1, 2] == pytest.approx(-force / 2, rel=2e-6)
    np.testing.assert_allclose(path.position(lower.at(0.25))[-1, [0, 2]], (-0.25, -0.0375), atol=1e-7)
    field = path.quantities["rod_force"].of(path, upper)
    np.testing.assert_allclose(field[-1].sum(axis=0), (0, 0, force), atol=1e-6 * force)
    path.save(tmp_path / "crossing.h5")
    again = cf.read_path(tmp_path / "crossing.h5")
    assert again.contacts(again.scene.loads[0]).force == pytest.approx(found.force, rel=1e-12)


@pytest.mark.slow
def test_a_ring_is_pulled_until_it_touches_itself(truth):
    """By shooting: F = 6 N presses it onto itself by 0.12063607907258804 N, in one point."""
    R, EI, radius, n = 1 / (2 * math.pi), 1e-3, 0.03, 32
    section = cf.Stiffness(RIGID, math.inf, (EI, EI), EI)
    a, b = (cf.Rod(cf.Arc((0, 0, 0), (-R, 0, 0), turn), section, name=name) for name, turn in
            (("a", -math.pi), ("b", math.pi)))  # fmt: skip
    touch = cf.RodContact(radius=radius, exclude=0.4955)  # the truth has contact in the middle alone
    joints = [cf.Joint(a.start, b.start), cf.Joint(a.end, b.end)]
    scene = cf.Scene([a, b], [cf.Clamp(a.start)], [touch, cf.Force(a.end, (1.0, 0, 0))], joints=joints)
    path = cf.solve(scene, [2.0, 6.0], elements=n)
    apart = np.linalg.norm(path.position(a.end) - path.position(a.start), axis=1)
    np.testing.assert_allclose(apart, (0.46295178732099795, 0.47801546152226415), rtol=1e-6)
    assert not len(path[0].contacts(touch))
    truth("pulled ring that touches itself, force", path.contacts(touch).force.sum(), 0.12063607907258804, 1e-5)


def beam_on_another(A, B, k, F):
    """A beam under F in its middle, on another one in a bed k: half the length of contact, and (deflection of order n
    at x) -> number. Both bend as one, w'' = 0 where they part, and the lower one goes on as exp(-o x) cos(o x)."""
    b, o = ((k / (4 * EI)) ** 0.25 for EI in (A + B, B))
    roots = b * np.array([1 + 1j, -1 - 1j])

    def of(x, n):
        found = roots**n * np.exp(roots * x)
        return np.append(found.real, found.imag)

    def parting(c):
        """The balance of shear forces at the end of contact, and coefficients for all else."""
        rows = of(0, 1), of(0, 3), of(c, 2), of(c, 1) + o * of(c, 0)
        found = np.linalg.solve(rows, (0, F / 2 / (A + B), 0, 0))
        return (A + B) * of(c, 3) @ found - 2 * B * o**3 * of(c, 0) @ found, found

    c = brentq(lambda c: parting(c)[0], 0.3 / b, 1.5 / b, xtol=1e-15)
    return c, lambda x, n: float(of(x, n) @ parting(c)[1])


def test_two_beams_one_on_a_bed(truth):
    """They touch along a part that does not depend on the force, with forces that are concentrated under it and at the
    ends of contact: those with the moments of the true pressure and of the beam, since forces of nodes alternate."""
    A, B, k, F, r, half, far = 10.0, 20.0, 1e4, 0.5, 0.01, 0.45, 2.5
    c, w = beam_on_another(A, B, k, F)
    assert (c, w(0, 0)) == pytest.approx((0.2766934320814265, 0.0769854348171996e-3), rel=1e-9)  # another program
    section = [cf.Stiffness(RIGID, math.inf, (EI, EI), EI) for EI in (A, B)]
    upper = cf.Rod(cf.Line((-half, 0, 2 * r), (half, 0, 2 * r)), section[0], name="upper")
    lower = cf.Rod(cf.Line((-0.5, 0, 0), (0.5, 0, 0)), section[1], name="lower")
    outer = [cf.Rod(cf.Line((s * 0.5, 0, 0), (s * far, 0, 0)), section[1]) for s in (-1, 1)]
    pressed, middle = upper.at(half), lower.at(0.5)
    supports = [cf.Prescribed(pressed, displacement=(0, 0, -w(0, 0)), rotation=(0, 0, 0)),
                cf.Prescribed(middle, rotation=(0, 0, 0)), *(cf.Roller(middle, x) for x in ((1, 0, 0), (0, 1, 0)))]
    touch = cf.RodContact(radius=r, pairs=(("upper", "lower"),))
    loads = [touch, *(cf.Foundation(rod, k, direction=(0, 0, 1)) for rod in (lower, *outer))]
    joints = [cf.Joint(end, rod.start) for end, rod in zip((lower.start, lower.end), outer, strict=True)]
    scene = cf.Scene([upper, lower, *outer], supports, loads, joints)
    path = cf.solve(scene, 1.0, elements=20, steps=cf.StepControl(first=1.0))
    force = -path.reaction(supports[0])[0][-1, 2]
    truth("two beams, one on a bed, force for a deflection", force, F, 1e-4)
    found = path.contacts(touch)
    truth("two beams, sum of contact forces", np.abs(found.force @ found.normal)[2], force, 1e-10, most=1e-9)
    reach = max(abs(found.s - half).max(), abs(found.other_s - 0.5).max())
    assert reach == pytest.approx(c, abs=2 * half / 20 / 4 * 1.4)  # the widest distance of nodes

    def moment(x):
        return abs(path.moment(upper.at(half + x))[-1, 1])

    def pressure(a, b, about):
        """The moment of the true pressure from a to b about a place."""
        x, weights = np.polynomial.legendre.leggauss(12)
        x = (a + b) / 2 + (b - a) / 2 * x
        return (b - a) / 2 * sum(v * A * abs(w(y, 4)) * abs(y - about) for y, v in zip(x, weights, strict=True))

    inner, beside = 0.1, 0.2
    end = (moment(beside) - pressure(beside, c, beside)) / (c - beside)
    shear = (moment(0) - moment(inner) + pressure(0, inner, inner)) / inner
    truth("two beams, concentrated forces", (force - 2 * shear, end), (F * B / (A + B), A * w(c, 3)), 1e-2)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"radius": 0.011}, "rod 'lower' at s = .* overlaps rod 'upper' at s = .* by 0.002 m at rest: .*`exclude`"),
        ({"radius": None}, "RodContact.radius is missing: the section of rod 'lower' is not round"),
        ({"pairs": [("lower", "upr")]}, "RodContact.pairs: no rod is named 'upr'.*'upper'"),
        ({"pairs": [("lower",)]}, "expected two names of rods each"),
    ],
)
def test_bad_input_is_refused(change, words):
    with pytest.raises(cf.SceneError, match=words):
        crossing(**change)


def test_a_rod_that_folds_its_own_surface():
    rod = cf.Rod(cf.Arc((0, 0, 0), (0.01, 0, 0), 1.0), cf.Stiffness(RIGID, math.inf, (1.0, 1.0), 1.0), name="bend")
    with pytest.raises(cf.SceneError, match="is larger than its radius of curvature at rest, 0.01 m"):
        cf.Scene([rod], [cf.Clamp(rod.start)], [cf.RodContact(radius=0.02), cf.Force(rod.end, (0, 0, 1))])


def test_what_rods_that_touch_have_not():
    scene = crossing()
    with pytest.raises(cf.SceneError, match="rods that touch each other have hard surfaces in equilibria"):
        cf.solve(crossing(stiffness=1e8))
    with pytest.raises(cf.SceneError, match="buckling: RodContact acts in `solve` and `simulate` alone"):
        cf.buckling(scene)
    with pytest.raises(cf.SceneError, match="modes: RodContact acts in `solve` and `simulate` alone"):
        cf.modes(scene)
    with pytest.raises(cf.SceneError, match="expected load control and no branch, since rods touch each other"):
        cf.solve(scene, control="arc")


def test_it_is_a_table_of_scene_files(tmp_path):
    scene = crossing(pairs=[("lower", "upper")], exclude=0.05)
    cf.write(scene, tmp_path / "crossing.toml")
    assert "RodContact" in tomllib.loads((tmp_path / "crossing.toml").read_text())["loads"][0]["type"]
    assert cf.read(tmp_path / "crossing.toml").scene.loads[0] == replace(scene.loads[0])
    assert "RodContact" in json.dumps(schema_of_files())


def closest(path, radius):
    """The smallest distance of two rods' centrelines over 2 radius in all states, by samples alone."""
    smallest = math.inf
    for k in range(len(path)):
        points = [path.sample(k, rod, np.linspace(0, 1, 400))[0] for rod in path.scene.rods]
        for i, p in enumerate(points):
            for q in points[:i]:
                smallest = min(smallest, np.linalg.norm(p[:, None] - q, axis=2).min())
    return smallest / (2 * radius)


@pytest.mark.slow
def test_no_rod_passes_through_another(tangle):
    """Two to five rods at random angles, whose ends are moved through each other by many diameters, some with friction:
    each path ends with rods that hold each other, or with the contact by name; none is crossed."""
    random, radius, count = np.random.default_rng(tangle), 0.02, 2 + tangle % 4
    section = cf.Stiffness((1e4, 1e4), 1e4, (1.0, 1.0), 0.8)
    rods, supports = [], []
    for k in range(count):
        angle = random.uniform(0.3, 1.2) + k * math.pi / count
        half = 0.5 * np.array([math.cos(angle), math.sin(angle), 0])
        middle = np.array([*random.uniform(-0.1, 0.1, 2), 2.2 * radius * k])
        rod = cf.Rod(cf.Line(tuple(middle - half), tuple(middle + half)), section, name=f"rod {k}")
        rods.append(rod)
        moved = {"displacement": (0, 0, -0.12 * k), "rotation": (0, 0, 0)}
        supports += [cf.Prescribed(end, **moved) if k else cf.Clamp(end) for end in (rod.start, rod.end)]
    scene = cf.Scene(rods, supports, [cf.RodContact(radius=radius, friction=0.4 * (tangle % 2))])
    try:
        path = cf.solve(scene, np.linspace(0.1, 1, 4), elements=10)
    except cf.NotConverged as failure:
        path = failure.path
        assert "rod 'rod " in str(failure)
    assert closest(path, radius) > 1 - 1e-2
    shapes = (
        [path.sample(len(path) - 1, rod, np.linspace(0, 1, 400))[0] for rod in path.scene.rods] if len(path) else []
    )
    for upper, p in enumerate(shapes):
        for q in shapes[:upper]:  # seen from above, where they cross
            apart = np.linalg.norm(p[:, None, :2] - q[:, :2], axis=2)
            i, j = np.unravel_index(apart.argmin(), apart.shape)
            assert apart[i, j] > 2.5e-3 or p[i, 2] > q[j, 2]


def test_many_contacts_are_solved_by_the_sparse_tangent(monkeypatch):
    """Forces, places and negative modes are those by the responses to all forces; some candidates do not press."""
    section, material = cf.Circle(0.01), cf.Material(E=1e9, nu=0.3, density=1000.0)
    lower = [cf.Rod(cf.Line((0, y, 0), (0.3, y, 0)), section, material) for y in (0.05, 0.12, 0.22)]
    upper = [cf.Rod(cf.Line((x, 0, 0.01), (x, 0.3, 0.01)), section, material) for x in (0.08, 0.1, 0.2)]
    held = [end for rod in (*lower, *upper[1:]) for end in (rod.start, rod.end)]
    touch, supports = cf.RodContact(), [cf.Clamp(end) for end in held]
    supports += [cf.Hinge(upper[0].start, (1, 0, 0)), *(cf.Roller(upper[0].end, n) for n in ((0, 0, 1), (1, 0, 0)))]
    loads = [touch, cf.Force(upper[0].at(0.2), (0, 0, -2.0)), cf.Force(upper[2].at(0.1), (0, 0, 1.0)),
             cf.Moment(upper[0].at(0.1), (0, 0.01, 0))]  # fmt: skip
    scene, found = cf.Scene([*lower, *upper], supports, loads), []
    for many in (10**6, 0):
        monkeypatch.setattr("cosserat_fenicsx.statics.touching._MANY", many)
        path = cf.solve(scene, [0.5, 1.0], elements=3)
        table = path.contacts(touch)
        found.append((table.force, table.s, [path.position(rod.at(0.13))[-1] for rod in upper], path.negative_modes))
    assert 3 <= len(found[0][0]) < 9
    for by_responses, by_tangent in zip(*found, strict=True):
        np.testing.assert_allclose(by_tangent, by_responses, rtol=1e-8, atol=1e-10)


@pytest.mark.slow
def test_friction_holds_and_slips(tmp_path, truth):
    """A rod on another one is pulled to and fro against a spring k: it sticks with the compliance of the lower rod in
    bending, shear and, since friction has an arm, twist, and slips at the friction mu N, N known from the balance."""
    r, L, EI, GA, GJ, k, pressed, friction = 0.01, 1.0, 1e3, 1e6, 5.0, 1e3, 10.0, 0.5
    lower = cf.Rod(cf.Line((-L / 2, 0, 0), (L / 2, 0, 0)), cf.Stiffness((GA, GA), 1e7, (EI, EI), GJ), name="lower")
    upper = cf.Rod(
        cf.Line((0, -0.3, 2 * r), (0, 0.3, 2 * r)), cf.Stiffness((GA, GA), 1e7, (1e4, 1e4), 1e4), name="upper"
    )
    end, touch = upper.start, cf.RodContact(radius=r, friction=friction)
    supports = [cf.Clamp(lower.start), cf.Clamp(lower.end), cf.Prescribed(end, rotation=(0, 0, 0)),
                cf.Roller(end, (1, 0, 0))]  # fmt: skip
    loads = [touch, cf.Spring(end, k, direction=(0, 1, 0)), cf.Spring(end, 10.0, direction=(0, 0, 1)),
             cf.Force(upper.at(0.3), (0, 0, -pressed), permanent=True), cf.Force(end, (0, 10.0, 0))]  # fmt: skip
    path = cf.solve(cf.Scene([lower, upper], supports, loads), [0.25, 0.75, 1.0, 0.25, -0.5, -1.0], elements=4)
    u, w = path.displacement(end)[:, 1], path.displacement(end)[:, 2]
    below = L**3 / (192 * EI) + L / (4 * GA) + r**2 * L / (4 * GJ)
    stiffness, slid = (k + 1 / (below + s * (r**2 / 1e4 + 1e-7)) for s in (0.3, 0.3 - u[2]))
    bound = friction * (pressed + 10.0 * w)
    truth("rod that sticks to another one, displacement", u[0], 2.5 / stiffness, 2e-5)
    truth("rod that turns back and sticks", u[2] - u[3], 7.5 / slid, 2e-5)
    slips = k * u[[1, 2, 4, 5]] - 10 * np.array([0.75, 1.0, -0.5, -1.0])
    truth("rod that slips on another one, friction", slips, bound[[1, 2, 4, 5]] * [-1, -1, 1, 1], 2e-5)
    held = [path[i].contacts(touch) for i in range(len(path))]
    assert [bool(found.sticks[0]) for found in held] == [True, False, False, True, False, False]
    path.save(tmp_path / "rubs.h5")
    again = cf.read_path(tmp_path / "rubs.h5")
    for found in (held[2], again[2].contacts(again.scene.loads[0])):
        assert np.linalg.norm(found.friction[0]) == pytest.approx(friction * found.force[0], rel=1e-6)
        assert found.friction[0, 1] == pytest.approx(slips[1], rel=1e-4)
    assert any("friction" in why for why in path.why)


def test_rods_that_turn_with_their_contact_do_not_slip():
    """A frame whose rods stick to each other under follower loads is turned about one of them by 86 degrees: friction
    along that axis is that of the frame at rest."""
    r, found = 0.02, []
    soft, stiff = (cf.Stiffness((x * 1e6, x * 1e6), x * 1e7, (x * 1e3, x * 1e3), x * 1e3) for x in (1, 100))
    first = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), soft, name="first")
    frame = cf.Rod(cf.Line((0, 0, 0), (0.5, 0.5, 2 * r)), stiff, name="frame")
    other = cf.Rod(cf.Line((0.5, 0.5, 2 * r), (0.5, -0.3, 2 * r)), soft, name="other")
    joints = [cf.Joint(first.start, frame.start), cf.Joint(frame.end, other.start)]
    touch = cf.RodContact(radius=r, friction=0.5, pairs=(("first", "other"),))
    loads = [
        touch,
        cf.FollowerForce(other.end, (0, -40.0, 0), permanent=True),
        cf.FollowerForce(other.end, (6.0, 0, 0)),
    ]
    for turned, states in ((0.0, [0.0, 1.0]), (1.5, np.linspace(0, 1, 21))):
        support = cf.Prescribed(first.start, displacement=(0, 0, 0), rotation=(turned, 0, 0))
        path = cf.solve(cf.Scene([first, frame, other], [support], loads, joints=joints), states, elements=4)
        contact = path.contacts(touch)
        assert contact.sticks.all() and len(contact) == 1
        found.append(contact.friction[0, 0])
    assert found[1] == pytest.approx(found[0], rel=1e-3)  # 1.5 % off by slips along the last normal
