"""The components of a string, by numbers, by dimensions or by standard sizes, and the string made of them.

Lengths in m. `mass` is that in air, kg/m, tool joints included; its volume of steel is mass over density. The weight in
mud follows from it (`Mud`), or is given (`Component`).

Standard sizes are in standard_sizes.csv. Drill pipe: bodies of API Spec 5DP (ISO 11961); tool joints and weights with
them of API RP 7G, for new grade E75 pipe with the connection named, which other grades and connections exceed by up to
a tenth. Casing: API Spec 5CT (ISO 11960), nominal weights with threads and couplings; its inner diameter is that of the
body, which the drift diameter is less than. Drill collars: number, outer diameter and bore of API Spec 7-1 (ISO
10424-1); of those with two bores the larger one. Heavy-weight pipe: Drilco's Hevi-Wate; other makes differ by about
1 %. Sizes without a weight have the weight of the plain section.
"""

import csv
import functools
import math
import re
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np

from cosserat_fenicsx import units
from cosserat_fenicsx.checks import doubt_width, positive, refuse, store, warn
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.parts import (
    DampingTime,
    Diameter,
    ForcePerLength,
    Length,
    MassPerLength,
    Number,
    Part,
    at_least,
    between,
)
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.results.screen import InWords
from cosserat_fenicsx.scene.sections import Circle, Material, Stiffness, Tube

# A number with a unit of lengths, and nothing after it.
_LENGTH = re.compile(r"""\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?(?:[ -]+\d+/\d+|/\d+)?\s*[a-zA-Z"]*\s*$""")
# Diameters, in: larger numbers are no inches.
_WIDEST = 40.0
_TABLE = Path(__file__).with_name("standard_sizes.csv")


@functools.cache
def standard_sizes():
    """{kind: {name: what `standard_size` returns}}."""
    sizes = {}
    for row in csv.DictReader(_TABLE.read_text(encoding="utf-8").splitlines()):

        def read(column, unit, row=row):
            return float(row[column]) * unit if row[column] else None

        sizes.setdefault(row["kind"], {})[row["name"]] = {
            "size": row["name"],
            "outer_diameter": read("outer_diameter_in", units.inch),
            "inner_diameter": read("inner_diameter_in", units.inch),
            "tool_joint": read("tool_joint_in", units.inch),
            "mass": read("weight_lb_per_ft", units.lb_per_ft),
        }
    return sizes


def standard_size(kind, name):
    """Its full name as `size`, outer_diameter, inner_diameter, tool_joint (m, or None), mass (kg/m in air, or None).
    kind: "DrillPipe", "HeavyWeight", "Collar" or "Casing"; name: such as "5 in 19.50 lb/ft"; the units may be left out.
    Raises SceneError: an unknown name, with the nearest known one."""
    known = standard_sizes()[kind]
    plain = {_plain(size): size for size in known}
    if not isinstance(name, str) or _plain(name) not in plain:
        own = "" if kind == "Casing" else "; outer_diameter and inner_diameter may stand in the place of size"
        raise SceneError(f"{kind}.size = {name!r}: {_sizes_near(name, known)}{own}")
    return known[plain[_plain(name)]]


def _sizes_near(name, known):
    """The end of a message on an unknown size: the known ones of its diameter, or the nearest name."""
    alike = _of_its_diameter(name, known)
    if alike:
        return f"known of this diameter: {', '.join(alike)}"
    first = _plain(str(name)).partition(" ")[0]
    if first.replace(".", "", 1).isdigit() and float(first) < _WIDEST:
        asked, widths = float(first) * units.inch, {row["outer_diameter"] for row in known.values()}
        widths = sorted(widths, key=lambda x: abs(x - asked))
        near = [size for size, row in known.items() if row["outer_diameter"] in widths[:2]]
        return f"none of this diameter is known, of the nearest ones {', '.join(near)}"
    found = nearest(name, known)
    if found.startswith("did"):
        return found
    wide = (f"{size} ({row['outer_diameter'] / units.inch:.4g} x {row['inner_diameter'] / units.inch:.4g} in)"
            for size, row in known.items())  # fmt: skip
    return f"known, with outer and inner diameter: {', '.join(wide)}"


