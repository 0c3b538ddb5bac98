"""Contact forces and moments at the nodes from the values at the Gauss points, by the equilibrium of each element;
and threads along rods (`Action.is_thread`): what they carry, their tensions and lengths.
"""

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cosserat_fenicsx.numerics import conjugate_product, directors, lagrange, product_conjugate
from cosserat_fenicsx.quantities import Quantity, Units, span_in_words
from cosserat_fenicsx.results.records import Records
from cosserat_fenicsx.results.compared import all_cell_nodes, cell_nodes
from cosserat_fenicsx.results.result import Result, by_name
from cosserat_fenicsx.scene.action import without_stress
from cosserat_fenicsx.scene.profiles import BESIDE_BREAK
from cosserat_fenicsx.scene.signals import at
from cosserat_fenicsx.turning import Turning


def element_contact(path, records, carried=None):
    """(n, elements, p + 1, 6) n and m (dimensionless, inertial) of `Records` at the nodes of every element: those of
    the rods, and `carried`, what threads along them carry at the Gauss points (`carried_by_threads`).

    At the element ends they follow from the element's weak form with the shape functions of its ends as test functions,
    which is as accurate as the nodal positions (order 2p). At the nodes between they are interpolated by the polynomial
    through both ends and the Gauss points. Virtual rotations are those of the formulation, see `Path.galerkin`.
    """
    rule, p, mesh, fields = path.rule, path.degree, path._mesh, records["gauss_fields"]
    if carried is not None:
        fields = np.concatenate([fields[..., :6] + carried, fields[..., 6:]], axis=3)
    at_gauss, at_nodes = records["densities"]
    along = np.empty((*fields.shape[:2], p + 1, 6))
    mesh.call("recover_all", mesh.c, len(fields), fields, at_gauss, along)
    if path.galerkin or at_nodes is not None:
        h, cells = _elements(path.layout, path.scene, path.scales.length, p)
        more = np.zeros((*along.shape[:2], 2, 6))
        if at_nodes is not None:
            more -= h * rule.lobatto[[0, p], None] * at_nodes[:, :, [0, p]]
        if path.galerkin:
            n, r_s, density = fields[..., :3], fields[..., 6:], np.zeros_like(fields[..., :6])
            density[..., 3:] = r_s[..., _NEXT] * n[..., _LAST] - r_s[..., _LAST] * n[..., _NEXT]
            density += 0.0 if at_gauss is None else at_gauss
            q, m = records["rq"][:, :, 3:][:, cells], fields[..., 3:6]
            for i, end in enumerate((0, p)):
                grad, value = rule.weights * rule.slopes[:, end], rule.weights * rule.at_gauss[:, end]
                plain = np.matmul(grad, m) - h[..., 0] * np.matmul(value, density[..., 3:])
                more[:, :, i, 3:] += _tested_by_turning(q, end, rule, h, m, density[..., 3:]) - plain
        along += np.matmul(rule.from_ends_and_gauss[:, [0, -1]] * [-1, 1], more)
    return along


# Components in cyclic order.
_NEXT, _LAST = [1, 2, 0], [2, 0, 1]


@lru_cache(maxsize=32)
def _elements(layout, scene, length, p):
    """Of all rods one after another: (elements, 1, 1) lengths, and (elements, p + 1) the nodes of each."""
    return layout.sizes(scene)[:, None, None] / length, all_cell_nodes(layout, p)


def _tested_by_turning(q, end, rule, h, m, density):
    """(n, elements, 3) work-conjugate moments of small rotations of one end, where virtual rotations are changes of q.

    A small rotation theta of the end alone changes q_h by N theta q_end/2, which is the virtual rotation
    N vec(theta c) with c = q_end conj(q_h)/|q_h|^2 and N the shape function of the end.

    Args:
        q: (n, elements, p + 1, 4) at the nodes; end: index of the end among them.
        h: (elements, 1, 1) lengths; m: (n, elements, points, 3) moments at the Gauss points.
        density: (n, elements, points, 3) r' x n and moments per length.
    """
    basis = rule.at_gauss
    inside, slope = basis @ q, rule.slopes @ q / h
    squared = np.einsum("...i,...i", inside, inside)[..., None]
    at_end = np.broadcast_to(q[:, :, end, None], inside.shape)
    c = product_conjugate(at_end, inside) / squared
    c_s = (product_conjugate(at_end, slope) - 2 * np.einsum("...i,...i", inside, slope)[..., None] * c) / squared
    N, N_s = basis[:, end, None], rule.slopes[:, end, None] / h
    tested = N_s * _turned(c, m) + N * (_turned(c_s, m) - _turned(c, density))
    return h[..., 0] * np.matmul(rule.weights, tested)


