"""Threads along rods (`Action.is_thread`): what they carry, their tensions and lengths."""

from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.numerics import conjugate_product, directors
from cosserat_fenicsx.results.compared import cell_nodes
from cosserat_fenicsx.scene.action import without_stress
from cosserat_fenicsx.scene.signals import at

# Iterations for the strains of sections from what a cut carries, and the relative change at which they end. The share of
# a thread in the stiffness of a section is small, and its square is that of an iteration.
_MOST, _SAME = 50, 1e-13
# Share of an element's length by which its ends are inside it, where data may jump.
_INSIDE = 1e-9


class TendonState(NamedTuple):
    """A tendon in several states: its tension (n,), N, and its length along the rod (n,), m."""

    tension: np.ndarray
    length: np.ndarray


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
            places = _Places(self._result, thread.rod, self._result.rule.gauss)
            R, k = places.turned(self._records)
            v = np.einsum("...ji,...j->...i", R, self._records["gauss_fields"][:, places.cells, :, 6:])
            found[:, places.cells] += _inertial(R, self._carried(thread, places, v, k))
        return found

    def taken_from(self, cut):
        """(n, elements, p + 1, 6) n and m of the rods at the nodes from what cuts carry, dimensionless, inertial.

        At the ends of elements the strains follow from n and m by the law, and the force of the threads from the
        strains; in between the polynomial through the ends and the Gauss points is used.
        """
        rule, at_gauss = self._result.rule, self.at_gauss()
        at_ends = np.zeros((*at_gauss.shape[:2], 2, 6))
        for rod in {thread.rod: None for thread in self._threads}:
            places = _Places(self._result, rod, np.array([_INSIDE, 1 - _INSIDE]))
            R, _ = places.turned(self._records)
            whole = _material(R, cut[:, places.cells][:, :, [0, -1]])
            share = np.zeros_like(whole)
            for _ in range(_MOST):
                before, (v, k) = share, places.strains(self._records, whole - share)
                share = sum(self._carried(x, places, v, k) for x in self._threads if x.rod is rod)
                if np.abs(share - before).max() <= _SAME * np.abs(whole).max():
                    break
            at_ends[:, places.cells] = _inertial(R, share)
        ends_and_gauss = np.concatenate([at_ends[:, :, :1], at_gauss, at_ends[:, :, 1:]], axis=2)
        return cut - np.matmul(rule.from_ends_and_gauss, ends_and_gauss)

    def tension(self, thread):
        """(n,) N."""
        records = self._records
        times = records["time"] if "time" in records.columns else np.zeros(len(records))
        full = np.array([np.reshape(at(thread, t).tension, -1)[0] for t in times], dtype=float)
        return full * records["load_factor"] if thread.scaled else full

    def length(self, thread):
        """(n,) m."""
        places = _Places(self._result, thread.rod, self._result.rule.gauss)
        R, k = places.turned(self._records)
        v = np.einsum("...ji,...j->...i", R, self._records["gauss_fields"][:, places.cells, :, 6:])
        sizes = np.linalg.norm(_along(thread, places, v, k)[1], axis=-1)
        return sizes @ self._result.rule.weights @ np.diff(places.breaks) * places.rod.length

    def _carried(self, thread, places, v, k):
        """(n, elements, points, 6) T t and p x T t, material, for strains v and u - u_R, dimensionless."""
        arm, along = _along(thread, places, v, k)
        tension = self.tension(thread)[:, None, None, None] / self._result.scales.force
        force = tension * along / np.linalg.norm(along, axis=-1, keepdims=True)
        return np.concatenate([force, np.cross(np.broadcast_to(arm, force.shape), force)], axis=-1)


def _along(thread, places, v, k):
    """p (elements, points, 3) and v + u x p + p' (n, elements, points, 3), material, dimensionless."""
    frames, length = places.frames, places.length
    _, arm, slope = (datum.value for datum in at(thread, 0.0).data(places.rod, places.s))
    p, along = (np.einsum("kji,kj->ki", frames, a).reshape(*places.shape, 3) for a in (arm / length, slope))
    return p, v + np.cross(k, p) + along


class _Places:
    """Points of the elements of a rod.

    Args:
        result: a `Path` or `History`; rod: of its scene; x: (points,) in [0, 1].
    """

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

    def strains(self, records, contact):
        """v and u - u_R, material, dimensionless, for n and m (n, elements, points, 6), material, dimensionless."""
        n, m = (a.reshape(len(contact), -1, 3) for a in np.split(contact, 2, axis=-1))
        e, k = self.rod.stiffness_at(self.s).strains(n * self._scales.force, m * self._scales.moment)
        times = records["time"] if "time" in records.columns else np.zeros(len(records))
        for i, (t, load_factor) in enumerate(zip(times, records["load_factor"], strict=True)):
            full, scaled = (
                without_stress(self._scene, self.rod, self.s, t) if self._scene.acts_in_law else np.zeros((2, 2))
            )
            k[i] += full[0] + load_factor * scaled[0]
            e[i] += full[1] + load_factor * scaled[1]
        v = e + [0.0, 0.0, 1.0]
        return v.reshape(*contact.shape[:3], 3), k.reshape(*contact.shape[:3], 3) * self.length


def _inertial(R, a):
    return np.concatenate([np.einsum("...ij,...j->...i", R, part) for part in np.split(a, 2, axis=-1)], axis=-1)


def _material(R, a):
    return _inertial(np.swapaxes(R, -1, -2), a)
