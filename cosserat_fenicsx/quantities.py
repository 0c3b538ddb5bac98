"""Quantities of results: names, labels, units, frames and axes, and the units in which they are shown.

A class of results says its quantities once; files, tables, data frames and charts follow from them.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosserat_fenicsx.dimensions import DIMENSIONS
from cosserat_fenicsx.errors import SceneError, nearest

#: SI units with their usual prefixes. On the screen the largest unit is taken that gives a number above 1, or above 10
#: for mega: a hook load of 1122 kN is not written as 1.122 MN.
_PREFIXED = {
    "N": {"N": 1.0, "kN": 1e3, "MN": 1e6},
    "N m": {"N m": 1.0, "kN m": 1e3, "MN m": 1e6},
    "N/m": {"N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6},
    "N m^2": {"N m^2": 1.0, "kN m^2": 1e3, "MN m^2": 1e6},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    "J": {"J": 1.0, "kJ": 1e3, "MJ": 1e6},
    "W": {"W": 1.0, "kW": 1e3, "MW": 1e6},
    "m": {"mm": 1e-3, "m": 1.0},
}
# Numbers, also "a to b", with a unit in a sentence, and no longer unit after it.
_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_WITH_UNIT = re.compile(rf"(?<![\w.])({_NUMBER})(?: (to|and) ({_NUMBER}))? (m|k?N m|N/m|k?N|kJ)(?![\w/^]| m\b| s\b)")
_SI = {"kN m": ("N m", 1e3), "kN": ("N", 1e3), "kJ": ("J", 1e3)}
# Numbers below this are written without an exponent.
_PLAIN = 1e7
#: Lengths (m) are shown in mm only below this.
_SHORT = 1e-2


@dataclass(frozen=True)
class Quantity:
    """A named quantity of a class of results.

    Attributes:
        name: as users ask for it; also the name of the result's attribute unless there is a `getter`.
        label: in words, for headings and charts; by default the name.
        unit: in which the result has it: SI, degrees for some angles, "1" for none.
        parts: names of the components along its last axis, such as "xyz"; "" for a scalar.
        frame: in which the components are, in words; "" for a scalar.
        axes: names of its axes without that of the components, such as ("point",); () for a single number.
        getter: a function of the result that returns the values, or the path of an attribute; None for `name`.
        shown: unit on the screen; by default the unit of the result with a prefix (kN, kN m) by its size.
        dimension: name in `dimensions.DIMENSIONS`, where several have its unit ("diameter" for inches in field units).
        noise: values up to this, in `unit`, are rounding and shown as 0.
        digits: significant ones in tables on the screen.
        short: its label there, followed by the name of a component ("d" for dx, dy, dz).
        chart: a function of matplotlib's Axes and of the values along the axis and of the quantity, both in the units
            of the chart, which draws them; None for lines.
    """

    name: str
    label: str = ""
    unit: str = "1"
    parts: Sequence[str] = ""
    frame: str = ""
    axes: tuple[str, ...] = ("point",)
    getter: Callable | str | None = None
    shown: str = ""
    dimension: str = ""
    noise: float = 0.0
    digits: int = 6
    short: str = ""
    chart: Callable | None = None

    def __post_init__(self):
        object.__setattr__(self, "label", self.label or self.name.replace("_", " "))

    def of(self, result: Any, *where: Any) -> Any:
        """Its values in a result, in `unit`; `where`: further arguments of the getter, such as a rod."""
        if callable(self.getter):
            return self.getter(result, *where)
        for name in (self.getter or self.name).split("."):
            result = getattr(result, name)
        return result

    def heading(self, unit: str | None = None, before: str = "") -> str:
        """Its label with a unit, such as "hook load (kN)"; by default its own."""
        unit = self.unit if unit is None else unit
        return f"{before}{self.label}" + ("" if unit in ("1", "") else f" ({unit})")

    def columns(self, values: Any, units: "Units", before: str = "") -> dict[str, np.ndarray]:
        """{heading: (n,)} of values (n,) or (n, components) in some units, such as "position (m) x"."""
        unit, size = units.of(self)
        heading = self.heading(unit, before)
        values = np.asarray(values)
        if size != 1.0:
            values = values / size
        if not self.parts:
            return {heading: values}
        return dict(zip((f"{heading} {part}" for part in self.parts), values.reshape(-1, len(self.parts)).T,
                        strict=True))  # fmt: skip


class Quantities(dict[str, Quantity]):
    """{name: `Quantity`}; printed a line each: the name, its heading, its axes, and the frame of its components."""

    def __repr__(self):
        rows = [(x.name, x.heading(), ", ".join(x.axes) or "one number", x.frame) for x in self.values()]
        widths = [max(map(len, column), default=0) for column in zip(*rows, strict=True)]
        lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) for row in rows]
        return "\n".join(line.rstrip() for line in lines)

    def __or__(self, other):
        return Quantities({**self, **other})


class Units:
    """The units that quantities are shown in: those of the result ("SI"), of the oil field, or chosen ones.

    Args:
        units: "SI"; "field" (ft, in, klbf, ft-lbf, ppg, rpm, psi); or {dimension or unit: unit}, such as
            {"force": "klbf", "[length]": "ft", "N m": "kN m"}, with SI for all others.

    Raises:
        SceneError: unknown units; a unit of another dimension.
    """

    def __init__(self, units: "str | Mapping | Units" = "SI"):
        self.si = units == "SI"
        self._chosen: dict[str, str] = {}  # units by dimensions
        if isinstance(units, Units):
            self.si, self._chosen = units.si, units._chosen
        elif isinstance(units, Mapping):
            for key, unit in units.items():
                self._chosen |= dict.fromkeys(_named(str(key), str(unit)), str(unit))
        elif units == "field":
            self._chosen = {name: dimension.field for name, dimension in DIMENSIONS.items()}
        elif not self.si:
            raise SceneError(
                f"units = {units!r}: expected 'SI', 'field' or a dict of units by dimensions, such as "
                "{'force': 'klbf', 'length': 'ft'}"
            )

    def of(self, quantity: Quantity) -> tuple[str, float]:
        """The unit of a quantity in files and data frames, and its size in the result's unit."""
        for name in _dimensions(quantity.unit, quantity.dimension):
            if name in self._chosen:
                known = DIMENSIONS[name].units
                return self._chosen[name], known[self._chosen[name]] / known[quantity.unit]
        return quantity.unit, 1.0

    def told(self, value: float, unit: str, dimension: str = "", form: str = "g", shown: str = "") -> str:
        """A number with its unit: one in an SI unit, of a dimension where several have that unit, as text; `shown`:
        see `Quantity`."""
        shown, size = self.on_screen(Quantity("number", unit=unit, dimension=dimension, shown=shown), [value])
        return f"{value / size:{form}} {shown}"

    def sentence(self, text: str) -> str:
        """A sentence with its lengths, forces, forces per length, moments and energies in these units, with as many
        digits as it has, at least three."""
        return text if self.si else _WITH_UNIT.sub(self._again, text)

    def _again(self, found):
        first, word, second, unit = found.groups()
        si, size = _SI.get(unit, (unit, 1.0))
        shown, other = self.of(Quantity("number", unit=si, dimension="force per length" if si == "N/m" else ""))
        if shown == si:  # none was chosen
            return found[0]
        digits = [max(3, len(re.sub(r"e.*|\D", "", x).lstrip("0"))) for x in (first, second) if x]
        told = [as_text(float(x) * size / other, n) for x, n in zip(filter(None, (first, second)), digits, strict=True)]
        return f"{f' {word} '.join(told)} {shown}"

    def on_screen(self, quantity: Quantity, values: Any = ()) -> tuple[str, float]:
        """The unit of a quantity in tables and charts, and its size in the result's unit: SI units have the prefix that
        suits the values."""
        unit, size = self.of(quantity)
        if any(name in self._chosen for name in _dimensions(quantity.unit, quantity.dimension)):
            return unit, size
        if quantity.shown:
            known = next(x.units for x in DIMENSIONS.values() if {unit, quantity.shown} <= x.units.keys())
            return quantity.shown, known[quantity.shown] / known[unit]
        values = np.abs(np.asarray(values, dtype=float))
        largest = float(values[np.isfinite(values)].max(initial=0.0))
        if unit not in _PREFIXED or largest == 0 or (unit == "m" and largest >= _SHORT):
            return unit, 1.0
        least = {"MN": 1e7, "MN m": 1e7, "MN/m": 1e7}
        suits = [(name, size) for name, size in _PREFIXED[unit].items() if least.get(name, size) <= largest]
        return suits[-1] if suits else next(iter(_PREFIXED[unit].items()))


