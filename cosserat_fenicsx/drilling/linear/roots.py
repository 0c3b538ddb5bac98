"""All roots of an analytic function in a box of the complex plane, counted by the argument principle.

Functions are real on the real axis: their roots are real or pairs, of which those with Im s >= 0 are returned. They
take s (n,) and return (f, f') scaled by any positive factors (n,): only phases and f'/f are used. An attribute
`exponents` = (a, b), s, says that they grow like exp(a s) to the left and exp(b s) to the right.

`follow` continues them from one case to the next, each in a column of its own, with all roots of every case counted.

`LumpedCutting`: the bit that cuts on a string of one mass and one disc: Richard, Germay & Detournay, J. Sound Vib. 305
(2007) 432.

In their units (time sqrt(I/C) of the disc I on the torsional spring C, length 2 C/(epsilon a^2)):

    u'' + 2 za wa u' + wa^2 u = -psi n (d - d0),    phi'' + 2 zt phi' + phi = -n (d - d0)

with the depth of cut d of a blade, d0 the steady one at the rotation om0 and the rate of penetration v0, and the
characteristic equation, with E = 1 - exp(-2 pi s/(n om0)) and rho = v0/om0,

    (s^2 + 2 za wa s + wa^2 + n psi E)(s^2 + 2 zt s + 1 - n rho E) + n^2 psi rho E^2 = 0.
"""

import math
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Annotated

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import positive, refuse
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.parts import Number, Part, Ratio, at_least


@dataclass(frozen=True)
class _Settings:
    """Settings of the search for roots."""

    turn: float = 1.0  # largest change of phase between points of a contour, rad
    mismatch: float = 0.3  # its largest misfit to the derivatives, rad
    reach: float = 1.5  # largest step over the distance of a single root with the same derivative
    near: float = 1e-9  # distance of a root, over the size of a contour, at which the contour is moved
    steps: int = 60  # of Newton's method
    settled: float = 1e-14  # relative step at which it stops
    rounding: float = 1e-11  # relative step at which it stops where steps no longer fall
    far: float = 0.25  # roots that move by more than this share of their distance are followed in halved steps
    halvings: int = 7
    same: float = 1e-8  # roots nearer to each other than this share of their size are one


_SET = _Settings()


@dataclass(frozen=True)
class Box:
    """left < Re s < right, bottom < Im s < top, 1/s; bottom = 0 stands for the symmetric box -top < Im s < top."""

    left: float
    right: float
    bottom: float
    top: float

    @property
    def size(self):
        return max(self.right - self.left, self.top - self.bottom)

    def holds(self, s):
        """Which of the roots of Im s >= 0 are inside."""
        return (s.real > self.left) & (s.real < self.right) & (s.imag >= self.bottom) & (s.imag < self.top)

    def near(self, s, margin):
        """Whether a root is inside, or outside by less than a margin."""
        return (self.left - margin < s.real < self.right + margin) and s.imag < self.top + margin

    def halves(self, share):
        """Both parts, cut across the longer side."""
        if self.top - self.bottom >= self.right - self.left:
            cut = self.bottom + share * (self.top - self.bottom)
            return replace(self, top=cut), replace(self, bottom=cut)
        cut = self.left + share * (self.right - self.left)
        return replace(self, right=cut), replace(self, left=cut)


class OnContour(Exception):
    """A root lies on the contour, or too near to it."""


