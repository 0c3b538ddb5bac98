"""Results as arrays with named fields, in SI units. Knows no solver; files and pictures are made by other rooms."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.recovery import ElementRule, directors, nodal_contact


@dataclass(frozen=True)
class Record:
    """One equilibrium, dimensionless: (r, q) at the nodes (N, 7), (n, m, r') at the Gauss points (cells, points, 9)."""

    load_factor: float
    rq: np.ndarray
    gauss_fields: np.ndarray
    negative_modes: int
    iterations: int


class Path:
    """An equilibrium path: a sequence of converged points.

    Attributes:
        scene: the scene it belongs to.
        model, formulation, degree, elements, unknowns: what it was computed with (`elements`: of each rod).
        why: sentences that say why.
        comm: the ranks that solved it; each holds all of it, the first writes files and pictures.
        load_factors: (n,).
        iterations: (n,) Newton iterations spent since the point before, rejected steps included.
        negative_modes: (n,) negative squares of the second variation; 0 at a stable point, -1 where it is singular.
        stable: (n,) bool.
        error: (n,) estimated error of the positions, relative to the largest displacement; NaN where not estimated.

    Station queries return one row a point, in inertial components unless they say material.
    """

    def __init__(self, scene, layout, scales, rule, *, comm, model, formulation, degree, unknowns, why):
        self.scene, self.layout, self.scales, self._rule, self.comm = scene, layout, scales, rule, comm
        self.model, self.formulation, self.degree, self.unknowns = model, formulation, degree, unknowns
        self.elements, self.why = layout.counts, why
        self._records, self._error = [], None

    @classmethod
    def of(cls, model, formulation):
        """An empty path for the scene that a model was loaded with."""
        rule = ElementRule(model.nodes, model.forms.gauss, model.forms.weights)
        why = [
            "the spatial rod takes any scene",
            {
                "condensed": "the contact force is carried at the Gauss points (formulation 'mixed')",
                "field": "a stiffness is infinite, so the contact force is an unknown (formulation 'mixed')",
            }.get(model.shape.variant, f"formulation '{formulation}' was asked for"),
        ]
        return cls(
            model.scene,
            model.layout,
            model.scales,
            rule,
            comm=model.comm,
            model=model.name,
            formulation=formulation,
            degree=model.shape.degree,
            unknowns=model.unknowns,
            why=why,
        )

    def append(self, record):
        """Add a converged point."""
        self._records.append(record)
        self.__dict__.pop("_contact", None)

    def __len__(self):
        return len(self._records)

    def __repr__(self):
        reach = f"load factors {self.load_factors[0]:g} .. {self.load_factors[-1]:g}" if len(self) else "empty"
        return f"<Path: {len(self)} points, {reach}, {self.model}, {self.unknowns} unknowns>"

    def _array(self, name):
        return np.array([getattr(record, name) for record in self._records])

    load_factors = property(lambda self: self._array("load_factor").astype(float))
    iterations = property(lambda self: self._array("iterations").astype(int))
    negative_modes = property(lambda self: self._array("negative_modes").astype(int))
    stable = property(lambda self: self.negative_modes == 0)

    @property
    def error(self):
        """(n,) estimated error, see the class."""
        return np.full(len(self), np.nan) if self._error is None else self._error

    # -- queries -----------------------------------------------------------------------------------------------------

    def position(self, station):
        """(n, 3) m, inertial."""
        return self._at(station, self._all("position"))

    def displacement(self, station):
        """(n, 3) m, inertial, from the reference."""
        return self.position(station) - station.rod.curve.position(station.s)

    def rotation(self, station):
        """(n, 4) unit quaternion (scalar first) from the reference to the current section; its sign is continuous
        along the path and the rod."""
        q = self._at(station, self._all("quaternion"))
        return q / np.linalg.norm(q, axis=1, keepdims=True)

    def rotation_angle(self, station):
        """(n,) rad: angle of `rotation`, in [0, 2 pi]; not folded back at pi, because q is continuous along the path."""
        q = self.rotation(station)
        half = np.arctan2(np.linalg.norm(q[:, 1:], axis=1), q[:, 0])
        return 2 * half

    def force(self, station):
        """(n, 3) contact force n, N, inertial: what the part beyond (larger s) exerts on the part before. At a
        station with a point load, the value just before it; at rod.start the value just after."""
        return self._at(station, self._all("force"))

    def moment(self, station):
        """(n, 3) contact moment m, N m, inertial; sides as in `force`."""
        return self._at(station, self._all("moment"))

    def centreline(self, k=-1, rod=None):
        """(nodes, 3) m, inertial: the nodes of a rod (default the first) at point k."""
        return self.fields(k, rod or self.scene.rods[0])["position"]

    def fields(self, k, rod):
        """Everything at the nodes of a rod at point k.

        Returns:
            dict of arrays (nodes, ...): s (m), position, displacement (m), quaternion, d1, d2, d3, force (N), moment
            (N m), all inertial; strain (v - v_R: shear 1, shear 2, stretch) and curvature (u - u_R: bending 1,
            bending 2, twist; 1/m), both material; bending_moment (N m, its size).
        """
        i, rows = self._rows(rod)
        s = self.layout.node_s(self._rule.nodes)[i] * rod.length
        record, contact = self._records[k], self._contact[k]
        position = record.rq[rows, :3] * self.scales.length + self.scales.origin
        q = record.rq[rows, 3:] / np.linalg.norm(record.rq[rows, 3:], axis=1, keepdims=True)
        d = directors(q) @ rod.curve.frame(s)
        n, m = contact[rows, :3] * self.scales.force, contact[rows, 3:] * self.scales.moment
        n_material, m_material = np.einsum("kij,ki->kj", d, n), np.einsum("kij,ki->kj", d, m)
        section = rod.stiffness
        return {
            "s": s,
            "position": position,
            "displacement": position - rod.curve.position(s),
            "quaternion": q,
            "d1": d[:, :, 0],
            "d2": d[:, :, 1],
            "d3": d[:, :, 2],
            "force": n,
            "moment": m,
            "strain": n_material / [*section.shear, section.axial],
            "curvature": m_material / [*section.bending, section.torsion],
            "bending_moment": np.linalg.norm(m_material[:, :2], axis=1),
        }

    def largest_displacement(self):
        """(n,) m: the largest over all nodes."""
        return np.array(
            [max(np.linalg.norm(self.fields(k, rod)["displacement"], axis=1).max() for rod in self.scene.rods)
             for k in range(len(self))]
        )  # fmt: skip

    def _all(self, name):
        if name in ("position", "quaternion"):
            rq = np.array([record.rq for record in self._records]).reshape(len(self), -1, 7)
            if name == "quaternion":
                return rq[:, :, 3:]
            return rq[:, :, :3] * self.scales.length + self.scales.origin
        contact = self._contact
        return contact[:, :, :3] * self.scales.force if name == "force" else contact[:, :, 3:] * self.scales.moment

    @cached_property
    def _contact(self):
        """(points, nodes, 6) n and m at the nodes, dimensionless."""
        return np.array([nodal_contact(self, record) for record in self._records])

    def _rows(self, rod):
        """(index of a rod, slice of its nodes)."""
        if rod not in self.scene.rods:
            raise SceneError(f"rod '{rod.name}' is not in the scene of this path")
        i = self.scene.rods.index(rod)
        first = sum(n * self.degree + 1 for n in self.elements[:i])
        return i, slice(first, first + self.elements[i] * self.degree + 1)

    def _at(self, station, values):
        """Values (points, nodes, k) at a station, by the element's polynomial."""
        i, rows = self._rows(station.rod)
        cell, weights = self._rule.locate(self.layout.breaks[i], station.s / station.rod.length)
        first = rows.start + cell * self.degree
        return np.einsum("j,njk->nk", weights, values[:, first : first + self.degree + 1])

    # -- error -------------------------------------------------------------------------------------------------------

    def estimate_error(self, coarse):
        """Estimate this path's error from the same load factors on a coarser mesh of the same degree.

        The difference of the positions at the coarse nodes, over h^p: one order and more below the order p + 1
        of the centreline (2 p at element ends), so that the estimate errs on the safe side.
        """
        difference = np.zeros(len(self))
        largest = np.zeros(len(self))
        for i, rod in enumerate(self.scene.rods):
            s = coarse.layout.node_s(coarse._rule.nodes)[i]
            for k in range(len(self)):
                a = coarse.fields(k, rod)["position"]
                b = self.sample(k, rod, s)
                difference[k] = max(difference[k], np.linalg.norm(a - b, axis=1).max())
                moved = a - rod.curve.position(s * rod.length)
                largest[k] = max(largest[k], np.linalg.norm(moved, axis=1).max())
        ratio = max(fine / few for fine, few in zip(self.elements, coarse.elements, strict=True))
        scale = np.where(largest > 0, largest, 1.0)
        self._error = difference / scale / ratio**self.degree

    def sample(self, k, rod, x):
        """(len(x), 3) positions, m, at arc lengths x in [0, 1] of the rod's length, at point k."""
        i, rows = self._rows(rod)
        r = self._records[k].rq[rows, :3]
        cells, weights = self._rule.locate_all(self.layout.breaks[i], x)
        nodes = cells[:, None] * self.degree + np.arange(self.degree + 1)
        return np.einsum("kj,kjc->kc", weights, r[nodes]) * self.scales.length + self.scales.origin

    # -- files and pictures ------------------------------------------------------------------------------------------

    def write(self, file, k=-1):
        """Write the whole path as .xdmf (time axis: load factor), or point k as .vtu, .vtk or what else meshio writes.

        Raises:
            OSError: the file cannot be written.
            SceneError: a format that is not known.
        """
        from cosserat_fenicsx import xdmf

        xdmf.write(self, file, k)

    def plot(self, file=None, points=None):
        """Picture of the deformed rods, coloured by bending moment, at some points of the path (default up to five).

        Args:
            file: a .png; None returns the pyvista plotter.
            points: indices of points.
        """
        from cosserat_fenicsx import plot

        return plot.rods(self, file, points)
