"""A drill-string in motion: what is refused, the history and what it tells, Ctrl-C and failures."""

import numpy as np
import pytest
from fake_string import Pendulum, scene, use

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.history import DrillingHistory
from cosserat_fenicsx.drilling.protocol import LEDGER, PROFILE, SERIES

pytestmark = [pytest.mark.serial, pytest.mark.once]
rpm = cf.units.rpm


@pytest.fixture
def history(monkeypatch):
    use(monkeypatch)
    return cf.drilling.simulate(scene(), 60.0)


def test_rows_are_those_of_the_model(history):
    model = Pendulum(scene(), 0.01)
    rows = model.advance(6000)
    for i, name in enumerate(("times", *SERIES, *LEDGER)):
        assert np.array_equal(getattr(history, name), rows[:, i], equal_nan=True), name
    assert len(history) == 6000 and history.times[-1] == 60.0 and history.model == "torsion"
    assert history.profile_times == pytest.approx(np.arange(1, 401) * 0.15) and history.speed.shape == (400, 5)
    assert (history.angle[-1] == model.profile()[0]).all() and history.sticking.dtype == bool
    assert history.sticking[:, -1].any() and not history.sticking[:, 0].any()


def test_rows_are_thinned(history, monkeypatch):
    coarse = cf.drilling.simulate(scene(), 60.0, save_every=0.05, profile_every=2.0)
    assert (coarse.bit_speed == history.bit_speed[4::5]).all() and len(coarse.profile_times) == 30
    assert (coarse.speed[2] == history.speed[39]).all()  # both at 6 s


def test_stick_slip(history):
    """Free swings about the drive's speed between two rests: the period of the pendulum in closed form."""
    found = history.stick_slip(since=15.0)
    J, k, Om, drop = 374.0, 473.0, 60 * rpm, 3000.0
    w = np.sqrt(k / J)
    a = drop / k  # the twist at release beyond that of the friction in motion
    swing = (2 * np.pi - 2 * np.arctan2(a * w, Om)) / w  # until the bit comes to rest
    assert found.period == pytest.approx(swing + 2 * a / Om, rel=1e-3)
    assert found.peak == pytest.approx(Om + np.hypot(Om, a * w), rel=1e-2)
    assert found.stuck == pytest.approx(2 * a / Om / found.period, abs=6e-3) and found.sticks
    reach = k * np.hypot(a, Om / w)
    assert found.torque == pytest.approx((drop - reach, drop + reach), abs=60) and found.severity > 1
    assert len(found.starts) == len(found.stops) and np.ptp(found.periods) < 0.03
    assert "stick-slip: period" in str(history) and "bit (rpm)" in str(history) and "hook load" not in str(history)
    with pytest.raises(cf.SceneError, match=r"stick_slip.since = 70: expected .* up to 60 s"):
        history.stick_slip(70.0)


def test_starts_and_stops_are_interpolated():
    from cosserat_fenicsx.drilling.stick_slip import crossings

    speed = np.array([0.0, 0.0, 2.0, 2.0, 0.0, 0.6, 0.4, 0.0, -4.0])  # it creeps at 5 s
    starts, stops = crossings(np.arange(9.0), speed, 0.5, 1.0)
    assert starts == pytest.approx([1.25, 7.125]) and stops == pytest.approx([3.75])


@pytest.mark.parametrize("sign", [1, -1])
def test_a_bit_that_swings_back_stops_once_a_period(sign):
    """6 + 10 sin(2 pi t/5): it turns against the drive for a time, and no sample is at rest."""
    rows = np.zeros((12000, 1 + len(SERIES) + len(LEDGER)))
    t = rows[:, 0] = 0.005 * np.arange(12000) + 0.0017
    rows[:, 1 + SERIES.index("drive_speed")] = 6.0 * sign
    rows[:, 1 + SERIES.index("bit_speed")] = sign * (6 + 10 * np.sin(2 * np.pi * t / 5))
    found = DrillingHistory(scene(), "torsion", (), 0.005, np.arange(2.0), rows).stick_slip()
    assert found.period == pytest.approx(5, rel=1e-4) and found.sticks and found.stuck == 0
    assert found.starts[0] % 5 == pytest.approx(5 - np.arcsin(0.6) * 5 / (2 * np.pi), abs=6e-3)


def test_balance(history):
    assert np.abs(history.balance).max() < 0.05 * history.work_of_drive[-1] and history.balance[-1] != 0


