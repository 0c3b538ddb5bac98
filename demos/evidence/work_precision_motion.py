"""Speed against accuracy in motion: the schemes of this package and Exudyn's geometrically exact rods, one chart.

    python demos/evidence/work_precision_motion.py            all, about seven minutes; continues an interrupted run
    python demos/evidence/work_precision_motion.py --fresh    discards existing samples
    python demos/evidence/work_precision_motion.py --quick    a few configurations; nothing is installed

Writes to out/: work_precision_motion.json (every sample), .md (the table), .png (the chart). For the measurement see
`work_precision`. The error is that of the final positions of the rods' ends, over the length of a rod
(peers/motions.py).
"""

from pathlib import Path

from harness import HEADS, command, drawn, in_words, judged, table
from matplotlib.ticker import LogLocator
from peers import motions
from peers.environments import OWN
from work_precision import SAMPLES, Panel, Record, concluded, run
from work_precision_chart import in_time, plot
from work_precision_table import answered, at_accuracies, cheapest, median, milliseconds

from cosserat_fenicsx.pictures.charts import SMALL, beside, legend

PANEL = Panel(
    motions.PEERS, motions.problems, motions.error, motions.configurations, motions.kind, motions.model, 1, False
)
ACCURACIES = (1e-2, 1e-3, 1e-4)
ASKED_AT = 1e-3  # the error at which times are compared
ASKED = {"spaghetti": 1 / 6, "right angle": 1 / 13}  # the largest ratio of times allowed
BUDGET = 330.0  # s of measurement; rounds that would begin later are left out
LIMIT, QUICK_LIMIT = 40.0, 5.0  # s, of a request: here it may compile a form; of all peers in a quick run
_COLOURS = {"momentum": "#08519c", "energy": "#31a354", "triple-jump": "#7570b3"}
_OTHERS = ("#1b9e77", "#e7298a", "#666666")  # for additional schemes
_THEIRS = {"LG": "#d95f02", "EP": "#b2182b"}


def called(row):
    """A configuration as text."""
    c = row["configuration"]
    step = f"steps of {1e3 * c['dt']:g} ms" if "dt" in c else f"tol {c['tol']:g}"
    if row["peer"] == OWN:
        return f"{c['scheme']}, P{c['degree']}, {c['elements']} elements a rod, {step}"
    return f"Exudyn {c['node']}, {c['elements']} elements a rod, {step}"


def ratio(rows, problem):
    """The cheapest rows of this package and of the peer with an error up to
    ASKED_AT, or None, and the ratio of their times, or None."""
    here = answered(rows, problem)
    mine, theirs = (cheapest([r for r in here if (r["peer"] == OWN) == own], ASKED_AT) for own in (True, False))
    return mine, theirs, median(mine) / median(theirs) if mine and theirs else None


def text(found, rows):
    """The table, in Markdown."""
    told = [row for problem in motions.TITLES for row in ratio(rows, problem)[:2] if row]
    least = min((len(row["seconds"]) for row in told), default=0)
    lines = [
        f"{in_words(found.about['machine'])}. Random seed of the order {found.about['seed']}.",
        "",
        f"Processor time of one thread, warm, medians of up to {found.about['samples']} samples (of {least} or more in "
        "the first table), peers in alternation. Timed are, here, the whole call of `simulate` in space and the query "
        "of the ends; of Exudyn `SolveDynamic`, its model built before. The error is the distance of the ends from "
        "their true places, over the length of a rod; mesh and step are the best measured of each.",
        *(f"\n{peer} is missing: {why}" for peer, why in found.missing.items()),
        "",
    ]
    asked, times = [], []
    for problem, title in motions.TITLES.items():
        mine, theirs, share = ratio(rows, problem)
        cells = [f"{milliseconds(median(r))} ({called(r)})" if r else "none is so accurate" for r in (mine, theirs)]
        asked.append((title, f"{ASKED_AT:.0e}", *cells, judged(share, ASKED[problem])))
        for name, members in _groups(answered(rows, problem)).items():
            times.append((title, name, *at_accuracies(members, ACCURACIES)))
    lines += [*table(f"problem | error | here | Exudyn | ratio | {HEADS}", asked), ""]
    lines += table(f"problem | solver | {' | '.join(f'{x:.0e}' for x in ACCURACIES)} | best error", times)
    failed = [row for row in rows if row["failed"]]
    if failed:
        lines += ["", f"Without an answer: {len(failed)} configurations, such as {called(failed[0])} "
                      f"({failed[0]['failed'][:80]})."]  # fmt: skip
    return "\n".join(lines)