def turns(f, corners, spacing):
    """Change of the phase of f along straight lines from corner to corner, rad.

    Intervals are halved until the phase turns by less than a limit in each, as the derivatives at both ends predict,
    and until no root can be as near as the interval is long.

    Raises:
        OnContour: no interval is short enough.
    """
    total = 0.0
    for a, b in zip(corners[:-1], corners[1:], strict=True):
        s = a + (b - a) * _shares(a, b, spacing)
        value, derivative = f(s)
        least = _SET.near * max(abs(x - y) for x in corners for y in corners)
        while True:
            if not np.all(value != 0):
                raise OnContour
            change = np.angle(value[1:] / value[:-1])
            log = derivative / value
            step = np.diff(s)
            predicted = ((log[1:] + log[:-1]) / 2 * step).imag
            # beside two close roots the phase turns by 2 pi, which is not visible at points on both sides: the size of
            # the logarithmic derivative says how near roots are
            near = np.abs(log - _rate(f, s))
            rough = (np.abs(change) > _SET.turn) | (np.abs(change - predicted) > _SET.mismatch)
            rough |= np.maximum(near[1:], near[:-1]) * np.abs(step) > _SET.reach
            if not rough.any():
                break
            where = np.flatnonzero(rough)
            middle = (s[where] + s[where + 1]) / 2
            if np.abs(step[where]).min() < least:
                raise OnContour
            new_value, new_derivative = f(middle)
            s = np.insert(s, where + 1, middle)
            value, derivative = np.insert(value, where + 1, new_value), np.insert(derivative, where + 1, new_derivative)
        total += float(change.sum())
    return total


def _shares(a, b, spacing):
    """Initial samples of a straight contour, from 0 to 1: even, but coarser far from the imaginary axis."""
    if a.imag != b.imag or max(abs(a.real), abs(b.real)) < 20 * spacing:
        return np.linspace(0.0, 1.0, 2 + math.ceil(abs(b - a) / spacing))
    low, high = np.arcsinh(np.array([a.real, b.real]) / (10 * spacing))
    x = 10 * spacing * np.sinh(np.linspace(low, high, 2 + math.ceil(10 * abs(high - low))))
    shares = (x - a.real) / (b.real - a.real)
    shares[[0, -1]] = 0.0, 1.0
    return shares


def count(f, box, spacing):
    """Number of roots in a box with multiplicity; in a symmetric one pairs count twice.

    Raises:
        OnContour: see `turns`.
    """
    low, high = box.left + 1j * box.bottom, box.right + 1j * box.top
    a, b, c, d = low, complex(high.real, low.imag), high, complex(low.real, high.imag)
    whole = turns(f, (b, c, d, a) if box.bottom == 0 else (a, b, c, d, a), spacing) / math.pi
    if box.bottom != 0:
        whole /= 2
    if abs(whole - round(whole)) > 1e-3:
        raise OnContour
    return round(whole)


def each(f, starts, stride):
    """(n,) complex by Newton's method from many points, in steps of at most `stride`; NaN where it has not settled."""
    s = np.array(starts, dtype=complex)
    size, open_ = np.full(len(s), np.inf), np.arange(len(s))
    for _ in range(_SET.steps):
        if not open_.size:
            break
        here = s[open_]
        with np.errstate(all="ignore"):
            value, derivative = f(here)
            step = np.where(value == 0, 0.0, -value / (derivative - _rate(f, here) * value))
        step = np.where(np.isfinite(step), step, 0.3 * stride)
        longest = np.maximum(stride, np.abs(here.real) / 4)  # far from the imaginary axis roots are far apart
        length, before = np.abs(step), size[open_]
        s[open_] = here + step * np.minimum(1.0, longest / np.maximum(length, 1e-300))
        size[open_] = length
        scale = np.maximum(np.abs(here), stride * 1e-3)
        done = (length <= _SET.settled * scale) | ((length <= _SET.rounding * scale) & (length >= before / 4))
        open_ = open_[~done]
    return np.where(size <= _SET.rounding * np.maximum(np.abs(s), stride * 1e-3), s, np.nan)


def _rate(f, s):
    """The rate of the exponential growth of f on either side, which Newton's method divides out."""
    left, right = getattr(f, "exponents", (0.0, 0.0))
    rate = np.where(s.real < 0, left, right)
    return rate * np.tanh(np.abs(s.real * rate))


