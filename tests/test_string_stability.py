"""Strings that drill: growth of modes, bits that cut with a delay and on lobes, and the rock left behind."""

import dataclasses
import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from axial_scenes import column, hanging, unbalanced
from fake_string import scene
from reference_strings import GIVEN, RPM, drive_of, falling, pipe_and_collars, public_discs, tubes, weight_of_slope

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.bit_laws import RockSurface
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.laws import check_bit
from cosserat_fenicsx.drilling.linear import stability as linear
from cosserat_fenicsx.drilling.linear.impedances import axial, torsional
from cosserat_fenicsx.drilling.linear.limits import fed_by_bit
from cosserat_fenicsx.quantities import Units

pytestmark = [pytest.mark.serial, pytest.mark.once]
BAND = 60 / (2 * math.pi)  # Hz, of the reference


@pytest.mark.parametrize("case", GIVEN["roots"], ids=lambda x: f"{x['top']} {x['kappa']:g}")
def test_reference_roots(case):
    speed = 6.0
    weight = weight_of_slope(case["kappa"], speed)
    answer = cf.drilling.stability(pipe_and_collars(case["top"], case["drag_rate"]), [speed], [weight], up_to=BAND)
    found = answer.roots[0, 0]
    for re, im in case["s"]:
        assert np.nanmin(np.abs(found - complex(re, im))) < 1e-12 * abs(complex(re, im))


@pytest.mark.parametrize("case", GIVEN["limits"], ids=lambda x: f"{x['top']} {x['drag_rate']:g} {x['Jb']:g}")
def test_reference_limits(case):
    scene = pipe_and_collars(case["top"], case["drag_rate"], case["Jb"])
    w, kappa = cf.drilling.critical_slopes(scene, BAND)
    for frequency, slope in case["crossings"]:
        k = int(np.abs(w - frequency).argmin())
        assert w[k] == pytest.approx(frequency, rel=1e-10) and kappa[k] == pytest.approx(slope, rel=1e-10)
    moving = w > 0  # at rest a matched drive gives way, which the reference lists by itself
    assert moving.sum() >= case["number_of_crossings"]
    assert kappa[moving].max() == pytest.approx(case["kappa_c"], rel=1e-10)
    k = int(np.abs(w - case["omega_mode1"]).argmin())
    assert kappa[k] == pytest.approx(case["kappa_mode1"], rel=1e-10)
    if kappa.argmax() != 0 or moving[0]:
        weights = case["WOB_N_at_rpm_band"]
        assert cf.drilling.limit_weight(scene, 90 * RPM, up_to=BAND) == pytest.approx(weights["90"], rel=1e-10)
        assert cf.drilling.limit_speed(scene, weights["180"], up_to=BAND) == pytest.approx(180 * RPM, rel=1e-9)


def test_limit_speeds_by_drive():
    """Each is that of `limit_speed` with that drive; a tuned one calms the first mode from a lower speed on."""
    scene = pipe_and_collars("tuned")
    answer = cf.drilling.stability(scene, weights=[40e3, 80e3])
    assert answer.speeds[[0, -1]] == pytest.approx([20 * RPM, 200 * RPM]) and len(answer.speeds) == 19
    limits = answer.limit_speeds
    assert limits["PI (own)"][1] == cf.drilling.limit_speed(scene, 80e3) and limits["PI (own)"][0] < limits["stiff"][0]
    assert all(first <= every for first, every in limits.values())
    assert f"PI (own) {limits['PI (own)'][0] / RPM:.4g} rpm" in " ".join(str(answer).split())
    cutting = replace(scene, bit=cf.drilling.BitOnRock(cf.drilling.Cutting(0.1, 60e6, 0.6, 4), 50e3))
    answer = replace(answer, scene=cutting)
    assert not answer.limit_speeds and not any(drives for *_, drives in answer._growing[0])  # which take minutes
    assert "with_drives(i, j) has the growth with other drives" in " ".join(str(answer).split())


def test_a_string_without_losses():
    """Any falling torque makes it grow; none leaves it as it is."""
    scene = pipe_and_collars(drag=0.0)
    assert math.isinf(cf.drilling.limit_speed(scene)) and cf.drilling.limit_weight(scene, 6.0) == 0.0
    assert cf.drilling.limit_speed(scene, up_to=0.05) == 0.0  # no mode
    assert math.isinf(cf.drilling.limit_weight(scene, 6.0, up_to=0.05))
    assert cf.drilling.stability(scene, [6.0], [1e3], modes=6).unstable_modes.tolist() == [[6]]
    free = cf.drilling.stability(replace(scene, bit=None), [6.0], modes=6)
    assert free.unstable_modes.tolist() == [[0]] and (free.growth == 0).all()
    assert free.frequency[0, 0] == pytest.approx(cf.drilling.natural_frequencies(scene, 6), rel=1e-12)


