"""Linear buckling, loads without a potential, and negative modes of rods under high tension."""

import math
import pathlib
import re
import time

import numpy as np
import pytest
from conftest import COMM
from path_scenes import clamped_ring
from plane_scenes import STEEL

import cosserat_fenicsx as cf


def sheared(euler, GA):
    """The critical load P of a column that is not shortened: P (1 + P/GA) = P_Euler."""
    return GA / 2 * (np.sqrt(1 + 4 * euler / GA) - 1)


@pytest.mark.serial
@pytest.mark.parametrize("EA, GA", [(np.inf, 20.0), (1e3, 400.0), (20.0, 20.0)])
def test_shear_counts(EA, GA):
    """Against P (1 + P/GA) = P_Euler. For infinite EA `solve` finds the same events;
    from a prestressed state the estimate comes closer to its events."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((GA, GA), EA, (1.0, 2.0), 1.0))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -1.0))])
    found = cf.buckling(scene, tol=1e-6)
    assert found.load_factors == pytest.approx([sheared(np.pi**2 / 4, GA)], rel=1e-6)
    (event,) = cf.solve(scene, (0.0, 3.0), model="spatial").events
    shortened = 1 / GA - 1 / EA  # P (1 - P/EA + P/GA) = P_Euler
    exact = np.pi**2 / 4 if abs(shortened) < 1e-12 else sheared(np.pi**2 / 4, 1 / shortened)
    assert event.load_factor == pytest.approx(exact, rel=1e-7)
    near = cf.buckling(scene, load_factor=0.95 * exact).load_factors[0]
    assert abs(near - exact) <= max(0.2 * abs(found.load_factors[0] - exact), 1e-6)


@pytest.mark.serial
def test_the_error_bar_holds_what_both_meshes_have_in_common():
    """Infinite stiffnesses are bounded: a propped column, (4.4934)^2 and twice that, at two tolerances."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((np.inf, np.inf), np.inf, (1.0, 2.0), 1.0))
    guide = [cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
    scene = cf.Scene([rod], [cf.Clamp(rod.start), *guide], [cf.Force(rod.end, (0, 0, -1.0))])
    found = cf.buckling(scene, 2)
    off = np.abs(found.load_factors / (4.493409457909064**2 * np.array([1, 2])) - 1)
    assert (off <= found.error).all() and (found.error < 1e-6).all()
    with pytest.raises(cf.NotConverged, match="bounds the stiffnesses"):
        cf.buckling(scene, 2, tol=1e-7)


@pytest.mark.parametrize("section", [cf.Circle(0.2), cf.Rectangle(0.2, 0.25)])
def test_euler_columns(section):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), section, STEEL)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -cf.euler_load(rod)))])
    found = cf.buckling(scene, 4)
    ratio = max(rod.stiffness.bending) / min(rod.stiffness.bending)
    euler = np.array([1, ratio, 9, 9 * ratio])
    expected = sheared(euler, rod.stiffness.shear[0] / cf.euler_load(rod))
    np.testing.assert_allclose(found.load_factors, expected, rtol=1e-6)
    assert abs(found.load_factors / euler - 1).max() > 2e-5, "shear shows"
    assert (found.error <= 1e-5).all()
    s = np.linspace(0, 1, 4 * found.elements[0] + 1)[::4]  # element ends
    for k, axis in ((0, 0), (1, 1)):
        mode = found.mode(k, rod)[::4]
        np.testing.assert_allclose(mode[:, axis], 1 - np.cos(np.pi / 2 * s), atol=1e-4)
        np.testing.assert_allclose(np.delete(mode, axis, 1), 0, atol=1e-6)
    with pytest.raises(cf.NotConverged, match="unstable at the load factor 1.5"):
        cf.buckling(scene, load_factor=1.5)


@pytest.mark.serial
def test_from_a_prestressed_state_it_nears_the_bifurcation():
    for out_of_plane, far in ((50.0, 3.0), (1.0, 1.0)):
        _, scene = clamped_ring(out_of_plane)
        (event, *_) = cf.solve(scene, (0.0, far), elements=16).events
        errors = []
        for share in (0.0, 0.5, 0.9, 0.99):
            found = cf.buckling(scene, load_factor=share * event.load_factor, elements=16)
            errors.append(abs(found.load_factors[0] / event.load_factor - 1))
        assert errors == sorted(errors, reverse=True) and errors[-1] < 5e-3 < errors[0]


