"""Tables of a result: over load factors or time, and along rods; also as CSV."""

import csv

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.results.export.quantities import FIELDS, headings
from cosserat_fenicsx.results.tables import most_displaced

# How texts begin that spreadsheet programs take for formulas.
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
_ENERGIES = ("kinetic", "strain", "work", "dissipated", "balance")
_MOMENTA = {"linear_momentum": "linear momentum (kg m/s)", "angular_momentum": "angular momentum (kg m^2/s)"}


def over_states(result, station=None):
    """{heading: (n,)} over load factors or time.

    Of a path: load factor, negative modes, iterations, estimated errors. Of a motion: time, steps, energies, momenta.
    Then displacement, quaternion, contact force n and moment m, of a motion velocities too, all inertial, at both ends
    of every rod, where loads and supports act, and at one more station. n and m act from the part of larger s on the
    part of smaller s: the reaction of a support at the start is their opposite.

    Args:
        station: one more; default the one with the largest displacement.
    """
    moving = result.axis == "time"
    return (_of_times if moving else _of_points)(result) | _at_stations(result, station, moving)


def _of_points(path):
    return {
        "load_factor": path.load_factors,
        "negative_modes": path.negative_modes,
        "iterations": path.iterations,
        "estimated_error": path.error,
        **{f"estimated_error_{name}": values for name, values in path.errors._asdict().items()},
    }


def _of_times(history):
    energies = {f"{name} (J)": getattr(history, name) for name in _ENERGIES}
    momenta = {
        f"{heading} {axis}": values
        for name, heading in _MOMENTA.items()
        for axis, values in zip("xyz", getattr(history, name).T, strict=True)
    }
    return {"time (s)": history.times, "steps": history.steps, **energies, **momenta}


def _at_stations(result, station, moving):
    columns, of_table = {}, result.station(station or most_displaced(result))
    queries = {"displacement": "displacement", "quaternion": "rotation"}
    queries |= {"velocity": "velocity", "angular_velocity": "angular_velocity"} if moving else {}
    queries |= {"force": "force", "moment": "moment"}
    for rod in result.scene.rods:
        stations = [rod.start, *result.scene.stations(rod), rod.end, *([of_table] if of_table.rod is rod else [])]
        for place in {place.s: place for place in sorted(stations, key=lambda place: place.s)}.values():
            for name, query in queries.items():
                columns |= _split(getattr(result, query)(place), FIELDS[name], f"{place} ")
    return columns


def along_rods(result, k, rods):
    """{heading: (nodes,)} all fields of `Result.fields` at state k along some rods, one after another."""
    parts = []
    for rod in rods:
        fields = result.fields(k, rod)
        columns = {"rod": np.full(len(fields["s"]), rod.name)}
        for name, values in fields.items():
            columns |= _split(values, FIELDS[name])
        parts.append(columns)
    return {heading: np.concatenate([part[heading] for part in parts]) for heading in parts[0]}


def table(result, k=None, rod=None, station=None):
    """The columns of `Result.write` for .csv and of `to_dataframe`."""
    if k is None and rod is None:
        return over_states(result, station)
    if station is not None:
        raise SceneError(
            f"station = {station!r}: expected None beside k or rod, since a table along rods has no station"
        )
    return along_rods(result, -1 if k is None else k, result.scene.rods if rod is None else [result.rod(rod)])


def plain_text(text):
    """A text for a table, with a quote before it where a spreadsheet program would take it for a formula."""
    return f"'{text}" if text.startswith(_FORMULAS) else text


def write_csv(result, file, k=None, rod=None, station=None):
    """Write the columns of `table` as CSV."""
    write_columns(file, table(result, k, rod, station))


def write_columns(file, columns):
    """Write columns {heading: (n,)} as CSV; a file that was there is replaced once the new one is complete."""
    with replaced(file) as fresh, open(fresh, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(map(plain_text, columns))
        writer.writerows(zip(*map(_cells, columns.values()), strict=True))


def _cells(column):
    return list(map(plain_text, column.tolist())) if column.dtype.kind == "U" else column.tolist()


def _split(values, quantity, before=""):
    """{heading: (n,)} of values (n,) or (n, components)."""
    return dict(zip(headings(quantity, before), values.reshape(len(values), -1).T, strict=True))
