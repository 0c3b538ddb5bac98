"""Centrelines of rods as curves in space that may come close to each other: nearest points of two strands, and their
derivatives.

A strand is any part of a rod; a rod may come close to itself. Lengths are in the unit of the positions. Tangents of
finite elements jump between elements, by which nearest points would alternate; so the curve of an element gets the mean
tangents at its ends: r + h (H_0 d_0 + H_1 d_1), with Hermite's cubics H of the slopes at the ends and half the jumps d
there. It is smooth, and linear in the positions of the nodes of three elements.
"""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.numerics import cross

#: Sine of the angle of two strands above which they touch in a point; below, along a line.
CROSSING = 0.2
#: Friction that is at its bound, but for this share.
AT_BOUND = 1e-6
# Places of an element where strands are compared first; Newton steps to the nearest points; their largest size, in
# elements, and the one at which they end, first, and from a step on after which rounding may not leave less: gaps have
# its square.
_PLACES, _STEPS, _LONGEST, _ENOUGH, _ROUNDED, _ROUGH = 4, 40, 0.7, 1e-10, 8, 1e-7
# Smallest determinant of the equations of two nearest points, for unit tangents, at which both are varied.
_PARALLEL = 1e-3
# Least curvature of half the square of the distance of strands that cross, over that of straight ones at their angle.
_FLAT = 0.04
# The neighbours of a pair of places.
_BESIDE = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]


class Apart:
    """Which points of rods may touch.

    Args:
        joints: [(rod, arc length, rod, arc length)] of points that are joined; rods by number.
        exclude: (rods,) length of a rod next to a point, or a joint, where it does not touch itself.
        pairs: (rods, rods) whether a rod touches another, or itself.
    """

    def __init__(self, joints, exclude, pairs):
        self._joints, self._exclude, self._pairs = joints, np.asarray(exclude), pairs

    def scaled(self, length):
        """The same in another unit of length."""
        joints = [(a, x / length, b, y / length) for a, x, b, y in self._joints]
        return Apart(joints, self._exclude / length, self._pairs)

    def may_touch(self, rod, s, other, t):
        """(n,) whether points at arc lengths s (n,) of rods (n,), and t of others, may touch."""
        between = np.where(rod == other, np.abs(s - t), np.inf)
        for a, x, b, y in self._joints:
            for i, u, j, v in ((a, x, b, y), (b, y, a, x)):
                here = (rod == i) & (other == j)
                between = np.where(here, np.minimum(between, np.abs(s - u) + np.abs(t - v)), between)
        return self._pairs[rod, other] & (between > np.maximum(self._exclude[rod], self._exclude[other]))