def _of_its_diameter(name, known):
    """The known sizes that have the diameter of a name, that of the nearest weight first."""
    found, sizes = _plain(str(name)).split(), {size: _plain(size).split() for size in known}

    def off(size):
        try:
            return abs(float(sizes[size][1]) - float(found[1]))
        except (IndexError, ValueError):  # without a weight
            return 0.0

    def same(size, words):
        return words[:1] == found[:1] or f"{known[size]['outer_diameter'] / units.inch:g}" == "".join(found[:1])

    return sorted((size for size, words in sizes.items() if same(size, words)), key=off)


def _plain(name):
    """A name without units and blanks; numbers in decimals, to the last digit that is not zero."""
    name = re.sub(r"[\"#]|lb/ft|ppf|in(?![a-z])", " ", name.lower())
    name = re.sub(r"(?:(\d+)[ -]+)?(\d+)/([1-9]\d*)", lambda x: f"{int(x[1] or 0) + int(x[2]) / int(x[3]):g}", name)
    words = name.split()
    return " ".join(f"{float(word):g}" if word.replace(".", "", 1).isdigit() else word for word in words)


#: Drill-pipe steel: E = 30 million psi, as in API RP 7G.
STEEL = Material(E=206.8e9, nu=0.3, density=7850.0)


class StringPart(Part, family="component of a string", homes=("cosserat_fenicsx.well.tools",)):
    """Base of the components of a string; a component of one's own is a frozen dataclass derived from it.

    Attributes:
        length: m; None for the one that fills up to the surface.
        stiffness: a `Stiffness`, or None.
        weight: in mud, N/m; None where it follows from `mass` (in air with tool joints, kg/m), the inner diameter and
            the density of the `material`.
        contact_radius: where it touches the wall, m.
        outer_diameter, inner_diameter: of the body, m; None where they are not known.
        name: in tables.
        damping_time: of Kelvin and Voigt, s: of torsion and axial motion along the string.
        touches: whether it touches along its whole length (None), with its `diameter` at its lower end ("bottom"), or
            with that in the middle of its length ("middle").
    """

    touches: ClassVar[str | None] = None
    damping_time = 0.0
    bend: float | None = None

    @property
    def body_radius(self):
        """Contact radius along its whole length, m; of the body, where the `diameter` stands out from it."""
        return self.contact_radius if self.touches is None else self.outer_diameter / 2

    def rings(self, length):
        """Distances (m) from the lower end of the places at which it touches alone, where there are any."""
        return {None: (), "bottom": (0.0,), "middle": (length / 2,)}[self.touches]

    @property
    def torsion(self):
        """Torsional stiffness (N m^2) and polar inertia per length (kg m) for waves of torsion along the string."""
        return self.stiffness.torsion, self.stiffness.inertia[2]


# Distances of tool joints (m) between which pipe of the ranges 1 to 3 has them, 18 to 45 ft, with some room.
_JOINTS = 4.0, 16.0
# Share of its body's weight below which the mass of a tube is doubted, and distance (m) of centralisers above which.
_LIGHT, _APART = 0.9, 100.0
# The largest bend of a housing, degrees.
_MOST_BENT = 5.0


