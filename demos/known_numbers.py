"""Numbers that demos must give, and the table that shows them."""

import sys
from collections import namedtuple

import numpy as np
from rich.table import Table

from cosserat_fenicsx.results.screen import as_text

#: A number, its expected value and the source of that, and the allowed deviation (absolute).
Check = namedtuple("Check", "what found expected allowed source")


def deviation(check):
    """The largest difference of a number from what it should be."""
    return float(np.max(np.abs(np.subtract(check.found, check.expected))))


def chosen(program, kind, demos, names):
    """The demos (functions) of these names, or all; ends the program where there is none of a name."""
    known = {demo.__name__: demo for demo in demos}
    for name in names:
        if name not in known:
            sys.exit(f"{program}: no {kind} is named '{name}': known: {', '.join(known)}")
    return [known[name] for name in names or known]


def verdict(checks):
    """The exit code of a program: whether a number is off by more than is allowed."""
    return int(any(deviation(check) > check.allowed for check in checks))


def report(title, rows, headings=()):
    """A table in text.

    Args:
        rows: (scene's name, model, Check, *more), `headings` those of what is more.
    """
    table = Table(title=title)
    for heading in ("scene", "model", *headings, "number", "deviation", "allowed", "expected by"):
        table.add_column(heading)
    for name, model, check, *more in rows:
        found = np.atleast_1d(check.found)
        values = ", ".join(f"{x:.6g}" for x in np.where(abs(found) > 1e-12 * abs(found).max(), found, 0))
        table.add_row(
            name,
            model,
            *map(str, more),
            f"{check.what}: {values}",
            f"{deviation(check):.2g}",
            f"{check.allowed:.2g}",
            check.source,
        )
    return as_text(table)
