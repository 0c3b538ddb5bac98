"""The largest contact forces, moments and stresses over a path or a motion, also as text."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.results.on_nodes import OnNodes
from cosserat_fenicsx.scene.rod import Station

# Sampling intervals of an element, per degree of its polynomials.
_PLACES = 6
# Relative differences, and values relative to the largest of the same unit, below this are rounding.
_ROUNDING = 1e-6
_UNITS = {
    "bending moment": "N m",
    "twisting moment": "N m",
    "shear force": "N",
    "tension": "N",
    "compression": "N",
    "normal stress": "Pa",
    "von Mises stress": "Pa",
}
# States that are computed at once.
_BLOCK = 64


@dataclass(frozen=True)
class Largest:
    """The largest value of a quantity: its size (N m, N or Pa), its station, and the index of the point or time."""

    size: float
    station: Station
    point: int


class Extremes(OnNodes):
    """The largest contact forces, moments and stresses of a path or a motion."""

    def largest(self) -> dict[str, "Largest"]:
        """The largest contact forces, moments and stresses over all points of a path (or times of a motion) and all
        rods.

        Both sides of jumps are included, and places between the nodes. Values are those of the mesh used: the `errors`
        of a path tell how well it knows n and m; `tol` of a motion limits the error of positions only. With t = d_3:
        bending ``|m - (m.t) t|``, twisting ``|m.t|``, shear ``|n - (n.t) t|``, tension ``n.t``, compression ``-n.t``.

        Returns:
            {quantity: `Largest`}, the quantities "bending moment", "twisting moment" (N m), "shear force", "tension",
            "compression" (N) and, of the rods that know them, "normal stress" (its size) and "von Mises stress" (Pa,
            see `stress`), without those that are zero up to rounding.
        """
        found = dict.fromkeys(_UNITS, Largest(0.0, None, 0))
        inside = np.linspace(0, 1, _PLACES * self.degree + 1)
        for first in range(0, len(self), _BLOCK):
            which = range(first, min(first + _BLOCK, len(self)))
            contact = np.array([self._contact_of(k) for k in which])
            for i, rod in enumerate(self.scene.rods):
                for what, sizes in self._sizes(i, inside, contact[:, self._cells(i)], which).items():
                    most = sizes.max()
                    k, place = np.unravel_index(np.argmax(sizes >= most - _ROUNDING * abs(most)), sizes.shape)
                    if sizes[k, place] > (1 + _ROUNDING) * found[what].size:
                        s = self._places(i, inside).ravel()[place]
                        found[what] = Largest(float(sizes[k, place]), rod.at(s), first + int(k))
        most = {unit: max(x.size for what, x in found.items() if _UNITS[what] == unit) for unit in _UNITS.values()}
        return {what: x for what, x in found.items() if x.size > _ROUNDING * most[_UNITS[what]]}

    def _places(self, i, inside):
        """(elements, places) arc lengths of places in the elements of the i-th rod, m."""
        breaks = self.layout.breaks[i]
        return (breaks[:-1, None] + np.diff(breaks)[:, None] * inside) * self.scene.rods[i].length

    def _sizes(self, i, inside, contact, which):
        """{quantity: (states, places)} in the elements of the i-th rod.

        Args:
            contact: (states, elements, nodes per element, 6) n and m, dimensionless; which: indices of the states.
        """
        rod, basis, s = self.scene.rods[i], self.rule.basis(inside), self._places(i, inside)
        nodes = np.arange(self.elements[i])[:, None] * self.degree + np.arange(self.degree + 1)
        rows = self._rows(rod)[1]
        q = np.einsum("qj,kcji->kcqi", basis, np.array([self._records[k].rq[rows, 3:] for k in which])[:, nodes])
        q /= np.linalg.norm(q, axis=-1, keepdims=True)
        d = directors(q.reshape(-1, 4)).reshape(*q.shape[:-1], 3, 3) @ rod.curve.frame(s.ravel()).reshape(
            *s.shape, 3, 3
        )
        n, m = np.split(np.einsum("qj,kcji->kcqi", basis, contact), 2, axis=-1)
        n = np.einsum("kcqij,kcqi->kcqj", d, n) * self.scales.force
        m = np.einsum("kcqij,kcqi->kcqj", d, m) * self.scales.moment
        sizes = {
            "bending moment": np.hypot(m[..., 0], m[..., 1]),
            "twisting moment": np.abs(m[..., 2]),
            "shear force": np.hypot(n[..., 0], n[..., 1]),
            "tension": n[..., 2],
            "compression": -n[..., 2],
        }
        if rod.profile.shaped:
            normal, mises = np.zeros((2, *n.shape[:-1]))
            for places, side in ((slice(0, 1), "right"), (slice(1, None), "left")):  # within the element at jumps
                flat = (len(which), -1, 3)
                told = rod.profile.stresses(
                    s[:, places].ravel(), side, n[:, :, places].reshape(flat), m[:, :, places].reshape(flat)
                )
                shape = normal[:, :, places].shape
                normal[:, :, places] = np.nan_to_num(np.maximum(told.axial_max, -told.axial_min)).reshape(shape)
                mises[:, :, places] = np.nan_to_num(told.von_mises).reshape(shape)
            sizes |= {"normal stress": normal, "von Mises stress": mises}
        return {what: values.reshape(len(which), -1) for what, values in sizes.items()}


def largest_in_words(path):
    """`Extremes.largest` as a line of text, and which rods' stresses it cannot know."""
    moves = path.axis == "time"
    unit = " s" if moves else ""
    told = [
        f"{what} {x.size:.4g} {_UNITS[what]} ({x.station}, {path.axis} {path.along_axis[x.point]:.4g}{unit})"
        for what, x in path.largest().items()
    ]
    limits = " (tol limits errors of positions only)" if moves else ""
    line = f"Largest on this mesh{limits}: {'; '.join(told) or 'no force or moment'}."
    return "\n".join([line, *_unknown_in_words(path)])


def _unknown_in_words(path):
    """Sentences on rods of which stresses are not known, where those of others are."""
    if not path.knows_stresses:
        return
    fields = {rod.name: path.fields(0, rod) for rod in path.scene.rods}
    for field, what in (("axial_max", "Stresses"), ("von_mises", "Von Mises stresses")):
        names = [name for name, values in fields.items() if np.isnan(values[field]).any()]
        if names:
            yield f"{what} of {', '.join(names)} are not computed, or not everywhere: see the sections there."
            fields = {name: values for name, values in fields.items() if name not in names}  # each is told once
