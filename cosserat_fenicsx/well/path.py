"""The axis of a hole from a survey, which is checked: circular arcs of minimum curvature; a plan made crooked.

Frame: (north, east, down), m, its origin at the first station. md is the measured depth, the arc length along the axis
from there. Between two stations the axis is the circular arc that is tangent to both directions (straight where they
are equal): S. J. Sawaryn & J. L. Thorogood, SPE Drilling & Completion 20 (2005) 24, doi:10.2118/84246-PA. An arc is
described by its first tangent t and curvature vector k alone, so that nothing is divided by the curvature:

    r(x) = r + t x sinc(kx) + k x^2/2 sinc(kx/2)^2,    t(x) = t cos(kx) + k x sinc(kx),    sinc(a) = sin(a)/a
"""

import math
from collections import namedtuple
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.interpolate import CubicSpline

from cosserat_fenicsx.algebra.building import module
from cosserat_fenicsx.checks import File, Numbers, finite_array, instance, refuse, store, warn
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.actions.walls import TubeAxis
from cosserat_fenicsx.quantities import Units, length_unit_of, size_of
from cosserat_fenicsx.parts import Length, Number, Part, at_least, between
from cosserat_fenicsx.units import deg_per_100ft, deg_per_30m, foot
from cosserat_fenicsx.well.survey import doubt_depth, read_columns, unit_asked


#: The arcs between stations, arrays over these: md of the start (m), there position (m, 3), tangent (3) and curvature
#: vector (1/m, 3), length (m), and size of the curvature (1/m).
Sections = namedtuple("Sections", "start position tangent curvature length bend")

#: Measured depth (n,), position (n, 3), tangent (n, 3) and curvature vector (n, 3, 1/m) of points of the axis.
Nearest = namedtuple("Nearest", "md position tangent curvature")


