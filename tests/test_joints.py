"""Joints and supports: cut rods, balance, releases, reactions in place of supports, frames of many rods."""

import time

import numpy as np
import pytest
from conftest import column, refused
from frame_scenes import grid_shell
from mpi4py import MPI
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

import cosserat_fenicsx as cf

SECTION = cf.Stiffness(shear=(3e3, 5e3), axial=8e3, bending=(1.0, 2.5), torsion=0.7, mass=1.0)
FORCE = np.array([0.5, 0.9, -0.7])


def line(a, b, name, section=SECTION, **more):
    return cf.Rod(cf.Line(a, b, **more), section, name=name)


@pytest.mark.parametrize("turned_round", [False, True])
def test_a_cut_rod_is_the_whole_rod(turned_round):
    """Also if the second half runs in the opposite direction, with rotated axes."""
    a, b, c = np.array([1.0, 2.0, 3.0]), np.array([1.2, 2.4, 3.2]), np.array([1.5, 3.0, 3.5])
    whole = line(a, c, "whole", d1=(1, 0, 0))
    lower = line(a, b, "lower", d1=(1, 0, 0))
    if turned_round:  # d3 and d1 x d3 change sign, d1 does not
        upper = line(c, b, "upper", d1=(1, 0, 0))
        joint, tip = cf.Joint(lower.end, upper.end), upper.start
    else:
        upper = line(b, c, "upper", d1=(1, 0, 0))
        joint, tip = cf.Joint(lower.end, upper.start), upper.end
    one = cf.solve(cf.Scene([whole], [cf.Clamp(whole.start)], [cf.Force(whole.end, 3 * FORCE)]), [1.0], elements=10)
    scene = cf.Scene([lower, upper], [cf.Clamp(lower.start)], [cf.Force(tip, 3 * FORCE)], [joint])
    two = cf.solve(scene, [1.0], elements=5, comm=MPI.COMM_SELF)
    np.testing.assert_allclose(two.position(tip), one.position(whole.end), atol=2e-9)
    np.testing.assert_allclose(two.rotation(tip), one.rotation(whole.end), atol=2e-8)
    assert np.linalg.norm(one.displacement(whole.end)) > 0.3


def star(release=None, elements=3):
    """Four rods that meet at one point, at arbitrary angles."""
    tips = [(0, 0, -1.0), (1.0, 0.2, 0.3), (-0.4, 0.9, 0.5), (-0.3, -0.8, 0.9)]
    rods = [line((0, 0, 0), tip, f"arm{i}") for i, tip in enumerate(tips)]
    joints = [cf.Joint(rods[0].start, rod.start, release if i == 1 else None) for i, rod in enumerate(rods) if i]
    supports = [cf.Clamp(rods[0].end), *([cf.Pin(rods[1].end)] if release is not None else [])]
    loads = [cf.Force(rods[2].end, FORCE), cf.Force(rods[3].end, (-0.4, 0.2, -0.6)), cf.Weight((0, 0, -0.5)),
             cf.Moment(rods[0].start, (0.1, 0.2, 0.3))]  # fmt: skip
    return rods, cf.Scene(rods, supports, loads, joints), elements


