"""Surveys from files: three columns of a .csv file or of a sheet of a workbook, found by their names, with their units.

A sheet becomes text with tabs between its cells, so both are read by the same functions.
"""

import csv
import io
import math
import os
import re
import warnings
from pathlib import Path

import numpy as np

from cosserat_fenicsx import checks, units
from cosserat_fenicsx.checks import bytes_of, instance, positive, text_of, warn
from cosserat_fenicsx.quantities import length_unit_of, size_of
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.results.result import import_library

# Names of the same column in files.
_NAMES = (
    ("md", "measured depth", "meas depth", "depth md", "md depth", "hole depth", "survey depth"),
    ("inc", "incl", "inclination", "drift angle"),
    ("azi", "az", "azm", "azim", "azimuth", "azi true", "azi grid", "azimuth true", "azimuth grid",
     "azimuth true north", "azimuth grid north"),
)
_TVD = ("tvd", "true vertical depth", "vertical depth")
# Units in headings: of lengths, m; of angles, whether it is a degree.
_LENGTHS = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet"), units.foot),
    **dict.fromkeys(("usft", "ftus"), 1200 / 3937),  # of the United States' surveys
}
_ANGLES = {
    **dict.fromkeys(("deg", "degree", "degrees", "\N{DEGREE SIGN}"), True),
    **dict.fromkeys(("rad", "radian", "radians"), False),
}
_UNITS = {*_LENGTHS, *_ANGLES}
# Depths without a unit that are larger, m, are probably in feet: few wells are as long.
_DEEP = 5000.0
# The arguments that give the units of the columns where headings do not.
_SAY = ("length_unit, in m or by its name", "degrees (True or False)", "degrees (True or False)")
# Other texts in brackets: units followed by words, such as the datum of depths, and the north of azimuths.
_SPELT = (
    (r"(us|u\.s\.)[ -]*(survey)?[ -]*(ft|foot|feet)|survey (ft|foot|feet)", "usft"),
    (r"ft(?!us)", "ft"),
    (r"m(et(er|re)s?)?(?![a-z])|m(r?kb|rt|brt|md|bdf)\b", "m"),
    (r"deg|\N{DEGREE SIGN}", "deg"),
    (r"(true|grid|magnetic|mag|[tgm]n?)\b", ""),
)


def read_columns(who, file, names, degrees, length_unit, sheet=None):
    """Three columns of a survey in a file: depths (m), inclinations, azimuths; its `degrees`, and the unit of depths
    there. who: "WellPath.from_csv" or "WellPath.from_xlsx", which decides how the file is read, and has the arguments;
    names: of the columns of measured depth, inclination and azimuth."""
    workbook = who == "WellPath.from_xlsx"
    file = Path(
        instance(who, "file", file, str | os.PathLike, f"the name of {'an .xlsx' if workbook else 'a .csv'} file")
    )
    for field, name in zip(("md", "inc", "azi"), names, strict=True):
        instance(who, field, name, str, "the name of a column")
    whole = _sheet_of(who, file, sheet) if workbook else text_of(file, "a survey as .csv")
    lines = [(i, line) for i, line in enumerate(whole.splitlines(), start=1) if line.strip()]
    first, separator, heading, columns = _heading(file, lines, names, "\t" if workbook else ",;\t")
    says = [_split(heading[column])[1] for column in columns]
    deep = next((i for i, name in enumerate(heading) if _split(name)[0] in _TVD), None)
    vertical, tvd = "" if deep is None else _split(heading[deep])[1], []
    values = []
    stations = [(i, line) for i, line in lines[first + 1 :] if not line.lstrip(' "').startswith("#")]  # comments
    for k, (i, line) in enumerate(stations):
        row = _cells(file, i, line, separator)
        cells = [row[column].strip() if column < len(row) else "" for column in columns]
        bare = [cell.lower().strip("()[]") for cell in cells]
        if k == 0 and all(cell in _UNITS for cell in bare):
            says = bare
            if deep is not None:
                vertical = row[deep].strip().lower().strip("()[]") if deep < len(row) else ""
            continue
        try:
            if any(cell.strip() for cell in row[len(heading) :]):
                raise ValueError
            cells = [_with_point(cell, separator) for cell in cells]
            told = _with_point(row[deep].strip(), separator) if deep is not None and deep < len(row) else ""
            tvd.append(float(told) if _is_number(told) else math.nan)
            values.append([*map(_number, cells[:2]), _number(cells[2] or "nan")])  # of vertical stations: no azimuth
        except ValueError:
            point = any("," in cell for cell in row) or len(row) > len(heading)
            hint = "; decimals stand behind a point, as in 10.5" if point else ""
            if re.search(r"[^\W\d]", cells[0]):  # "Tie-in", "Projected to TD"
                hint = "; where the line is no station, remove it or begin it with #, as a comment"
            raise SceneError(
                f"{file}: line {i}, {line!r:.100}: expected numbers in {', '.join(heading[x] for x in columns)}, and "
                f"no more columns than names{hint}"
            ) from None
    if len(values) < 2:
        raise SceneError(f"{file}: {len(values)} stations below the row of names, expected at least two")
    depth, inclination, azimuth = np.array(values).T
    for column, unit, known, given, field in zip(
        columns, says, (_LENGTHS, _ANGLES, _ANGLES), (length_unit, degrees, degrees), _SAY, strict=True
    ):
        if unit and unit not in known and given is None:
            raise SceneError(
                f"{file}: '{heading[column].strip()}': unit '{unit}' is not known: expected {', '.join(known)}; or say "
                f"it by {field}"
            )
    unit = _length_unit(who, file, heading[columns[0]], says[0], length_unit, depth.max())
    degrees = _degrees(file, [heading[x] for x in columns[1:]], says[1:], degrees)
    tvd = np.array(tvd) * _LENGTHS.get(vertical, unit)
    return depth * unit, inclination, azimuth, degrees, length_unit_of(unit), tvd


