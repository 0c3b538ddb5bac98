"""Speed against accuracy of stick-slip: waves and elements of this package beside a first-order upwind scheme.

    python demos/evidence/work_precision_string.py           a quarter of a minute
    python demos/evidence/work_precision_string.py --quick   one sample of the coarser ones

Writes to out/: work_precision_string.md (the table), work_precision_string.png (the chart).

3000 m of pipe and 200 m of collars under a stiff drive at 60 rpm, drag 0.3 1/s, and a bit of 50 kg m^2 whose torque
falls from 6000 to 4000 N m: the limit cycle after 120 s from rest. The truth is that of an independent computation, by
characteristics on three meshes. The upwind scheme is that of the open literature, see peers/upwind_torsion.py. Times
are processor times of a whole computation, in C all three, on one thread: medians of 5.
"""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from harness import command, drawn, in_words, repeated, table, write
from peers import upwind_torsion

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.protocol import SERIES
from cosserat_fenicsx.drilling.torsion import TorsionWaves
from cosserat_fenicsx.pictures.charts import SMALL, empty_figure, legend, room_for

#: Mean of the last four periods (s), largest speed of the bit after 60 s (rad/s); and how far these may be wrong, as
#: relative errors: the differences of meshes, and of the levels at which a period is measured.
TRUTH = {"period": 6.042747520, "peak": 15.079233719}
KNOWN = {"period": 1e-5, "peak": 2.4e-6}
DURATION, FROM, SAMPLES = 120.0, 60.0, 5
#: Of a control in Python, s.
SAMPLE = 0.02
WAVES, ELEMENTS, UPWIND = "waves (characteristics)", "elements (P1, implicit)", "upwind, first order"
#: Cells; steps are those that the models choose for them.
CASES = {WAVES: (32, 64, 160, 320, 640), ELEMENTS: (64, 128, 256, 512), UPWIND: (250, 500, 1000, 2000)}
QUICK = {WAVES: (64, 160), ELEMENTS: (128,), UPWIND: (250, 500)}


def scene():
    """The string."""
    material = cf.Material(E=206e9, nu=206e9 / 2 / 79.3e9 - 1, density=7850.0)
    parts = [
        cf.well.Component(length, cf.Tube(outer, inner).stiffness(material), weight=1.0, contact_radius=outer / 2)
        for length, outer, inner in ((3000.0, 0.127, 0.10861), (200.0, 0.1651, 0.05715))
    ]
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(6000.0, 4000.0, 3.0), inertia=50.0)
    return cf.drilling.Drilling(
        cf.well.DrillString(parts, order="top down"),
        cf.drilling.TopDrive(60 * cf.units.rpm),
        bit,
        drag=cf.drilling.ViscousDrag(0.3),
    )


@dataclass(frozen=True)
class Sampled(cf.drilling.SampledControl):
    """A proportional and integral control in Python."""

    sample: float = SAMPLE

    def begin(self):
        return (0.0,)

    def torque(self, state, now):
        error = now.asked - now.speed
        state = state + error * self.sample
        return 1200.0 * error + 800.0 * state[0], state


def with_control(samples):
    """Median processor time (s) of the string with a control in Python, through the public face."""
    drilling = replace(scene(), drive=cf.drilling.TopDrive(60 * cf.units.rpm, 2900.0, Sampled()))
    return repeated(lambda: cf.drilling.simulate(drilling, DURATION, progress=False), samples)[1]


def solved(drilling, method, cells):
    """Times and speeds of the bit, (n,) each, s and rad/s."""
    if method == UPWIND:
        return upwind_torsion.run(drilling, cells, DURATION)[:2]
    if method == WAVES:
        model = TorsionWaves(drilling, elements=cells)
    else:
        model = AxialTorsional(drilling, None, cells, axial=False)
    rows = model.advance(int(np.ceil(DURATION / model.dt)))
    return rows[:, 0], rows[:, 1 + SERIES.index("bit_speed")]


