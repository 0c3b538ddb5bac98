"""Rods, made of a curve, sections and a material, their damping, and the stations on them that supports, loads and
joints refer to, also by names, which are looked up when the scene is put together."""

import dataclasses
import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import Numbers, instance, number, refuse, store
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.numerics import gauss
from cosserat_fenicsx.parts import Number, Part, Text, at_least, fields_of
from cosserat_fenicsx.scene.curves import Curve
from cosserat_fenicsx.scene.profiles import (
    MassCentre,
    Offset,
    Section,
    Sections,
    SectionsAlong,
    Stiffnesses,
    mass_centre_of,
)
from cosserat_fenicsx.scene.sections import Material, PerDirector, Stiffness
from cosserat_fenicsx.scene.signals import Signal


@dataclass(frozen=True)
class Damping(Part):
    """Damping of a rod.

    Kelvin-Voigt: to n and m are added Kt v_t and Jt u_t, the rates of the material strains, eqs. (2)-(3). A mode of a
    beam with the angular frequency omega decays as exp(-time omega^2 t/2). Drag: every section feels the force and the
    moment -drag times its momentum and its angular momentum, and so do each `PointMass` at the rod and the mass of an
    `AddedMass`; modes decay as exp(-drag t/2). For drag on the rod alone see `LinearDrag`.

    Args:
        time: s; Kt and Jt are `time` times the stiffnesses, and so are the couplings of a `Stiffness.matrix`.
        drag: 1/s.
        Kt: (GAt1, GAt2, EAt), N s, instead of `time` times K.
        Jt: (EIt1, EIt2, GJt), N m^2 s, instead of `time` times J; where either is given, rates of stretch and shear
            cause no moment and rates of bending and torsion no force.

    Raises:
        SceneError: a number below zero, or not three of them.
    """

    time: Annotated[float, Number("time", at_least(0))] = 0.0
    drag: Annotated[float, Number("rate", at_least(0))] = 0.0
    Kt: Annotated[tuple, PerDirector(Number(limits=at_least(0, "a viscosity (N s)")))] | None = None
    Jt: Annotated[tuple, PerDirector(Number(limits=at_least(0, "a viscosity (N m^2 s)")))] | None = None

    @classmethod
    def ratio(cls, ratio: float, frequencies: Numbers) -> "Damping":
        """The damping with a given damping ratio drag/(2 omega) + time omega/2 at two frequencies.

        Args:
            ratio: of the damping to the critical one, in [0, 1).
            frequencies: two, Hz; the ratio is smaller between them and larger outside.

        Raises:
            SceneError: a value outside its range.
        """
        ratio = number("Damping.ratio", "ratio", ratio, "a number from 0 to below 1", lambda x: 0 <= x < 1)
        if not isinstance(frequencies, tuple | list) or len(frequencies) != 2:
            refuse("Damping.ratio", "frequencies", frequencies, "two frequencies (Hz)")
        one, two = (
            2 * math.pi * number("Damping.ratio", "frequencies", f, "positive numbers (Hz)", lambda x: 0 < x < math.inf)
            for f in frequencies
        )
        return cls(time=2 * ratio / (one + two), drag=2 * ratio * one * two / (one + two))

    @classmethod
    def constructors(cls):
        return cls, cls.ratio

    @property
    def sizes(self):
        """All its numbers, zero where nothing is damped."""
        return (self.time, self.drag, *(self.Kt or ()), *(self.Jt or ()))

    def viscosity(self, stiffnesses):
        """The viscosities as `Stiffnesses` (times s), from the elastic ones."""
        Kt, Jt = (
            self.time * values if given is None else np.broadcast_to(given, values.shape)
            for values, given in ((stiffnesses.K, self.Kt), (stiffnesses.J, self.Jt))
        )
        matrix = stiffnesses.matrix
        if matrix is not None:
            matrix = self.time * matrix
            for given, part in ((self.Kt, slice(0, 3)), (self.Jt, slice(3, 6))):
                if given is not None:
                    matrix[..., part, :] = matrix[..., :, part] = 0.0
                    matrix[..., part, part] = np.diag(given)
        return stiffnesses._replace(K=Kt, J=Jt, matrix=matrix)


