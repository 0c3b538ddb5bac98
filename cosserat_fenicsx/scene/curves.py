"""Reference centrelines with their frames R_R(s) = [d_1R d_2R d_3R]; d_3R is the tangent, s the arc length.

The interface of a curve: `length`, m; `breaks`, the arc lengths inside it where it is not smooth, m; `uniform`, whether
its curvature and twist are constant; `position(s)` and `frame(s)`, both exact to round-off, for an arc length or an
array of them. Frames, rows of points from files and splines come first.
"""

import contextlib
import csv
import io
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.polynomial import legendre

from cosserat_fenicsx.checks import File, Numbers, Rows, name_of, positive, refuse, store, text_of, vector, warn
from cosserat_fenicsx.quantities import LARGEST
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import directors, gauss
from cosserat_fenicsx.parts import FileName, Limits, Number, Part, Several

# Smallest distance of neighbouring points, relative to the extent of all: closer ones make the curvature inaccurate.
_APART = 1e-7


def polyline(owner, field, given, *, closed):
    """The points (n, 3), m, of an array or a file (.csv of three columns, m, with or without a header; or one that
    meshio reads), without repetitions; closed: whether the last point is joined to the first; it may then repeat it. A
    SceneError for a file that cannot be read or holds no single polyline without branches, too few points, numbers that
    are not finite, or a point that repeats the one before; owner, field: in its message."""
    points, what = given, f"{given!r:.60}"
    if isinstance(given, str | Path):
        what = str(given)
        if Path(given).suffix.lower() == ".csv":
            points = _from_csv(owner, field, Path(given))
        else:
            points = _from_mesh(owner, field, Path(given), closed)
    try:
        points = np.asarray(points)
    except ValueError:
        refuse(owner, field, what, "points of three numbers each (m)")
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "iuf":
        refuse(owner, field, what, "points of three numbers each (m)")
    points = points.astype(float)
    usable = (np.abs(points) <= LARGEST).all(axis=1)
    if not usable.all():
        row = int(np.argmin(usable))
        refuse(owner, f"{field}[{row}]", tuple(points[row].tolist()), f"finite numbers (m), none beyond {LARGEST:g}")
    if closed and len(points) > 1 and _coincide(points[-1:], points[:1], points)[0]:
        points = points[:-1]
    if len(points) < 2 + closed:
        refuse(owner, field, what, f"{'three' if closed else 'two'} points or more")
    again = np.flatnonzero(_coincide(points[1:], points[:-1], points))
    if len(again):
        row = int(again[0]) + 1
        apart = f"a point apart from the one before, by more than {_APART:g} of the extent of all"
        refuse(owner, f"{field}[{row}]", tuple(points[row].tolist()), apart)
    return points


def _coincide(a, b, points):
    near = max(1e-12 * np.abs(points).max(), _APART * np.ptp(points, axis=0).max())
    return ~(np.linalg.norm(a - b, axis=1) > near)


def _from_csv(owner, field, file):
    rows = []
    try:
        table = list(csv.reader(io.StringIO(text_of(file, "points as .csv"), newline="")))
    except SceneError as problem:
        why = str(problem).removeprefix(f"{file}: ")
        raise SceneError(f"{name_of(owner)}.{field} = '{file}': {why}") from None
    except csv.Error as problem:
        refuse(owner, field, str(file), f"a text file that can be read ({problem})")
    for line, row in enumerate(table, start=1):
        if not any(cell.strip() for cell in row):
            continue
        try:
            x, y, z = map(float, row)
        except ValueError:
            if rows or line > 1:
                refuse(owner, field, str(file), f"three numbers in line {line}, which is {','.join(row)!r:.60}")
        else:
            rows.append((x, y, z))
    return rows or np.empty((0, 3))


def _from_mesh(owner, field, file, closed):
    import meshio  # imported here, since few scenes need it

    if not file.is_file():
        refuse(owner, field, str(file), "a file that exists")
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            mesh = meshio.read(file)
    except (Exception, SystemExit) as problem:  # its readers may raise anything, even SystemExit
        refuse(owner, field, str(file), f"a .csv file or a mesh file that meshio reads ({problem!r:.120})")
    segments = [cells.data for cells in mesh.cells if cells.type == "line"]
    for cells in mesh.cells:
        if cells.type == "line3":  # its third node is the midpoint
            segments.append(cells.data[:, [0, 2, 2, 1]].reshape(-1, 2))
    if not segments:
        refuse(owner, field, str(file), "a file with line cells, which form the polyline")
    points = np.asarray(mesh.points, dtype=float)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    return points[_chain(owner, field, file, np.concatenate(segments).tolist(), closed)]