@dataclass(frozen=True, kw_only=True)
class _Bendable(StringPart):
    """Base of components with a bend, such as the housing of a mud motor: straight pieces at an angle, free of stress.

    Args:
        bend: degrees, up to 5; None for none.
        bend_at: its distance from the component's lower end, m.
        tool_face: the side that the bend points its lower end to where the string is in its hole: degrees clockwise
            from the high side looking down the hole, from north where that is vertical; by default 0, the high side.

    Raises:
        SceneError: a bend without its place or beyond the component, a place or a tool face without a bend.
    """

    bend: Annotated[float, between(0, _MOST_BENT, "a bend (degrees)")] | None = None
    bend_at: Annotated[float, Number("length", at_least(0, "a distance from the lower end (m)"))] | None = None
    tool_face: Annotated[float, between(-360, 360, "an angle (degrees, 0 the high side, 90 right)")] | None = None

    def validate(self):
        """Refuse a bend without its place, or with a place outside, and what belongs to a bend without one."""
        if self.bend is None:
            for field in ("bend_at", "tool_face"):
                if getattr(self, field) is not None:
                    refuse(self, field, getattr(self, field), "a bend, too: bend=1.15 (degrees)")
            return
        if self.length is None:
            refuse(self, "bend", self.bend, "a component with a length: the uppermost one, which fills up, has none")
        if self.bend_at is None or not 0 < self.bend_at < self.length:
            expected = f"its distance (m) from the lower end, between 0 and the length, {self.length:g} m"
            refuse(self, "bend_at", self.bend_at, expected)
        if self.tool_face is None:
            store(self, tool_face=0.0)


@dataclass(frozen=True)
class Component(_Bendable):
    """A part of a string by its numbers, with its weight in mud.

    Args:
        length: m; None for the one that fills up to the surface.
        stiffness: a `Stiffness`, or None: only the soft string can be solved, without bending moments and stretch.
        weight: in mud, N/m.
        contact_radius: where it touches the wall, m: of the tool joints, if it has any.
        name: in tables.
        damping_time: of Kelvin and Voigt, s: torques and forces along the string grow by it times the rates of twist
            and stretch; a mode of the frequency f gets the damping ratio pi f times it.
        bend, bend_at, tool_face: as of `Collar`.

    Raises:
        SceneError: a number that is missing or not positive; a bend as of `Collar`.
    """

    length: Length | None = None
    stiffness: Stiffness | None = None
    weight: Annotated[ForcePerLength, between(-1e6, 1e6)] | None = None
    contact_radius: Length | None = None
    name: str = "component"
    damping_time: DampingTime = 0.0

    outer_diameter = inner_diameter = mass = None

    def validate(self):
        """Refuse a missing weight or contact radius."""
        super().validate()
        if self.weight is None:
            refuse(self, "weight", None, "the weight in mud (N/m): a component without weight cannot be placed")
        if self.contact_radius is None:
            refuse(self, "contact_radius", None, "a positive number (m)")


@dataclass(frozen=True)
class Centraliser(Part):
    """Rings on a component, which alone touch the wall where they hold its body off: centralisers, or tool joints that
    the exact rod in contact shall see one by one.

    Args:
        spacing: of the rings, m; the lowest one is half of it above the component's lower end.
        diameter: of the rings, m; at most the hole's.

    Raises:
        SceneError: a number that is not positive.
    """

    spacing: Length
    diameter: Diameter

    def validate(self):
        """Warn of a diameter that is probably in inches, and of a distance that no casing has."""
        doubt_width(self, "diameter")
        if self.spacing > _APART:
            warn(
                f"Centraliser.spacing = {self.spacing:g} m is more than centralisers are apart, a few joints of 12 m "
                f"at most: {self.spacing:g} in are '{self.spacing:g} in'"
            )