@pytest.mark.parametrize("release", [None, (0.3, 1.0, -0.2), "all"])
def test_balance_at_a_joint_of_four(release):
    if release == "all":
        rods, scene, elements = star((1.0, 0, 0))
        joints = [cf.Joint(j.first, j.second, "all" if j.release else None) for j in scene.joints]
        scene = cf.Scene(rods, [scene.supports[0], cf.Clamp(rods[1].end)], scene.loads, joints)
    else:
        rods, scene, elements = star(release)
    path = cf.solve(scene, [1.0], elements=elements)
    force = sum(path.force(rod.start)[0] for rod in rods)
    moment = sum(path.moment(rod.start)[0] for rod in rods) + np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(force, 0, atol=1e-9)
    np.testing.assert_allclose(moment, 0, atol=1e-11)
    ends = np.array([path.position(rod.start)[0] for rod in rods])
    np.testing.assert_allclose(ends, ends[:1].repeat(4, axis=0), atol=1e-13)
    q = np.array([path.rotation(rod.start)[0] for rod in rods])
    np.testing.assert_allclose(q[2:], q[:1].repeat(2, axis=0), atol=1e-13)
    if release is None:
        np.testing.assert_allclose(q[1], q[0], atol=1e-13)
        return
    relative = Rotation.from_quat(q[0, [1, 2, 3, 0]]).inv() * Rotation.from_quat(q[1, [1, 2, 3, 0]])
    transmitted = path.moment(rods[1].start)[0]
    assert relative.magnitude() > 0.02
    if release == "all":
        np.testing.assert_allclose(transmitted, 0, atol=1e-11)
    else:  # it rotates about the axis only, and transmits no moment about the current axis
        axis = np.array(release) / np.linalg.norm(release)
        np.testing.assert_allclose(np.cross(relative.as_rotvec(), axis), 0, atol=1e-12)
        assert abs(transmitted @ Rotation.from_quat(q[0, [1, 2, 3, 0]]).apply(axis)) < 1e-11
        assert np.linalg.norm(transmitted) > 1e-3


@pytest.mark.ranks
@pytest.mark.parametrize("release", [None, (0.3, 1.0, -0.2)])
def test_ranks_agree_on_branching_structures(release):
    rods, scene, elements = star(release)
    together = cf.solve(scene, [0.5, 1.0], elements=elements)
    alone = cf.solve(scene, [0.5, 1.0], elements=elements, comm=MPI.COMM_SELF)
    assert together.unknowns == alone.unknowns
    assert together.iterations.tolist() == alone.iterations.tolist()
    assert together.negative_modes.tolist() == alone.negative_modes.tolist()
    for rod in rods:
        np.testing.assert_allclose(together.centreline(rod=rod), alone.centreline(rod=rod), atol=1e-10)
        np.testing.assert_allclose(together.force(rod.start), alone.force(rod.start), atol=1e-7)


@pytest.mark.serial
def test_number_of_unknowns():
    """The shared node counts once; nodes have seven unknowns; a hinge adds five equations."""
    _, rigid, elements = star()
    path = cf.solve(rigid, [0.1], elements=elements, degree=2, model="spatial")
    nodes = 4 * 2 * elements + 1
    assert path.unknowns == 7 * (nodes - 1)
    _, hinged, elements = star((1.0, 0, 0))
    assert cf.solve(hinged, [0.1], elements=elements, degree=2).unknowns == 7 * nodes + 5 + 3


@pytest.mark.parametrize("elements", [1, 8])
def test_a_closed_ring(elements):
    """A closed ring, held at one point, equals two half rings joined at both ends."""
    ring = cf.Rod(cf.Arc((0, 0, 0), (1, 0, 0), 2 * np.pi), SECTION, name="ring")
    far = ring.at(np.pi)
    loads = [cf.Force(far, (-1.5, 0.3, 1.0))]
    path = cf.solve(cf.Scene([ring], [cf.Clamp(ring.start)], loads, [cf.Joint(ring.start, ring.end)]), [1.0],
                    elements=2 * elements)  # fmt: skip
    halves = [cf.Rod(cf.Arc((0, 0, 0), (side, 0, 0), np.pi), SECTION, name=f"half{side}") for side in (1, -1)]
    scene = cf.Scene(halves, [cf.Clamp(halves[0].start)], [cf.Force(halves[0].end, (-1.5, 0.3, 1.0))],
                     [cf.Joint(halves[0].end, halves[1].start), cf.Joint(halves[1].end, halves[0].start)])  # fmt: skip
    both = cf.solve(scene, [1.0], elements=elements)
    np.testing.assert_allclose(path.displacement(far), both.displacement(halves[0].end), atol=1e-10)
    np.testing.assert_allclose(path.displacement(ring.end), 0, atol=1e-14)
    assert np.linalg.norm(path.displacement(far)) > 0.3