def _groups(rows):
    """{name: rows} of every scheme and peer, this package first."""
    groups = {}
    for row in sorted(rows, key=lambda row: (row["peer"] != OWN, row["kind"])):
        groups.setdefault(f"{'cosserat_fenicsx' if row['peer'] == OWN else row['peer']}: {row['kind']}", []).append(row)
    return groups


def draw(rows):
    """The chart, one panel per problem."""
    figure, panels, _ = beside([5.0] * len(motions.TITLES), 6.2)
    for axes, (problem, title) in zip(panels, motions.TITLES.items(), strict=True):
        for name, members in _groups(answered(rows, problem)).items():
            ours, kind = members[0]["peer"] == OWN, members[0]["kind"]
            scheme = kind.removesuffix(", by tol") if ours else members[0]["configuration"]["node"]
            others = sorted({r["configuration"].get("scheme", "momentum") for r in rows} - _COLOURS.keys())
            colours = {**_COLOURS, **dict(zip(others, _OTHERS, strict=False)), **_THEIRS}
            style = {"marker": "o" if ours else "s", "ls": ":" if "tol" in kind else "-"}
            plot(axes, members, name, 2.2 if ours else 1.5, color=colours.get(scheme, "0.4"), **style)
        _, _, share = ratio(rows, problem)
        axes.axvline(ASKED_AT, color="0.5", lw=1, ls="--")
        if share:
            words = f"at {ASKED_AT:.0e}: 1/{1 / share:.3g} of Exudyn's time "
            axes.text(ASKED_AT, 0.985, words, va="top", ha="right", fontsize=SMALL,
                      transform=axes.get_xaxis_transform())  # fmt: skip
        in_time(axes)
        note = "small dots: every mesh and step measured; lines: the best of each"
        axes.set_xlabel(f"{title}: error of the ends' positions, over a rod's length (-)\n{note}")
    panels[0].set_ylabel("processor time of one warm answer, one thread")
    panels[0].yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    legend(*panels)
    return figure


def main(out="out", quick=False, fresh=False, peers=motions.PEERS, wanted=None):
    """Measure, write the JSON, the table and the chart. out: folder; quick: few configurations, nothing is installed;
    fresh: discard earlier samples; peers: which;; wanted: samples of every configuration, at least. Returns The
    `Record`."""
    out = Path(out)
    stem = "work_precision_motion_quick" if quick else "work_precision_motion"
    found = Record(out / f"{stem}.json", fresh or quick, PANEL)
    limits = {peer: QUICK_LIMIT if quick and peer != OWN else LIMIT for peer in peers}
    wanted = wanted or (1 if quick else SAMPLES)
    budgets = {name: BUDGET * k / len(motions.TITLES) for k, name in enumerate(motions.TITLES, 1)}  # a share for each
    rows = run(found, peers, budgets, quick=quick, wanted=wanted, limits=limits)
    concluded(found, rows, text)
    drawn(lambda: draw(rows), out / f"{stem}.png")
    print(f"\nwritten: {found.file}, {stem}.md, {stem}.png")
    return found


if __name__ == "__main__":
    command(__doc__, main, {"quick": True}, fresh=True)