@dataclass(frozen=True)
class _Tubular(_Bendable):
    """Base of the components of steel, by their dimensions or by the name of a standard size.

    Args:
        length: m; None for the one that fills up to the surface.
        size: the name of a standard size, from which whatever is not given is taken.
        outer_diameter, inner_diameter: of the body, m.
        tool_joint: largest outer diameter, which touches the wall, m; None for the body's.
        mass: in air with tool joints, kg/m; None: the body's.
        material: a `Material` with a density.
        name: in tables.
        damping_time: s, as of `Component`.
        bend: of its housing, degrees, up to 5: two straight pieces at an angle, free of stress. bend_at: its distance
            from the component's lower end, m. tool_face: the side of the hole that the bend points its lower end to,
            degrees clockwise from the high side looking down the hole (from north where it is vertical), by default 0.
        centralisers: a `Centraliser`: its rings touch; the soft string touches with their diameter everywhere.
        joint_spacing: of the tool joints, m, such as 9.45 of range 2: the pipe between them bends more than the hole,
            see `bending_between_joints`. It counts in `TorqueAndDrag.utilisation` alone.

    Raises:
        SceneError: a dimension that is missing or not positive, an inner diameter that is not below the outer one, or
            an unknown size; a bend without its place or beyond the component, a place or a tool face without a bend.
    """

    length: Length | None = None
    size: str | None = None
    outer_diameter: Diameter | None = None
    inner_diameter: Diameter | None = None
    tool_joint: Diameter | None = None
    mass: MassPerLength | None = None
    material: Material = STEEL
    name: str = ""
    damping_time: DampingTime = 0.0
    joint_spacing: Length | None = None
    centralisers: Centraliser | None = None

    weight = None

    def __post_init__(self):
        if isinstance(self.length, str):
            self._refuse_size_as_length()
        super().__post_init__()

    def _refuse_size_as_length(self):
        """Refuse the name of a size, or what looks like one, where a length belongs; say how both are written."""
        kind, given = type(self).__name__, self.length
        known = standard_sizes()[kind]
        names = {_plain(size): size for size in known}
        swapped = _LENGTH.match(str(self.size))
        alone = self.size is None and self.outer_diameter is None
        if _LENGTH.match(given) and not (_plain(given) in names and (swapped or alone)):
            return
        size = names.get(_plain(given))
        near = "" if size else f"; {_sizes_near(given, known)}"
        length, size = self.size if swapped else "300 ft", size or [*_of_its_diameter(given, known), *known][0]
        how = f"{kind}({length!r}, {size!r})" + ("" if swapped else f", or up to the surface {kind}(size={size!r})")
        refuse(self, "length", given, f"a length, then the name of a size, as in {how}{near}")

    def validate(self):
        """Fill in missing fields from the standard size or from the body."""
        super().validate()
        store(self, name=self.name or type(self)._called)
        if self.size is not None:
            known = standard_size(type(self).__name__, self.size)
            if any(getattr(self, name) is not None for name in ("outer_diameter", "inner_diameter", "mass")):
                known = {**known, "mass": self.mass}  # another section has another weight
            missing = ["size", *(name for name in known if getattr(self, name) is None)]
            store(self, **{name: known[name] for name in missing})
        positive("Material", "density", self.material.density, "kg/m^3, for the weight")
        for field in ("outer_diameter", "inner_diameter"):
            if getattr(self, field) is None:
                refuse(self, field, None, "a diameter (m), or the name of a standard size, size='...'")
        doubt_width(self, "outer_diameter")
        doubt_width(self, "tool_joint")
        Tube(self.outer_diameter, self.inner_diameter)  # refuses diameters of no tube
        body = self.material.density * math.pi / 4 * (self.outer_diameter**2 - self.inner_diameter**2)
        if self.mass is None:
            store(self, mass=body)
        if self.mass < _LIGHT * body:
            warn(
                f"{type(self).__name__}.mass = {self.mass:g} kg/m is less than its body weighs, {body:.4g} kg/m: are "
                f"these pounds per foot? {self.mass:g} lb/ft are '{self.mass:g} lb/ft'"
            )
        if self.tool_joint is not None and self.tool_joint < self.outer_diameter:
            refuse(self, "tool_joint", self.tool_joint, f"at least the body's diameter, {self.outer_diameter:g} m")
        if self.joint_spacing is not None and not (self.tool_joint or 0) > self.outer_diameter:
            refuse(self, "joint_spacing", self.joint_spacing, "tool_joint as well, wider than the body")
        if self.joint_spacing is not None and not _JOINTS[0] <= self.joint_spacing <= _JOINTS[1]:
            warn(
                f"{type(self).__name__}.joint_spacing = {self.joint_spacing:g} m is not that of drill pipe, 5.5 to 14 "
                "m (ranges 1 to 3): 31 ft are '31 ft' or 9.45"
            )
        if self.centralisers is not None and not self.centralisers.diameter > 2 * self.body_radius:
            expected = f"rings wider than the body, {2 * self.body_radius:g} m"
            refuse(self, "centralisers", self.centralisers, expected)

    @property
    def body_radius(self):
        """Contact radius between centralisers, m."""
        return (self.tool_joint or self.outer_diameter) / 2

    @property
    def contact_radius(self):
        """m."""
        return self.body_radius if self.centralisers is None else self.centralisers.diameter / 2

    def rings(self, length):
        return (
            ()
            if self.centralisers is None
            else np.arange(self.centralisers.spacing / 2, length, self.centralisers.spacing)
        )

    @cached_property
    def stiffness(self):
        """Of the body."""
        return Tube(self.outer_diameter, self.inner_diameter).stiffness(self.material)

    @cached_property
    def torsion(self):
        """Torsional stiffness (N m^2) and polar inertia per length (kg m), means of body and tool joints.

        A joint every 10 m is far shorter than the waves, which see the mean inertia and the mean compliance. The share
        of the length that joints have follows from the mass: they have the bore of the body, which lengthens them by
        what upsets and a narrower bore weigh.
        """
        body, share = self.stiffness, 0.0
        joint = Tube(self.tool_joint or self.outer_diameter, self.inner_diameter).stiffness(self.material)
        if joint.mass > body.mass:
            share = min(max((self.mass - body.mass) / (joint.mass - body.mass), 0.0), 1.0)
        compliance = (1 - share) / body.torsion + share / joint.torsion
        return 1 / compliance, (1 - share) * body.inertia[2] + share * joint.inertia[2]