def test_a_matched_drive_gives_way_at_its_impedance():
    Z = pipe_and_collars().segments[0].torsional_impedance
    w, kappa = cf.drilling.critical_slopes(pipe_and_collars("matched", 0.0, 50.0), BAND)
    assert w[0] == 0.0 and kappa[0] == pytest.approx(-Z, rel=1e-12)
    speed = 6.0
    weights = [weight_of_slope(factor * kappa[0], speed) for factor in (0.99, 1.01)]
    answer = cf.drilling.stability(pipe_and_collars("matched", 0.0, 50.0), [speed], weights, up_to=BAND)
    assert answer.unstable_modes.tolist() == [[0, 1]]
    assert answer.frequency[0, 1, answer.unstable(0, 1)[0]] == 0.0


def test_a_drive_calms_the_first_mode_and_leaves_the_collars():
    """At 92 rpm and 100 kN: stiff, the modes of 0.19 and 8 Hz grow; SoftSpeed calms the first one alone."""
    answer = cf.drilling.stability(pipe_and_collars("PI_stiff"), [92 * RPM], up_to=BAND)
    grow = answer.unstable(0)
    first, collars = (min(grow, key=lambda k: abs(answer.frequency[0, 0, k] - f)) for f in (0.19, 8.14))
    drives = answer.with_drives(0)
    assert set(drives) == {"stiff", "SoftTorque", "SoftSpeed", "matched"}
    assert drives["SoftSpeed"][first] < 0 < drives["stiff"][first]
    assert drives["SoftSpeed"][collars] == pytest.approx(answer.growth[0, 0, collars], rel=0.01)
    alone = cf.drilling.stability(pipe_and_collars("SoftSpeed"), [92 * RPM], up_to=BAND)
    assert drives["SoftSpeed"][first] == pytest.approx(alone.growth[0, 0, :2].max(), rel=1e-12)
    text = answer.details()
    assert "SoftSpeed calms 0.191" in text and "densest in the collar" in answer.shape(collars).where
    assert "8.137 Hz moves" in text
    short = answer.summary("field")
    weight = float(answer.weights[0]) / cf.units.kip
    assert f"rpm, {weight:.4g} klbf on bit" in short and "kN" not in short and "(klbf)" in short
    headings = [column.header for column in answer._table(Units("field"), 12).columns]
    assert headings[2:7] == [
        "largest growth", "middle case (rpm)", "middle case (klbf)", "frequency there (Hz)", "growth there"
    ]  # fmt: skip


def test_a_tuned_drive_is_one_drive_whoever_tells_of_it():
    """The drive of the scene is a column, with the growth of the scene, whatever inertia the bit adds to the mode; a
    drive chosen by hand is compared with the one that its string would have."""
    string, case = tubes(*GIVEN["sections"]), ([60 * RPM], [8e4])

    def told(control):
        drive = cf.drilling.TopDrive(1.0, 2900.0, control)
        return cf.drilling.stability(pipe_and_collars(drive=drive, inertia=50.0), *case, up_to=BAND)

    soft, torque = (choose(string, 2900.0) for choose in (cf.drilling.SoftSpeed, cf.drilling.SoftTorque))
    assert (soft.rule, torque.rule) == ("SoftSpeed", "SoftTorque") and cf.drilling.PI(soft.Kp, soft.Ki) == soft
    own = told(soft)
    assert cf.drilling.SoftSpeed(own.scene, 2900.0) == soft
    heard = cf.drilling.SoftSpeed(string, 2900.0, bit_inertia=50.0)
    omega = 2 * math.pi * cf.drilling.natural_frequencies(own.scene, 1)[0]
    assert heard.Ki == pytest.approx(2900.0 * omega**2, rel=1e-12)
    columns, k = own.with_drives(0), own.unstable(0)[0]
    assert (columns["SoftSpeed"] == own.growth[0, 0]).all()
    text = own.details()
    assert "(own)" in text and "of the scene, SoftSpeed." in " ".join(text.split())
    for other in (told(torque), told(cf.drilling.PI(38e3, 1e5))):
        near = int(np.abs(other.frequency[0, 0] - own.frequency[0, 0, k]).argmin())
        assert other.with_drives(0)["SoftSpeed"][near] == pytest.approx(own.growth[0, 0, k], rel=1e-9)
        if other.scene.drive.control == torque:
            assert columns["SoftTorque"][k] == pytest.approx(other.growth[0, 0, near], rel=1e-9)


