"""Results as arrays with named fields, in SI units. Knows no solver; files and pictures are made by other rooms."""

import copy
from functools import cached_property

import numpy as np

from cosserat_fenicsx.checks import instance
from cosserat_fenicsx.quaternions import directors
from cosserat_fenicsx.results.bearing import Bearing
from cosserat_fenicsx.results.recovery import at_nodes, element_contact
from cosserat_fenicsx.scene.rod import Station


class Path(Bearing):
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
        rounding: what rounding of the residual alone may make of it.
        events: the `Event`s met, in order: limit points and bifurcations.
        left: whether the path was left at its first bifurcation, for a branch.
        control: "load", or "arc" where the path, or a part of it, was followed in arc length.

    Station queries take a `Station` or its name as in scene files ("column.end", "column@5.0"), and return one row a point,
    in inertial components unless they say material.
    """

    #: what tells the points apart, in words; fields that files hold beside those of `xdmf.FIELDS`
    axis, more_fields = "load factor", {}
    #: what is computed once, until a point is added
    _computed = ("_contact", "_all_rq")

    def __init__(self, scene, layout, scales, rule, *, comm, rounding, model, formulation, degree, unknowns, why,
                 expand):  # fmt: skip
        self.scene, self.layout, self.scales, self.rule, self.comm = scene, layout, scales, rule, comm
        self.model, self.formulation, self.degree, self.unknowns = model, formulation, degree, unknowns
        self.elements, self.why, self.events = layout.counts, why, []
        self._expand, self._expanded, self._appended, self.rounding = expand, [], [], rounding
        self.control, self.left = "load", False
        self._error = None

    @classmethod
    def of(cls, model, formulation, why=()):
        """An empty path for the scene that a model was loaded with; `why` are sentences on the choice of the model."""
        return cls(
            model.scene,
            model.layout,
            model.scales,
            model.rule,
            comm=model.comm,
            rounding=0.0 if model.carries_force else model.round_off / (10 if formulation == "displacement" else 1),
            model=model.name,
            formulation=formulation,
            degree=model.shape.degree,
            unknowns=model.unknowns,
            why=[*why, *model.scene.cautions],
            expand=model.expansion(),
        )

    def append(self, record):
        """Add a converged point."""
        self._appended.append(record)
        self._forget()

    def _forget(self):
        for name in self._computed:
            self.__dict__.pop(name, None)

    @property
    def _records(self):
        """All records, in space."""
        if self._appended:
            new, self._appended = self._appended, []
            gauss = None if new[0].gauss_fields is None else np.array([x.gauss_fields for x in new])
            etas = np.array([x.load_factor for x in new])
            rq, fields = self._expand(etas, np.array([x.rq for x in new]), gauss)
            for x, x.rq, x.gauss_fields in zip(new, rq, fields, strict=True):
                self._expanded.append(x)
        return self._expanded

    def __len__(self):
        return len(self._expanded) + len(self._appended)

    def __getitem__(self, k):
        """Point k as it was solved: a `Record`."""
        return self._records[k]

    def at_points(self, which):
        """The path of some of its points alone, without events.

        Args:
            which: their indices.
        """
        part = copy.copy(self)
        part._forget()
        part.events, part._expanded, part._appended = [], [self[k] for k in which], []
        part._error = None if self._error is None else self._error[which]
        return part

    def with_points(self, others, which):
        """The path of these points and those of another one on the same mesh.

        Args:
            others: a Path.
            which: for every point of the whole, in order, whether it is of `others`.
        """
        mine, theirs = iter(self._records), iter(others._records)
        whole = self.at_points([])
        whole._expanded = [next(theirs if other else mine) for other in which]
        return whole

    def __repr__(self):
        reach = f"load factors {self.load_factors[0]:g} .. {self.load_factors[-1]:g}" if len(self) else "empty"
        return f"<Path: {len(self)} points, {reach}, {self.model}, {self.unknowns} unknowns>"

    def _array(self, name):
        return np.array([getattr(record, name) for record in (*self._expanded, *self._appended)])

    load_factors = property(lambda self: self._array("load_factor").astype(float))
    iterations = property(lambda self: self._array("iterations").astype(int))
    negative_modes = property(lambda self: self._array("negative_modes").astype(int))
    stable = property(lambda self: self.negative_modes == 0)

    @property
    def along_axis(self):
        """(n,) what tells the points apart."""
        return self.load_factors

    def label(self, k):
        """What a picture writes beside point k."""
        return f"{self.load_factors[k]:.3g}" + ("" if self.stable[k] else " (unstable)")

    @property
    def error(self):
        """(n,) estimated error, see the class."""
        return np.full(len(self), np.nan) if self._error is None else self._error

    def set_error(self, error):
        """Take an estimate; it is never below what rounding leaves of the residual."""
        self._error = np.maximum(error, self.rounding)

    # -- queries: a station, such as rod.end, or its name, such as "rod.end" or "rod@1.5" --------------------------------

    def station(self, station):
        """The `Station` that a query means.

        Raises:
            SceneError: it is neither a station nor the name of one.
        """
        if isinstance(station, str):
            return self.scene.station(station)
        return instance("Path", "station", station, Station, "a station such as rod.end, or its name")

    def position(self, station):
        """(n, 3) m, inertial."""
        station = self.station(station)
        return self.displacement(station) + station.rod.curve.position(station.s)

    def displacement(self, station):
        """(n, 3) m, inertial, from the reference."""
        return self._at(station, self._all_rq[:, :, :3], self._rest) * self.scales.length

    def rotation(self, station):
        """(n, 4) unit quaternion (scalar first) from the reference to the current section; its sign is continuous
        along the path and the rod."""
        q = self._at(station, self._all_rq[:, :, 3:])
        return q / np.linalg.norm(q, axis=1, keepdims=True)

    def rotation_angle(self, station):
        """(n,) rad: angle of `rotation`, in [0, 2 pi]: q is continuous along the path, so it folds at 2 pi and not at pi."""
        q = self.rotation(station)
        half = np.arctan2(np.linalg.norm(q[:, 1:], axis=1), q[:, 0])
        return 2 * half

    def force(self, station):
        """(n, 3) contact force n, N, inertial: what the part beyond (larger s) exerts on the part before. At a
        station with a point load, the value just before it; at rod.start the value just after."""
        return self._contact_at(station)[:, :3] * self.scales.force

    def moment(self, station):
        """(n, 3) contact moment m, N m, inertial; sides as in `force`."""
        return self._contact_at(station)[:, 3:] * self.scales.moment

    def centreline(self, k=-1, rod=None):
        """(nodes, 3) m, inertial: the nodes of a rod (default the first) at point k."""
        return self.fields(k, rod)["position"]

    def fields(self, k, rod=None):
        """Everything at the nodes of a rod, given as one or by its name (default the first), at point k.

        Returns:
            dict of arrays (nodes, ...): s (m), position, displacement (m), quaternion, d1, d2, d3, force (N), moment
            (N m), all inertial; strain (v - v_R: shear 1, shear 2, stretch) and curvature (u - u_R: bending 1,
            bending 2, twist; 1/m), both material; bending_moment (N m, its size).
        """
        rod = self.rod(rod)
        i, rows = self._rows(rod)
        s = self.layout.node_s(self.rule.nodes)[i] * rod.length
        record = self._records[k]
        contact = at_nodes(self._contact_of(k)[self._cells(i)])
        displacement = (record.rq[rows, :3] - self._rest[rows]) * self.scales.length
        q = record.rq[rows, 3:] / np.linalg.norm(record.rq[rows, 3:], axis=1, keepdims=True)
        d = directors(q) @ rod.curve.frame(s)
        n, m = contact[:, :3] * self.scales.force, contact[:, 3:] * self.scales.moment
        n_material, m_material = np.einsum("kij,ki->kj", d, n), np.einsum("kij,ki->kj", d, m)
        section = rod.stiffness_at(s, "left")  # like n and m, on a jump that of the element before
        return {
            "s": s,
            "position": rod.curve.position(s) + displacement,
            "displacement": displacement,
            "quaternion": q,
            "d1": d[:, :, 0],
            "d2": d[:, :, 1],
            "d3": d[:, :, 2],
            "force": n,
            "moment": m,
            "strain": n_material / section.K,
            "curvature": m_material / section.J,
            "bending_moment": np.linalg.norm(m_material[:, :2], axis=1),
        }

    def largest_displacement(self):
        """(n,) m: the largest over all nodes."""
        return np.array(
            [max(np.linalg.norm(self.fields(k, rod)["displacement"], axis=1).max() for rod in self.scene.rods)
             for k in range(len(self))]
        )  # fmt: skip

    def mode(self, event, rod=None):
        """(nodes, 3) the mode of an event at the nodes of a rod (default the first), see `Event`."""
        return event.mode[self._rows(rod)[1]]

    @cached_property
    def _all_rq(self):
        """(points, nodes, 7) r and q, dimensionless."""
        return np.array([record.rq for record in self._records]).reshape(len(self), -1, 7)

    @cached_property
    def _rest(self):
        """(nodes, 3) positions at rest, dimensionless, from where each structure starts."""
        return np.concatenate([
            (rod.curve.position(x * rod.length) - self.scene.origin(rod)) / self.scales.length
            for rod, x in zip(self.scene.rods, self.layout.node_s(self.rule.nodes), strict=True)
        ])  # fmt: skip

    @cached_property
    def _contact(self):
        """(points, elements, nodes of one, 6) n and m, dimensionless: two-valued where a load sits between elements."""
        return np.array([element_contact(self, record) for record in self._records])

    def _contact_at(self, station):
        """(points, 6) n and m at a station, dimensionless."""
        station = self.station(station)
        i, _ = self._rows(station.rod)
        cell, weights = self.rule.locate(self.layout.breaks[i], station.s / station.rod.length)
        return np.einsum("j,njk->nk", weights, self._contact_in(self._cells(i).start + cell))

    def _contact_of(self, k):
        """(elements, nodes of one, 6) n and m at point k, dimensionless."""
        return self._contact[k]

    def _contact_in(self, cell):
        """(points, nodes of one, 6) n and m in one element, dimensionless."""
        return self._contact[:, cell]

    def _cells(self, i):
        """Slice of the elements of the i-th rod."""
        first = sum(self.elements[:i])
        return slice(first, first + self.elements[i])

    def _at(self, station, values, rest=None):
        """Values (points, nodes, k), less those at rest (nodes, k), at a station, by the element's polynomial."""
        station = self.station(station)
        i, rows = self._rows(station.rod)
        cell, weights = self.rule.locate(self.layout.breaks[i], station.s / station.rod.length)
        first = rows.start + cell * self.degree
        nodes = slice(first, first + self.degree + 1)
        return np.einsum("j,njk->nk", weights, values[:, nodes] if rest is None else values[:, nodes] - rest[nodes])

    def sample(self, k, rod, x):
        """Between the nodes, by the elements' polynomials, at point k.

        Args:
            k: the point, or a `Record`.
            rod: the rod.
            x: arc lengths (n,) over the rod's length, in [0, 1].

        Returns:
            positions (n, 3), m, and directors (n, 3, 3) as columns, both inertial.
        """
        moved = self.motion(rod, x, [k if hasattr(k, "rq") else self._records[k]])[0]
        s, q = np.asarray(x) * rod.length, moved[:, 3:]
        return rod.curve.position(s) + moved[:, :3] * self.scales.length, directors(q) @ rod.curve.frame(s)

    def motion(self, rod, x, records=None):
        """(points, n, 7) displacement over `scales.length` and unit quaternion at arc lengths x (n,) over the rod's length."""
        i, rows = self._rows(rod)
        cells, weights = self.rule.locate_all(self.layout.breaks[i], x)
        nodes = cells[:, None] * self.degree + np.arange(self.degree + 1)
        nodal = np.array([record.rq[rows] for record in (self._records if records is None else records)])
        nodal[:, :, :3] -= self._rest[rows]
        moved = np.einsum("kj,nkjc->nkc", weights, nodal[:, nodes])
        moved[:, :, 3:] /= np.linalg.norm(moved[:, :, 3:], axis=2, keepdims=True)
        return moved

    # -- files and pictures ------------------------------------------------------------------------------------------

    def write(self, file, k=-1):
        """Write the whole path as .xdmf (time axis: load factor), or point k as .vtu, .vtk or what else meshio writes.

        Raises:
            OSError: the file cannot be written.
            SceneError: a format that is not known.
        """
        from cosserat_fenicsx.results import xdmf

        xdmf.write(self, file, k)

    def plot(self, file=None, points=None, *, magnify=1.0):
        """Picture of the deformed rods, coloured by bending moment, at some points of the path (default up to five).

        Args:
            file: a .png; None returns the pyvista plotter.
            points: indices of points.
            magnify: displacements are drawn this many times their size.
        """
        from cosserat_fenicsx.pictures import plot

        return plot.rods(self, file, points, magnify)
