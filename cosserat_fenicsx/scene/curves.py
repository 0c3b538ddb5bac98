"""Reference centrelines with their frames R_R(s) = [d_1R d_2R d_3R]; d_3R is the tangent, s the arc length.

The interface of a curve: `length`, m; `breaks`, the arc lengths inside it where it is not smooth, m; `uniform`, whether
its curvature and twist are constant; `position(s)` and `frame(s)`, both exact to round-off, for an arc length or an
array of them.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.checks import Numbers, number, positive, refuse, store, vector
from cosserat_fenicsx.scene.frames import carried, exponential, level_axis, rotation, start_frame
from cosserat_fenicsx.scene.splines import Spline


@dataclass(frozen=True)
class Line:
    """A straight line.

    Args:
        start, end: inertial points, m.
        d1: a vector whose component normal to the line gives the direction of d_1R; None for a horizontal d_1R such
            that d_2R points upwards (along z); a vertical line has d_1R = x.

    Raises:
        SceneError: points that coincide, or d1 along the line.
    """

    start: Numbers
    end: Numbers
    d1: Numbers | None = None
    length: float = field(init=False)

    breaks, uniform = (), True

    def __post_init__(self):
        store(self, start=vector(self, "start", self.start, "m"), end=vector(self, "end", self.end, "m"))
        _check_d1(self)
        chord = np.subtract(self.end, self.start)
        length = float(np.linalg.norm(chord))
        if not length > 1e-12 * max(np.abs(self.start).max(), np.abs(self.end).max()):
            refuse(self, "end", self.end, f"a point apart from start = {self.start}")
        d3 = chord / length
        store(self, length=length, _frame=start_frame(self, d3, level_axis(d3)))

    def position(self, s: float | Numbers) -> np.ndarray:
        """Inertial points at the arc lengths s (n,), m; shape (n, 3)."""
        x = np.asarray(s, dtype=float)[..., None] / self.length
        return (1 - x) * self.start + x * self.end

    def frame(self, s: float | Numbers) -> np.ndarray:
        """R_R at the arc lengths s (n,); shape (n, 3, 3), the directors as columns, inertial components."""
        return np.broadcast_to(self._frame, (*np.shape(s), 3, 3))


class _Uniform:
    """A curve of constant material curvature u: R_R(s) = R_R(0) exp(s u x), r(s) = r(0) + integral of R_R (0, 0, 1).

    Subclasses store `start`, `length`, `_frame` = R_R(0) and `_curvature` = u.
    """

    breaks, uniform = (), True

    def position(self, s: float | Numbers) -> np.ndarray:
        """Inertial points at the arc lengths s (n,), m; shape (n, 3)."""
        s = np.asarray(s, dtype=float)[..., None]
        return self.start + s * (carried(s * self._curvature) @ self._frame.T)

    def frame(self, s: float | Numbers) -> np.ndarray:
        """R_R at the arc lengths s (n,); shape (n, 3, 3), the directors as columns, inertial components."""
        return self._frame @ exponential(np.asarray(s, dtype=float)[..., None] * self._curvature)

    def _wind(self, axis, angle, length, frame):
        """Store a uniform rotation about an axis by `angle`, rad, over `length`, m, of curve and frame."""
        if not length > 1e-12 * np.abs([self.start, self.centre]).max():
            refuse(self, "length", length, "more than the rounding of its start and centre (m)")
        store(self, length=float(length), _frame=frame, _curvature=frame.T @ axis * (angle / length))


@dataclass(frozen=True)
class Arc(_Uniform):
    """A circular arc: `start` turned about an axis; its frame turns with it.

    Args:
        centre: any point of the axis, m.
        start: the curve's first point, off the axis, m.
        angle: rad, right-handed about the axis, of either sign; 2 pi gives a closed circle, more overlaps it.
        axis: direction of the axis.
        d1: a vector whose component normal to the tangent at the start gives the direction of d_1R there; None for the
            direction of the axis.

    Raises:
        SceneError: no angle, no axis, a start on the axis, or d1 along the tangent.
    """

    centre: Numbers
    start: Numbers
    angle: float
    axis: Numbers = (0.0, 0.0, 1.0)
    d1: Numbers | None = None
    length: float = field(init=False)

    def __post_init__(self):
        axis, out, radius = _axis_and_arm(self)
        store(self, angle=_nonzero(self, "angle", self.angle, "rad"))
        frame = start_frame(self, math.copysign(1, self.angle) * np.cross(axis, out), axis)
        self._wind(axis, self.angle, radius * abs(self.angle), frame)


@dataclass(frozen=True)
class Helix(_Uniform):
    """A helix about an axis, as a wire wound on a cylinder: its frame turns with it.

    Args:
        centre: any point of the axis, m.
        start: the curve's first point, off the axis, m.
        turns: number of turns; positive ones are right-handed about the axis.
        pitch: advance along the axis per turn of either sense, m; negative against the axis, 0 gives a plane curve.
        axis: direction of the axis.
        d1: a vector whose component normal to the tangent at the start gives the direction of d_1R there; None for the
            direction to the axis, the curve's principal normal.

    Raises:
        SceneError: no turns, no axis, a start on the axis, or d1 along the tangent.
    """

    centre: Numbers
    start: Numbers
    turns: float
    pitch: float
    axis: Numbers = (0.0, 0.0, 1.0)
    d1: Numbers | None = None
    length: float = field(init=False)

    def __post_init__(self):
        axis, out, radius = _axis_and_arm(self)
        store(self, turns=_nonzero(self, "turns", self.turns, "-"))
        store(self, pitch=number(self, "pitch", self.pitch, "a finite number (m)", math.isfinite))
        round_ = math.copysign(2 * math.pi * radius, self.turns)
        turn = math.hypot(round_, self.pitch)
        d3 = (round_ * np.cross(axis, out) + self.pitch * axis) / turn
        self._wind(axis, 2 * math.pi * self.turns, turn * abs(self.turns), start_frame(self, d3, -out))


@dataclass(frozen=True, init=False)
class UniformCurvature(_Uniform):
    """A curve of constant curvature and twist: a line, an arc or a helix by its material curvature.

    Args:
        length: m.
        curvature: u_R = (u1, u2, u3), material, 1/m: bending about d_1R and d_2R, twist about d_3R.
        start: the curve's first point, m.
        frame: unit quaternion, scalar first, of R_R(0) relative to the inertial axes.

    Raises:
        SceneError: a length that is not positive, numbers that are not finite, or a quaternion that is not of length 1
            within 1e-3.
    """

    length: float
    curvature: Numbers
    start: Numbers
    quaternion: tuple  # the argument `frame`, whose name belongs to the method

    def __init__(
        self,
        length: float,
        curvature: Numbers,
        start: Numbers = (0.0, 0.0, 0.0),
        frame: Numbers = (1.0, 0.0, 0.0, 0.0),
    ):
        store(self, length=positive(self, "length", length, "m"))
        store(self, curvature=vector(self, "curvature", curvature, "1/m"), start=vector(self, "start", start, "m"))
        q = np.array(vector(self, "frame", frame, "unit quaternion, scalar first", size=4))
        if abs(np.linalg.norm(q) - 1) > 1e-3:
            refuse(self, "frame", frame, "a quaternion of length 1, scalar first")
        if abs(np.linalg.norm(q) - 1) > 1e-15:  # a unit quaternion stays the same to the last digit
            q /= np.linalg.norm(q)
        store(self, quaternion=tuple(q.tolist()), _frame=rotation(q), _curvature=np.array(self.curvature))


def _check_d1(curve):
    if curve.d1 is not None:
        store(curve, d1=vector(curve, "d1", curve.d1, "direction"))


def _nonzero(curve, name, value, unit):
    return number(curve, name, value, f"a finite number other than 0 ({unit})", lambda x: x != 0 and math.isfinite(x))


def _axis_and_arm(curve):
    """The checked unit axis, the unit vector from it to the start, and their distance, m."""
    for name, unit in (("centre", "m"), ("start", "m"), ("axis", "direction")):
        store(curve, **{name: vector(curve, name, getattr(curve, name), unit)})
    _check_d1(curve)
    axis = np.array(curve.axis)
    if not np.linalg.norm(axis) > 0:
        refuse(curve, "axis", curve.axis, "a direction other than 0")
    axis = axis / np.abs(axis).max()
    axis /= np.linalg.norm(axis)
    arm = np.subtract(curve.start, curve.centre)
    across = arm - np.dot(arm, axis) * axis
    across -= np.dot(across, axis) * axis  # twice, against cancellation where the component along the axis is large
    radius = float(np.linalg.norm(across))
    if not radius > 1e-12 * np.abs([curve.start, curve.centre]).max():
        refuse(curve, "start", curve.start, f"a point off the axis through centre = {curve.centre}")
    return axis, across / radius, radius


#: Curves that scene files know.
CURVES = (Line, Arc, Helix, Spline, UniformCurvature)
Curve = Line | Arc | Helix | Spline | UniformCurvature