def test_every_case_of_a_map_has_all_its_modes():
    """The same roots as one by one, and each mode in its own column: its growth falls with the speed."""
    scene, speeds, weights = pipe_and_collars("SoftSpeed", inertia=20.0), np.linspace(3, 14, 6), [2e4, 6e4, 1.2e5]
    answer = cf.drilling.stability(scene, speeds, weights, up_to=BAND)
    for i, j in ((0, 0), (0, 2), (3, 1), (5, 2)):
        alone = cf.drilling.stability(scene, speeds[i : i + 1], weights[j : j + 1], up_to=BAND).roots.ravel()
        here = answer.roots[i, j][np.isfinite(answer.roots[i, j])]
        assert len(here) == np.isfinite(alone).sum()
        assert np.abs(np.sort_complex(here) - np.sort_complex(alone)).max() < 1e-11
    grow = answer.growth[1:, :, answer.unstable(1, 2)]
    assert grow.shape[2] > 8 and (np.diff(grow, axis=0) < 0).all() and (np.diff(grow, axis=1) > 0).all()
    assert (answer.frequency[0, 2] == 0).sum() == 2  # the first mode no longer oscillates: one root and a new one
    table = answer.to_dataframe()
    assert len(table) == np.isfinite(answer.growth).sum() and list(table)[-2:] == ["growth (1/s)", "frequency (Hz)"]


def cutting(rpm=60.0):
    given, p = GIVEN["cutting"], GIVEN["cutting"]["parameters"]
    law = cf.drilling.Cutting(p["a"], p["eps"], p["zeta"], p["n"])
    drag, hook = cf.drilling.ViscousDrag(p["dt_"], p["da"]), cf.drilling.Hook(speed=-p["V"])
    return cf.drilling.Drilling(
        tubes(given["section"]), cf.drilling.TopDrive(rpm * RPM), cf.drilling.BitOnRock(law), hook=hook, drag=drag
    )


def test_counts_of_a_string_whose_bit_cuts():
    rows = GIVEN["cutting"]["rows"]
    answer = cf.drilling.stability(cutting(), [row["rpm"] * RPM for row in rows], up_to=BAND)
    within = (answer.growth > 1e-3) & (answer.growth < 6) & (answer.roots.imag > 1e-3) & (answer.roots.imag < 60)
    assert within.sum(axis=2).ravel().tolist() == [row["unstable_roots_in_box"] for row in rows]
    for i, row in enumerate(rows):
        for re, im in row["rightmost_below_30_rad_s"]:
            assert np.nanmin(np.abs(answer.roots[i, 0] - complex(re, im))) < 1e-9
    assert any("axial motion of drill pipe" in answer.shape(k, 4).shares for k in answer.unstable(4))


def test_the_shape_of_a_coupled_mode():
    """Both equations of motion of the bit, with the depth of cut d = E (v - rho om)/s."""
    speed, law, rate = 100 * RPM, cutting().bit.law, GIVEN["cutting"]["parameters"]["V"]
    answer = cf.drilling.stability(cutting(), [speed], up_to=BAND)
    for k in (*answer.unstable(0), 3, 8):
        shape = answer.shape(k, 0)
        s, om, v = shape.root, shape.rotation[-1], shape.velocity[-1]
        d = (1 - np.exp(-2 * math.pi * s / (law.blades * speed))) / s * (v - rate / speed * om)
        Zt, Za = (of(cutting()).impedance_at_bit(np.array([s]))[0] for of in (torsional, axial))
        assert om == pytest.approx(1.0) and sum(shape.shares.values()) == pytest.approx(1.0)
        assert Zt * om + law.torsional_stiffness * d == pytest.approx(0, abs=1e-7 * abs(Zt * om))
        assert Za * v + law.axial_stiffness * d == pytest.approx(0, abs=1e-7 * abs(Za * v))


def test_the_weight_sets_the_rate_of_penetration():
    """Weight n zeta epsilon a d and rate V = n Om d/(2 pi), flats of wear on top: the same roots."""
    scene, speed = cutting(), 100 * RPM
    law = scene.bit.law
    depth = 2 * math.pi * GIVEN["cutting"]["parameters"]["V"] / (law.blades * speed)
    by_rate = cf.drilling.stability(scene, [speed], up_to=2.0)
    worn = replace(law, wear=cf.drilling.Wear(60e6, 0.011, 0.6))
    for changed, flats in ((law, 0.0), (worn, 0.108 * 0.011 * 60e6)):
        string = replace(scene, bit=cf.drilling.BitOnRock(changed))
        found = cf.drilling.stability(string, [speed], [law.axial_stiffness * depth + flats], up_to=2.0)
        assert np.abs(found.roots - by_rate.roots).max() < 1e-10
    with pytest.raises(cf.SceneError, match="more than the wear flats carry"):
        cf.drilling.stability(replace(scene, bit=cf.drilling.BitOnRock(worn)), [speed], [7e4])


def test_the_lumped_bit_that_cuts():
    given = GIVEN["lumped"]
    p = given["parameters"]
    free = cf.drilling.LumpedCutting(p["psi"], p["n"], p["v0"])
    damped = replace(free, axial_frequency=p["omega_a"], axial_damping=p["zeta_a"], torsional_damping=p["zeta_t"])
    for model, rows in ((damped, given["damped"]), (free, given["free"])):
        for row in rows:
            found = model.roots(row["omega0"])
            listed = [complex(*s) for s in row["roots"] if s[0] > -1]
            assert max(np.abs(found - s).min() for s in listed) < 1e-12
            assert (found.real > 0).sum() == sum(s.real > 0 for s in listed)
    assert damped.limits(2.0, 12.0) == pytest.approx([given["limit"]], abs=1e-10)
    exact = 2 * math.sqrt(2 * p["psi"] / p["n"])
    assert cf.drilling.LumpedCutting(p["psi"], p["n"]).limits(3.0, 12.0) == pytest.approx([exact], rel=1e-10)
    assert exact == pytest.approx(given["axial_only"], rel=1e-12)