def _chain(owner, field, file, segments, closed):
    """The nodes of segments, ordered along the polyline that they form, from an end that begins a segment."""
    neighbours = {}
    for a, b in segments:
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    branching = [node for node, others in neighbours.items() if len(others) > 2]
    if branching:
        refuse(
            owner, field, str(file), f"a polyline without branches, but three or more lines meet at node {branching[0]}"
        )
    ends = [node for node, others in neighbours.items() if len(others) == 1]
    if not ends and not closed:
        refuse(owner, field, str(file), "a polyline with two ends, or closed = true for this ring")
    firsts = {a for a, _ in segments}
    node = next((end for end in ends if end in firsts), (ends or [segments[0][0]])[0])
    chain, following = [node], neighbours[node][0]
    while following not in (None, chain[0]):
        previous, node = node, following
        chain.append(node)
        following = next((other for other in neighbours[node] if other != previous), None)
    if len(chain) != len(neighbours):
        refuse(owner, field, str(file), "a single polyline, but its lines form several")
    return chain


# Taylor coefficients of (theta - sin theta)/theta^3 in theta^2, used below theta = 1, where the closed form cancels.
_SERIES = np.array([(-1) ** k / math.factorial(2 * k + 3) for k in range(9)])


def start_frame(owner, d3, default):
    """The frame [d1 d2 d3] of a unit tangent, (3, 3), with d1 by the component of `owner.d1`, or else of `default`,
    normal to the tangent; a SceneError for d1 along it."""
    d3, given = d3.tolist(), np.asarray(default if owner.d1 is None else owner.d1, dtype=float).tolist()
    # twice, against cancellation where `given` is almost along the tangent; numpy takes most of the time of a frame
    size = math.hypot(*given)
    across = _across(given, d3)
    if math.hypot(*across) <= 1e-6 * size:
        refuse(owner, "d1", owner.d1, "a direction across the tangent at the start")
    (a, b, c), (x, y, z) = _across(across, d3), d3
    size = math.hypot(a, b, c)
    a, b, c = a / size, b / size, c / size
    return np.array([[a, y * c - z * b, x], [b, z * a - x * c, y], [c, x * b - y * a, z]])


def _across(v, t):
    """The component of a vector v normal to a unit vector t, three numbers each."""
    along = math.fsum(a * b for a, b in zip(v, t, strict=True))
    return [a - along * b for a, b in zip(v, t, strict=True)]


def level_axis(t):
    """The horizontal direction d1 normal to t such that t x d1 points upwards (along z); x for a vertical t."""
    across = np.array([0.0 - t[1], t[0], 0.0])
    return across if math.hypot(t[0], t[1]) > 1e-6 else np.array([1.0, 0.0, 0.0])


def exponential(w):
    """Rotations by the rotation vectors w (..., 3): (..., 3, 3), orthonormal to round-off (Rodrigues' formula)."""
    first, second, _ = _factors(w)
    W = _skew(w)
    return np.eye(3) + first[..., None, None] * W + second[..., None, None] * (W @ W)


def carried(w):
    """The integral of exponential(t w) (0, 0, 1) over t in [0, 1], (..., 3): the chord of a curve of unit length."""
    _, second, third = _factors(w)
    e3 = np.array([0.0, 0.0, 1.0])
    once = np.cross(w, e3)
    return e3 + second[..., None] * once + third[..., None] * np.cross(w, once)


def _factors(w):
    """sin(x)/x, (1 - cos x)/x^2 and (x - sin x)/x^3 of the lengths x of w, without cancellation."""
    x = np.linalg.norm(w, axis=-1)
    first, half = np.sinc(x / np.pi), np.sinc(x / (2 * np.pi))
    small = x < 1
    series = np.polynomial.polynomial.polyval(np.where(small, x, 0.0) ** 2, _SERIES)
    return first, half**2 / 2, np.where(small, series, (1 - first) / np.where(small, 1.0, x) ** 2)


def _skew(w):
    """The skew matrices of w (..., 3): skew(w) v = w x v, (..., 3, 3)."""
    a, b, c = np.moveaxis(w, -1, 0)
    zero = np.zeros_like(a)
    return np.stack([zero, -c, b, c, zero, -a, -b, a, zero], axis=-1).reshape(*np.shape(w)[:-1], 3, 3)


