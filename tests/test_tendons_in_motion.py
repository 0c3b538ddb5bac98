"""Tendons of given length in motions: small vibrations, a mass on a tendon that is slack at times, energy, resuming."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares, minimize_scalar

import cosserat_fenicsx as cf

EI, GJ, EA, GA, LENGTH, E = 0.02, 0.016, 5000.0, 3000.0, 0.3, 0.01
LINE, STIFFNESS = cf.Line((0, 0, 0), (0, 0, LENGTH)), dict(shear=(GA, GA), axial=EA, bending=(EI, EI), torsion=GJ)
ROD = cf.Rod(LINE, cf.Stiffness(**STIFFNESS, mass=0.5, inertia=(1e-5, 1e-5, 2e-5)), name="arm")
FINE = dict(elements=4, degree=4)


def arm(*loads, rod=ROD):
    return cf.Scene([rod], [cf.Clamp(rod.start)], loads)


@pytest.mark.serial
def test_it_vibrates_as_its_modes(truth):
    """Released from a small force. Steps h turn the phase of a vibration by 2 arctan(omega h/2)."""
    tendon, share, steps = cf.Tendon(ROD, (E, 0), shortening=0.006, axial=300.0), 0.01, 48
    omega = 2 * np.pi * cf.modes(arm(tendon), 6, load_factor=share, elements=8).frequencies[1::2]  # in the plane
    h = 2 * np.pi / omega[0] / steps
    at_rest, pulled = (
        cf.solve(arm(tendon, *more), [share], **FINE) for more in ([], [cf.Force(ROD.end, (1e-7 / share, 0, 0))])
    )
    history = cf.simulate(arm(tendon), 3 * steps * h, dt=h, start=pulled, load_factor=share, model="planar", **FINE)
    moved = (history.position(ROD.end) - at_rest.position(ROD.end)[-1])[:, 0]
    phases = np.arctan(omega * h / 2) * 2 / h

    def misfit(ratio):
        waves = np.multiply.outer(history.times, [ratio[0] * phases[0], *phases[1:]])
        basis = np.hstack([np.cos(waves), np.sin(waves)])
        return (basis @ np.linalg.lstsq(basis, moved, rcond=None)[0] - moved) / np.abs(moved).max()

    found = least_squares(misfit, [1.0001], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert np.abs(found.fun).max() < 0.01
    truth("tendons: by length, frequency in a motion over that of the mode", found.x[0], 1.0, 1e-6, of=1.0)
    assert history.tendon(tendon).tension == pytest.approx(at_rest.tendon(tendon).tension[-1], rel=1e-4)


def test_a_mass_on_a_tendon_that_is_slack_at_times(truth):
    """A light rod and the tendon in its axis are two springs; that of the tendon does not push, and its length changes
    in time."""
    light = cf.Rod(LINE, cf.Stiffness(**STIFFNESS, mass=1e-9, inertia=(1e-14, 1e-14, 2e-14)), name="arm")
    mass, axial, duration = 2.0, 3000.0, 0.05
    tendon = cf.Tendon(light, (0, 0), shortening=cf.signals.Sine(2e-3, 40.0), axial=axial)

    def tension(t, moved):
        left = LENGTH - 2e-3 * np.sin(80 * np.pi * t)
        return axial * np.maximum((LENGTH + moved) / left - 1, 0)

    def rates(t, y):
        return y[1], -(EA / LENGTH * y[0] + tension(t, y[0])) / mass

    scene = arm(tendon, cf.PointMass(light.end, mass), rod=light)
    history = cf.simulate(scene, duration, dt=1e-4, elements=1, degree=4)
    exact = solve_ivp(rates, (0, duration), (0, 0), rtol=1e-11, atol=1e-14, max_step=1e-4, t_eval=history.times)
    expected, state = tension(history.times, exact.y[0]), history.tendon(history.scene.loads[0])
    assert 0.4 < state.slack.mean() < 0.7
    truth("tendons: by length in time, tension over its largest", state.tension / expected.max(),
          expected / expected.max(), 1e-4, of=1.0)  # fmt: skip


def test_one_with_friction_is_pulled_and_let_go(truth):
    """Slowly: 1/T = 1/T0 + mu e s/EI; it slides back to where 1/T0 - mu e s/EI is as large, and sticks beyond."""
    slow = cf.Rod(LINE, cf.Stiffness(**STIFFNESS, mass=1e-3, inertia=(1e-8, 1e-8, 2e-8)), name="arm",
                  damping=cf.Damping(time=0.02))  # fmt: skip
    first, last, by = 8.0, 5.0, 0.5 * E / EI
    motor = cf.signals.Table([0.0, 0.3, 0.5, 0.7], [0.0, first, first, last])
    tendon = cf.Tendon(slow, (E, 0), motor, friction=0.5, axial=300.0)
    history = cf.simulate(arm(tendon, rod=slow), 0.9, dt=0.02, scheme="generalised-alpha", elements=4)
    state = history.tendon(history.scene.loads[0])
    pulled = 1 / (1 / first + by * state.s)
    let_go = np.minimum(pulled, 1 / (1 / last - by * state.s))
    at = int(np.argmin(np.abs(history.times - 0.5)))
    truth("tendons: friction, slowly pulled, tension", state.along[at] / first, pulled / first, 1e-3, of=1.0)
    truth("tendons: friction, slowly let go, tension", state.along[-1] / first, let_go / first, 1e-3, of=1.0)
    assert history.to_dict()["rods"]["arm"]["tendon_tension"].shape == (len(history), 13)


def test_its_work_and_a_motion_that_goes_on(tmp_path_all):
    """The energy-conserving scheme closes the balance while tendons get slack and taut, and a motion that is continued
    has the same digits."""
    pair = (
        cf.Tendon(ROD, (E, 0), shortening=cf.signals.Sine(1e-3, 40.0), axial=300.0),
        cf.Tendon(ROD, cf.Helical(E, LENGTH), shortening=1e-4, axial=300.0),
    )
    scene = arm(*pair, cf.Force(ROD.end, (0.2, 0.1, -0.05)))
    how = dict(dt=1e-3, scheme="energy", elements=2, degree=2)
    whole = cf.simulate(scene, 0.04, **how, folder=tmp_path_all / "whole")
    states = [whole.tendon(load) for load in whole.scene.loads[:2]]
    assert all(0 < state.slack.sum() < len(whole) for state in states)
    assert np.abs(whole.balance).max() < 1e-11 * np.abs(whole.work).max()
    cf.simulate(scene, 0.021, **how, folder=tmp_path_all / "parts")
    both = cf.resume(tmp_path_all / "parts", scene, duration=0.04)
    assert np.array_equal(both.position(ROD.end), whole.position(ROD.end))
    for state, load in zip(states, both.scene.loads, strict=False):
        assert np.array_equal(both.tendon(load).tension, state.tension)


@pytest.mark.parametrize("pulled", ["start", "end"])
def test_the_work_of_one_that_slides_and_sticks(pulled, tmp_path_all):
    """The balance closes, beside a tendon of given length too, and a motion that is continued is the same."""
    motor = cf.signals.Table([0, 0.01, 0.02, 0.03], [1, 5, 1, 5.0])
    rough = cf.Tendon(ROD, (0, E), motor, friction=0.4, axial=300.0, pulled=pulled)
    wound = cf.Tendon(ROD, cf.Helical(E, LENGTH), shortening=1e-4, axial=300.0)
    scene, how = arm(rough, wound), dict(dt=1e-3, scheme="energy", elements=2, degree=2)
    whole = cf.simulate(scene, 0.03, **how)
    assert np.abs(whole.balance).max() < 1e-11 * np.abs(whole.work).max()
    cf.simulate(scene, 0.013, **how, folder=tmp_path_all / "parts")
    both = cf.resume(tmp_path_all / "parts", scene, duration=0.03)
    assert both.position(ROD.end) == pytest.approx(whole.position(ROD.end), abs=1e-13)
    both, state = (x.tendon(x.scene.loads[0]) for x in (both, whole))
    assert both.along == pytest.approx(state.along, abs=1e-8)
    assert state.along[:, 0 if pulled == "start" else -1] == pytest.approx(state.tension, rel=1e-12)


def test_a_motion_starts_with_what_has_slid():
    """Nothing moves, with several in one place too."""
    pair = [cf.Tendon(ROD, (E, 0), tension, friction=0.5, axial=300.0) for tension in (6.0, 2.0)]
    start = cf.solve(arm(*pair), [1.0], **FINE)
    history = cf.simulate(arm(*pair), 0.05, dt=5e-3, start=start, **FINE)
    moved = history.position(ROD.end) - start.position(ROD.end)[-1]
    assert np.abs(moved).max() < 1e-10
    for tendon in pair:
        assert history.tendon(tendon).along[-1] == pytest.approx(start.tendon(tendon).along[-1], rel=1e-5)
    other = cf.Tendon(ROD, (E, 0), lambda t: 8.0, friction=0.4, axial=300.0)
    with pytest.raises(cf.SceneError, match="another friction or pulled end in the path"):
        cf.simulate(arm(other), 0.05, dt=5e-3, start=start, **FINE)


@pytest.mark.slow
def test_small_vibrations_stick():
    """After the first slips an arm under a small force vibrates as its modes do, in which the tendon sticks: at 2.00 Hz
    in its plane, and not at 1.28 Hz as with a tendon of given tension without friction."""
    tendon, fine = cf.Tendon(ROD, (E, 0), 8.0, friction=0.5, axial=300.0), dict(elements=2, degree=4)
    expected = cf.modes(arm(tendon), 2, load_factor=1.0, elements=4).frequencies[1]
    start, h = cf.solve(arm(tendon), [1.0], **fine), 1 / expected / 50
    history = cf.simulate(arm(tendon, cf.Force(ROD.end, (1e-3, 0, 0))), 4.2 / expected, dt=h, start=start, **fine)
    late = history.times > 1.6 / expected
    moved = history.position(ROD.end)[late, 0]

    def misfit(f):
        f = np.arctan(np.pi * f * h) / np.pi / h
        waves = np.exp(2j * np.pi * f * history.times[late])
        basis = np.stack([np.ones(len(waves)), waves.real, waves.imag], axis=1)
        return np.linalg.norm(basis @ np.linalg.lstsq(basis, moved, rcond=None)[0] - moved)

    found = minimize_scalar(misfit, bounds=(expected / 2, 1.3 * expected), method="bounded").x
    assert found == pytest.approx(expected, rel=0.02)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("shortening", "axial", "says"),
    [
        (0.01, None, "does not stretch"),
        (cf.signals.Ramp(0.4, 0, 0.01), 1e2, "less than the length of the tendon, 0.3 m, at the time t = 0.00"),
    ],
)
def test_what_is_refused(shortening, axial, says):
    with pytest.raises(cf.SceneError) as found:
        cf.simulate(arm(cf.Tendon(ROD, (E, 0), shortening=shortening, axial=axial)), 0.01, dt=1e-3, **FINE)
    assert says in str(found.value)