@pytest.mark.parametrize("row", GIVEN["discs"]["critical"], ids=lambda row: f"{row['WOB'] / 1e3:g} kN")
def test_critical_speeds_of_discs(row):
    pairs = {"omega_constant_torque": cf.drilling.Motor(8138.0), "omega_imposed_top_speed": cf.drilling.Stiff()}
    for name, control in pairs.items():
        assert cf.drilling.limit_speed(public_discs(control, row["WOB"])) == pytest.approx(row[name], rel=1e-8)
        above, below = row[name] * 1.001, row[name] * 0.999
        answer = cf.drilling.stability(public_discs(control, row["WOB"]), [below, above])
        assert (answer.unstable_modes.ravel() > 0).tolist() == [True, False]


def test_bit_bounce(tmp_path):
    given = GIVEN["bit_bounce"]
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(given["lobes"], given["amplitude"]), weight=given["static_WOB"])
    scene = pipe_and_collars(drag=given["drag_rate"], bit=bit, hook=cf.drilling.Hook(GIVEN["natural_Hz"]["hook"]))
    rpm = np.array([float(x) for x in given["dynamic_WOB_amplitude"]])
    answer = cf.drilling.bit_bounce(scene, rpm * RPM)
    assert answer.amplitude == pytest.approx(list(given["dynamic_WOB_amplitude"].values()), rel=1e-10)
    assert answer.lifts_off.tolist() == list(given["lifts_off"].values())
    limits = cf.drilling.bit_bounce(scene, np.arange(40, 200, 0.25) * RPM).limits() / RPM
    assert limits == pytest.approx(given["lift_off_limits_rpm"], abs=0.006)  # the reference's grid is 0.005 rpm
    answer.plot(tmp_path / "bounce.png")
    with pytest.raises(cf.SceneError, match="Lobes"):
        cf.drilling.bit_bounce(pipe_and_collars(), [1.0])


def test_the_shape_of_a_mode():
    """In one pipe below a stiff drive: sinh(g x)/sinh(g L) with g = s/c, and half a wave more from mode to mode."""
    scene = replace(pipe_and_collars(drag=0.0), string=tubes(GIVEN["sections"][0]))
    part, answer = scene.segments[0], cf.drilling.stability(scene, [14.0], modes=4)
    assert answer.roots.shape == (1, 1, 4)
    for k in range(4):
        shape = answer.shape(k)
        g = shape.root / part.torsional_speed
        expected = np.sinh(g * shape.depth) / np.sinh(g * part.length)
        assert np.abs(shape.rotation - expected).max() < 1e-10
        assert shape.shares == {"drill pipe": pytest.approx(1.0)} and shape.velocity is None


def test_pictures(tmp_path):
    scene = pipe_and_collars("SoftSpeed")
    cf.drilling.stability(scene, [4.0, 8.0, 12.0], [3e4, 8e4], up_to=1.0).plot(tmp_path / "map.png")
    cf.drilling.stability(scene, [4.0, 8.0, 12.0], up_to=1.0).plot(tmp_path / "speeds.png", mode=0)
    assert all((tmp_path / name).stat().st_size > 10_000 for name in ("map.png", "speeds.png"))


def test_a_torque_that_falls_too_fast():
    scene = pipe_and_collars()
    Z = scene.segments[-1].torsional_impedance
    steep = 1.1 * Z / (0.3 * falling().radius / falling().speed)  # weight whose slope at rest exceeds the impedance
    with pytest.raises(cf.SceneError, match=r"falls by 1973\.\d* N m .* impedance .* 1793\.\d* N m s/rad"):
        check_bit(scene.with_case(weight=steep))
    check_bit(scene.with_case(weight=steep / 1.2))
    check_bit(replace(scene, bit=cf.drilling.BitOnRock(falling(), weight=steep, inertia=5.0)))
    with pytest.raises(cf.SceneError, match="at 0.1 rad/s under"):
        cf.drilling.stability(scene, [0.1], [1.1 * steep])


