"""Paths and motions as tables for the screen."""

import sys

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from cosserat_fenicsx.results.compared import NAMES
from cosserat_fenicsx.results.queries import largest_in_words, reactions_in_words
from cosserat_fenicsx.scene.describe import actions_in_words

#: Tables with more rows than this leave out some in the middle.
ROWS = 40
# A named station is shown if its displacement is at least this share of the largest one.
_WORTH_SHOWING = 0.2


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
        f"iterations: Newton's, since the row above. est. error: the largest of {_bounded(path)}.\n"
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
        [
            *lines,
            *errors_in_words(path),
            largest_in_words(path),
            *reactions_in_words(path),
            f"{path.model} model: {'; '.join(path.why)}.",
        ]
    )


def errors_in_words(path):
    """A sentence on the largest estimated errors; none where they are unknown."""
    known = [(name, values.max()) for name, values in path.errors._asdict().items() if not np.isnan(values).any()]
    if known and len(path):
        by_rounding = dict(zip(NAMES, path.rounding_errors.max(axis=1), strict=True))
        told = ", ".join(
            f"{name}s {worst:.1e}{' (rounding)' if 0 < worst <= by_rounding[name] else ''}" for name, worst in known
        )
        yield f"Estimated errors, each relative to the largest of its kind, are at most: {told}."


def _bounded(path):
    """What `tol` bounds, in words."""
    *names, last = [f"{name}s" for name in path.bounded]
    return f"{', '.join(names)} and {last}, relative" if names else f"{last}, relative"


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


#: Largest number of rows of the table.
_TIMES = 21
_ENERGIES = ("kinetic", "strain", "work", "dissipated", "balance")


def motion_table(history, station=None, rows=_TIMES):
    """Text: time, motion of a station and energies at up to `rows` times; final positions of all named stations.

    The default station is that with the largest displacement.
    """
    shown = np.unique(np.round(np.linspace(0, len(history) - 1, rows)).astype(int))
    station = history.station(station or most_displaced(history))
    moved, speed = history.displacement(station), np.linalg.norm(history.velocity(station), axis=1)
    title = f"{history.scene.title}\n" if history.scene.title else ""
    which = f"{len(shown)} of {len(history)} times" if len(shown) < len(history) else f"{len(history)} times"
    table = Table(
        title=f"{title}{history.model} model, scheme {history.scheme}, degree {history.degree}, "
        f"{' + '.join(map(str, history.elements))} elements, {history.unknowns} unknowns, "
        f"{history.steps[-1]} steps, {which}",
        caption=f"dx, dy, dz, speed: of {station}. work: of loads and prescribed motions.\n"
        "balance: kinetic + strain - work + dissipated, minus its value at the start; zero for an exact solution.",
    )
    for heading in ("time (s)", "dx (m)", "dy (m)", "dz (m)", "speed (m/s)", *(f"{name} (J)" for name in _ENERGIES)):
        table.add_column(heading, justify="right")
    energies = [getattr(history, name) for name in _ENERGIES]
    least = 1e-12 * history.scales.length
    for k in shown:
        table.add_row(
            f"{history.times[k]:.6g}",
            *(f"{x:.6g}" if abs(x) > least else "0" for x in moved[k]),
            f"{speed[k]:.4g}",
            *(f"{energy[k]:.5g}" for energy in energies[:-1]),
            f"{energies[-1][k]:.1e}",
        )
    ends = (
        f"{place} at ({', '.join(f'{x if abs(x) > least else 0:.6g}' for x in history.position(place)[-1])}) m"
        for place in _named(history.scene)
    )
    return "\n".join([
        as_text(table),
        f"t = {history.times[-1]:.6g} s: {'; '.join(ends)}.",
        largest_in_words(history),
        *reactions_in_words(history),
        f"{history.model} model: {'; '.join(history.why)}.",
    ])  # fmt: skip


def _named(scene):
    """The ends of all rods and the stations of supports, loads and joints, without repetitions."""
    places = {}
    for rod in scene.rods:
        for station in (rod.start, *scene.stations(rod), rod.end):
            places.setdefault(tuple(np.round(rod.curve.position(station.s), 9)), station)
    return places.values()
