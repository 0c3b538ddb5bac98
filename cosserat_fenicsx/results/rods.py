"""Base class of equilibrium paths and motions: queries of a sequence of states, its tables and files."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import File, instance, positive
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.results.compared import cells_of, located
from cosserat_fenicsx.results.queries import Extremes, Reactions, Stresses, largest_in_words, reactions_in_words
from cosserat_fenicsx.results.recovery import TendonState, Threads, at_nodes, tension_of
from cosserat_fenicsx.results.result import (
    Result,
    _said,
    _values,
    by_name,
    component_names,
    dataset,
    elements_in_words,
    import_library,
    variable,
    write_columns,
)
from cosserat_fenicsx.results.states import States
from cosserat_fenicsx.scene.action import describe, without_stress
from cosserat_fenicsx.scene.rod import RodOrName, Station, StationOrName

# How far beyond a jump its right side is taken, over the rod's length.
_BEYOND = 1e-9


@per_scene
def resting(scene, layout, rule):
    """(nodes, 3) positions at rest, m, of all nodes of all rods, relative to the origin of each structure."""
    return layout.at_rest(scene, rule.nodes)


def _of_supports(k):
    """Of a result: (supports, n, 3) forces (k = 0) or moments (1) of supports, NaN where unknown; None without."""

    def exerted(result):
        found = []
        for support in result.scene.all_supports:
            try:
                found.append(result.reaction(support)[k])
            except SceneError:  # of an action with memory at the same point
                found.append(np.full((len(result), 3), np.nan))
        return np.array(found) if found else None

    return exerted


def _supports(result):
    found = result.scene.all_supports
    return np.array([describe(support) for support in found]) if found else None


_ALONG = ("point", "s")
#: The fields of `RodResult.fields`, and reactions.
_QUANTITIES = by_name(
    Quantity("support", axes=("support",), getter=_supports),
    Quantity("reaction_force", "force", "N", "xyz", "inertial", ("support", "point"), _of_supports(0)),
    Quantity("reaction_moment", "moment", "N m", "xyz", "inertial, about the station", ("support", "point"),
             _of_supports(1)),
    Quantity("s", unit="m", axes=("s",)),
    Quantity("position", unit="m", parts="xyz", frame="inertial", axes=_ALONG),
    Quantity("displacement", unit="m", parts="xyz", frame="inertial", axes=_ALONG),
    Quantity("quaternion", parts="abcd", frame="rotation from the reference, scalar first, inertial", axes=_ALONG),
    *(Quantity(f"d{i}", parts="xyz", frame="inertial", axes=_ALONG) for i in (1, 2, 3)),
    Quantity("force", "inertial contact force", "N", "xyz", "inertial", _ALONG),
    Quantity("moment", "inertial contact moment", "N m", "xyz", "inertial", _ALONG),
    Quantity("strain", "material strain", "1", ("shear 1", "shear 2", "stretch"), "material: along d1, d2, d3", _ALONG),
    Quantity("curvature", "material change of curvature", "1/m", ("bending 1", "bending 2", "twist"),
             "material: about d1, d2, d3", _ALONG),
    Quantity("bending_moment", unit="N m", axes=_ALONG),
    Quantity("von_mises", "von Mises stress", "Pa", axes=_ALONG),
    Quantity("axial_max", "largest axial stress", "Pa", axes=_ALONG),
    Quantity("axial_min", "smallest axial stress", "Pa", axes=_ALONG),
)  # fmt: skip
#: Of the station of a table that nobody asked for.
MOVES_MOST = ", which moves most (another by --station, station=)"
# A named station is shown in tables if its displacement is at least this share of the largest one.
_WORTH_SHOWING = 0.2


class RodResult(Result, Extremes, Reactions, Stresses, States):
    """A sequence of states of a scene. Public methods return SI units. It can be copied and pickled, see `States`.

    Subclasses have the dimensionless contact forces and moments, which jump at point loads: `_contact_of(k)` in all
    elements at point k, (elements, nodes per element, 6), and `_contact_in(cell)` in one element at all points,
    (points, nodes per element, 6).

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

    _quantities = _QUANTITIES
    cautions: Sequence[str] = ()
    # Name in files; attributes in the heads of files; queries of stations in tables.
    _kind = ""
    _more_about: tuple[str, ...] = ()
    _of_stations: tuple[str, ...] = ("displacement", "quaternion", "force", "moment")

    @property
    def quantities(self) -> dict[str, Quantity]:
        """{name: `Quantity`}, with the tensions of tendons along the rods."""
        return super().quantities | by_name(*tension_of(self.scene))

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

    def tendon(self, tendon) -> TendonState:
        """Tension and length of a tendon in every state.

        Args:
            tendon: one of the `Tendon`s in `result.scene.loads`, or in those of a stage.

        Raises:
            SceneError: it is not one of them.
        """
        if not any(load.is_thread and load == tendon for load in self.scene.all_loads):
            raise SceneError(f"tendon: {tendon!r} is no tendon of the scene: expected one of result.scene.loads")
        places = tuple(map(self.place_of, range(len(self))))
        tension, length = self._tension(tendon), self.thread_length(tendon)
        return TendonState(tension, length, *Threads(self).along(tendon, tension), places)

    def thread_length(self, thread):
        """(n,) length along its rod, m, of a thread that need not be there."""
        return Threads(self).length(thread)

    def _tension(self, tendon):
        return Threads(self).tension(tendon)

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
            fields that jump are taken on the side of smaller s; `stress` and `largest` cover both sides.

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
        rod = self.rod(rod)
        i, rows = self._rows(rod)
        s = self.layout.nodes_of(i, self.rule.nodes) * rod.length
        rq = np.array([self._records[k].rq[rows] for k in which])
        contact = np.array([at_nodes(self._contact_of(k)[self._cells(i)]) for k in which])
        displacement = (rq[..., :3] - self._rest[rows]) * self.scales.length
        q = rq[..., 3:] / np.linalg.norm(rq[..., 3:], axis=-1, keepdims=True)
        d = directors(q.reshape(-1, 4)).reshape(*q.shape[:2], 3, 3) @ rod.curve.frame(s)
        n, m = contact[..., :3] * self.scales.force, contact[..., 3:] * self.scales.moment
        n_material, m_material = np.einsum("nkij,nki->nkj", d, n), np.einsum("nkij,nki->nkj", d, m)
        # at a jump the values of the element before, as for n and m
        viscous = self._viscous(which, rod)
        strain, curvature = rod.stiffness_at(s, "left").strains(n_material - viscous[0], m_material - viscous[1])
        if self.scene.acts_in_law:
            free = np.moveaxis(self._without_stress(which, rod, s), 1, 0)
            curvature, strain = (a + b for a, b in zip((curvature, strain), free, strict=True))
        found = {
            "s": s,
            "position": rod.curve.position(s) + displacement,
            "displacement": displacement,
            "quaternion": q,
            "d1": d[..., 0],
            "d2": d[..., 1],
            "d3": d[..., 2],
            "force": n,
            "moment": m,
            "strain": strain,
            "curvature": curvature,
            "bending_moment": np.linalg.norm(m_material[..., :2], axis=-1),
        }
        if self.knows_stresses:
            found |= rod.profile.stresses(s, "left", n_material, m_material)._asdict()
        return found

    def _without_stress(self, which, rod, s):
        """(k, 2, n, 3) curvature, 1/m, and strain without stress in several states: see `action.without_stress`."""
        records, known, found = [self._records[k] for k in which], {}, []
        for record in records:
            time = getattr(record, "time", 0.0)
            full, scaled = known[time] = known[time] if time in known else without_stress(self.scene, rod, s, time)
            found.append(full + record.load_factor * scaled)
        return np.array(found)

    def largest_displacement(self) -> np.ndarray:
        """(n,) the largest displacement of any node, m."""
        return np.linalg.norm(self._motion[..., :3], axis=2).max(axis=1) * self.scales.length

    @property
    def _all_rq(self):
        """(points, nodes, 7) r and q, dimensionless."""
        return self._stacked("rq") if len(self) else np.empty((0, len(self._rest), 7))

    @cached_property
    def _rest(self):
        """(nodes, 3) positions at rest, dimensionless, relative to the origin of each structure."""
        return resting(self.scene, self.layout, self.rule) / self.scales.length

    @cached_property
    def _motion(self):
        """(points, nodes, 7) displacements of the nodes, dimensionless, and q."""
        motion = self._all_rq.copy()
        motion[:, :, :3] -= self._rest
        return motion

    def _contact_at(self, station, side="left"):
        """(points, 6) n and m at a station, dimensionless; at a jump on the "left" or the "right" side."""
        station = self.station(station)
        i, _ = self._rows(station.rod)
        x = station.s / station.rod.length + (_BEYOND if side == "right" else 0.0)
        cell, weights = located(self.layout, self.rule, i, x)
        return np.einsum("j,njk->nk", weights, self._contact_in(self._cells(i).start + cell))

    def _viscous(self, which, rod):
        """The viscous parts of n and m at the nodes of a rod in several states, material, N and N m: none at rest."""
        return 0.0, 0.0

    def _cells(self, i):
        """Slice of the elements of the i-th rod."""
        return cells_of(self.layout)[i]

    def _at(self, station, values, rest=None):
        """Values (points, nodes, k), minus those at rest (nodes, k), interpolated to a station."""
        station = self.station(station)
        i, rows = self._rows(station.rod)
        cell, weights = located(self.layout, self.rule, i, station.s / station.rod.length)
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
        nodes, weights = self._between(rod, x)
        nodal = self._all_rq[:, nodes] if records is None else np.array([record.rq[nodes] for record in records])
        nodal[..., :3] -= self._rest[nodes]
        moved = np.einsum("kj,nkjc->nkc", weights, nodal)
        moved[:, :, 3:] /= np.linalg.norm(moved[:, :, 3:], axis=2, keepdims=True)
        return moved

    # -- other libraries ---------------------------------------------------------------------------------------------

    @property
    def _ranks(self):
        return self.comm

    def _about(self):
        names = ("model", "formulation", "degree", "unknowns", *self._more_about)
        told = {"kind": type(self)._kind, "title": self.scene.title} | {name: getattr(self, name) for name in names}
        return told | {"elements": list(self.elements), "why": list(self.why)}

    def _along(self, rod, units):
        """{name: `Variable`} of the fields along a rod in all states, and of the modes of events."""
        fields, found = self.fields_at(range(len(self)), rod), {}
        for name, quantity in self.quantities.items():
            if "s" in quantity.axes:
                values = fields.get(name) if quantity.getter is None else quantity.of(self, rod)
                if values is not None:
                    found[name] = variable(quantity, values, units)
        return found

    def to_dict(self, units: str | Mapping = "SI") -> dict[str, Any]:
        """All of the result as a dict of numpy arrays, numbers and texts.

        Returns:
            dict with the keys kind, title, model, formulation, degree, unknowns, elements and why; load_factor,
            negative_modes, stable, iterations, error and control of a path, or time, steps, iterations, scheme,
            energies and momenta of a motion, arrays (n, ...); support, texts, reaction_force and reaction_moment
            (supports, n, 3), inertial, NaN where unknown; event_kind, event_load_factor, event_after, event_residual
            and event_error of a path, empty where it has no events; rods, {name: {field: array}} with those of `fields`
            (n, nodes, ...), s (nodes,) and the modes of events (events, nodes, 3); units and frames, {name: text} of
            all these; and quantities of your own, see `quantity`.
            `json.dumps(result.to_dict(), default=lambda a: a.tolist())` makes text of it, with NaN for the unknown.
        """
        units = Units(units)
        whole, rods = self._variables(units), {rod.name: self._along(rod, units) for rod in self.scene.rods}
        told = {name: variable for variables in (whole, *rods.values()) for name, variable in variables.items()}
        return {
            **self._about(),
            **_values(whole),
            "rods": {name: _values(variables) for name, variables in rods.items()},
            **_said(told),
        }

    def to_dataframe(
        self,
        k: int | None = None,
        rod: RodOrName | None = None,
        station: StationOrName | None = None,
        *,
        units: str | Mapping = "SI",
    ) -> Any:
        """A pandas DataFrame with the columns of the .csv of `write`, whose arguments it has.

        Without k and rod it has a row per load factor or time, and the index `point` counts them, since load factors
        repeat where a path turns back. Else it has a row per node along the rods, at point k, and takes no station.

        Raises:
            InstallationError: pandas is missing.
            SceneError: an empty result, no such rod or station, or a station beside k or rod.
        """
        import_library("pandas", "to_dataframe")
        self._refuse_empty("to_dataframe")
        columns = self._columns(k, rod, station, units)
        return self._frame(columns, "point" if k is None and rod is None else "node")

    def to_xarray(self, units: str | Mapping = "SI") -> Any:
        """An xarray DataTree: what belongs to every state in its root, and a group per rod with the fields along it.

        Dimensions are `point` (load factors or times) and, in the group of a rod, `s` (m), an index. `load_factor` or
        `time` is a coordinate of `point` without an index, since load factors repeat where a path turns back: select by
        `isel(point=...)`. Variables have the attributes units, long_name and, where they have components, frame. The
        root holds reactions by `support` and the events of a path, whose modes are in the groups. Characters that names
        of groups cannot have are replaced; the attribute rod is the name. `tree.to_netcdf("file.nc",
        engine="h5netcdf")` writes a file.

        Raises:
            InstallationError: xarray is missing, or older than 2024.10.
            SceneError: an empty result.
        """
        xarray = import_library("xarray", "to_xarray", "DataTree")
        self._refuse_empty("to_xarray")
        root, *groups = self.in_groups(units)
        axis = {name: root[2][name] for name in self._coordinates}
        made = [(place, attributes, axis | variables) for place, attributes, variables in (root, *groups)]
        about = {"/": {**self._about(), "why": "\n".join(self.why)}}
        return xarray.DataTree.from_dict({
            place: dataset(xarray, variables, self._coordinates, about.get(place, attributes))
            for place, attributes, variables in made
        })  # fmt: skip

    def in_groups(self, units: str | Mapping = "SI") -> list[tuple[str, dict, dict]]:
        """(place, attributes, {name: `Variable`}) of the root and of each rod, as files have them; without events
        where there are none."""
        units, quantities = Units(units), self.quantities
        root = self._variables(units)
        none = "event_kind" in root and not len(root["event_kind"].values)
        found = [("/", {}, root)]
        for rod, group in zip(self.scene.rods, group_names(self.scene), strict=True):
            found.append((f"/{group}", {"rod": rod.name}, self._along(rod, units)))
        for _, _, variables in found:
            for name in [name for name, x in variables.items() if none and "event" in x.dims]:
                del variables[name]
            variables |= component_names(quantities, variables)
        return found

    def columns(self, units: str | Mapping = "SI", axis: str = "", station: StationOrName | None = None) -> dict:
        """{heading: (n,)} over load factors or time.

        Of a path: load factor, negative modes, iterations, estimated errors. Of a motion: time, steps, energies,
        momenta. Then displacement, quaternion, contact force n and moment m, of a motion velocities too, all inertial,
        at both ends of every rod, where loads and supports act, and at one more station. n and m act from the part of
        larger s on the part of smaller s: the reaction of a support at the start is their opposite.

        Args:
            station: one more; default the one with the largest displacement.
        """
        found, units, known = super().columns(units, axis), Units(units), self.quantities
        one_more = self.station(station or self._most_displaced())
        for rod in self.scene.rods:
            more = [one_more] if one_more.rod is rod else []
            stations = sorted([rod.start, *self.scene.stations(rod), rod.end, *more], key=lambda place: place.s)
            for place in {place.s: place for place in stations}.values():
                for name in self._of_stations:
                    values = (self.rotation if name == "quaternion" else getattr(self, name))(place)
                    found |= known[name].columns(values, units, f"{place} ")
        return found

    def _columns(self, k, rod, station, units):
        """The columns of `write` for .csv and of `to_dataframe`."""
        if k is None and rod is None:
            return self.columns(units, station=station)
        if station is not None:
            raise SceneError(
                f"station = {station!r}: expected None beside k or rod, since a table along rods has no station"
            )
        parts, units = [], Units(units)
        for one in self.scene.rods if rod is None else [self.rod(rod)]:
            fields = self.fields(-1 if k is None else k, one)
            columns = {"rod": np.full(len(fields["s"]), one.name)}
            for name, values in fields.items():
                columns |= self.quantities[name].columns(values, units)
            parts.append(columns)
        return {heading: np.concatenate([part[heading] for part in parts]) for heading in parts[0]}

    # -- on the screen -----------------------------------------------------------------------------------------------

    def details(self, units: str | Mapping = "SI", station: StationOrName | None = None) -> str:
        """The answer with a longer table, the largest forces and stresses, reactions, and why this model.

        Args:
            station: whose motion the table shows; default the one with the largest displacement.
        """
        units = Units(units)
        table = self._table(units, screen.ROWS, station)
        text = [] if table is None else [screen.as_text(table)]
        return "\n".join([*text, *self._answer(units), *self._more(units)])

    def _most_displaced(self):
        """The named station that moves most; the node that does where named ones move much less."""

        def moves(station):
            return round(float(np.linalg.norm(self.displacement(station), axis=1).max()), 12)

        rods = self.scene.rods
        named = max((station for rod in rods for station in (rod.end, *self.scene.stations(rod))), key=moves)
        inside = []
        for i, rod in enumerate(rods):
            x = self.layout.nodes_of(i, self.rule.nodes)
            moved = np.linalg.norm(self.motion(rod, x)[:, :, :3], axis=2).max(axis=0)
            inside.append(rod.at(x[np.argmax(moved)] * rod.length))
        other = max(inside, key=moves)
        return named if moves(named) >= _WORTH_SHOWING * moves(other) else other

    def _moved_in_words(self, station, units):
        """The last displacement of a station."""
        quantity, moved = self.quantities["displacement"], self.displacement(station)[-1]
        unit, size = units.on_screen(quantity, moved)
        least = max(1e-12 * self.scales.length, 1e-9 * np.abs(moved).max())
        return f"({', '.join(f'{x / size if abs(x) > least else 0:.6g}' for x in moved)}) {unit}"

    def _mesh_in_words(self):
        return f"degree {self.degree}, {elements_in_words(self.elements)}, {self.unknowns} unknowns"

    def _more(self, units):
        if len(self):
            yield units.sentence(largest_in_words(self))
            yield from map(units.sentence, reactions_in_words(self))
        yield units.sentence(f"{self.model} model: {'; '.join(self._reasons)}.")

    def _doubts(self, units):
        for doubt in self.scene.doubts:
            yield units.sentence(f"First check: {doubt}")

    @property
    def _reasons(self):
        """The sentences of `why` that are not in the answer."""
        told = [*self.scene.doubts, *self.cautions]
        return [sentence for sentence in self.why if sentence not in told]

    # -- files and pictures ------------------------------------------------------------------------------------------

    def save(self, file: File) -> None:
        """Write all of the result to one HDF5 file, from which `read_result` makes it again.

        Every query then gives the same digits. Other programs find, with units, what belongs to every state in the
        root, and fields along each rod in rods/<name>, see `results.saved`. An old file is replaced once the new
        one is complete.

        Raises:
            OSError: the file cannot be written; an old one stays.
            SceneError: an empty result, or a scene with functions written in Python, or with actions of your own,
                which are code: no file holds any.
        """
        from cosserat_fenicsx.results import saved

        self._refuse_empty("save")
        on_first(self.comm, lambda: saved.save(self, file))

    def write(
        self,
        file: File,
        k: int | None = None,
        *,
        rod: RodOrName | None = None,
        station: StationOrName | None = None,
        units: str | Mapping = "SI",
        magnify: float = 1.0,
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
            units: of a .csv or .html; all other files are in SI.
            magnify: of a .html: the factor of the displacements when it is opened; it can be changed there.

        Raises:
            OSError: the file cannot be written.
            SceneError: an unknown format, or an option that it does not have.
        """
        from cosserat_fenicsx.results import xdmf

        file = Path(file)
        if len(self) == 0:
            raise SceneError(f"{file}: the {type(self)._kind.lower()} has no point to write")
        if k is not None:
            try:
                self._index(k, f"{file}: k = {k!r}")
            except IndexError as problem:
                raise SceneError(str(problem)) from None
        for name, value, usual, endings in (
            ("rod", rod, None, ".csv"), ("station", station, None, ".csv"),
            ("units", units, "SI", ".csv or .html"), ("magnify", magnify, 1, ".html"),
        ):  # fmt: skip
            if value != usual and file.suffix not in endings.split(" or "):
                raise SceneError(f"{file}: {name} is not for the ending '{file.suffix}': expected a file {endings}")
        if file.suffix == ".csv":
            on_first(self.comm, lambda: write_columns(file, self._columns(k, rod, station, units)))
        elif file.suffix == ".html":
            from cosserat_fenicsx.pictures import viewer

            positive("write", "magnify", magnify, "-")
            on_first(self.comm, lambda: viewer.write(self, file, magnify, units))
        else:
            written = xdmf.write_series if file.suffix == ".xdmf" else xdmf.write_state
            on_first(self.comm, lambda: written(self, file, k))

    def plot(self, file=None, points=None, *, magnify=1.0, color=None, side_by_side=None, units="SI"):
        """Picture of the deformed rods at some points, with the reference as a grey line, supports, joints and loads.

        Supports and joints are drawn on the last shape, each load on the last shape where it is not zero.

        Args:
            file: a .png, which rank 0 writes; None returns the pyvista plotter.
            points: indices of points of a path, or of times; None for up to five, with the end of each stage.
            magnify: factor of the displacements in the picture.
            color: what colours the rods: bending_moment, twisting_moment, tension, shear_force, n, m, displacement,
                strain, curvature, of a motion velocity and angular_velocity too; n.x, n.y, n.z for an inertial
                component, n.1, n.2, n.3 for one along d_1, d_2, d_3. None for what matters: the tension of cables,
                else of the first four the one that stores most strain energy and varies, see docs/viewing.md.
            side_by_side: whether shapes are drawn beside each other, without the reference, instead of where they are;
                None where they would cross each other many times.
            units: "SI", "field", or a dict of units by dimensions, such as {"force": "klbf"}.

        Raises:
            SceneError: an empty result, an unknown field (lists the names), unknown units, a file that is no .png, or
                pyvista is missing.
            OSError: the file cannot be written.
        """
        from cosserat_fenicsx.pictures import plot

        return plot.rods(self, file, points, magnify, color, side_by_side, units)


def group_names(scene):
    """Names of groups, one a rod: its own name where files can have it, else a similar one."""
    names = []
    for rod in scene.rods:
        name = plain = rod.name.replace("/", "|").replace("\0", "").strip(". ") or "rod"
        while name in names:
            name = f"{plain} ({len(names)})"
        names.append(name)
    return names