@pytest.mark.parametrize(("call", "words"), [
    (lambda: cf.drilling.stability(pipe_and_collars(), [0.0]), "speeds\\[0\\] = 0.0: expected a positive number"),
    (lambda: cf.drilling.stability(pipe_and_collars(), [1.0], [-1.0]), "weights\\[0\\] = -1.0: expected a positive"),
    (lambda: cf.drilling.stability(pipe_and_collars(bit=None), [1.0], [1e4]), "expected a BitOnRock"),
    (lambda: cf.drilling.stability(pipe_and_collars(), [1.0], modes=0), "modes = 0"),
    (lambda: cf.drilling.stability(replace(cutting(), hook=None), [1.0]), "or a Hook whose speed"),
    (lambda: cf.drilling.limit_weight(cutting(), 1.0), "a Stribeck law and a radius"),
    (lambda: cf.drilling.stability(pipe_and_collars(), [5.0], up_to=1.0).shape(99), "a number from 0 to"),
    (lambda: cf.drilling.PI(1.0, 1.0, rule="SoftSped"), "PI.rule = 'SoftSped': expected 'SoftTorque' or 'SoftSpeed'"),
    (lambda: cf.drilling.SoftSpeed(tubes(*GIVEN["sections"]), 2900.0, bit_inertia=-1), "bit_inertia = -1"),
    (lambda: cf.drilling.LumpedCutting(13.9, 4).limits(3.0, 2.0), "more than low"),
])  # fmt: skip
def test_refusals(call, words):
    with pytest.raises(cf.SceneError, match=words):
        call()


def test_limit_speed_of_a_bit_that_cuts():
    scene = replace(cutting(), drag=cf.drilling.ViscousDrag(0.8, 0.8))
    limit = cf.drilling.limit_speed(scene, up_to=2.0, between=(2.0, 40.0), points=12)
    grow = cf.drilling.stability(scene, [0.999 * limit, 1.001 * limit], up_to=2.0).unstable_modes.ravel()
    assert grow[0] > 0 == grow[1]
    assert math.isinf(cf.drilling.limit_speed(scene, up_to=2.0, between=(2.0, 0.9 * limit), points=3))


def test_a_bit_without_inertia_feeds_the_fastest_modes_that_steps_resolve():
    """As critical_slopes has them; an inertia ends it."""
    case, dt, speed = GIVEN["roots"][0], 0.005, 6.0
    scene = pipe_and_collars(case["top"], case["drag_rate"])
    w, slopes = cf.drilling.critical_slopes(scene, 0.25 / dt)
    limit = slopes[w > 0.25 * math.pi / dt].max()

    def told(slope, **more):
        bit = replace(scene.bit, weight=weight_of_slope(slope, speed), **more)
        return fed_by_bit(replace(scene, drive=replace(scene.drive, speed=speed), bit=bit), dt)

    assert "the motion depends on the step" in told(1.01 * limit) and not told(0.99 * limit)
    assert not told(1.01 * limit, inertia=5.0)


def test_other_drives():
    answer = cf.drilling.stability(pipe_and_collars(), range(6, 7), up_to=1.0)
    assert set(answer.with_drives(0)) == {"matched"}  # no inertia to tune
    own = answer.with_drives(0, 0, {"own": drive_of("rigid")})["own"]
    assert own == pytest.approx(answer.growth[0, 0], rel=1e-12)


def test_speeds_in_revolutions_a_minute_are_doubted():
    """120 typed for 120 * units.rpm would be 1146 rev/min."""
    for law in (cf.drilling.Stribeck, cf.drilling.WallFriction):
        with pytest.warns(cf.SceneWarning, match=r"speed = 30 .*30 rev/min are '30 rpm', 3.14 rad/s"):
            law(0.5, 0.3, speed=30)
    with pytest.warns(cf.SceneWarning, match=r"TopDrive.speed = 120 rad/s are 1146 rev/min.* or '120 rpm'"):
        fast = cf.drilling.TopDrive(120)
    assert fast.speed == 120
    for function in (cf.signals.Ramp((120.0,), 1.0, 5.0), lambda t: 120.0):
        with pytest.warns(cf.SceneWarning, match=r"TopDrive.speed = 120 rad/s are 1146 rev/min"):
            cf.drilling.TopDrive(function)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cf.drilling.Stribeck(0.5, 0.3, speed=10)
        cf.drilling.WallFriction(0.5, 0.3, speed="300 ft/min")
        drive = cf.drilling.TopDrive(250 * cf.units.rpm)
        scene = cf.drilling.Drilling(
            cf.drilling.Discs((930.0, 2782.0), (700.0,)),
            drive,
            cf.drilling.BitOnRock(cf.drilling.Stribeck(8000.0, 5000.0)),
        )
    with pytest.warns(cf.SceneWarning, match="stability.speeds = 180 rad/s"):
        cf.drilling.stability(scene, [90.0, 180.0], None)


BLADES, PSI, RATE = 4, 13.9, 0.5
WORN = cf.drilling.Cutting(a=0.108, epsilon=60e6, zeta=0.6, blades=4, wear=cf.drilling.Wear(60e6, 0.011, 0.6))


