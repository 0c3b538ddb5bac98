"""Threads along rods (`Action.is_thread`): what they carry, their tensions and lengths."""

from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.numerics import conjugate_product, directors
from cosserat_fenicsx.quantities import span_in_words
from cosserat_fenicsx.results.compared import cell_nodes
from cosserat_fenicsx.scene.action import without_stress
from cosserat_fenicsx.scene.signals import at

# Newton's iterations for n and m of a rod from what a cut carries, and the relative change at which they end.
_MOST, _SAME = 30, 1e-13
# Share of an element's length by which its ends are inside it, where data may jump.
_INSIDE = 1e-9


class TendonState(NamedTuple):
    """A tendon in several states: its tension (n,), N, and its length along the rod (n,), m; `print` shows the first
    and the last, and in how many states it is slack."""

    tension: np.ndarray
    length: np.ndarray

    @property
    def slack(self):
        """(n,) whether it has no tension."""
        return self.tension == 0

    def __str__(self):
        slack = f", slack in {self.slack.sum()} of {len(self.slack)} states" if self.slack.any() else ""
        return f"tension {span_in_words(self.tension, 'N')}, length {span_in_words(self.length, 'm')}{slack}"


class Threads:
    """The threads of a scene in all states of a `Path` or `History`.

    Args:
        result: the `Path` or `History`.
    """

    def __init__(self, result):
        self._result, self._records = result, result._all
        self._threads = [thread for thread in result.scene.actions if thread.is_thread]

    def at_gauss(self):
        """(n, elements, points, 6) the force T t and the moment R a x T t about the axis, of all threads, at the Gauss
        points, inertial, dimensionless."""
        found = np.zeros((*self._records["gauss_fields"].shape[:3], 6))
        for thread in self._threads:
            places, R, v, k = self._strained(thread)
            found[:, places.cells] += _inertial(R, self._carried(thread, places, v, k)[0])
        return found

    def taken_from(self, cut):
        """(n, elements, p + 1, 6) n and m of the rods at the nodes from what cuts carry, dimensionless, inertial.

        At the ends of elements the strains follow from n and m by the law, and the force of the threads from the
        strains: six equations for n and m, NaN where they are not met. In between the polynomial through the ends and
        the Gauss points is used.
        """
        rule, at_gauss = self._result.rule, self.at_gauss()
        at_ends = np.zeros((*at_gauss.shape[:2], 2, 6))
        for rod in {thread.rod: None for thread in self._threads}:
            places = _Places(self._result, rod, np.array([_INSIDE, 1 - _INSIDE]))
            R, _ = places.turned(self._records)
            whole = _inertial(np.swapaxes(R, -1, -2), cut[:, places.cells][:, :, [0, -1]])
            at_ends[:, places.cells] = _inertial(R, self._share(places, whole))
        ends_and_gauss = np.concatenate([at_ends[:, :, :1], at_gauss, at_ends[:, :, 1:]], axis=2)
        return cut - np.matmul(rule.from_ends_and_gauss, ends_and_gauss)

    def _share(self, places, whole):
        """(n, elements, points, 6) the part of threads in what cuts carry, `whole`, material, dimensionless."""
        own, (without, compliance) = whole.copy(), places.law(self._records)
        threads = [thread for thread in self._threads if thread.rod is places.rod]
        for _ in range(_MOST):
            strains = without + np.einsum("ekij,nekj->neki", compliance, own)
            parts = [self._carried(thread, places, strains[..., :3], strains[..., 3:]) for thread in threads]
            share, slope = (sum(values) for values in zip(*parts, strict=True))
            step = np.linalg.solve(np.eye(6) + slope @ compliance, (whole - share - own)[..., None])[..., 0]
            own += step
            if np.abs(step).max() <= _SAME * np.abs([own, share]).max():
                return whole - own
        return np.full_like(whole, np.nan)

    def tension(self, thread):
        """(n,) N."""
        records = self._records
        if thread.shortens:
            found = [other for other in self._threads if other.shortens]
            return records["reactions"][:, found.index(thread) - len(found)] * self._result.scales.force
        times = records["time"] if "time" in records.columns else np.zeros(len(records))
        full = thread.amplitude * np.array([np.reshape(at(thread, t).tension, -1)[0] for t in times], dtype=float)
        return full * records["load_factor"] if thread.scaled else full

    def length(self, thread):
        """(n,) m."""
        places, _, v, k = self._strained(thread)
        sizes = np.linalg.norm(_along(thread, places, v, k)[1], axis=-1)
        return sizes @ self._result.rule.weights @ np.diff(places.breaks) * places.rod.length

    def _strained(self, thread):
        """The Gauss points of a thread's rod, the directors there, and v and u - u_R, see `_Places`."""
        places = _Places(self._result, thread.rod, self._result.rule.gauss)
        R, k = places.turned(self._records)
        v = np.einsum("...ji,...j->...i", R, self._records["gauss_fields"][:, places.cells, :, 6:])
        return places, R, v, k

    def _carried(self, thread, places, v, k):
        """T t and p x T t (n, elements, points, 6) for v and u - u_R, and their derivatives (.., 6, 6), material."""
        arm, along = _along(thread, places, v, k)
        size = np.linalg.norm(along, axis=-1, keepdims=True)
        t, lever = along / size, np.concatenate([np.broadcast_to(np.eye(3), (*arm.shape, 3)), _skew(arm)], axis=-2)
        tension = self.tension(thread)[:, None, None, None] / self._result.scales.force
        across = (tension / size)[..., None] * (np.eye(3) - t[..., :, None] * t[..., None, :])
        return np.einsum("ekij,nekj->neki", lever, tension * t), lever @ across @ np.swapaxes(lever, -1, -2)