@pytest.mark.serial
@pytest.mark.parametrize("axial", [1e3, 10.0])
def test_a_weak_rod_without_force_hides_no_critical_load(axial):
    """A weak rod at the top of a column, whose own EA is below the load."""

    def section(EA, EI):
        return cf.Stiffness((EA, EA), EA, (EI, EI), EI)

    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section(1e9, 1e3))
    weak = cf.Rod(cf.Line((0, 0, 1.0), (1.0, 0, 1.0)), section(axial, 1e-4 * axial))
    joint = cf.Joint(column.end, weak.start, release="all")
    supports, load = [cf.Clamp(column.start), cf.Clamp(weak.end)], cf.Force(column.end, (0, 0, -1000.0))
    found = cf.buckling(cf.Scene([column, weak], supports, [load], joints=[joint]), 2)
    assert found.load_factors[0] == pytest.approx(np.pi**2 / 4, rel=1e-4) and found.bound == found.load_factors[0]


@pytest.mark.serial
def test_critical_loads_of_slender_frames_scatter_little():
    """Their difference quotients are taken over a share of the critical load, not over a step so small that rounding
    shows."""
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    upright = cf.Rod(cf.Line((0, 0, 0), (0, 0, 3.0)), cf.Circle(0.01), steel)
    level = cf.Rod(cf.Line((0, 0, 3.0), (3.0, 0, 3.0)), cf.Circle(0.01), steel)
    scene = cf.Scene(
        [upright, level], [cf.Clamp(upright.start), cf.Pin(level.end)],
        [cf.Force(upright.end, (0, 0, -1.0))], joints=[cf.Joint(upright.end, level.start)],
    )  # fmt: skip
    found = np.array([cf.buckling(scene, 1, elements=n).load_factors[0] for n in (8, 10, 12, 16, 24)])
    assert np.ptp(found) < 1e-6 * found.mean()


@pytest.mark.serial
def test_any_load_is_a_unit_of_load_factors():
    """3000 EA of a soft column, as in numbers without units; `solve` refuses it."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Circle(0.02), cf.Material(E=1.0, nu=0.3))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -1.0))])
    assert cf.buckling(scene).load_factors[0] == pytest.approx(np.pi**3 * 0.02**4 / 256, rel=1e-3)
    with pytest.raises(cf.SceneError, match="at most 10 EA .*a Stiffness in its place is not doubted"):
        cf.solve(scene, [1.0])


@pytest.mark.serial
@pytest.mark.parametrize("held", ["clamped", "hinged"])
def test_rounding_of_slender_columns_is_small_and_told(held):
    """L/d from 10^2 to 10^5 against Engesser's load with EA and GA, to first order in P/EA; EA L^2/EI is 10^11.

    What rounding leaves depends on the BLAS and on the axes: in 20 orientations at most 2.1e-9, the estimate 3.8e-8.
    """
    for slender in (1e2, 1e4, 1e5):
        EA = 16 * slender**2
        section = cf.Stiffness((EA / 2.6,) * 2, EA, (1.0, 1.0), 1 / 1.3)
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
        guide = [cf.Hinge(rod.start, (1, 0, 0)), cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
        supports, euler = (guide, np.pi**2) if held == "hinged" else ([cf.Clamp(rod.start)], np.pi**2 / 4)
        found = cf.buckling(cf.Scene([rod], supports, [cf.Force(rod.end, (0, 0, -1.0))]))
        x = 4 * euler / (EA / 2.6)
        off = abs(found.load_factors[0] / (euler * 2 / (1 + np.sqrt(1 + x))) - 1)
        assert off < 1e-8 and 0.8 * off <= found.error[0] < 1e-7, (slender, off, found.error)


@pytest.mark.slow
@pytest.mark.serial
def test_rounding_of_a_slender_column_at_a_spring_or_under_load():
    """A spring at the top, which acts in full at the load factor 0: tan a = a - a^3/k with P = a^2, again without shear
    at L/d = 10^5. About a loaded state contact forces are rounded by eps EA: that is told, or refused; P + P^2/GA =
    P_Euler + P_0^2/EA, since the extrapolated n and r' are those of the state with P_0."""
    k, a = 5.0, 2.5
    for _ in range(50):  # Newton's method
        a -= (math.tan(a) - a + a**3 / k) / (math.tan(a) ** 2 + 3 * a**2 / k)
    for slender, share in ((1e5, 0.0), (1e3, 0.9), (1e5, 0.9)):
        EA = 16 * slender**2
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((EA / 2.6,) * 2, EA, (1.0, 1.0), 1 / 1.3))
        loads = [cf.Force(rod.end, (0, 0, -1.0)), *([] if share else [cf.Spring(rod.end, k)])]
        euler = np.pi**2 / 4 if share else a * a
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
        try:
            found = cf.buckling(scene, load_factor=share * euler)
        except cf.NotConverged as refused:
            assert share and slender > 1e4 and "accuracy" in str(refused)
            continue
        P = euler + (share * euler) ** 2 / EA
        off = abs(found.load_factors[0] / (P * 2 / (1 + np.sqrt(1 + 4 * P / (EA / 2.6)))) - 1)
        assert off < (1e-5 if slender > 1e4 else 5e-8) and 0.8 * off <= found.error[0] <= 1e-5, (slender, off)


