"""Texts of every kind of chart, at 1280 and at 400 pixels: they can be read, overlap nothing, and stay inside."""

import itertools
from functools import partial

import numpy as np
import pytest
import test_well_sweep as wells
import test_whirl
from fake_string import scene, use
from motion_chart import Curve, Shapes, figure_of
from reference_strings import pipe_and_collars
from test_whirl import collar  # noqa: F401

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.charts import chatter
from cosserat_fenicsx.pictures.charts import draw_chart

pytest.importorskip("matplotlib")
pytestmark = [pytest.mark.serial, pytest.mark.once]
#: Pixels that a letter is high at least, and that boxes of texts may share: their margins.
LEGIBLE, MARGIN = 9.0, 1.0


def texts_of(figure):
    """[(words, box)] of all that is written in a Figure, as `arrange` has drawn it at last."""
    found = [figure._suptitle]
    for panel in figure.axes:
        if not panel.get_visible():
            continue
        found += [panel.title, panel.xaxis.label, panel.yaxis.label, *panel.texts]
        found += [panel.xaxis.get_offset_text(), panel.yaxis.get_offset_text()]
        for axis, limits in ((panel.xaxis, panel.get_xlim()), (panel.yaxis, panel.get_ylim())):
            inside = [low - 1e-9 * abs(low) <= x <= high + 1e-9 * abs(high)
                      for low, high in (sorted(limits),) for x in axis.get_ticklocs()]  # fmt: skip
            ticks = axis.get_major_ticks(len(inside))
            for tick in itertools.compress(ticks, inside):
                found += [tick.label1, tick.label2]
        if panel.get_legend() is not None:
            found += [*panel.get_legend().get_texts(), panel.get_legend().get_title()]
    found = [text for text in found if text is not None and text.get_visible() and text.get_text().strip()]
    assert all(text.get_fontsize() * figure.dpi / 72 >= LEGIBLE for text in found)
    return [(text.get_text(), text.get_window_extent()) for text in found]


def check(figure, width):
    assert figure.bbox.width == pytest.approx(width)
    texts = texts_of(figure)
    assert len(texts) > 8
    for words, box in texts:
        assert min(box.x0, box.y0) > -MARGIN, f"outside: {words!r}"
        assert box.x1 < figure.bbox.x1 + MARGIN and box.y1 < figure.bbox.y1 + MARGIN, f"outside: {words!r}"
    for (one, a), (other, b) in itertools.combinations(texts, 2):
        shared = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(shared) <= MARGIN, f"{one!r} and {other!r} share {shared} pixels"


def check_all(*plots, units=True):
    for plot in plots:
        check(plot(width=1280), 1280)
        check(plot(width=400, **({"units": "field"} if units else {})), 400)  # the texts are longer in these


def test_strings_in_motion(monkeypatch):
    use(monkeypatch)
    history, long = (
        cf.drilling.simulate(scene(), 30.0),
        cf.drilling.simulate(scene(), 300.0, profile_every=3.0),
    )
    check_all(history.plot, history.plot_map, history.plot_phase, history.plot_energy, long.plot, long.plot_map)
    assert history.plot(units="field").axes[1].get_ylabel() == "torque (ft-lbf)"
    torque = history.plot(units={"moment": "N m"}).axes[1].lines[0].get_ydata()
    assert torque == pytest.approx(history.torque_on_bit)
    for wrong in ({"units": "imperial"}, {"width": 10}, {"width": "wide"}):
        with pytest.raises(cf.SceneError, match=next(iter(wrong))):
            history.plot(**wrong)


def test_stability_of_strings():
    plain, speeds = pipe_and_collars("SoftSpeed"), np.linspace(4.0, 16.0, 7)
    rock = cf.drilling.BitOnRock(cf.drilling.Lobes(3, 0.002), weight=8e4)
    lobes = pipe_and_collars(bit=rock, hook=cf.drilling.Hook(1.0))
    check_all(
        cf.drilling.stability(plain, speeds, [3e4, 8e4], up_to=1.0).plot,
        cf.drilling.stability(plain, speeds, up_to=1.0).plot,
        cf.drilling.campbell(lobes, 20.0, up_to=2.0).plot,
        cf.drilling.bit_bounce(lobes, speeds).plot,
    )


def test_sections_in_holes(collar):  # noqa: F811
    rod, wall, history = collar
    station = rod.at(test_whirl.LENGTH / 2)
    check_all(
        lambda **look: history.plot_orbit(station, wall, **look),
        lambda **look: history.plot_whirl(station, **look),
        history.plot_energy,
    )
    curve = Curve("time (s)", "displacement (m)", [("x", history.times, history.displacement(station)[:, 0])])
    motion = partial(draw_chart, lambda: figure_of(history, Shapes("yz", station), curve))
    check_all(motion, units=False)


@pytest.mark.slow
def test_strings_in_wells():
    sliding = cf.well.torque_and_drag(wells.HOLE, wells.STRING, cf.well.Sliding(1e5), mud=wells.MUD, model="buckled")
    fit = cf.well.calibrate_friction(wells.HOLE.with_friction(0.0), wells.STRING, wells.measured(1.0), mud=wells.MUD)
    check_all(sliding.plot, lambda **look: sliding.plot(between=(2300, 2500), **look), wells.sweep().plot, fit.plot)
    assert sliding.plot(units="field").axes[1].get_xlabel() == "tension (klbf)"


def test_chatter_is_counted_apart_from_what_it_rides_on_and_from_noise():
    t = np.linspace(0, 100, 50_001)
    slow, fast = np.sin(2 * np.pi * 0.2 * t), np.sin(2 * np.pi * 9 * t)
    assert chatter(slow) == pytest.approx(20, abs=1) and chatter(slow + 0.3 * fast) == pytest.approx(900, rel=0.02)
    assert chatter(slow + 0.01 * fast) < 100 and chatter(0 * t) == 0
