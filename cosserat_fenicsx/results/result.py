"""Base class of equilibrium paths and motions: queries of a sequence of states."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from cosserat_fenicsx.checks import File, instance
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.remember import per_scene
from cosserat_fenicsx.results.export.exports import Exports
from cosserat_fenicsx.results.fields import fields_at
from cosserat_fenicsx.results.queries import Extremes, Reactions, Stresses
from cosserat_fenicsx.results.states import States
from cosserat_fenicsx.scene.rod import RodOrName, Station, StationOrName

# How far beyond a jump its right side is taken, over the rod's length.
_BEYOND = 1e-9


@per_scene
def resting(scene, layout, rule):
    """(nodes, 3) positions at rest, m, of all nodes of all rods, relative to the origin of each structure."""
    return np.concatenate([
        rod.curve.position(x * rod.length) - scene.origin(rod)
        for rod, x in zip(scene.rods, layout.node_s(rule.nodes), strict=True)
    ])  # fmt: skip


class Result(Exports, Extremes, Reactions, Stresses, States):
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

    def station(self, station: StationOrName) -> Station:
        """The `Station` given as one or by its name.

        Raises:
            SceneError: neither a station nor the name of one.
        """
        if isinstance(station, str):
            return self.scene.station(station)
        return instance(type(self).__name__, "station", station, Station, "a station such as rod.end, or its name")

    def position(self, station: StationOrName) -> np.ndarray:
        """(n, 3) positions, m, inertial."""
        station = self.station(station)
        return self.displacement(station) + station.rod.curve.position(station.s)

    def displacement(self, station: StationOrName) -> np.ndarray:
        """(n, 3) displacements from the reference, m, inertial."""
        return self._at(station, self._all_rq[:, :, :3], self._rest) * self.scales.length

    def rotation(self, station: StationOrName) -> np.ndarray:
        """(n, 4) unit quaternion (scalar first) from the reference to the current section; its sign is continuous
        from point to point and along the rod."""
        q = self._at(station, self._all_rq[:, :, 3:])
        return q / np.linalg.norm(q, axis=1, keepdims=True)

    def rotation_angle(self, station: StationOrName) -> np.ndarray:
        """(n,) angle of `rotation`, rad, in [0, 2 pi]: since q is continuous, it exceeds pi and decreases again after
        2 pi."""
        q = self.rotation(station)
        half = np.arctan2(np.linalg.norm(q[:, 1:], axis=1), q[:, 0])
        return 2 * half

    def force(self, station: StationOrName) -> np.ndarray:
        """(n, 3) contact force n, N, inertial, exerted by the part with larger s on the part with smaller s. At a
        station with a point load it is the value just before it; at rod.start the value just after."""
        return self._contact_at(station)[:, :3] * self.scales.force

    def moment(self, station: StationOrName) -> np.ndarray:
        """(n, 3) contact moment m, N m, inertial; sign and side as in `force`."""
        return self._contact_at(station)[:, 3:] * self.scales.moment

    def centreline(self, k: int = -1, rod: RodOrName | None = None) -> np.ndarray:
        """(nodes, 3) m, inertial: the nodes of a rod (default the first) at point k."""
        return self.fields(k, rod)["position"]

    def fields(self, k: int, rod: RodOrName | None = None) -> dict[str, np.ndarray]:
        """All fields at the nodes of a rod (a `Rod` or its name; default the first) at point k.

        Returns:
            dict of arrays (nodes, ...): s (m), position, displacement (m), quaternion, d1, d2, d3, force (N), moment
            (N m), all inertial; strain (v - v_R: shear 1, shear 2, stretch) and curvature (u - u_R: bending 1,
            bending 2, twist; 1/m), both material; bending_moment (N m, its size). Where a section of the scene knows
            its shape, also von_mises, axial_max and axial_min (Pa), see `stress`; NaN along other sections. Of a motion
            also velocity (m/s) and angular_velocity (rad/s), inertial. Where a section changes or a point load acts,
            what jumps is that of the side of smaller s; `stress` and `largest` cover both sides.

        Raises:
            IndexError: there is no point k.
            SceneError: k is no whole number.
        """
        which = [self._index(k, f"fields({k!r})")]
        return {name: a if name == "s" else a[0] for name, a in self.fields_at(which, rod).items()}

    def fields_at(self, which: Sequence[int] | np.ndarray, rod: RodOrName | None = None) -> dict[str, np.ndarray]:
        """`fields` in several states at once: {name: array (n, nodes, ...)}, but s (nodes,).

        Args:
            which: their indices (n,).
        """
        return fields_at(self, which, self.rod(rod))

    def largest_displacement(self) -> np.ndarray:
        """(n,) the largest displacement of any node, m."""
        return np.linalg.norm(self._moved, axis=2).max(axis=1) * self.scales.length

    @cached_property
    def _all_rq(self):
        """(points, nodes, 7) r and q, dimensionless."""
        return self._stacked("rq") if len(self) else np.empty((0, len(self._rest), 7))

    @cached_property
    def _rest(self):
        """(nodes, 3) positions at rest, dimensionless, relative to the origin of each structure."""
        return resting(self.scene, self.layout, self.rule) / self.scales.length

    @cached_property
    def _moved(self):
        """(points, nodes, 3) displacements of the nodes, dimensionless."""
        return self._motion[:, :, :3]

    @cached_property
    def _motion(self):
        """(points, nodes, 7) displacements of the nodes, dimensionless, and q."""
        motion = self._all_rq.copy()
        motion[:, :, :3] -= self._rest
        return motion

    @property
    def _turned(self):
        """(points, nodes, 4) q at the nodes."""
        return self._all_rq[:, :, 3:]

    def _contact_at(self, station, side="left"):
        """(points, 6) n and m at a station, dimensionless; at a jump those of the "left" or the "right" side."""
        station = self.station(station)
        i, _ = self._rows(station.rod)
        x = station.s / station.rod.length + (_BEYOND if side == "right" else 0.0)
        cell, weights = self.rule.locate(self.layout.breaks[i], x)
        return np.einsum("j,njk->nk", weights, self._contact_in(self._cells(i).start + cell))

    def _contact_of(self, k):
        """(elements, nodes per element, 6) n and m at point k, dimensionless; they jump at point loads."""
        raise NotImplementedError

    def _contact_in(self, cell):
        """(points, nodes per element, 6) n and m in one element, dimensionless."""
        raise NotImplementedError

    def _viscous(self, which, rod):
        """The viscous parts of n and m at the nodes of a rod in several states, material, N and N m: none at rest."""
        return 0.0, 0.0

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
        if records is None:
            nodal = self._all_rq[:, rows].copy()
        else:
            nodal = np.array([record.rq[rows] for record in records])
        nodal[:, :, :3] -= self._rest[rows]
        moved = np.einsum("kj,nkjc->nkc", weights, nodal[:, nodes])
        moved[:, :, 3:] /= np.linalg.norm(moved[:, :, 3:], axis=2, keepdims=True)
        return moved

    # -- files and pictures ------------------------------------------------------------------------------------------

    def write(
        self,
        file: File,
        k: int | None = None,
        *,
        rod: RodOrName | None = None,
        station: StationOrName | None = None,
    ) -> None:
        """Write a file whose ending says what it holds.

        .xdmf: all points, with the load factor or the time as time axis, for ParaView. .csv: a table over load factors
        or time, of motion and contact forces at stations; or, given k or rod, all fields along the rods at point k.
        .html: one interactive page with a slider over all points, which needs no network.
        .vtu, .vtk or another ending of meshio: point k. For all of a result, to read it again, see `save`.

        Args:
            file: its name.
            k: the index of the point, for endings other than .xdmf and .html; default the last.
            rod: for .csv: the `Rod`, or its name, along which fields are written; None for all.
            station: for .csv: a station of the table beside the ends of rods and the places of loads and supports;
                default the one that moves most.

        Raises:
            OSError: the file cannot be written.
            SceneError: an unknown format, or an option that it does not have.
        """
        from cosserat_fenicsx.results.export import files

        files.write(self, file, k, rod=rod, station=station)

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
