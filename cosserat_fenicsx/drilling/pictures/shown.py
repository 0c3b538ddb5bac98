"""What charts of a drill-string in motion share: units of the field, times that are shown, titles."""

import numpy as np

from cosserat_fenicsx.checks import finite_array, refuse
from cosserat_fenicsx.errors import SceneError

#: Factors from SI to the units of charts, and these.
RPM, KILO = 30 / np.pi, 1e-3
#: {name: (words, unit, factor from SI, whether it has values of either sign)} of what maps show.
SHOWN = {
    "speed": ("speed of rotation", "rpm", RPM, False),
    "torque": ("torque", "kN m", KILO, True),
    "angle": ("turns", "1", 1 / (2 * np.pi), False),
    "tension": ("tension", "kN", KILO, True),
    "displacement": ("displacement downwards", "mm", 1e3, True),
    "velocity": ("velocity downwards", "m/s", 1.0, True),
}
DRIVE, BIT, GREY = "tab:blue", "tab:red", "0.45"


def times_between(where, times, between):
    """A slice of ascending times (s) from which to which is shown.

    Raises:
        SceneError: fewer than two of them, or no two ascending times.
    """
    if len(times) < 2:
        raise SceneError(f"{where}: expected a motion with at least two times, this one has {len(times)}")
    if between is None:
        return slice(None)
    ends = finite_array(where, "between", between, "two times (s), such as (60, 120)")
    if ends.shape != (2,) or not ends[0] < ends[1]:
        refuse(where, "between", between, "two times (s), ascending")
    rows = slice(*np.searchsorted(times, ends + [-1e-9, 1e-9]))
    if rows.stop - rows.start < 2:
        refuse(where, "between", between, f"times of the motion, which ends at {times[-1]:g} s")
    return rows


def turns(history):
    """Whether drive or bit turn."""
    return bool(np.any(history.drive_speed) or np.any(history.bit_speed))


def title_of(history):
    """What moves and how, for titles."""
    drive = history.scene.drive
    control = type(drive.control).__name__
    asked = f" at {drive.signal()(0.0) * RPM:.4g} rpm" if drive.signal().constant and drive.speed is not None else ""
    bit = history.scene.bit
    at = "bit off bottom" if bit is None else f"{type(bit.law).__name__} bit"
    weight = f", {bit.weight / 1e3:.4g} kN on bit" if bit is not None and bit.weight else ""
    return f"{history.model}: {control} drive{asked}, {at}{weight}"
