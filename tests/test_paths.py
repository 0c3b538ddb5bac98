"""Limit points, snap-through, bifurcations, branches and events; solvers called from within others."""

import contextlib
import dataclasses
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import COMM, column, refuses
from moving_scenes import SPAGHETTI
from mpi4py import MPI
from path_scenes import (
    ARCH_BIFURCATIONS,
    ARCH_LIMITS,
    LEE_LIMITS,
    clamped_ring,
    lees_frame,
    pendulum_limits,
    shallow_arch,
    torsion_pendulum,
)
from scipy.optimize import brentq

import cosserat_fenicsx as cf
from cosserat_fenicsx.algebra.pool import PROBLEMS, ProblemPool
from cosserat_fenicsx.results import compared
from cosserat_fenicsx.results.records import find_again, keep_confirmed
from cosserat_fenicsx.statics import refinement
from cosserat_fenicsx.statics.path.events import Locator
from cosserat_fenicsx.statics.path.recorder import Tracing

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)


def loads(path, kind):
    return [event.load_factor for event in path.events if event.kind == kind]


def told(path):
    return [sentence for sentence in path.why if "negative modes go" in sentence or "not listed" in sentence]


def lie_between_their_points(path):
    eta = path.load_factors
    assert path.events and not told(path)
    for event in path.events:
        before, after = eta[event.after], eta[event.after + 1]
        turns = (event.load_factor - before) * (event.load_factor - after) > 0
        assert turns == (event.kind == "limit") and event.residual <= 1e-6


def exact_tip(rod, etas, eccentricity):
    """The exact rod of a column of 20 m."""
    k = rod.stiffness
    return cf.analytic.reissner(
        np.array(etas), eccentricity, 20.0, bending=min(k.bending), axial=k.axial, shear=k.shear[0]
    )


def perfect_column(section):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), section, STEEL)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -cf.euler_load(rod)))])
    return rod, scene


def critical(rod, mode=1):
    """Exact: EI theta'' + P (1 + P (1/GA - 1/EA)) theta = 0, over P_cr."""
    k, P = rod.stiffness, cf.euler_load(rod)
    c = P * (1 / k.shear[0] - 1 / k.axial)
    ratio = sorted([(2 * n - 1) ** 2 * EI / min(k.bending) for n in (1, 2) for EI in k.bending])[mode - 1]
    return (np.sqrt(1 + 4 * c * ratio) - 1) / (2 * c)


@pytest.mark.parametrize("control", ["auto", pytest.param("arc", marks=pytest.mark.serial)])
def test_limit_points_in_closed_form(control):
    rod, scene, load = torsion_pendulum()
    path = cf.solve(scene, (0.0, 20.0), elements=8, control=control)
    np.testing.assert_allclose(loads(path, "limit"), pendulum_limits(load), rtol=1e-9)
    assert len(path.events) == 2 and path.control == "arc"
    lie_between_their_points(path)
    assert path.load_factors[0] == 0 and path.load_factors[-1] == 20.0
    limits = [event.after for event in path.events]
    between = np.arange(len(path))
    expected = (between > limits[0]) & (between <= limits[1])
    np.testing.assert_array_equal(path.negative_modes, expected)
    twist = path.rotation_angle(rod.end)  # folds at 2 pi
    shown = np.where(load(twist) - path.load_factors > 1e-6, np.nan, twist)
    np.testing.assert_allclose(load(twist)[: limits[1]], path.load_factors[: limits[1]], rtol=1e-9)
    assert np.isfinite(shown[: limits[1]]).all() and (np.diff(shown[: limits[1]]) > 0).all()


@pytest.mark.serial
def test_load_control_alone_says_what_it_met():
    _, scene, load = torsion_pendulum()
    with pytest.raises(cf.NotConverged, match="There may be a limit point.*control='auto'") as refusal:
        cf.solve(scene, (0.0, 20.0), elements=4, control="load")
    with pytest.raises(cf.NotConverged, match="There may be a limit point.*model='spatial'"):
        cf.solve(shallow_arch()[-1], (0.0, 40.0), elements=8, model="planar")
    reached = refusal.value.path.load_factors[-1]
    assert pendulum_limits(load)[0] * 0.999 < reached < pendulum_limits(load)[0]
    with pytest.raises(cf.NotConverged, match="3 steps of arc length did not reach it"):
        cf.solve(scene, (0.0, 20.0), elements=4, control="arc", steps=cf.StepControl(most_steps=3))
    with pytest.raises(cf.NotConverged, match=r"stability at the load factor 8.16.*\(limit\): ask for .* up to there;"):
        cf.solve(scene, (0.0, 20.0), elements=4, steps=cf.StepControl(most_steps=6))
    path = cf.solve(scene, (0.0, 20.0), elements=4, control="arc", steps=cf.StepControl(largest=1.0))
    assert np.abs(np.diff(path.load_factors)).max() <= 1.0