@pytest.mark.serial
def test_apart():
    a, b, c = (line(*ends, name) for ends, name in (
        (((0, 0, 0), (1, 0, 0)), "a"), (((1, 0, 1e-3), (2, 0, 0)), "b"), (((1, 0, 0), (2, 0, 0)), "c")))  # fmt: skip
    y, clamp = (0, 1, 0), cf.Clamp(a.start)

    def solve(*joints):
        return cf.solve(cf.Scene([a, c], [clamp], [cf.Force(c.end, y)], joints), [1.0])

    for words, make in {
        "a.end at .* with b.start at .* 0.001 m apart": lambda: cf.Joint(a.end, b.start),
        "Joint.release = 'hinge'": lambda: cf.Joint(a.end, c.start, "hinge"),
        r"joints\[0\].*twice": lambda: solve(cf.Joint(a.end, c.start, y), cf.Joint(c.start, a.end, y)),
        "mechanism: rod 'c' can turn about the axis": lambda: solve(cf.Joint(a.end, c.start, y)),
        r"Clamp\(c.start\), or a Joint\(c.start, a.end\)": solve,
    }.items():
        with pytest.raises(cf.SceneError, match=words):
            make()


@pytest.mark.serial
def test_every_pair_of_three_rods_may_be_joined():
    rods = [line((0, 0, 0), tip, f"r{i}") for i, tip in enumerate([(0, 0, -1.0), (1.0, 0, 0.3), (-0.4, 0.9, 0.5)])]
    pairs = [(0, 1), (1, 2), (2, 0)]
    loads = [cf.Force(rods[1].end, FORCE)]
    shapes = []
    for joined in (pairs, pairs[:2]):
        joints = [cf.Joint(rods[i].start, rods[j].start) for i, j in joined]
        path = cf.solve(cf.Scene(rods, [cf.Clamp(rods[0].end)], loads, joints), [1.0], elements=3)
        shapes.append(path.position(rods[2].end))
    np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-13)


TURN = Rotation.from_rotvec([0.7, -1.1, 0.4])


def turned(x):
    return TURN.apply(np.asarray(x, dtype=float))


def bow():
    """A bent rod of length 1 in a general position."""
    q = TURN.as_quat()
    return cf.Rod(cf.UniformCurvature(1.0, (0.4, 0.9, 0.5), start=(3.0, 1.0, -2.0), frame=(q[3], *q[:3])), SECTION)


def solve(rod, supports, loads, **settings):
    scene = cf.Scene([rod], [cf.Clamp(rod.start), *supports], loads)
    return cf.solve(scene, [0.4, 1.0], elements=6, **settings)


def same_shape(rod, a, b, atol):
    np.testing.assert_allclose(a.centreline(), b.centreline(), atol=atol)
    for name in ("force", "moment"):
        one, other = (path.fields(-1, rod)[name] for path in (a, b))
        np.testing.assert_allclose(one, other, atol=1e3 * atol)


LOADS = (turned((0.5, 0.8, 2.0)), turned((0.3, -0.2, 0.1)))


def across(rod):
    return cf.Force(rod.at(0.5), turned((1.5, -1.0, 0.5)))


def test_a_prescribed_motion_is_what_its_reaction_would_do():
    """A tip that is displaced and rotated as by a force and a moment has these as reactions."""
    rod = bow()
    force, moment = LOADS
    pushed = solve(rod, [], [cf.Force(rod.end, force), cf.Moment(rod.end, moment), across(rod)])
    q = pushed.rotation(rod.end)[-1]
    turn = 2 * np.arctan2(np.linalg.norm(q[1:]), q[0]) * q[1:] / np.linalg.norm(q[1:])
    u = pushed.displacement(rod.end)[-1]
    moved = solve(rod, [cf.Prescribed(rod.end, displacement=u, rotation=turn)], [across(rod)])
    np.testing.assert_allclose(moved.displacement(rod.end), [0.4 * u, u], atol=1e-12)
    np.testing.assert_allclose(moved.force(rod.end)[-1], force, atol=1e-7)
    np.testing.assert_allclose(moved.moment(rod.end)[-1], moment, atol=1e-8)
    same_shape(rod, pushed, moved, 1e-10)
    free_to_turn = solve(rod, [cf.Prescribed(rod.end, displacement=u)], [across(rod), cf.Moment(rod.end, moment)])
    same_shape(rod, pushed, free_to_turn, 1e-10)