def lumped(speed, *, coupled):
    """The bit of Richard, Germay & Detournay in their units: with springs and dampers of both motions, or on an axial
    one that is next to nothing, below a drive that turns it as it likes."""
    spring = {"stiffnesses": (1.0,), "dampings": (0.04,)} if coupled else {"stiffnesses": (1e6,)}
    axial = {"axial_stiffnesses": (4.0,), "axial_dampings": (0.4,)} if coupled else {"axial_stiffnesses": (1e-9,)}
    discs = cf.drilling.Discs((1e-3, 1.0 if coupled else 1e6), masses=(1e-3, 1.0), **spring, **axial)
    law = cf.drilling.Cutting(a=1.0, epsilon=2.0, zeta=PSI / 2, blades=BLADES)
    weight = law.axial_stiffness * 2 * math.pi * RATE / (BLADES * speed)
    bit = cf.drilling.BitOnRock(law, weight=None if coupled else weight)
    return cf.drilling.Drilling(
        discs, cf.drilling.TopDrive(speed), bit, hook=cf.drilling.Hook(speed=-RATE), start="steady"
    )


def pushed(scene, dt, by):
    model = AxialTorsional(scene, dt)
    model._kept["v"][-1] += by
    return model


@pytest.mark.parametrize(("limit", "coupled"), [(2 * math.sqrt(2 * PSI / BLADES), False), (5.215775798890863, True)])
def test_vibrations_grow_below_the_regenerative_limit_and_decay_above_it(limit, coupled):
    """2 sqrt(2 psi/n) for axial motion alone; with torsion the limit of the quasi-polynomial (Richard et al. 2007)."""
    for speed, grows in ((0.99 * limit, True), (1.01 * limit, False)):
        rows = pushed(lumped(speed, coupled=coupled), 0.01, [1e-4, 0.0]).advance(6000)
        shaking = column(rows, "bit_advance") - RATE * rows[:, 0]
        early, late = (np.ptp(shaking[a : a + 1000]) for a in (2000, 5000))
        assert (late > 1.3 * early) if grows else (late < 0.8 * early)


def test_a_bit_that_shakes_follows_the_delay_equation_with_order_two():
    """u at 1, 2, 3 by Runge and Kutta's method with the delay that depends on the state, in published units."""
    exact = [0.0017178378340104425, 0.0034790366326158807, 0.0019899716831700367]
    start, errors = AxialTorsional(lumped(5.737353378779949, coupled=True), 0.01).bit_state()[0, 0], []
    for dt in (0.005, 0.0025):
        rows = pushed(lumped(5.737353378779949, coupled=True), dt, [0.05, 0.02]).advance(round(3 / dt))
        at = [round(t / dt) - 1 for t in (1, 2, 3)]
        errors.append(np.abs(column(rows, "bit_advance")[at] - RATE * np.arange(1, 4) - start - exact).max())
    assert errors[1] < 3e-6 and 3 < errors[0] / errors[1] < 5


def drilling(start="rest", weight=None, law=WORN, rpm=120.0, **more):
    bit = cf.drilling.BitOnRock(law, weight, inertia=41.0)
    rate = cf.drilling.Hook(speed=-1 / 120)
    return hanging(
        rate, cf.drilling.TopDrive(rpm * cf.units.rpm), bit, drag=cf.drilling.ViscousDrag(0.3, 0.5), start=start, **more
    )


def test_steady_drilling_is_a_solution():
    """Advance of the hook; weight and torque of the depth of cut and of the flats."""
    law, turns = WORN, 240 * cf.units.rpm
    rows = AxialTorsional(drilling("steady", rpm=240.0), 0.002).advance(100)
    cut, flats = 2 * math.pi / 120 / (4 * turns), 0.108 * 0.011 * 60e6
    weight = law.axial_stiffness * cut + flats
    torque = law.torsional_stiffness * cut + 0.6 * 0.108 / 2 * flats
    for name, value in (
        ("weight_on_bit", weight), ("torque_on_bit", torque), ("bit_speed", turns), ("bit_velocity", 1 / 120),
        ("drive_speed", turns),
    ):  # fmt: skip
        assert np.abs(column(rows, name) / value - 1).max() < 1e-6, name


def test_a_bit_that_is_pulled_up_steadily_is_free():
    """The rock does not pull it: no weight, no torque, and all of the string moves with the hook."""
    scene = hanging(
        cf.drilling.Hook(speed=0.01), cf.drilling.TopDrive(12.0), cf.drilling.BitOnRock(WORN), start="steady"
    )
    rows = AxialTorsional(scene, 0.002).advance(200)
    assert not column(rows, "weight_on_bit").any() and not column(rows, "torque_on_bit").any()
    assert np.abs(column(rows, "bit_velocity") + 0.01).max() < 1e-9


