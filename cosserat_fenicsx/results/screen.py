"""Tables for the screen, pages of sentences with one table; in notebooks a small table and a picture, as HTML."""

import copy
import dataclasses
import html
import sys
import textwrap

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.quantities import as_text as value_text

#: Most rows of a table in `details` and in `print`; lines of a printed page, and characters of a line.
ROWS, SHORT, LINES, WIDTH = 40, 12, 30, 100
# Lines of a table besides its rows; fewest rows.
_FRAME, _FEWEST = 6, 4
# Most significant digits in the short table.
_DIGITS = 5
# Numbers below this times the largest of their column are rounding.
_ROUNDING = 1e-9
# Longest texts that are never cut in a cell; characters between two columns, and at the edge of the table.
_TEXT, _BETWEEN, _EDGE = 40, 3, 1


def rows_of(count, most):
    """Indices of at most `most` of `count` rows, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int)) if count else np.arange(0)


def table(given, units, rows, title=None, caption=None, which=None, gaps=True):
    """A table of quantities.

    Args:
        given: pairs of a `Quantity` and its values (n,) or (n, components).
        units: the `Units`. rows: the most of them; those in between are left out.
        which: indices of rows instead; gaps: with dots for those between.
    """
    count, gaps = len(given[0][1]), gaps and which is not None
    which = rows_of(count, rows) if which is None else which
    found = Table(title=title, caption=caption)
    texts = []
    for quantity, values in given:
        values = np.asarray(values)
        numbers = values.dtype.kind in "fiu"
        unit, size = units.on_screen(quantity, values[which] if numbers else ())
        digits = quantity.digits if rows > SHORT else min(quantity.digits, _DIGITS)
        if values.dtype.kind == "f":  # in the short table, numbers with a unit end where those of their column do
            small = 10.0**-digits if rows <= SHORT and unit not in ("", "1") else _ROUNDING
            least = max(quantity.noise, small * float(np.nanmax(np.abs(values), initial=0.0)))
            values = np.where(np.abs(values) <= least, 0.0, values) / size
        parts = values.reshape(count, -1).T
        for part, column in zip(quantity.parts or [""], parts, strict=True):
            label = dataclasses.replace(quantity, label=f"{quantity.short or f'{quantity.label} '}{part}".strip())
            heading, cells = label.heading(unit), [value_text(column[k], digits) for k in which]
            found.add_column(heading, justify="right" if numbers else "left", no_wrap=True)
            texts.append(cells)
    for i, row in enumerate(zip(*texts, strict=True)):
        if gaps and which[i] > (which[i - 1] + 1 if i else 0):
            found.add_row(*["..."] * len(row))
        found.add_row(*row)
    return found


def _wrapped(heading, width):
    return textwrap.wrap(heading, width, break_long_words=False, break_on_hyphens=False)


def _least(column):
    """The least width of a column: of its longest cell, and of the longest word of its heading."""
    longest = max(map(len, column.cells), default=0)
    return max(longest if column.justify == "right" else min(longest, _TEXT), *map(len, column.header.split()), 1)


def _widths(columns, width):
    """Widths of columns that fit a width, headings broken between words in few lines; None where there are none."""
    room = width - _EDGE - _BETWEEN * len(columns)
    for lines in range(1, max(len(column.header.split()) for column in columns) + 1):
        found = []
        for column in columns:
            least = _least(column)
            enough = range(least, max(least, len(column.header)) + 1)
            found.append(next(w for w in enough if len(_wrapped(column.header, w)) <= lines or w == enough[-1]))
        if sum(found) <= room:
            for i, column in enumerate(columns):  # texts may use what is left
                longest = max(map(len, column.cells), default=0)
                found[i] += max(0, min(longest - found[i], room - sum(found)))
            return found
    return None


def _parts(table, width):
    """Tables of some of the columns each, which fit a width; all of them begin with the first column."""
    first, *rest = table.columns
    while rest:
        count = next((k for k in range(len(rest), 1, -1) if _widths([first, *rest[:k]], width)), 1)
        part, columns = copy.copy(table), [first, *rest[:count]]
        widths = _widths(columns, width) or [_least(column) for column in columns]
        part.columns = [
            dataclasses.replace(column, header="\n".join(_wrapped(column.header, w)), width=w)
            for column, w in zip(columns, widths, strict=True)
        ]
        yield part
        table, rest = copy.copy(table), rest[count:]
        table.title = None


def as_text(table, width=140, most=None):
    """A rich table from `table` as plain text, as wide as it needs up to `width`, with names and titles as they are.

    Columns that do not fit follow in further tables below; or, of more than `most` tables, are left out, which is said.
    Its lines are ASCII where standard output does not know others.
    """
    try:
        "━┏┃".encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        table.box = box.ASCII2
    parts = list(_parts(table, width)) or [table]
    shown = parts[:most]
    for part in shown[:-1]:
        part.caption = None
    if len(parts) > len(shown):
        count = 1 + sum(len(part.columns) - 1 for part in shown)
        told = f"{count} of {len(table.columns)} columns: details() has more"
        shown[-1].caption = f"{table.caption}\n{told}" if table.caption else told
    # a fixed width, since the size of the terminal is unknown under mpirun
    # and both sizes given, since rich takes 80 columns where TERM is dumb
    console = Console(width=width, height=LINES, color_system=None, markup=False, emoji=False)
    with console.capture() as capture:
        for part in shown:
            console.print(part)
    return capture.get().rstrip()


def page(answer, table_of=None):
    """Sentences and a table that fit a screen. answer: sentences; those that do not fit are left out, from the end.
    table_of: a function of the number of rows that returns a rich table, or None where there is nothing to show; None
    without a table."""
    lines = [line for told in answer for line in textwrap.wrap(told, WIDTH, break_on_hyphens=False)]
    room = LINES - (0 if table_of is None else _FRAME + _FEWEST)
    if len(lines) > room:
        lines = [*lines[: room - 1], "... more by `details()`"]
    rows = 0 if table_of is None else SHORT
    while rows >= 1 and (shown := table_of(rows)) is not None:
        text = as_text(shown, WIDTH, 1).splitlines()
        beyond = len(lines) + len(text) - LINES
        if beyond <= 0:
            return "\n".join([*lines, *text])
        rows -= beyond
    return "\n".join(lines)


class InWords:
    """Base of scenes and parts of scenes that are printed as sentences; subclasses define `sentences`."""

    def __str__(self) -> str:
        return self.summary()

    def summary(self, units="SI") -> str:
        """The text that `print` shows, in some units (see `Result`): sentences, at most 30 lines of 100 characters.

        Raises:
            SceneError: unknown units.
        """
        return page(self.sentences(Units(units)))

    def details(self, units="SI") -> str:
        """All sentences of `summary`, a line each."""
        return "\n".join(self.sentences(Units(units)))


# Rows of the table, states and points of the picture, and its size in pixels.
_ROWS, _STATES, _POINTS, _SIZE, _MARGIN = 8, 4, 240, 200, 6


def as_html(result):
    """HTML of about 3 kB: what the result is, a table of some rows and, of rods, a picture."""
    title = getattr(getattr(result, "scene", None), "title", "")
    whole = f"<b>{html.escape(title)}</b><br/>" if title else ""
    whole += f"<code>{html.escape(repr(result))}</code>"
    if len(result) == 0:
        return f"<div>{whole}</div>"
    picture = f"<div>{_picture(result)}</div>" if hasattr(result, "sample") else ""
    return (
        f'<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start"><div>{whole}{_table(result)}</div>'
        f"{picture}</div>"
    )


def _table(result):
    columns = result._table(Units(), _ROWS).columns
    rows = [("th", [column.header for column in columns])]
    rows += [("td", row) for row in zip(*(column.cells for column in columns), strict=True)]
    lines = ("".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in row) for tag, row in rows)
    left_out = f"{len(rows) - 1} of {len(result)} shown" if len(rows) - 1 < len(result) else ""
    return f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>{left_out}"


def _picture(result):
    """SVG of the rods in some states, the last one darkest, in the plane that shows most of them."""
    shown, rods = rows_of(len(result), _STATES), result.scene.rods
    x = np.linspace(0, 1, max(2, _POINTS // (len(shown) * len(rods))))
    lines = [(k, result.sample(k, rod, x)[0]) for k in shown.tolist() for rod in rods]
    points = np.concatenate([places for _, places in lines])
    axes = _plane(points)
    flat = points @ axes.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = (_SIZE - 2 * _MARGIN) / max((high - low).max(), 1e-300)
    width, height = (high - low) * scale + 2 * _MARGIN
    drawn = []
    for k, places in lines:
        across, up = ((places @ axes.T - low) * scale + _MARGIN).T
        corners = " ".join(f"{a:.1f},{height - b:.1f}" for a, b in zip(across, up, strict=True))
        ink = 1.0 if k == shown[-1] else 0.25 + 0.4 * k / shown[-1]
        drawn.append(
            f'<polyline points="{corners}" fill="none" stroke="#2a788e" stroke-width="2" opacity="{ink:.2f}"/>'
        )
    normal = ", ".join(f"{a:.2g}" for a in np.round(-np.cross(*axes), 2) + 0.0)
    return (
        f'<svg width="{width:.0f}" height="{height:.0f}" role="img">{"".join(drawn)}</svg>'
        f"<br/><small>seen along ({normal})</small>"
    )


def _plane(points):
    """(2, 3) two directions, to the right and up, of the plane in which points lie farthest apart; up is near z."""
    _, _, directions = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    normal = directions[2]
    up = np.array([0, 0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0, 1.0, 0])
    up = up - normal * (normal @ up)
    up /= np.linalg.norm(up)
    right = np.cross(up, normal)
    return np.array([right if right[np.argmax(np.abs(right))] > 0 else -right, up])
