"""Results of buckling and of natural vibrations as tables for the screen."""

from html import escape

import numpy as np
from rich.table import Table

from cosserat_fenicsx.results.tables import as_text
from cosserat_fenicsx.scene.describe import actions_in_words


def buckling_table(found):
    """Text: critical load factors by linear buckling, where each mode moves most, and the limits of the result."""
    caption = (
        f"The equilibrium at the load factor {found.load_factor:g}, extrapolated linearly, becomes critical there.\n"
        "est. error: relative, of the load factor.\n"
        "A structure that bends much before it buckles needs `cosserat run`."
    )
    headings = ("critical load factor", "est. error")
    rows = [(f"{eta:.7g}", _error(error)) for eta, error in zip(found.load_factors, found.error, strict=True)]
    text = _table(found, headings, rows, caption) if rows else f"{found.none[0].upper()}{found.none[1:]}."
    lines = [text, actions_in_words(found.scene)]
    if found.conservative:
        lines.append(f"The loads have a potential: there is no static bifurcation below {found.bound:.7g} (bound).")
    return "\n".join([*lines, found.caution]).rstrip()


def modes_table(found):
    """Text: natural frequencies, where each mode moves most, and whether the state is stable."""
    caption = (
        "est. error: relative, of the square of the frequency.\n"
        "0 Hz: a free motion, or one that grows as exp(growth t)."
    )
    numbers = zip(found.frequencies, found.periods, found.growth, found.error, strict=True)
    rows = [(f"{f:.7g}", f"{T:.5g}" if f else "-", f"{growth:.4g}", _error(e)) for f, T, growth, e in numbers]
    text = _table(found, ("frequency (Hz)", "period (s)", "growth (1/s)", "est. error"), rows, caption)
    verdict = {0: "no negative mode (stable)" if found.conservative else "no negative mode", -1: "a singular stiffness"}
    counted = verdict.get(found.negative_modes, f"{found.negative_modes} negative mode(s) (unstable)")
    return f"{text}\nThe equilibrium at the load factor {found.load_factor:g} has {counted}.\n{found.caution}".rstrip()


def html_table(found):
    """The numbers of all modes as a table in HTML, with the limits of the result."""
    head = "".join(f"<th>{name}</th>" for name in ("k", *found.columns))
    rows = "".join(
        f"<tr>{''.join(f'<td>{value:.7g}</td>' for value in (k, *values))}</tr>"
        for k, values in enumerate(zip(*found.columns.values(), strict=True))
    )
    title = f"{found.scene.title}: {found.title.lower()}" if found.scene.title else found.title
    return f"<table><caption>{escape(title)}</caption><tr>{head}</tr>{rows}</table><p>{escape(found.caution)}</p>"


def _table(found, headings, rows, caption):
    table = Table(
        title=f"{found.scene.title or found.title}: degree {found.degree}, "
        f"{' + '.join(map(str, found.elements))} elements",
        caption=f"{caption}\nk: number of the mode in Python, in files and in pictures.",
    )
    for heading in ("k", *headings, "mode moves most at (m)", "there along"):
        table.add_column(heading, justify="right")
    for k, row in enumerate(rows):
        table.add_row(str(k), *row, *_farthest(found, k))
    return as_text(table)


def _error(error):
    return "unknown" if np.isnan(error) else f"{error:.1e}"


def _farthest(found, k):
    """Texts: the station with the largest displacement of a mode, and its direction there, inertial."""
    station, along = found.farthest(k)
    if station is None:
        return "sections turn", "-"
    return str(station), "({:.2f}, {:.2f}, {:.2f})".format(*(np.round(along, 2) + 0.0))