class DrillPipe(_Tubular):
    __doc__ = (
        f"Drill pipe, such as DrillPipe(size='5 in 19.50 lb/ft').\n{(_Tubular.__doc__ or '').partition(chr(10))[2]}"
    )
    _called = "drill pipe"


class HeavyWeight(_Tubular):
    __doc__ = f"Heavy-weight drill pipe, such as size='5 in'.\n{(_Tubular.__doc__ or '').partition(chr(10))[2]}"
    _called = "heavy-weight"


class Collar(_Tubular):
    __doc__ = f"Drill collars, such as size='NC46-65'.\n{(_Tubular.__doc__ or '').partition(chr(10))[2]}"
    _called = "collar"


@dataclass(frozen=True)
class Stabiliser(StringPart):
    """A stabiliser: a tube with blades that touch the wall.

    Args:
        length: m.
        diameter: across the blades, m; at most the hole's.
        outer_diameter, inner_diameter: of the body, m.
        mass, material, name, damping_time: as of `DrillPipe`.

    Raises:
        SceneError: as of `DrillPipe`.
    """

    length: Length
    diameter: Diameter
    outer_diameter: Diameter
    inner_diameter: Diameter
    mass: MassPerLength | None = None
    material: Material = STEEL
    name: str = "stabiliser"
    damping_time: DampingTime = 0.0

    weight, touches = None, "middle"

    def validate(self):
        """Refuse blades that do not stand out, and diameters of no tube."""
        if self.diameter < self.outer_diameter:
            refuse(
                self, "diameter", self.diameter, f"across the blades, at least the body's, {self.outer_diameter:g} m"
            )
        sizes = (self.outer_diameter, self.inner_diameter, self.diameter, self.mass)
        body = Collar(self.length, None, *sizes, self.material)  # has the checks and the stiffness of a collar
        store(self, mass=body.mass, _body=body)

    contact_radius = property(lambda self: self._body.contact_radius)
    stiffness = property(lambda self: self._body.stiffness)


