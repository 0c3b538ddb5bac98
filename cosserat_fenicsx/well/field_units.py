"""Numbers with units, as text: "5 in", "10.2 ppg", "60 klbf", "12 kft-lbf"; a number without one is SI."""

import math
import re

from cosserat_fenicsx import units
from cosserat_fenicsx.errors import SceneError, nearest

#: {dimension: (SI unit, {unit: its size in SI})}.
DIMENSIONS = {
    "length": ("m", {"m": 1.0, "mm": units.mm, "cm": units.cm, "km": units.km, "in": units.inch, '"': units.inch,
                     "ft": units.foot}),
    "force": ("N", {"N": 1.0, "kN": units.kN, "MN": units.MN, "kgf": units.kgf, "lbf": units.lbf, "klbf": units.kip,
                    "kip": units.kip}),
    "moment": ("N m", {"N m": 1.0, "Nm": 1.0, "kN m": units.kNm, "kNm": units.kNm, "ft-lbf": units.ft_lbf,
                       "ft lbf": units.ft_lbf, "kft-lbf": 1e3 * units.ft_lbf}),
    "density": ("kg/m^3", {"kg/m^3": 1.0, "kg/m3": 1.0, "g/cm^3": units.g_per_cm3, "g/cm3": units.g_per_cm3,
                           "sg": units.g_per_cm3, "ppg": units.ppg}),
    "mass per length": ("kg/m", {"kg/m": 1.0, "lb/ft": units.lb_per_ft}),
    "force per length": ("N/m", {"N/m": 1.0, "kN/m": units.kN, "lbf/ft": units.lbf_per_ft}),
    "speed": ("m/s", {"m/s": 1.0, "m/min": 1 / units.minute, "m/h": 1 / units.hour, "ft/min": units.foot / units.minute,
                      "ft/h": units.foot / units.hour}),
    "rotation": ("1/min", {"rpm": 1.0, "1/min": 1.0}),
    "pressure": ("N/m^2", {"N/m^2": 1.0, "Pa": 1.0, "MPa": units.MPa, "GPa": units.GPa, "psi": units.psi,
                           "ksi": units.ksi}),
    "angle per length": ("rad/m", {"rad/m": 1.0, "deg/30m": units.deg_per_30m, "deg/100ft": units.deg_per_100ft}),
}  # fmt: skip
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")


def in_si(where, value, dimension):
    """A number in SI from a number in SI, or from text with a unit of a dimension.

    Raises:
        SceneError: no number, no unit, or one of another dimension.
    """
    if not isinstance(value, str):
        return value
    si, known = DIMENSIONS[dimension]
    found = _NUMBER.match(value)
    if not found:
        raise SceneError(f"{where} = {value!r}: expected a number ({si}), or text such as '{_example(known)}'")
    number, unit = float(found[1]), found[2]
    if not unit or not math.isfinite(number):
        raise SceneError(f"{where} = {value!r}: expected a unit after the number, or the number without quotes ({si})")
    if unit not in known:
        others = [name for name, (_, names) in DIMENSIONS.items() if unit in names]
        other = f"{unit} is a unit of {others[0]}, expected one of {dimension}" if others else nearest(unit, known)
        raise SceneError(f"{where} = {value!r}: {other} ({', '.join(known)})")
    return number * known[unit]


def _example(known):
    return f"5 {list(known)[-1]}"
