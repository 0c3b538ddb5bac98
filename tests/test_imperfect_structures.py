"""Imperfect symmetric structures: the path is that of small steps, and a limit point is no bifurcation."""

import imperfect_structures
import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.statics.path.events import Locator
from cosserat_fenicsx.statics.path.track import PathPoint

pytestmark = pytest.mark.serial


def hinged_arch(sideways):
    """A hinged circular arch of half-angle 0.6 rad with a force on its crown, a part of it sideways: (crown, scene)."""
    R, half, axis = 10.0, 0.6, (0, 1, 0)
    curve = cf.Arc((0, 0, 0), (-R * np.sin(half), 0, R * np.cos(half)), 2 * half, axis)
    rod = cf.Rod(curve, cf.Stiffness((1e5, 1e5), 1e5, (1.0, 100.0), 100.0))
    crown = rod.at(R * half)
    supports = [cf.Hinge(end, axis) for end in (rod.start, rod.end)]
    return crown, cf.Scene([rod], supports, [cf.Force(crown, (sideways, 0, -1.0))])


#: By small steps (and, of 1e-2, by shooting of the strong form): the limit points, and the crown at load factor 0.6.
ARCH = {
    3e-2: ((0.18983433, -0.10203886), (4.12838e-4, 0, -3.692597)),
    1e-2: ((0.19421969, -0.10447634), (1.37607e-4, 0, -3.692603)),
    1e-3: ((0.19759409, -0.10636187), (1.37607e-5, 0, -3.692604)),
    1e-4: ((0.19834251, -0.10678178), (1.37607e-6, 0, -3.692604)),
}


@pytest.mark.parametrize("control", ["auto", "arc"])
@pytest.mark.parametrize("sideways", ARCH)
def test_an_imperfect_arch_snaps_through(sideways, control):
    crown, scene = hinged_arch(sideways)
    limits, end = ARCH[sideways]
    path = cf.solve(scene, (0, 0.6), elements=8, control=control)
    assert [event.kind for event in path.events] == ["limit", "limit"]
    np.testing.assert_allclose([event.load_factor for event in path.events], limits, rtol=2e-6)
    np.testing.assert_allclose(path.displacement(crown)[-1], end, atol=3e-6)
    assert path.stable[-1] and not [said for said in path.why if "negative modes go" in said]


def test_the_imperfect_arch_with_an_estimate():
    crown, scene = hinged_arch(1e-2)
    path = cf.solve(scene, (0, 0.6))
    assert [event.kind for event in path.events] == ["limit", "limit"] and path.error.max() <= 1e-6
    np.testing.assert_allclose(path.displacement(crown)[-1], ARCH[1e-2][1], atol=3e-6)


@pytest.mark.parametrize("sideways", [1e-3, 3e-4, 1e-4, 1e-5])
@pytest.mark.parametrize("top", [0.3, 1.0, 5.0])
def test_the_first_event_of_an_imperfect_arch_is_a_limit_point(sideways, top):
    _, scene = hinged_arch(sideways)
    path = cf.solve(scene, (0, top), elements=8, control="arc", until=lambda path: path.events)
    assert path.events[0].kind == "limit"


# an arch, a toggle that is nearly perfect, a dome of six arcs
@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3, 12])
def test_structures_follow_small_steps(seed):
    given = imperfect_structures.structure(seed)
    truth = imperfect_structures.small_steps(given, imperfect_structures.STEP)
    assert truth.events and truth.reached
    for control in imperfect_structures.CONTROLS:
        verdict, words, _ = imperfect_structures.outcome(given, truth, control, elements=8)
        assert verdict == "right", f"{given.kind}, {control}: {words}"


