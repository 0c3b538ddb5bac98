"""The table as a picture: a colour, a mark and a number in every cell."""

from harness import in_words

from cosserat_fenicsx.pictures.charts import draw_chart, empty_figure
from trials import methods
from trials.cells import MISSING, NOT, RIGHT, SAID, SILENT, STOPPED, Cell
from trials.table import MARKS

#: From light to dark in the order of severity, so that a print without colours can be read.
_COLOURS = {
    RIGHT: "#d4efc5",
    SAID: "#fbe08c",
    STOPPED: "#9fc1e6",
    SILENT: "#a3122a",
    NOT: "#f6f6f6",
    MISSING: "#ffffff",
}
_WORDS = {
    RIGHT: "right",
    SAID: "wrong and said so",
    STOPPED: "stopped, and said so (number: load factor reached)",
    SILENT: "silently wrong",
    NOT: "does not apply",
    MISSING: "not installed",
}
_GROUPS = ("this package", "written for comparison", "other programs")


def draw(data, file):
    """Draw failures.json into `file`."""
    draw_chart(lambda: _figure(data), file)


def _figure(data):
    columns, rows = methods.shown(data)
    figure = empty_figure(2.9 + 0.84 * len(columns), 2.6 + 0.42 * len(rows))
    axes = figure.subplots()
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5))
    for j, trial in enumerate(rows):
        for i, method in enumerate(columns):
            plain = data["cells"].get(f"{trial.key}/{method.key}")
            if plain is not None:
                _cell(axes, i, j, Cell.of(plain))
    axes.set_xticks(range(len(columns)), [method.title for method in columns], fontsize=8.5)
    axes.set_yticks(range(len(rows)), [trial.title for trial in rows], fontsize=8.5)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.grid(visible=False)
    for side in axes.spines.values():
        side.set_visible(False)
    _groups(axes, columns)
    _legend(figure, data)
    figure.suptitle(
        "Where methods fail: what is tried (rows) with which method (columns), and what becomes of it", fontsize=13
    )
    return figure


def _cell(axes, i, j, cell):
    from matplotlib.patches import Rectangle

    hatch = "///" if cell.verdict == STOPPED else None
    style = {"facecolor": _COLOURS[cell.verdict], "edgecolor": "white", "lw": 1.5}
    axes.add_patch(Rectangle((i - 0.5, j - 0.5), 1, 1, **style))
    if hatch:
        axes.add_patch(Rectangle((i - 0.5, j - 0.5), 1, 1, fill=False, hatch=hatch, edgecolor="#c3d9f0", lw=0))
    if cell.verdict in (NOT, MISSING):
        words, colour = ("-" if cell.verdict == NOT else "not\ninstalled"), "#909090"
    else:
        words = f"{MARKS[cell.verdict]}  {cell.number}" if cell.value is not None else MARKS[cell.verdict]
        colour = "white" if cell.verdict == SILENT else "black"
    axes.text(i, j, words, ha="center", va="center", fontsize=8.5, color=colour, fontfamily="DejaVu Sans",
              fontweight="bold" if cell.verdict == SILENT else "normal")  # fmt: skip


def _groups(axes, columns):
    """Groups of columns, above their headings."""
    kinds = [0 if method.own else 2 if hasattr(method, "end") else 1 for method in columns]
    for kind, words in enumerate(_GROUPS):
        members = [i for i, each in enumerate(kinds) if each == kind]
        if not members:
            continue
        low, high = min(members) - 0.45, max(members) + 0.45
        axes.plot([low, high], [1.052, 1.052], transform=axes.get_xaxis_transform(), color="black", lw=1, clip_on=False)
        axes.text((low + high) / 2, 1.058, words, transform=axes.get_xaxis_transform(), ha="center", fontsize=10)
        if min(members):
            axes.axvline(min(members) - 0.5, color="black", lw=1)


def _legend(figure, data):
    from matplotlib.patches import Patch

    handles = []
    for verdict, words in _WORDS.items():
        mark = f"{MARKS[verdict]}  " if MARKS[verdict] else ""
        hatch = {"hatch": "///", "edgecolor": "#c3d9f0"} if verdict == STOPPED else {"edgecolor": "grey"}
        handles.append(Patch(facecolor=_COLOURS[verdict], label=f"{mark}{words}", **hatch))
    figure.legend(handles=handles, loc="outside lower center", ncols=6, frameon=False, fontsize=9, title=(
        "Numbers are relative errors, or errors over the length; in the rows of the limit point and the follower load, "
        "the load over the limit "
        "or flutter load; in that of\nthe line search, Newton iterations. What each row tries, and what right means "
        "there, is in failures.md. "
        + in_words(data["machine"]) + "."), title_fontsize=8.5)  # fmt: skip