@dataclass(frozen=True, eq=False)
class WellPath(TubeAxis):
    """The axis of a hole, of circular arcs and straight lines. Made by `from_survey`, `from_csv` or `from_xlsx`.

    Attributes:
        md: (n,) measured depth of the stations, m.
        inclination, azimuth: (n,) of the stations, rad.
        sections: `Sections`, n - 1 arcs.
        length: md of the last station, m.
        dogleg: (n - 1,) angle between the tangents at both ends of each section, rad.
        dogleg_severity: (n - 1,) dogleg per length, rad/m: over `units.deg_per_30m` in degrees per 30 m.
        crooked: the `Tortuosity` by which `tortuosity` made it from a plan, or None.
        unit: the unit of length of its survey, which messages have.
        filled: measured depths (m) of the vertical stations that were given without an azimuth.
    """

    crooked, unit, filled = None, "m", ()

    md: np.ndarray
    inclination: np.ndarray
    azimuth: np.ndarray

    def __post_init__(self):
        for name in ("md", "inclination", "azimuth"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        length, tangent = np.diff(self.md), _tangents(self.inclination, self.azimuth)
        dogleg, curvature = _curvatures(self.inclination, self.azimuth, length)
        bend = np.sqrt(_dot(curvature, curvature))
        sections = Sections(self.md[:-1], np.zeros_like(curvature), tangent[:-1], curvature, length, bend)
        _, along, aside = _arc(sections, np.arange(len(length)), length)
        steps = along[:, None] * tangent[:-1] + aside[:, None] * curvature
        sections.position[1:] = np.cumsum(steps[:-1], axis=0)
        for name, value in (("sections", sections), ("length", float(self.md[-1])), ("dogleg", dogleg)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "dogleg_severity", dogleg / length)
        for array in (self.md, self.inclination, self.azimuth, dogleg, self.dogleg_severity, *sections):
            array.flags.writeable = False

    @classmethod
    def from_survey(
        cls,
        md: Numbers,
        inc: Numbers,
        azi: Numbers,
        degrees: bool | None = None,
        length_unit: float | str | None = None,
    ) -> "WellPath":
        """The axis through the stations of a survey.

        Args:
            md: measured depths, m or text with a unit, ascending from 0 (where the survey begins further down, add the
                station (0, 0, azimuth of the next) of a vertical start).
            inc: inclinations from the vertical, 0 to 180 degrees; above 90 the hole climbs.
            azi: azimuths from north towards east, of any turn from -360 to 360 degrees; without meaning at a vertical
                station, where None or NaN takes that of the next station.
            degrees: False where the angles are in radians. None: degrees, refused where they look like radians; True:
                degrees, whatever they look like.
            length_unit: of plain numbers in `md`, in m or by name, such as "ft"; None for m, with a `SceneWarning`
                where these are as large as feet are.

        Raises:
            SceneError: fewer than two stations, numbers that are missing or out of their range, depths that do not
                ascend from 0, or two stations of opposite directions, between which no arc is defined.
        """
        texts = [x for x in md if isinstance(x, str)] if isinstance(md, list | tuple) else []
        who = "WellPath.from_survey"
        if texts and length_unit is not None:
            refuse(who, "length_unit", length_unit, "None, since depths have units of their own")
        size = 1.0 if texts else unit_asked(who, length_unit)
        if size not in (None, 1.0):
            md = finite_array("WellPath", "md", md, "finite numbers, one a station") * size
        path = cls.of_unit(md, inc, azi, degrees, length_unit_of(texts[0] if texts else size or 1.0))
        if size is None:
            doubt_depth(f"{who}: md has", path.length, ", and '12000 ft' wherever else a depth or a length is in feet")
        return path

    @classmethod
    def of_unit(cls, md, inc, azi, degrees, unit, tvd=()):
        """From measured depths (m) that were given in this unit; tvd: (n,) vertical depths (m, or NaN) of a survey,
        which are compared with the path's: those of all stations from the first one on."""
        *columns, filled = checked_survey(md, inc, azi, degrees, unit)
        path = cls(*columns)
        store(path, unit=unit, filled=filled)
        down = float(path.position(path.length)[2])
        if path.inclination[0] > math.pi / 2 + 1e-9 or down < -_ABOVE * path.length:
            says = "climbs from the surface" if path.inclination[0] > math.pi / 2 else "ends above the surface"
            first = math.degrees(path.inclination[0])
            warn(f"WellPath: the hole {says}: inclinations are from the vertical down, {first:g} "
                 "degrees at the surface; are inclinations and azimuths swapped?")  # fmt: skip
        if len(tvd) and np.isfinite(tvd).any():
            off = np.asarray(tvd) - path.position(path.md)[:, 2]
            off = np.nan_to_num(np.abs(off - off[np.isfinite(off)][0]))
            if off.max() > max(1.0, _APART * path.length):
                md = path.md[off.argmax()]
                warn(path.told(
                    f"WellPath: TVD of the survey differs by {off.max():.5g} m from that of its measured depths and "
                    f"inclinations at md = {md:.10g} m, and is not used: are columns or units wrong?"
                ))  # fmt: skip
        return path

    def told(self, text):
        """A sentence with its lengths in the unit of the survey; its loads in field units where these are feet."""
        field = {"force": "klbf", "moment": "ft-lbf", "rad/m": "deg/100ft", "density": "ppg"}
        return Units({"length": self.unit, **(field if self.unit == "ft" else {})}).sentence(text)

    def depth_told(self, depth, least=0.0, most=math.inf):
        """A depth (m), as it was probably typed; and a question where as many feet are more than `least` and at most
        `most` (m), else ""."""
        given = f"{depth:.10g} m"
        feet = depth / foot
        if self.unit == "ft" and abs(feet - round(feet)) < 1e-6:  # typed in feet
            return self.told(given), ""
        found = given if self.unit == "m" else f"{given} ({self.told(given)})"
        asks = least < depth * foot <= most * (1 + 1e-12)
        return found, f"; if these are feet, write '{depth:.10g} ft'" if asks else ""

    @classmethod
    def from_csv(
        cls,
        file: File,
        md: str = "md",
        inc: str = "inc",
        azi: str = "azi",
        *,
        degrees: bool | None = None,
        length_unit: float | str | None = None,
    ) -> "WellPath":
        """The axis from a .csv file with one row of names, separated by commas, semicolons or tabs.

        Lines above that row are skipped. Units in the file are used, as in "MD (ft)" or in a row below the names.

        Args:
            file: its path.
            md, inc, azi: names of the columns, upper or lower case alike, without units. Usual other names, such as
                "Measured Depth" and "Azimuth", are found by these.
            degrees: see `from_survey`. length_unit: of the measured depths, in m or by name, such as `units.foot` or
                "ft"; None for what the file says, else metres. Both are refused where the file says otherwise.

        Raises:
            SceneError: the file cannot be read, a column is missing or not of numbers; see also `from_survey`.
        """
        return cls.of_unit(*read_columns("WellPath.from_csv", file, (md, inc, azi), degrees, length_unit))

    @classmethod
    def from_xlsx(
        cls,
        file: File,
        sheet: str | None = None,
        md: str = "md",
        inc: str = "inc",
        azi: str = "azi",
        *,
        degrees: bool | None = None,
        length_unit: float | str | None = None,
    ) -> "WellPath":
        """The axis from a sheet of a workbook, an .xlsx file, with one row of names above the numbers.

        Rows above that row are skipped, and formulas have the values that they had when the file was saved. Needs
        openpyxl, which `pip install 'cosserat-fenicsx[data]'` installs.

        Args:
            file: its path.
            sheet: its name; None for the first one.
            md, inc, azi, degrees, length_unit: see `from_csv`.

        Raises:
            SceneError: see `from_csv`; or the workbook cannot be read or has no such sheet.
            InstallationError: openpyxl is missing.
        """
        return cls.of_unit(*read_columns("WellPath.from_xlsx", file, (md, inc, azi), degrees, length_unit, sheet))

    def position(self, md: float | Numbers) -> np.ndarray:
        """(..., 3) north, east, down at measured depths, m."""
        return self._at(*self._place(md))[0]

    def tangent(self, md: float | Numbers) -> np.ndarray:
        """(..., 3) unit vectors down the hole at measured depths (m)."""
        return self._at(*self._place(md))[1]

    def curvature(self, md: float | Numbers) -> np.ndarray:
        """(..., 3) derivative of the tangent by md, 1/m; at a station, in the section below it."""
        return self._at(*self._place(md))[2]

    def inclination_at(self, md: float | Numbers) -> np.ndarray:
        """(...) inclination at measured depths (m), rad."""
        t = self.tangent(md)
        return np.arctan2(np.hypot(t[..., 0], t[..., 1]), t[..., 2])

    def azimuth_at(self, md: float | Numbers) -> np.ndarray:
        """(...) azimuth at measured depths (m), rad from 0 to 2 pi; without meaning where the hole is vertical."""
        t = self.tangent(md)
        return np.arctan2(t[..., 1], t[..., 0]) % (2 * np.pi)

    def closest(self, points: Numbers, near: float | Numbers | None = None) -> np.ndarray:
        """(...) measured depths of the points of the axis that are closest to points.

        In closed form on each arc. A point beyond an end of the axis has the measured depth of that end.

        Args:
            points: (..., 3) m.
            near: (...) measured depths (m) to start from, such as the last answer: the search then walks from section
                to section as long as the distance falls, and finds the closest point on that part of the axis.
                None: on the whole axis.

        Raises:
            SceneError: points that are not three finite numbers each.
        """
        points = finite_array("WellPath.closest", "points", points, "(..., 3) finite numbers (m)")
        if points.shape[-1:] != (3,):
            refuse("WellPath.closest", "points", points, "(..., 3) finite numbers (m)")
        if near is not None:
            near = np.asarray(near, dtype=float)
            self._place(near)
        return self._nearest(points, near).md

    def nearest(self, points: Numbers | None, near: Numbers) -> "Nearest":
        """The points of the axis that are closest to points, with tangent and curvature there.

        Args:
            points: (..., 3) m; None for the points of the axis at `near`.
            near: (...) measured depths (m) to start from, see `closest`; of any value.

        Returns:
            `Nearest`. Beyond its ends the axis is straight: a point there has the measured depth and the position
            of the end, and no curvature.
        """
        if points is not None:
            return self._nearest(points, near)
        at = np.clip(near, 0.0, self.length)
        position, tangent, curvature = self._at(*self._place(at))
        position += (near - at)[..., None] * tangent
        curvature[(at <= 0.0) | (at >= self.length)] = 0.0
        return Nearest(at, position, tangent, curvature)

    def _nearest(self, points, near):
        """`nearest`, in C; near: None for the whole axis."""
        ffi, lib = module()
        shape = np.shape(points)[:-1]  # C relies on it
        md = np.array(np.broadcast_to(0.0 if near is None else near, shape), dtype=float, order="C")
        points, sections = np.ascontiguousarray(np.reshape(points, (*shape, 3)), dtype=float), self.sections._asdict()
        found = Nearest(md, *np.empty((3, *points.shape)))
        data = {name: ffi.from_buffer("double[]", array) for name, array in sections.items()}
        arcs = ffi.new("arcs *", {"sections": len(self.sections.start), **data})
        lib.nearest_on_arcs(
            arcs, md.size, ffi.from_buffer("double[]", points), near is None,
            *(ffi.from_buffer("double[]", array) for array in found),
        )  # fmt: skip
        return found

    def _at(self, i, x):
        """Position, tangent and curvature vector, (..., 3), at arc lengths x (m) from the starts of sections i."""
        s = self.sections
        r, t, k = (array.take(i, axis=0) for array in (s.position, s.tangent, s.curvature))
        if not k.any():
            return r + x[..., None] * t, t, k
        cos, along, aside = (part[..., None] for part in _arc(s, i, x))
        bent = along * _dot(k, k)[..., None]
        return r + along * t + aside * k, cos * t + along * k, cos * k - bent * t

    def _place(self, md):
        """Index of the section and arc length from its start, for measured depths."""
        md = np.asarray(md, dtype=float)
        slack = 1e-9 * self.length
        if not ((md >= -slack) & (md <= self.length + slack)).all():
            refuse("WellPath", "md", md, self.told(f"measured depths from 0 to {self.length:g} m"))
        i = np.clip(np.searchsorted(self.md, md, side="right") - 1, 0, len(self.md) - 2)
        return i, md - self.md[i]

    def __repr__(self):
        return f"WellPath({len(self.md)} stations, {self.length:g} m)"


def _dot(u, v):
    return np.einsum("...i,...i->...", u, v)


def _tangents(inc, azi):
    return np.stack([np.sin(inc) * np.cos(azi), np.sin(inc) * np.sin(azi), np.cos(inc)], axis=-1)


def _curvatures(inc, azi, length):
    """Doglegs (rad) and curvature vectors (1/m), accurate for small angles: by the size sin(dogleg) across."""
    i, a, j = inc[:-1], azi[:-1], inc[1:]
    half = np.sin(np.diff(azi) / 2)
    up = np.sin(j - i) - 2 * np.cos(i) * np.sin(j) * half**2
    across = np.sin(j) * np.sin(np.diff(azi))
    sine, cosine = np.hypot(up, across), np.cos(j - i) - 2 * np.sin(i) * np.sin(j) * half**2
    dogleg = np.arctan2(sine, cosine)
    share = np.divide(dogleg, sine, out=np.ones_like(sine), where=sine > 0) / length
    grows = np.stack([np.cos(i) * np.cos(a), np.cos(i) * np.sin(a), -np.sin(i)], axis=-1)
    turns = np.stack([-np.sin(a), np.cos(a), np.zeros_like(a)], axis=-1)
    return dogleg, (share * up)[:, None] * grows + (share * across)[:, None] * turns


def _arc(sections, i, x):
    """cos(kx), x sinc(kx), x^2/2 sinc(kx/2)^2 at x from the starts of sections i; sinc without pi."""
    half = sections.bend[i] * x / 2
    sine = np.sin(half)
    chord = x * np.divide(sine, half, out=np.ones_like(half), where=half != 0)
    return 1 - 2 * sine**2, chord * np.cos(half), chord**2 / 2


_FULL = math.radians(360)
# Degrees per 30 m above which no usual well turns.
_TIGHT = 30.0


# Height of the bottom above the surface, over the length, from which on a survey is doubted: crossings end near 0.
_ABOVE = 0.05
# Difference of vertical depths, over the length, from which on a survey is doubted: methods differ by less.
_APART = 3e-3


def checked_survey(md, inc, azi, degrees, given="m"):
    """Measured depths (m), inclinations and azimuths (rad) as arrays, and depths of stations whose azimuth was filled
    in, see `WellPath.from_survey`; messages have depths in the unit in which they were given."""
    who, length = "WellPath", size_of("WellPath", given, "length")
    instance(who, "degrees", degrees, (bool, type(None)), "True (degrees), False (radians) or None")
    columns, blank = {}, np.zeros(1, dtype=bool)
    for name, values, unit in (("md", md, "m"), ("inc", inc, "degrees or radians"), ("azi", azi, "degrees or radians")):
        if name == "azi" and np.iterable(values) and len(values) == len(columns["inc"]):
            values, blank = _filled(values, columns["inc"])
        columns[name] = finite_array(who, name, values, f"finite numbers ({unit}), one a station")
        if columns[name].ndim != 1 or len(columns[name]) < 2:
            refuse(who, name, values, f"at least two stations ({unit})")
        if len(columns[name]) != len(columns["md"]):
            refuse(who, name, values, f"{len(columns['md'])} numbers, as many as there are measured depths")
    md, inc, azi = columns.values()
    told = [f"{depth:.10g}" for depth in md / length]
    if (np.diff(np.sort(md)) >= 1e-6).all() and (np.diff(md) < 0).any():
        i = int(np.argmax(np.diff(md) < 0)) + 1
        rows = "the surface down: sort the stations by depth"
        refuse(who, f"md[{i}]", float(told[i]), f"more than the station before, {told[i - 1]} {given}, from {rows}")
    if md[0] != 0:
        expected = f"0 {given}: add the station (0, 0, azimuth) where the well starts vertically"
        refuse(who, "md[0]", float(told[0]), expected)
    if md[-1] > 1e6:
        refuse(who, "md[-1]", float(told[-1]), f"at most {1e6 / length:.4g} {given}")
    for i in np.flatnonzero(np.diff(md) < 1e-6) + 1:
        before = f"more than the station before, {told[i - 1]} {given}"
        refuse(who, f"md[{i}]", float(told[i]), f"{before} (ascending depths)")
    if degrees is not False:
        _doubt_degrees(inc, azi, degrees)
        inc, azi = np.radians(inc), np.radians(azi)
    unit, one = ("rad", 1.0) if degrees is False else ("degrees", math.radians(1))
    for name, values, least, most in (("inc", inc, 0.0, math.pi), ("azi", azi, -_FULL, _FULL)):
        for i in np.flatnonzero((values < least) | (values > most * (1 + 1e-12))):
            refuse(who, f"{name}[{i}]", float(columns[name][i]),
                   f"{least / one:g} to {most / one:.6g} ({unit}), at md = {told[i]} {given}")  # fmt: skip
    inc = np.minimum(inc, math.pi)
    rates = _curvatures(inc, azi, np.diff(md))[0] / np.diff(md)
    i = int(rates.argmax())
    if rates[i] > _TIGHT * deg_per_30m:
        rate, per = (deg_per_100ft, "100 ft") if given == "ft" else (deg_per_30m, "30 m")
        warn(f"WellPath: the hole turns by {rates[i] / rate:.3g} degrees per {per} between md = {told[i]} and "
             f"{told[i + 1]} {given}; wells have up to about 20: is there an error in the survey?")  # fmt: skip
    # rounding errors would decide the plane of such an arc
    for i in np.flatnonzero(_curvatures(inc, azi, np.diff(md))[0] > math.pi - 1e-6):
        raise SceneError(
            f"WellPath: the hole turns by 180 degrees between md = {told[i]} and {told[i + 1]} {given}: expected less "
            "(no arc is defined by two opposite directions)"
        )
    return md, inc, azi, tuple(md[: len(blank)][blank].tolist())


def _filled(azi, inc):
    """Azimuths in which vertical stations without one have that of the next station, and which have none (n,)."""
    blank = np.array([x is None or (isinstance(x, float) and math.isnan(x)) for x in azi])
    if not blank.any():
        return azi, blank
    slanted = np.flatnonzero(blank & (inc != 0))
    if len(slanted):
        refuse("WellPath", f"azi[{slanted[0]}]", None, f"a number, since the hole is not vertical there (inclination "
               f"{inc[slanted[0]]:g}); vertical stations need none")  # fmt: skip
    azi = list(azi)
    for i in np.flatnonzero(blank)[::-1]:
        azi[i] = azi[i + 1] if i + 1 < len(azi) else 0.0
    return azi, blank


def _doubt_degrees(inc, azi, degrees):
    """Refuse angles that look like radians, or warn where the user says that they are degrees."""
    if not 0 < inc.max() <= math.pi or np.abs(azi).max() > _FULL:
        return
    text = f"all inclinations are below {inc.max():.4g} and all azimuths within +-{np.abs(azi).max():.4g}: these look"
    text += " like radians"
    if degrees:
        warn(f"WellPath: {text}; they are taken as degrees, as degrees=True says")
    else:
        raise SceneError(
            f"WellPath: {text}. Say degrees=False if they are, degrees=True if they are not (in a scene file "
            "degrees = false and degrees = true)"
        )


# Stations a period, and nodes a period of random numbers; most stations; degrees per 30 m, and period (m), above which
# is warned.
_STATIONS, _NODES, _MOST, _STEEP, _LONG = 12, 2, 200_000, 20.0, 200.0


@dataclass(frozen=True)
class Tortuosity(Part):
    """Arguments of `tortuosity`, in a scene file too: amplitude (degrees), period (m) and seed; text with a unit."""

    amplitude: Annotated[float, between(0, 10, "an angle (degrees)")]
    period: Length
    seed: Annotated[int, Number(limits=at_least(0), whole=True)] | None = None

    called = "tortuosity"

    def in_words(self, units):
        """Its effect on a plan, in some units."""
        how = "a helix, without a seed" if self.seed is None else f"seed {self.seed}"
        return f"amplitude {self.amplitude:g} degrees, period {units.told(self.period, 'm')}, {how}"


def tortuosity(path: WellPath, amplitude: float | str, period: float | str, seed: int | None = None) -> WellPath:
    """The path with a small deviation of its direction, which vanishes at both ends.

    Without a seed the direction goes round that of the plan, a helix with a dogleg of 2 pi amplitude/period of its own.
    With a seed its deviations in two directions across the plan are smooth random functions of the
    depth, with random values every half of a period and amplitude/sqrt(2) as their standard deviations. Deviations are
    about directions that do not turn along the path, so that vertical parts have them, too.

    Args:
        path: the plan. amplitude: angle of the deviation, degrees, or text with a unit; at most 10 degrees.
        period: along the path, m, or text with a unit; of at most a half of the path's length.
        seed: of the random numbers, a whole number; the same one gives the same path.

    Raises:
        SceneError: a number outside its range; so short a period that there were more than 200 000 stations. A hole
            that turns by more than 20 degrees per 30 m, or a period above 200 m, gives a `SceneWarning`.
    """
    given = Tortuosity(amplitude, period, seed)
    instance(given, "path", path, WellPath, "a WellPath")
    amplitude, period, seed = math.radians(given.amplitude), given.period, given.seed
    if period > path.length / 2:
        most = path.told(f"{path.length / 2:g} m")
        refuse(given, "period", path.told(f"{period:g} m"), f"a length of at most half of the path's, {most}")
    if path.length / period * _STATIONS > _MOST:
        least = path.told(f"{path.length * _STATIONS / _MOST:.3g} m")
        refuse(given, "period", path.told(f"{period:g} m"), f"at least {least}, for {_MOST} stations at most")
    turn = 2 * math.pi * amplitude / period
    if turn > _STEEP * deg_per_30m:
        rate, per = (deg_per_100ft, "100 ft") if path.unit == "ft" else (deg_per_30m, "30 m")
        warn(f"tortuosity: amplitude = {given.amplitude:g} degrees and period = {path.told(f'{period:g} m')} turn the "
             f"hole by {turn / rate:.3g} degrees per {per}; drilled ones are crooked by a few: 300 feet are '300 ft' "
             "or 91.44")  # fmt: skip
    if period > _LONG:
        warn(path.told(f"tortuosity: period = {period:g} m is hardly one of a drilled hole, which swerves within a few "
             f"stands, at most {_LONG:g} m: {period:g} feet are '{period:g} ft' or {period * foot:g}"))  # fmt: skip
    md = np.linspace(0.0, path.length, math.ceil(path.length / period * _STATIONS) + 1)
    high, right = _deviations(md, path.length, amplitude, period, seed)
    tangent, across, aside = _frames(path, md)
    bent = tangent + np.tan(high)[:, None] * across + np.tan(right)[:, None] * aside
    inc, azi = np.arctan2(np.hypot(bent[:, 0], bent[:, 1]), bent[:, 2]), np.arctan2(bent[:, 1], bent[:, 0])
    found = WellPath.of_unit(md, inc, azi % (2 * np.pi), False, path.unit)
    store(found, crooked=given)
    return found


def _deviations(md, length, amplitude, period, seed):
    """Angles (rad) towards two directions across the path, faded out over a period at both ends."""
    fade = np.minimum(1.0, np.minimum(md, length - md) / period)
    fade = fade**2 * (3 - 2 * fade)
    if seed is None:
        angle = 2 * np.pi * md / period
        return amplitude * fade * np.array([np.cos(angle), np.sin(angle)])
    nodes = np.linspace(0.0, length, math.ceil(length / period * _NODES) + 1)
    values = np.random.default_rng(seed).normal(0.0, amplitude / math.sqrt(2), (2, len(nodes)))
    return fade * CubicSpline(nodes, values, axis=1)(md)


def _frames(path, md):
    """Tangents at measured depths, and two unit vectors across each, which turn about it as little as they can."""
    tangent = path.tangent(md)
    across = np.empty_like(tangent)
    first = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    for i, t in enumerate(tangent):
        first = first - (first @ t) * t
        first /= np.linalg.norm(first)
        across[i] = first
    return tangent, across, np.cross(tangent, across)
