"""The Markdown table of speed against accuracy: times at given accuracies, and the required ratios."""

import statistics

from harness import HEADS, in_words, judged, share, table
from peers.environments import OWN
from peers.problems import TITLES

ACCURACIES = (1e-3, 1e-5, 1e-7)
WAITS = {("cosserat run", "warm"): 1.0, ("cosserat run", "cold"): 8.0}  # s of wall clock, asked at most
CLOSE = 1.25  # times the smallest time: a row may turn out to be the fastest


def spatial(row):
    return row["spatial"]


def automatic(row):
    """Of `model="auto"` by `tol`, its error estimate included."""
    return row["configuration"].get("model") == "auto"


def planar_exudyn(row):
    return row["peer"] == "Exudyn" and not row["spatial"]


#: (requirement, which rows of this package, which rows of the peers, {accuracy: largest ratio of times}).
ASKED = (
    ("planar sweep against the fastest peer", bool, bool, {1e-3: 1 / 2, 1e-5: 1 / 5, 1e-7: 1 / 12}),
    ("sweep forced to spatial against the fastest spatial peer", spatial, spatial,
     {1e-3: 1 / 25, 1e-5: 1 / 40, 1e-7: 1 / 40}),
    ("sweep forced to spatial against the fastest planar peer", spatial, lambda row: not row["spatial"],
     {1e-3: 1.0, 1e-5: 1.0, 1e-7: 1.0}),
    ('`model="auto"` by `tol`, error estimate included, against Exudyn\'s fastest planar element', automatic,
     planar_exudyn, {1e-3: 1.0, 1e-5: 1 / 2, 1e-7: 1 / 3}),
)  # fmt: skip


def median(row):
    """Median of a row's samples, s."""
    return statistics.median(row["seconds"])


def answered(rows, problem):
    """Rows of a problem that have an answer."""
    return [row for row in rows if row["problem"] == problem and row["seconds"] and row["error"] is not None]


def cheapest(rows, accuracy):
    """The fastest row with at least this accuracy, or None."""
    good = [row for row in rows if row["error"] <= accuracy]
    return min(good, key=median, default=None)


def at_accuracies(rows, accuracies):
    """Cells of a table: the times of the cheapest rows at some accuracies, and the best error."""
    found = [cheapest(rows, accuracy) for accuracy in accuracies]
    return [*(milliseconds(median(row)) if row else "-" for row in found), f"{min(row['error'] for row in rows):.0e}"]


def called(row):
    """A configuration as text."""
    c = row["configuration"]
    mesh = (
        f"P{c['degree']}, {c['elements']} elements"
        if "degree" in c
        else f"{c['elements']} elements"
        if "elements" in c
        else f"tol {c['tol']:.0e}"
    )
    more = f", {c['substeps']} steps" if c.get("substeps", 1) > 1 else ""
    name = row["kind"].removesuffix(", by tol") if row["peer"] == OWN else f"{row['peer']} {row['kind']}"
    return f"{name}, {mesh}{more}"


def milliseconds(seconds):
    return f"{1e3 * seconds:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"


def _sides(rows):
    """(requirement, accuracy, this package's rows and the peers' rows with that accuracy, required ratio), of each."""
    sweep = answered(rows, "sweep")
    for words, ours, theirs, asked in ASKED:
        for accuracy, largest in asked.items():
            good = [row for row in sweep if row["error"] <= accuracy]
            here = [row for row in good if row["peer"] == OWN and ours(row)]
            peers = [row for row in good if row["peer"] != OWN and theirs(row)]
            yield words, accuracy, here, peers, largest


def ratios(rows):
    """[(requirement, accuracy, this package's row, peer's row, ratio or None, required ratio)]."""
    found = []
    for words, accuracy, here, peers, largest in _sides(rows):
        mine, peer = (min(side, key=median, default=None) for side in (here, peers))
        ratio = median(mine) / median(peer) if mine and peer else None
        found.append((words, accuracy, mine, peer, ratio, largest))
    return found


def deciding(rows):
    """The rows on which a ratio depends, or may depend once they are measured better."""
    found = {}
    for _, _, here, peers, _ in _sides(rows):
        for side in filter(None, (here, peers)):
            least = min(map(median, side))
            found.update((id(row), row) for row in side if median(row) <= CLOSE * least)
    return list(found.values())


def text(found, rows):
    """The whole table, in Markdown."""
    return "\n".join(
        [*_head(found), "", *_ratios(rows), "", *_by_tol(rows), *_times(rows), "", *_stopped(rows), *_waits(found)]
    ).rstrip()


