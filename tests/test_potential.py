"""Loads without a potential: which results report it, and the meaning of linear buckling then.

Reference values come from the strong form of a straight shaft.

With w = x + i y, k = M/EI and EI w'''' = i M w''' a dead moment leaves EI w'' = i M w' at an end that is free to turn.
The symmetric part of the second variation has half of the right side there, which is the moment's semitangential part.
"""

import numpy as np
import pytest

import cosserat_fenicsx as cf

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


def test_a_shaft_under_a_dead_axial_moment():
    """Free at its end and pinned there it has no static bifurcation; pinned at both ends 2 pi (Greenhill)."""
    free = cf.buckling(held(clamped, lambda rod: [cf.Moment(rod.end, ALONG)]), 2, elements=8)
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


@pytest.mark.parametrize("load_factor", [0.0, 5.0])
def test_becks_column(load_factor):
    """It flutters at 20.05 and never diverges; the symmetric part is singular at pi^2."""
    beck = held(clamped, lambda rod: [cf.FollowerForce(rod.end, (0, 0, -1.0))])
    found = cf.buckling(beck, 3, load_factor=load_factor, elements=8)
    assert not found.conservative and len(found.load_factors) == 0 and found.bound == pytest.approx(np.pi**2, rel=1e-4)


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
    found = cf.modes(follower, load_factor=1.0, elements=4)
    assert not found.conservative and "may flutter" in repr(found)
    assert "potential" not in repr(cf.modes(arm, load_factor=1.0, elements=4))


@pytest.mark.serial
def test_the_command_line_says_so(tmp_path, capsys):
    from cosserat_fenicsx.cli import main as cli

    file = tmp_path / "shaft.toml"
    file.write_text(
        """
        [materials.steel]
        E = 210e9
        [[rods]]
        name = "shaft"
        curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 2] }
        section = { type = "Circle", diameter = 0.02 }
        material = "steel"
        [[supports]]
        type = "Clamp"
        station = "shaft.start"
        [[loads]]
        type = "Moment"
        station = "shaft.end"
        moment = [0, 0, 1]
        """,
        encoding="utf-8",
    )
    assert cli.main(["buckling", str(file), "--count", "1"]) == 0
    said = capsys.readouterr().out
    assert "The loads have no potential: no static bifurcation" in said and "may flutter" in said