_unnamed = itertools.count(1)
# Largest number of rods listed in a message.
_NAMED = 8


@dataclass(frozen=True, eq=False)
class Rod(Part):
    """A slender body with its reference centreline, free of stress in the reference.

    Args:
        curve: the reference centreline: `Line`, `Arc`, `Helix`, `Spline` or `UniformCurvature`.
        section: `Circle`, `Tube`, `Rectangle` or `Stiffness`; or a list of pieces (s_end, section) from the start to
            the end, s_end in m, the last the rod's length or None for it; or a smooth function from arc length (m) to a
            section, which a piece may also have.
        material: a `Material`; not needed with `Stiffness`.
        name: its name in messages, results and scene files.
        damping: a `Damping`, for motions; None for none.
        eccentricity: the mass centre of the sections off the axis, for motions, natural modes and `Weight`: (a1, a2)
            along d_1 and d_2, m; pieces (s_end, (a1, a2)) or a function, as for the section; None on the axis. The
            inertia of a section is about its mass centre.

    Attributes:
        stiffness: the `Stiffness` at s = 0, which is that of the whole rod where `profile.constant`.
        profile: the `Sections` along it.
        mass_centre: the `MassCentre` of an eccentric rod, else None.

    Raises:
        SceneError: a part of the wrong kind, a missing material, or pieces that do not ascend to the length.
    """

    curve: Curve
    section: SectionsAlong
    material: Material | None = None
    name: str | None = None
    damping: Damping | None = None
    eccentricity: Offset | None = None
    stiffness: Stiffness = dataclasses.field(init=False, repr=False)
    profile: Sections = dataclasses.field(init=False, repr=False)
    mass_centre: MassCentre | None = dataclasses.field(init=False, repr=False)

    def validate(self):
        if self.name is None:
            store(self, name=f"rod{next(_unnamed)}")
        if "@" in self.name:
            refuse(self, "name", self.name, "a name without '@', which separates it from the s of a station")
        store(self, profile=Sections(self, self.section, self.material))
        store(self, stiffness=self.profile.start)
        store(self, mass_centre=mass_centre_of(self))
        store(self, eccentricity=self.mass_centre and self.mass_centre.given)

    def __repr__(self):
        return f"<Rod '{self.name}': {type(self.curve).__name__}, length {self.length:g} m>"

    @cached_property
    def length(self) -> float:
        """Reference arc length, m."""
        return self.curve.length

    @property
    def breaks(self) -> tuple[float, ...]:
        """Arc lengths inside the rod where its curve is not smooth or its section may jump, ascending, m."""
        breaks, offsets = [], self.mass_centre.breaks if self.mass_centre else ()
        for s in sorted({*self.curve.breaks, *self.profile.breaks, *offsets}):
            if s - (breaks[-1] if breaks else 0.0) > 1e-9 * self.length:
                breaks.append(s)
        return tuple(breaks)

    @cached_property
    def uniform(self) -> bool:
        """Whether curvature, twist and section are constant between the `breaks`: no splines, no functions of s."""
        return self.curve.uniform and self.profile.uniform

    def stiffness_at(self, s: float | Numbers, side: str = "right") -> Stiffnesses:
        """Stiffnesses and mass at reference arc lengths.

        Args:
            s: (...), m, in [0, length].
            side: "left" or "right": the limit from below or from above where the section jumps at s.

        Returns:
            `Stiffnesses`; mass and inertia are None where they are not known everywhere.

        Raises:
            SceneError: a function of s that returns no section there.
        """
        return self.profile.stiffness(s, side)

    def section_at(self, s: float, side: str = "right") -> Section:
        """The section at one reference arc length, m; `side` as for `stiffness_at`."""
        return self.profile.section(s, side)

    @property
    def start(self) -> "Station":
        """The station at s = 0."""
        return Station(self, 0.0)

    @property
    def end(self) -> "Station":
        """The station at s = length."""
        return Station(self, self.length)

    def at(self, s: float) -> "Station":
        """The station at reference arc length s, m, in [0, length]."""
        L = self.length
        s = number(self, "at(s)", s, f"an arc length in [0, {L:g}] m", lambda s: -1e-12 * L <= s <= L * (1 + 1e-12))
        return Station(self, min(max(s, 0.0), L))