def _turned(c, a):
    """The transpose of the map theta -> vec(theta c), applied to vectors a."""
    return c[..., :1] * a + np.cross(c[..., 1:], a)


def at_nodes(values):
    """(nodes, k) from values (elements, p + 1, k) of a rod; at shared nodes those of the element before."""
    return np.concatenate([values[:1, 0], values[:, 1:].reshape(-1, values.shape[2])])


def viscous_contact(history, which, rod):
    """n and m (n, nodes, 3) of Kelvin-Voigt damping of a rod in several states of a `History`, N and N m, material; at
    a jump of the section the values of the element before."""
    s = history.layout.nodes_of(history._rows(rod)[0], history.rule.nodes) * rod.length
    law = rod.damping.viscosity(rod.stiffness_at(s, "left"))
    rates = np.array([_strain_rates(history, history._records[k], rod) for k in which])
    return law.contact(rates[..., :3], rates[..., 3:])


def _strain_rates(history, record, rod):
    """(nodes, 6) rates of the material strains v and u, 1/s and 1/(m s), extrapolated from the Gauss points: v_t = R^T
    (r_t' - w x r') and u_t = R^T w', with the angular velocity w = 2 vec(q_t conj(q))/|q|^2 of the interpolated q, as
    in the models."""
    i, _ = history._rows(rod)
    rule, breaks, cells = history.rule, history.layout.breaks[i], history._cells(i)
    h = np.diff(breaks)[:, None, None] * rod.length / history.scales.length
    nodes, _ = cell_nodes(history.layout, history.degree)[i]
    q, velocity, spin = record.rq[nodes, 3:], record.rates[nodes, :3], record.rates[nodes, 3:]
    zero = np.zeros_like(spin[..., :1])
    q_t = product_conjugate(np.concatenate([zero, spin], axis=-1), q * [1, -1, -1, -1]) / 2
    (p, p_t), (p_s, p_ts) = ([values @ x for x in (q, q_t)] for values in (rule.basis(rule.gauss), rule.slopes / h))
    squared = np.einsum("...i,...i", p, p)[..., None]
    w = _turning(p_t, p) / squared
    along = 2 * np.einsum("...i,...i", p, p_s)[..., None] / squared
    w_s = (_turning(p_ts, p) + _turning(p_t, p_s)) / squared - along * w
    v_t = rule.slopes @ velocity / h - np.cross(w, record.gauss_fields[cells, :, 6:])
    s = (breaks[:-1, None] + np.diff(breaks)[:, None] * rule.gauss) * rod.length
    d = directors((p / np.sqrt(squared)).reshape(-1, 4)) @ rod.curve.frame(s.ravel())
    units = history.time_unit, history.time_unit * history.scales.length
    found = [
        np.einsum("kij,ki->kj", d, x.reshape(-1, 3)).reshape(x.shape) / unit
        for x, unit in zip((v_t, w_s), units, strict=True)
    ]
    return at_nodes(rule.between_gauss(rule.nodes) @ np.concatenate(found, axis=-1))


def _turning(p, q):
    return 2 * product_conjugate(p, q)[..., 1:]


# Newton's iterations for n and m of a rod from what a cut carries, and the relative change at which they end.
_MOST, _SAME = 30, 1e-13


