"""What charts of a drill-string in motion share: units of the field, times that are shown, titles."""

import numpy as np

from cosserat_fenicsx.checks import finite_array, refuse
from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.top_drive import PI
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
# Bands of a chart of a long run.
_BANDS = 400


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


def bands(times, *lines):
    """(middles, [(least, largest)]) of lines over time between the limits of equal numbers of rows, for charts of long
    runs, whose oscillations would become a block of one colour."""
    edges = np.linspace(0, len(times), _BANDS + 1).astype(int)[:-1]
    ends = np.append(edges[1:], len(times)) - 1
    extremes = [(np.minimum.reduceat(line, edges), np.maximum.reduceat(line, edges)) for line in lines]
    return (times[edges] + times[ends]) / 2, extremes


def swings(values):
    """How often values oscillate, about: half the crossings of the middle of their range."""
    above = values > (np.nanmin(values) + np.nanmax(values)) / 2
    return int((above[1:] != above[:-1]).sum()) // 2


def advance_unit(metres):
    """(unit, factor from m) of a way: mm up to a metre."""
    return ("m", 1.0) if np.nan_to_num(np.abs(metres)).max(initial=0.0) >= 1 else ("mm", 1e3)


def alias(history):
    """Words where profiles along the string are further apart than half the period of stick-slip; else ""."""
    if len(history) <= 5 or len(history.profile_times) < 3:
        return ""
    apart, period = float(np.diff(history.profile_times).max()), history.stick_slip().period
    if not apart > period / 2:  # also where there is none
        return ""
    return (f"profiles are {apart:.3g} s apart, and the period of stick-slip is {period:.3g} s: maps and films show a "
            f"pattern that is not there; profile_every = {period / 10:.2g} (s) avoids it")  # fmt: skip


def turns(history):
    """Whether drive or bit turn."""
    return bool(np.any(history.drive_speed) or np.any(history.bit_speed))


def title_of(history):
    """What moves and how, for titles."""
    drive = history.scene.drive
    control = type(drive.control).__name__
    if isinstance(drive.control, PI):
        control = f"{_impedances(history)} drive"
    else:
        control += " drive"
    asked = f" at {drive.signal()(0.0) * RPM:.4g} rpm" if drive.signal().constant and drive.speed is not None else ""
    bit = history.scene.bit
    at = "bit off bottom" if bit is None else f"{type(bit.law).__name__} bit"
    weight = f", {bit.weight / 1e3:.4g} kN on bit" if bit is not None and bit.weight else ""
    return f"{history.model}: {control}{asked}, {at}{weight}"


def _impedances(history):
    """A PI control by its gain over the impedance of the string: 1 of SoftTorque, 4 of SoftSpeed."""
    scene, Kp = history.scene, history.scene.drive.control.Kp
    if isinstance(scene.string, Discs):
        return f"PI (Kp = {Kp:.4g} N m s/rad)"
    return f"PI (Kp = {Kp / scene.segments[0].torsional_impedance:.3g} impedances)"