@pytest.mark.serial
@pytest.mark.parametrize("share, length, foot", [(1e-2, 1.0, "clamp"), (1e-3, 5.0, "hinge"), (1e-4, 5.0, "clamp")])
def test_a_thin_arm_beside_a_thick_column(share, length, foot):
    """A column with a joined arm whose bending stiffness is 10^-8 to 10^-16 of its own, longer than it or not, and
    first in the scene: the arm changes nothing, the units of the longest rod neither."""
    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 3.0)), cf.Circle(0.1), STEEL, name="column")
    arm = cf.Rod(cf.Line((0, 0, 3.0), (length, 0, 3.0)), cf.Circle(0.1 * share), STEEL, name="arm")
    supports = [cf.Clamp(column.start)]
    if foot == "hinge":  # free to bend out of the plane x-z, as if clamped
        supports = [cf.Hinge(column.start, (0, 1, 0)), cf.Roller(column.end, (1, 0, 0))]
    load, joint = cf.Force(column.end, (0, 0, -cf.euler_load(column))), cf.Joint(column.end, arm.start)
    found = cf.buckling(cf.Scene([arm, column], supports, [load], [joint]))
    alone = cf.buckling(cf.Scene([column], supports, [load]))
    np.testing.assert_allclose(found.load_factors, alone.load_factors, rtol=1e-7)


@pytest.mark.serial
def test_a_taut_line_has_no_critical_load(tmp_path):
    """The scene of docs/command_line.md: two meshes and the words, not the largest mesh and a refusal."""
    text = pathlib.Path(__file__).parents[1].joinpath("docs", "command_line.md").read_text()
    file = tmp_path / "line.toml"
    file.write_text(re.search(r"```toml\n(.*?)```", text, re.DOTALL)[1])
    scene = cf.read(file).scene
    found = cf.buckling(scene, 3)
    assert len(found) == 0 == found.modes.shape[0]
    assert "no critical load factor up to 18.84, where linear" in repr(found)
    assert "limit loads are found by `solve` (`cosserat run`)" in str(found)
    before = time.process_time()
    cf.buckling(scene, 3)  # compiled by now
    assert time.process_time() - before < 2.0
    for arguments, message in ((dict(count=0), "count = 0"), (dict(load_factor=np.inf), "buckling.load_factor = inf")):
        with pytest.raises(cf.SceneError, match=message):
            cf.buckling(scene, **arguments)


ROUND = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 1.0), 1.0, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
BLADE = cf.Stiffness((1e7, 1e7), 1e7, (1e4, 1.0), 0.7)
ALONG = (0, 0, 1.0)


def shaft(section=ROUND):
    return cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0), d1=(1, 0, 0)), section)


def guided(station):
    return [cf.Roller(station, (1, 0, 0)), cf.Roller(station, (0, 1, 0))]


def held(supports, loads, section=ROUND):
    """A scene of one shaft, whose supports and loads are functions of it."""
    rod = shaft(section)
    return cf.Scene([rod], supports(rod), loads(rod))


