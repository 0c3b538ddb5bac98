"""Strength of the body of a pipe, in closed form: API RP 7G and API Bulletin 5C3, with the numbers of their tables.

- Tension Y A; torque 0.577 Y J/r, and with a tension t 0.577 (Y^2 - (t/A)^2)^(1/2) J/r: API RP 7G, appendix A.9.
- Burst: 2 Y t/D of the thinnest wall, 7/8 of a new one (Barlow), with the new pipe's D.
- Collapse: the four formulas of API Bulletin 5C3, section 1, by D/t: at yield, plastic, transition, elastic; a tension
  makes the yield strength ((1 - 3/4 z^2)^(1/2) - z/2) Y, z = (t/A)/Y; the pressure inside carries 1 - 2 t/D of itself.
- Fatigue of drill pipe that rotates in a bend: A. Lubinski, J. Petr. Technol. 13 (1961) 175, doi:10.2118/1543-G-PA; the
  allowed bending stress is that of API RP 7G, of grade E, and of S-135 from its yield strength on, which is known for
  these two alone: X95 and G105 have that of grade E.

Wear: the share of the wall that is left, worn off the outside: 0.8 of the class "premium", 0.7 of "class 2". All is of
the body: tool joints and their connections are left out, and so is damage by corrosion.

Bending of a pipe between its tool joints, which alone rest on the wall of a curved hole.

A span of length 2 L between two joints under an effective tension T, whose ends have the direction of the hole, of
curvature K; k = (T/EI)^(1/2), x from the middle, u the deviation from the hole's curve towards the wall that the joints
lean on, h how far a joint stands out from the body:

    free     c(x) = K k L cosh(k x)/sinh(k L),  u(0) = K (L^2/2 - L tanh(k L/2)/k) < h
    point    c(x) = A cosh(k x) + B sinh(k x) from the middle on, where a force -2 EI k B acts and u(0) = h;
             the integral of c is K L, that of x c is h + K L^2/2
    wrapped  the middle lies on the wall with the curvature K (as soon as A > K), and the same holds for the rest of
             the span, s long, with A = K: its two integrals give B and s

In compression, k = i q: K q L/sin(q L) in the middle, up to q L = pi/2, where a span with hinges buckles. The weight of
the span is left out. A. Lubinski, J. Petr. Technol. 13 (1961) 175, doi:10.2118/1543-G-PA; P. R. Paslay &
E. Y. Cernocky, SPE 22547 (1991), doi:10.2118/22547-MS.
"""

import re
from collections import namedtuple
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import instance, number, refuse, store
from cosserat_fenicsx.quantities import Units, in_si
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.parts import Part
from cosserat_fenicsx.results.screen import InWords
from cosserat_fenicsx.units import inch, ksi, psi
from cosserat_fenicsx.well.components import Collar, DrillPipe, HeavyWeight, StringPart
from cosserat_fenicsx.well.pieces import areas, sections_of, true_tension, von_mises


FREE, POINT, WRAPPED, UNKNOWN = range(4)
MODES = ("free", "point", "wrapped", "not known")
# Below this, (k L)^2 changes nothing; below the second, the wrapped end's equation is its series; steps of bisection.
_NONE, _SERIES, _STEPS = 1e-8, 0.02, 60

#: Arrays: index in `MODES`; curvature at the joints and in the middle, 1/m; deviation in the middle, m; force of the
#: wall on the body, N. All but the first are NaN where nothing is known.
Bent = namedtuple("Bent", "mode joint middle deviation force")


@dataclass(frozen=True)
class PipeBetweenJoints(InWords):
    """Bending of a pipe between its tool joints, from `bending_between_joints`.

    Attributes:
        mode: "free", or how its body touches the wall: "point" in the middle, "wrapped" along a part.
        at_joint, in_middle: curvature of the pipe, 1/m. factor: the larger one over the hole's.
        deviation: in the middle, m, from the hole's curve towards the wall that the joints lean on; below 0 away
            from the centre of curvature, in compression.
        wall_force: on the body between two joints, N. bending_stress: the largest, Pa.
    """

    mode: str
    at_joint: float
    in_middle: float
    factor: float
    deviation: float
    wall_force: float
    bending_stress: float

    def sentences(self, units: Units):
        """On its contact, its curvature and its stress, in some units."""
        how = {"free": "touches the wall at its joints alone", "point": "touches the wall in the middle",
               "wrapped": "lies on the wall between its joints"}[self.mode]  # fmt: skip
        yield (
            f"The pipe {how}: its largest curvature is {self.factor:.4g} times the hole's, its bending stress "
            f"{units.told(self.bending_stress, 'Pa', form='.4g')}, the force of the wall on its body "
            f"{units.told(self.wall_force, 'N', form='.4g')}."
        )


