"""Numbers with units, as text: "5 in", "10.2 ppg", "60 klbf", "12 kft-lbf"; a number without one is SI."""

import math
import re

from cosserat_fenicsx import units
from cosserat_fenicsx.errors import SceneError, nearest


def _same(size, *names):
    """Names of one unit."""
    return dict.fromkeys(names, size)


#: {dimension: (SI unit, {unit: its size in SI})}.
DIMENSIONS = {
    "length": ("m", {"m": 1.0, "mm": units.mm, "cm": units.cm, "km": units.km,
                     **_same(units.inch, "in", "inch", "inches", '"'), **_same(units.foot, "ft", "foot", "feet")}),
    "force": ("N", {"N": 1.0, "daN": 10.0, "kN": units.kN, "MN": units.MN, "kgf": units.kgf, "tf": 1e3 * units.kgf,
                    **_same(units.lbf, "lbf", "lb", "lbs"), **_same(units.kip, "klbf", "klb", "klbs", "kip", "kips")}),
    "moment": ("N m", {**_same(1.0, "N m", "Nm", "N-m"), **_same(units.kNm, "kN m", "kNm", "kN-m"),
                       **{f"{k}{name}": (1e3 if k else 1.0) * units.ft_lbf for k in ("", "k")
                          for name in ("ft-lbf", "ft lbf", "ft-lb", "ft lb", "ft-lbs", "lbf-ft", "lbf ft", "lb-ft",
                                       "lb ft")}}),
    "density": ("kg/m^3", {"kg/m^3": 1.0, "kg/m3": 1.0, **_same(units.g_per_cm3, "g/cm^3", "g/cm3", "sg", "SG"),
                           **_same(units.ppg, "ppg", "lb/gal", "lbm/gal")}),
    "mass per length": ("kg/m", {"kg/m": 1.0, **_same(units.lb_per_ft, "lb/ft", "lbm/ft", "ppf")}),
    "force per length": ("N/m", {"N/m": 1.0, "kN/m": units.kN, **_same(units.lbf_per_ft, "lbf/ft", "lb/ft", "ppf")}),
    "speed": ("m/s", {"m/s": 1.0, "m/min": 1 / units.minute, **_same(1 / units.hour, "m/h", "m/hr"),
                      "ft/min": units.foot / units.minute, **_same(units.foot / units.hour, "ft/h", "ft/hr")}),
    "rotation": ("1/min", _same(1.0, "rpm", "RPM", "1/min")),
    "pressure": ("N/m^2", {"N/m^2": 1.0, "Pa": 1.0, "MPa": units.MPa, "GPa": units.GPa, "psi": units.psi,
                           "ksi": units.ksi}),
    "angle per length": ("rad/m", {"rad/m": 1.0, "deg/30m": units.deg_per_30m, "deg/100ft": units.deg_per_100ft}),
}  # fmt: skip
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")
_FRACTION = re.compile(r"\s*(?:(\d+)(?:\s+|\s*-\s*))?(\d+)/([1-9]\d*)\s*(.*?)\s*$")  # 8 1/2 in, 8-1/2 in, 3/4 in
# Of 1000 kgf, 2000 lbf or 2240 lbf.
_TONS = ("t", "ton", "tons", "tonne", "tonnes")


def in_si(where, value, dimension, dimensions=None):
    """A number in SI from a number in SI, or from text with a unit of a dimension.

    Args:
        dimensions: those that are known, as `DIMENSIONS`, which is the default.

    Raises:
        SceneError: no number, no unit, or one of another dimension.
    """
    if not isinstance(value, str):
        return value
    dimensions = dimensions or DIMENSIONS
    si, known = dimensions[dimension]
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
        others = [name for name, (_, names) in dimensions.items() if unit in names]
        other = f"{unit} is a unit of {others[0]}, expected one of {dimension}" if others else nearest(unit, known)
        raise SceneError(f"{where} = {value!r}: {other} ({', '.join(known)})")
    return number * known[unit]


def size_of(where, unit, dimension):
    """The size of a unit in SI by its name.

    Raises:
        SceneError: an unknown one.
    """
    known = DIMENSIONS[dimension][1]
    if not isinstance(unit, str) or unit not in known:
        raise SceneError(f"{where} = {unit!r}: {nearest(unit, [name for name in known if name.isalpha()])}")
    return known[unit]