_GAUSS = gauss(20)
#: halvings of a span, and mean number of panels per span, beyond which the curve has a cusp
_MOST_HALVINGS, _MOST_PANELS = 24, 200

# The default of d1 is that of the line between the ends where the start is nearly along it, rad.
_NEARLY_ALONG = math.radians(30)

Point = Annotated[Numbers, Several("length")]
Direction = Annotated[Numbers, Several(unit="direction")]
_NONZERO = Limits(what="a finite number other than 0")


class PointsOrFile(FileName):
    """Rows of numbers, or the name of a file of them; `polyline` checks both."""

    def check(self, owner, field, value):
        return value


class Curve(Part, family="curve"):
    """Base of reference centrelines."""


@dataclass(frozen=True)
class Spline(Curve):
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
            the `Line` between the ends where the curve starts within 30 degrees of it, else as for one along the start.
        closed: whether the curve returns to its first point, smoothly.

    Raises:
        SceneError: too few points, points that coincide with the one before, a file without a single polyline, a curve
            that turns back on itself in a cusp, or d1 along the tangent.
    """

    points: Annotated[Rows | File, PointsOrFile()] = field(repr=False)
    d1: Direction | None = None
    closed: bool = False
    length: float = field(init=False)
    breaks: tuple = field(init=False, repr=False, compare=False)

    uniform = False

    def validate(self):
        from scipy.interpolate import CubicSpline  # imported here: it is slow to import, and few scenes need it

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
        """Divide the curve into panels: spans, middles and half lengths in the parameter, tangents, and series."""
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
        """The cubics of spans (n,), or a derivative, (..., n, 3), at parameters t (..., n) from the spans' starts."""
        a, b, c, d = self._cubics[:, span]
        t = t[..., None]
        if derivative == 0:
            return ((a * t + b) * t + c) * t + d
        return (3 * a * t + 2 * b) * t + c if derivative == 1 else 6 * a * t + 2 * b

    def _series(self, span, middle, half):
        """Whether panels are resolved (n,), tangents at their starts, Legendre series of arc length and frame angle."""
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

    def _upright(self):
        """The direction that the default of d1 is level to: that from end to end where the curve starts nearly along
        it, since a bow of a vertical line turns its horizontal direction by any angle; else that of the start."""
        straight = np.subtract(self.points[-1], self.points[0])
        length = np.linalg.norm(straight)
        near = not self.closed and np.dot(straight, self._tangents[0]) > math.cos(_NEARLY_ALONG) * length
        return straight / length if near else self._tangents[0]

    def _carry_frame(self):
        """Store d_1R at the start of every panel, and the angle that the frame of a closed curve fails to close by."""
        ends = np.vstack([self._tangents[1:], self._tangent(self._span[-1:], self._middle[-1:] + self._half[-1:])])
        d1 = start_frame(self, self._tangents[0], level_axis(self._upright()))[:, 0]
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
        """Panels of arc lengths s (n,), places in [-1, 1] on them, spans and parameters: Newton with bisection."""
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


@dataclass(frozen=True)
class Line(Curve):
    """A straight line.

    Args:
        start, end: inertial points, m.
        d1: a vector whose component normal to the line gives the direction of d_1R; None for a horizontal d_1R such
            that d_2R points upwards (along z); a vertical line has d_1R = x.

    Raises:
        SceneError: points that coincide, or d1 along the line.
    """

    start: Point
    end: Point
    d1: Direction | None = None
    length: float = field(init=False)

    breaks, uniform = (), True

    def validate(self):
        length = math.dist(self.start, self.end)
        if not length > 1e-12 * max(map(abs, (*self.start, *self.end))):
            refuse(self, "end", self.end, f"a point apart from start = {self.start}")
        d3 = np.subtract(self.end, self.start) / length
        store(self, length=length, _frame=start_frame(self, d3, level_axis(d3)))

    def position(self, s: float | Numbers) -> np.ndarray:
        """Inertial points at the arc lengths s (n,), m; shape (n, 3)."""
        if isinstance(s, float):  # one point, as joints ask: without arrays
            x = s / self.length
            return np.array([(1 - x) * a + x * b for a, b in zip(self.start, self.end, strict=True)])
        x = np.asarray(s, dtype=float)[..., None] / self.length
        return (1 - x) * self.start + x * self.end

    def frame(self, s: float | Numbers) -> np.ndarray:
        """R_R at the arc lengths s (n,); shape (n, 3, 3), the directors as columns, inertial components."""
        return np.broadcast_to(self._frame, (*np.shape(s), 3, 3))