@dataclass(frozen=True, repr=False)
class TendonState(Result):
    """A tendon in several states: its tension (n,), N, with friction that at its pulled end; its length along the rod
    (n,), m; s (elements + 1,), m, the arc lengths of the rod at the ends of its elements, and along (n, elements + 1)
    the tension there, N, at a kink that just beyond it. places (n,): of the states, in words. `print` shows the first
    and the last state, and in how many it is slack; tables, files and `plot_quantity("along")` the tension along it.
    """

    tension: np.ndarray
    length: np.ndarray
    s: np.ndarray
    along: np.ndarray
    places: tuple[str, ...] = ()

    _rows_axis, _beside = "place", {"_states": "point"}  # noqa: RUF012
    _quantities = by_name(
        Quantity("s", unit="m", axes=("place",)),
        Quantity("state", axes=("point",), getter=lambda found: np.array(found.places)),
        Quantity("tension", unit="N"),
        Quantity("length", unit="m"),
        Quantity("slack"),
    )

    def __len__(self):
        return len(self.tension)

    @property
    def quantities(self) -> dict[str, Quantity]:
        """{name: `Quantity`}; the components of `along` are the states."""
        along = Quantity("along", "tension along the tendon", "N", self.places, axes=("place",),
                         getter=lambda found: found.along.T)  # fmt: skip
        return super().quantities | by_name(along)

    @property
    def slack(self):
        """(n,) whether it has no tension."""
        return self.tension == 0

    def _answer(self, units):
        slack = f", slack in {self.slack.sum()} of {len(self.slack)} states" if self.slack.any() else ""
        least = self.along[-1].min() if len(self.along) else 0.0
        slack = f", friction leaves {least:.4g} N in the last" * bool(least < self.tension[-1:].sum()) + slack
        text = f"tension {span_in_words(self.tension, 'N')}, length {span_in_words(self.length, 'm')}{slack}"
        return [units.sentence(text)]

    def __str__(self):
        return "\n".join(self._answer(Units()))

    __repr__ = __str__


class Threads:
    """The threads of a scene in all states of a `Path` or `History`.

    Args:
        result: the `Path` or `History`.
    """

    def __init__(self, result):
        self._result, self._records = result, result._all
        if self._records is None:  # on a disk
            self._records = Records.of(list(result._records))
        self._threads, self._found = [thread for thread in result.scene.actions if thread.is_thread], {}

    def at_gauss(self):
        """(n, elements, points, 6) force T t and moment R a x T t of all threads, inertial, dimensionless."""
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
            places = _Places(self._result, rod, np.array([0.0, 1.0]))
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

    def along(self, thread, pulled):
        """Arc lengths s (elements + 1,), m, of the ends of elements, and the tension there (n, elements + 1), N, with
        that of the pulled end, (n,)."""
        found, breaks = self._tensions(thread, pulled), self._result.layout.breaks[self._result._rows(thread.rod)[0]]
        found = np.concatenate([found[:, :, 0], found[:, -1:, -1]], axis=1)
        return breaks * thread.rod.length, found * self._result.scales.force

    def _tensions(self, thread, pulled=None):
        """(n, elements, points + 2) the tension at the begin, the Gauss points and the end of every element,
        dimensionless; pulled: (n,) that of the pulled end, N, where it is not that of the result's scene."""
        if id(thread) not in self._found:
            places, R, v, k = self._strained(thread)
            pulled = (self.tension(thread) if pulled is None else pulled) / self._result.scales.force
            found = np.broadcast_to(pulled[:, None, None], (len(v), v.shape[1], v.shape[2] + 2))
            if thread.rough and "time" in self._records.columns:
                found = self._recorded(thread, found)
            elif thread.rough:
                turning, t = self._turning(thread, places, R, v, k)
                found = found * turning.left(t, thread.friction, thread.pulled == "start")[0]
            self._found[id(thread)] = found
        return self._found[id(thread)]

    def _recorded(self, thread, pulled):
        """`_tensions` of a thread with friction in a motion, from those at the Gauss points, and at its pulled end."""
        rough = [other for other in self._threads if other.rough]
        sizes = [self._result.layout.counts[self._result._rows(x.rod)[0]] * (pulled.shape[2] - 2) for x in rough]
        last = self._records["reactions"].shape[1] - sum(other.shortens for other in self._threads)
        first = last - sum(sizes[rough.index(thread) :])
        inside = self._records["reactions"][:, first : first + sizes[rough.index(thread)]]
        inside = inside.reshape(*pulled.shape[:2], -1)
        to_ends = np.transpose([lagrange(self._result.rule.gauss, x) for x in (0.0, 1.0)])
        ends = np.maximum(inside @ to_ends, 0.0)
        found = np.concatenate([ends[..., :1], inside, ends[..., 1:]], axis=-1)
        end = (slice(None), 0, 0) if thread.pulled == "start" else (slice(None), -1, -1)
        found[end] = pulled[end]
        return found

    def at_nodes(self, thread, pulled):
        """(n, nodes) the tension at the nodes of the thread's rod, N, with that of the pulled end, (n,)."""
        found = np.einsum("ij,nej->nei", self._result.rule.from_ends_and_gauss, self._tensions(thread, pulled))
        found = found * self._result.scales.force
        return np.concatenate([found[:, :, :-1].reshape(len(found), -1), found[:, -1:, -1]], axis=1)

    def _turning(self, thread, places, R, v, k):
        """The `Turning` of a thread, and its directions at the Gauss points (n, elements, points, 3), inertial."""
        t = _along(thread, places, v, k)[1]
        t = np.einsum("...ij,...j->...i", R, t / np.linalg.norm(t, axis=-1, keepdims=True))
        return Turning(self._result.scene, thread.rod, places.breaks, self._result.rule.gauss), t

    def bend_back(self):
        """(n,) whether a thread with friction bends back inside an element, so that its tension has a kink there."""
        found = np.zeros(len(self._records["load_factor"]), dtype=bool)
        for thread in self._threads:
            if thread.rough:
                turning, t = self._turning(thread, *self._strained(thread))
                found |= turning.bends_back(t, thread.friction)
        return found

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
        tension = self._tensions(thread)  # `places` are the Gauss points of elements, or their ends
        tension = (tension[..., [0, -1]] if places.ends else tension[..., 1:-1])[..., None]
        across = (tension / size)[..., None] * (np.eye(3) - t[..., :, None] * t[..., None, :])
        return np.einsum("ekij,nekj->neki", lever, tension * t), lever @ across @ np.swapaxes(lever, -1, -2)


