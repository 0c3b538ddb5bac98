"""What rods bear over a path or a motion, and what supports hold with, in words."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quaternions import directors
from cosserat_fenicsx.results.on_nodes import OnNodes
from cosserat_fenicsx.scene.loads import Force, Moment
from cosserat_fenicsx.scene.words import describe

# Places looked at in an element, for each degree of its polynomials.
_PLACES = 6
# Less than this share of what it stands beside is rounding.
_ROUNDING = 1e-6
_UNITS = {"bending moment": "N m", "twisting moment": "N m", "shear force": "N", "tension": "N", "compression": "N"}


@dataclass(frozen=True)
class Largest:
    """The largest of a quantity: its size (N m or N), its station, and the point of the path."""

    size: float
    station: object
    point: int


class Bearing(OnNodes):
    """What a path or a motion tells of its contact forces and moments as a whole."""

    def largest(self):
        """{quantity: `Largest`} over all points and places of a path or a motion, both sides of a jump and between the nodes; on
        the mesh there is, which `tol` does not speak of. What is zero everywhere but for rounding is left out.

        With the tangent t = d3: bending |m - (m.t) t|, twisting |m.t|, shear |n - (n.t) t|, tension n.t, compression -n.t.
        """
        found = dict.fromkeys(_UNITS, Largest(0.0, None, 0))
        inside = np.linspace(0, 1, _PLACES * self.degree + 1)
        basis = self.rule.basis(inside)
        places = []
        for i, rod in enumerate(self.scene.rods):
            breaks = self.layout.breaks[i]
            s = ((breaks[:-1, None] + np.diff(breaks)[:, None] * inside) * rod.length).ravel()
            nodes = np.arange(self.elements[i])[:, None] * self.degree + np.arange(self.degree + 1)
            places.append((rod, s, rod.curve.frame(s)[:, :, 2], self._rows(rod)[1], self._cells(i), nodes))
        for k in range(len(self)):
            contact, rq = self._contact_of(k), self[k].rq
            for rod, s, d3, rows, cells, nodes in places:
                n, m = np.split(np.einsum("qj,cjk->cqk", basis, contact[cells]).reshape(-1, 6), 2, axis=1)
                q = np.einsum("qj,cjk->cqk", basis, rq[rows, 3:][nodes]).reshape(-1, 4)
                t = np.einsum("nij,nj->ni", directors(q / np.linalg.norm(q, axis=1, keepdims=True)), d3)
                axial, twist = np.einsum("ni,ni->n", n, t), np.einsum("ni,ni->n", m, t)
                force, moment = self.scales.force, self.scales.moment
                sizes = (
                    moment * np.linalg.norm(m - twist[:, None] * t, axis=1),
                    moment * np.abs(twist),
                    force * np.linalg.norm(n - axial[:, None] * t, axis=1),
                    force * axial,
                    -force * axial,
                )
                for what, size in zip(_UNITS, sizes, strict=True):
                    place = int(np.argmax(size >= size.max() - _ROUNDING * abs(size.max())))  # the first of many alike
                    if size[place] > (1 + _ROUNDING) * found[what].size:
                        found[what] = Largest(float(size[place]), rod.at(s[place]), k)
        most = {unit: max(x.size for what, x in found.items() if _UNITS[what] == unit) for unit in ("N m", "N")}
        return {what: x for what, x in found.items() if x.size > _ROUNDING * most[_UNITS[what]]}

    def reaction(self, support):
        """What a support holds its rod with at every point of a path, by the balance of its node: n(s-) - n(s+) - F with the dead
        force F there (n = 0 beyond the ends), and likewise m.

        Returns:
            force, moment: (n, 3) each, N and N m, inertial.

        Raises:
            SceneError: it is no support of the scene, or shares its place with what the balance cannot be told from.
        """
        if not any(x is support for x in self.scene.supports):
            raise SceneError(f"{support!r} is no support of this path's scene")
        others = _others(self, support)
        if others:
            raise SceneError(
                f"{describe(support)} shares its place with {', '.join(others)}: what it alone holds with is not told"
            )
        i, j = node = _node(self, support.station)
        cells = self._cells(i)
        before = self._contact_in(cells.start + j - 1)[:, -1] if j else 0.0
        after = self._contact_in(cells.start + j)[:, 0] if cells.start + j < cells.stop else 0.0
        force, moment = np.split(before - after, 2, axis=1)
        force, moment = force * self.scales.force, moment * self.scales.moment
        for load in self.scene.loads:
            if load.station is not None and _node(self, load.station) == node:
                if isinstance(load, Force):
                    force -= np.multiply.outer(self.load_factors, load.force)
                else:
                    moment -= np.multiply.outer(self.load_factors, load.moment)
        return force, moment


def largest_in_words(path):
    """`Bearing.largest` as a sentence."""
    where = "time" if path.axis == "time" else path.axis
    unit = " s" if path.axis == "time" else ""
    told = [
        f"{what} {x.size:.4g} {_UNITS[what]} ({x.station}, {where} {path.along_axis[x.point]:.4g}{unit})"
        for what, x in path.largest().items()
    ]
    return f"Largest, on this mesh (tol speaks of positions): {'; '.join(told) or 'no contact force or moment'}."


def reactions_in_words(path):
    """What every support holds with at the last point, a sentence each."""
    contact = path._contact_of(len(path) - 1)
    n = np.linalg.norm(contact[..., :3], axis=-1).max() * path.scales.force
    m = np.linalg.norm(contact[..., 3:], axis=-1).max() * path.scales.moment
    for support in path.scene.supports:
        try:
            force, moment = (values[-1] for values in path.reaction(support))
        except SceneError as shared:
            yield f"{shared}."
            continue
        told = f"{_vector(force, n)} N and {_vector(moment, m)} N m"
        yield f"{describe(support)} holds with {told} at the load factor {path.load_factors[-1]:.6g}."


def _others(path, support):
    """What acts at the node of a support and is neither a dead force nor a dead moment, in words."""
    scene, node, found = path.scene, _node(path, support.station), []
    for item in (*scene.supports, *scene.loads):
        plain = isinstance(item, Force | Moment) or item is support or item.station is None
        if not plain and _node(path, item.station) == node:
            found.append(f"the {type(item).__name__}")
    return found + [
        "a Joint" for joint in scene.joints if node in (_node(path, joint.first), _node(path, joint.second))
    ]


def _node(path, station):
    """(index of the rod, index of the element end) where the mesh has a station of a support, a load or a joint."""
    i = path.scene.rods.index(station.rod)
    return i, int(np.argmin(np.abs(path.layout.breaks[i] - station.s / station.rod.length)))


def _vector(a, beside):
    """Components in words; those that are rounding beside each other or a number as 0."""
    least = _ROUNDING * max(np.abs(a).max(), beside)
    return f"({', '.join(f'{x:.6g}' if abs(x) > least else '0' for x in a)})"