@dataclass(frozen=True)
class Bit(StringPart):
    """A bit, as a short solid cylinder.

    Args:
        diameter: m; at most the hole's.
        length: m.
        body_diameter: of the cylinder, m; None for 0.7 of the diameter.
        mass: in air, kg/m; None: the cylinder's.
        material, name, damping_time: as of `DrillPipe`.

    Raises:
        SceneError: a number that is not positive, or a body wider than the bit. A diameter of metres gives a
            `SceneWarning`.
    """

    diameter: Diameter
    length: Length = 0.3
    body_diameter: Diameter | None = None
    mass: MassPerLength | None = None
    material: Material = STEEL
    name: str = "bit"
    damping_time: DampingTime = 0.0

    inner_diameter, weight, touches = 0.0, None, "bottom"

    def validate(self):
        """Fill in missing fields from the diameter."""
        doubt_width(self, "diameter")
        if self.body_diameter is None:
            store(self, body_diameter=0.7 * self.diameter)
        if self.body_diameter > self.diameter:
            refuse(self, "body_diameter", self.body_diameter, f"at most the bit's, {self.diameter:g} m")
        if self.mass is None:
            density = positive("Material", "density", self.material.density, "kg/m^3, for the weight")
            store(self, mass=density * math.pi / 4 * self.body_diameter**2)

    outer_diameter = property(lambda self: self.body_diameter)
    contact_radius = property(lambda self: self.diameter / 2)

    @cached_property
    def stiffness(self):
        """Of the cylinder."""
        return Circle(self.body_diameter).stiffness(self.material)


def weight_in_mud(component, mud, md):
    """N/m at measured depths (m): as given, or from the mass in air and the fluids outside and inside, whose pressures
    carry a part of it.

    w = m g - rho_o g A_o + rho_i g A_i, the weight that goes with the effective tension: A. Sparks, J. Energy Resour.
    Technol. 106 (1984) 46, doi:10.1115/1.3231023. The outer area A_o is the area of the steel, mass over density, and
    of the bore A_i, so that tool joints count. Where the fluids change w jumps and the effective tension does not.
    Raises SceneError: no mud, and no weight in it."""
    if component.weight is not None:
        return np.full(np.shape(md), component.weight)[()]
    if mud is None:
        raise SceneError(
            f"mud = None: expected Mud(density), since {component.name} is given by its weight in air "
            "(Mud(0) for air, or Component(weight=...) by the weight in mud)"
        )
    steel, bore = component.mass / component.material.density, math.pi / 4 * component.inner_diameter**2
    outside, inside = mud.densities(md)
    return (component.mass - (outside * (steel + bore) - inside * bore)) * mud.gravity


def in_words(part, where, weight, units):
    """A sentence on a component: where it is, its weight, its width and its stiffness, in some units."""
    stiff, S = "stiffness not known", part.stiffness
    if S is not None and S.matrix is None:
        stiff = f"EI = {units.told(min(S.bending), 'N m^2', form='.4g')}"
    wide = units.told(2 * part.contact_radius, "m", "diameter", ".5g")
    bent = ""
    if part.bend:
        place = units.told(part.bend_at, "m")
        bent = f", bent by {part.bend:g} deg {place} above its lower end, tool face {part.tool_face:g} deg"
    return f"String, {part.name}: {where}, {weight}, {wide} wide where it touches the wall, {stiff}{bent}."


@dataclass(frozen=True)
class Laid:
    """A component in its place: measured depths (m) of its upper and lower end."""

    top: float
    bottom: float
    component: StringPart

    def weight_in(self, mud):
        """N/m in a mud, of a place with one fluid outside and one inside, see `in_columns`."""
        return float(weight_in_mud(self.component, mud, (self.top + self.bottom) / 2))


# Length (m) of a part below which a fluid that ends beside the end of a component ends there.
_SLIVER = 1e-4


def in_columns(laid, mud):
    """Components in their places, from the bit up, cut where a fluid gives way to another one."""
    cuts = [] if mud is None else mud.interfaces[::-1].tolist()
    found = []
    for place in laid:
        shared = place.component.weight is None
        inside = [x for x in cuts if shared and place.top + _SLIVER < x < place.bottom - _SLIVER]
        found += [Laid(top, bottom, place.component) for bottom, top in pairwise([place.bottom, *inside, place.top])]
    return found