def pinned_at_both_ends():
    """A roller under a transverse arm keeps the start from spinning; bending is free in both directions."""
    rod, arm = shaft(), cf.Rod(cf.Line((0, 0, 0), (0.5, 0, 0)), cf.Stiffness((1e6,) * 2, 1e6, (1e3,) * 2, 1e3))
    supports = [cf.Pin(rod.start), cf.Roller(arm.end, (0, 1, 0)), *guided(rod.end)]
    moments = [cf.Moment(rod.end, ALONG), cf.Moment(rod.start, (0, 0, -1.0))]
    return cf.Scene([rod, arm], supports, moments, [cf.Joint(rod.start, arm.start)])


def clamped(rod):
    return [cf.Clamp(rod.start)]


def determinant(k, start, end):
    """Of the strong form, over k^3, with these shares of the moment at the ends; None for a clamp."""

    def row(s, d):
        e = np.exp(1j * k * s)
        return np.array([[1, s, s * s, e], [0, 1, 2 * s, 1j * k * e], [0, 0, 2, -k * k * e]][d])

    def turned(s, share):
        return row(s, 1) if share is None else row(s, 2) - 1j * share * k * row(s, 1)

    return abs(np.linalg.det([row(0, 0), turned(0, start), row(1, 0), turned(1, end)])) / k**3


