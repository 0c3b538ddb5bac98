"""A hole along an axis, with diameters and friction of its cased and open sections, and the drilling fluid in it."""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import KW_ONLY, dataclass, replace
from itertools import pairwise
from typing import Annotated, ClassVar

import numpy as np

from cosserat_fenicsx import units as constants
from cosserat_fenicsx.actions.fluids import AddedMass, LinearDrag
from cosserat_fenicsx.actions.walls import value_at
from cosserat_fenicsx.checks import File, Numbers, doubt_width, number, positive, refuse, store, warn
from cosserat_fenicsx.quantities import Units, in_si, length_unit_of, size_of
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.parts import Depth, Diameter, FileName, Friction, Number, Part, WallStiffness, at_least
from cosserat_fenicsx.results.screen import InWords
from cosserat_fenicsx.scene.rod import Rod
from cosserat_fenicsx.scene.sections import Circle, Tube
from cosserat_fenicsx.well.components import standard_size, standard_sizes
from cosserat_fenicsx.well.path import Tortuosity, WellPath, tortuosity as made_crooked
from cosserat_fenicsx.well.survey import doubt_depth

# Pa, standard.
_ATMOSPHERE = 101325.0
# Pressures (Pa) of flow below this are probably in psi or bar.
_FAINT = 1e4
# {what: ([ranges of values that are doubted], what is said of them)}. Densities, kg/m^3: relative ones; neither of a
# gas nor of a liquid; heavier than any mud.
_DOUBTED = {
    "density": ([(0.5, 3.0), (5.0, 300.0), (2700.0, math.inf)], "is hardly that of a mud: 1.2 g/cm^3 are 1200, 10 "
                "pounds per US gallon are '10 ppg' or 1198"),
    "friction": ([(1.0, math.inf)], "is more than the wall of a well has (0.1 to 0.5; 25 percent are 0.25)"),
}  # fmt: skip


def doubt_value(what, called, values):
    """Warn once of a "density" of mud (kg/m^3) or a "friction" where any of `values`, an array, is doubtful: `called`,
    with {value} for the first such value and {count} for their number."""
    ranges, words = _DOUBTED[what]
    odd = values[np.any([(low < values) & (values < high) for low, high in ranges], axis=0)]
    if odd.size:
        warn(f"{called.format(value=odd[0], count=odd.size)} {words}")


@dataclass(frozen=True)
class HoleSection(Part):
    """A part of a hole, from the end of the part above it.

    Args:
        to: measured depth of its lower end, m.
        diameter: of the hole, or inside the casing, m; None for that of `casing`.
        friction: coefficient of friction between string and wall (friction factor), 0 to 5; must be given.
        name: in tables and charts, such as "casing"; by default the size of the casing.
        casing: the name of a standard size, such as "9 5/8 in 47 lb/ft", which has its inner diameter.

    Raises:
        SceneError: a number outside its range, neither or both of diameter and casing, an unknown size.
    """

    to: Depth
    diameter: Diameter | None = None
    friction: Friction = None  # type: ignore[assignment]  # refused unless it is given
    name: str = ""
    casing: str | None = None

    def __post_init__(self):
        ends = self.to if isinstance(self.to, str) else f"{self.to:g} m" if isinstance(self.to, float | int) else ""
        try:
            super().__post_init__()
        except SceneError as problem:  # of several sections: which one
            told = "" if ".to =" in str(problem) else f", in the section that ends at {ends}"
            if ".friction =" in str(problem) and isinstance(self.friction, float | int) and 5 < self.friction <= 100:
                told += f"; {self.friction:g} percent are {self.friction / 100:g}"
            raise SceneError(f"{problem}{told}") from None

    def validate(self):
        """Find the diameter of a casing; warn of one that is probably in another unit, and of a friction above 1."""
        if self.casing is not None:
            known = standard_size("Casing", self.casing)
            inside = known["inner_diameter"]
            if self.diameter not in (None, inside):
                refuse(self, "diameter", self.diameter, f"either a diameter or a casing, whose is {inside:.6g} m")
            store(self, diameter=inside, casing=known["size"], name=self.name or f"casing {known['size']}")
        if self.diameter is None:
            refuse(self, "diameter", None, "a diameter (m), or the size of a casing, casing='9 5/8 in 47 lb/ft'")
        doubt_width(self, "diameter")
        called_casing = not self.casing and "casing" in self.name.lower()
        sizes = standard_sizes()["Casing"] if called_casing else {}
        alike = [size for size, row in sizes.items() if abs(row["outer_diameter"] - self.diameter) < 1e-5]
        if alike:
            warn(f"HoleSection.diameter = {self.diameter:g} m is the outer diameter of casing; inside it is less: give "
                 f"casing='{alike[0]}' in the place of the diameter, or the inner diameter")  # fmt: skip
        doubt_value("friction", f"HoleSection.friction = {self.friction:g}", np.array([self.friction]))