def _along(thread, places, v, k):
    """p (elements, points, 3) and v + u x p + p' (n, elements, points, 3), material, dimensionless."""
    frames, length = places.frames, places.length
    _, arm, slope = (datum.value for datum in at(thread, 0.0).data(places.rod, places.s))
    p, along = (np.einsum("kji,kj->ki", frames, a).reshape(*places.shape, 3) for a in (arm / length, slope))
    return p, v + np.cross(k, p) + along


class _Places:
    """Points x (points,) in [0, 1] of the elements of a rod of a `Path` or `History`."""

    def __init__(self, result, rod, x):
        i, _ = result._rows(rod)
        self.rod, self.cells, self._nodes = rod, result._cells(i), cell_nodes(result.layout, result.degree)[i][0]
        self.breaks, self.length, self._scales = result.layout.breaks[i], result.scales.length, result.scales
        h = np.diff(self.breaks)[:, None]
        self._basis, self._slopes = result.rule.basis(x), result.rule.slopes
        self._h, s = h[..., None] * rod.length / self.length, (self.breaks[:-1, None] + h * x) * rod.length
        self.shape, self.s, self._scene = s.shape, s.ravel(), result.scene
        self.frames = rod.curve.frame(self.s)

    def turned(self, records):
        """(n, elements, points, 3, 3) directors, and (n, elements, points, 3) u - u_R, material, dimensionless; the
        latter at the Gauss points alone."""
        q = records["rq"][:, self._nodes, 3:]
        here, slope = self._basis @ q, self._slopes @ q / self._h
        squared = np.einsum("...i,...i", here, here)[..., None]
        R = directors((here / np.sqrt(squared)).reshape(-1, 4)).reshape(len(q), -1, 3, 3) @ self.frames
        R = R.reshape(*here.shape[:3], 3, 3)
        if here.shape != slope.shape:
            return R, None
        k = 2 * conjugate_product(here, slope) / squared
        return R, np.einsum("kji,nkj->nki", self.frames, k.reshape(len(q), -1, 3)).reshape(k.shape)

    def law(self, records):
        """v and u - u_R without stress (n, elements, points, 6), and their derivatives by n and m (elements, points, 6,
        6), material, dimensionless, in statics."""
        along, sizes = self.rod.stiffness_at(self.s), np.repeat([1.0, self.length], 3)
        units = np.broadcast_to(np.eye(6)[:, None], (6, len(self.s), 6))
        by_unit = along.strains(units[..., :3] * self._scales.force, units[..., 3:] * self._scales.moment)
        compliance = np.moveaxis(np.concatenate(by_unit, axis=-1) * sizes, 0, -1).reshape(*self.shape, 6, 6)
        without = np.tile([0.0, 0, 1, 0, 0, 0], (len(records), len(self.s), 1))
        if self._scene.acts_in_law:
            full, scaled = (values[::-1] for values in without_stress(self._scene, self.rod, self.s))
            free = full + np.multiply.outer(records["load_factor"], scaled)
            without += np.concatenate([free[:, 0], free[:, 1]], axis=-1) * sizes
        return without.reshape(len(records), *self.shape, 6), compliance


def _inertial(R, a):
    """Two vectors (.., 6) multiplied by matrices R (.., 3, 3)."""
    return np.concatenate([np.einsum("...ij,...j->...i", R, part) for part in np.split(a, 2, axis=-1)], axis=-1)


def _skew(a):
    """(.., 3, 3) the matrices of the cross product by vectors (.., 3)."""
    return np.cross(a[..., None, :], np.eye(3)).swapaxes(-1, -2)