def test_a_shaft_under_a_dead_axial_moment(tmp_path, capsys):
    """Free at its end and pinned there it has no static bifurcation; pinned at both ends 2 pi (Greenhill)."""
    from cosserat_fenicsx.cli import main as cli

    scene = held(clamped, lambda rod: [cf.Moment(rod.end, ALONG)])
    free = cf.buckling(scene, 2, elements=8)
    assert not free.conservative and len(free.load_factors) == len(free.modes) == len(free.error) == 0
    assert free.bound == pytest.approx(np.pi, rel=1e-6)

    supports = lambda rod: [*clamped(rod), *guided(rod.end)]  # noqa: E731
    pinned = cf.buckling(held(supports, lambda rod: [cf.Moment(rod.end, ALONG)]), 2)
    assert not pinned.conservative and len(pinned.load_factors) == 0
    assert min(determinant(k, None, 1) for k in np.linspace(2, 20, 2000)) > 0.04
    assert pinned.bound == pytest.approx(6.8112, rel=1e-5) and determinant(pinned.bound, None, 0.5) < 1e-5

    both = cf.buckling(pinned_at_both_ends(), 2, elements=8)
    assert not both.conservative and both.bound == pytest.approx(4.9113, rel=1e-5)
    assert determinant(both.bound, 0.5, 0.5) < 1e-5 and determinant(2 * np.pi, 1, 1) < 1e-12
    np.testing.assert_allclose(both.load_factors, 2 * np.pi, rtol=1e-5)
    w = both.mode(0)[::4] @ np.array([1, 1j, 0])  # at element ends
    w /= w[len(w) // 2]
    np.testing.assert_allclose(w, (1 - np.exp(2j * np.pi * np.linspace(0, 1, len(w)))) / 2, atol=1e-4)
    for found in (free, pinned, both):
        assert "no static bifurcation" in repr(found) or "static bifurcations (divergence) alone" in repr(found)
        assert f"none below {found.bound:.7g}" in found.caution
    if COMM.size == 1:
        cf.write(scene, tmp_path / "shaft.toml")
        assert cli.main(["buckling", str(tmp_path / "shaft.toml"), "--count", "1"]) == 0
        said = capsys.readouterr().out
        assert "The loads have no potential: no static bifurcation" in said and "may flutter" in said


@pytest.mark.serial
@pytest.mark.parametrize("load_factor", [0.0, 5.0])
def test_becks_column(load_factor):
    """It flutters at 20.05 and never diverges; the symmetric part is singular at pi^2."""
    beck = held(clamped, lambda rod: [cf.FollowerForce(rod.end, (0, 0, -1.0))])
    found = cf.buckling(beck, 3, load_factor=load_factor, elements=8)
    assert not found.conservative and len(found.load_factors) == 0 and found.bound == pytest.approx(np.pi**2, rel=1e-4)


@pytest.mark.serial
def test_a_blade_under_a_moment_about_its_normal():
    """As a cantilever it has no static bifurcation; between forks that prevent its twist it buckles at M = pi sqrt(EI
    GJ).

    The bound is the same, since on forks with rigid arms the moment would have a potential."""
    exact = np.pi * np.sqrt(0.7)
    found = cf.buckling(held(clamped, lambda rod: [cf.Moment(rod.end, (1.0, 0, 0))], BLADE), elements=8)
    assert not found.conservative and len(found.load_factors) == 0 and found.bound == pytest.approx(exact, rel=2e-4)

    rod, stiff = shaft(BLADE), cf.Stiffness((1e7,) * 2, 1e7, (1e4,) * 2, 1e4)
    arms = [cf.Rod(cf.Line((0, 0, z), (0.2, 0, z)), stiff) for z in (0.0, 1.0)]
    supports = [cf.Pin(rod.start), *guided(rod.end), *(cf.Roller(arm.end, (0, 1, 0)) for arm in arms)]
    moments = [cf.Moment(rod.end, (1.0, 0, 0)), cf.Moment(rod.start, (-1.0, 0, 0))]
    joints = [cf.Joint(end, arm.start) for end, arm in zip((rod.start, rod.end), arms, strict=True)]
    found = cf.buckling(cf.Scene([rod, *arms], supports, moments, joints), elements=8)
    assert found.load_factors == pytest.approx([exact], rel=5e-4) and found.bound == pytest.approx(exact, rel=5e-4)
    assert not found.conservative, "the arms are not rigid"


CONSERVATIVE = {
    "a dead force": (clamped, lambda rod: [cf.Force(rod.end, (0, 0, -1.0))], np.pi**2 / 4),
    "its weight on an arm": (clamped, lambda rod: [cf.EccentricForce(rod.end, (0, 0, -1.0), (0.1, 0.2))], None),
    "a dead moment about a hinge": (
        lambda rod: [*clamped(rod), cf.Hinge(rod.end, ALONG)], lambda rod: [cf.Moment(rod.end, ALONG)], 2 * 4.493409458
    ),
    "a dead moment on a section that is held": (
        lambda rod: [*clamped(rod), *guided(rod.end), cf.Prescribed(rod.end, rotation=(0, 0, 0))],
        lambda rod: [cf.Moment(rod.end, ALONG)], np.inf
    ),
    "half a dead and half a follower moment, the semitangential one": (
        clamped, lambda rod: [cf.Moment(rod.end, (0, 0, 0.5)), cf.FollowerMoment(rod.end, (0, 0, 0.5))], np.pi
    ),
}  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize("case", CONSERVATIVE)
def test_loads_with_a_potential(case):
    """Determined from the virtual work on the motions that the supports allow, not from the classes of loads."""
    supports, loads, exact = CONSERVATIVE[case]
    found = cf.buckling(held(supports, loads), elements=8)
    assert found.conservative and found.caution == "" and "potential" not in repr(found)
    if exact == np.inf:
        assert len(found.load_factors) == 0 and found.bound > 1e6
        return
    assert found.bound == found.load_factors[0]
    if exact is not None:
        assert found.bound == pytest.approx(exact, rel=1e-5)


@pytest.mark.serial
@pytest.mark.slow
def test_paths_and_vibrations_say_so_too():
    """For motions in space, whichever model computed the path."""
    dead, arm, moment, follower, line = (
        held(clamped, lambda rod, load=load: [cf.Force(rod.end, (0, 0, -0.5)), load(rod)])
        for load in (
            lambda rod: cf.LineForce(rod, (1e-3, 0, 0)),
            lambda rod: cf.EccentricForce(rod.end, (0, 0, -0.1), (0.1, 0)),
            lambda rod: cf.Moment(rod.end, (0, 0.1, 0)),
            lambda rod: cf.FollowerForce(rod.end, (0.1, 0, 0)),
            lambda rod: cf.LineMoment(rod, (0, 0.1, 0)),
        )
    )
    for scene, model, conservative in (
        (dead, "determinate", True), (arm, "planar", True), (arm, "spatial", True), (moment, "determinate", False),
        (moment, "spatial", False), (follower, "planar", False), (line, "planar", False)
    ):  # fmt: skip
        path = cf.solve(scene, [0.0, 1.0], model=model, elements=4)
        assert path.conservative == conservative, (scene.loads, model)
        assert path.at_points([0]).conservative, "nothing acts there"
    springs = held(clamped, lambda rod: [cf.Force(rod.end, (0.5, 0.2, 0)), cf.Spring(rod.end, 3.0, rotational=2.0),
                                         cf.Foundation(rod, 5.0)])  # fmt: skip
    assert cf.solve(springs, [1.0], elements=4).conservative
    twisted = held(clamped, lambda rod: [cf.Force(rod.end, (0.5, 0, 0)), cf.Moment(rod.end, ALONG, permanent=True)])
    assert not cf.solve(twisted, [0.0], elements=4).conservative
    assert cf.modes(follower, elements=4).conservative
    found = cf.modes(follower, load_factor=1.0, elements=4, damped=False)
    assert not found.conservative and "may flutter" in repr(found)
    assert "potential" not in repr(cf.modes(arm, load_factor=1.0, elements=4))


# L = EI = 1
STIFF, SMALL = 1e13, 0.8
ONE_STEP = cf.StepControl(adaptive=False)
RUNGS = [("determinate", False), ("planar", False), ("planar", True), ("spatial", False), ("spatial", True)]


def straight(force, guided=False, *, K=STIFF, direction=(0.6, 0, 0.8), shear=STIFF):
    """A rod of length and bending stiffness 1, clamped at its start; its
    loaded end is free, or guided in the direction of the load."""
    rod = cf.Rod(cf.Line((0, 0, 0), direction), cf.Stiffness((shear, shear), K, (1, 1), SMALL), name="rod")
    x, y, z = direction
    supports = [cf.Clamp(rod.start)]
    if guided:
        supports += [cf.Roller(rod.end, (z, 0, -x)), cf.Roller(rod.end, np.cross((z, 0, -x), direction))]
    return cf.Scene([rod], supports, [cf.Force(rod.end, force * np.array(direction))])


def counts(scene, forces, **options):
    return cf.solve(scene, forces, steps=ONE_STEP, **options).negative_modes.tolist()


def critical_below(force, guided):
    """The number of critical loads x^2 below a force, each counted
    twice: cos x = 0 for a free end, otherwise tan x = x."""
    x, k = np.sqrt(force), np.arange(1, 1000)
    roots = (k - 0.5) * np.pi
    if guided:
        roots = (k + 0.5) * np.pi
        for _ in range(50):
            roots = k * np.pi + np.arctan(roots)
    return 2 * np.count_nonzero(roots < x)


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("elements, degree", [(8, 4), (64, 2), (512, 1)])
@pytest.mark.parametrize("model, guided", RUNGS)
def test_tension_makes_no_negative_modes(model, guided, elements, degree):
    forces = [-10.0, 0.0, 1.0, 1e3, 1e6, 1e8, 1e10]
    assert counts(straight(1.0, guided), forces, model=model, elements=elements, degree=degree) == [
        critical_below(10.0, guided), 0, 0, 0, 0, 0, 0,
    ]  # fmt: skip


@pytest.mark.parametrize("model, guided", RUNGS)
def test_compression_makes_as_many_as_there_are_critical_loads_below(model, guided):
    """Half way between two critical loads, on a mesh where these were
    shifted by up to a quarter with a tighter bound of K."""
    roots = np.pi * (np.array([10, 159]) + 0.5 * guided)
    expected = [critical_below(x**2, guided) for x in roots]
    assert expected == [20, 318]
    assert counts(straight(-1.0, guided), list(roots**2), model=model, elements=256) == expected


BOTH = ("planar", "spatial")
LIMIT = 1 / (1 / 1e5 - 1 / 1e6)
#: Models; the rod and its forces; options; negative modes. Forces of a million on the finest mesh; infinite stiffness;
#: the displacement form, on a rod so slender that with the true stiffnesses rounding errors would exceed the bending
#: stiffness; a tension N > GA (1 + N/EA), under which the sections of a shear-flexible rod rotate: a real instability.
COUNTED = {
    "at a million": (("spatial",), straight(-1.0), [(318 * np.pi) ** 2], {"elements": 512}, [636]),
    "degree 2": (("spatial",), straight(1.0), [1e5, 1e10], {"elements": 512, "degree": 2}, [0, 0]),
    "degree 3": (("spatial",), straight(1.0), [1e5, 1e10], {"elements": 512, "degree": 3}, [0, 0]),
    "infinite stiffness": (BOTH, straight(1.0, True, K=np.inf, shear=np.inf), [-1e3, 1e5, 1e10], {"elements": 64},
                           [critical_below(1e3, True), 0, 0]),
    "displacement": (("spatial",), straight(1.0, direction=(0, 0, 1.0)), [-10.0, 1.0, 1e3, 1e6],
                     {"formulation": "displacement", "elements": 512}, [2, 0, 0, 0]),
    "soft": (("determinate", *BOTH), straight(1.0, K=1e6, shear=1e5), [0.9 * LIMIT, 1.1 * LIMIT], {"elements": 8},
             None),
}  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize("case", COUNTED)
def test_negative_modes_of_many_kinds(case):
    models, scene, forces, options, expected = COUNTED[case]
    for model in models:
        found = counts(scene, forces, model=model, **options)
        assert found == expected if expected else found[0] == 0 < found[1], model


@pytest.mark.serial
@pytest.mark.parametrize("tension", [10.0, 1e6])
def test_a_column_between_taut_wires(tension):
    """The wires support its top rigidly in their plane, and out of it with 2 T/L and the bending of their ends."""
    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1e9, 1e9), 1e9, (1, 1), SMALL), name="column")
    thin = cf.Stiffness((1e9, 1e9), 1e9, (1e-3, 1e-3), 1e-3)
    wires = [cf.Rod(cf.Line((side, 0, 1), (0, 0, 1)), thin, name=f"wire {side}") for side in (-1, 1)]
    ends = [
        cf.Prescribed(wire.start, displacement=(side * tension / 1e9, 0, 0), rotation=(0, 0, 0))
        for wire, side in zip(wires, (-1, 1), strict=True)
    ]
    joints = [cf.Joint(wire.end, column.end, release="all") for wire in wires]
    spring = 2 * tension + 2 * np.sqrt(tension * 1e-3)
    supported = 4.493409458**2
    x = np.linspace(1.6, 4.4934095, 100001)
    beside = np.sin(x) - x * (1 - x**2 / spring) * np.cos(x)
    critical = x[np.flatnonzero(np.diff(np.sign(beside)))[0]] ** 2
    expected = {0.98 * critical: 0, (critical + supported) / 2: 1, 1.02 * supported: 2}
    if tension > 1e3:
        del expected[(critical + supported) / 2]  # here both coincide
    for model in ("planar", "spatial"):
        for force, modes in expected.items():
            load = cf.Force(column.end, (0, 0, -force))
            scene = cf.Scene([column, *wires], [cf.Clamp(column.start), *ends], [load], joints)
            assert counts(scene, [1.0], model=model, elements=16) == [modes], (model, force)


