"""Numbers that demos must give, and the table that shows them."""

from collections import namedtuple

import numpy as np
from rich.table import Table

from cosserat_fenicsx.results.tables import as_text

#: A number, its expected value and the source of that, and the allowed deviation (absolute).
Check = namedtuple("Check", "what found expected allowed source")


def deviation(check):
    """The largest difference of a number from what it should be."""
    return float(np.max(np.abs(np.subtract(check.found, check.expected))))


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
