"""Bending of a pipe between its tool joints, which alone rest on the wall of a curved hole.

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

from collections import namedtuple
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import instance, number
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.results.screen import InWords
from cosserat_fenicsx.well.components import StringPart

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
            f"buckles between its joints, {2 * half:g} m apart: expected less compression, or solve the rod in contact, "
            "torque_and_drag(..., model='rod'), with the joints as rings: Centraliser(spacing, diameter)"
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
    """`Bent` of arrays: bending stiffness (N m^2), half the span, how far joints stand out (m), effective tension (N),
    curvature of the hole (1/m)."""
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