@pytest.mark.serial
@pytest.mark.parametrize("model, elements", [("determinate", 16), ("planar", 16), ("planar", 256), ("spatial", 16)])
def test_a_steel_wire_with_a_small_force_across(model, elements):
    """2 mm, 100 m, 500 N at its end and 1 N transverse: the path starts without tension."""
    wire = cf.Rod(cf.Line((0, 0, 0), (0, 0, 100.0)), cf.Circle(0.002), STEEL, name="wire")
    scene = cf.Scene([wire], [cf.Clamp(wire.start)], [cf.Force(wire.end, (1.0, 0, 500.0))])
    path = cf.solve(scene, [1.0], model=model, elements=elements)
    assert path.negative_modes.tolist() == [0]
    EA, EI = 210e9 * np.pi * 1e-6, 210e9 * np.pi * 1e-12 / 4
    straight_part = 100.0 * (1 + 500 / EA) - np.sqrt(EI / 500)
    assert path.displacement(wire.end)[0, 0] == pytest.approx(straight_part / 500, rel=2e-4)


@pytest.mark.serial
@pytest.mark.parametrize("slenderness", [1e4, 3e4])
def test_a_taut_wire_with_a_force_at_mid_span(slenderness):
    """Strained by 1e-3 between two clamps, then loaded by 1 N: the deflection of
    a beam under tension, including the strain due to the sag."""
    L = 0.002 * slenderness
    wire = cf.Rod(cf.Line((0, 0, 0), (L, 0, 0)), cf.Circle(0.002), STEEL, name="wire")
    ends = [cf.Clamp(wire.start), cf.Prescribed(wire.end, displacement=(1e-3 * L, 0, 0), rotation=(0, 0, 0))]
    path = cf.solve(cf.Scene([wire], ends, [cf.Force(wire.at(L / 2), (0, 0, -1.0))]), [1.0], tol=1e-5)
    assert path.model == "planar" and path.stable.all()
    EA, EI = 210e9 * np.pi * 1e-6, 210e9 * np.pi * 1e-12 / 4
    T = EA * (1e-3 + (0.5 / (EA * 1e-3)) ** 2 / 2)
    boundary = np.sqrt(EI / T)
    deflection = (L * (1 + 1e-3) - 4 * boundary) / (4 * T)
    assert path.displacement(wire.at(L / 2))[0, 2] == pytest.approx(-deflection, rel=2e-5)