def _depth(i, depth, unit):
    """Measured depth of a station, m: text has its own unit."""
    return in_si(f"Borehole.stations[{i}]", depth, "length") if isinstance(depth, str) else depth * unit


@dataclass(frozen=True)
class Borehole(InWords, Part):
    """A hole along an axis.

    Args:
        path: a `WellPath`.
        sections: one `HoleSection`, or a list of them from the surface down.
        wall_stiffness: pressure per length over penetration, N/m^2; rock and steel have 1e9 and more. None for a rigid
            wall, which the rod in contact approaches by stiffer ones until the remaining error is small beside the
            tolerance. Only the rod in contact needs it.

    Raises:
        SceneError: sections that do not follow each other downwards.
    """

    path: WellPath
    sections: tuple[HoleSection, ...]
    # a second section there is a mistake
    _: KW_ONLY
    wall_stiffness: WallStiffness | None = None

    @classmethod
    def constructors(cls):
        return cls, cls.from_survey

    @classmethod
    def constructor(cls, names):
        return cls if "path" in names else cls.from_survey  # which says what a file may give

    @classmethod
    def from_survey(
        cls,
        sections: tuple[HoleSection, ...],
        survey: Annotated[File | None, FileName()] = None,
        stations: Numbers | None = None,
        columns: Sequence[str] = ("md", "inc", "azi"),
        degrees: bool | None = None,
        length_unit: str | None = None,
        wall_stiffness: WallStiffness | None = None,
        sheet: str | None = None,
        tortuosity: Tortuosity | None = None,
    ) -> "Borehole":
        """A hole from its survey, as in a scene file.

        Args:
            sections, wall_stiffness: see the class.
            survey: the name of a .csv file or of an .xlsx file, see `WellPath.from_csv` and `WellPath.from_xlsx`; or
            stations: rows of measured depth, inclination and azimuth; depths in m or text with a unit.
            columns: names of the columns of the file. degrees: see `WellPath.from_survey`.
            length_unit: of the measured depths of survey or stations, such as "ft".
            sheet: of an .xlsx file; None for the first one.
            tortuosity: amplitude (degrees), period (m) and seed, where survey or stations are a plan, which is made as
                crooked as drilled wells are: see `tortuosity`.

        Raises:
            SceneError: neither survey nor stations, or both; a sheet without an .xlsx file; see also `WellPath`.
        """
        if (survey is None) == (stations is None):
            raise SceneError(
                "expected either survey, the name of a .csv or .xlsx file, or stations, rows of md, inc, azi"
            )
        workbook = survey is not None and str(survey).lower().endswith((".xlsx", ".xlsm"))
        if sheet is not None and not workbook:
            refuse("Borehole", "sheet", sheet, "an .xlsx file as survey")
        unit = None if length_unit is None else size_of("Borehole.length_unit", length_unit, "length")
        if stations is None:
            if not isinstance(columns, list | tuple) or len(columns) != 3:
                refuse("Borehole", "columns", columns, "three names of columns: md, inclination, azimuth")
            given = {"degrees": degrees, "length_unit": unit}
            if workbook:
                path = WellPath.from_xlsx(survey, sheet, *columns, **given)
            else:
                path = WellPath.from_csv(survey, *columns, **given)
        else:
            try:
                rows = [(_depth(i, md, unit or 1.0), *angles) for i, (md, *angles) in enumerate(stations)]
                md, inc, azi = np.array(rows, dtype=float).T
                given = stations[-1][0] if isinstance(stations[-1][0], str) else unit or 1.0
            except (ValueError, TypeError, OverflowError) as problem:
                if isinstance(problem, SceneError):
                    raise
                refuse("Borehole", "stations", stations, "rows of three numbers: md, inclination, azimuth")
            path = WellPath.of_unit(md, inc, azi, degrees, length_unit_of(given))
            if length_unit is None and not isinstance(given, str):
                doubt_depth("stations: their depths have", path.length)
        if tortuosity is not None:
            path = made_crooked(path, **tortuosity.arguments())
        return cls(path, sections, wall_stiffness=wall_stiffness)

    def __post_init__(self):
        if isinstance(self.sections, HoleSection):
            store(self, sections=(self.sections,))
        super().__post_init__()

    def validate(self):
        """Refuse sections that do not follow each other downwards; warn where they and the survey end apart."""
        if not self.sections:
            refuse(self, "sections", self.sections, "at least one HoleSection")
        above = 0.0
        for section in self.sections:
            if section.to <= above:
                told = self.path.told(f"HoleSection.to = {section.to:g} m: expected more than")
                found, feet = self.path.depth_told(above, most=section.to)
                raise SceneError(f"{told} {found}, the section above{feet}")
            above = section.to
        if abs(self.path.length - above) > 1e-3 * self.length:
            ratio = max(self.path.length, above) * constants.foot / self.length
            feet = ": 3.28 times as deep, as feet are that are taken for metres" if abs(ratio - 1) < 0.05 else ""
            told = f"Borehole: the survey ends at {self.path.length:.6g} m and the sections at {above:.6g} m; "
            warn(self.path.told(f"{told}the hole ends at the shallower one{feet}"))

    def sentences(self, units: Units) -> list[str]:
        """On its path and its sections, in some units."""
        return [self.path_in_words(units), *self.sections_in_words(units)]

    def path_in_words(self, units: Units) -> str:
        """A sentence on the path, in some units."""
        path = self.path
        north, east, down = (units.told(round(x, 6) + 0.0, "m", form=".2f") for x in path.position(path.length))
        worst = int(np.argmax(path.dogleg_severity))
        unit, size = ("30 m", constants.deg_per_30m) if units.si else ("100 ft", constants.deg_per_100ft)
        blank = ", ".join(units.told(md, "m") for md in path.filled)
        return (
            f"Well: {len(path.md)} stations to md = {units.told(path.length, 'm')}, which is north {north}, east "
            f"{east} and down {down}; largest inclination {math.degrees(path.inclination.max()):.2f} degrees, largest "
            f"dogleg {path.dogleg_severity[worst] / size:.2f} degrees per {unit} below "
            f"{units.told(path.md[worst], 'm')}."
            + f" No azimuth was given at md = {blank}, which is vertical: that of the next station." * bool(blank)
            + (f" A plan made crooked by tortuosity: {path.crooked.in_words(units)}." if path.crooked else "")
        )

    def sections_in_words(self, units: Units) -> list[str]:
        """A sentence on each section, in some units."""
        return [
            f"Hole, {section.name or f'section {i}'}: to {units.told(section.to, 'm')}, "
            f"{units.told(section.diameter, 'm', 'diameter', '.5g')} wide, friction {section.friction:g}."
            for i, section in enumerate(self.sections, start=1)
        ]

    @property
    def length(self):
        """Measured depth of the bottom: where the survey or the sections end, m."""
        return min(self.path.length, self.sections[-1].to)

    def at(self, md, field):
        """(...) `diameter` or `friction` at measured depths (m)."""
        values = np.array([getattr(section, field) for section in self.sections])
        ends = [section.to for section in self.sections[:-1]]
        return values[np.searchsorted(ends, md, side="left")]

    def with_friction(self, friction):
        """The same hole with other friction: a number for all sections, or one for each.

        Raises:
            SceneError: another number of values than there are sections.
        """
        values = [friction] * len(self.sections) if np.ndim(friction) == 0 else list(friction)
        if len(values) != len(self.sections):
            refuse(self, "friction", friction, f"a number, or {len(self.sections)}, one for each section of the hole")
        try:
            sections = [replace(section, friction=value) for section, value in zip(self.sections, values, strict=True)]
        except SceneError as problem:
            raise SceneError(self.path.told(str(problem))) from None
        found = copy(self)  # which was checked, and warned of
        store(found, sections=tuple(sections))
        return found


