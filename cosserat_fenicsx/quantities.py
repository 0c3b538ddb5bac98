"""Quantities of results: names, labels, units, frames and axes, and the units in which they are shown.

A class of results says its quantities once; files, tables, data frames and charts follow from them.

Dimensions: units in SI and in the oil field; text with a unit, such as "20 klbf", as a number. A number without a unit
is in SI.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np

from cosserat_fenicsx import units
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
_UNIT = r"(m|k?N m|N/m|k?N|kJ|Pa|deg/30m|kg/m\^3)"
_NUMBERS = rf"{_NUMBER}(?: (?:to|and) {_NUMBER})?|\({_NUMBER}(?:, {_NUMBER})*\)"
_WITH_UNIT = re.compile(rf"(?<![\w.])({_NUMBERS}) {_UNIT}(?![\w/^]| m\b| s\b)")
_SI = {"kN m": ("N m", 1e3), "kN": ("N", 1e3), "kJ": ("J", 1e3), "deg/30m": ("rad/m", units.deg_per_30m)}
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
        dimension: name in `DIMENSIONS`, where several have its unit ("diameter" for inches in field units).
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
        units: "SI"; "field" (ft, in, klbf, ft-lbf, ppg, rpm, psi); {dimension or unit: unit}, such as
            {"force": "klbf", "[length]": "ft", "N m": "kN m"}, or units with commas between, "kN,mm", with SI for all
            others: but moments and forces per length follow a force in N, kN, lbf or klbf, as kN m and kN/m.

    Raises:
        SceneError: unknown units; a unit of another dimension; several of one.
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
            asked = [unit.strip() for unit in str(units).split(",")]
            for unit in asked:
                known = {name: unit for name, x in DIMENSIONS.items() if unit in x.units}
                if not known:
                    raise SceneError(
                        f"units = {units!r}: expected 'SI', 'field' or a dict of units by dimensions, such as "
                        "{'force': 'klbf', 'length': 'ft'}, or units with commas between, such as 'kN,mm': "
                        f"'{unit}' is none"
                    )
                self._chosen |= known
            if lost := [unit for unit in asked if unit not in self._chosen.values()]:
                raise SceneError(
                    f"units = {units!r}: '{lost[0]}' and a later one are units of the same kind: expected one of them "
                    "(a dict of units by dimensions, or 'field', has lengths apart from diameters)"
                )
        force = self._chosen.get("force")
        for name, unit in (("moment", f"{force} m"), ("force per length", f"{force}/m")):
            if force and re.search("lb|kip", force):
                unit = DIMENSIONS[name].field
            if unit in DIMENSIONS[name].units:
                self._chosen.setdefault(name, unit)

    def chosen(self, quantity: Quantity) -> tuple[str, float] | None:
        """The unit that was chosen for a quantity, and its size in the result's unit; None where none was."""
        for name in _dimensions(quantity.unit, quantity.dimension):
            if name in self._chosen:
                known = DIMENSIONS[name].units
                return self._chosen[name], known[self._chosen[name]] / known[quantity.unit]
        return None

    def of(self, quantity: Quantity) -> tuple[str, float]:
        """The unit of a quantity in files and data frames, and its size in the result's unit."""
        return self.chosen(quantity) or (quantity.unit, 1.0)

    def told(self, value: float, unit: str, dimension: str = "", form: str = "g", shown: str = "") -> str:
        """A number with its unit: one in an SI unit, of a dimension where several have that unit, as text; `shown`:
        see `Quantity`."""
        shown, size = self.on_screen(Quantity("number", unit=unit, dimension=dimension, shown=shown), [value])
        return f"{value / size:{form}} {shown}"

    def sentence(self, text: str) -> str:
        """A sentence with its lengths, forces, forces per length, moments, stresses, energies and densities in these
        units, with as many digits as it has, at least three."""
        return text if self.si else _WITH_UNIT.sub(self._again, text)

    def _again(self, found):
        numbers, unit = found.groups()
        si, size = _SI.get(unit, (unit, 1.0))
        number = Quantity("number", unit=si, dimension={"N/m": "force per length", "Pa": "pressure"}.get(si, ""))
        shown, other = self.chosen(number) or (unit, size)
        if shown == unit:
            return found[0]

        def again(x):
            return as_text(float(x[0]) * size / other, max(3, len(re.sub(r"e.*|\D", "", x[0]).lstrip("0"))))

        return f"{re.sub(_NUMBER, again, numbers)} {shown}"

    def on_screen(self, quantity: Quantity, values: Any = ()) -> tuple[str, float]:
        """The unit of a quantity in tables and charts, and its size in the result's unit: SI units have the prefix that
        suits the values."""
        if found := self.chosen(quantity):
            return found
        unit = quantity.unit
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