@pytest.mark.serial
def test_load_factors_are_the_next_along_the_path_or_the_next_of_load_control():
    rod, scene, load = torsion_pendulum()
    path = cf.solve(scene, [5.0, 5.0, 5.0, 3.0], elements=4, control="arc")  # 3.0 comes after the turn at 39.3
    twist = path.rotation_angle(rod.end)
    np.testing.assert_allclose(load(twist[:3]), 5.0, rtol=2e-8)
    assert (np.diff(twist[:3]) > 0.5).all() and path.negative_modes[:3].tolist() == [0, 1, 0]
    path = cf.solve(scene, [5.0, 10.0, 2.5, 1.0], elements=8)
    assert path.stable.all() and len(path.events) == 4  # up through both limit points, and all the way back
    np.testing.assert_allclose(load(path.rotation_angle(rod.end)[[0, 3]]), [5.0, 1.0], rtol=1e-9)


@pytest.mark.serial
def test_a_path_that_begins_nearly_linearly_takes_long_steps():
    """Where they are no results: of a tenth of the way the first one, then to the load factors."""
    _, scene = column()
    assert cf.solve(scene, [0.05, 0.1], elements=4).steps.tolist() == [2, 3]
    recorded = cf.solve(scene, (0.0, 0.1), elements=4).load_factors
    np.testing.assert_allclose(recorded[:3], [0.0, 0.01, 0.03], rtol=1e-12)


@pytest.mark.parametrize("far", [45.0, 20000.0])
@pytest.mark.parametrize("control", ["auto", pytest.param("arc", marks=pytest.mark.serial)])
def test_shallow_arch(control, far):
    """Also if the first step of load control would jump over the whole snap-through."""
    rod, crown, scene = shallow_arch()
    path = cf.solve(scene, (0.0, far), elements=16, control=control)
    lie_between_their_points(path)
    np.testing.assert_allclose(loads(path, "limit"), ARCH_LIMITS, rtol=2e-8)
    np.testing.assert_allclose(loads(path, "bifurcation"), ARCH_BIFURCATIONS, rtol=2e-7)
    skew = path.mode(next(event for event in path.events if event.kind == "bifurcation"), rod)
    snap = path.mode(path.events[0], rod)
    # 1e-9 as a rule; where an event is met to rounding, that of the bounded stiffnesses (1e8 EI/L^2) over the gap to
    # the next eigenvalue: 1.1e-4 was seen with dolfinx 0.9
    np.testing.assert_allclose(snap[:, :2], snap[::-1, :2] * [-1, 1], atol=1e-3)
    np.testing.assert_allclose(skew[:, :2], skew[::-1, :2] * [1, -1], atol=1e-3)
    for mode in (snap, skew):
        assert np.linalg.norm(mode, axis=1).max() == pytest.approx(1)
        np.testing.assert_allclose(mode[:, 2], 0, atol=1e-9)
    assert {0, 1, 2} == set(cf.solve(scene, [33.0, 25.0, 17.0], elements=8, control="arc").negative_modes.tolist())


@pytest.mark.serial
def test_a_path_through_limit_points_meets_its_tolerance():
    rod, crown, scene = shallow_arch()
    path = cf.solve(scene, (0.0, 45.0), tol=1e-6)
    assert path.error.max() <= 1e-6 and path.control == "arc" and min(path.elements) >= 16
    assert len(path.events) == 4 and all(0 < event.error <= 1e-6 for event in path.events)
    assert all(np.isnan(event.error) for event in cf.solve(scene, [45.0], elements=8).events)
    np.testing.assert_allclose(loads(path, "limit"), ARCH_LIMITS, rtol=2e-8)
    np.testing.assert_allclose(loads(path, "bifurcation"), ARCH_BIFURCATIONS, rtol=2e-7)
    fine = cf.solve(scene, path.load_factors[[0, -1]].tolist(), elements=64)
    np.testing.assert_allclose(path.displacement(crown)[-1], fine.displacement(crown)[-1], atol=2e-6)
    with pytest.warns(cf.SceneWarning, match="the path passes a limit point"):
        listed = cf.solve(scene, [30.0, 40.0], tol=1e-6)
    assert (listed.error <= 1e-6).all() and listed.stable.all() and len(loads(listed, "limit")) == 2
    for snapped in (path, listed):
        told = f"limit load factor is {loads(snapped, 'limit')[0]:.6g}: what follows lies beyond it."
        assert told in str(snapped).splitlines()[0] and "lies beyond it" not in str(snapped.at_points([0]))