def test_tables_and_files(history, tmp_path):
    history.write(tmp_path / "out.csv")
    lines = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("time (s),drive speed (rad/s),drive angle (rad)") and "hook load" not in lines[0]
    assert len(lines) == 6001 and lines[-1].startswith("60.0,6.283185307179586,")
    with pytest.raises(cf.SceneError, match=r"ends in .csv or .nc"):
        history.write(tmp_path / "out.xlsx")
    pytest.importorskip("pandas")
    assert history.to_dataframe()["bit speed (rad/s)"].max() == history.bit_speed.max()
    xarray = pytest.importorskip("xarray")
    found = history.to_xarray()
    assert found.speed.dims == ("profile_time", "depth") and found.bit_speed.attrs["units"] == "rad/s"
    assert set(found) == {*SERIES, *LEDGER, *PROFILE, "balance"}
    pytest.importorskip("h5netcdf")
    history.write(tmp_path / "out.nc")
    again = xarray.open_dataset(tmp_path / "out.nc", engine="h5netcdf")
    assert (again.bit_angle.values == history.bit_angle).all() and again.attrs["model"] == "torsion"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"duration": -1.0}, r"simulate.duration = -1.0: expected a positive number \(s\)"),
        ({"dt": 0.0}, r"simulate.dt = 0.0: expected a positive number \(s\)"),
        ({"dt": 100.0}, r"simulate.dt = 100.0: expected at most the duration, 60 s"),
        ({"dt": 1e-8}, r"dt = 1e-08: expected at least 6e-07 s: 1e\+08 steps in 60 s"),
        ({"dt": 0.1}, r"dt = 0.1: expected a step of at most 0.0531 s, .* 1 rad in a step at 3 times the speed"),
        ({"duration": 3e5}, r"save_every = None: expected at least 0.015 s: 2e\+07 rows in 300000 s"),
        ({"save_every": 61.0}, r"save_every = 61.0: expected at most the duration"),
        ({"elements": 0}, r"elements = 0: expected how many along the string"),
        ({"model": "torsional"}, r"model = 'torsional': did you mean 'torsion'"),
        ({"scene": 3}, r"scene = 3: expected a Drilling"),
    ],
)
def test_what_is_refused(given, words, monkeypatch):
    use(monkeypatch)
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.simulate(**{"scene": scene(), "duration": 60.0, **given})


def test_jumps_in_speed_need_a_drive_that_follows(monkeypatch):
    use(monkeypatch)
    drive = cf.drilling.TopDrive(cf.signals.Step((6.0,), start=3.0))
    with pytest.raises(cf.SceneError, match=r"no jump, such as that of 6 rad/s at t = 3 s: no drive follows it"):
        cf.drilling.simulate(scene(drive=drive), 10.0)
    ramp = cf.drilling.TopDrive(cf.signals.Ramp((6.0,), start=1.0, end=3.0))
    assert cf.drilling.simulate(scene(drive=ramp), 10.0).drive_speed[-1] == 6.0


def test_a_failing_step_keeps_what_is_done(monkeypatch):
    use(monkeypatch, fails_at=1000)
    with pytest.raises(cf.NotConverged, match="the step at t = 10 s fails") as stop:
        cf.drilling.simulate(scene(), 60.0)
    assert 900 < len(stop.value.path) <= 1000 and "halved" in stop.value.path.counts


def test_ctrl_c_keeps_what_is_done(monkeypatch):
    use(monkeypatch, stops_at=2000)
    with pytest.raises(
        cf.Interrupted, match=r"interrupted after \d+ times, which the exception's `path` holds"
    ) as stop:
        cf.drilling.simulate(scene(), 60.0)
    history = stop.value.path
    assert 1700 < len(history) <= 2000 and history.stick_slip().sticks


def test_progress_is_told(monkeypatch, capsys):
    use(monkeypatch)
    cf.drilling.simulate(scene(), 20.0, progress=True)
    assert "torsion, 5 places: t (s) = " in capsys.readouterr().err


def test_histories_can_be_pickled(history):
    import pickle

    again = pickle.loads(pickle.dumps(history))
    assert (again.bit_speed == history.bit_speed).all() and repr(again) == repr(history)


def test_speeds_of_discs_are_those_at_the_end_of_a_step():
    """Two discs that a constant torque turns, in closed form; means over a step would be off by 3e-3 rad/s."""
    J, k, M = (2122.0, 374.0), 473.0, 1000.0
    drive = cf.drilling.TopDrive(control=cf.drilling.Motor(M))
    found = cf.drilling.simulate(
        cf.drilling.Drilling(cf.drilling.Discs(J, (k,)), drive), 10.0, dt=8e-3, profile_every=1.0
    )
    w = np.sqrt(k * sum(J) / (J[0] * J[1]))
    swing = M / J[0] / w * np.sin(w * found.times)
    for values, exact in ((found.drive_speed, J[1] * swing), (found.bit_speed, -J[0] * swing)):
        assert np.abs(values - (M * found.times + exact) / sum(J)).max() < 1e-4
    rows = np.searchsorted(found.times, found.profile_times - 1e-9)
    assert (found.speed[:, -1] == found.bit_speed[rows]).all()


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_what_is_a_mean_has_times_of_its_own(model):
    """Before anything comes back a string takes the torque Z om(t) from a drive: at mean_times to the second order."""
    pipe, off = cf.well.DrillPipe(3000.0, None, 0.127, 0.10861), []
    turned = cf.drilling.Drilling(
        cf.well.DrillString((pipe,)), cf.drilling.TopDrive(lambda t: 10 * np.sin(1.5 * t) ** 2)
    )
    Z = turned.segments[0].torsional_impedance
    for dt in (2e-2, 1e-2):
        found = cf.drilling.simulate(turned, 1.8, model=model, dt=dt)
        exact = Z * 10 * np.sin(1.5 * found.mean_times) ** 2
        off.append(np.abs(found.surface_torque - exact)[found.times > 0.1].max() / exact.max())
    assert off[0] < 2e-3 and off[1] < 0.3 * off[0], off