@dataclass(frozen=True)
class _Rows(Number):
    """A number, or ascending rows of measured depth (m) and one; `ends`: of the lower ends of columns."""

    ends: bool = False

    @property
    def words(self):
        depth = "of the lower end of each column" if self.ends else "ascending"
        return f"{super().words}, or rows of measured depth (m), {depth}, and such a value"

    def check(self, owner, field, value):
        if not isinstance(value, list | tuple | np.ndarray):
            return super().check(owner, field, value)
        if not len(value) or not all(isinstance(row, list | tuple | np.ndarray) and len(row) == 2 for row in value):
            refuse(owner, field, value, self.words)
        rows, last = [], 0.0 if self.ends else -math.ulp(0.0)
        more = ", of the lower ends of columns, from above 0" if self.ends else ""
        for md, x in value:
            last = number(
                owner, field, md, f"measured depths (m) that ascend{more}", lambda x, last=last: last < x < math.inf
            )
            rows.append((last, super().check(owner, field, x)))
        if not self.ends:
            return tuple(rows)
        kept = [a for a, b in pairwise(rows) if a[1] != b[1]] + rows[-1:]
        return tuple(kept) if len(kept) > 1 else kept[0][1]

    def schema(self, definitions):
        plain, depth = super().schema(definitions), Number("length", at_least(0)).schema(definitions)
        row = {"type": "array", "prefixItems": [depth, plain], "minItems": 2, "maxItems": 2}
        return {"anyOf": [plain, {"type": "array", "items": row, "minItems": 1}]}