def _sheet_of(who, file, sheet):
    """The cells of a sheet as text: a line a row, tabs between the cells, nothing in a cell without a value."""
    instance(who, "sheet", sheet, str | None, "the name of a sheet, or None for the first one")
    data = bytes_of(file, "a survey as .xlsx")
    openpyxl = import_library("openpyxl", f"{file}: a workbook, whose sheet may be saved as .csv instead,")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what it leaves out, such as styles
            book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
            sheets = {one.title: one for one in book.worksheets}
            found = next(iter(sheets.values())) if sheet is None else sheets.get(sheet)
            rows = None if found is None else _rows(found)
    except Exception as problem:  # a damaged file may raise anything
        raise SceneError(f"{file}: expected a workbook that openpyxl reads ({problem!r:.120})") from None
    if rows is None:
        raise SceneError(f"{file}: no sheet '{sheet}': {nearest(sheet, list(sheets))}")
    if isinstance(rows, int):
        raise SceneError(f"{file}: more than {rows / 2**20:g} MiB of text in a sheet: expected a survey as .xlsx")
    width, text = max(map(len, rows), default=0), io.StringIO()
    csv.writer(text, delimiter="\t", lineterminator="\n").writerows(row + [""] * (width - len(row)) for row in rows)
    return text.getvalue()


def _rows(sheet):
    """The rows of a sheet, lists of text; the bound on their size where they exceed it."""
    sheet.reset_dimensions()  # those in the file may be wrong
    rows, size = [], 0
    for values in sheet.iter_rows(values_only=True):
        rows.append(["" if value is None else " ".join(str(value).split()) for value in values])
        size += len(values) + sum(map(len, rows[-1]))
        if size > checks.MOST_TEXT:
            return checks.MOST_TEXT
    return rows


def _cells(file, i, line, separator):
    """The cells of line i."""
    try:
        return next(csv.reader([line], delimiter=separator))
    except csv.Error as problem:
        raise SceneError(f"{file}: line {i} is no row of a .csv file ({problem})") from None


