"""A hole along an axis: diameters and friction of its cased and open sections."""

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from cosserat_fenicsx import units
from cosserat_fenicsx.checks import instance, number, positive, refuse, store, warn
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.well.path import WellPath

# Survey and sections that differ by more than this part end at different depths.
_APART = 1e-3
# Diameters (m) above this are hardly those of holes.
_WIDEST = 1.5


@dataclass(frozen=True)
class HoleSection:
    """A part of a hole, from the end of the part above it.

    Args:
        to: measured depth of its lower end, m.
        diameter: of the hole, or inside the casing, m.
        friction: coefficient of friction between string and wall (friction factor), 0 to 5.
        name: in tables and charts, such as "casing".

    Raises:
        SceneError: a number outside its range.
    """

    to: float
    diameter: float
    friction: float
    name: str = ""

    def __post_init__(self):
        store(self, to=positive(self, "to", self.to, "m"), diameter=positive(self, "diameter", self.diameter, "m"))
        store(self, friction=number(self, "friction", self.friction, "a coefficient of friction from 0 to 5",
                                    lambda x: 0 <= x <= 5))  # fmt: skip
        instance(self, "name", self.name, str, "a text")
        if self.diameter > _WIDEST:
            warn(f"HoleSection.diameter = {self.diameter:g} m is wider than holes are: 8.5 in are "
                          "8.5 * units.inch = 0.2159")  # fmt: skip


@dataclass(frozen=True)
class Borehole:
    """A hole along an axis.

    Args:
        path: a `WellPath`.
        sections: those of the hole, each a `HoleSection`, from the surface down.
        wall_stiffness: pressure per length over penetration, N/m^2; rock and steel have 1e9 and more. None for a rigid
            wall, which the rod in contact approaches by stiffer ones until what is left is small beside the accuracy
            asked for. Only the rod in contact needs it.

    Raises:
        SceneError: sections that do not follow each other downwards.
    """

    path: WellPath
    sections: tuple[HoleSection, ...]
    wall_stiffness: float | None = None

    def __post_init__(self):
        instance(self, "path", self.path, WellPath, "a WellPath")
        given = (self.sections,) if isinstance(self.sections, HoleSection) else tuple(self.sections)
        store(self, sections=given)
        if self.wall_stiffness is not None:
            store(self, wall_stiffness=positive(self, "wall_stiffness", self.wall_stiffness, "N/m^2"))
        if not given:
            refuse(self, "sections", given, "at least one HoleSection")
        above = 0.0
        for section in given:
            instance(self, "sections", section, HoleSection, "HoleSections")
            if section.to <= above:
                raise SceneError(f"HoleSection.to = {section.to:g}: expected more than {above:g} m, the section above")
            above = section.to
        if abs(self.path.length - above) > _APART * self.length:
            ratio = max(self.path.length, above) * units.foot / self.length
            feet = ": 3.28 times as deep, as feet are that are taken for metres" if abs(ratio - 1) < 0.05 else ""
            warn(f"Borehole: the survey ends at {self.path.length:.6g} m and the sections at {above:.6g} m; "
                          f"the hole ends at the shallower one{feet}")  # fmt: skip

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
        sections = [replace(section, friction=value) for section, value in zip(self.sections, values, strict=True)]
        found = copy(self)  # which was checked, and warned of
        store(found, sections=tuple(sections))
        return found