def _along(thread, places, v, k):
    """p (elements, points, 3) and v + u x p + p' (n, elements, points, 3), material, dimensionless."""
    p, along = places.beside(thread)
    return p, v + np.cross(k, p) + along


class _Places:
    """Points x (points,) in [0, 1] of the elements of a rod of a `Path` or `History`: its Gauss points, or its
    ends, where data are those inside it."""

    def __init__(self, result, rod, x):
        i, _ = result._rows(rod)
        self.rod, self.cells, self._nodes = rod, result._cells(i), cell_nodes(result.layout, result.degree)[i][0]
        self.ends = x[0] == 0.0
        self.breaks, self.length, self._scales = result.layout.breaks[i], result.scales.length, result.scales
        h = np.diff(self.breaks)[:, None]
        self._basis, self._slopes = result.rule.basis(x), result.rule.slopes
        inside = [BESIDE_BREAK, -BESIDE_BREAK] if self.ends else 0.0
        self._h, s = h[..., None] * rod.length / self.length, (self.breaks[:-1, None] + h * x + inside) * rod.length
        self.shape, self.s, self._scene = s.shape, s.ravel(), result.scene
        self.frames, self._beside = rod.curve.frame(self.s), {}

    def beside(self, thread):
        """(elements, points, 3) p and p' of a thread along the rod, material, dimensionless."""
        if id(thread) not in self._beside:
            _, arm, slope = (datum.value for datum in at(thread, 0.0).data(self.rod, self.s))
            found = (np.einsum("kji,kj->ki", self.frames, a) for a in (arm / self.length, slope))
            self._beside[id(thread)] = tuple(a.reshape(*self.shape, 3) for a in found)
        return self._beside[id(thread)]

    def turned(self, records):
        """(n, elements, points, 3, 3) directors and (n, elements, points, 3) u - u_R, material, dimensionless."""
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
        """v, u - u_R without stress (n, elements, points, 6), derivatives by n, m (elements, points, 6, 6)."""
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


def _tensions(result, rod):
    """(n, nodes, parts) tensions of the threads along a rod, N, NaN beyond its own; None without any."""
    threads, most = Threads(result), _most_threads(result.scene)
    found = [x for x in result.scene.all_loads if x.is_thread and x.rod is rod]
    found = [threads.at_nodes(x, result._tension(x)) for x in found]
    if not found:
        return None
    found += [np.full_like(found[0], np.nan)] * (most - len(found))
    return np.stack(found, axis=-1) if most > 1 else found[0]


def _most_threads(scene):
    """The largest number of threads along one rod."""
    return max(Counter(id(x.rod) for x in scene.all_loads if x.is_thread).values(), default=0)


def tension_of(scene):
    """The `Quantity` of the tensions along the rods, with a component for each thread along a rod in the order of the
    loads, as a list; an empty one without threads."""
    most = _most_threads(scene) if any(x.is_thread for x in scene.all_loads) else 0
    parts = [str(k) for k in range(most)] if most > 1 else ""
    return [Quantity("tendon_tension", "tension of tendons", "N", parts, axes=("point", "s"), getter=_tensions)][:most]