_Columns = Annotated[float | Numbers, _Rows("density", at_least(0, "a density"), ends=True)]
_Flow = Annotated[float | Numbers, _Rows("pressure")]


@dataclass(frozen=True)
class Mud(InWords, Part):
    """The fluids in the hole and in the string, at rest.

    Args:
        density: kg/m^3; 0 for air. Of columns of fluid on top of each other, such as of a spacer and a slurry: rows of
            the measured depth of a column's lower end (m) and its density, from the surface down; the last one reaches
            to the bottom. A row that ends above the string's lower end, or begins below the hole, gives a
            `SceneWarning` where both are known.
        inside: that in the string, kg/m^3, or rows as of `density`; None for the same. Where the pressures inside and
            outside differ at the lower end, something there holds the difference: a float valve, the nozzles of a bit,
            a plug.
        added_mass: C_a, for motions: the mass of the fluid around that moves with the string, over the mass that the
            string displaces: 1 far from walls, 1.5 to 3 in a hole. None leaves it and the mud inside out.
        drag: lateral drag on the axis, for motions: force per length and speed, N s/m^2; None for none.
        flow_inside, flow_outside: pressure in the string and around it above that of the fluids at rest, such as that
            of a pump: a number, Pa, or rows of measured depth (m) and pressure, linear between and constant beyond
            them. It is in true tension, stresses, stretch, burst and collapse; not in weight and effective tension,
            since the fluid hands the loss of pressure to the wall.

    Raises:
        SceneError: a number that is negative or not finite; depths that do not ascend; a pressure of flow below a
            vacuum at the surface.
    """

    density: _Columns
    inside: _Columns | None = None
    added_mass: Annotated[float, at_least(0, "a coefficient")] | None = None
    drag: Annotated[float, Number("damping per length", at_least(0, "a coefficient"))] | None = None
    flow_inside: _Flow = 0.0
    flow_outside: _Flow = 0.0

    #: m/s^2, standard.
    gravity: ClassVar[float] = 9.80665

    def validate(self):
        """Take the same mud inside by default; warn of a density that is probably in another unit."""
        if self.inside is None:
            store(self, inside=self.density)
        for density in {x for rows in (self.density, self.inside) for _, x in _columns(rows)}:
            doubt_value("density", f"Mud.density = {density:g} kg/m^3", np.array([density]))
        for field in ("flow_inside", "flow_outside"):
            flow = getattr(self, field)
            at_surface = flow[0][1] if isinstance(flow, tuple) else flow
            most = max(abs(x) for _, x in flow) if isinstance(flow, tuple) else abs(flow)
            if 0 < most < _FAINT:
                warn(f"Mud.{field}: {most:g} Pa is hardly a pressure of flow: {most:g} psi are '{most:g} psi', "
                     f"{most:g} bar are '{most:g} bar'")  # fmt: skip
            if at_surface < -_ATMOSPHERE:
                refuse(self, field, flow, f"at least -{_ATMOSPHERE:g} Pa at the surface, a vacuum; what flow loses on "
                       "its way down the string is a positive number that falls with depth")  # fmt: skip

    def doubt_depths(self, hole: "Borehole", depth: float) -> None:
        """Warn of columns that hardly fit a hole and a string in it, such as of depths in another unit.

        Args:
            hole: the `Borehole`. depth: of the lower end of the string, m.
        """
        bottom = hole.length
        for field in ("density", "inside") if self.inside != self.density else ("density",):
            rows = getattr(self, field)
            if not isinstance(rows, tuple):
                continue
            (begins, _), (ends, last) = rows[-2:]
            if begins >= bottom:
                text = (f"the fluid of {last:g} kg/m^3 begins at md = {begins:.6g} m, below the bottom of the hole at "
                        f"{bottom:.6g} m, and counts nowhere: expected depths in m, or text such as '4000 ft'")
            elif abs(ends * constants.foot / bottom - 1) < 0.02:
                text = (f"the last row ends at md = {ends:.6g} m, 3.28 times as deep as the hole, as feet are that are "
                        "taken for metres: expected depths in m, or text such as '4000 ft'")
            elif ends < depth - 1e-3 * bottom:
                text = (f"the last row ends at md = {ends:.6g} m, above the lower end of the string; its fluid is "
                        "taken to reach to the bottom: expected the depth of the bottom there")
            else:
                continue
            warn(hole.path.told(f"Mud.{field}: {text}"))

    @property
    def interfaces(self) -> np.ndarray:
        """Measured depths at which a fluid gives way to another one, outside or inside, m."""
        return np.unique([end for rows in (self.density, self.inside) for end, _ in _columns(rows)[:-1]])

    def densities(self, md) -> np.ndarray:
        """(2, ...) kg/m^3, outside and inside the string, at measured depths (m); at an interface, above it."""
        return np.array([value_at(_columns(rows), md) for rows in (self.density, self.inside)])

    def pressures(self, md, path: WellPath) -> np.ndarray:
        """(2, n) Pa, outside and inside the string, at measured depths (m) along a path."""
        down, found = path.position(md)[:, 2], []
        for rows, flow in ((self.density, self.flow_outside), (self.inside, self.flow_inside)):
            ends, densities = np.transpose(_columns(rows))
            tops = path.position(np.append(0.0, np.minimum(ends[:-1], path.length)))[:, 2]
            below = np.append(0.0, np.cumsum(densities[:-1] * np.diff(tops)))
            i = np.searchsorted(ends, md)
            added = np.interp(md, *np.transpose(flow)) if isinstance(flow, tuple) else flow
            found.append(self.gravity * (below[i] + densities[i] * (down - tops[i])) + added)
        return np.array(found)

    def sentences(self, units: Units) -> list[str]:
        """On its densities, in SI and in ppg, whatever the units."""
        flow = "" if (self.flow_inside, self.flow_outside) == (0.0, 0.0) else "; with pressures of flow"
        outside, inside = (_fluid_in_words(rows, units) for rows in (self.density, self.inside))
        return [f"Mud: {outside}{'' if inside == outside else f'; inside the string {inside}'}{flow}."]

    def along(self, rod: Rod, outer: float | None = None, inner: float | None = None) -> tuple:
        """Actions of the mud on a moving rod: an `AddedMass`, across the rod alone, and a `LinearDrag`, if they are not
        zero.

        Args:
            rod: the rod.
            outer, inner: diameters, m, of the rod and of its bore (0 without one); None: of its sections.

        Raises:
            SceneError: a diameter that is not positive, or not given where a section is neither `Circle` nor `Tube`.
        """
        actions, across = [], []
        if self.added_mass is not None and len(self.interfaces):
            refuse(self, "density", self.density, "one fluid outside and one inside, for a motion with added_mass")
        if self.added_mass is not None:
            for end, section in rod.profile.pieces:
                outside, inside = self._diameters(rod, section, outer, inner)
                mass = self.added_mass * self.density * outside**2 + self.inside * inside**2
                across.append((end, math.pi / 4 * mass))
        if any(mass for _, mass in across):
            actions.append(AddedMass(rod, across if len(across) > 1 else across[0][1]))
        if self.drag:
            actions.append(LinearDrag(rod, self.drag))
        return tuple(actions)

    def _diameters(self, rod, section, outer, inner):
        """Outer and inner diameter of a section of a rod, m: those asked for, else its own."""
        own = section.diameter if isinstance(section, Circle) else None, 0.0
        if isinstance(section, Tube):
            own = section.outer_diameter, section.inner_diameter
        if outer is None and own[0] is None:
            refuse("Mud.along", "outer", None, f"the diameter of rod '{rod.name}' (m), which its section does not give")
        outer = own[0] if outer is None else positive("Mud.along", "outer", outer, "m")
        inner = own[1] if inner is None else number("Mud.along", "inner", inner, "a diameter from 0 on (m)",
                                                    lambda x: 0 <= x < math.inf)  # fmt: skip
        return outer, inner


def _columns(rows):
    """((md of the lower end, density), ...) of one fluid or of columns; the last one has no end."""
    return (*rows[:-1], (math.inf, rows[-1][1])) if isinstance(rows, tuple) else ((math.inf, rows),)


def _fluid_in_words(rows, units):
    """The densities of columns, and their lower ends."""
    told = [f"{x:g} kg/m^3, {x / constants.ppg:.4g} ppg" for _, x in _columns(rows)]
    ends = [f" to md = {units.told(end, 'm')}; " for end, _ in _columns(rows)[:-1]]
    return "".join(a + b for a, b in zip(told, [*ends, " below" if ends else ""], strict=True))