@pytest.mark.parametrize("control", ["auto", pytest.param("arc", marks=pytest.mark.serial)])
def test_lees_frame_snaps_back(control):
    loaded, scene = lees_frame()
    path = cf.solve(scene, (0.0, 20000.0), elements=8, control=control)
    np.testing.assert_allclose(loads(path, "limit"), LEE_LIMITS, rtol=1e-5)
    lie_between_their_points(path)
    turns = np.diff(path.displacement(loaded)[:, 1])
    assert (turns > 0).any() and (turns < 0).any()  # the displacement turns too: snap-back
    assert path.iterations.sum() < 400


@pytest.mark.parametrize("section, count", [(cf.Circle(0.2), 2), (cf.Rectangle(0.2, 0.25), 1)])
def test_perfect_column_bifurcates_at_its_exact_critical_loads(section, count):
    rod, scene = perfect_column(section)
    path = cf.solve(scene, [0.5, 2.0], elements=16)
    np.testing.assert_allclose(loads(path, "bifurcation"), [critical(rod, 1), critical(rod, 2)], rtol=2e-8)
    assert path.negative_modes.tolist() == [0, 2] and path.control == "load"
    assert [event.after for event in path.events] == [0, 0]
    x, y = (path.mode(event, rod) for event in path.events)
    s = path.fields(0, rod)["s"] / rod.length
    shape = 1 - np.cos(np.pi / 2 * s)
    np.testing.assert_allclose(x, shape[:, None] * [1.0, 0, 0], atol=1e-4)
    np.testing.assert_allclose(y, shape[:, None] * [0, 1.0, 0], atol=1e-4)


@pytest.mark.parametrize("section", [cf.Circle(0.2), cf.Rectangle(0.2, 0.25)])
@pytest.mark.parametrize("branch", [1, pytest.param(-1, marks=pytest.mark.serial)])
def test_branch_of_the_perfect_column(section, branch):
    """The buckled column against the exact rod as its eccentricity tends to zero, also by a tolerance; a round one may
    also rotate about its axis, a neutral motion that is not counted."""
    rod, scene = perfect_column(section)
    path = cf.solve(scene, [0.5, 1.0005, 1.1, 2.0], elements=16, branch=branch)
    accurate = cf.solve(scene, (0.0, 2.0), branch=branch, tol=1e-6)
    exact = exact_tip(rod, [1.0005, 1.1, 2.0], 2e-10)
    tip = path.displacement(rod.end)
    np.testing.assert_allclose(tip[1:, 0], branch * exact.delta, rtol=1e-6)
    np.testing.assert_allclose(tip[1:, 2], -exact.shortening, rtol=1e-5)
    assert np.abs(tip[:, 1]).max() < 1e-6 and np.abs(tip[0, :2]).max() < 1e-9
    assert accurate.error.max() <= 1e-6
    assert accurate.displacement(rod.end)[-1, 0] == pytest.approx(branch * exact.delta[-1], rel=1e-6)
    for found in (path, accurate):
        assert found.stable.all() and found.left
        assert loads(found, "bifurcation") == pytest.approx([critical(rod)], rel=2e-8)


@pytest.mark.serial
def test_an_unstable_end_is_warned_of_once_where_nobody_asked_for_it():
    rod, scene = perfect_column(cf.Circle(0.2))

    def warned(load_factors, **more):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            cf.solve(scene, load_factors, elements=4, **more)
        return [str(x.message) for x in said if x.category is cf.SceneWarning and x.filename == __file__]

    (words,) = warned([0.5, 1.1])
    assert words.startswith("the last state of the path is unstable") and "branch=1" in words and "Ball" not in words
    assert warned([0.5, 1.1], model="determinate")[0].startswith("Unstable out of its plane at the load factor 1.1")
    assert warned([1.1, 1.2]) == [words]
    assert not warned([1.1, 0.9]) and not warned([0.5, 1.1], branch=1) and not warned([1.1], control="arc")
    assert not warned((0.0, 1.1), until=lambda path: path.load_factors[-1] == 1.1)
    scene = cf.Scene([rod], scene.supports, [cf.FollowerForce(rod.end, (0, 0, -2 * cf.euler_load(rod)))])
    assert not warned([1.0])
    arms = [cf.Rod(cf.Line((0, 0, 0), (x, 0, 0)), cf.Circle(0.01), STEEL, name=f"x{x}") for x in (1, -1)]
    force = cf.Force(arms[0].start, (80 * arms[0].stiffness.bending[0], 0, 0))
    ball = cf.Joint(arms[0].start, arms[1].start, "all")
    scene = cf.Scene(arms, [cf.Clamp(x.end) for x in arms], [force], [ball])
    assert "frame? Ball joints let rods turn about every axis: release=axis of a Joint" in warned([1.0])[0]