def newton(f, starts, stride):
    """The roots that Newton's method finds from many starts, each once: (n,) complex of Im s >= 0."""
    done = each(f, starts, stride)
    done = done[np.isfinite(done)]
    done = np.where(done.imag < 0, done.conj(), done)
    real = np.abs(done.imag) < 1e-11 * np.maximum(np.abs(done), stride * 1e-3)
    return distinct(np.where(real, done.real + 0j, done))


def distinct(roots):
    """The roots without repetition, by frequency and then by growth."""
    kept = []
    for s in roots[np.lexsort((-roots.real, roots.imag))]:
        same = 1e-8 * max(abs(s), 1e-6)
        if all(abs(s - other) > same for other in takewhile(lambda x: s.imag - x.imag <= same, reversed(kept))):
            kept.append(s)
    return np.array(kept, dtype=complex)


def number_of(roots, box):
    """The number of roots with conjugates, from those of Im s >= 0."""
    return len(roots) + (int((roots.imag > 0).sum()) if box.bottom == 0 else 0)


def counted(f, box, spacing):
    """The count of a box, moved a little where a root lies on its contour: (count, box)."""
    for k in range(6):
        moved = box if k == 0 else Box(
            box.left - 1.3e-3 * k * spacing, box.right + 1.7e-3 * k * spacing,
            box.bottom - 1.1e-3 * k * spacing if box.bottom else 0.0, box.top + 2.3e-3 * k * spacing)  # fmt: skip
        try:
            return count(f, moved, spacing / 4), moved
        except OnContour:
            continue
    raise NotConverged(f"the roots in {box} could not be counted: one lies on every contour that was tried")


def all_roots(f, box, spacing, known=()):
    """All roots in a box, as many as the argument principle says. f: see above. box: a `Box`. spacing: typical distance
    of roots, rad/s. known: guesses, (n,). Returns (roots, box): (n,) complex of Im s >= 0, repeated as often as they
    are multiple; by frequency, then by growth. The box differs by a few thousandths of `spacing` where a root would lie
    on its contour. Raises NotConverged: the roots found are fewer than those counted."""
    total, box = counted(f, box, spacing)
    found = np.array([], dtype=complex)
    if len(known):
        found = newton(f, known, spacing / 2)
        found = found[box.holds(found)]
    if number_of(found, box) != total:
        found = _search(f, box, spacing, total, found)
    return found[np.lexsort((-found.real, found.imag))], box


