"""Charts and films of a drill-string in motion: what is drawn, its units, what is refused."""

import numpy as np
import pytest
from fake_string import scene, use

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.charts import advance_unit

pytest.importorskip("matplotlib")
pytestmark = [pytest.mark.serial, pytest.mark.once]


@pytest.fixture
def history(monkeypatch):
    use(monkeypatch)
    return cf.drilling.simulate(scene(), 30.0)


def curve(panel, label):
    return next(line for line in panel.lines if line.get_label() == label).get_ydata()


def test_over_time(history, tmp_path):
    speeds, torques = history.plot().axes
    assert curve(speeds, "bit") == pytest.approx(history.bit_speed / cf.units.rpm)
    assert curve(torques, "at the surface") == pytest.approx(history.surface_torque / 1e3)
    assert [panel.get_ylabel() for panel in (speeds, torques)] == ["speed (rpm)", "torque (kN m)"]
    assert torques.get_xlabel() == "time (s)"
    part = history.plot(between=(10.0, 20.0)).axes[0].lines[0].get_xdata()
    assert part[0] == pytest.approx(10.0) and part[-1] == pytest.approx(20.0)
    history.plot(tmp_path / "out.png")
    assert (tmp_path / "out.png").stat().st_size > 20_000


def test_the_map(history):
    panel, bar = history.plot_map().axes
    speeds, sticks, of_bit = panel.collections
    title = panel.figure.get_suptitle()
    assert np.asarray(speeds.get_array()).reshape(5, -1) == pytest.approx(history.speed.T / cf.units.rpm)
    assert np.ma.count(np.ma.masked_invalid(sticks.get_array())) == history.sticking.sum() > 0
    assert len(of_bit.get_paths()) > 1 and "(at the lower edge: the bit)" in title
    assert bar.get_ylabel() == "speed of rotation (rpm)" and panel.get_ylabel() == "measured depth (m)"
    assert panel.get_ylim() == (1000.0, 0.0) and "grey: held by friction" in title
    assert history.plot_map(what="angle").axes[1].get_ylabel() == "turns"
    with pytest.raises(cf.SceneError, match="the torsion model has none: expected model='axial and torsional'"):
        history.plot_map(what="tension")
    with pytest.raises(cf.SceneError, match="what = 'speeds': did you mean 'speed'"):
        history.plot_map(what="speeds")


def test_what_is_grey_is_told_and_the_drive_is_named(history):
    legend = [text.get_text() for text in history.plot().axes[0].get_legend().get_texts()]
    assert "bit at rest" in legend
    string, rpm = history.scene.string, cf.units.rpm
    history.scene = scene(
        drive=cf.drilling.TopDrive(60 * rpm, inertia=2900.0, control=cf.drilling.SoftSpeed(string, 2900.0))
    )
    assert "PI (Kp = 4 impedances) drive at 60 rpm" in history.plot()._suptitle.get_text()


def test_long_runs_show_bands_between_extremes(monkeypatch):
    use(monkeypatch)
    history = cf.drilling.simulate(scene(), 1000.0, dt=0.02, profile_every=10.0)
    speeds = history.plot().axes[0]
    assert not speeds.lines and len(speeds.collections) == 2
    tops = [shape.get_paths()[0].vertices[:, 1].max() for shape in speeds.collections]
    assert max(tops) == pytest.approx(history.bit_speed.max() / cf.units.rpm)
    assert history.plot(between=(900.0, 930.0)).axes[0].lines
    period = history.stick_slip().period
    words = f"profiles are 10 s apart, and the period of stick-slip is {period:.3g} s"
    title = history.plot_map().get_suptitle()
    assert words in " ".join(title.split()) and words[1:] in str(history)


def test_a_long_way_is_in_metres():
    assert advance_unit(np.array([np.nan, 0.2])) == ("mm", 1e3) and advance_unit(np.array([-3.0, 0.0])) == ("m", 1.0)


def test_phase_and_energy(history):
    (panel,) = history.plot_phase(since=10.0).axes
    assert panel.get_xlabel().endswith("(rad)") and panel.lines[0].get_xdata()[0] == pytest.approx(
        history.drive_angle[999] - history.bit_angle[999]
    )
    above, below = history.plot_energy().axes
    assert {line.get_label() for line in above.lines} == {"kinetic", "strain", "work of the drive", "lost at the bit"}
    assert below.lines[0].get_ydata() == pytest.approx(history.balance) and below.get_ylabel().endswith("(J)")


def test_what_is_refused(history, tmp_path):
    for between, words in (((3, 1), "two times .s., ascending"), ((40, 50), "which ends at 30 s")):
        with pytest.raises(cf.SceneError, match=words):
            history.plot(between=between)
    with pytest.raises(cf.SceneError, match="since = 40.0: expected a time .s. before the end, 30 s"):
        history.plot_phase(since=40.0)
    with pytest.raises(cf.SceneError, match="expected a name that ends in"):
        history.plot(tmp_path / "out.docx")
    with pytest.raises(cf.SceneError, match=r"ends in .gif or .mp4"):
        history.animate(tmp_path / "out.avi")
    with pytest.raises(cf.SceneError, match="at most 10000 frames"):
        history.animate(tmp_path / "out.gif", speed=1e-3)


@pytest.mark.slow
def test_a_film(history, tmp_path):
    image = pytest.importorskip("PIL.Image")
    history.animate(tmp_path / "out.gif", speed=30.0, fps=5)
    film = image.open(tmp_path / "out.gif")
    assert film.n_frames == 6 and film.size == (960, 600)