def _heading(file, lines, wanted, separators):
    """Of the row of names: its index in `lines`, the separator, the names, and the columns of those that are wanted."""
    likely = []
    for k, (i, line) in enumerate(lines):
        separator = max(separators, key=line.count)
        heading = _cells(file, i, line, separator)
        columns = [_columns(heading, name) for name in wanted]
        if all(columns):
            for name, found in zip(wanted, columns, strict=True):
                if len(found) > 1:
                    raise SceneError(
                        f"{file}: line {i}: columns {' and '.join(str(x + 1) for x in found)} are both named '{name}' "
                        f"({', '.join(heading[x].strip() for x in found)}): expected one, or that columns (in Python "
                        "md, inc, azi) say which, with its unit"
                    )
            one = [found[0] for found in columns]
            if len(set(one)) < len(one):
                raise SceneError(f"{file}: {', '.join(wanted)}: expected three columns, each of another name")
            return k, separator, heading, one
        if sum(_is_number(cell) for cell in heading) > 1:
            break
        named = [name for name in heading if name.strip()]
        if len(named) > len(likely):
            likely = named
    if len(likely) < 2:
        raise SceneError(f"{file}: expected a row of names, such as 'MD (m),Inc (deg),Azi (deg)', above the stations")
    known = [_split(name)[0] for name in likely]
    missing = next(name for name in wanted if not _columns(likely, name))
    raise SceneError(
        f"{file}: no column '{missing}' in {', '.join(likely):.500}: {nearest(missing.lower(), known)}. Expected the "
        "names of the columns of measured depth, inclination and azimuth: columns = ['...', '...', '...'] in a scene "
        "file, md=, inc=, azi= in Python"
    )


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
    words = name.replace(".", "").split()
    if bracket:
        unit = unit.strip()
        return " ".join(words), next((name for spelt, name in _SPELT if re.match(spelt, unit)), unit)
    last = words.pop() if len(words) > 1 and words[-1] in _UNITS else ""
    return " ".join(words), last


def _with_point(cell, separator):
    """A number as Python writes it where there is no doubt: commas between thousands before a point, or before
    decimals that are not three, where commas do not separate cells."""
    if re.fullmatch(r"-?\d{1,3}(,\d{3})+\.\d*", cell):
        return cell.replace(",", "")
    decimals = separator != "," and re.fullmatch(r"-?(\d+,(\d\d?|\d{4,})|\d{4,},\d{3})", cell)
    return cell.replace(",", ".") if decimals else cell


def _number(cell):
    if "_" in cell or not cell.isascii():  # Python takes 10_00 for a number, and digits of all scripts
        raise ValueError
    return float(cell)


def _is_number(cell):
    try:
        return math.isfinite(_number(cell))
    except ValueError:
        return False


def _length_unit(who, file, heading, says, given, deepest):
    """The unit (m) of measured depths: as given, or as the heading says; deepest: the largest number there."""
    given, says = unit_asked(who, given), _LENGTHS.get(says)
    if given is not None and says is not None and not math.isclose(says, given, rel_tol=1e-3):
        raise SceneError(
            f"{file}: '{heading}' says a unit of {says:g} m, and length_unit {given:g} m: expected one of them, or "
            "none given"
        )
    if given is None and says is None:
        doubt_depth(f"{file}: '{heading.strip()}' names", deepest, ", or 'MD (ft)' there")
    return given or says or 1.0


def unit_asked(who, length_unit):
    """A unit of measured depths (m) that is given by its name or its size; None stays."""
    if isinstance(length_unit, str):
        return size_of(f"{who}.length_unit", length_unit, "length")
    return None if length_unit is None else positive(who, "length_unit", length_unit, "m")


def doubt_depth(told, deepest, more=""):
    """Warn of measured depths (m) without a unit that are probably in feet: the warning begins with `told`."""
    if deepest > _DEEP:
        warn(
            f"{told} no unit, so that the deepest station is at {deepest:g} m: if these are feet, say "
            f"length_unit = 'ft'{more}; length_unit = 'm' ends this warning"
        )


def _degrees(file, headings, says, given):
    """Whether angles are in degrees, see `WellPath.from_survey`."""
    stated = {_ANGLES[unit] for unit in says if unit in _ANGLES} | ({given} - {None})
    if len(stated) > 1:
        raise SceneError(
            f"{file}: '{headings[0]}', '{headings[1]}' and degrees = {given} contradict each other: expected one unit"
        )
    return False if stated == {False} else given