@pytest.mark.parametrize("start", ["rest", "steady"])
def test_without_a_hook_the_string_follows_the_bit(start):
    """The load of the hook stays, so that the mean weight on bit does; it drills by its depth of cut."""
    turns, steel = 240 * cf.units.rpm, 26.71375795359451 * 3000 + 147.91899737466485 * 200
    scene = dataclasses.replace(drilling(start, 120e3, rpm=240.0), hook=None)
    rows = AxialTorsional(scene, 0.004).advance(5000)
    # V from weight = k cut + flats + drag of the mud
    stiffness = WORN.axial_stiffness * 2 * math.pi / (4 * turns)
    rate = (120e3 - 0.108 * 0.011 * 60e6) / (stiffness + 0.5 * steel)
    weight = 120e3 - 0.5 * steel * rate
    if start == "steady":  # before vibrations grow
        assert column(rows, "weight_on_bit")[:250] == pytest.approx(weight, rel=1e-6)
        assert column(rows, "bit_velocity")[:250] == pytest.approx(rate, rel=1e-5)
    else:
        late = rows[:, 0] > 10
        assert column(rows, "weight_on_bit")[late].mean() == pytest.approx(weight, rel=0.05)
        assert np.ptp(column(rows, "bit_advance")[late]) > 5 * rate


@pytest.mark.parametrize("weight", [None, 120e3])
def test_a_bit_that_cuts_from_rest_keeps_the_books(weight):
    rows = AxialTorsional(drilling(weight=weight), 0.002).advance(8000)
    assert unbalanced(rows) < 1e-11 and column(rows, "lost_at_bit")[-1] > 1e4
    assert (column(rows, "weight_on_bit") >= -1e-6).all() and column(rows, "bit_speed").max() > 8


def test_a_worn_bit_stands_still_until_the_weight_exceeds_that_of_its_flats():
    """It does not turn, and the hook lowers it: the flats bear all up to a l sigma."""
    scene = hanging(cf.drilling.Hook(speed=-0.02), cf.drilling.TopDrive(0.0), cf.drilling.BitOnRock(WORN))
    rows = AxialTorsional(scene, 0.005).advance(4000)
    weight, deep = column(rows, "weight_on_bit"), column(rows, "bit_advance")
    limit = 0.108 * 0.011 * 60e6
    reached = int(np.argmax(weight > 0.99 * limit))
    assert reached > 100 and np.ptp(deep[:reached]) < 1e-12 and weight[-1] > 1.01 * limit
    assert deep[-1] > 1e-4


@pytest.mark.parametrize(("rpm", "rock", "amplitude"), [
    (60, math.inf, 31767.361251313883), (100, math.inf, 36070.57264496292), (60, 2.5e7, None), (100, 1e8, None),
])  # fmt: skip
def test_lobes_shake_the_weight_on_bit_as_the_impedance_says(rpm, rock, amplitude):
    """Three lobes: forced vibration, as long as the bit stays on the rock; where the rock gives way `bit_bounce` and
    the motion agree: D k/(D + k) of the dynamic stiffness D of the string."""
    turns = rpm * cf.units.rpm
    height, mass = (0.002, 0.0) if amplitude else (0.001, 500.0)
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(3, height), weight=80e3, mass=mass, rock_stiffness=rock)
    scene = hanging(
        cf.drilling.Hook(5e6), cf.drilling.TopDrive(turns), bit, drag=cf.drilling.ViscousDrag(0.2, 0.2), start="steady"
    )
    model = AxialTorsional(scene, 0.002, 300)
    rows = model.advance(30000)[20000:]
    phase = 3 * turns * (rows[:, 0] - model.dt / 2)
    parts = np.column_stack([np.sin(phase), np.cos(phase), np.ones(len(phase))])
    sine, cosine, mean = np.linalg.lstsq(parts, column(rows, "weight_on_bit"), rcond=None)[0]
    expected = amplitude or cf.drilling.bit_bounce(scene, [turns]).amplitude[0]
    assert math.hypot(sine, cosine) == pytest.approx(expected, rel=1e-3 if amplitude else 4e-3)
    assert mean == pytest.approx(80e3, rel=1e-3)


def test_a_bit_on_high_lobes_leaves_the_rock_and_is_not_pulled():
    scene = hanging(
        cf.drilling.Hook(stiffness=5e6),
        cf.drilling.TopDrive(140 * cf.units.rpm),
        cf.drilling.BitOnRock(cf.drilling.Lobes(3, 0.005), weight=40e3),
        drag=cf.drilling.ViscousDrag(0.2, 0.2),
    )
    rows = AxialTorsional(scene, 0.004).advance(5000)
    weight, up = column(rows, "weight_on_bit"), -column(rows, "bit_advance")
    assert weight.min() == 0.0 and weight.max() > 80e3 and up.max() > 0.006
    assert unbalanced(rows) < 1e-11