def bending_between_joints(pipe: StringPart, tension: float, curvature: float) -> PipeBetweenJoints:
    """Bending of a pipe between its tool joints in a curved hole.

    Args:
        pipe: a `DrillPipe` with `joint_spacing` and a tool joint.
        tension: effective tension, N; compression is negative.
        curvature: of the hole, 1/m or text, such as "3 deg/100ft".

    Raises:
        SceneError: a pipe without tool joints or their spacing; in compression, a body that touches the wall or buckles
            between its joints, whose bending is not known.
    """
    who = "bending_between_joints"
    instance(who, "pipe", pipe, StringPart, "a DrillPipe(..., joint_spacing=...)")
    tension = number(who, "tension", tension, "a force (N)", np.isfinite)
    curvature = number(who, "curvature", curvature, "a curvature (rad/m), not negative", lambda x: 0 <= x < 10)
    half, gap = span_of(pipe)
    if half is None:
        raise SceneError(f"{who}: {pipe.name} has no joint_spacing: expected DrillPipe(..., joint_spacing=9.45)")
    EI = min(pipe.stiffness.bending)
    found = bent(EI, half, gap, np.array(tension), np.array(curvature))
    if found.mode == UNKNOWN:
        raise SceneError(
            f"{who}: tension = {tension:g} N: with this compression the body of {pipe.name} touches the wall or "
            f"buckles between its joints, {2 * half:g} m apart: expected less compression, or solve the rod in "
            "contact, torque_and_drag(..., model='rod'), with the joints as rings: Centraliser(spacing, diameter)"
        )
    mode, joint, middle, deviation, force = (float(x) for x in found)
    largest = max(joint, middle)
    factor = largest / curvature if curvature > 0 else 1.0
    return PipeBetweenJoints(MODES[int(mode)], joint, middle, factor, deviation, force,
                             pipe.material.E * pipe.outer_diameter / 2 * largest)  # fmt: skip


def span_of(part):
    """Half the length between tool joints of a component, and how far these stand out from its body, m; (None, 0)
    where it has none, or their spacing is not given."""
    spacing, joint = getattr(part, "joint_spacing", None), getattr(part, "tool_joint", None)
    if spacing is None or joint is None or not joint > part.outer_diameter:
        return None, 0.0
    return spacing / 2, (joint - part.outer_diameter) / 2


def bent(EI, half, gap, tension, curvature):
    """`Bent` of arrays: EI (N m^2), half the span, how far joints stand out (m), tension (N), curvature (1/m)."""
    EI, half, gap, tension, curvature = (
        np.array(x, dtype=float) for x in np.broadcast_arrays(EI, half, gap, tension, curvature)
    )
    square = tension / EI * half**2  # (k L)^2
    found = Bent(np.full(square.shape, FREE), curvature.copy(), curvature.copy(), np.zeros_like(square),
                 np.zeros_like(square))  # fmt: skip
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        _compressed(found, half, gap, curvature, square)
        pulled = square > _NONE
        x = np.sqrt(np.where(pulled, square, 1.0))
        sech, tanh = 1 / np.cosh(x), np.tanh(x)
        deviation = curvature * half**2 * (0.5 - np.tanh(x / 2) / x)
        _put(found, pulled, FREE, curvature * x / tanh, curvature * x / np.sinh(x), deviation, 0.0)
        touches = pulled & (deviation > gap)
        if touches.any():
            k = x / half
            # A and B times cosh(k L)
            rows = (tanh, 1 - sech, x * tanh - 1 + sech, x - tanh)
            right = curvature * x, k**2 * (gap + curvature * half**2 / 2)
            det = rows[0] * rows[3] - rows[1] * rows[2]
            A, B = (right[0] * rows[3] - rows[1] * right[1]) / det, (rows[0] * right[1] - rows[2] * right[0]) / det
            force = -2 * EI * k * B * sech
            _put(found, touches, POINT, A + B * tanh, A * sech, gap, force)
            wraps = touches & (A * sech > curvature)
            if wraps.any():
                _wrapped(found, wraps, EI, half, gap, tension, curvature, k)
    return found


