"""Natural frequencies of strings, the gains of tuned drives, and roots in the complex plane: none may be missed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from reference_strings import GIVEN, pipe_and_collars, public_discs, tubes
from scipy.optimize import brentq

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.linear.impedances import axial, torsional
from cosserat_fenicsx.drilling.linear.roots import Box, all_roots

pytestmark = [pytest.mark.serial, pytest.mark.once]


@pytest.mark.parametrize("case", [x for x in GIVEN["natural_Hz"] if x != "hook"])
def test_reference_frequencies(case):
    expected = GIVEN["natural_Hz"][case]
    hook = cf.drilling.Hook(GIVEN["natural_Hz"]["hook"]) if "hook" in case else None
    found = cf.drilling.natural_frequencies(
        pipe_and_collars(hook=hook), len(expected), case.split()[-1], case.split()[0]
    )
    assert found == pytest.approx(expected, rel=1e-12)


def test_a_pipe_with_an_inertia_at_its_end():
    """w tan(w L/c) = Z/J between k pi and (k + 1/2) pi, by itself."""
    pipe = replace(pipe_and_collars(), string=tubes(GIVEN["sections"][0]))
    part, inertia = pipe.segments[0], 40.0
    found = cf.drilling.natural_frequencies(
        replace(pipe, bit=cf.drilling.BitOnRock(cf.drilling.Stribeck(0, 0), inertia=inertia)), 5
    )
    time, Z = part.length / part.torsional_speed, part.torsional_impedance
    for k in range(5):
        exact = brentq(lambda x: x / time * math.sin(x) * inertia - Z * math.cos(x), k * math.pi, (k + 0.5) * math.pi)
        assert 2 * math.pi * found[k] == pytest.approx(exact / time, rel=1e-12)


def many_parts(count, drive):
    """A string of parts that differ by orders of magnitude."""
    draw = np.random.default_rng(4)
    lengths, masses = draw.uniform(1, 100, count), draw.uniform(20, 300, count)
    axial, torsional = 10 ** draw.uniform(8, 10, count), 10 ** draw.uniform(5, 8, count)
    parts = []
    for length, EA, GJ, mass in zip(lengths, axial, torsional, masses, strict=True):
        stiff = cf.Stiffness((1e9, 1e9), EA, (1e6, 1e6), GJ, mass=mass, inertia=(mass / 1e3, mass / 1e3, mass / 5e2))
        parts.append(cf.well.Component(float(length), stiff, 100.0, 0.08))
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0, 0), inertia=30.0, mass=500.0)
    return cf.drilling.Drilling(cf.well.DrillString(tuple(parts)), drive, bit, hook=cf.drilling.Hook(4e6))


@pytest.mark.parametrize(
    "drive",
    [cf.drilling.TopDrive(1.0), cf.drilling.TopDrive(None, 2000.0, cf.drilling.Motor(1.0))],
    ids=["held", "free"],
)
@pytest.mark.parametrize("kind", ["torsion", "axial"])
@pytest.mark.parametrize("bit", ["free", "fixed"])
def test_no_frequency_is_missed(drive, kind, bit):
    """Forty parts: as many frequencies as the winding number of another function says, and the same ones."""
    scene = many_parts(40, drive)
    w = 2 * math.pi * cf.drilling.natural_frequencies(scene, 40, bit, kind)
    assert (np.diff(w) > 0).all()
    guide = torsional(scene) if kind == "torsion" else axial(scene)
    columns = slice(1, None, 2) if bit == "free" else slice(0, None, 2)
    box = Box(-1.0, 1.0, 1e-3, (w[-2] + w[-1]) / 2)
    roots, _ = all_roots(lambda s: guide.bit(s)[columns], box, math.pi / guide.travel)
    assert len(roots) == 39
    assert np.abs(roots - 1j * w[:-1]).max() < 1e-10 * w[-1]


def test_discs_and_what_turns_as_a_whole():
    held, free = public_discs(cf.drilling.Stiff(), 1e4), public_discs(cf.drilling.Motor(1.0), 1e4)
    assert [len(cf.drilling.natural_frequencies(x, 9, bit)) for x in (held, free) for bit in ("free", "fixed")] == [
        3,
        2,
        3,
        3,
    ]
    undamped = replace(held, string=cf.drilling.Discs(held.string.inertias, held.string.stiffnesses))
    guide = torsional(undamped)
    roots, _ = all_roots(lambda s: guide.bit(s)[1::2], Box(-1, 1, 1e-3, 9.0), 1.0)
    assert roots.imag / (2 * math.pi) == pytest.approx(cf.drilling.natural_frequencies(held, 9), rel=1e-12)


def test_nothing_overflows():
    scene = pipe_and_collars("PI_stiff")
    s = np.array([1e5 + 1e6j, -300.0 + 40j, 1e-9j, 0j])
    for values in torsional(scene).bit(s):
        assert np.isfinite(values).all()
    Z = scene.segments[-1].torsional_impedance
    assert torsional(scene).impedance_at_bit(np.array([1e5 + 0j]))[0] == pytest.approx(Z, rel=1e-5)


def function_with(roots):
    """A polynomial with these roots and their conjugates, as `all_roots` takes it: value and derivative, scaled."""
    all_of_them = np.array([z for s in roots for z in ({s, s.conjugate()})])

    def f(s):
        apart = np.asarray(s)[:, None] - all_of_them
        value = np.exp(1j * np.angle(apart).sum(axis=1))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where((apart == 0).any(axis=1), 0, value), value * (1 / apart).sum(axis=1)

    return f


@pytest.mark.parametrize("seed", range(6))
def test_all_roots_of_a_polynomial(seed):
    """Some a hair apart, some real, one on the contour that is asked for, and others outside."""
    draw = np.random.default_rng(seed)
    inside = draw.uniform(-2, 1, 25) + 1j * draw.uniform(0, 30, 25)
    close = inside[:5] + 1e-5 * np.exp(2j * np.pi * draw.random(5))
    real, outside = draw.uniform(-2, 1, 3) + 0j, np.array([-2 + 7j, 1.5 + 3j, -5 + 2j, 0.3 + 31j])
    roots, box = all_roots(function_with([*inside, *close, *real, *outside]), Box(-2.0, 1.2, 0.0, 30.5), 1.0)
    expected = np.array([s for s in (*inside, *close, *real, *outside) if box.holds(s)])
    assert len(roots) == len(expected) >= 33
    assert max(np.abs(roots - s).min() for s in expected) < 1e-9


@pytest.mark.parametrize(
    "roots",
    [
        [0.3 + 2j, 0.3 + 2j, 0.5 + 5j],
        [0.3 + 2j] * 3,
        [0.25, 0.25, 0.7 + 1j],
        [0.3 + 2j, 0.3 + 2j + 1e-7],
        [0.3 + 1e-6j],
    ],
    ids=["double", "triple", "real", "close", "hardly complex"],
)
def test_multiple_roots(roots):
    found, _ = all_roots(function_with([complex(s) for s in roots]), Box(-1.0, 1.0, 0.0, 10.0), 1.0)
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(np.array(roots, dtype=complex)), abs=1e-8)


def test_gains_of_tuned_drives():
    scene = pipe_and_collars("PI_stiff")
    for choose, name in ((cf.drilling.SoftSpeed, "SoftSpeed"), (cf.drilling.SoftTorque, "tuned")):
        expected = cf.drilling.PI(GIVEN["tops"][name]["Kp"], GIVEN["tops"][name]["Ki"])
        for string in (scene.string, scene):
            found = choose(string, 2900.0)
            assert (found.Kp, found.Ki) == pytest.approx((expected.Kp, expected.Ki), rel=1e-12)
    pipe = scene.string.components[-1]
    part = scene.segments[0]
    found = cf.drilling.SoftTorque(pipe, 2000.0)
    assert found.Ki == pytest.approx(2000 * (math.pi / 2 * part.torsional_speed / part.length) ** 2, rel=1e-12)
    assert cf.drilling.SoftTorque(cf.well.DrillString((replace(pipe, length=None),)), 2000.0, depth=3000.0) == found
    with pytest.raises(cf.SceneError, match="inertia = 0"):
        cf.drilling.SoftSpeed(pipe, 0)
    with pytest.raises(cf.SceneError, match="discs have no impedance"):
        cf.drilling.SoftSpeed(public_discs(cf.drilling.Stiff(), 1e4), 2900.0)


def test_critical_speeds_of_a_pipe(tmp_path):
    """A free end in torsion, (k + 1/2)/2 c/L; a fixed one in axial motion, k c/(2 L)."""
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(3, 0.002), weight=8e4)
    scene = replace(pipe_and_collars(), string=tubes(GIVEN["sections"][0]), bit=bit)
    part, answer = scene.segments[0], cf.drilling.campbell(scene, 20.0, up_to=4.0)
    found = answer.critical_speeds()
    w = np.arange(1, 40) * math.pi * part.axial_speed / part.length
    for name, times in answer.excitations.items():
        expected = w[(w <= 8 * math.pi) & (w <= 20 * times)] / times
        assert found["axial", name] == pytest.approx(expected, rel=1e-12)
    w = (np.arange(40) + 0.5) * math.pi * part.torsional_speed / part.length
    assert found["torsion", "1 x"] == pytest.approx(w[w <= 20.0], rel=1e-12)
    assert set(answer.excitations) == {"1 x", "3 x (lobes)"} and "kind" in answer.to_dataframe()
    answer.plot(tmp_path / "campbell.png")
    assert (tmp_path / "campbell.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [((0,), "a number from 1"), ((3, "loose"), "'free' or 'fixed'"), ((3, "free", "lateral"), "'torsion' or 'axial'")],
)
def test_refusals(arguments, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.natural_frequencies(pipe_and_collars(), *arguments)
    with pytest.raises(cf.SceneError, match="discs turn alone"):
        cf.drilling.natural_frequencies(public_discs(cf.drilling.Stiff(), 1e4), 1, kind="axial")
