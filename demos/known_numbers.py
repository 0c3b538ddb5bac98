"""Numbers that demos must give, the table that shows them, and the command line of programs of several demos."""

import argparse
import sys
from collections import namedtuple

import numpy as np
from mpi4py import MPI
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


def run_all(program, kind, title, demos, names, run, headings=()):
    """Run demos, and print their numbers and whether all are right.

    Args:
        program, kind, title: words of the message on an unknown name, and the title of the table.
        demos: functions; names: of those that are run; none for all.
        run: what a demo is given to: (the model's name, [Check], *more), `headings` those of what is more.

    Returns:
        list of `Check`s.
    """
    rows = []
    for demo in chosen(program, kind, demos, names):
        model, checks, *more = run(demo)
        rows += [(demo.__name__, model, check, *more) for check in checks]
    if MPI.COMM_WORLD.rank == 0:
        print(report(title, rows, headings))
    return [row[2] for row in rows]


def command(about, demos, main, out, **flags):
    """Run `main(names, out)` with the options of the command line; the exit code is 1 where a number is off.

    Args:
        about: the program's docstring. out: the folder for pictures; None is given instead with `--quick`.
        flags: further options of `main`, each with what it does.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="; ".join(demo.__name__ for demo in demos))
    parser.add_argument("--quick", action="store_true", help="without pictures")
    for name, what in flags.items():
        parser.add_argument(f"--{name}", action="store_true", help=what)
    given = vars(parser.parse_args())
    names, quick = given.pop("names"), given.pop("quick")
    sys.exit(verdict(main(names, None if quick else out, **given)))


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
