"""A survey as people have it: checked, or read from a .csv file."""

import csv
import math
import re
import warnings
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import finite_array, instance, positive, refuse
from cosserat_fenicsx.errors import SceneError, SceneWarning, nearest

_FULL = math.radians(360)
# Doglegs (rad) above this are refused: the plane of the arc would be that of rounding errors.
_MOST_DOGLEG = math.pi - 1e-6


def checked_survey(md, inc, azi, degrees):
    """Measured depths (m), inclinations and azimuths (rad) as arrays, see `WellPath.from_survey`."""
    who = "WellPath"
    instance(who, "degrees", degrees, (bool, type(None)), "True (degrees), False (radians) or None")
    columns = {}
    for name, values, unit in (("md", md, "m"), ("inc", inc, "degrees or radians"), ("azi", azi, "degrees or radians")):
        columns[name] = finite_array(who, name, values, f"finite numbers ({unit}), one a station")
        if columns[name].ndim != 1 or len(columns[name]) < 2:
            refuse(who, name, values, f"at least two stations ({unit})")
        if len(columns[name]) != len(columns["md"]):
            refuse(who, name, values, f"{len(columns['md'])} numbers, as many as there are measured depths")
    md, inc, azi = columns.values()
    _check_depths(md)
    if degrees is not False:
        _doubt_degrees(inc, azi, degrees)
        inc, azi = np.radians(inc), np.radians(azi)
    unit, one = ("rad", 1.0) if degrees is False else ("degrees", math.radians(1))
    for name, values, least, most in (("inc", inc, 0.0, math.pi), ("azi", azi, -_FULL, _FULL)):
        bad = np.flatnonzero((values < least) | (values > most * (1 + 1e-12)))
        if len(bad):
            refuse(who, f"{name}[{bad[0]}]", float(columns[name][bad[0]]),
                   f"{least / one:g} to {most / one:.6g} ({unit}), at md = {md[bad[0]]:g} m")  # fmt: skip
    inc = np.minimum(inc, math.pi)
    _check_doglegs(md, inc, azi)
    return md, inc, azi


def _check_depths(md):
    if md[0] != 0:
        refuse(
            "WellPath", "md[0]", float(md[0]), "0 m: add the station (0, 0, azimuth) where the well starts vertically"
        )
    bad = np.flatnonzero(np.diff(md) <= 0)
    if len(bad):
        i = bad[0] + 1
        refuse(
            "WellPath", f"md[{i}]", float(md[i]), f"more than the station before, {md[i - 1]:g} m (ascending depths)"
        )


def _doubt_degrees(inc, azi, degrees):
    """Refuse angles that are radians by all appearance, or warn where the user says that they are degrees."""
    if not 0 < inc.max() <= math.pi or np.abs(azi).max() > _FULL:
        return
    text = (
        f"all inclinations are below {inc.max():.4g} and all azimuths within +-{max(np.abs(azi).max(), 0):.4g}: these "
        "look like radians"
    )
    if degrees:
        warnings.warn(f"WellPath: {text}; they are taken as degrees, as degrees=True says", SceneWarning, stacklevel=5)
    else:
        raise SceneError(f"WellPath: {text}. Say degrees=False if they are, degrees=True if they are not")


def _check_doglegs(md, inc, azi):
    half = np.sin(np.diff(inc) / 2) ** 2 + np.sin(inc[:-1]) * np.sin(inc[1:]) * np.sin(np.diff(azi) / 2) ** 2
    bad = np.flatnonzero(half > math.sin(_MOST_DOGLEG / 2) ** 2)
    if len(bad):
        raise SceneError(
            f"WellPath: the hole turns by 180 degrees between md = {md[bad[0]]:g} and {md[bad[0] + 1]:g} m: expected "
            "less (no arc is defined by two opposite directions)"
        )


def read_columns(file, md, inc, azi, length_unit):
    """Three columns of a .csv file, see `WellPath.from_csv`; measured depths in m."""
    file = Path(file)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except OSError as problem:
        raise SceneError(f"{file}: cannot be read ({problem.strerror}): expected a survey as .csv") from None
    except UnicodeDecodeError as problem:
        raise SceneError(f"{file}: not UTF-8 ({problem.reason} at byte {problem.start}): save it as UTF-8") from None
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) < 3:
        raise SceneError(f"{file}: {len(lines)} lines: expected a row of names, and at least two stations")
    separator = max(",;\t", key=lines[0].count)
    heading, *rows = csv.reader(lines, delimiter=separator)
    names = [re.sub(r"[\[(].*", "", name).strip().lower() for name in heading]
    columns = []
    for name in (md, inc, azi):
        if name.strip().lower() not in names:
            raise SceneError(f"{file}: no column '{name}' in {', '.join(heading)}; {nearest(name.lower(), names)}")
        columns.append(names.index(name.strip().lower()))
    if length_unit is None:
        if re.search(r"[\[( ](ft|feet|foot)\b", heading[columns[0]].lower()):
            raise SceneError(f"{file}: '{heading[columns[0]]}' says feet: expected length_unit=units.foot with it")
        length_unit = 1.0
    length_unit = positive("WellPath.from_csv", "length_unit", length_unit, "m")
    values = []
    for i, row in enumerate(rows, start=2):
        try:
            values.append([float(row[column]) for column in columns])
        except (ValueError, IndexError):
            raise SceneError(
                f"{file}: line {i}, {separator.join(row)!r}: expected numbers in {md}, {inc}, {azi}"
            ) from None
    depth, inclination, azimuth = np.array(values).T
    return depth * length_unit, inclination, azimuth