@pytest.mark.serial
@pytest.mark.parametrize("diameter", [0.005, 0.001])
@pytest.mark.parametrize("held", ["hinged", "clamped"])
def test_a_wire_that_hangs_as_an_arc(diameter, held):
    """110 m between two points 100 m apart, a circular arc in the reference, close to a catenary under its weight. On
    the first mesh the thin one seems to buckle out of its plane."""
    angle = 1.0
    for _ in range(100):  # sin(a/2)/(a/2) = 100/110
        angle = 2 * np.sin(angle / 2) * 1.1
    R = 110.0 / angle
    wire = cf.Rod(
        cf.Arc((0, 0, 0), (-R * np.sin(angle / 2), 0, -R * np.cos(angle / 2)), angle, axis=(0, -1, 0)),
        cf.Circle(diameter), STEEL, name="wire",
    )  # fmt: skip
    hold = cf.Clamp if held == "clamped" else lambda end: cf.Hinge(end, (0, 1, 0))
    path = cf.solve(cf.Scene([wire], [hold(wire.start), hold(wire.end)], [cf.Weight()]), [1.0], tol=1e-3)
    assert path.model == "planar" and path.stable.all()
    c = 50.0
    for _ in range(200):  # parameter c of the catenary: 2 c sinh(50/c) = 110
        c = 50.0 / np.arcsinh(55.0 / c)
    sag = c * (np.cosh(50.0 / c) - 1)
    drop = path.position(wire.at(55.0))[0, 2] - path.position(wire.start)[0, 2]
    assert drop == pytest.approx(-sag, rel=2e-3)


