"""The Markdown table of speed against accuracy: times at given accuracies, and the required ratios."""

import statistics

from machine import in_words
from peers.environments import OWN
from peers.problems import TITLES

ACCURACIES = (1e-3, 1e-5, 1e-7)
#: (requirement, rows of this package, rows of the peers, {accuracy: largest ratio of times}).
ASKED = (
    ("planar sweep against the fastest peer", "any", "any", {1e-3: 1 / 2, 1e-5: 1 / 3, 1e-7: 1 / 5}),
    ("sweep forced to spatial against the fastest spatial peer", "spatial", "spatial",
     {1e-3: 1 / 5, 1e-5: 1 / 40, 1e-7: 1 / 40}),
    ("sweep forced to spatial against the fastest planar peer", "spatial", "planar", {1e-5: 1.0, 1e-7: 1.0}),
)  # fmt: skip


def median(row):
    """Median of a row's samples, s."""
    return statistics.median(row["seconds"])


def answered(rows, problem):
    """Rows of a problem that have an answer."""
    return [row for row in rows if row["problem"] == problem and row["seconds"] and row["error"] is not None]


def own(rows, spatial=None):
    return [row for row in rows if row["peer"] == OWN and spatial in (None, row["spatial"])]


def others(rows, spatial=None):
    return [row for row in rows if row["peer"] != OWN and spatial in (None, row["spatial"])]


def cheapest(rows, accuracy):
    """The fastest row with at least this accuracy, or None."""
    good = [row for row in rows if row["error"] <= accuracy]
    return min(good, key=median, default=None)


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
    name = "" if row["peer"] == OWN else f"{row['peer']} "
    return f"{name}{row['kind']}, {mesh}{more}"


def milliseconds(seconds):
    return f"{1e3 * seconds:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"


def ratios(rows):
    """[(requirement, accuracy, this package's row, peer's row, ratio or None, required ratio)]."""
    sweep, found = answered(rows, "sweep"), []
    spatial = {"any": None, "spatial": True, "planar": False}
    for words, ours, theirs, asked in ASKED:
        for accuracy, largest in asked.items():
            mine = cheapest(own(sweep, spatial[ours]), accuracy)
            peer = cheapest(others(sweep, spatial[theirs]), accuracy)
            ratio = median(mine) / median(peer) if mine and peer else None
            found.append((words, accuracy, mine, peer, ratio, largest))
    return found


def text(found, rows):
    """The whole table, in Markdown."""
    return "\n".join(
        [*_head(found), "", *_ratios(rows), "", *_times(rows), "", *_stopped(rows), *_waits(found)]
    ).rstrip()


def _head(found):
    told = ", ".join(
        f"{peer} {found.versions[peer].get(peer.lower(), '')}".strip() for peer in found.versions if peer != OWN
    )
    lines = [
        f"{in_words(found.about['machine'])}. Peers: {told or 'none'}. Random seed of the order {found.about['seed']}.",
        "",
        (
            f"Processor time of one thread, warm, medians of {found.about['samples']} samples (some of what takes over"
            " 0.5 s of fewer), peers in alternation. What is timed: here the"
        ),
        (
            "whole call of `solve` and the tip's position, with the stability count (a scene that was solved before is"
            " at hand); for Exudyn `SolveStatic`, for OpenSeesPy the"
        ),
        (
            "analysis (the model of both is built before and not counted); for PyElastica the whole relaxation; for"
            " CalculiX the whole program. Time at an accuracy: the cheapest configuration measured whose error,"
        ),
        (
            "against the truth of its own mechanical model, is below it. The error is that of delta, largest over the"
            " load factors, on the eccentric"
        ),
        "cantilever, and of the position of the tip, over its displacement, elsewhere.",
    ]
    missing = [f"- {peer} is missing: {why}" for peer, why in found.missing.items()]
    return [*lines, *(["", *missing] if missing else [])]


def _ratios(rows):
    lines = ["| asked | error | here | fastest peer | ratio | asked at most | |", "|---|---|---|---|---|---|---|"]
    for words, accuracy, mine, peer, ratio, largest in ratios(rows):
        cells = [f"{milliseconds(median(r))} ({called(r)})" if r else "none is so accurate" for r in (mine, peer)]
        verdict = "-" if ratio is None else "met" if ratio <= largest else "missed"
        told = "-" if ratio is None else f"1/{1 / ratio:.3g}" if ratio <= 1 else f"{ratio:.3g} (slower)"
        lines.append(f"| {words} | {accuracy:.0e} | {' | '.join(cells)} | {told} | 1/{1 / largest:.3g} | {verdict} |")
    return lines


def _times(rows):
    lines = [
        "| problem | solver | " + " | ".join(f"{accuracy:.0e}" for accuracy in ACCURACIES) + " | best error |",
        "|---|---|" + "---|" * (len(ACCURACIES) + 1),
    ]
    for problem, title in TITLES.items():
        here = answered(rows, problem)
        for peer, name in sorted({(row["peer"], row["kind"]) for row in here}, key=lambda pair: (pair[0] != OWN, pair)):
            mine = [row for row in here if (row["peer"], row["kind"]) == (peer, name)]
            found = [cheapest(mine, accuracy) for accuracy in ACCURACIES]
            cells = [milliseconds(median(row)) if row else "-" for row in found]
            best = min(row["error"] for row in mine)
            lines.append(f"| {title} | {peer}: {name} | {' | '.join(cells)} | {best:.0e} |")
    return lines


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
    lines = [
        "| what a person waits for | caches | processor time | wall clock | what is computed |",
        "|---|---|---|---|---|",
    ]
    for row in found.waits:
        told = (
            [f"{statistics.median(row[key]):.2f} s" for key in ("processor", "wall")]
            if row["wall"]
            else [row["failed"], "-"]
        )
        lines.append(f"| {row['who']} | {row['caches']} | {' | '.join(told)} | {row['what']} |")
    return lines