@dataclass(frozen=True)
class Station:
    """A point of a rod by its reference arc length s, m; made by `rod.start`, `rod.end`, `rod.at(s)`."""

    rod: Rod
    s: float

    def __str__(self):
        if math.isclose(self.s, self.rod.length, rel_tol=1e-12):
            return f"{self.rod.name}.end"
        return f"{self.rod.name}.start" if self.s == 0 else f"{self.rod.name}@{self.s:g}"

    __repr__ = __str__

    @property
    def full_name(self):
        """Its name with all digits of s."""
        places = {0.0: ".start", self.rod.length: ".end"}
        return f"{self.rod.name}{places.get(self.s, f'@{self.s!r}')}"


def station_named(where, text, rods):
    """The station 'rod.start', 'rod.end' or 'rod@s' (m) of {name: rod}; a SceneError of `where` for others."""
    known = ", ".join([*rods][:_NAMED]) + (", ..." if len(rods) > _NAMED else "")
    expected = f"expected 'rod.start', 'rod.end' or 'rod@s' with s in m and the rod one of {known}"
    if not isinstance(text, str):
        raise SceneError(f"{where} = {text!r}: {expected}")
    if text in rods:
        expected = f"it is a rod, expected '{text}.start', '{text}.end' or '{text}@s' with s in m"
    if "@" in text:
        name, _, s = text.partition("@")
        try:
            place = float(s)
        except ValueError:
            raise SceneError(f"{where} = '{text}': {expected}") from None
    else:
        name, _, place = text.rpartition(".")
        if place not in ("start", "end"):
            raise SceneError(f"{where} = '{text}': {expected}")
    if name not in rods:
        raise SceneError(f"{where} = '{text}': no rod is named '{name}', {nearest(name, rods)}")
    if isinstance(place, str):
        return getattr(rods[name], place)
    try:
        return rods[name].at(place)
    except SceneError as problem:
        raise SceneError(f"{where} = '{text}': {problem}") from None


@dataclass(frozen=True)
class ByName(Text):
    """A `Station` or a `Rod` (`kind`), or its name, which data have and `Scene` looks up."""

    kind: type = Station

    @property
    def words(self):
        return f"{'a station such as rod.end' if self.kind is Station else 'a Rod'}, or its name"

    def check(self, owner, field, value):
        if self.kind is Station and isinstance(value, Rod):
            refuse(owner, field, value, f"a station of it, such as '{value.name}.start' or '{value.name}.end'")
        return instance(owner, field, value, self.kind | str, self.words)

    def write(self, value, writing):
        return value if isinstance(value, str) else value.name if isinstance(value, Rod) else value.full_name


Station.by_name, Rod.by_name = ByName(Station), ByName(Rod)
#: Fields of supports, loads and joints that say where they act.
StationOrName = Annotated[Station | str, Station.by_name]
RodOrName = Annotated[Rod | str, Rod.by_name]


def is_known(owner, field, kind):
    """Whether a field holds a `Station` or a `Rod` (kind); False for a name, which `Scene` looks up; or SceneError."""
    return not isinstance(kind.by_name.check(owner, field, getattr(owner, field)), str)