@dataclass(frozen=True)
class DrillString(InWords, Part):
    """A string of components.

    Args:
        components: `DrillPipe`, `Component` ... from the bit up. The uppermost one fills up to the surface: its length
            is None. With a length, the string hangs from the surface only at the depth that is the sum of lengths.
        order: "bit up", or "top down": `components` from the surface down.

    Attributes:
        components: from the bit up, whatever the order was.

    Raises:
        SceneError: no components, an unknown order, or a length that is missing below the uppermost component.
    """

    components: tuple[StringPart, ...]
    order: Literal["bit up", "top down"] = "bit up"

    def __post_init__(self):
        if isinstance(self.components, StringPart):
            store(self, components=(self.components,))
        super().__post_init__()

    def validate(self):
        """Put the components in the order from the bit up; refuse a length that is missing below the uppermost one."""
        given, other = self.components, "top down" if self.order == "bit up" else "bit up"
        if not given:
            refuse(self, "components", given, "at least one component")
        given = given if self.order == "bit up" else given[::-1]
        store(self, components=given, order="bit up")
        for part in given[:-1]:
            if part.length is None:
                expected = f"a length (m): only the uppermost component, {given[-1].name}, fills up"
                if part is given[0]:
                    expected += f"; where the list runs the other way, say order='{other}'"
                refuse(part, "length", None, expected)
        bits = [k for k, part in enumerate(given) if isinstance(part, Bit)]
        if bits and bits[-1]:
            told = f"{len(bits)} bits" if len(bits) > 1 else f"the bit is component {bits[0] + 1} from below"
            warn(f"DrillString: {told}, of {len(given)} components: expected one bit, the lowest component; where the "
                 f"list runs the other way, say order='{other}'")  # fmt: skip

    @property
    def bent(self) -> str:
        """Names of the components with a bend, from the bit up; "" where there are none."""
        return " and ".join(part.name for part in self.components if part.bend)

    @property
    def least_depth(self) -> float:
        """Measured depth (m) below which all of it is in the hole: the length below a component that fills up."""
        return 0.0 if self.components[-1].length is not None else math.fsum(x.length for x in self.components[:-1])

    def fitting(self, depths):
        """Those of measured depths (m) at which all of it is in the hole, or all depths where there are none."""
        return [x for x in depths if x > self.least_depth * (1 + 1e-9)] or depths

    def sentences(self, units: Units):
        """On its components from the bit up, in some units."""
        for part in self.components:
            where = "up to the surface" if part.length is None else f"length {units.told(part.length, 'm')}"
            if part.weight is not None:
                weight = f"{units.told(part.weight, 'N/m', 'force per length', '.2f', 'N/m')} in mud"
            else:
                weight = f"{units.told(part.mass, 'kg/m', form='.2f')} in air"
            yield in_words(part, where, weight, units)

    def sentences_at(self, depth, mud, units):
        """Sentences on the components in their places, with the bit at a measured depth (m) in a mud, in some units."""
        for place in in_columns(self.laid(depth), mud):
            where = f"md {units.told(place.top, 'm').split()[0]} to {units.told(place.bottom, 'm')}"
            weight = units.told(place.weight_in(mud), "N/m", "force per length", ".2f", "N/m")
            yield in_words(place.component, where, f"{weight} in mud", units)

    def laid(self, depth, told=str):
        """The components in their places with the lower end at a measured depth (m), from the bit up; told: makes
        messages of sentences with lengths in m, see `WellPath.told`.

        Raises:
            SceneError: the string is longer or shorter than the depth.
        """
        places, bottom = [], depth
        for part in self.components:
            top = 0.0 if part.length is None else bottom - part.length
            top = 0.0 if abs(top) < 1e-9 * depth else top
            if top < 0 or bottom <= 0:
                raise SceneError(told(
                    f"DrillString: {part.name} reaches {-top:.6g} m above the surface at the depth {depth:.6g} m: "
                    "expected a string that is no longer; the uppermost component fills up where it has no length"
                ))  # fmt: skip
            places.append(Laid(top, bottom, part))
            bottom = top
        if places[-1].top > 0:
            raise SceneError(told(
                f"DrillString: it ends {places[-1].top:.6g} m below the surface at the depth {depth:.6g} m: expected "
                "an uppermost component without a length, which fills up"
            ))  # fmt: skip
        return places
