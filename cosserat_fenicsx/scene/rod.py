"""A rod: a curve, a section and a material; and the stations on it that everything else refers to."""

import itertools
import math
from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.checks import instance, number, refuse, store
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.quadrature import gauss
from cosserat_fenicsx.scene.curves import CURVES
from cosserat_fenicsx.scene.damping import Damping
from cosserat_fenicsx.scene.materials import Material
from cosserat_fenicsx.scene.profiles import Profile
from cosserat_fenicsx.scene.sections import Stiffness

_unnamed = itertools.count(1)


@dataclass(frozen=True, eq=False)
class Rod:
    """A slender body with its reference centreline, stress-free as drawn.

    Args:
        curve: the reference centreline: `Line`, `Arc`, `Helix`, `Spline` or `UniformCurvature`.
        section: `Circle`, `Tube`, `Rectangle` or `Stiffness`; or a list of pieces (s_end, section) from the start to the
            end, s_end in m, the last the rod's length or None for it; or a function from arc length (m) to a section,
            smooth in s, which may also stand in a piece.
        material: a `Material`; not needed with `Stiffness`.
        name: how messages, files and scene files call it.
        damping: a `Damping`, for motions; None for none.

    Attributes:
        stiffness: the `Stiffness` at s = 0, which is that of the whole rod where `profile.constant`.
        profile: the `Profile` of its sections.

    Raises:
        SceneError: a part of the wrong kind, a missing material, or pieces that do not ascend to the length.
    """

    curve: object
    section: object
    material: Material | None = None
    name: str | None = None
    damping: Damping | None = None
    stiffness: Stiffness = field(init=False, repr=False)
    profile: Profile = field(init=False, repr=False)

    def __post_init__(self):
        if self.name is None:
            store(self, name=f"rod{next(_unnamed)}")
        instance(self, "name", self.name, str, "a string")
        if "@" in self.name:
            refuse(self, "name", self.name, "a name without '@', which parts it from the s of a station")
        instance(self, "curve", self.curve, CURVES, "a curve such as Line(start, end)")
        if self.material is not None:
            instance(self, "material", self.material, Material, "a Material")
        if self.damping is not None:
            instance(self, "damping", self.damping, Damping, "a Damping")
        store(self, profile=Profile(self, self.section, self.material))
        store(self, stiffness=self.profile.start)

    @property
    def length(self):
        """Reference arc length, m."""
        return self.curve.length

    @property
    def breaks(self):
        """Arc lengths inside the rod where its curve is not smooth or its section may jump, ascending, m."""
        breaks = []
        for s in sorted({*self.curve.breaks, *self.profile.breaks}):
            if s - (breaks[-1] if breaks else 0.0) > 1e-9 * self.length:
                breaks.append(s)
        return tuple(breaks)

    @property
    def uniform(self):
        """Whether curvature, twist and section are constant between the `breaks`: no spline, no section that is a function of s."""
        return self.curve.uniform and self.profile.uniform

    def stiffness_at(self, s, side="right"):
        """Stiffnesses and mass at reference arc lengths.

        Args:
            s: (...), m, in [0, length].
            side: "left" or "right": just before or just after s, where the section jumps there.

        Returns:
            `Stiffnesses`: K (..., 3) = (GA1, GA2, EA), N; J (..., 3) = (EI1, EI2, GJ), N m^2; mass (...), kg/m, and
            inertia (..., 3), kg m, about d_1, d_2, d_3, or None where they are not known everywhere.

        Raises:
            SceneError: a function of s that gives no section there.
        """
        return self.profile.stiffness(s, side)

    def section_at(self, s, side="right"):
        """The section at one reference arc length, m; `side` as for `stiffness_at`."""
        return self.profile.section(s, side)

    @property
    def start(self):
        """The station at s = 0."""
        return Station(self, 0.0)

    @property
    def end(self):
        """The station at s = length."""
        return Station(self, self.length)

    def at(self, s):
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


def station_named(where, text, rods):
    """The station 'rod.start', 'rod.end' or 'rod@s', s in m.

    Args:
        where: what is named so, for the message; rods: {name: rod}.

    Raises:
        SceneError: it is none of these, or no rod has this name, or it lies beyond its rod.
    """
    expected = "expected 'rod.start', 'rod.end' or 'rod@s' with s in m"
    if not isinstance(text, str):
        raise SceneError(f"{where} = {text!r}: {expected}")
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


def euler_load(rod):
    """Critical load of the cantilever column, N: pi^2 EI/(2L)^2 with the smaller bending stiffness.

    Where the section changes, the least P with (EI theta')' + P theta = 0, theta(0) = theta'(L) = 0, about either axis
    (Gauss collocation of theta', exact to about 1e-12 where EI is smooth between the rod's breaks).
    """
    if rod.profile.constant:
        return math.pi**2 * min(rod.stiffness.bending) / (2 * rod.length) ** 2
    return min(_column_load(rod, axis) for axis in (0, 1))


def _column_load(rod, axis, pieces=4, points=8):
    """The critical load for bending about d_1 or d_2: the unknowns are theta' at the Gauss points."""
    breaks = np.array([0.0, *rod.breaks, rod.length])
    ends = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(pieces) / pieces).ravel(), rod.length)
    rule, half = gauss(points), np.diff(ends) / 2
    inner = np.polynomial.legendre.legvander(rule.points, points) @ rule.integral
    s, weights = (
        ((ends[:-1] + half)[:, None] + np.outer(half, rule.points)).ravel(),
        np.outer(half, rule.weights).ravel(),
    )
    theta = np.kron(np.tri(len(half), k=-1), np.ones((points, points))) * weights + np.kron(np.diag(half), inner)
    # P is the least of (int EI theta'^2)/(int theta^2)
    EI = rod.stiffness_at(s).J[:, axis]
    return float(1 / np.linalg.norm(np.sqrt(weights)[:, None] * theta / np.sqrt(weights * EI), 2) ** 2)