@pytest.mark.parametrize("kind", ["pin", "hinge", "roller"])
def test_reactions_replace_the_support(kind):
    rod = bow()
    axis = turned((0.2, 0.9, 0.3))
    support = {"pin": cf.Pin(rod.end), "hinge": cf.Hinge(rod.end, axis), "roller": cf.Roller(rod.end, axis)}[kind]
    # small enough for the reaction to stay below the buckling load of the rod without the support
    loads = [cf.Force(rod.at(0.5), turned((0.9, -0.6, 0.3))), cf.LineForce(rod, turned((0.24, 0.6, 0.0)))]
    held = solve(rod, [support], loads)
    u, q = held.displacement(rod.end)[-1], held.rotation(rod.end)[-1]
    force, moment = held.force(rod.end)[-1], held.moment(rod.end)[-1]
    axis = axis / np.linalg.norm(axis)
    assert np.linalg.norm(held.displacement(rod.at(0.5))[-1]) > 5e-4
    if kind == "roller":
        assert abs(u @ axis) < 1e-13 and np.linalg.norm(u) > 5e-3
        np.testing.assert_allclose(np.cross(force, axis), 0, atol=1e-8)
    else:
        np.testing.assert_allclose(u, 0, atol=1e-13)
    if kind == "hinge":
        np.testing.assert_allclose(np.cross(q[1:], axis), 0, atol=1e-13)
        assert np.linalg.norm(q[1:]) > 5e-4 and np.linalg.norm(moment) > 1e-3
        assert abs(moment @ axis) < 1e-9
    else:
        np.testing.assert_allclose(moment, 0, atol=1e-9)
    free = solve(rod, [], [*loads, cf.Force(rod.end, force), cf.Moment(rod.end, moment)])
    same_shape(rod, held, free, 1e-9)
    if kind == "pin":  # one inside the rod
        path = solve(rod, [cf.Pin(rod.at(0.37))], [cf.Force(rod.end, 0.3 * LOADS[0])])
        np.testing.assert_allclose(path.displacement(rod.at(0.37)), 0, atol=1e-13)
        np.testing.assert_allclose(path.force(rod.at(0.4))[-1], 0.3 * LOADS[0], atol=1e-8)


def test_infinite_stiffness_between_supports():
    rod = cf.Rod(bow().curve, cf.Stiffness((np.inf, np.inf), np.inf, (1.0, 2.5), 0.7))
    path = solve(rod, [cf.Pin(rod.end)], [across(rod)])
    line = path.sample(-1, rod, np.linspace(0, 1, 2001))[0]
    assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(1.0, abs=1e-6)
    assert path.stable.all()


@pytest.mark.serial
def test_follower_loads_are_dead_loads_where_they_end_up():
    rod = bow()
    force, moment = (0.9, -0.4, 0.6), (0.2, 0.3, -0.5)
    follower = solve(rod, [], [cf.FollowerForce(rod.end, force), cf.FollowerMoment(rod.at(0.5), moment)])
    turn = {s: follower.sample(-1, rod, np.array([s]))[1][0] for s in (0.5, 1.0)}
    dead = solve(rod, [], [cf.Force(rod.end, turn[1.0] @ force), cf.Moment(rod.at(0.5), turn[0.5] @ moment)])
    same_shape(rod, follower, dead, 1e-9)
    assert any("follower" in sentence and "flutter" in sentence for sentence in follower.why)
    assert not any("flutter" in sentence for sentence in dead.why)