@pytest.mark.serial
def test_a_ring_sways_and_tips():
    """In its plane, whatever its stiffness out of it; out of it if that is low. The branches are mirror images."""
    sways = []
    for out_of_plane in (50.0, 1.0):
        top, scene = clamped_ring(out_of_plane)
        path = cf.solve(scene, (0.0, 4.0), elements=16)
        lie_between_their_points(path)
        in_plane = [event for event in path.events if abs(event.mode[:, 2]).max() < 1e-6]
        sways.append(in_plane[0].load_factor)
    assert sways[0] == pytest.approx(sways[1], rel=1e-7)
    first = path.events[0]
    assert first.load_factor < sways[0] and abs(first.mode[:, :2]).max() < 1e-6
    there, back = (cf.solve(scene, [2.0, 4.0], elements=16, branch=branch) for branch in (1, -1))
    assert there.stable.all() and back.stable.all()
    assert (there.displacement(top)[:, 2] > 0.5).all()
    np.testing.assert_allclose(there.displacement(top), back.displacement(top) * [1, 1, -1], atol=1e-8)


def test_a_bifurcation_is_found_once(monkeypatch):
    """Rounding decides how many modes are negative at the bifurcation itself, from which the branch sets out."""
    located = Locator._singular

    def unsure(*given):
        found = located(*given)
        for crossing in found:
            crossing.point.negative_modes += 1
        return found

    monkeypatch.setattr(Locator, "_singular", unsure)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1e4, 1e4), 1e5, (1.0, 2.0), 1.0))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -cf.euler_load(rod)))])
    path = cf.solve(scene, (0.5, 1.1), elements=4, model="spatial", branch=1)
    assert path.left and len(path.events) == 1 and path.stable.all()


@pytest.mark.serial
def test_a_closed_branch_is_no_way_to_higher_loads():
    _, _, scene = shallow_arch()
    with pytest.raises(cf.NotConverged, match="the path is closed") as refusal:
        cf.solve(scene, (0.0, 40.0), elements=8, branch=1)
    assert refusal.value.path.left and 10 < len(refusal.value.path) < 60


def test_until():
    _, crown, scene = shallow_arch()
    path = cf.solve(scene, (0.0, 45.0), elements=8, until=lambda path: path.displacement(crown)[-1, 1] < -1.0)
    v = path.displacement(crown)[:, 1]
    assert v[-1] < -1.0 and (v[:-1] >= -1.0).all() and len(loads(path, "limit")) == 1


def test_prescribed_motion_by_arc_length():
    """The load factor moves a station, and is in the residual only through the constraint equations."""
    rod, _ = perfect_column(cf.Circle(0.2))
    motion = cf.Prescribed(rod.end, displacement=(3.0, 0.0, -6.0), rotation=(0.0, 1.2, 0.0))
    scene = cf.Scene([rod], [cf.Clamp(rod.start), motion], [])
    by_load, by_arc = (
        cf.solve(scene, [0.3, 1.0], elements=8, control=control, model="spatial") for control in ("load", "arc")
    )
    for station in (rod.at(7.0), rod.end):
        np.testing.assert_allclose(by_arc.position(station), by_load.position(station), atol=1e-9)
    np.testing.assert_allclose(by_arc.force(rod.start), by_load.force(rod.start), rtol=1e-6, atol=1e-3)


@pytest.mark.serial
@pytest.mark.parametrize("eccentricity", [1e-3, 1e-5, 1e-7])
def test_nearly_perfect_columns_follow_their_own_branch(eccentricity):
    rod, scene = column(eccentricity=20.0 * eccentricity)
    path, exact = cf.solve(scene, [1.5], elements=8), exact_tip(rod, [1.5], 20.0 * eccentricity)
    assert path.stable.all() and path.events == []
    assert path.displacement(rod.end)[0, 0] == pytest.approx(exact.delta[0], rel=1e-6)


test_arguments_that_are_refused = pytest.mark.serial(refuses({
    "control": (dict(control="arclength"), "control = 'arclength': did you mean"),
    "branch": (dict(branch=2), "branch = 2: expected 1, -1 or None"),
    "branch by load": (dict(branch=1, control="load"), "branch: expected control 'auto' or 'arc'"),
    "fixed steps": (dict(control="arc", steps=cf.StepControl(adaptive=False)), "expected adaptive steps"),
    "until": (dict(until=lambda path: True), "until: expected a function of the Path, with a pair"),
}, lambda arguments: cf.solve(column()[1], [0.5], **arguments)))  # fmt: skip