@dataclass(frozen=True, eq=False)
class Touches:
    """Pairs of points of strands, as arrays over them.

    Attributes:
        element, place: (m, 2) elements of the first and the second point, and the places in them, in [0, 1].
        slides: (m, 2) whether the point is where the distance is stationary along its strand; it is not at the ends of
            rods, nor where it is a node of the mesh along a line of contact.
        gap, distance: between the surfaces, and the centrelines; normal: (m, 3) unit vectors from first to second.
        node: (m,) the node of the first point along a line of contact, -1 at a point.
    """

    element: np.ndarray
    place: np.ndarray
    slides: np.ndarray
    gap: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    node: np.ndarray

    def __len__(self):
        return len(self.gap)

    def of(self, which):
        """Some of them."""
        return Touches(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


class Strands:
    """The centrelines of rods on a mesh.

    Args:
        cells: (elements, p + 1) nodes of every element; rods: (elements,) the rod of each, in order.
        sizes, starts: (elements,) its length, and the arc length where it begins.
        radii: (elements,) of the surface; rule: the `numerics.ElementRule`; apart: an `Apart`.
    """

    def __init__(self, cells, rods, sizes, starts, radii, rule, apart):
        self.cells, self.rods, self.sizes, self.starts, self.radii = cells, rods, sizes, starts, radii
        self._rule, self._nodes, self._apart = rule, rule.nodes, apart
        same = np.diff(rods) == 0
        count = np.arange(len(rods))
        self._next = np.where(np.append(same, False), count + 1, -1)
        self._before = np.where(np.insert(same, 0, False), count - 1, -1)
        #: (elements, 3 (p + 1)) the nodes of the elements before, of each, and after it; its own where there is none
        self.neighbours = (
            np.where(self._before < 0, count, self._before),
            count,
            np.where(self._next < 0, count, self._next),
        )
        self.stencil = np.concatenate([cells[k] for k in self.neighbours], axis=1)
        #: the elements that another one of their rod follows, and those that follow
        self.joined = np.flatnonzero(self._next >= 0), self._next[self._next >= 0]
        self._slopes = rule.derivative([0.0, 1.0], 1)
        cubics = [np.polynomial.Polynomial(c) for c in ((0, 1, -2, 1), (0, 0, -1, 1))]
        # of every order: coefficients of powers of 2 x - 1 of an element's basis, and of half of Hermite's slopes
        many = np.cos(np.pi * (np.arange(max(len(self._nodes), 4)) + 0.5) / max(len(self._nodes), 4))
        inverse, places = np.linalg.inv(np.vander(many, increasing=True)), (many + 1) / 2
        self._powers, self._coefficients = np.arange(len(many)), []
        for order in range(3):
            slopes = [cubic.deriv(order)(places) / 2 if order else cubic(places) / 2 for cubic in cubics]
            self._coefficients.append(inverse @ np.column_stack([rule.derivative(places, order), *slopes]))
        self._of = np.repeat(count, _PLACES)
        self._at = np.tile((np.arange(_PLACES) + 0.5) / _PLACES, len(rods))
        self._spacing = sizes.max() / _PLACES
        own = np.ones(cells.shape, dtype=bool)  # each node once, in the element before where two share it
        own[1:, 0] = ~same
        self._slave, self._slave_node = np.nonzero(own)

    @classmethod
    def of(cls, scene, layout, rule, length):
        """Those of a scene with a `RodContact` on a mesh, in a unit of length (m)."""
        action, counts, p = scene.rod_contact, layout.counts, len(rule.nodes) - 1
        rods = np.repeat(np.arange(len(counts)), counts)
        cells = (p * np.arange(len(rods)) + rods)[:, None] + np.arange(p + 1)
        radii = np.array([action.radius_of(rod) if action.acts_on(rod) else 0.0 for rod in scene.rods]) / length
        starts = [b[:-1] * rod.length / length for b, rod in zip(layout.breaks, scene.rods, strict=True)]
        sizes, apart = layout.sizes(scene) / length, action.apart(scene).scaled(length)
        return cls(cells, rods, sizes, np.concatenate(starts), radii[rods], rule, apart)

    def basis(self, element, place, order=0):
        """(n, 3 (p + 1)) derivatives of the basis by the place, of `stencil`; (n, orders, ..) for a tuple `order`."""
        orders, slopes, count = order if isinstance(order, tuple) else (order,), self._slopes, len(self._nodes)
        powers = (2 * place - 1)[:, None] ** self._powers
        found = np.stack([powers @ self._coefficients[k] for k in orders], axis=1)
        own, ends = found[..., :count], found[..., count:]
        beside = np.stack([self._before[element], self._next[element]], axis=1)
        ends = np.where(beside[:, None] < 0, 0.0, ends)
        ratio = (self.sizes[element][:, None] / self.sizes[beside])[:, None] * ends
        parts = ratio[..., :1] * slopes[1], own - ends @ slopes, ratio[..., 1:] * slopes[0]
        found = np.concatenate(parts, axis=2)
        return found if isinstance(order, tuple) else found[:, 0]

    def at(self, x, element, place, order=0):
        """(n, 3) position, or its derivative by arc length, by x (N, 3); (n, orders, 3) for a tuple `order`."""
        orders = order if isinstance(order, tuple) else (order,)
        nodes = x[self.stencil[element]]
        first = nodes[:, :1]  # subtracted for the sake of rounding
        values = self.basis(element, place, orders) @ (nodes - first)
        values /= self.sizes[element][:, None, None] ** np.array(orders)[:, None]
        if 0 in orders:
            values[:, orders.index(0)] += first[:, 0]
        return values if isinstance(order, tuple) else values[:, 0]

    def s(self, element, place):
        """(n,) arc lengths."""
        return self.starts[element] + self.sizes[element] * place

    def place_of(self, touches, k, length):
        """[(rod, arc length in units of 1/length)] of both points of the pair k."""
        return [(self.rods[e], self.s(e, a) * length)
                for e, a in zip(touches.element[k], touches.place[k], strict=True)]  # fmt: skip

    def _may_touch(self, first, second):
        (e, a), (f, b) = first, second
        return self._apart.may_touch(self.rods[e], self.s(e, a), self.rods[f], self.s(f, b))

    def _moved(self, element, place, change):
        """Elements and places after a limited change; and whether an end of a rod, or between elements, stops it."""
        place = place + np.minimum(np.maximum(change, -_LONGEST), _LONGEST)
        element, stopped = element.copy(), np.zeros(len(element), dtype=bool)
        for beyond, neighbour, shift, end in ((place > 1, self._next, -1.0, 1.0), (place < 0, self._before, 1.0, 0.0)):
            ended = beyond & (neighbour[element] < 0)
            goes = beyond & ~ended
            place[goes] += shift * 1.0
            element[goes] = neighbour[element[goes]]
            place[ended], stopped[ended] = end, True
        return element, place, stopped

    def _nearest(self, x, element, place, fixed):
        """(elements, places, slides), (m, 2) each, of the nearest points by Newton's method; the first `fixed`."""
        (e, f), (a, b) = element.T.copy(), place.T.copy()
        slides = np.ones((len(e), 2), dtype=bool)
        for step in range(_STEPS):
            both = np.concatenate([e, f]), np.concatenate([a, b])
            found = self.at(x, *both, (0, 1, 2)).swapaxes(0, 1)
            (p, t, tt), (q, u, uu) = found[:, : len(e)], found[:, len(e) :]
            w = q - p
            g, k = -np.sum(w * t, axis=1), np.sum(w * u, axis=1)
            G, K = np.sum(t * t - w * tt, axis=1), np.sum(u * u + w * uu, axis=1)
            C = -np.sum(t * u, axis=1)
            G, K = (np.where(x > 0.2, x, 1.0) for x in (G, K))
            determinant = G * K - C * C
            apart = fixed | (determinant < _PARALLEL) | ~slides.all(axis=1)
            safe = np.where(apart, 1.0, determinant)
            first = np.where(apart, -g / G, -(K * g - C * k) / safe) * ~fixed
            second = np.where(apart, -k / K, -(G * k - C * g) / safe)
            first, second = first / self.sizes[e], second / self.sizes[f]
            old = e, f, a, b
            e, a, stop = self._moved(e, a, first)
            slides[:, 0] = ~(stop | fixed)
            f, b, stop = self._moved(f, b, second)
            slides[:, 1] = ~stop
            if step > 10:  # two elements that lead to each other meet at their common end
                for now, place_now, was, place_was, column in ((e, a, old[0], old[2], 0), (f, b, old[1], old[3], 1)):
                    back = (now != was) & ((place_now < 0.1) | (place_now > 0.9)) & (step > 20)
                    place_now[back] = np.round(place_now[back])
                    slides[back, column] = False
            moved = np.abs(np.where(slides, np.stack([first, second], axis=1), 0.0)).max(initial=0.0)
            if moved < (_ENOUGH if step < _ROUNDED else _ROUGH):
                break
        return np.stack([e, f], axis=1), np.stack([a, b], axis=1), slides

    def near(self, x, reach):
        """All pairs of points of strands that are nearest to each other, with gaps below `reach`: where strands cross,
        the points of both; along strands side by side, the nodes of one and the nearest points of the other.

        Args:
            x: (N, 3) positions of the nodes.

        Returns:
            (`Touches`, the smallest distance of the centrelines over the sum of the radii; infinite without any).
        """
        from scipy.spatial import cKDTree  # late: scipy is slow to import

        points = self.at(x, self._of, self._at)
        cut = 2 * self.radii.max() + reach + self._spacing
        pairs = cKDTree(points).query_pairs(cut, output_type="ndarray")
        pairs = pairs[self._may_touch(*((self._of[p], self._at[p]) for p in pairs.T))]
        if not len(pairs):
            return self._none(), np.inf
        i, j = pairs.T
        size = np.linalg.norm(points[i] - points[j], axis=1)
        count = len(points)
        order = np.argsort(i * count + j)
        i, j, size = i[order], j[order], size[order]
        keys, lowest = i * count + j, np.ones(len(i), dtype=bool)
        rod = self.rods[self._of]
        for a, b in _BESIDE:
            u, v = i + a, j + b
            there = (u >= 0) & (v >= 0) & (u < count) & (v < count)
            u, v = np.clip(u, 0, count - 1), np.clip(v, 0, count - 1)
            there &= (rod[u] == rod[i]) & (rod[v] == rod[j])
            place = np.minimum(np.searchsorted(keys, u * count + v), len(keys) - 1)
            there &= keys[place] == u * count + v
            lowest &= ~there | (size <= size[place])
        found = self._made(x, np.c_[self._of[i], self._of[j]][lowest], np.c_[self._at[i], self._at[j]][lowest], None)
        found = self._once(found)
        total = self.radii[found.element].sum(axis=1)
        closest = (found.distance / total).min(initial=np.inf)
        (narrow, flat), lines = self._side_by_side(x, found), self._none()
        bent = self.at(x, self._of, self._at, (1, 2)).swapaxes(0, 1)
        if np.any(flat) or np.any(_side_by_side(points[j] - points[i], bent[:, i], bent[:, j])):
            lines = self._lines(x, points, cut, reach)
        # where they are flat next to no node, as in a narrow hook on few elements, they touch in a point after all
        beside = cKDTree(np.sort(lines.element)).query(np.sort(found.element), p=np.inf)[0] <= 1
        crosses = ~(narrow | flat & beside) | ~found.slides.all(axis=1)
        parts = [found.of(crosses & (found.gap < reach)), lines]
        joined = Touches(*(np.concatenate([getattr(p, n) for p in parts]) for n in Touches.__dataclass_fields__))
        return joined, closest

    def _none(self):
        pair, one = np.zeros((0, 2)), np.zeros(0)
        return Touches(pair.astype(int), pair, pair.astype(bool), one, one, np.zeros((0, 3)), one.astype(int))

    def _made(self, x, element, place, node):
        """`Touches` next to pairs of places; node: (m,) of first points that are fixed, or None."""
        found = self._followed(x, element, place, np.full(len(element), -1) if node is None else node)
        return found.of(self._may_touch(*((found.element[:, k], found.place[:, k]) for k in (0, 1))))

    def followed(self, x, touches):
        """The `Touches` next to others, those of other positions."""
        return self._followed(x, touches.element, touches.place, touches.node)

    def _followed(self, x, element, place, node):
        element, place, slides = self._nearest(x, element, place, node >= 0)
        w = self.apart(x, element, place)
        distance = np.linalg.norm(w, axis=1)
        normal = w / np.maximum(distance, np.finfo(float).tiny)[:, None]
        gap = distance - self.radii[element].sum(axis=1)
        return Touches(element, place, slides, gap, distance, normal, node)

    def apart(self, x, element, place):
        """(m, 3) vectors from the first to the second points of pairs of places (m, 2), linear in the positions x."""
        found = self.at(x, element.T.ravel(), place.T.ravel())
        return found[len(element) :] - found[: len(element)]

    def between(self, first, second, share):
        """Elements, places (m, 2) at a share (m,) of the arc lengths from some `Touches` to others of the same rods."""
        ends = np.cumsum(self.sizes) - self.sizes
        begin, end = (ends[t.element] + self.sizes[t.element] * t.place for t in (first, second))
        at = begin + share[:, None] * (end - begin)
        lowest, highest = np.sort([first.element, second.element], axis=0)
        element = np.clip(np.searchsorted(ends, at, side="right") - 1, lowest, highest)
        return element, (at - ends[element]) / self.sizes[element]

    def _once(self, found):
        """Each pair of points once."""
        from scipy.spatial import cKDTree

        s = np.column_stack([self.s(found.element[:, k], found.place[:, k]) for k in (0, 1)])
        order, close = np.argsort(found.distance, kind="stable"), 1e-6 * self.radii.max()
        places = np.c_[s, 2 * (1 + s.max(initial=0.0)) * self.rods[found.element]][order]
        kept = np.ones(len(order), dtype=bool)
        for nearer, other in sorted(cKDTree(places).query_pairs(close, p=np.inf)):
            kept[other] &= not kept[nearer]
        return found.of(np.sort(order[kept]))

    def _lines(self, x, points, cut, reach):
        """Nodes of strands next to others that run along them."""
        from scipy.spatial import cKDTree

        places = self._nodes[self._slave_node]
        nodes = x[self.cells[self._slave, self._slave_node]]
        rod, sizes = self.rods[self._of], self.sizes
        mean = np.bincount(self.rods, sizes) / np.bincount(self.rods)
        near = cKDTree(points).query_ball_point(nodes, cut, return_sorted=True)
        k = np.repeat(np.arange(len(nodes)), [len(found) for found in near])
        near = np.concatenate(near).astype(int)
        e, own, other = self._slave[k], self.rods[self._slave[k]], rod[near]
        finer = (mean[own] < mean[other]) | ((mean[own] == mean[other]) & (own < other))
        later = self.s(self._of[near], self._at[near]) > self.s(e, places[k])
        kept = np.where(other == own, later, finer)
        kept &= self._may_touch((e, places[k]), (self._of[near], self._at[near]))
        k, near = k[kept], near[kept]
        if not len(k):
            return self._none()
        runs = np.append(True, (np.diff(near) > 1) | (np.diff(rod[near]) != 0) | (np.diff(k) != 0))
        nearest = np.lexsort((np.linalg.norm(points[near] - nodes[k], axis=1), np.cumsum(runs)))[runs]
        k, master = k[nearest], near[nearest]
        element = np.c_[self._slave[k], self._of[master]]
        node = self.cells[self._slave[k], self._slave_node[k]]
        found = self._made(x, element, np.c_[places[k], self._at[master]], node)
        return found.of(np.any(self._side_by_side(x, found), axis=0) & found.slides[:, 1] & (found.gap < reach))

    def _side_by_side(self, x, found):
        """See `_side_by_side`, at pairs of points."""
        bent = (self.at(x, e, a, (1, 2)).swapaxes(0, 1) for e, a in zip(found.element.T, found.place.T, strict=True))
        return _side_by_side(found.normal * found.distance[:, None], *bent)

    # -- derivatives -------------------------------------------------------------------------------------------------

    def nodes_of(self, touches):
        """(m, n) the nodes that move the two points of each pair."""
        return self.movers(touches.element)

    def movers(self, element):
        """(m, n) the nodes that move points of pairs of elements (m, 2)."""
        return np.concatenate([self.stencil[element[:, k]] for k in (0, 1)], axis=1)

    def moves(self, element, place):
        """(m, n) shares of `movers` in how far the second of a pair of places moves from the first."""
        found = self.basis(element.T.ravel(), place.T.ravel())
        return np.concatenate([-found[: len(element)], found[len(element) :]], axis=1)

    def gradients(self, touches):
        """(m, n, 3) derivatives of the gaps by the positions of `nodes_of`."""
        return self.moves(touches.element, touches.place)[..., None] * touches.normal[:, None]

    def surface_pulls(self, element, place, direction, apart, across=None):
        """Forces and moments (m, parts, n, 6) at `movers` of unit forces along directions (m, 3) and, of three parts,
        along `across` (m, 2, 3) on the surfaces, midway between centrelines that are `apart` (m,)."""
        moves = self.moves(element, place)
        found = np.zeros((len(moves), 1 if across is None else 3, moves.shape[1], 6))
        found[:, 0, :, :3] = moves[..., None] * direction[:, None]
        if across is not None:
            radii = self.radii[element]
            deep = (radii.sum(axis=1) - apart) / 2
            arms = moves * np.repeat((radii - deep[:, None]) * (-1, 1), moves.shape[1] // 2, axis=1)
            found[:, 1:, :, :3] = moves[:, None, :, None] * across[:, :, None]
            turned = np.stack([across[:, 1], -across[:, 0]], axis=1)  # n x t
            found[:, 1:, :, 3:] = -arms[:, None, :, None] * turned[:, :, None]
        return found

    def curvatures(self, x, touches):
        """The second derivatives of the gaps by the positions of `nodes_of`, with the points that slide, as sums of
        products of columns: sum_k factor_k c_k c_k^T.

        Returns:
            columns (m, 4, 3 n), factors (m, 4).
        """
        m, p = len(touches), self.stencil.shape[1]
        values, slopes = (
            [
                self.basis(e, place, order) / self.sizes[e][:, None] ** order
                for e, place in zip(touches.element.T, touches.place.T, strict=True)
            ]
            for order in (0, 1)
        )
        moves = np.concatenate([-values[0], values[1]], axis=1)
        turns = np.zeros((2, m, 2 * p))
        turns[0, :, :p], turns[1, :, p:] = -slopes[0], slopes[1]
        n, w = touches.normal, touches.normal * touches.distance[:, None]
        t, tt = (
            [sign * self.at(x, touches.element[:, k], touches.place[:, k], order) for k, sign in ((0, -1), (1, 1))]
            for order in (1, 2)
        )
        across = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
        across /= np.linalg.norm(across, axis=1)[:, None]
        columns = np.zeros((m, 4, 2 * p, 3))
        for k, direction in enumerate((across, np.cross(n, across))):
            columns[:, k] = moves[..., None] * direction[:, None]
        F, free = np.zeros((m, 2, 2)), touches.slides
        for k in (0, 1):
            F[:, k, k] = np.sum(t[k] * t[k] + w * tt[k], axis=1)
        F[:, 0, 1] = F[:, 1, 0] = np.sum(t[0] * t[1], axis=1)
        F = np.where(free[:, :, None] & free[:, None, :], F, np.eye(2))
        sizes, turned = np.linalg.eigh(F)
        A = np.stack([moves[..., None] * t[k][:, None] + turns[k][..., None] * w[:, None] for k in (0, 1)], axis=1)
        columns[:, 2:] = np.einsum("mka,mknx->manx", turned, A * free[:, :, None, None])
        factors = np.concatenate([np.ones((m, 2)), -1 / sizes], axis=1) / touches.distance[:, None]
        return columns.reshape(m, 4, 6 * p), factors


def across(direction, normal=None):
    """(m, 2, 3) two unit vectors across directions (m, 3), next to an axis that normals (m, 3) choose."""
    n = direction / np.linalg.norm(direction, axis=1)[:, None]
    first = cross(n, np.eye(3)[np.abs(n if normal is None else normal).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, cross(n, first)], axis=1)


def _side_by_side(w, first, second):
    """(n,) whether strands are at a small angle, and whether, as those that wind around each other, at any angle, their
    distance hardly changes along them: both touch along a line. w: (n, 3) from the first to the second points; first,
    second: (2, n, 3) first and second derivatives of positions by arc length there."""
    (t, tt), (u, uu) = first, second
    G, K, C = (np.sum(a * b, axis=1) for a, b in ((t, t), (u, u), (t, u)))
    cosine = np.abs(C) / np.sqrt(G * K)
    G, K = G - np.sum(w * tt, axis=1), K + np.sum(w * uu, axis=1)
    least = (G + K) / 2 - np.hypot((G - K) / 2, C)  # of half the square of the distance, by both places
    return 1 - cosine**2 <= CROSSING**2, least <= _FLAT * (1 - cosine)


def closest_segments(points, rods, s, radii, apart, reach):
    """Gaps between polygons through points of rods, by the distances of their sides: independent of `Strands`. points:
    (n, 3); rods, s, radii: (n,) of each point; apart: an `Apart`; reach: largest gap of interest. Returns (gap,
    allowed, first, second), (k,) each: gaps of sides, how far the polygons may lie inside of the curves, and the arc
    lengths of the nearest points with their rods, (k, 2) each; only gaps below `reach`."""
    from scipy.spatial import cKDTree

    side = np.flatnonzero(np.diff(rods) == 0)
    a, b = points[side], points[side + 1]
    length = np.linalg.norm(b - a, axis=1)
    cut = 2 * radii.max() + reach + length.max()
    pairs = cKDTree((a + b) / 2).query_pairs(cut, output_type="ndarray")
    middle = (s[side] + s[side + 1]) / 2
    i, j = pairs.T
    keep = apart.may_touch(rods[side[i]], middle[i], rods[side[j]], middle[j])
    i, j = i[keep], j[keep]
    u, v, w = b[i] - a[i], b[j] - a[j], a[i] - a[j]
    A, B, C, D, E = (np.sum(p * q, axis=1) for p, q in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    determinant = A * C - B * B
    x = np.where(determinant > 1e-12 * A * C, (B * E - C * D) / np.where(determinant > 0, determinant, 1.0), 0.5)
    x = np.clip(x, 0, 1)
    y = np.clip((B * x + E) / C, 0, 1)
    x = np.clip((B * y - D) / A, 0, 1)
    gap = np.linalg.norm(w + x[:, None] * u - y[:, None] * v, axis=1)
    gap = gap - np.maximum(radii[side[i]], radii[side[i] + 1]) - np.maximum(radii[side[j]], radii[side[j] + 1])
    bend = np.zeros(len(points))
    inner = np.flatnonzero((np.diff(rods)[1:] == 0) & (np.diff(rods)[:-1] == 0)) + 1
    bend[inner] = np.linalg.norm(points[inner - 1] - 2 * points[inner] + points[inner + 1], axis=1) / 4
    sag = np.maximum(bend[side], bend[side + 1])
    where = [s[side[k]] + z * (s[side[k] + 1] - s[side[k]]) for k, z in ((i, x), (j, y))]
    close = gap < reach
    places = [np.c_[rods[side[k]], at][close] for k, at in zip((i, j), where, strict=True)]
    return gap[close], (sag[i] + sag[j])[close], *places


def in_words(rods, places, verb):
    """Two places of rods, (number, arc length in m) each, in words."""
    (a, s), (b, t) = places
    return f"rod '{rods[int(a)].name}' at s = {s:.6g} m {verb} rod '{rods[int(b)].name}' at s = {t:.6g} m"


def overlap(rods, found, allowed):
    """Where polygons overlap most beyond allowed depths (m), in words; "" without. found: of `closest_segments`, m."""
    gap, sag, *places = found
    deep = -(gap + sag) - allowed
    if not len(gap) or deep.max() <= 0:
        return ""
    k = int(np.argmax(deep))
    return f"{in_words(rods, [place[k] for place in places], 'overlaps')} by {-gap[k]:.3g} m"