def _dimensions(unit, dimension=""):
    """Names of the dimensions that have a unit, or the one that is given."""
    return [dimension] if dimension else [name for name, x in DIMENSIONS.items() if unit in x.units]


def _named(key, unit):
    """Names of the dimensions that a key of chosen units means, and that have the unit."""
    name = key.strip("[]").replace("_", " ")
    meant = [name] if name in DIMENSIONS else _dimensions(key)
    if not meant:
        raise SceneError(f"units[{key!r}]: {nearest(name, list(DIMENSIONS))}")
    found = [name for name in meant if unit in DIMENSIONS[name].units]
    if not found:
        raise SceneError(f"units[{key!r}] = {unit!r}: {nearest(unit, list(DIMENSIONS[meant[0]].units))}")
    return found


def span_in_words(values: Any, unit: str) -> str:
    """Numbers (n,) as text: the first and the last one with their unit, "0 .. 2.5 N"."""
    ends = [f"{x:.4g}" for x in np.atleast_1d(values)[[0, -1] if np.size(values) > 1 else slice(1)].tolist()]
    return f"{' .. '.join(ends)} {unit}" if ends else "none"


def as_text(value: Any, digits: int = 6, noise: float = 0.0) -> str:
    """A value in a table: with some digits, 0 where it is noise, "-" where it is unknown, texts as they are."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if not isinstance(value, float | np.floating):
        return str(value)
    if np.isnan(value):
        return "-"
    if abs(value) <= noise:
        return "0"
    return f"{value:.0f}" if 10.0**digits <= abs(value) < _PLAIN else f"{value:.{digits}g}"
