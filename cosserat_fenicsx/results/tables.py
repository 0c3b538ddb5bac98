"""A path as a table for the screen."""

import sys

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from cosserat_fenicsx.results.extremes import largest_in_words
from cosserat_fenicsx.results.reactions import reactions_in_words
from cosserat_fenicsx.scene.describe import actions_in_words

#: Tables with more rows than this leave out some in the middle.
ROWS = 40
# A named station is shown if its displacement is at least this share of the largest one.
_WORTH_SHOWING = 0.2
# Largest displacement of a mode of pure twist (the largest displacement or rotation of a mode is 1).
_TWIST = 1e-6


def path_table(path, station=None):
    """Text: load factor, motion of a station, stability, iterations and estimated error at every point.

    The default station is that with the largest displacement.
    """
    station = path.station(station or most_displaced(path))
    tip, angle = path.displacement(station), path.rotation_angle(station)
    title = f"{path.scene.title}\n" if path.scene.title else ""
    table = Table(
        title=f"{title}{path.model} model, {path.formulation} formulation, degree {path.degree}, "
        f"{' + '.join(map(str, path.elements))} elements, {path.unknowns} unknowns",
        caption=f"dx, dy, dz, size of the rotation: of {station}. stable: 'no (2)' has two negative modes.\n"
        "iterations: Newton's, since the row above. est. error: of positions, relative to the largest displacement.\n"
        f"{actions_in_words(path.scene)}",
    )
    headings = ("load factor", "dx (m)", "dy (m)", "dz (m)", "rotation (rad)", "stable", "iterations", "est. error")
    for heading in headings:
        table.add_column(heading, justify="right")
    before = -1
    for k in _shown(path):
        if k > before + 1:
            table.add_row(*["..."] * len(headings))
        before = k
        table.add_row(
            f"{path.load_factors[k]:.6g}",
            *(f"{x:.9g}" if abs(x) > 1e-12 * path.scales.length else "0" for x in tip[k]),
            f"{angle[k]:.9g}" if angle[k] > 1e-12 else "0",
            stability(path.negative_modes[k]),
            str(path.iterations[k]),
            "unknown" if np.isnan(path.error[k]) else f"{path.error[k]:.1e}",
        )
    kinds = {"limit": "limit point", "bifurcation": "bifurcation"}
    lines = [as_text(table)]
    if len(path) > ROWS:
        lines.append(
            f"{len(_shown(path))} of {len(path)} points: path.csv has all (-o DIR; path.write('path.csv') in Python)."
        )
    lines += [f"{kinds[event.kind]} at the load factor {event.load_factor:.7g}" for event in path.events]
    if not path.left and any(event.kind == "bifurcation" for event in path.events):
        lines.append(
            "The path stays on its branch there; --branch 1 or -1 (branch= in Python) leaves it at the first "
            "bifurcation."
        )
    return "\n".join(
        [*lines, largest_in_words(path), *reactions_in_words(path), f"{path.model} model: {'; '.join(path.why)}."]
    )


def _shown(path):
    """Indices of the points of the table: the first ones, the last ones, and those on both sides of events."""
    beside = {k for event in path.events for k in (event.after, event.after + 1)}
    return [k for k in range(len(path)) if k < ROWS // 2 or k >= len(path) - ROWS // 2 or k in beside]


def most_displaced(path):
    """The station with the largest displacement among the ends of rods and the stations of loads and supports.

    If these move much less than the rest, it is the node with the largest displacement.
    """

    def moves(station):
        return round(float(np.linalg.norm(path.displacement(station), axis=1).max()), 12)

    named = max((station for rod in path.scene.rods for station in (rod.end, *path.scene.stations(rod))), key=moves)
    inside = []
    for i, rod in enumerate(path.scene.rods):
        x = path.layout.node_s(path.rule.nodes)[i]
        moved = np.linalg.norm(path.motion(rod, x)[:, :, :3], axis=2).max(axis=0)
        inside.append(rod.at(x[np.argmax(moved)] * rod.length))
    other = max(inside, key=moves)
    return named if moves(named) >= _WORTH_SHOWING * moves(other) else other


def buckling_table(found):
    """Text: critical load factors by linear buckling, and where each mode moves most."""
    table = Table(
        title=f"{found.scene.title or 'Linear buckling'}: degree {found.degree}, "
        f"{' + '.join(map(str, found.elements))} elements",
        caption="Load factors at which the unloaded state, extrapolated, loses its stability; estimated relative "
        "error. A structure that bends much before it buckles needs `cosserat run` instead.",
    )
    for heading in ("critical load factor", "est. error", "mode moves most at (m)", "there along"):
        table.add_column(heading, justify="right")
    for k, (eta, error) in enumerate(zip(found.load_factors, found.error, strict=True)):
        table.add_row(f"{eta:.7g}", f"{error:.1e}", *_farthest(found, k))
    text = as_text(table) if len(found.load_factors) else "No buckling under positive load factors."
    return f"{text}\n{found.caution}".rstrip()


def modes_table(found):
    """Text: natural frequencies, and where each mode moves most."""
    table = Table(
        title=f"{found.scene.title or 'Natural frequencies'}: degree {found.degree}, "
        f"{' + '.join(map(str, found.elements))} elements",
        caption="Estimated relative error of the square of the frequency. 0 Hz: a free motion, or one that grows as "
        "exp(growth t).",
    )
    for heading in ("frequency (Hz)", "growth (1/s)", "est. error", "mode moves most at (m)", "there along"):
        table.add_column(heading, justify="right")
    for k, (frequency, growth, error) in enumerate(zip(found.frequencies, found.growth, found.error, strict=True)):
        table.add_row(f"{frequency:.7g}", f"{growth:.4g}", f"{error:.1e}", *_farthest(found, k))
    return f"{as_text(table)}\n{found.caution}".rstrip()


def _farthest(found, k):
    """Texts: the station with the largest displacement of a mode, and its direction there, inertial."""
    sizes = [(np.linalg.norm(found.mode(k, rod), axis=1), rod) for rod in found.scene.rods]
    size, rod = max(sizes, key=lambda item: item[0].max())
    if size.max() < _TWIST:
        return "sections turn", "-"
    place = int(np.argmax(size))
    along = found.mode(k, rod)[place] / size[place]
    return f"{rod.name}@{rod.length * place / (len(size) - 1):.4g}", "({:.2f}, {:.2f}, {:.2f})".format(
        *(np.round(along, 2) + 0.0)
    )


def stability(negative_modes):
    """'yes', 'no (2)' with the number of negative modes, or 'critical'."""
    if negative_modes < 0:
        return "critical"
    return "yes" if negative_modes == 0 else f"no ({negative_modes})"


def as_text(table):
    """A rich table as plain text, as wide as it needs, with names and titles as they are.

    Its lines are ASCII where standard output does not know others.
    """
    try:
        "━┏┃".encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        table.box = box.ASCII2
    # a fixed width, since the size of the terminal is unknown under mpirun
    console = Console(width=140, color_system=None, markup=False, emoji=False)
    with console.capture() as capture:
        console.print(table)
    return capture.get().rstrip()