def test_load_control_does_not_step_over_a_limit_point():
    """It went on at 5.98 on another path with a negative mode."""
    given = imperfect_structures.structure(103)
    by_load, by_arc = (cf.solve(given.scene, (0, given.top), elements=8, control=c) for c in ("auto", "arc"))
    assert [event.kind for event in by_load.events] == ["limit", "limit"] and by_load.stable[-1]
    apex = given.stations[0]
    np.testing.assert_allclose(by_load.displacement(apex)[-1], by_arc.displacement(apex)[-1], atol=1e-8)


@pytest.mark.slow
def test_two_paths_beside_each_other_are_no_bifurcation():
    """Two arches whose crowns are tied: at its tenth limit point the path turns off by 3e-4 of the load factor before a
    bifurcation of the path beside it."""
    half, gap, axis, load = 0.38413884, 2.9, (0, 1, 0), 1.00076
    R = 1 / half
    section = imperfect_structures._section(880.0, 2.0)
    rods = [
        cf.Rod(cf.Arc((x, 0, 0), (x - R * np.sin(half), 0, R * np.cos(half)), 2 * half, axis), section, name=f"at {x}")
        for x in (0.0, gap)
    ]
    tie = cf.Rod(cf.Line((0, 0, R), (gap, 0, R), d1=axis), imperfect_structures._section(880.0, gap), name="tie")
    crowns = [rod.at(rod.length / 2) for rod in rods]
    scene = cf.Scene(
        [*rods, tie],
        [cf.Hinge(end, axis) for rod in rods for end in (rod.start, rod.end)],
        [cf.Force(crowns[0], (0, 0, -load)), cf.Force(crowns[1], (0, 0, -1.0))],
        [cf.Joint(crowns[0], tie.start), cf.Joint(crowns[1], tie.end)],
    )
    path = cf.solve(scene, (0, 18), elements=8, control="arc", until=lambda path: len(path.events) == 10)
    assert {event.kind for event in path.events} == {"limit"}
    assert path.events[-1].load_factor == pytest.approx(-3.1996880, abs=1e-6)  # by small steps


def test_load_control_does_not_step_over_two_limit_points():
    """A gable frame whose ridge snaps through from 7.24 to 7.13: one step of load control was as long as that."""
    rise, height, axis = 0.3945717, 0.7556963, (0, 1, 0)
    rafter = cf.Stiffness((6931.0, 6931.0), 20793.5, (1.0, 100.0), 100.0)
    post = cf.Stiffness((146830.0, 146830.0), 146830.0, (14.683, 1468.3), 1468.3)
    apex = (0, 0, height + rise)
    left, right = (
        cf.Rod(cf.Line(*ends, d1=axis), rafter, name=name)
        for name, ends in (("left", ((-1, 0, height), apex)), ("right", (apex, (1, 0, height))))
    )
    posts = [cf.Rod(cf.Line((x, 0, 0), (x, 0, height), d1=axis), post, name=f"at {x}") for x in (-1, 1)]
    joints = [cf.Joint(posts[0].end, left.start), cf.Joint(left.end, right.start), cf.Joint(right.end, posts[1].end)]
    load = cf.Force(left.end, (0.01089104, 0, -1.0))
    scene = cf.Scene([posts[0], left, right, posts[1]], [cf.Clamp(x.start) for x in posts], [load], joints)
    path = cf.solve(scene, (0, 19.029), elements=8)
    assert [event.kind for event in path.events] == ["limit", "limit"]
    np.testing.assert_allclose([event.load_factor for event in path.events], [7.2426, 7.1325], atol=1e-3)


@pytest.mark.parametrize(("end", "follows"), [(8.71102, True), (8.71139, False)])
def test_the_load_factor_changes_in_the_direction_of_the_path(end, follows):
    """Of two arches that cross at their crowns: a step led upwards between two points where the load factor falls."""

    class Straight:
        without_potential = False

    a, b = (PathPoint(eta, [], 1, 3, rise=rise) for eta, rise in ((8.71115, -0.025), (end, -0.069)))
    assert Locator(Straight())._explained(a, b, []) is follows