@pytest.mark.parametrize("weak", [1.0, 3.0])
@pytest.mark.parametrize("elements", [pytest.param(None, marks=pytest.mark.serial), 8])
def test_an_inextensible_column_stands_still_until_it_buckles(weak, elements):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((np.inf, np.inf), np.inf, (1.0, weak), 1.0))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -(np.pi**2) / 4))])
    path = cf.solve(scene, (0, 1.2), elements=elements)
    np.testing.assert_allclose([event.load_factor for event in path.events], 1.0, rtol=1e-8)
    assert len(path.events) == (2 if weak == 1.0 else 1)
    assert path.load_factors[-1] == 1.2 and (np.diff(path.load_factors) > 0).all()
    assert np.abs(path.displacement(rod.end)).max() < 1e-12


def t_frame(soft, k=1.5):
    """A column (EI = 1 and k) under a beam that is softer by a factor, with guided ends."""

    def section(EI, k):
        return cf.Stiffness((1e4 * EI,) * 2, 2e4 * EI, (EI, k * EI), EI)

    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), section(1.0, k), name="column")
    left = cf.Rod(cf.Line((-0.8, 0, 1), (0, 0, 1)), section(soft, 1.0), name="left")
    right = cf.Rod(cf.Line((0, 0, 1), (0.8, 0, 1)), section(soft, 1.0), name="right")
    guides = [cf.Roller(end, axis) for end in (left.start, right.end) for axis in ((0, 0, 1), (0, 1, 0))]
    joints = [cf.Joint(column.end, left.end), cf.Joint(column.end, right.start)]
    return cf.Scene(
        [column, left, right], [cf.Clamp(column.start), *guides], [cf.Force(column.end, (0, 0, -1.0))], joints
    )


@pytest.mark.serial
def test_bifurcations_are_neither_lost_nor_found_twice():
    """The lowest mode is that of a soft member until that of another crosses zero: the lowest eigenvalue has a kink."""
    scene = t_frame(0.1)
    fine = cf.solve(scene, [3.0, 4.0, 9.0]).events
    for load_factors in ([3.0, 9.0], (0.0, 9.0)):
        found = cf.solve(scene, load_factors).events
        assert [event.kind for event in found] == ["bifurcation"] * 2
        np.testing.assert_allclose([e.load_factor for e in found], [e.load_factor for e in fine], rtol=1e-6)
    np.testing.assert_allclose([e.load_factor for e in fine], [3.410490, 5.058076], rtol=1e-6)


@pytest.mark.serial
@pytest.mark.parametrize(
    "soft", [pytest.param(1e-2, marks=pytest.mark.serial), pytest.param(1e-6, marks=pytest.mark.serial), 1e-10]
)
def test_soft_members_hide_no_bifurcation(soft):
    """A propped column, (4.4934)^2, whose head is joined to a rod that is softer by orders of magnitude."""
    rigid = (np.inf,) * 2, np.inf
    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness(*rigid, (1.0, 50.0), 1.0), name="column")
    stub = cf.Rod(cf.Line((0, 0, 1), (0, 1, 1)), cf.Stiffness(*rigid, (soft, soft), soft), name="stub")
    held = [cf.Clamp(column.start), *(cf.Roller(stub.start, axis) for axis in ((1, 0, 0), (0, 1, 0))),
            cf.Prescribed(stub.end, rotation=(0, 0, 0))]  # fmt: skip
    joint, load = cf.Joint(column.end, stub.start, release="all"), cf.Force(column.end, (0, 0, -1.0))
    path = cf.solve(cf.Scene([column, stub], held, [load], [joint]), [19.0, 22.0], model="spatial")
    assert path.negative_modes.tolist() == [0, 1]
    assert [e.load_factor for e in path.events] == pytest.approx([4.493409457909064**2], rel=1e-6)


@pytest.mark.serial
@pytest.mark.parametrize(("apart", "counts"), [(9e-12, False), (2e-11, True)])
def test_rounding_of_a_column_that_keeps_its_line_is_no_error(apart, counts):
    """Positions of two meshes differ by rounding times a load near that of buckling."""
    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((np.inf,) * 2, np.inf, (1.0, 1.0), 1.0))
    scene = cf.Scene([column], [cf.Clamp(column.start)], [cf.Force(column.end, (0, 0, -1.0))])
    fine, coarse = (cf.solve(scene, 2.0, elements=n, model="spatial") for n in (4, 2))
    coarse._motion[..., 0] += apart
    assert (compared.differences(fine, coarse)[0][0] > 0).all() == counts


