"""Dimensions of numbers: their units in SI and in the oil field, and text with a unit, such as "20 klbf", as numbers.

A number without a unit is in SI.
"""

import math
import re
from difflib import get_close_matches
from typing import NamedTuple

from cosserat_fenicsx import units
from cosserat_fenicsx.errors import SceneError, nearest

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
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")
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
    """A number in SI from text with a unit of a dimension, such as "5 in"; anything else as it is.

    Raises:
        SceneError: no number, no unit, or one of another dimension.
    """
    if not isinstance(value, str):
        return value
    si, known, *_ = DIMENSIONS[dimension]
    found, parts = _NUMBER.match(value), _FRACTION.match(value)
    if not found:
        raise SceneError(f"{where} = {value!r}: expected a number ({si}), or text such as '5 {list(known)[-1]}'")
    number, unit = float(found[1]), found[2]
    if parts:
        number, unit = int(parts[1] or 0) + int(parts[2]) / int(parts[3]), parts[4]
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
