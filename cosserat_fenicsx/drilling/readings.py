"""Readings of a rig over time, from arrays or from a file as rigs write them."""

import csv
import datetime
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import File, finite_array, instance, number, refuse, text_of
from cosserat_fenicsx.quantities import BY_UNIT, DIMENSIONS
from cosserat_fenicsx.drilling.history import DrillingHistory
from cosserat_fenicsx.drilling.signals import doubt_speed
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.well.operations import doubt_load

# Numbers that stand for none in files of rigs; usual names of columns beside those of a `DrillingHistory`.
_NONE = (-999.25, -999.0, -9999.0, -9999.25)
_USUAL = {
    "drive_speed": ("rpm", "rotary speed", "surface rpm", "surface speed", "top drive rpm", "td rpm", "rotary rpm"),
    "surface_torque": ("torque", "tq", "top drive torque", "td torque", "rotary torque"),
    "hook_load": ("hookload", "hkld", "hkl"),
    "bit_speed": ("bit rpm", "downhole rpm"),
    "weight_on_bit": ("wob",),
}
_TIME = ("time", "t", "seconds", "elapsed time", "timestamp", "date time", "datetime")
#: {name: SI unit} of what a rig reads, quantities of a `DrillingHistory` over time.
READ = {
    quantity.name: quantity.unit
    for quantity in DrillingHistory._quantities.values()
    if quantity.axes == ("time",) and quantity.name != "time" and quantity.unit != "J"
}


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of a rig over time.

    Args:
        times: (n,) s, ascending, at any distances.
        values: {name: (n,)} of quantities of a `DrillingHistory` over time, such as "drive_speed" (rad/s) and
            "surface_torque" (N m); NaN where nothing was read.
        noise: {name: standard deviation} of each, in the same units: the weights of the readings.

    Raises:
        SceneError: times that do not ascend, a name that is none, lengths that differ, or no noise.
    """

    times: np.ndarray
    values: Mapping[str, np.ndarray]
    noise: Mapping[str, float]

    def __post_init__(self):
        times = finite_array(self, "times", self.times, "(n,) times (s)")
        if times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0).all():
            refuse(self, "times", self.times, "at least two ascending times (s)")
        found = {}
        for name, column in dict(instance(self, "values", self.values, Mapping, "{name: readings}")).items():
            if name not in READ:
                raise SceneError(f"Readings.values: '{name}': {nearest(name, list(READ))}")
            found[name] = np.asarray(column, dtype=float)
            if found[name].shape != times.shape:
                refuse(self, f"values['{name}']", np.shape(column), f"as many as there are times, {len(times)}")
        if not any(np.isfinite(column).any() for column in found.values()):
            refuse(self, "values", self.values, "at least one quantity with readings")
        _doubt(found)
        noise = {}
        for name in found:
            if name not in self.noise:
                refuse(self, "noise", dict(self.noise), f"the standard deviation of '{name}' ({READ[name]}) too")
            noise[name] = number(self, f"noise['{name}']", self.noise[name], f"above 0 ({READ[name]})", _above_zero)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", found)
        object.__setattr__(self, "noise", noise)

    @classmethod
    def from_csv(cls, file: File, noise: Mapping[str, float], columns: Mapping[str, str] | None = None) -> "Readings":
        """Readings from a .csv file: names in the first row; units behind them in brackets, or in a row of their own.

        Times are seconds, or another unit that the heading names, or dates with times as of ISO 8601; they then count
        from the first row. Rows may stand at any distances of time, cells may be empty or hold -999.25 where nothing
        was read.

        Args:
            noise: see the class, in SI units.
            columns: {quantity: name of its column} where the names are not usual ones; "time" for that of the times.

        Raises:
            SceneError: no such file, a column or unit that is not known, or times that do not ascend, with the line.
        """
        lines = [(i, x) for i, x in enumerate(text_of(file, "readings as .csv").splitlines(), start=1) if x.strip()]
        if not lines:
            raise SceneError(f"{file}: expected a row of names, such as 'time (s),surface torque (N m)'")
        separator = max(",;\t", key=lines[0][1].count)
        rows = [(i, [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]) for i, line in lines]
        names, says = zip(*(_split(cell) for cell in rows[0][1]), strict=True)
        wanted = dict(columns or {})
        time = _column(file, names, "time", wanted, _TIME)
        known = {x: _column(file, names, x, wanted, _USUAL.get(x, ()), x in wanted) for x in READ}
        known = {name: column for name, column in known.items() if column is not None}
        if not known:
            raise SceneError(
                f"{file}: none of the columns {', '.join(map(repr, names))} is a quantity that a motion has: expected "
                "columns={'surface_torque': 'name of its column'}"
            )
        units, body = list(says), rows[1:]
        if body and not any(_is_number(cell) or _date(cell) for cell in body[0][1]):  # a row of units
            units = [_plain_unit(cell) or said for cell, said in zip(body[0][1], says, strict=False)]
            body = body[1:]
        sizes = {name: _size(file, names[k], units[k], READ[name]) for name, k in known.items()}
        times = _times(file, [(i, row[time] if time < len(row) else "") for i, row in body], names[time], units[time])
        values = {
            name: np.array([_value(file, i, row[k] if k < len(row) else "") for i, row in body]) * sizes[name]
            for name, k in known.items()
        }
        return cls(times, values, {name: noise[name] for name in known if name in noise})


def _doubt(values):
    """Warn of readings that are probably in other units."""
    largest = {name: float(np.nanmax(np.abs(x))) for name, x in values.items() if np.isfinite(x).any()}
    doubt_speed("Readings", "values['drive_speed']", largest.get("drive_speed", 0.0))
    for name, what, of in (("surface_torque", "torque", "drive"), ("hook_load", "hook load", "string"),
                           ("weight_on_bit", "weight", "bit"), ("torque_on_bit", "torque", "bit")):  # fmt: skip
        doubt_load(f"Readings.values['{name}']", largest.get(name, 0.0), what, of=of)


# Quantities at the ends of steps; all others are means over them.
_AT_ENDS = ("drive_angle", "bit_angle", "bit_advance", "impulse_on_bit")


def computed(history, name, times):
    """A quantity of a history at times (s), by lines between rows; means hold for the middles of the steps."""
    ends = name in _AT_ENDS or (name == "drive_speed" and history.scene.drive.inertia > 0)
    return np.interp(times, history.times if ends else history.mean_times, getattr(history, name))


def _above_zero(x):
    return 0 < x < math.inf


def _split(heading):
    """(name in lower case, unit) of a heading such as "Surface Torque (kN m)"."""
    name, unit = re.match(r"([^\[(]*)(?:[\[(]([^\])]*)[\])])?", heading).groups()
    return " ".join(name.replace("_", " ").lower().split()), _plain_unit(unit or "")


def _plain_unit(text):
    return text.strip().strip("()[]").replace(".", " ").strip()


def _column(file, names, quantity, wanted, usual, needed=None):
    """The number of the column of a quantity, None where there is none and none is needed."""
    given = wanted.get(quantity)
    accepted = [" ".join(given.replace("_", " ").lower().split())] if given else [quantity.replace("_", " "), *usual]
    found = [k for k, name in enumerate(names) if name in accepted or (given and _split(given)[0] == name)]
    if len(found) == 1:
        return found[0]
    if found or given or (quantity == "time" if needed is None else needed):
        what = "columns are several" if found else "no column is"
        raise SceneError(
            f"{file}: {what} named '{given or quantity}' in {', '.join(map(repr, names))}: expected "
            f"columns={{'{quantity}': 'name of its column'}}"
        )
    return None


def _size(file, name, unit, si):
    """The size in SI of the unit of a column."""
    if not unit:
        known = list(DIMENSIONS[BY_UNIT[si]].units) if si in BY_UNIT else [si]
        raise SceneError(f"{file}: column '{name}' has no unit: expected one behind the name, as in '{name} "
                         f"({known[-1]})', of {', '.join(known)}")  # fmt: skip
    known = DIMENSIONS[BY_UNIT[si]].units if si in BY_UNIT else {si: 1.0}
    plain = {name.lower().replace(" ", ""): size for name, size in known.items()}
    size = known.get(unit, plain.get(unit.lower().replace(" ", "")))
    if size is None:
        raise SceneError(f"{file}: column '{name}': unit '{unit}': {nearest(unit, list(known))}")
    return size


def _times(file, cells, name, unit):
    """(n,) s, of numbers or of dates."""
    dates = [_date(cell) for _, cell in cells]
    if cells and all(dates):
        return np.array([(date - dates[0]).total_seconds() for date in dates])
    found = np.array([_value(file, i, cell) for i, cell in cells])
    bad = np.flatnonzero(~np.isfinite(found))
    if len(bad):
        raise SceneError(f"{file}: line {cells[bad[0]][0]}: expected a time in column '{name}'")
    down = np.flatnonzero(np.diff(found) <= 0)
    if len(down):
        raise SceneError(f"{file}: line {cells[down[0] + 1][0]}: expected times that ascend in column '{name}'")
    return found * _size(file, name, unit or "s", "s")


def _date(cell):
    """A date with its time, None for other text."""
    try:
        return datetime.datetime.fromisoformat(cell) if not _is_number(cell) else None
    except ValueError:
        return None


def _value(file, line, cell):
    """A number, NaN for none."""
    if not cell or cell.lower() in ("nan", "null", "none"):
        return math.nan
    if not _is_number(cell):
        raise SceneError(f"{file}: line {line}: {cell!r:.40}: expected a number, or an empty cell where none was read")
    return math.nan if float(cell) in _NONE else float(cell)


def _is_number(cell):
    try:
        float(cell)
    except ValueError:
        return False
    return True
