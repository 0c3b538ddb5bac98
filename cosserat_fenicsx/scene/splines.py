"""Smooth curves through given points, by arc length, with frames that do not twist about the tangent.

The curve is divided into panels on which speed and frame are analytic, and integrated as Legendre series. Panels are
halved until the last terms of the series are round-off, so arc length and frame are exact for any points.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import legendre

from cosserat_fenicsx.checks import File, Numbers, Rows, instance, refuse, store, vector
from cosserat_fenicsx.numerics import gauss
from cosserat_fenicsx.scene.frames import level_axis, start_frame
from cosserat_fenicsx.scene.polylines import polyline

_GAUSS = gauss(20)
#: halvings of a span, and mean number of panels per span, beyond which the curve has a cusp
_MOST_HALVINGS, _MOST_PANELS = 24, 200


@dataclass(frozen=True)
class Spline:
    """The cubic spline through points, twice continuously differentiable, with chord lengths as its parameter.

    At open ends it is "not-a-knot": points of a smooth curve give that curve to fourth order up to its ends, where the
    curvature of a natural spline would be zero. Two points give a straight line, three a parabola. Its frame is
    rotation-minimising (Bishop's: d_1R' and d_2R' lie along the tangent, no material twist); the frame of a closed
    spline is twisted uniformly, so that it closes too.

    The frame on a panel is that at the panel's start, with tangent a, after the smallest rotation that takes a to t,
    then rotated about t by the integral of a . (t x t')/(1 + a . t), which cancels the twist of the first rotation:
    Bishop, Amer. Math. Monthly 82 (1975) 246, doi:10.2307/2319846; the double reflection of Wang et al. (2008),
    doi:10.1145/1330511.1330513, integrated exactly.

    Args:
        points: (n, 3), m, or the path of a file: a .csv with three columns (m), or any file with line cells that meshio
            reads; a relative path in a scene file starts at the scene file.
        d1: a vector whose component normal to the tangent at the start gives the direction of d_1R there; None as for
            `Line`.
        closed: whether the curve returns to its first point, smoothly.

    Raises:
        SceneError: too few points, points that coincide with the one before, a file without a single polyline, a curve
            that turns back on itself in a cusp, or d1 along the tangent.
    """

    points: Rows | File = field(repr=False, metadata={"file": True})
    d1: Numbers | None = None
    closed: bool = False
    length: float = field(init=False)
    breaks: tuple = field(init=False, repr=False, compare=False)

    uniform = False

    def __post_init__(self):
        from scipy.interpolate import CubicSpline  # imported here: it is slow to import, and few scenes need it

        instance(self, "closed", self.closed, bool, "true or false")
        if self.d1 is not None:
            store(self, d1=vector(self, "d1", self.d1, "direction"))
        points = polyline(self, "points", self.points, closed=self.closed)
        store(self, points=tuple(map(tuple, points.tolist())))
        offsets = points - points[0]  # a large distance from the origin costs no accuracy
        if self.closed:
            offsets = np.vstack([offsets, offsets[:1]])
        knots = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(offsets, axis=0), axis=1)))
        cubics = CubicSpline(knots, offsets, bc_type="periodic" if self.closed else "not-a-knot").c
        store(self, _cubics=cubics, _origin=points[0])
        self._cut(np.diff(knots))
        arcs = np.append(0.0, np.cumsum(self._arc.sum(axis=0), dtype=np.longdouble)).astype(float)
        inner = np.searchsorted(self._span, np.arange(1, len(knots) - 1))
        store(self, length=float(arcs[-1]), breaks=tuple(arcs[inner].tolist()), _arcs=arcs)
        self._carry_frame()

    def _cut(self, spans):
        """Divide the curve into panels, and store their spans (indices), midpoints and half lengths in the spline's
        parameter, tangents at their starts, and series."""
        span, middle, half = np.arange(len(spans)), spans / 2, spans / 2
        done = []
        for _ in range(_MOST_HALVINGS):
            resolved, start, arc, turn = self._series(span, middle, half)
            panels = (span, middle, half, start, arc.T, turn.T)
            done.append([values[resolved] for values in panels])
            rest = ~resolved
            if not rest.any():
                break
            span, half = np.repeat(span[rest], 2), np.repeat(half[rest] / 2, 2)
            middle = np.repeat(middle[rest], 2) + half * np.tile([-1.0, 1.0], rest.sum())
            if len(span) > _MOST_PANELS * len(spans):
                break
        if rest.any():
            where = ", ".join(f"{x:.6g}" for x in self._origin + self._cubic(span[:1], middle[:1])[0])
            refuse(
                self, "points", f"({len(self.points)} points)", f"a smooth curve: this one has a cusp at ({where}) m"
            )
        span, middle, half, start, arc, turn = (np.concatenate(parts) for parts in zip(*done, strict=True))
        order = np.lexsort((middle, span))
        store(self, _span=span[order], _middle=middle[order], _half=half[order], _tangents=start[order])
        store(self, _arc=arc[order].T, _turn=turn[order].T)

    def _cubic(self, span, t, derivative=0):
        """The cubics of spans (n,), or a derivative, (..., n, 3), at parameters t (..., n) from the starts of the
        spans."""
        a, b, c, d = self._cubics[:, span]
        t = t[..., None]
        if derivative == 0:
            return ((a * t + b) * t + c) * t + d
        return (3 * a * t + 2 * b) * t + c if derivative == 1 else 6 * a * t + 2 * b

    def _series(self, span, middle, half):
        """Whether panels are resolved (n,), the tangents at their starts (n, 3), and Legendre series of arc length and
        frame angle (terms, n)."""
        t = middle + half * np.concatenate([[-1.0], _GAUSS.points, [1.0]])[:, None]
        first, second = self._cubic(span, t, 1), self._cubic(span, t, 2)
        speed = np.linalg.norm(first, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            tangents = first / speed[..., None]
            start = tangents[0]
            forward = np.einsum("pj,npj->np", start, tangents)
            rate = np.einsum("pj,npj->np", start, np.cross(tangents, second)) / (speed * (1 + forward))
        rates = np.stack([speed, np.nan_to_num(rate, posinf=0.0, neginf=0.0)])[:, 1:-1] * half
        tails = np.abs(_GAUSS.series[-3:] @ rates).max(axis=1)
        # Near a cusp the terms of the derivative cancel; the series are limited by the rounding of these terms.
        a, b, c = np.linalg.norm(self._cubics[:3, span], axis=-1)
        end = middle + half
        terms = 3 * a * end**2 + 2 * b * end + c
        slowest = speed.min(axis=0)
        resolved = (
            (slowest > 1e-6)  # the parameter is the chord length: the speed is about 1 on a smooth curve
            & (forward.min(axis=0) > 0.7)
            & (tails[0] < 1e-14 * terms * half)
            & (tails[1] * slowest < 1e-14 * terms)
        )
        return resolved, start, _GAUSS.integral @ rates[0], _GAUSS.integral @ rates[1]

    def _carry_frame(self):
        """Store d_1R at the start of every panel, and the angle that the frame of a closed curve fails to close by."""
        ends = np.vstack([self._tangents[1:], self._tangent(self._span[-1:], self._middle[-1:] + self._half[-1:])])
        d1 = start_frame(self, self._tangents[0], level_axis(self._tangents[0]))[:, 0]
        starts = [d1]
        for a, t, angle in zip(self._tangents, ends, self._turn.sum(axis=0), strict=True):
            d1 = _moved(d1, a, t, angle)
            d1 = d1 - np.dot(d1, t) * t
            d1 /= np.linalg.norm(d1)
            starts.append(d1)
        t, missing = ends[-1], 0.0
        if self.closed:
            missing = float(np.arctan2(np.dot(np.cross(d1, starts[0]), t), np.dot(d1, starts[0])))
        store(self, _d1=np.array(starts[:-1]), _missing=missing)

    def _tangent(self, span, t):
        first = self._cubic(span, t, 1)
        return first / np.linalg.norm(first, axis=-1, keepdims=True)

    def _locate(self, s):
        """The panels of arc lengths s (n,), the coordinates in [-1, 1] on them, and their spans and parameters there.

        By Newton's method, safeguarded by bisection.
        """
        s = np.clip(s, 0.0, self.length)
        panel = np.clip(np.searchsorted(self._arcs, s, side="right") - 1, 0, len(self._half) - 1)
        arc, span, middle, half = self._arc[:, panel], self._span[panel], self._middle[panel], self._half[panel]
        target = s - self._arcs[panel]
        x = 2 * target / (self._arcs[panel + 1] - self._arcs[panel]) - 1
        low, high = np.full_like(x, -1.0), np.full_like(x, 1.0)
        for _ in range(100):  # bisection alone would need 53
            gap = legendre.legval(x, arc, tensor=False) - target
            low, high = np.where(gap < 0, x, low), np.where(gap > 0, x, high)
            new = x - gap / (half * np.linalg.norm(self._cubic(span, middle + half * x, 1), axis=-1))
            new = np.where((new < low) | (new > high), (low + high) / 2, new)
            step, x = np.abs(new - x).max(initial=0.0), new
            if step < 1e-8:  # the remaining error is about its square
                break
        return panel, x, span, middle + half * x

    def position(self, s: float | Numbers) -> np.ndarray:
        """Inertial points at the arc lengths s (n,), m; shape (n, 3)."""
        _, _, span, t = self._locate(np.ravel(s).astype(float))
        return (self._origin + self._cubic(span, t)).reshape(*np.shape(s), 3)

    def frame(self, s: float | Numbers) -> np.ndarray:
        """R_R at the arc lengths s (n,); shape (n, 3, 3), the directors as columns, inertial components."""
        panel, x, span, t = self._locate(np.ravel(s).astype(float))
        t = self._tangent(span, t)
        angle = legendre.legval(x, self._turn[:, panel], tensor=False) + self._missing * np.ravel(s) / self.length
        d1 = _moved(self._d1[panel], self._tangents[panel], t, angle[:, None])
        return np.stack([d1, np.cross(t, d1), t], axis=-1).reshape(*np.shape(s), 3, 3)


def _moved(d1, a, t, angle):
    """d1, normal to a, after the smallest rotation that takes a to t, then rotated about t by an angle."""
    along = np.sum(t * d1, axis=-1, keepdims=True) / (1 + np.sum(a * t, axis=-1, keepdims=True))
    d1 = d1 - along * (a + t)
    return np.cos(angle) * d1 + np.sin(angle) * np.cross(t, d1)
