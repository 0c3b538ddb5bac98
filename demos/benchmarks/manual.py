"""The verification manual: published problems are solved one after another; their tables, and a section for each."""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
from problem import PROBLEMS

HERE = Path(__file__).parent
for folder in (HERE, HERE.parent, HERE.parent / "evidence"):
    if str(folder) not in sys.path:
        sys.path.append(str(folder))

from harness import in_words, table, timed  # noqa: E402

from cosserat_fenicsx import code_cache  # noqa: E402

#: The chapters in their order, by what problems call them.
CHAPTERS = {
    "statics": "Statics of rods",
    "stability": "Stability of rods",
    "motion": "Motion and vibration of rods",
    "wells": "Strings in wells",
    "drilling": "Drill-strings in motion",
}
HEADS = "problem: quantity | published | ours | our estimate | difference | allowed, and why | s"
#: Significant digits that are shown at least and at most.
_FEWEST, _MOST = 4, 14


def load():
    """{name: `Problem`} of all files of this folder, in the order of the chapters."""
    for file in sorted(HERE.glob("*.py")):
        name = file.stem
        if (HERE.parent / file.name).exists():  # the demos have a module of this name, which it must not replace
            name = f"published_{name}"
        if name not in sys.modules and file.stem != "__main__":
            spec = importlib.util.spec_from_file_location(name, file)
            sys.modules[name] = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(sys.modules[name])
    order = list(CHAPTERS)
    return dict(sorted(PROBLEMS.items(), key=lambda item: order.index(item[1].chapter)))


def solved(problem, picture=None, again=True):
    """Solve a problem, and draw it into a file.

    Returns:
        {"seconds": processor time of solving, "rows": a dict of `Row.__dict__`, "difference" and "agrees" each}, as
        plain data. Where forms were compiled it is solved again, unless `again` is False, and that time taken.
    """
    before = _compiled()
    (rows, draw), seconds = timed(problem.solve)
    if again and _compiled() != before:
        (rows, draw), seconds = timed(problem.solve)
    if picture:
        picture.parent.mkdir(parents=True, exist_ok=True)
        draw(picture)
    return {"seconds": seconds, "rows": [_plain(row) for row in rows]}


def _compiled():
    return set(Path(code_cache.folder()).glob("*.so"))


def _plain(row):
    kept = {name: np.asarray(x).tolist() for name, x in vars(row).items()}
    return kept | {"difference": row.difference, "agrees": row.agrees}


# -- the text ----------------------------------------------------------------------------------------------------------


def text(problems, results, machine):
    """Lines of Markdown: for every chapter its table and a section for each problem.

    Args:
        problems: of `load`. results: {name: of `solved`}, of some of them. machine: `harness.record`.
    """
    rows = [row for found in results.values() for row in found["rows"]]
    agree = sum(row["agrees"] for row in rows)
    yield (
        f"{len(results)} problems, {len(rows)} rows, of which {agree} are within what is allowed. In the column s is "
        f"the processor time of solving, in seconds, with the forms compiled before. {in_words(machine)}."
    )
    for chapter, title in CHAPTERS.items():
        here = {name: results[name] for name, x in problems.items() if x.chapter == chapter and name in results}
        if here:
            yield from ("", f"## {title}", "", *table(HEADS, cells(problems, here)))
        for name in here:
            x = problems[name]
            yield from ("", f"### {x.title}", "", f"![{x.title}](benchmarks/{name}.png)", "")
            yield from (
                f"- Source: {x.source}",
                f"- Input: {x.given}",
                *([f"- Remark: {x.remark}"] if x.remark else []),
            )


def cells(problems, results):
    """The rows of a table as lists of texts."""
    for name, found in results.items():
        for k, row in enumerate(found["rows"]):
            published, ours, estimate, allowed = (
                np.broadcast_to(row[key], np.shape(row["ours"])).ravel()
                for key in ("published", "ours", "estimate", "allowed")
            )
            worst = np.argmax(np.abs(ours - published) / allowed)
            yield (
                (f"**{problems[name].title}**: " if k == 0 else "") + row["quantity"].replace("|", "/"),
                ", ".join(f"{x:.12g}" for x in published),
                ", ".join(map(_shown, ours, np.maximum(estimate, allowed / 100))),
                f"{estimate.max():.1g}",
                f"{row['difference']:.1e}" + ("" if row["agrees"] else ", **disagrees**"),
                f"{allowed[worst]:.2g}: {row['because']}".replace("|", "/"),
                f"{found['seconds']:.2g}" if k == 0 else '"',
            )


def _shown(x, sure):
    """A number with the digits that are sure."""
    if abs(x) < sure / 10:
        return "0"
    if sure <= 0:
        return f"{x:.{_MOST}g}"
    return f"{x:#.{min(max(math.ceil(math.log10(abs(x) / sure)), _FEWEST), _MOST)}g}".rstrip(".")