@pytest.mark.serial
def test_a_moment_that_a_support_takes_buckles_nothing():
    """Rounding of the contact forces gave factors of 1e5 to 1e22, different on each mesh, and no convergence."""
    points = np.array([(i, j, 0.0) for i in range(3) for j in range(3)])
    edges = [(3 * i + j, 3 * i + j + d) for i in range(3) for j in range(3) for d in (1, 3)
             if (j < 2 if d == 1 else i < 2)]  # fmt: skip
    frame = cf.frame(points, np.array(edges), cf.Tube(0.09, 0.08), cf.Material(210e9, 0.3))
    supports = [cf.Clamp(frame.at(0)), cf.Clamp(frame.at(8)), cf.Hinge(frame.at(4), (0, 0, 1))]
    found = cf.buckling(frame.scene([cf.Moment(frame.at(4), (1e3, 0, 0))], supports), 2)
    assert len(found) == 0 and np.isinf(found.bound) and found.conservative
    assert "no rod bears the loads" in str(found) and "inf" not in str(found)


@pytest.mark.serial
def test_a_planar_model_says_what_it_counts_out_of_its_plane(tmp_path):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1e6, 1e6), 1e6, (1.0, 100.0), 1.0), name="strip")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0.1, 0, -5.0))])
    path = cf.solve(scene, [0.2, 1.0], model="planar", elements=4)
    assert path.negative_modes.tolist() == [0, 1] and "Unstable out of its plane at the load factor" in str(path)
    path.save(tmp_path / "result.h5")
    assert str(cf.read_path(tmp_path / "result.h5")) == str(path)
