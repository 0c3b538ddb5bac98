"""The largest contact forces and moments over a path or a motion, also as text."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.quaternions import directors
from cosserat_fenicsx.results.on_nodes import OnNodes
from cosserat_fenicsx.scene.rod import Station

# Sampling intervals of an element, per degree of its polynomials.
_PLACES = 6
# Relative differences, and values relative to the largest of the same unit, below this are rounding.
_ROUNDING = 1e-6
_UNITS = {"bending moment": "N m", "twisting moment": "N m", "shear force": "N", "tension": "N", "compression": "N"}


@dataclass(frozen=True)
class Largest:
    """The largest value of a quantity: its size (N m or N), its station, and the index of the point or time."""

    size: float
    station: Station
    point: int


class Extremes(OnNodes):
    """The largest contact forces and moments of a path or a motion."""

    def largest(self) -> dict[str, "Largest"]:
        """The largest contact forces and moments over all points of a path (or times of a motion) and all rods.

        Both sides of jumps are included, and places between the nodes. Values are those of the mesh used: `tol` limits
        the error of positions only. With t = d_3: bending |m - (m.t) t|, twisting |m.t|, shear |n - (n.t) t|, tension
        n.t, compression -n.t.

        Returns:
            {quantity: `Largest`}, the quantities "bending moment", "twisting moment" (N m), "shear force", "tension"
            and "compression" (N), without those that are zero up to rounding.
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
            contact, rq = self._contact_of(k), self._records[k].rq
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
                    place = int(np.argmax(size >= size.max() - _ROUNDING * abs(size.max())))  # the first of equal ones
                    if size[place] > (1 + _ROUNDING) * found[what].size:
                        found[what] = Largest(float(size[place]), rod.at(s[place]), k)
        most = {unit: max(x.size for what, x in found.items() if _UNITS[what] == unit) for unit in ("N m", "N")}
        return {what: x for what, x in found.items() if x.size > _ROUNDING * most[_UNITS[what]]}


def largest_in_words(path):
    """`Extremes.largest` as a line of text."""
    where = "time" if path.axis == "time" else path.axis
    unit = " s" if path.axis == "time" else ""
    told = [
        f"{what} {x.size:.4g} {_UNITS[what]} ({x.station}, {where} {path.along_axis[x.point]:.4g}{unit})"
        for what, x in path.largest().items()
    ]
    return f"Largest on this mesh (tol limits errors of positions only): {'; '.join(told) or 'no force or moment'}."