def errors(times, speed):
    """Relative errors of the limit cycle; a period is from one start to the next, at half the speed of the drive."""
    level = 30 * cf.units.rpm
    k = np.flatnonzero((speed[:-1] < level) & (speed[1:] >= level))
    starts = times[k] + (level - speed[k]) / (speed[k + 1] - speed[k]) * (times[k + 1] - times[k])
    found = {"period": np.diff(starts)[-4:].mean(), "peak": speed[times > FROM].max()}
    return {name: abs(found[name] / truth - 1) for name, truth in TRUTH.items()}


def measure(cases, samples):
    """[(method, cells, errors, s)]."""
    drilling, rows = scene(), []
    for method, counts in cases.items():
        solved(drilling, method, counts[0])  # what is compiled at first use
        for cells in counts:
            found, seconds = repeated(partial(solved, drilling, method, cells), samples)
            rows.append((method, cells, errors(*found), seconds))
    return rows


def lines(rows, controlled):
    """Markdown: errors and times."""
    heads = "method | cells | error of the period | error of the bit's largest speed | processor time (ms)"
    told = [
        (method, cells, f"{off['period']:.1e}", f"{off['peak']:.1e}", f"{1e3 * seconds:.1f}")
        for method, cells, off, seconds in rows
    ]
    return [
        *table(heads, told),
        "",
        f"{in_words()}. The truth is known to {KNOWN['period']:.0e} (period) and "
        f"{KNOWN['peak']:.1e} (speed); smaller errors are chance. "
        f"{DURATION:g} s of this string under a control in Python, called every {1e3 * SAMPLE:g} ms, take "
        f"{controlled:.2f} s of one processor.",
    ]


def chart(rows):
    """Errors over time, one panel for the period and one for the largest speed."""
    beside = room_for(12) > 7
    figure = empty_figure(12, 5.2 if beside else 8.5)
    panels = figure.subplots(*((1, 2) if beside else (2, 1)))
    colours = dict(zip(CASES, ("#08519c", "#31a354", "#d95f02"), strict=True))
    titles = {"period": "period of stick-slip", "peak": "largest speed of the bit"}
    for panel, (name, title) in zip(panels, titles.items(), strict=True):
        panel.axhspan(KNOWN[name] / 100, KNOWN[name], color="0.9", zorder=0)
        style = {"transform": panel.get_yaxis_transform(), "fontsize": SMALL, "color": "0.4", "ha": "right"}
        panel.text(0.99, KNOWN[name] * 0.9, "not known better ", va="top", **style)
        for method, colour in colours.items():
            here = [(cells, off[name], seconds) for by, cells, off, seconds in rows if by == method]
            cells, off, seconds = zip(*here, strict=True)
            shown = np.maximum(off, KNOWN[name] / 5)
            panel.loglog(1e3 * np.array(seconds), shown, "o-", color=colour, label=method)
            for x, y, n in zip(seconds, shown, cells, strict=True):
                style = {"textcoords": "offset points", "fontsize": SMALL, "color": colour}
                panel.annotate(f"{n}", (1e3 * x, y), xytext=(4, 4), **style)
        panel.set(xlabel="processor time of 120 s of motion (ms), one thread", ylim=(KNOWN[name] / 8, 5e-3))
        panel.set_ylabel(f"relative error, {title}")
        panel.margins(x=0.12)
    legend(figure.axes[0])
    figure.suptitle("Stick-slip of 3200 m at 60 rpm: speed against accuracy (numbers of cells at the points)")
    return figure


def main(out="out", quick=False):
    """Measure, write table and chart; returns the rows."""
    rows = measure(QUICK if quick else CASES, 1 if quick else SAMPLES)
    stem = "work_precision_string_quick" if quick else "work_precision_string"
    print(write(stem, lines(rows, with_control(1 if quick else SAMPLES)), out))
    drawn(lambda: chart(rows), Path(out) / f"{stem}.png")
    return rows


if __name__ == "__main__":
    command(__doc__, main, {"quick": True})