def _search(f, box, spacing, total, known, depth=0):
    """The roots in a box whose number is known: from a net of starts, then in halves of the box."""
    if total == 0:
        return np.array([], dtype=complex)
    starts = np.concatenate([known[box.holds(known)], _net(box, spacing)])
    found = newton(f, starts, spacing / 2)
    found = found[box.holds(found)]
    if number_of(found, box) == total:
        return found
    if box.size < 1e-7 * spacing or depth > 60:
        if len(found) == 1 and number_of(found, box) < total:  # a multiple root
            return np.repeat(found, total // number_of(found, box))
        raise NotConverged(f"{total} roots were counted in {box}, {number_of(found, box)} found")
    for share in (0.5, 0.4617, 0.5391, 0.4233):
        parts = box.halves(share)
        try:
            totals = [count(f, part, min(spacing / 4, part.size / 8)) for part in parts]
        except OnContour:
            continue
        pairs = 2 if box.bottom == 0 and parts[1].bottom != 0 else 1  # the upper half counts no conjugate roots
        if totals[0] + pairs * totals[1] == total:
            break
    else:
        raise NotConverged(f"the {total} roots in {box} could not be separated")
    pieces = [_search(f, part, spacing, n, found, depth + 1) for part, n in zip(parts, totals, strict=True)]
    return np.concatenate(pieces)


def _net(box, spacing):
    """Starts for Newton's method: near the imaginary axis, and to its left and right as far as the box goes."""
    wide, high = box.right - box.left, box.top - box.bottom
    heights = box.bottom + high * (np.arange(n := 2 + math.ceil(3 * high / spacing)) + 0.43) / n
    columns = np.array([0.0, -0.15, 0.15, -0.6, 0.6]) * spacing
    columns = np.unique(np.clip(columns, box.left + 0.05 * wide, box.right - 0.05 * wide))
    axis = np.linspace(box.left, box.right, 12) + 0j if box.bottom == 0 else np.array([])
    return np.concatenate([(columns[:, None] + 1j * heights[None, :]).ravel(), axis])


def follow(equation, points, parents, box, spacing):
    """The roots of a family of functions at many points, each mode in a column of its own.

    Args:
        equation: function of the parameters (d,) that returns a characteristic function. points: (n, d) parameters.
        parents: for each point, in order of preference, the indices of earlier points from which modes are followed.
        box: function of a characteristic function that gives the `Box`. spacing: typical distance of roots, rad/s.

    Returns:
        (n, m) complex; NaN where a mode is outside the box. Modes that come into the box add columns.

    Raises:
        NotConverged: the roots of a case differ from their count.
    """
    rows, followed, following = [], [], 0
    for point, origins in zip(points, parents, strict=True):
        f, here, lost = equation(point), {}, {}
        for k in origins:
            here = _moved(equation, points[k], point, followed[k], spacing) | here
            lost = followed[k] | lost
        found, counted = all_roots(f, box(f), f.spacing, np.array(list(here.values())))
        lost = {name: s for name, s in lost.items() if name not in here}
        row, following = _named(found, here, lost, spacing, following)
        rows.append(row)
        # those that leave the box are followed on, to know them when they come back
        beyond = {name: s for name, s in here.items() if not counted.holds(s) and counted.near(s, 2 * spacing)}
        followed.append(beyond | row)
    names = sorted({name for row in rows for name in row})
    roots = np.full((len(rows), len(names)), np.nan + 0j)
    for k, row in enumerate(rows):
        for name, s in row.items():
            roots[k, name] = s
    return roots


def _moved(equation, start, end, roots, spacing, depth=0):
    """Roots by name, followed by Newton's method from one point to another, without lost ones."""
    names = list(roots)
    if not names:
        return {}
    old = np.array([roots[name] for name in names])
    new = each(equation(end), old, spacing / 2)
    new = np.where(new.imag < 0, new.conj(), new)
    apart = np.abs(new[:, None] - new[None, :]) + np.diag(np.full(len(new), np.inf))
    safe = np.isfinite(new) & (np.abs(new - old) < _SET.far * np.maximum(spacing, np.abs(old.real)))
    safe &= ~(apart < _SET.same * np.abs(new)[:, None]).any(axis=1)
    moved = {name: s for name, s, good in zip(names, new, safe, strict=True) if good}
    rest = {name: roots[name] for name in names if name not in moved}
    if rest and depth < _SET.halvings:
        middle = (start + end) / 2
        half = _moved(equation, start, middle, rest, spacing, depth + 1)
        for name, s in _moved(equation, middle, end, half, spacing, depth + 1).items():
            if all(abs(s - other) > _SET.same * abs(s) for other in moved.values()):
                moved[name] = s
    return moved


def _named(found, here, lost, spacing, following):
    """The roots of a case by name: followed ones, then those near a lost one, then new ones."""
    row, free = {}, list(range(len(found)))
    for name, s in here.items():
        near = [k for k in free if abs(found[k] - s) < 1e-7 * max(abs(s), 1e-3)]
        if near:
            row[name] = found[near[0]]
            free.remove(near[0])
    for distance, k, name in sorted((abs(found[k] - s), k, name) for k in free for name, s in lost.items()):
        if distance < spacing / 2 and k in free and name not in row:
            row[name] = found[k]
            free.remove(k)
    return row | {following + i: found[k] for i, k in enumerate(free)}, following + len(free)


NotNegative = Annotated[float, Number(limits=at_least(0))]


@dataclass(frozen=True)
class LumpedCutting(Part):
    """The lumped model in its own units, see the head of its file.

    Args:
        psi: ratio of axial to torsional stiffness of the cut over those of the string, zeta epsilon a I/(M C).
        blades: n. penetration: v0; 0 for the axial motion alone.
        axial_frequency, axial_damping: wa and za; 0 for a mass without spring, as in the paper.
        torsional_damping: zt.

    Raises:
        SceneError: numbers out of range.
    """

    psi: Ratio
    blades: Annotated[int, Number(limits=at_least(1, "a number of blades"), whole=True)]
    penetration: NotNegative = 0.0
    axial_frequency: NotNegative = 0.0
    axial_damping: NotNegative = 0.0
    torsional_damping: NotNegative = 0.0

    def roots(self, rotation: float, up_to: float | None = None) -> np.ndarray:
        """All roots with Re s > -1 at a rotation om0.

        Args:
            up_to: largest imaginary part; None for that beyond which no root can grow.

        Returns:
            (m,) complex of Im s >= 0, the fastest growing one first. The root 0 of a string whose axial position is
            arbitrary (wa = 0) is left out.

        Raises:
            SceneError: a rotation that is not positive. NotConverged: roots are missing from their count.
        """
        rotation = positive("LumpedCutting", "rotation", rotation, "number")
        n, rho = self.blades, self.penetration / rotation
        # on the right |E| <= 2: no root is farther from 0 than where |s|^2 outweighs all the rest
        reach = 2 + 2 * self.axial_damping * self.axial_frequency + 2 * self.torsional_damping + self.axial_frequency
        reach += math.sqrt(2 * n * self.psi) + math.sqrt(2 * n * rho) + 1
        up_to = reach if up_to is None else positive("LumpedCutting", "up_to", up_to, "number")
        spacing = min(1.0, n * rotation)
        roots, _ = all_roots(self._equation(rotation), Box(-1.0, reach, 0.0, up_to), spacing)
        roots = roots[np.abs(roots) > 1e-9]
        return roots[np.argsort(-roots.real, kind="stable")]

    def limits(self, low: float, high: float, points: int = 40) -> np.ndarray:
        """Rotations between `low` and `high` where the number of growing roots changes, ascending.

        Args:
            points: at which the roots are counted in between; two changes between neighbours would be missed.

        Raises:
            SceneError: an empty range. NotConverged: roots are missing from their count.
        """
        low, high = positive("LumpedCutting", "low", low, "number"), positive("LumpedCutting", "high", high, "number")
        if low >= high:
            refuse("LumpedCutting", "high", high, f"more than low, {low:g}")

        def growth(rotation, nth):
            roots = self.roots(rotation)
            return float(roots.real[nth]) if nth < len(roots) else -1.0

        rotations = np.geomspace(low, high, points)
        spectra = [self.roots(x) for x in rotations]
        found = []
        for k in range(points - 1):
            before, after = (int((s.real > 0).sum()) for s in spectra[k : k + 2])
            if before != after:
                nth = min(before, after)  # in the order of growth
                found.append(brentq(growth, *rotations[k : k + 2], (nth,), xtol=1e-13))
        return np.array(found)

    def _equation(self, rotation):
        n, psi, rho, tau = self.blades, self.psi, self.penetration / rotation, 2 * math.pi / (self.blades * rotation)
        wa, za, zt = self.axial_frequency, self.axial_damping, self.torsional_damping

        def f(s):
            with np.errstate(over="ignore"):
                decayed = np.exp(-s * tau)
            E, dE = 1 - decayed, tau * decayed
            axial, daxial = s**2 + 2 * za * wa * s + wa**2, 2 * s + 2 * za * wa
            if rho == 0.0:
                return axial + n * psi * E, daxial + n * psi * dE
            torsional, dtorsional = s**2 + 2 * zt * s + 1, 2 * s + 2 * zt
            cut, dcut = n * (psi * torsional - rho * axial), n * (psi * dtorsional - rho * daxial)  # E^2 drops out
            return axial * torsional + E * cut, daxial * torsional + axial * dtorsional + dE * cut + E * dcut

        return f