@pytest.mark.serial
def test_thin_guys_hold_a_mast_in_the_count_of_its_modes():
    """Its buckling between its foot and the guyed head, twice, which guys of bounded stiffness would lower."""
    steel = cf.Material(E=210e9, nu=0.3)
    mast = cf.Rod(cf.Line((0, 0, 0), (0, 0, 30)), cf.Tube(0.2191, 0.2031), steel, name="mast")
    feet = [(20 * np.cos(a), 20 * np.sin(a), 0.0) for a in np.deg2rad([0, 120, 240])]
    guys = [cf.Rod(cf.Line(foot, (0, 0, 30)), cf.Circle(0.016), steel) for foot in feet]
    tight = [cf.Pretension(guy, force=10e3) for guy in guys]
    clamps, joints = [cf.Clamp(rod.start) for rod in (mast, *guys)], [cf.Joint(mast.end, guy.end) for guy in guys]
    scene = cf.Scene([mast, *guys], clamps, [*tight, cf.Force(mast.end, (0, 0, -30e3))], joints)
    assert cf.solve(scene, [3.9, 4.5], tol=1e-4).negative_modes.tolist() == [0, 2]
    path, linear = cf.solve(scene, [3.9, 4.5], elements=4), cf.buckling(scene, 2, load_factor=3.9)
    assert path.negative_modes.tolist() == [0, 2]
    assert [event.load_factor for event in path.events] == pytest.approx(linear.load_factors.tolist(), rel=3e-5)


DEMOS = Path(__file__).parent.parent / "demos"


def lees_frame_with_a_follower():
    scene = cf.read(DEMOS / "lees_frame.toml").scene
    load = cf.FollowerForce(scene.rod("beam").at(24.0), (0, -1e4, 0))
    return cf.Scene(scene.rods, scene.supports, [load], scene.joints)


def spring():
    """A clamped spring of sixteen turns, compressed by a fifth of its height and more."""
    rod = cf.Rod(cf.Helix((0, 0, 0), (0.05, 0, 0), 16, 0.05), cf.Circle(0.005), cf.Material(E=200e9, nu=0.3))
    pressed = cf.Prescribed(rod.end, displacement=(0, 0, -0.8), rotation=(0, 0, 0))
    return cf.Scene([rod], [cf.Clamp(rod.start), pressed], [])


@pytest.mark.serial
def test_an_event_is_not_beyond_the_end_and_of_one_kind():
    scene = lees_frame_with_a_follower()
    assert cf.solve(scene, [3.5], elements=16).events == []
    path = cf.solve(scene, (0.0, 10.0), elements=16)
    assert [event.kind for event in path.events] == ["limit"] * 2
    np.testing.assert_allclose([event.load_factor for event in path.events], [3.53997598, -1.38118014], rtol=1e-8)
    lie_between_their_points(path)


