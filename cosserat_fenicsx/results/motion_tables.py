"""A motion as a table for the screen."""

import numpy as np
from rich.table import Table

from cosserat_fenicsx.results.extremes import largest_in_words
from cosserat_fenicsx.results.reactions import reactions_in_words
from cosserat_fenicsx.results.tables import as_text, most_displaced

#: Largest number of rows of the table.
ROWS = 21
_ENERGIES = ("kinetic", "strain", "work", "dissipated", "balance")


def motion_table(history, station=None, rows=ROWS):
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
