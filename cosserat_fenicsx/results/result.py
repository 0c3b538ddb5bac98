"""Base class of equilibrium paths and motions: queries of a sequence of states."""

from functools import cached_property

import numpy as np

from cosserat_fenicsx.checks import instance
from cosserat_fenicsx.quaternions import directors
from cosserat_fenicsx.results.extremes import Extremes
from cosserat_fenicsx.results.reactions import Reactions
from cosserat_fenicsx.results.recovery import at_nodes
from cosserat_fenicsx.results.states import States
from cosserat_fenicsx.scene.rod import Station


class Result(Extremes, Reactions, States):
    """A sequence of states of a scene. Public methods return SI units. It can be copied and pickled, see `States`.

    Attributes:
        scene: the scene it belongs to.
        model, formulation: names of those it was computed with.
        degree, unknowns: of the elements, and number of unknowns; elements: number of elements of each rod.
        why: sentences on the choice of the model, and cautions.
        comm: the MPI communicator of the solution; every rank has the whole result, rank 0 writes files and pictures.
        iterations: (n,) Newton iterations since the previous state, rejected steps included.

    Station queries take a `Station` or its name as in scene files ("column.end", "column@5.0"), and return one row per
    state, in inertial components unless stated otherwise.
    """

    def station(self, station):
        """The `Station` given as one or by its name.

        Raises:
            SceneError: neither a station nor the name of one.
        """
        if isinstance(station, str):
            return self.scene.station(station)
        return instance(type(self).__name__, "station", station, Station, "a station such as rod.end, or its name")

    def position(self, station):
        """(n, 3) positions, m, inertial."""
        station = self.station(station)
        return self.displacement(station) + station.rod.curve.position(station.s)

    def displacement(self, station):
        """(n, 3) displacements from the reference, m, inertial."""
        return self._at(station, self._all_rq[:, :, :3], self._rest) * self.scales.length

    def rotation(self, station):
        """(n, 4) unit quaternion (scalar first) from the reference to the current section; its sign is continuous
        from point to point and along the rod."""
        q = self._at(station, self._all_rq[:, :, 3:])
        return q / np.linalg.norm(q, axis=1, keepdims=True)

    def rotation_angle(self, station):
        """(n,) angle of `rotation`, rad, in [0, 2 pi]: since q is continuous, it exceeds pi and decreases again after
        2 pi."""
        q = self.rotation(station)
        half = np.arctan2(np.linalg.norm(q[:, 1:], axis=1), q[:, 0])
        return 2 * half

    def force(self, station):
        """(n, 3) contact force n, N, inertial, exerted by the part with larger s on the part with smaller s. At a
        station with a point load it is the value just before it; at rod.start the value just after."""
        return self._contact_at(station)[:, :3] * self.scales.force

    def moment(self, station):
        """(n, 3) contact moment m, N m, inertial; sign and side as in `force`."""
        return self._contact_at(station)[:, 3:] * self.scales.moment

    def centreline(self, k=-1, rod=None):
        """(nodes, 3) m, inertial: the nodes of a rod (default the first) at point k."""
        return self.fields(k, rod)["position"]

    def fields(self, k, rod=None):
        """All fields at the nodes of a rod (a `Rod` or its name; default the first) at point k.

        Returns:
            dict of arrays (nodes, ...): s (m), position, displacement (m), quaternion, d1, d2, d3, force (N), moment
            (N m), all inertial; strain (v - v_R: shear 1, shear 2, stretch) and curvature (u - u_R: bending 1,
            bending 2, twist; 1/m), both material; bending_moment (N m, its size).

        Raises:
            IndexError: there is no point k.
        """
        if not -len(self) <= k < len(self):
            raise IndexError(f"fields({k}): expected the number of a {self.axis}, from 0 to {len(self) - 1}")
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
        # at a jump those of the element before, as n and m
        strain, curvature = rod.stiffness_at(s, "left").strains(n_material, m_material)
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
            "strain": strain,
            "curvature": curvature,
            "bending_moment": np.linalg.norm(m_material[:, :2], axis=1),
        }

    def largest_displacement(self):
        """(n,) the largest displacement of any node, m."""
        return np.array(
            [max(np.linalg.norm(self.fields(k, rod)["displacement"], axis=1).max() for rod in self.scene.rods)
             for k in range(len(self))]
        )  # fmt: skip

    @cached_property
    def _all_rq(self):
        """(points, nodes, 7) r and q, dimensionless."""
        return np.array([record.rq for record in self._records]).reshape(len(self), -1, 7)

    @cached_property
    def _rest(self):
        """(nodes, 3) positions at rest, dimensionless, relative to the origin of each structure."""
        return np.concatenate([
            (rod.curve.position(x * rod.length) - self.scene.origin(rod)) / self.scales.length
            for rod, x in zip(self.scene.rods, self.layout.node_s(self.rule.nodes), strict=True)
        ])  # fmt: skip

    def _contact_at(self, station):
        """(points, 6) n and m at a station, dimensionless."""
        station = self.station(station)
        i, _ = self._rows(station.rod)
        cell, weights = self.rule.locate(self.layout.breaks[i], station.s / station.rod.length)
        return np.einsum("j,njk->nk", weights, self._contact_in(self._cells(i).start + cell))

    def _contact_of(self, k):
        """(elements, nodes per element, 6) n and m at point k, dimensionless; they jump at point loads."""
        raise NotImplementedError

    def _contact_in(self, cell):
        """(points, nodes per element, 6) n and m in one element, dimensionless."""
        raise NotImplementedError

    def _cells(self, i):
        """Slice of the elements of the i-th rod."""
        first = sum(self.elements[:i])
        return slice(first, first + self.elements[i])

    def _at(self, station, values, rest=None):
        """Values (points, nodes, k), minus those at rest (nodes, k), interpolated to a station."""
        station = self.station(station)
        i, rows = self._rows(station.rod)
        cell, weights = self.rule.locate(self.layout.breaks[i], station.s / station.rod.length)
        first = rows.start + cell * self.degree
        nodes = slice(first, first + self.degree + 1)
        return np.einsum("j,njk->nk", weights, values[:, nodes] if rest is None else values[:, nodes] - rest[nodes])

    def sample(self, k, rod, x):
        """Positions and directors anywhere along a rod, at point k.

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
        """(points, n, 7) displacement over `scales.length` and unit quaternion at arc lengths x (n,) over the rod's
        length."""
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
        """Write all points as .xdmf (time axis: load factor or time) or interactive .html, or point k in a format of
        meshio.

        Args:
            file: its name, with the ending .xdmf, .html, or .vtu, .vtk or another of meshio's.
            k: the index of the point, for formats other than .xdmf and .html.

        Raises:
            OSError: the file cannot be written.
            SceneError: an unknown format.
        """
        from cosserat_fenicsx.results import xdmf

        xdmf.write(self, file, k)

    def plot(self, file=None, points=None, *, magnify=1.0, color="bending_moment"):
        """Picture of the deformed rods with supports, joints and loads, at some points (default up to five).

        Args:
            file: a .png; None returns the pyvista plotter.
            points: indices of points of a path, or of times.
            magnify: factor of the displacements in the picture.
            color: what colours the rods: bending_moment, twisting_moment, tension, shear_force, n, m, displacement,
                strain, curvature, of a motion velocity and angular_velocity too; n.x, n.y, n.z for an inertial
                component, n.1, n.2, n.3 for one along d_1, d_2, d_3.

        Raises:
            SceneError: an unknown field (lists the names), or pyvista is missing.
        """
        from cosserat_fenicsx.pictures import plot

        return plot.rods(self, file, points, magnify, color)