def _put(found, where, mode, *values):
    found.mode[where] = mode
    for array, value in zip(found[1:], values, strict=True):
        array[where] = np.broadcast_to(value, array.shape)[where]


def _compressed(found, half, gap, curvature, square):
    """Spans in compression: free, or not known."""
    pushed = square < -_NONE
    x = np.sqrt(np.where(pushed, -square, 1.0))
    deviation = curvature * half**2 * (0.5 - np.tan(x / 2) / x)
    _put(found, pushed, FREE, curvature * x / np.tan(x), curvature * x / np.sin(x), deviation, 0.0)
    beyond = pushed & ((x >= np.pi / 2) | (-deviation > gap))
    _put(found, beyond, UNKNOWN, *[np.nan] * 4)


def _wrapped(found, where, EI, half, gap, tension, curvature, k):
    """Spans whose middle lies on the wall; the equation of the free rest's length is solved by bisection."""
    EI, half, gap, tension, curvature, k = (x[where] for x in (EI, half, gap, tension, curvature, k))
    asked = gap * k**2 / curvature

    def end(u):
        """B over K of the free rest, u = k s; and its deviation, over K and times k^2."""
        B = (u - np.sinh(u)) / (np.cosh(u) - 1)
        moved = (u * np.sinh(u) - np.cosh(u) + 1) + B * (u * np.cosh(u) - np.sinh(u)) - u**2 / 2
        return B, np.where(u < _SERIES, u**4 / 72, moved)

    low, high = np.zeros_like(k), k * half
    for _ in range(_STEPS):
        u = (low + high) / 2
        short = end(u)[1] < asked
        low, high = np.where(short, u, low), np.where(short, high, u)
    B, _ = end(u)
    force = 2 * curvature * (tension * (half - u / k) - EI * k * B)
    for array, value in zip(found, (WRAPPED, curvature * (np.cosh(u) + B * np.sinh(u)), curvature, gap, force),
                            strict=True):  # fmt: skip
        array[where] = value


#: Least yield strengths of the grades of drill pipe, API Spec 5DP, Pa.
GRADES = {"E75": 75 * ksi, "X95": 95 * ksi, "G105": 105 * ksi, "S135": 135 * ksi}
#: Share of the wall that is left of the classes of used drill pipe, API RP 7G.
CLASSES = {"new": 1.0, "premium": 0.8, "class 2": 0.7}
# Of the tubes of heavy-weight pipe (Drilco), of collars up to 6 7/8 in and wider ones (API Spec 7-1).
_HEAVY, _COLLAR, _WIDE_COLLAR, _WIDE = 55 * ksi, 110 * ksi, 100 * ksi, 6.875 * inch
_SHEAR, _NEW_WALL = 0.577, 0.875
_LEAST_YIELD = 24e3  # psi, at which the formulas of collapse end
_CURVE_E, _CURVE_S = 67e3, 133.4e3  # psi, largest tensions of the allowed bending stresses


def yield_of(owner, grade):
    """Yield strength (Pa) of a grade by its name, or as a number or text with a unit. Raises SceneError: an unknown
    name, with the nearest one; a number that is no yield strength."""
    if isinstance(grade, str):
        plain = re.sub(r"[\s_-]|grade", "", grade, flags=re.IGNORECASE).upper()
        found = [name for name in GRADES if plain in (name, name[0])]
        if found:
            return GRADES[found[0]]
        if not re.match(r"\s*[\d.]", grade):
            raise SceneError(f"{owner}: grade = {grade!r}: {nearest(plain, GRADES)} Or a yield strength, '135 ksi'")
        grade = in_si(f"{owner}.grade", grade, "pressure")
    return number(owner, "grade", grade, "a grade, such as 'S135', or a yield strength (Pa) from 1e7 to 1e10",
                  lambda x: 1e7 <= x <= 1e10)  # fmt: skip


def wear_of(owner, wear):
    """Share of the wall that is left, of a class by its name or as a number. Raises SceneError: an unknown name, with
    the nearest one; a number that is no share."""
    expected = f"the share of the wall that is left, from 0.1 to 1, or {', '.join(map(repr, CLASSES))}"
    if isinstance(wear, str):
        plain = " ".join(wear.lower().replace("-", " ").replace("_", " ").split())
        if plain not in CLASSES:
            refuse(owner, "wear", wear, f"{expected}: 0.8 of premium pipe, 0.7 of class 2")
        return CLASSES[plain]
    return number(owner, "wear", wear, expected, lambda x: 0.1 <= x <= 1)


