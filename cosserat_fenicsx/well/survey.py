"""A survey as people have it: checked, or read from a .csv file."""

import csv
import math
import os
import re
from pathlib import Path

import numpy as np

from cosserat_fenicsx import units
from cosserat_fenicsx.checks import finite_array, instance, positive, refuse, text_of, warn
from cosserat_fenicsx.dimensions import size_of
from cosserat_fenicsx.errors import SceneError, nearest

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
# Largest measured depth, and least distance of stations, m.
_DEEPEST, _APART = 1e6, 1e-6
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
    if md[-1] > _DEEPEST:
        refuse("WellPath", "md[-1]", float(md[-1]), f"at most {_DEEPEST:g} m")
    bad = np.flatnonzero(np.diff(md) < _APART)
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
        warn(f"WellPath: {text}; they are taken as degrees, as degrees=True says")
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
    who = "WellPath.from_csv"
    file = Path(instance(who, "file", file, str | os.PathLike, "the name of a .csv file"))
    for field, name in (("md", md), ("inc", inc), ("azi", azi)):
        instance(who, field, name, str, "the name of a column")
    whole = text_of(file, "a survey as .csv")
    lines = [(i, line) for i, line in enumerate(whole.splitlines(), start=1) if line.strip()]
    first, separator, heading, columns = _heading(file, lines, (md, inc, azi))
    says = [_split(heading[column])[1] for column in columns]
    values = []
    for k, (i, line) in enumerate(lines[first + 1 :]):
        row = _cells(file, i, line, separator)
        cells = [row[column].strip() if column < len(row) else "" for column in columns]
        if k == 0 and all(cell.lower() in _UNITS for cell in cells):
            says = [cell.lower() for cell in cells]
            continue
        try:
            if any(cell.strip() for cell in row[len(heading) :]):
                raise ValueError
            values.append([_number(cell) for cell in cells])
        except ValueError:
            point = any("," in cell for cell in row) or len(row) > len(heading)
            hint = "; decimals stand behind a point, as in 10.5" if point else ""
            raise SceneError(
                f"{file}: line {i}, {line!r:.100}: expected numbers in {', '.join(heading[x] for x in columns)}, and "
                f"no more columns than names{hint}"
            ) from None
    if len(values) < 2:
        raise SceneError(f"{file}: {len(values)} stations below the row of names, expected at least two")
    depth, inclination, azimuth = np.array(values).T
    depth = depth * _length_unit(file, heading[columns[0]], says[0], length_unit)
    return depth, inclination, azimuth, _degrees(file, [heading[x] for x in columns[1:]], says[1:], degrees)


def _cells(file, i, line, separator):
    """The cells of line i."""
    try:
        return next(csv.reader([line], delimiter=separator))
    except csv.Error as problem:
        raise SceneError(f"{file}: line {i} is no row of a .csv file ({problem})") from None


def _heading(file, lines, wanted):
    """Of the row of names: its index in `lines`, the separator, the names, and the columns of those that are wanted."""
    likely = None
    for k, (i, line) in enumerate(lines):
        separator = max(",;\t", key=line.count)
        heading = _cells(file, i, line, separator)
        columns = [_columns(heading, name) for name in wanted]
        if all(columns):
            return k, separator, heading, _one_each(file, i, heading, wanted, columns)
        if sum(_is_number(cell) for cell in heading) > 1:
            break
        if likely is None or len(heading) > len(likely):
            likely = heading
    if likely is None or len(likely) < 2:
        raise SceneError(f"{file}: expected a row of names, such as 'MD (m),Inc (deg),Azi (deg)', above the stations")
    known = [_split(name)[0] for name in likely]
    missing = next(name for name in wanted if not _columns(likely, name))
    raise SceneError(
        f"{file}: no column '{missing}' in {', '.join(likely):.500}: {nearest(missing.lower(), known)}. Expected the "
        "names of the columns of measured depth, inclination and azimuth: columns = ['...', '...', '...'] in a scene "
        "file, md=, inc=, azi= in Python"
    )


def _one_each(file, i, heading, wanted, columns):
    """The column of each name, of lists of those that have it."""
    for name, found in zip(wanted, columns, strict=True):
        if len(found) > 1:
            raise SceneError(
                f"{file}: line {i}: columns {' and '.join(str(x + 1) for x in found)} are both named '{name}' "
                f"({', '.join(heading[x].strip() for x in found)}): expected one, or that columns (in Python md, inc, "
                "azi) say which, with its unit"
            )
    one = [found[0] for found in columns]
    if len(set(one)) < len(one):
        raise SceneError(f"{file}: {', '.join(wanted)}: expected three columns, each of another name")
    return one


def _columns(heading, name):
    """The columns of a name: written as it is there, else without its unit, else under another usual name."""
    whole, wanted = [" ".join(x.lower().split()) for x in heading], " ".join(name.lower().split())
    names, short = [_split(x)[0] for x in heading], _split(name)[0]
    same = next((group for group in _NAMES if short in group), ())
    for found in ([x == wanted for x in whole], [x == short for x in names]):
        if any(found):
            return np.flatnonzero(found).tolist()
    usual = [i for i, x in enumerate(names) if x in same]
    return usual if len(usual) == 1 else []


def _split(heading):
    """Name in lower case, and unit ("" where it has none) of the heading of a column: "MD (ft)", "inc_deg", "MD"."""
    name, bracket, unit = re.match(r"([^\[(]*)([\[(]?)([^\])]*)", heading.replace("_", " ").strip().lower()).groups()
    words = name.split()
    if bracket:
        return " ".join(words), "ft" if unit.startswith("ft") else unit.strip()  # feet below something: "ftKB"
    last = words.pop() if len(words) > 1 and words[-1] in _UNITS else ""
    return " ".join(words), last


def _number(cell):
    if "_" in cell or not cell.isascii():  # Python takes 10_00 for a number, and digits of all scripts
        raise ValueError
    return float(cell)


def _is_number(cell):
    try:
        return math.isfinite(_number(cell))
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