@pytest.mark.serial
def test_divergence_under_a_follower_load():
    """A pinned column, loaded at half its height: tan(k/2) = -k/2, P = k^2; indefinite long before if symmetrised."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0), d1=(1, 0, 0)), cf.Stiffness((np.inf,) * 2, np.inf, (1.0, 4.0), 1.0))
    guides = [cf.Roller(rod.end, axis) for axis in ((1, 0, 0), (0, 1, 0))]
    scene = cf.Scene([rod], [cf.Hinge(rod.start, (1, 0, 0)), *guides], [cf.FollowerForce(rod.at(0.5), (0, 0, -1.0))])
    exact = [4 * brentq(lambda z: np.tan(z) + z, *ends) ** 2 for ends in ((2.0, 2.1), (4.8, 5.0))]
    path = cf.solve(scene, [15.0, 16.0, 18.0, 50.0, 110.0], elements=16, model="spatial")
    assert [(event.kind, event.after) for event in path.events] == [("bifurcation", 1), ("bifurcation", 3)]
    np.testing.assert_allclose([event.load_factor for event in path.events], exact, rtol=1e-7)
    assert (path.negative_modes[:3] == 1).all()
    lie_between_their_points(path)


@pytest.mark.serial
def test_a_slender_spring_is_stable_where_it_bends_sideways():
    """With K bounded by the length of its wire there were negative modes, and a bifurcation at 0.807."""
    path = cf.solve(spring(), (0.0, 0.5), elements=128)
    assert path.stable.all() and path.events == [] and not told(path)


@pytest.mark.serial
@pytest.mark.parametrize("few_new, finer", [(4, 1), (3, 0)])
def test_accurate_points_are_returned_where_events_alone_depend_on_the_mesh(monkeypatch, few_new, finer):
    """At most one finer mesh is solved for events alone where that fails; none where each mesh has other events."""
    scene, again, failed = shallow_arch()[2], Tracing.again, []
    accurate = cf.solve(scene, (0.0, 45.0), tol=1e-5)

    def lost(self, coarse):
        if max(self.path.elements) > max(accurate.elements):
            failed.append(self.path.elements)
            raise cf.NotConverged("lost", self.path)
        return again(self, coarse)

    monkeypatch.setattr(Tracing, "again", lost)
    monkeypatch.setattr(refinement, "find_again", lambda fine, coarse: [])
    monkeypatch.setattr(refinement, "_REFINEMENT", dataclasses.replace(refinement._REFINEMENT, few_new=few_new))
    path = cf.solve(scene, (0.0, 45.0), tol=1e-5)
    assert path.elements == accurate.elements and path.error.max() <= 1e-5 and len(failed) == finer
    assert path.events == [] and sum("could not be confirmed" in why for why in path.why) == 4


@pytest.mark.serial
def test_what_depends_on_the_mesh_is_told(monkeypatch):
    meet = Tracing._meet

    def drifting(self, crossing):
        eta = crossing.point.load_factor + 1e-3 / self.path.elements[0]
        point = dataclasses.replace(crossing.point, load_factor=eta)
        return meet(self, dataclasses.replace(crossing, point=point))

    monkeypatch.setattr(Tracing, "_meet", drifting)
    path = cf.solve(perfect_column(cf.Rectangle(0.2, 0.25))[1], [0.5, 1.2])
    assert path.events == [] and path.error.max() <= 1e-6
    where, count = sorted(told(path))
    assert where.startswith("a bifurcation near the load factor 0.99") and "could not be confirmed" in where
    assert count.startswith("negative modes go from 0 to 1 on the way to the load factor 1.2")


@pytest.mark.serial
def test_events_of_two_meshes_are_compared_kind_by_kind():
    def path(*events):
        listed = [cf.Event(kind, eta, np.zeros((1, 3)), 0) for kind, eta in events]
        return SimpleNamespace(events=listed, why=[], load_factors=np.array([0.0, 2.0]))

    fine = path(("limit", 1.0), ("bifurcation", 1.0 + 1e-9), ("bifurcation", 1.5), ("bifurcation", 1.5))
    coarse = path(("bifurcation", 1.0), ("limit", 1.0 + 1e-8), ("bifurcation", 1.5 + 3e-9), ("bifurcation", 1.9))
    left = find_again(fine, coarse)
    assert [event.load_factor for event in left] == [1.9]
    errors = [event.error for event in fine.events]
    np.testing.assert_allclose(errors, [1e-8, 1e-9, 2e-9, np.nan], rtol=1e-3)
    keep_confirmed(fine, 5e-9, left)
    assert [event.load_factor for event in fine.events] == [1.0 + 1e-9, 1.5]
    assert len(fine.why) == 3 and "1.9 of a coarser mesh was not found again" in fine.why[-1]


HOPELESS = cf.StepControl(adaptive=False, max_iterations=5)
MOTION = {"dt": 0.05, "elements": 4, "degree": 2, "progress": False}


def pulled(force):
    """A clamped rod with a force, a function of time, at its end."""
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SPAGHETTI, name="rod")
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, force)])


def rising(t):
    return (0.0, 0.0, 50.0 * min(t, 0.2))


def and_nothing_more(*calls):
    """A function of any argument that makes the calls and returns False."""
    return lambda *_: bool([call() for call in calls] and False)


def tip_of_motion(force):
    rod, scene = pulled(force)
    return cf.simulate(scene, 0.4, **MOTION).displacement(rod.end)


def another_motion():
    rod, scene = pulled(lambda t: (0.0, 0.0, -80.0 * min(1.0, 20 * t)))
    return cf.simulate(scene, 0.1, **MOTION)


@pytest.mark.serial
def test_calls_within_until():
    """The same signature with twice the eccentricity: sharing one problem gave 15.8724713 m; and a motion."""
    rod, scene = column(eccentricity=0.2)
    _, other = column(eccentricity=0.4)
    plain = cf.solve(scene, (0.0, 1.5), elements=8)
    assert plain.displacement(rod.end)[-1, 0] == pytest.approx(15.8283154, abs=1e-6)
    for inner in (lambda: cf.solve(other, [0.3], elements=8), another_motion):
        path = cf.solve(scene, (0.0, 1.5), elements=8, until=and_nothing_more(inner))
        np.testing.assert_allclose(path.load_factors, plain.load_factors, rtol=1e-12)
        np.testing.assert_allclose(path.displacement(rod.end), plain.displacement(rod.end), atol=1e-10)


@pytest.mark.serial
def test_calls_within_a_force():
    """A motion, an equilibrium, and both of them three deep, in a force as a function of time."""
    plain, made = tip_of_motion(rising), []
    _, held = column(eccentricity=0.4)

    def with_inner(call):
        def force(t):
            if abs(t - 0.075) < 1e-9:  # in the middle of the second step, since the function is sampled before too
                made.append(call())
            return rising(t)

        return force

    def deep():
        _, scene = pulled(with_inner(another_motion))
        return cf.solve(held, (0.0, 0.2), elements=4, until=and_nothing_more(lambda: cf.simulate(scene, 0.1, **MOTION)))

    for inner in (another_motion, lambda: cf.solve(held, [0.3], elements=4), deep):
        made.clear()
        np.testing.assert_allclose(tip_of_motion(with_inner(inner)), plain, atol=1e-12)
        assert made


def test_results_outlive_their_problem():
    """Also the partial result of an error: results do not change when the problem is used for another scene."""
    rod, scene = column()
    _, other = column(eccentricity=1.0, length=13.0)
    for model in ("determinate", "planar", "spatial"):
        arguments = {"elements": 4, "model": model}
        looked_at = cf.solve(scene, [0.4], **arguments).fields(0)
        path = cf.solve(scene, [0.4], **arguments)
        until = and_nothing_more(lambda arguments=arguments: cf.solve(other, [0.7], **arguments))
        cf.solve(other, (0.0, 0.7), until=until, **arguments)
        for name, values in path.fields(0).items():
            np.testing.assert_array_equal(values, looked_at[name], err_msg=f"{model} {name}")
    expected = cf.solve(scene, [0.2], elements=4, model="planar", steps=HOPELESS).displacement(rod.end)
    with pytest.raises(cf.NotConverged) as failure:
        cf.solve(scene, [0.2, 30.0], elements=4, model="planar", steps=HOPELESS)
    cf.solve(other, [0.7], elements=4, model="planar")
    np.testing.assert_array_equal(failure.value.path.displacement(rod.end), expected)


@pytest.mark.serial
def test_warm_calls_make_nothing():
    """Nor do calls that end with a solver's error, or that change to another model."""
    rod, scene = column(eccentricity=0.0)
    _, motion = pulled(rising)

    def fails():
        with pytest.raises(cf.NotConverged):
            cf.solve(column()[1], [30.0], elements=4, model="spatial", steps=HOPELESS)

    calls = (lambda: cf.solve(scene, [0.5, 1.05], elements=4), lambda: cf.simulate(motion, 0.1, **MOTION),
             lambda: cf.buckling(scene), lambda: cf.modes(scene, 2), fails)  # fmt: skip
    made = [PROBLEMS.made for _ in range(2) if [call() for call in calls]]
    assert made[0] == made[1]