#: Sizes beyond this, and below its inverse, are refused: their fourth powers would not be numbers.
LARGEST = 1e60


class Dimension(NamedTuple):
    """A kind of number.

    Attributes:
        si: the SI unit.
        units: {name: size in SI} of the units that a text may have.
        field: the unit of the field system (ft, in, klbf, ft-lbf, ppg, rev/min, psi), one of `units`.
        most: the largest plausible size in SI for a string, its hole, its mud and its rig; larger ones are refused as
            mistakes of units.
    """

    si: str
    units: dict[str, float]
    field: str
    most: float = LARGEST


def _same(size, *names):
    """Names of one unit."""
    return dict.fromkeys(names, size)


_LENGTHS = {"m": 1.0, "mm": units.mm, "cm": units.cm, "km": units.km,
            **_same(units.inch, "in", "inch", "inches", '"'), **_same(units.foot, "ft", "foot", "feet")}  # fmt: skip

#: The dimensions by name.
DIMENSIONS = {
    "length": Dimension("m", _LENGTHS, "ft", 1e6),
    "diameter": Dimension("m", _LENGTHS, "in", 1e6),
    "force": Dimension(
        "N", {"N": 1.0, "daN": 10.0, "kN": units.kN, "MN": units.MN, "kgf": units.kgf, "tf": 1e3 * units.kgf,
              **_same(units.lbf, "lbf", "lb", "lbs"), **_same(units.kip, "klbf", "klb", "klbs", "kip", "kips")},
        "klbf", 1e10),
    "moment": Dimension(
        "N m", {**_same(1.0, "N m", "Nm", "N-m"), **_same(units.kNm, "kN m", "kNm", "kN-m"),
                **{f"{k}{name}": (1e3 if k else 1.0) * units.ft_lbf for k in ("", "k")
                   for name in ("ft-lbf", "ft lbf", "ft-lb", "ft lb", "ft-lbs", "ft lbs", "lbf-ft", "lbf ft", "lb-ft",
                                "lb ft")}},
        "ft-lbf", 1e10),
    "density": Dimension(
        "kg/m^3", {"kg/m^3": 1.0, "kg/m3": 1.0,
                   **_same(units.g_per_cm3, "g/cm^3", "g/cm3", "sg", "SG", "t/m^3", "t/m3"),
                   **_same(units.ppg, "ppg", "lb/gal", "lbm/gal"),
                   **_same(units.pound / units.foot**3, "pcf", "lb/ft3", "lb/ft^3", "lbm/ft3")}, "ppg", 1e5),
    "mass per length": Dimension(
        "kg/m", {"kg/m": 1.0, **_same(units.lb_per_ft, "lb/ft", "lbm/ft", "ppf")}, "lb/ft", 1e6),
    "force per length": Dimension(
        "N/m", {"N/m": 1.0, "kN/m": units.kN, **_same(units.lbf_per_ft, "lbf/ft", "lb/ft", "ppf")}, "lbf/ft", 1e13),
    "speed": Dimension(
        "m/s", {"m/s": 1.0, "m/min": 1 / units.minute, **_same(1 / units.hour, "m/h", "m/hr"),
                "ft/min": units.foot / units.minute, **_same(units.foot / units.hour, "ft/h", "ft/hr")},
        "ft/min", 1e5),
    "wave speed": Dimension("m/s", {"m/s": 1.0, "km/s": units.km, "ft/s": units.foot}, "ft/s"),
    "rotation": Dimension("1/min", _same(1.0, "rpm", "RPM", "1/min"), "rpm", 1e6),
    "angular velocity": Dimension("rad/s", {"rad/s": 1.0, **_same(units.rpm, "rpm", "RPM", "1/min")}, "rpm", 1e5),
    "pressure": Dimension(
        "Pa", {**_same(1.0, "Pa", "N/m^2"), "kPa": units.kPa, "MPa": units.MPa, "GPa": units.GPa,
               "bar": units.bar, "psi": units.psi, "ksi": units.ksi, **_same(units.kPa, "kN/m^2", "kN/m2"),
               **_same(1e4 * units.kPa, "kN/cm^2", "kN/cm2"),
               **_same(units.MPa, "N/mm^2", "N/mm2", "N/mm²", "MN/m^2", "MN/m2"), "N/cm^2": 1e4,
               **_same(units.GPa, "kN/mm^2", "kN/mm2", "kN/mm²"), **_same(1.0, "N/m2", "N/m²")}, "psi", 1e15),
    "angle": Dimension("rad", {"rad": 1.0, **_same(units.deg, "deg", "°")}, "deg"),
    "angle per length": Dimension(
        "rad/m", {"rad/m": 1.0, "deg/30m": units.deg_per_30m, "deg/100ft": units.deg_per_100ft}, "deg/100ft"),
    "time": Dimension("s", {"s": 1.0, "ms": units.ms, "min": units.minute, "h": units.hour}, "s"),
    "rate": Dimension("1/s", {"1/s": 1.0}, "1/s", 1e6),
    "frequency": Dimension("Hz", {"Hz": 1.0}, "Hz"),
    "acceleration": Dimension("m/s^2", {"m/s^2": 1.0, "ft/s^2": units.foot}, "ft/s^2"),
    "mass": Dimension("kg", {"kg": 1.0, "t": units.tonne, "lbm": units.pound}, "lbm"),
    "moment of inertia": Dimension(
        "kg m^2", {"kg m^2": 1.0, "lbm ft^2": units.pound * units.foot**2}, "lbm ft^2", 1e10),
    "stiffness": Dimension(
        "N/m", {"N/m": 1.0, "kN/m": units.kN, "MN/m": units.MN, "N/mm": units.kN, "kN/mm": units.kN / units.mm,
                "lbf/ft": units.lbf_per_ft, "lbf/in": units.lbf / units.inch}, "lbf/ft", 1e13),
    "torsional stiffness": Dimension(
        "N m/rad", {"N m/rad": 1.0, "kN m/rad": units.kNm, "ft-lbf/rad": units.ft_lbf}, "ft-lbf/rad"),
    "stiffness per length": Dimension("N/m^2", {"N/m^2": 1.0, "MN/m^2": units.MN, "Pa": 1.0, "MPa": units.MPa,
                                                "GPa": units.GPa}, "N/m^2", 1e15),
    "damping": Dimension("N s/m", {"N s/m": 1.0, "kN s/m": units.kN, "lbf s/ft": units.lbf_per_ft}, "lbf s/ft"),
    "damping per length": Dimension("N s/m^2", {"N s/m^2": 1.0}, "N s/m^2", 1e10),
    "drag per length": Dimension("N s^2/m^3", {"N s^2/m^3": 1.0}, "N s^2/m^3"),
    "torsional damping": Dimension(
        "N m s/rad", {"N m s/rad": 1.0, "kN m s/rad": units.kNm, "ft-lbf s/rad": units.ft_lbf}, "ft-lbf s/rad", 1e10),
    "bending stiffness": Dimension(
        "N m^2", {"N m^2": 1.0, "kN m^2": units.kN, "MN m^2": units.MN, "lbf in^2": units.lbf * units.inch**2,
                  "lbf ft^2": units.lbf * units.foot**2}, "lbf in^2"),
    "energy": Dimension("J", {"J": 1.0, "kJ": 1e3, "MJ": 1e6, "ft-lbf": units.ft_lbf}, "ft-lbf"),
    "power": Dimension("W", {"W": 1.0, "kW": 1e3, "MW": 1e6, "hp": 550 * units.ft_lbf}, "hp"),
    "volume": Dimension("m^3", {"m^3": 1.0, "l": units.litre, "gal": units.gallon}, "gal"),
    "flow": Dimension(
        "m^3/s", {"m^3/s": 1.0, "l/s": units.litre, **_same(units.litre / units.minute, "l/min", "lpm", "L/min"),
                  **_same(units.gallon / units.minute, "gpm", "gal/min")}, "gpm", 10.0),
    "curvature": Dimension("1/m", {"1/m": 1.0, "1/ft": 1 / units.foot}, "1/ft"),
}  # fmt: skip
#: {SI unit: dimension}, the first one with that unit.
BY_UNIT = {dimension.si: name for name, dimension in reversed(DIMENSIONS.items())}
#: {SI unit: largest size}, see `Dimension.most`.
MOST = {dimension.si: dimension.most for dimension in DIMENSIONS.values() if dimension.most < LARGEST}
_VALUE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")
_FRACTION = re.compile(r"\s*(?:(\d+)(?:\s+|\s*-\s*))?(\d+)/([1-9]\d*)\s*(.*?)\s*$")  # 8 1/2 in, 8-1/2 in, 3/4 in
# Of 1000 kgf, 2000 lbf or 2240 lbf.
_TONS = ("t", "ton", "tons", "tonne", "tonnes")