def mass_arm(rod, s, side="right"):
    """The arms (..., 3) from the axis of an eccentric rod to its mass centre in the reference, inertial, m."""
    return np.einsum("...ij,...j->...i", rod.curve.frame(s), rod.mass_centre.at(s, side))


def require_inertia(rod, user, fields=("mass", "inertia")):
    """Refuse (SceneError) a rod without mass or inertia, which `user` needs."""
    low = rod.profile.range[0]
    for name in fields:
        if getattr(low, name) is None:
            owner, field = ("Stiffness", name) if rod.material is None else ("Material", "density")
            refuse(f"Rod '{rod.name}': {owner}", field, None, f"a value, which {user} needs")


def euler_load(rod: Rod) -> float:
    """Critical load of the cantilever column, N: pi^2 EI/(2L)^2 with the smaller bending stiffness.

    Where the section changes, the least P with m' + P theta = 0, theta(0) = m(L) = 0 and theta' = F m, F the
    flexibility of bending (Gauss collocation of theta', exact to about 1e-12 where F is smooth between the rod's
    breaks).
    """
    if rod.profile.constant:
        return math.pi**2 * float(rod.profile.range[0].J[:2].min()) / (2 * rod.length) ** 2
    return _column_load(rod)


def _column_load(rod, pieces=4, points=8):
    """The critical load of a column whose section changes: the unknowns are theta' at the Gauss points."""
    breaks = np.array([0.0, *rod.breaks, rod.length])
    ends = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(pieces) / pieces).ravel(), rod.length)
    rule, half = gauss(points), np.diff(ends) / 2
    inner = np.polynomial.legendre.legvander(rule.points, points) @ rule.integral
    s, weights = (
        ((ends[:-1] + half)[:, None] + np.outer(half, rule.points)).ravel(),
        np.outer(half, rule.weights).ravel(),
    )
    theta = np.kron(np.tri(len(half), k=-1), np.ones((points, points))) * weights + np.kron(np.diag(half), inner)
    # P is the minimum of (int m . F m)/(int theta^2) with theta' = F m, for both bending directions, which F may couple
    root = np.linalg.cholesky(rod.stiffness_at(s).flexibility)
    scaled = (np.sqrt(weights)[:, None] * theta / np.sqrt(weights))[:, None, :, None] * root.swapaxes(0, 1)[None]
    return float(1 / np.linalg.norm(scaled.reshape(2 * len(s), -1), 2) ** 2)


# Fields of actions that may hold names, also in users' classes with other annotations.
_OF_ACTIONS = {"station": Station.by_name, "rod": Rod.by_name}


def _look_up(where, name, kind, rods):
    """The `Station` or `Rod` of a name among rods {name: rod}; `kind`: a `ByName`."""
    if kind.kind is Station:
        return station_named(where, name, rods)
    if name not in rods:
        raise SceneError(f"{where} = {name!r}: no rod has this name, {nearest(name, rods)}")
    return rods[name]


def with_names(where, item, rods):
    """A part of a scene with stations and rods in place of their names, from {name: rod}; the part itself where it has
    none; a SceneError of `where` if there is none of that name, or the part refuses it."""
    if isinstance(item, type) or not dataclasses.is_dataclass(item):  # refused by `Scene`
        return item
    kinds = fields_of(type(item))
    if not any(isinstance(getattr(item, name), str) for name in kinds):
        return item
    given = {name: (getattr(item, name), kind) for name, kind in kinds.items()}
    found = {
        name: _look_up(f"{where}.{name}", value, kind if isinstance(kind, ByName) else _OF_ACTIONS[name], rods)
        for name, (value, kind) in given.items()
        if isinstance(value, str) and (isinstance(kind, ByName) or name in _OF_ACTIONS)
    }
    if not found:
        return item
    # the constructor checks functions of time again, with the place in their messages
    functions = {name: value.function for name, (value, _) in given.items() if isinstance(value, Signal)}
    return dataclasses.replace(item, **functions, **found)