@pytest.mark.serial
def test_line_moment_bends_without_force():
    """m' = -mu, n = 0: the angle is mu (L s - s^2/2)/EI."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), SECTION)
    path = solve(rod, [], [cf.LineMoment(rod, (0, 4.0, 0))])
    x, z = (quad(lambda s, f=f: f(4.0 * (s - s * s / 2) / 2.5), 0, 1, epsabs=1e-14)[0] for f in (np.sin, np.cos))
    np.testing.assert_allclose(path.position(rod.end)[-1], [x, 0, z], atol=1e-11)
    np.testing.assert_allclose(path.moment(rod.at(0.3))[-1], [0, 4.0 * 0.7, 0], atol=1e-9)


@pytest.mark.serial
def test_weight_is_a_line_force_on_every_rod():
    rods = [bow(), cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), SECTION)]
    clamps = [cf.Clamp(rod.start) for rod in rods]
    heavy = cf.solve(cf.Scene(rods, clamps, [cf.Weight((0, 1.0, -3.0))]), [1.0], elements=5)
    lined = cf.solve(cf.Scene(rods, clamps, [cf.LineForce(rod, (0, 1.0, -3.0)) for rod in rods]), [1.0], elements=5)
    one = cf.solve(cf.Scene(rods, clamps, [cf.LineForce(rods[1], (0, 1.0, -3.0))]), [1.0], elements=5)
    for rod in rods:
        np.testing.assert_allclose(heavy.centreline(rod=rod), lined.centreline(rod=rod), atol=1e-12)
    np.testing.assert_allclose(one.centreline(rod=rods[1]), lined.centreline(rod=rods[1]), atol=1e-12)
    assert np.abs(one.displacement(rods[0].end)).max() < 1e-13


@pytest.mark.serial
def test_refusals():
    rod, other = bow(), cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), SECTION, name="other")
    link = cf.Rod(cf.Line((1, 0, 0), (2, 0, 0)), SECTION, name="link")

    def free(*supports):
        return cf.solve(cf.Scene([other], supports, [cf.Force(other.end, (0, 0, 1))]), [1.0])

    cases = {
        "rod 'other' can turn about its own axis: expected a Hinge with axis = (0, 1, 0) in the place of the "
        "Pin at other.start, other.end (hinge_axis of a frame), if all acts in the x-z plane: in space a Pin":
            lambda: free(cf.Pin(other.start), cf.Pin(other.end)),
        "rod 'other' can turn about its own axis, and rod 'other' can turn about the axis (0, 0, 1) through (0, 0, 0) "
        "m: expected a Hinge with axis": lambda: free(cf.Pin(other.start), cf.Roller(other.end, (0, 0, 1))),
        "and rod 'other' can move along (0, 0, 1): expected": lambda: free(cf.Roller(other.start, (1, 0, 0))),
        "supports[0] (Clamp at other.start) and supports[1] (Prescribed at other.start) hold the same motion twice":
            lambda: cf.Scene([other], [cf.Clamp(other.start), cf.Prescribed(other.start, displacement=(1, 0, 0))]),
        "Scene.joints: link.start and other.end are joined twice": lambda: cf.Scene(
            [other, link], [cf.Clamp(other.start)], [], [cf.Joint(other.end, link.start),
                                                                cf.Joint("link.start", "other.end")]),
        "supports[0] (Clamp at other.start) and supports[1] (Clamp at other.start) hold the same motion twice":
            lambda: cf.Scene([other], [cf.Clamp(other.start), cf.Clamp(other.start)]),
        "hold the same motion twice": lambda: cf.Scene(
            [other], [cf.Clamp(other.start), cf.Pin(other.at(0.3)), cf.Pin(other.at(0.1 + 0.2))]),
        "hold the same motion twice, or contradict each other":
            lambda: cf.Scene([other], [cf.Clamp(other.start), cf.Roller(other.end, (0, 0, 1)), cf.Pin(other.end)]),
        "Hinge.axis = (0, 0, 0): expected a direction": lambda: cf.Hinge(rod.end, (0, 0, 0)),
        "Roller.normal": lambda: cf.Roller(rod.end, (np.nan, 0, 0)),
        "Prescribed.displacement = None": lambda: cf.Prescribed(rod.end),
        "Prescribed.rotation": lambda: cf.Prescribed(rod.end, rotation=(1, 2)),
        "FollowerForce.force": lambda: cf.FollowerForce(rod.end, "up"),
        "LineForce.rod": lambda: cf.LineForce(rod.end, (0, 0, 1)),
        "loads[0] acts at": lambda: cf.Scene([other], [cf.Clamp(other.start)], [cf.LineForce(rod, (0, 0, 1))]),
    }  # fmt: skip
    for words, case in cases.items():
        with refused(words):
            case()


@pytest.mark.serial
def test_a_small_rod_beside_a_large_one_keeps_its_stability():
    """Penalties of its supports are relative to its own stiffness, not to that of a long wire in the same scene."""
    steel = cf.Material(E=210e9, nu=0.3)
    wire = cf.Rod(cf.Line((10, 0, 0), (110, 0, 0)), cf.Circle(0.02), steel, name="wire")
    post = cf.Rod(cf.Line((0, 0, 0), (0, 0, 5.0)), cf.Circle(0.2), steel, name="post")
    P = np.pi**2 * post.stiffness.bending[0] / 5.0**2  # pinned at both ends
    supports = [cf.Clamp(wire.start), cf.Hinge(post.start, (0, 1, 0)),
                *(cf.Roller(post.end, axis) for axis in ((1, 0, 0), (0, 1, 0)))]  # fmt: skip
    scene = cf.Scene([wire, post], supports, [cf.Force(post.end, (0, 0, -P)), cf.Force(wire.end, (1.0, 0, 0))])
    path = cf.solve(scene, [0.5, 0.99], model="spatial", elements=8)
    assert path.stable.all()


@pytest.mark.serial
def test_what_is_not_determined_is_said_in_words():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((np.inf, np.inf), np.inf, (1.0, 1.0), 1.0))
    scene = cf.Scene([rod], [cf.Clamp(rod.start), cf.Pin(rod.end)], [cf.LineForce(rod, (1.0, 0, 0))])
    for model in ("auto", "spatial", "planar"):
        with pytest.raises(cf.NotConverged, match="tangent is singular"):
            cf.solve(scene, [1.0], model=model)


@pytest.mark.serial
def test_one_jump_of_more_than_half_a_turn_is_refused():
    rod = bow()
    scene = cf.Scene([rod], [cf.Clamp(rod.start), cf.Prescribed(rod.end, rotation=(0, 1.0, 0))])
    with pytest.raises(cf.SceneError, match=r"would turn by 5 rad in one step"):
        cf.solve(scene, [5.0], elements=4, steps=cf.StepControl(adaptive=False))


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("load_factors", [[1.0], [0.3, 0.6, 1.0]])
def test_many_turns_are_not_mistaken_for_fewer(load_factors):
    """Ten turns of a shaft, in torsion and in bending: steps are small enough not to skip a turn."""
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), cf.Stiffness((1e4, 1e4), 1e4, (1.0, 1.0), 0.5))
    for axis, stiffness in (((1, 0, 0), 0.5), ((0, 1, 0), 1.0)):
        turns = cf.Prescribed(rod.end, rotation=tuple(20 * np.pi * np.array(axis)))
        path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start), turns]), load_factors, elements=32)
        expected = 20 * np.pi * stiffness * np.outer(path.load_factors, axis)
        np.testing.assert_allclose(path.moment(rod.start), expected, atol=1e-5)


@pytest.mark.serial
def test_a_roller_across_the_plane_alone_changes_nothing_in_it():
    """The planar model has then no constraint equation at all."""
    rod, scene = column()
    held = cf.Scene([rod], [cf.Clamp(rod.start), cf.Roller(rod.at(5.0), (0, 1, 0))], scene.loads)
    paths = [cf.solve(x, [0.5], elements=4, model="planar") for x in (scene, held)]
    np.testing.assert_allclose(*(path.centreline() for path in paths), atol=1e-12)
    np.testing.assert_array_equal(paths[1].reaction(held.supports[1]), np.zeros((2, 1, 3)))


def shell(n, released=False):
    """A grid shell; released: every other joint at the end of a rod is a ball joint."""
    rods, supports, loads, joints = grid_shell(n)
    ends = [k for k, joint in enumerate(joints) if joint.second == joint.second.rod.end]
    for k in ends[::2] if released else ():
        joints[k] = cf.Joint(joints[k].first, joints[k].second, "all")
    return cf.Scene(rods, supports, loads, joints)


@pytest.mark.parametrize("released", [False, True])
def test_all_ranks_find_the_equilibrium_of_a_frame(released):
    """Reactions balance the load, and the ranks agree with one alone."""
    scene = shell(6, released)
    together, alone = (cf.solve(scene, [1.0], elements=1, comm=comm) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    held = sum(together.reaction(support)[0][0] for support in scene.supports)
    np.testing.assert_allclose(held, -np.array(scene.loads[0].force), atol=1e-8)  # rounding of strains
    assert together.unknowns == alone.unknowns and together.negative_modes.tolist() == alone.negative_modes.tolist()
    for rod in scene.rods[::10]:
        np.testing.assert_allclose(together.position(rod.end), alone.position(rod.end), atol=1e-12)
        np.testing.assert_allclose(together.moment(rod.end), alone.moment(rod.end), atol=1e-8)


@pytest.mark.serial
def test_hinges_cost_no_more_than_rods():
    """Twice the frame takes some two to three times as long; where the equations of all ball joints were one dense
    block, 64 of them took 25 times as long as none, and more grew with the cube."""
    times = {}
    for released in (False, True):
        scene = shell(9, released)
        cf.solve(scene, [1.0], elements=1, comm=MPI.COMM_SELF)
        begun = time.process_time()
        cf.solve(scene, [1.0], elements=1, comm=MPI.COMM_SELF)
        times[released] = time.process_time() - begun
    assert times[True] < 6 * times[False] + 0.1


@pytest.mark.parametrize("acts", ["rotation", "tendon"])
def test_a_section_that_jumps_is_two_rods(acts):
    """Nodes at the jump have the data of their side: inertia of a rotation, and what a tendon leaves to the rod."""
    steel, thick, thin = cf.Material(1e8, 0.3, 1200.0), cf.Circle(0.03), cf.Circle(0.02)
    whole = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), [(0.4, thick), (None, thin)], steel, name="whole")
    a = cf.Rod(cf.Line((0, 0, 0), (0.4, 0, 0)), thick, steel, name="a")
    b = cf.Rod(cf.Line((0.4, 0, 0), (1, 0, 0)), thin, steel, name="b")

    def solved(rods, joints=()):
        acting = [cf.Tendon(rod, (0.02, 0), tension=20.0) for rod in rods]
        acting = [cf.Centrifugal((0.0, 1.0, 2.0))] if acts == "rotation" else acting
        loads = [*acting, cf.Force(rods[-1].end, (0, 0, -0.3))]
        return cf.solve(cf.Scene(rods, [cf.Clamp(rods[0].start)], loads, joints), [1.0], elements=10)

    one, two = solved([whole]), solved([a, b], [cf.Joint(a.end, b.start)])
    for s in (0.0, 0.35, 0.38, 0.4):
        assert one.force(whole.at(s))[-1] == pytest.approx(two.force(a.at(s))[-1], rel=1e-7, abs=1e-9)
    assert one.displacement(whole.end)[-1] == pytest.approx(two.displacement(b.end)[-1], rel=1e-8, abs=1e-12)