def positions_along(curves, x, counts):
    """(n, 3) inertial points of curves one after another, m, at arc lengths over their lengths x (n,); counts: of every
    curve, how many of the n places are on it."""
    if not _straight(curves):
        return _one_by_one(curves, x, counts, "position")
    start, end = (np.repeat(points, counts, axis=0) for points in
                  ([curve.start for curve in curves], [curve.end for curve in curves]))  # fmt: skip
    return (1 - x[:, None]) * start + x[:, None] * end


def frames_along(curves, x, counts):
    """(n, 3, 3) the R_R of curves one after another, see `positions_along`."""
    if not _straight(curves):
        return _one_by_one(curves, x, counts, "frame")
    return np.repeat([curve._frame for curve in curves], counts, axis=0)


def _straight(curves):
    return all(type(curve) is Line for curve in curves)


def _one_by_one(curves, x, counts, name):
    parts = zip(curves, np.split(x, np.cumsum(counts)[:-1]), strict=True)
    return np.concatenate([getattr(curve, name)(part * curve.length) for curve, part in parts])


class _Uniform(Curve):
    """A curve of constant material curvature u: R_R(s) = R_R(0) exp(s u x), r(s) = r(0) + integral of R_R (0, 0, 1).
    Subclasses store `start`, `length`, `_frame` = R_R(0) and `_curvature` = u."""

    breaks, uniform = (), True

    def position(self, s: float | Numbers) -> np.ndarray:
        """Inertial points at the arc lengths s (n,), m; shape (n, 3)."""
        s = np.asarray(s, dtype=float)[..., None]
        return self.start + s * (carried(s * self._curvature) @ self._frame.T)

    def frame(self, s: float | Numbers) -> np.ndarray:
        """R_R at the arc lengths s (n,); shape (n, 3, 3), the directors as columns, inertial components."""
        return self._frame @ exponential(np.asarray(s, dtype=float)[..., None] * self._curvature)

    def _axis_and_arm(self, turned):
        """The unit axis, the unit vector from it to the start, and their distance, m; the field `turned` is not 0."""
        if getattr(self, turned) == 0:
            refuse(self, turned, getattr(self, turned), _NONZERO.what)
        axis = np.array(self.axis)
        if not np.linalg.norm(axis) > 0:
            refuse(self, "axis", self.axis, "a direction other than 0")
        axis = axis / np.abs(axis).max()
        axis /= np.linalg.norm(axis)
        arm = np.subtract(self.start, self.centre)
        across = arm - np.dot(arm, axis) * axis
        across -= np.dot(across, axis) * axis  # twice, against cancellation where the component along the axis is large
        radius = float(np.linalg.norm(across))
        if not radius > 1e-12 * np.abs([self.start, self.centre]).max():
            refuse(self, "start", self.start, f"a point off the axis through centre = {self.centre}")
        return axis, across / radius, radius

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

    centre: Point
    start: Point
    angle: Annotated[float, Number("angle", _NONZERO)]
    axis: Direction = (0.0, 0.0, 1.0)
    d1: Direction | None = None
    length: float = field(init=False)

    def validate(self):
        axis, out, radius = self._axis_and_arm("angle")
        if abs(self.angle) > 2 * math.pi * (1 + 1e-9):
            warn(f"Arc.angle = {self.angle:g} rad are {abs(self.angle) / (2 * math.pi):.3g} turns, one over the other: "
                 f"{self.angle:g} degrees are '{self.angle:g} deg'; a Helix winds on")  # fmt: skip
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

    centre: Point
    start: Point
    turns: Annotated[float, Number(limits=_NONZERO)]
    pitch: Annotated[float, Number("length")]
    axis: Direction = (0.0, 0.0, 1.0)
    d1: Direction | None = None
    length: float = field(init=False)

    def validate(self):
        axis, out, radius = self._axis_and_arm("turns")
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
        store(self, quaternion=tuple(q.tolist()), _frame=directors(q[None])[0], _curvature=np.array(self.curvature))

    def arguments(self):
        return {"frame" if name == "quaternion" else name: value for name, value in super().arguments().items()}