# -- the pool itself ---------------------------------------------------------------------------------------------------


def used(pool, key, comm=MPI.COMM_WORLD, error=None, **more):
    """Borrow and return a problem; an error may be raised in between."""
    with contextlib.suppress(type(error) if error else ()), pool.lend(key, comm, object, KeyError, **more) as problem:
        if error:
            raise error
    return problem


@pytest.mark.ranks
def test_what_is_lent_and_kept():
    """What is busy is not lent, what may be half way is not kept, nor what is on a communicator of the user's own."""
    pool = ProblemPool()
    with pool.lend("a", COMM, object) as one, pool.lend("a", COMM, object) as other:
        assert one is not other
    assert used(pool, "a") is one and pool.made == 2  # the one given back last
    assert used(pool, "a", error=KeyError()) is one and used(pool, "a") is one
    assert used(pool, "a", error=KeyboardInterrupt()) is one and used(pool, "a") is not one
    own = COMM.Dup()
    assert used(pool, "b", own) is not used(pool, "b", own)
    own.Free()


@pytest.mark.ranks
def test_what_is_idle_is_bounded():
    """The work of one rank alone does not influence what all ranks create together."""
    pool = ProblemPool(most_idle=2)
    a = used(pool, "a")
    for key in range(10):
        used(pool, key, MPI.COMM_SELF)
    used(pool, "b")
    assert used(pool, "a") is a
    used(pool, "c")  # b was idle for the longest time
    made = pool.made
    assert used(pool, "a") is a and pool.made == made
    used(pool, "b")
    assert pool.made == made + 1


def test_a_large_problem_is_alone():
    """Other large ones that are idle are dropped before it is made; it stays for the next caller, as small ones do."""
    pool = ProblemPool()
    small, large = used(pool, "small"), used(pool, "one", large=True)
    assert used(pool, "one", large=True) is large
    used(pool, "other", large=True)
    made = pool.made
    assert used(pool, "small") is small and pool.made == made
    assert used(pool, "one", large=True) is not large and pool.made == made + 1
