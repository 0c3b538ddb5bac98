"""A path as a table for the screen and as CSV."""

import csv

import numpy as np
from rich.console import Console
from rich.table import Table

from cosserat_fenicsx.ranks import on_first


def path_table(path):
    """Text: load factor, displacement of the end of the first rod, largest displacement, stability, work, error."""
    rod = path.scene.rods[0]
    tip, largest = path.displacement(rod.end), path.largest_displacement()
    title = f"{path.scene.title}\n" if path.scene.title else ""
    table = Table(
        title=f"{title}{path.model} model, {path.formulation} formulation, degree {path.degree}, "
        f"{' + '.join(map(str, path.elements))} elements, {path.unknowns} unknowns",
        caption=f"loads, times the load factor: {', '.join(map(describe, path.scene.loads)) or 'none'}",
    )
    headings = ("load factor", *(f"{rod.name}.end {c} (m)" for c in ("dx", "dy", "dz")), "largest (m)", "stable",
                "iterations", "est. error")  # fmt: skip
    for heading in headings:
        table.add_column(heading, justify="right")
    for k, eta in enumerate(path.load_factors):
        table.add_row(
            f"{eta:.6g}",
            *(f"{x + 0.0:.9g}" if abs(x) > 1e-12 * path.scales.length else "0" for x in tip[k]),
            f"{largest[k]:.9g}",
            stability(path.negative_modes[k]),
            str(path.iterations[k]),
            "not asked" if np.isnan(path.error[k]) else f"{path.error[k]:.1e}",
        )
    return as_text(table)


def describe(item):
    """A support or a load in few words: its kind and its station."""
    return f"{type(item).__name__}" + (f" at {item.station}" if item.station is not None else "")


def stability(negative_modes):
    """'yes', 'no (2)' with the number of negative modes, or 'critical'."""
    if negative_modes < 0:
        return "critical"
    return "yes" if negative_modes == 0 else f"no ({negative_modes})"


def as_text(table):
    """A rich table as plain text, as wide as it needs."""
    console = Console(width=140, color_system=None)  # mpirun shows the ranks a terminal that there is not
    with console.capture() as capture:
        console.print(table)
    return capture.get().rstrip()


def write_csv(path, file):
    """Load factors, stability, work, error, and position (m), n (N) and m (N m) at both ends of every rod."""
    names = ["load_factor", "negative_modes", "iterations", "estimated_error"]
    columns = [path.load_factors, path.negative_modes, path.iterations, path.error]
    for rod in path.scene.rods:
        for station in (rod.start, rod.end):
            for quantity, unit in (("displacement", "m"), ("force", "N"), ("moment", "Nm")):
                values = getattr(path, quantity)(station)
                for i, axis in enumerate("xyz"):
                    names.append(f"{station} {quantity}_{axis} ({unit})")
                    columns.append(values[:, i])
    on_first(path.comm, lambda: _write_rows(file, names, zip(*(column.tolist() for column in columns), strict=True)))


def _write_rows(file, names, rows):
    with open(file, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(names)
        writer.writerows(rows)