def usual_yield(part):
    """Yield strength (Pa) of a component that no grade is given for; None where none is usual."""
    if isinstance(part, HeavyWeight):
        return _HEAVY
    if isinstance(part, Collar) or part.touches == "middle":
        return _COLLAR if part.outer_diameter <= _WIDE else _WIDE_COLLAR
    return None


@dataclass(frozen=True)
class PipeStrength(InWords, Part):
    """Strength of the body of a pipe.

    Args:
        pipe: a component with diameters.
        grade: "E75", "X95", "G105" or "S135"; or a yield strength, Pa or text, such as "135 ksi".
        wear: share of the wall that is left, 0.1 to 1, or a class of API RP 7G: "new" (1), "premium" (0.8), "class 2"
            (0.7).

    Attributes:
        yield_strength: Pa. outer_diameter: of the worn body, m. area: of its section, m^2.
        tension: at yield, N. torque: at yield, N m. burst: pressure inside, Pa, above that outside.

    Raises:
        SceneError: a component without diameters, an unknown grade, another wear.
    """

    pipe: StringPart
    grade: object = "E75"
    wear: Any = 1.0

    def validate(self):
        """Find the worn section and the yield strength."""
        if not self.pipe.outer_diameter or not self.pipe.inner_diameter:
            refuse(self, "pipe", self.pipe.name, "a component with an outer and an inner diameter, such as DrillPipe")
        store(self, wear=wear_of(self, self.wear))
        new, bore = self.pipe.outer_diameter, self.pipe.inner_diameter
        store(self, yield_strength=yield_of("PipeStrength", self.grade),
              outer_diameter=bore + self.wear * (new - bore))  # fmt: skip

    @cached_property
    def section(self):
        """`Sections` of the worn body, numbers."""
        found = sections_of([self.pipe])
        found = type(found)(*(float(x[0]) for x in found))
        return found._replace(outer=self.outer_diameter / 2)

    @property
    def bending(self) -> float:
        """Bending stiffness of the worn body, N m^2."""
        return float(self.pipe.material.E * np.pi / 4 * (self.section.outer**4 - self.section.inner**4))

    @property
    def area(self) -> float:
        """m^2."""
        bore, whole = areas(self.section)
        return whole - bore

    @property
    def tension(self) -> float:
        """At yield, N."""
        return self.yield_strength * self.area

    @property
    def torque(self) -> float:
        """At yield without tension, N m."""
        return float(self.torque_at(0.0))

    @property
    def _torsion(self):
        """J/r, m^3."""
        return np.pi / 2 * (self.section.outer**4 - self.section.inner**4) / self.section.outer

    def torque_at(self, tension) -> np.ndarray:
        """Torque at yield (N m) with a tension (N); 0 beyond its yield."""
        left = np.maximum(self.yield_strength**2 - (np.asarray(tension) / self.area) ** 2, 0.0)
        return _SHEAR * np.sqrt(left) * self._torsion

    def tension_at(self, torque) -> np.ndarray:
        """Tension at yield (N) with a torque (N m); 0 beyond its yield."""
        shear = np.asarray(torque) / (_SHEAR * self._torsion)
        return self.area * np.sqrt(np.maximum(self.yield_strength**2 - shear**2, 0.0))

    @property
    def burst(self) -> float:
        """Pressure inside, above that outside, Pa."""
        new = self.pipe.outer_diameter
        return min(self.wear, _NEW_WALL) * self.yield_strength * (new - self.pipe.inner_diameter) / new

    def true_tension(self, tension, outside, inside) -> np.ndarray:
        """Force in the wall, N, from the effective tension (N) and pressures (Pa)."""
        return true_tension(self.section, tension, outside, inside)

    def outer_excess(self, outside, inside) -> np.ndarray:
        """Pressure outside less the part of it that the one inside carries, Pa, for `collapse`."""
        return outside - (1 - 2 / self._slender) * inside

    @property
    def _slender(self):
        """D/t of the worn body."""
        return 2 * self.outer_diameter / (self.outer_diameter - self.pipe.inner_diameter)

    def collapse(self, tension: float = 0.0) -> np.ndarray:
        """Pressure outside at which an empty pipe with a tension (N) collapses, Pa; compression does not count."""
        z = np.clip(np.asarray(tension) / self.tension, 0.0, 1.0)
        strength = (np.sqrt(1 - 0.75 * z**2) - z / 2) * self.yield_strength
        return collapse_pressure(self._slender, strength)

    def utilisation(self, true_tension, torque=0.0, moment=0.0, inside=0.0, outside=0.0) -> np.ndarray:
        """(4, ...) von Mises stress over the yield strength: at the outer surface on the side in tension of bending and
        on the other one, and so at the inner surface.

        Args:
            true_tension: force in the wall, N. torque, moment: N m. inside, outside: pressures, Pa.
        """
        given = (np.asarray(x, dtype=float) for x in (true_tension, torque, moment, outside, inside))
        return von_mises(self.section, *given) / self.yield_strength

    def fatigue_stress(self, tension) -> np.ndarray:
        """Bending stress (Pa) that drill pipe may have when it rotates with a tension (N); NaN for other components."""
        tension = np.asarray(tension, dtype=float)
        if not isinstance(self.pipe, DrillPipe):
            return np.full(tension.shape, np.nan)
        pull = np.maximum(tension, 0.0) / self.area / psi
        if self.yield_strength >= 0.999 * GRADES["S135"]:
            allowed = np.where(pull <= _CURVE_S, 20e3 * (1 - pull / 145e3), 0.0)
        else:
            curve = 19.5e3 - 10 / 67 * pull - 0.6 / 670**2 * (pull - 33.5e3) ** 2
            allowed = np.where(pull <= _CURVE_E, curve, 0.0)
        return allowed * psi

    def allowed_dogleg(self, tension) -> np.ndarray:
        """Curvature (rad/m) of a hole in which drill pipe may rotate with an effective tension (N): its body reaches
        `fatigue_stress`, at the joints where these carry it. NaN where that is not known."""
        tension = np.asarray(tension, dtype=float)
        half, _ = span_of(self.pipe)
        factor = np.ones(tension.shape)
        if half is not None:
            # as Lubinski has it, without touching the wall
            one = bent(self.bending, half, np.inf, tension, 1.0)
            factor = np.maximum(one.joint, one.middle)
        return self.fatigue_stress(tension) / (self.pipe.material.E * self.outer_diameter / 2 * factor)

    def sentences(self, units: Units):
        """On its limits, in some units."""

        def told(value, unit):
            return units.told(float(value), unit, form=".6g")

        wear = f", {100 * self.wear:g} % of the wall left" if self.wear < 1 else ""
        yield (
            f"{self.pipe.name}, yield strength {told(self.yield_strength, 'Pa')}{wear}: tension "
            f"{told(self.tension, 'N')}, torque {told(self.torque, 'N m')}, burst {told(self.burst, 'Pa')}, collapse "
            f"{told(self.collapse(), 'Pa')}; each alone, of the body, without a safety factor."
        )