def _head(found):
    told = ", ".join(
        f"{peer} {found.versions[peer].get(peer.lower(), '')}".strip() for peer in found.versions if peer != OWN
    )
    about = found.about
    lines = [
        f"{in_words(about['machine'])}. Peers: {told or 'none'}. Random seed of the order {about['seed']}.",
        "",
        f"Processor time of one thread, warm, medians of {about['samples']} samples (of {about['deciding']} where a "
        "ratio depends on them, of fewer for some of what takes over 0.5 s), peers in alternation. Timed are, here, "
        "the whole call of `solve` and the tip's position, with the stability count (the scene was solved before); of "
        "Exudyn `SolveStatic`, of OpenSeesPy the analysis (the models of both are built before and not counted); of "
        "PyElastica the whole relaxation; of CalculiX the whole program. Time at an accuracy: that of the cheapest "
        "configuration measured whose error, against the truth of its own mechanical model, is below it (with `tol`, "
        "too, the true one, not the estimate). The error is the largest of delta over the load factors, on the "
        "eccentric cantilever, and of the position of the tip, over its displacement, elsewhere.",
    ]
    missing = [f"- {peer} is missing: {why}" for peer, why in found.missing.items()]
    return [*lines, *(["", *missing] if missing else [])]


def _ratios(rows):
    cells = []
    for words, accuracy, mine, peer, ratio, largest in ratios(rows):
        both = [f"{milliseconds(median(r))} ({called(r)})" if r else "none is so accurate" for r in (mine, peer)]
        cells.append((words, f"{accuracy:.0e}", *both, judged(ratio, largest)))
    return table(f"asked | error | here | fastest peer | ratio | {HEADS}", cells)


def _by_tol(rows):
    """What a tolerance gives and takes on the sweep, beside Exudyn's planar elements that are as accurate."""
    sweep = answered(rows, "sweep")
    mine = sorted((row for row in sweep if automatic(row)), key=lambda row: -row["configuration"]["tol"])
    theirs = [row for row in sweep if planar_exudyn(row)]
    if not mine:
        return []
    cells = []
    for row in mine:
        peer = cheapest(theirs, row["error"])
        both = (milliseconds(median(peer)), share(median(row) / median(peer))) if peer else ("none is so accurate", "-")
        cells.append((f"{row['configuration']['tol']:.0e}", f"{row['error']:.0e}", milliseconds(median(row)), *both))
    return [*table('`model="auto"`, tol | true error | here | Exudyn, planar, as accurate | ratio', cells), ""]


def _times(rows):
    cells = []
    for problem, title in TITLES.items():
        here = answered(rows, problem)
        for peer, name in sorted({(row["peer"], row["kind"]) for row in here}, key=lambda pair: (pair[0] != OWN, pair)):
            mine = [row for row in here if (row["peer"], row["kind"]) == (peer, name)]
            cells.append((title, f"{peer}: {name}", *at_accuracies(mine, ACCURACIES)))
    return table(f"problem | solver | {' | '.join(f'{x:.0e}' for x in ACCURACIES)} | best error", cells)


def _stopped(rows):
    """Solvers without any answer to a problem, with one of the reasons."""
    lines = []
    for problem, title in TITLES.items():
        for peer, name in sorted({(r["peer"], r["kind"]) for r in rows if r["problem"] == problem}):
            mine = [r for r in rows if (r["problem"], r["peer"], r["kind"]) == (problem, peer, name)]
            failed = [r for r in mine if r["failed"]]
            if failed:
                lines.append(f"- {title}: {peer}, {name}: no answer from {len(failed)} of {len(mine)} configurations "
                             f"(\"{failed[-1]['failed'][:100]}\").")  # fmt: skip
    return ["Without an answer:", "", *lines, ""] if lines else []


def _waits(found):
    if not found.waits:
        return []
    cells = []
    for row in found.waits:
        start = row["who"], row["caches"], row["what"]
        if not row["wall"]:
            cells.append((*start, row["failed"], "-", "-", "-"))
            continue
        worked, waited = (statistics.median(row[key]) for key in ("processor", "wall"))
        most = WAITS.get((row["who"], row["caches"]))
        told = judged(waited, most, ".2f") if most else f"{waited:.2f} | - | -"
        cells.append((*start, f"{worked:.2f}", told))
    heads = "what a person waits for | caches | what is computed | processor time (s) | wall clock (s)"
    return table(f"{heads} | {HEADS}", cells)