def _like(unit, known):
    """'did you mean ...?' for a unit that differs in capital letters, is written out, or differs hardly at all."""
    same = [name for name in known if name.lower() == unit.lower()]
    same = same or [name for name in known if unit.startswith(name) and len(unit) > len(name) + 1 > 2]  # "minutes"
    same = same or get_close_matches(unit, list(known), 1, 0.9)
    return f"did you mean '{same[0]}'?" if len(same) == 1 else "expected a known unit"


def in_si(where, value, dimension):
    """A number in SI from text with a unit of a dimension, such as "5 in"; anything else as it is. Raises SceneError:
    no number, no unit, or one of another dimension."""
    if not isinstance(value, str):
        return value
    si, known, *_ = DIMENSIONS[dimension]
    found, parts = _VALUE.match(value), _FRACTION.match(value)
    if not found:
        raise SceneError(f"{where} = {value!r}: expected a number ({si}), or text such as '5 {list(known)[-1]}'")
    number, unit = float(found[1]), found[2]
    if parts:
        number, unit = int(parts[1] or 0) + int(parts[2]) / int(parts[3]), parts[4]
    if unit.startswith(","):
        raise SceneError(
            f"{where} = {value!r}: expected a number without commas, such as '12000.5 {list(known)[-1]}': decimals "
            "stand behind a point, and nothing between thousands"
        )
    if not unit or not math.isfinite(number):
        raise SceneError(f"{where} = {value!r}: expected a unit after the number, or the number without quotes ({si})")
    if unit in _TONS and dimension == "force":
        raise SceneError(f"{where} = {value!r}: expected tf, 1000 kgf, or kN or klbf: there are several tons")
    if unit not in known:
        others = [name for name, other in DIMENSIONS.items() if unit in other.units]
        name = next(name for name, other in DIMENSIONS.items() if other.units is known)  # a diameter is a length
        other = f"{unit} is a unit of {others[0]}, expected one of {name}" if others else _like(unit, known)
        raise SceneError(f"{where} = {value!r}: {other} ({', '.join(known)})")
    return number * known[unit]


def size_of(where, unit, dimension):
    """The size of a unit in SI by its name; SceneError where it is unknown."""
    known = DIMENSIONS[dimension].units
    if not isinstance(unit, str) or unit not in known:
        raise SceneError(f"{where} = {unit!r}: {nearest(unit, [name for name in known if name.isalpha()])}")
    return known[unit]


def length_unit_of(given):
    """The unit of length of text, such as "500 ft", or of a size (m); "m" where there is none."""
    if isinstance(given, str):
        found = _VALUE.match(given)
        return found[2] if found and found[2] in _LENGTHS else "m"
    return next((name for name, size in _LENGTHS.items() if math.isclose(size, given, rel_tol=1e-5)), "m")
