"""The charts of speed against accuracy, one per problem, and one of waiting times."""

import statistics
from functools import partial
from pathlib import Path

import numpy as np
from harness import drawn
from peers.environments import OWN
from peers.problems import TITLES
from work_precision_table import answered, median

from cosserat_fenicsx.pictures.charts import SMALL, empty_figure, legend

#: (problem, file, subtitle, whether only the spatial model of this package is shown).
_VIEWS = (
    ("sweep", "sweep", "every model that the plane problem allows", False),
    ("sweep", "sweep_spatial", "forced into space; peers that stay in the plane are shown too", True),
    ("single", "single", "every model that the plane problem allows", False),
    ("bend", "bend", "a problem in space", False),
    ("roll-up 1", "roll_up_1", "every model that the plane problem allows", False),
    ("roll-up 2", "roll_up_2", "every model that the plane problem allows", False),
    ("roll-up 4", "roll_up_4", "every model that the plane problem allows", False),
)  # fmt: skip
_OURS = {"determinate": "#08519c", "planar": "#3182bd", "spatial": "#31a354", "auto": "black"}
_THEIRS = {"Exudyn": "#d95f02", "OpenSeesPy": "#b2182b", "PyElastica": "#7570b3", "CalculiX": "#8c6d31"}
_MARKS = "osD^vP"
_ROUND_OFF = 1e-14  # smaller errors are shown at this value
_BETTER = 0.9
_ELEMENTS = {"elastic": "elasticBeamColumn", "CBDI": "forceBeamColumnCBDI", "EP": "Euler parameters"}


def draw(found, rows, out, stem):
    """Draw all charts that have points; returns the names of the files."""
    names = []
    for problem, file, subtitle, spatial in _VIEWS:
        here = [r for r in answered(rows, problem) if not (r["peer"] == OWN and spatial and not r["spatial"])]
        if here:
            names.append(f"{stem}_{file}.png")
            silent = sorted({r["peer"] for r in rows if r["problem"] == problem} - {r["peer"] for r in here})
            absent = f"; no answer from {', '.join(silent)}" if silent else ""
            title = f"{TITLES[problem]}\n{subtitle}{absent}"
            drawn(partial(_chart, here, title, problem), Path(out) / names[-1])
    if any(row["wall"] for row in found.waits):
        names.append(f"{stem}_waiting.png")
        drawn(lambda: _bars(found.waits), Path(out) / names[-1])
    return names


def frontier(rows):
    """Rows that none beats in both error and time, the most accurate first; errors slightly smaller do not count."""
    best = []
    for row in sorted(rows, key=lambda row: (median(row), row["error"])):
        if not best or max(row["error"], _ROUND_OFF) < _BETTER * best[-1]["error"]:
            best.append(row)
    return best[::-1]


def _groups(rows):
    """{label: (colour, marker, line style, rows)}, this package first, with one line per model for all formulations."""
    groups = {}
    for row in rows:
        ours = row["peer"] == OWN
        model = row["configuration"].get("model")
        label = (
            f"cosserat_fenicsx, {'auto (its own choice)' if model == 'auto' else model}"
            if ours
            else f"{row['peer']}: {_in_full(row['kind'])}"
        )
        groups.setdefault((not ours, label), []).append(row)
    counted, found = {}, {}
    for (theirs, label), members in sorted(groups.items()):
        peer = members[0]["peer"]
        number = counted[peer] = counted.get(peer, -1) + 1
        colour = _THEIRS[peer] if theirs else _OURS[members[0]["configuration"]["model"]]
        style = "--" if theirs and members[0]["spatial"] else "-"
        found[label] = colour, _MARKS[number % len(_MARKS)] if theirs else "o", style, members
    return found


def _in_full(element):
    """The name of an element in its solver."""
    return " ".join(_ELEMENTS.get(word, word) for word in element.split())


def points(rows):
    """Errors and times of rows, for a chart."""
    return [max(row["error"], _ROUND_OFF) for row in rows], [median(row) for row in rows]


def plot(axes, members, label, width, **style):
    """Small dots for all rows, and a line through the best of them, which is returned."""
    axes.plot(*points(members), style["marker"], color=style["color"], ms=3, alpha=0.25, mew=0)
    (line,) = axes.plot(*points(frontier(members)), lw=width, ms=5, label=label, **style)
    return line


def in_time(axes):
    """Logarithmic axes, with times in words."""
    axes.set(xscale="log", yscale="log")
    axes.yaxis.set_major_formatter(lambda seconds, _: f"{seconds:g} s" if seconds >= 1 else f"{1e3 * seconds:g} ms")
    axes.grid(which="major", alpha=0.4)


def _chart(rows, title, problem):
    figure = empty_figure(9.5, 6.5)
    axes = figure.subplots()
    for label, (colour, marker, style, members) in _groups(rows).items():
        ours = label.startswith("cosserat")
        plot(axes, members, label, 2.6 if ours else 1.3, color=colour, marker=marker, ls=style)
    in_time(axes)
    errors, times = points(rows)
    axes.set(xlim=(0.4 * min(errors), 2.0), ylim=(0.3 * min(times), 2 * max(times)))  # with space for the text below
    measured = (
        r"of the tip displacement $\delta$"
        if problem in ("sweep", "single")
        else "of the tip's position, over its displacement"
    )
    most = ", largest over the load factors" if problem == "sweep" or problem.startswith("roll-up") else ""
    note = "small dots: every mesh, degree and formulation measured; lines: the best of each; dashed: peers in space"
    axes.set_xlabel(f"relative error {measured}{most} (-)\n{note}")
    axes.set_ylabel("processor time of one warm answer, one thread")
    figure.suptitle(title)
    axes.annotate("better: faster,\nmore accurate", (0.015, 0.02), (0.09, 0.10), xycoords="axes fraction",
                  textcoords="axes fraction", arrowprops={"arrowstyle": "->"})  # fmt: skip
    legend(axes)
    return figure


def _bars(waits):
    shown = [row for row in waits if row["wall"]]
    figure = empty_figure(9.5, 0.75 * len(shown) + 1.8)
    axes = figure.subplots()
    for i, row in enumerate(shown):
        seconds = statistics.median(row["wall"])
        axes.barh(i, seconds, color=_THEIRS.get(row["who"], "#3182bd"), alpha=0.9 if row["caches"] == "warm" else 0.45)
        worked = statistics.median(row["processor"])
        axes.text(seconds, i, f"  {seconds:.2f} s\n  (processor {worked:.2f} s)", va="center", fontsize=SMALL)
    names = [f"{row['who']}, {row['caches']}\n{row['what']}" for row in shown]
    axes.set_yticks(np.arange(len(shown)), names, fontsize=SMALL)
    axes.invert_yaxis()
    axes.margins(x=0.25)
    axes.set_xlabel("wall clock from the start of the process to its end (s), median")
    axes.set_title("What a person waits for an answer: eccentric cantilever, whole processes")
    axes.grid(axis="y", visible=False)
    return figure