def test_what_is_recalled_goes_on_to_the_same_digits():
    for given in (drilling(weight=100e3), drilling(law=cf.drilling.Lobes(3, 0.002), weight=80e3)):
        model, again = AxialTorsional(given, 0.004, 60), AxialTorsional(given, 0.004, 60)
        model.advance(700)
        again.recall(model.memory())
        np.testing.assert_array_equal(model.advance(300), again.advance(300))


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (lambda: AxialTorsional(drilling(), axial=False), "torsion alone"),
        (lambda: AxialTorsional(drilling("steady", 80e3, cf.drilling.Stribeck(4e3, 3e3, 1.0))), "does not give way"),
        (lambda: drilling("turning"), "Drilling.start.*'rest' or 'steady'"),
        (
            lambda: AxialTorsional(
                cf.drilling.Drilling(
                    drilling().string, cf.drilling.TopDrive(control=cf.drilling.Motor(5e3)), start="steady"
                )
            ),
            "Drilling.start.*PI",
        ),
        (lambda: cf.drilling.Discs((1.0, 1.0), (1.0,), axial_stiffnesses=(1.0,)), "axial_stiffnesses.*without masses"),
        (
            lambda: cf.drilling.Drilling(
                cf.drilling.Discs((1.0, 1.0), (1.0,)), cf.drilling.TopDrive(1.0), hook=cf.drilling.Hook()
            ),
            "turn alone",
        ),
    ],
)
def test_refused_bits(scene, message):
    with pytest.raises(cf.SceneError, match=message):
        scene()


def test_steady_drilling_cuts_the_advance_of_a_blade():
    slope, blades = 0.002 / (2 * math.pi), 4
    cut = 2 * math.pi * slope / blades
    rock = RockSurface(blades, slope=slope, cut=cut)
    for angle in np.linspace(0.01, 40.0, 400):
        assert abs(rock.pass_over(angle, slope * angle, slope) - cut) < 1e-15


def test_the_delayed_depth_of_a_vibrating_bit_is_interpolated_with_order_four():
    def error(places):
        rock = RockSurface(3)
        for angle in np.linspace(0.0, 6.0, places)[1:]:
            rock.pass_over(angle, angle + 0.2 * math.sin(2 * angle), 1 + 0.4 * math.cos(2 * angle))
        at = np.linspace(3.0, 5.9, 1717)
        return max(
            abs(rock.under(x)[0] - (y + 0.2 * math.sin(2 * y))) for x, y in zip(at, at - rock.pitch, strict=True)
        )

    assert 13 < error(61) / error(121) < 19


def test_rock_that_a_bit_jumps_over_remains():
    rock = RockSurface(2)
    for angle in np.linspace(0.0, 3.0, 31)[1:]:
        assert abs(rock.pass_over(angle, 0.01, 0.0) - 0.01) < 1e-15  # half a turn 10 mm deep
    for angle in np.linspace(3.0, 8.0, 51)[1:]:
        cut = rock.pass_over(angle, -0.005, 0.0)  # a turn above the rock
    assert abs(cut + 0.015) < 1e-12 and abs(rock.under(10.0)[0] - 0.01) < 1e-12


def test_recall_leads_to_the_same_digits():
    rock, again = RockSurface(4, slope=1e-3, cut=1e-3), RockSurface(4)
    path = [(0.1 * k, 1e-3 * math.sin(k), 1e-3 * math.cos(k)) for k in range(1, 40)]
    for place in path[:20]:
        rock.pass_over(*place)
    again.recall(rock.memory())
    assert [rock.pass_over(*x) for x in path[20:]] == [again.pass_over(*x) for x in path[20:]]


@pytest.mark.parametrize(("static", "unstable"), [(8e3, True), (5e3, False)])
def test_an_unstable_steady_state_that_nothing_disturbs_says_so(static, unstable, monkeypatch):
    """By the linear theory, which is solved once for all summaries of a motion."""
    solved, solve = [], linear.stability
    monkeypatch.setattr(linear, "stability", lambda *given, **more: solved.append(given) or solve(*given, **more))
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(static, 5e3, 3.0), inertia=41.0)
    steady = cf.drilling.Drilling(scene().string, cf.drilling.TopDrive(6.0), bit, start="steady")
    history = cf.drilling.simulate(steady, 1.0)
    title = history.plot()._suptitle.get_text()
    for text in (history.stick_slip().caution, str(history), title.replace("\n", " ")):
        assert (" ".join(text.split()).count("nothing disturbed it") == 1) == unstable
    assert history.stick_slip(0.25).caution == history.stick_slip().caution and len(solved) == 1
    weights = cf.drilling.stability(steady, [6.0], [1e4, 2e4], up_to=1.0)
    assert any("give radius=" in caution for caution in weights.cautions)
    assert not any("give radius=" in x for x in cf.drilling.stability(steady, [6.0], [1e4], up_to=1.0).cautions)


def test_soft_torque_asks_for_the_depth():
    string = scene().string
    parts = string.components
    endless = replace(string, components=(*parts[:-1], replace(parts[-1], length=None)))
    with pytest.raises(cf.SceneError, match="SoftTorque.depth = None.*depth of the bit.*SoftTorque.scene, inertia"):
        cf.drilling.SoftTorque(endless, inertia=2000.0)
    assert cf.drilling.SoftTorque(endless, inertia=2000.0, depth=3000.0).Kp > 0
