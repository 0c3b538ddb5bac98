"""A survey as people have it: checked, or read from a .csv file."""

import csv
import math
import re
import warnings
from pathlib import Path

import numpy as np

from cosserat_fenicsx import units
from cosserat_fenicsx.checks import finite_array, instance, positive, refuse
from cosserat_fenicsx.errors import SceneError, SceneWarning, nearest
from cosserat_fenicsx.well.field_units import size_of

_FULL = math.radians(360)
# Names of the same column in files.
_NAMES = (
    ("md", "measured depth", "meas depth", "meas. depth", "depth md", "md depth"),
    ("inc", "incl", "inclination"),
    ("azi", "az", "azim", "azimuth"),
)
# Units in headings: of lengths, m; of angles, whether it is a degree.
_LENGTHS = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet"), units.foot),
}
_ANGLES = {
    **dict.fromkeys(("deg", "degree", "degrees", "\N{DEGREE SIGN}"), True),
    **dict.fromkeys(("rad", "radian", "radians"), False),
}
_UNITS = {*_LENGTHS, *_ANGLES}
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
        raise SceneError(
            f"WellPath: {text}. Say degrees=False if they are, degrees=True if they are not (in a scene file "
            "degrees = false and degrees = true)"
        )


def _check_doglegs(md, inc, azi):
    half = np.sin(np.diff(inc) / 2) ** 2 + np.sin(inc[:-1]) * np.sin(inc[1:]) * np.sin(np.diff(azi) / 2) ** 2
    bad = np.flatnonzero(half > math.sin(_MOST_DOGLEG / 2) ** 2)
    if len(bad):
        raise SceneError(
            f"WellPath: the hole turns by 180 degrees between md = {md[bad[0]]:g} and {md[bad[0] + 1]:g} m: expected "
            "less (no arc is defined by two opposite directions)"
        )


def read_columns(file, md, inc, azi, degrees, length_unit):
    """Three columns of a .csv file, see `WellPath.from_csv`: depths (m), inclinations, azimuths; and its `degrees`.

    What stands above the row of names is passed over; units may follow the names, or stand in a row below them.
    """
    file = Path(file)
    lines = [(i, line) for i, line in enumerate(_text_of(file).splitlines(), start=1) if line.strip()]
    first, separator, heading, columns = _heading(file, lines, (md, inc, azi))
    says = [_split(heading[column])[1] for column in columns]
    values = []
    for k, (i, line) in enumerate(lines[first + 1 :]):
        row = _cells(line, separator)
        cells = [row[column].strip() if column < len(row) else "" for column in columns]
        if k == 0 and all(cell.lower() in _UNITS for cell in cells):
            says = [cell.lower() for cell in cells]
            continue
        try:
            if any(cell.strip() for cell in row[len(heading) :]):
                raise ValueError
            values.append([float(cell) for cell in cells])
        except ValueError:
            point = any("," in cell for cell in row) or len(row) > len(heading)
            hint = "; decimals stand behind a point, as in 10.5" if point else ""
            raise SceneError(
                f"{file}: line {i}, {line!r}: expected numbers in {', '.join(heading[x] for x in columns)}, and no "
                f"more columns than names{hint}"
            ) from None
    if len(values) < 2:
        raise SceneError(f"{file}: {len(values)} stations below the row of names, expected at least two")
    depth, inclination, azimuth = np.array(values).T
    depth = depth * _length_unit(file, heading[columns[0]], says[0], length_unit)
    return depth, inclination, azimuth, _degrees(file, [heading[x] for x in columns[1:]], says[1:], degrees)


def _text_of(file):
    try:
        return file.read_text(encoding="utf-8-sig")
    except OSError as problem:
        raise SceneError(f"{file}: cannot be read ({problem.strerror}): expected a survey as .csv") from None
    except UnicodeDecodeError as problem:
        raise SceneError(f"{file}: not UTF-8 ({problem.reason} at byte {problem.start}): save it as UTF-8") from None


def _cells(line, separator):
    return next(csv.reader([line], delimiter=separator))


def _heading(file, lines, wanted):
    """Of the row of names: its index in `lines`, the separator, the names, and the columns of those that are wanted."""
    likely = None
    for k, (_, line) in enumerate(lines):
        separator = max(",;\t", key=line.count)
        heading = _cells(line, separator)
        columns = [_column(heading, name) for name in wanted]
        if None not in columns:
            return k, separator, heading, columns
        if sum(_is_number(cell) for cell in heading) > 1:
            break
        if likely is None or len(heading) > len(likely):
            likely = heading
    if likely is None or len(likely) < 2:
        raise SceneError(f"{file}: expected a row of names, such as 'MD (m),Inc (deg),Azi (deg)', above the stations")
    known = [_split(name)[0] for name in likely]
    missing = next(name for name in wanted if _column(likely, name) is None)
    raise SceneError(
        f"{file}: no column '{missing}' in {', '.join(likely)}: {nearest(missing.lower(), known)}. Expected the names "
        "of the columns of measured depth, inclination and azimuth: columns = ['...', '...', '...'] in a scene file, "
        "md=, inc=, azi= in Python"
    )


def _column(heading, name):
    """The column of a name, or of another usual one for the same; None where there is none, or more than one."""
    names, name = [_split(x)[0] for x in heading], _split(name)[0]
    if name in names:
        return names.index(name)
    same = next((group for group in _NAMES if name in group), ())
    found = [i for i, x in enumerate(names) if x in same]
    return found[0] if len(found) == 1 else None


def _split(heading):
    """Name in lower case, and unit ("" where it has none) of the heading of a column: "MD (ft)", "inc_deg", "MD"."""
    name, bracket, unit = re.match(r"([^\[(]*)([\[(]?)([^\])]*)", heading.replace("_", " ").strip().lower()).groups()
    words = name.split()
    if bracket:
        return " ".join(words), "ft" if unit.startswith("ft") else unit.strip()  # feet below something: "ftKB"
    last = words.pop() if len(words) > 1 and words[-1] in _UNITS else ""
    return " ".join(words), last


def _is_number(cell):
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _length_unit(file, heading, says, given):
    """The unit (m) of measured depths: as given, or as the heading says."""
    if isinstance(given, str):
        given = size_of("WellPath.from_csv.length_unit", given, "length")
    says = _LENGTHS.get(says)
    if given is not None:
        given = positive("WellPath.from_csv", "length_unit", given, "m")
        if says is not None and not math.isclose(says, given, rel_tol=1e-3):
            raise SceneError(
                f"{file}: '{heading}' says a unit of {says:g} m, and length_unit {given:g} m: expected one of them, or "
                "none given"
            )
    return given or says or 1.0


def _degrees(file, headings, says, given):
    """Whether angles are in degrees, see `WellPath.from_survey`."""
    told = {_ANGLES[unit] for unit in says if unit in _ANGLES} | ({given} - {None})
    if len(told) > 1:
        raise SceneError(
            f"{file}: '{headings[0]}', '{headings[1]}' and degrees = {given} contradict each other: expected one unit"
        )
    return False if told == {False} else given