def collapse_pressure(slender, strength):
    """Pa: by API Bulletin 5C3, of pipe with D/t = `slender` and a yield strength (Pa, arrays). Below 24 000 psi, where
    its formulas end, in proportion to the strength."""
    strength = np.asarray(strength, dtype=float) / psi
    Y = np.maximum(strength, _LEAST_YIELD)
    A = 2.8762 + 0.10679e-5 * Y + 0.21301e-10 * Y**2 - 0.53132e-16 * Y**3
    B = 0.026233 + 0.50609e-6 * Y
    C = -465.93 + 0.030867 * Y - 0.10483e-7 * Y**2 + 0.36989e-13 * Y**3
    ratio = 3 * (B / A) / (2 + B / A)
    F = 46.95e6 * ratio**3 / (Y * (ratio - B / A) * (1 - ratio) ** 2)
    G = F * B / A
    ends = (
        (np.sqrt((A - 2) ** 2 + 8 * (B + C / Y)) + (A - 2)) / (2 * (B + C / Y)),
        Y * (A - F) / (C + Y * (B - G)),
        (2 + B / A) / (3 * B / A),
    )
    x = slender
    formulas = (2 * Y * (x - 1) / x**2, Y * (A / x - B) - C, Y * (F / x - G), 46.95e6 / (x * (x - 1) ** 2))
    found = np.select([x <= end for end in ends], formulas[:3], formulas[3])
    return found * np.minimum(strength / _LEAST_YIELD, 1.0) * psi
