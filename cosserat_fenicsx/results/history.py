"""A motion as arrays with named fields, in SI units."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import File, refuse
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.results.compared import cell_nodes
from cosserat_fenicsx.results.contacts import ROD_FORCE, RodContacts, contacts_in_words, rod_contacts_of
from cosserat_fenicsx.results.recovery import viscous_contact
from cosserat_fenicsx.results.result import by_name
from cosserat_fenicsx.results.rods import MOVES_MOST, RodResult
from cosserat_fenicsx.results.whirl import Orbit, WallForces, Whirl, orbit_of, wall_forces, whirl
from cosserat_fenicsx.scene.action import Action
from cosserat_fenicsx.scene.rod import RodOrName, StationOrName

# Largest number of times in tables.
_TIMES = 21
_ALONG = ("point", "s")
_ENERGIES = ("kinetic", "strain", "work", "dissipated", "balance")
_ERROR = Quantity("error", "estimated error of positions", unit="m", digits=2)
# Quantities of every time, and the fields that paths do not have.
_QUANTITIES = by_name(
    Quantity("time", unit="s", getter="times"),
    Quantity("steps"),
    Quantity("iterations", "Newton iterations"),
    Quantity("kinetic_energy", unit="J", getter="kinetic"),
    Quantity("strain_energy", unit="J", getter="strain"),
    Quantity("work", unit="J"),
    Quantity("dissipated", unit="J"),
    Quantity("balance", unit="J"),
    Quantity("linear_momentum", unit="kg m/s", parts="xyz", frame="inertial"),
    Quantity("angular_momentum", unit="kg m^2/s", parts="xyz", frame="inertial"),
    Quantity("velocity", unit="m/s", parts="xyz", frame="inertial", axes=_ALONG),
    Quantity("angular_velocity", unit="rad/s", parts="xyz", frame="inertial", axes=_ALONG),
)


def _of_ledger(name):
    """The property of a `History` that has a column of its ledger."""

    def column(history) -> np.ndarray:
        return history._booked(name)

    return property(column, doc="(n,) or (n, 3), see the class.")


class History(RodResult):
    """A motion: its states at the saved times, energies and momenta.

    All station queries (`position`, `displacement`, `rotation`, `force`, `moment`, ...) give one row per time. Contact
    forces and moments, and so stresses, include damping; strains and curvatures are of the shape alone. If `simulate`
    was given a `folder`, the states are read from a file in it.

    Beside those of `RodResult` it has these attributes.

    Attributes:
        times: (n,) s.
        scheme: the scheme's name.
        steps: (n,) number of steps since the start.
        kinetic, strain: (n,) energies, J.
        work: (n,) J, work of loads and prescribed motions, and of actuation that changes, since the start.
        dissipated: (n,) J, energy dissipated by damping since the start.
        balance: (n,) J, kinetic + strain - work + dissipated, minus its value at the start; zero for an exact solution.
        error: (n,) m, estimated error of the positions of all points up to each time, see `simulate(estimate=True)`;
            None if it was not asked for.
        linear_momentum: (n, 3) kg m/s; angular_momentum: (n, 3) kg m^2/s about the inertial origin, inertial.
    """

    axis, counts_modes = "time", False
    _kind, _more_about, _coordinates = "History", ("scheme",), ("time",)
    _quantities = _QUANTITIES
    _of_stations = ("displacement", "quaternion", "velocity", "angular_velocity", "force", "moment")
    more_fields = {"velocity": "velocity", "angular_velocity": "angular_velocity"}  # noqa: RUF012
    error: np.ndarray | None = None

    @classmethod
    def of(cls, model, scheme, why=()):
        """An empty history for the scene that a moving model was loaded with."""
        history = super().of(model, model.signature.formulation.name, why)
        history.scheme, history._time_unit = scheme, model.time
        return history

    def __repr__(self):
        reach = f"t = {self.times[0]:g} .. {self.times[-1]:g} s" if len(self) else "empty"
        return f"<History: {len(self)} times, {reach}, {self.model}, {self.unknowns} unknowns, scheme {self.scheme}>"

    def _answer(self, units):
        title = f"{self.scene.title}: at" if self.scene.title else "At"
        if not len(self):
            yield "No time of the motion was computed."
            return
        yield from self._doubts(units)
        station = self._most_displaced()
        yield (
            f"{title} t = {self.times[-1]:.6g} s {station} is displaced by {self._moved_in_words(station, units)}; "
            f"its largest speed is {np.linalg.norm(self.velocity(station), axis=1).max():.4g} m/s."
        )
        largest = max(np.abs(getattr(self, name)).max() for name in _ENERGIES)
        if largest:
            worst = np.abs(self.balance).max()
            yield (
                f"The energy balance is off by at most {worst:.1e} J, {worst / largest:.1e} of the largest energy, "
                "which tells nothing of the mesh."
            )
        yield from self._error_in_words(units)
        yield from map(units.sentence, contacts_in_words(self))
        yield f"{self.steps[-1]} steps of the scheme {self.scheme}, {self.model} model."

    def _error_in_words(self, units):
        if self.error is None:
            yield "The error of positions was not estimated (estimate = true does)."
            return
        if np.isnan(self.error).all():
            yield "The error of positions is not known: `why` says why."
            return
        k = int(np.nanargmax(self.error))
        words = f"{self.error[k]:.1e} m, {self.error[k] / max(self.scene.lengths):.1e} of the longest rod's length"
        yield units.sentence(f"Positions have an estimated error of at most {words}, at t = {self.times[k]:.4g} s.")

    def _table(self, units, rows, station=None):
        if not len(self):
            return None
        rows = min(rows, _TIMES)
        chosen, station = "" if station else MOVES_MOST, self.station(station or self._most_displaced())
        known = self.quantities
        title = f"{self.scene.title}\n" if self.scene.title else ""
        some = f"{rows} of " if rows < len(self) else ""
        speed = np.linalg.norm(self.velocity(station), axis=1)
        energies = [(dataclasses.replace(known.get(f"{x}_energy", known.get(x)), label=x, digits=5), getattr(self, x))
                    for x in (_ENERGIES[:-1] if rows == _TIMES else _ENERGIES[:2])]  # fmt: skip
        return screen.table(
            [
                (known["time"], self.times),
                (Quantity("displacement", unit="m", parts="xyz", short="d"), self.displacement(station)),
                (Quantity("speed", unit="m/s", digits=4), speed),
                *energies,
                (dataclasses.replace(known["balance"], digits=2), self.balance),
            ],
            units,
            rows,
            f"{title}{self.model} model, scheme {self.scheme}, {self._mesh_in_words()}, {self.steps[-1]} steps, "
            f"{some}{len(self)} times",
            f"dx, dy, dz, speed: of {station}{chosen}. "
            "work: of loads and prescribed motions. balance: kinetic + strain - work + dissipated, minus its value at "
            "the start; zero for an exact solution.",
        )

    def _more(self, units):
        if len(self):
            least = 1e-12 * self.scales.length
            ends = (
                f"{place} at ({', '.join(f'{x if abs(x) > least else 0:.6g}' for x in self.position(place)[-1])}) m"
                for place in _named(self.scene)
            )
            yield f"t = {self.times[-1]:.6g} s: {'; '.join(ends)}."
        yield from super()._more(units)

    @property
    def times(self) -> np.ndarray:
        """(n,), see the class."""
        return self._array("time")

    @property
    def quantities(self) -> dict[str, Quantity]:
        """{name: `Quantity`}, with forces of rods that touch, and the error where it was estimated."""
        more = [ROD_FORCE] * bool(self.scene.rod_contact) + [_ERROR] * (self.error is not None)
        return super().quantities | by_name(*more)

    def at_points(self, which):
        part = super().at_points(which)
        part.error = None if self.error is None else self.error[which]
        return part

    def apart(self, other: "History") -> np.ndarray:
        """Distance from another motion of the same rods, such as one with other elements, steps or another scheme.

        Args:
            other: a `History`; between its times, its positions are cubic polynomials through them and the velocities.

        Returns:
            (n,) m: at each time of this motion the largest distance, over its nodes, between the positions of a point
            in the two; NaN at times that the other does not reach.

        Raises:
            SceneError: no motion, or one of other rods.
        """
        rods = [(rod.name, rod.length) for rod in self.scene.rods]
        if not isinstance(other, History) or [(rod.name, rod.length) for rod in other.scene.rods] != rods:
            refuse("apart", "other", other, "a History of rods of the same names and lengths")
        if len(other) < 2:
            return np.full(len(self), np.nan)
        rule, layout = other.rule, other.layout
        places = zip(layout.breaks, self.layout.node_s(self.rule.nodes), strict=True)
        found = [rule.locate_all(breaks, x) for breaks, x in places]
        of_cells = [nodes for nodes, _ in cell_nodes(layout, other.degree)]
        nodes = np.concatenate([all_of[cells] for all_of, (cells, _) in zip(of_cells, found, strict=True)])
        weights, times = np.concatenate([x for _, x in found])[:, :, None], other.times
        apart = np.full(len(self), np.nan)
        for i, t in enumerate(self.times):
            if t > times[-1] * (1 + 1e-12):
                break
            k = int(np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2))
            h, ends = times[k + 1] - times[k], (other._records[k], other._records[k + 1])
            x = (t - times[k]) / h
            a, b = (state.rq[:, :3] * other.scales.length for state in ends)
            u, v = (state.rates[:, :3] * (h * other.scales.length / other.time_unit) for state in ends)
            there = a + x * u + x**2 * (3 * (b - a) - 2 * u - v) + x**3 * (2 * (a - b) + u + v)
            here = self._records[i].rq[:, :3] * self.scales.length
            apart[i] = np.linalg.norm((weights * there[nodes]).sum(axis=1) - here, axis=1).max()
        return apart

    def contacts(self, touch: Action) -> RodContacts:
        """Where rods touch each other in the last state, with the forces there; `print` shows them. `motion[k]` has
        those of state k.

        Args:
            touch: the `RodContact` of the scene.

        Raises:
            SceneError: something else.
        """
        if touch is not self.scene.rod_contact or touch is None:
            refuse("contacts", "touch", touch, "the RodContact of the scene")
        return rod_contacts_of(self, len(self) - 1)

    kinetic = _of_ledger("kinetic")
    strain = _of_ledger("strain")
    work = _of_ledger("work")
    dissipated = _of_ledger("dissipated")
    linear_momentum = _of_ledger("linear_momentum")
    angular_momentum = _of_ledger("angular_momentum")

    def _booked(self, name):
        return getattr(self._stacked("ledger"), name) if len(self) else np.empty(0)

    @property
    def time_unit(self) -> float:
        """The unit of time of the dimensionless rates of an `Instant`, s."""
        return self._time_unit

    @property
    def energy(self) -> np.ndarray:
        """(n,) kinetic + strain, J."""
        return self.kinetic + self.strain

    @property
    def balance(self) -> np.ndarray:
        """(n,) J, see the class."""
        total = self.energy - self.work + self.dissipated
        return total - total[:1]

    def velocity(self, station: StationOrName) -> np.ndarray:
        """(n, 3) m/s, inertial."""
        return self._at(station, self._all_rates[:, :, :3]) * (self.scales.length / self._time_unit)

    def angular_velocity(self, station: StationOrName, *, material: bool = False) -> np.ndarray:
        """(n, 3) rad/s, inertial; or along d_1, d_2, d_3 of the moving section."""
        angular = self._at(station, self._all_rates[:, :, 3:]) / self._time_unit
        if not material:
            return angular
        station = self.station(station)
        return np.einsum("nij,ni->nj", directors(self.rotation(station)) @ station.rod.curve.frame(station.s), angular)

    @property
    def along_axis(self) -> np.ndarray:
        """(n,) the times, s."""
        return self.times

    def when(self, k: int, form: str = ".6g") -> str:
        """Time k in words."""
        return f"time {self.times[k]:{form}} s"

    def label(self, k: int) -> str:
        """The label of time k in pictures."""
        return f"{self.times[k]:.3g} s"

    def fields_at(self, which: Sequence[int] | np.ndarray, rod: RodOrName | None = None) -> dict[str, np.ndarray]:
        """See `RodResult`; with velocity (m/s) and angular_velocity (rad/s), inertial."""
        rows = self._rows(rod)[1]
        rates = np.array([self._records[k].rates[rows] for k in which]) / self._time_unit
        velocity = rates[..., :3] * self.scales.length
        return {**super().fields_at(which, rod), "velocity": velocity, "angular_velocity": rates[..., 3:]}

    def plot_energy(self, file: File | None = None, *, units: Any = "SI", width: int | None = None):
        """Chart of the energies over time.

        Args:
            file: a .png or .pdf; None returns matplotlib's Figure.
            units: "SI", "field", or a dict of units by dimensions, such as {"force": "klbf"}.
            width: of the picture, pixels, which its fonts and legends are arranged for; None for 150 to the inch.
        """
        return self._drawn("pictures.motion_charts.energy_figure", file, units, width)

    def animate(self, file, *, fps=25, speed=None, magnify=1.0, enlarge=1.0, size=(960, 720), color=None,
                progress=None, units="SI"):  # fmt: skip
        """Film of the rods, coloured as those of `plot`; the camera is fixed and shows the whole motion.

        Frames come at a constant rate, interpolated between the saved times.

        Args:
            file: .gif or .mp4 (rank 0 writes). The time between frames of a .gif is rounded to 0.01 s.
            fps: frames per second, 1 to 100.
            speed: seconds of the motion per second of the film; None for 1 where the film then takes 2 to 10 s, and
                otherwise for 1, 2 or 5 times a power of ten.
            magnify: factor of the displacements in the picture.
            enlarge: factor of the distances from the axes of the holes that rods are in, and of their clearances.
            size: (width, height), pixels, even.
            color: as of `plot`.
            progress: whether to show a progress bar; None: only if it takes long.
            units: "SI", "field", or a dict of units by dimensions, such as {"force": "klbf"}.

        Raises:
            SceneError: fewer than two times, another ending, an argument outside its range, or pyvista, Pillow or
                ffmpeg is missing, with what to install.
            OSError: the file cannot be written.
            KeyboardInterrupt: Ctrl-C; the film ends with the frames drawn so far.
        """
        from cosserat_fenicsx.pictures import animation

        animation.film(self, file, fps=fps, speed=speed, magnify=magnify, enlarge=enlarge, size=size, color=color,
                       progress=progress, units=units)  # fmt: skip

    @property
    def _all_rates(self):
        """(times, nodes, 6) velocities and angular velocities, dimensionless."""
        return self._stacked("rates") if len(self) else np.empty((0, len(self._rest), 6))

    def wall_forces(self, wall: Action) -> WallForces:
        """The forces of a wall of motions, such as a `HoleWall`, on the nodes that may touch it, in the step that led
        to every state; NaN where no step did.

        Args:
            wall: of the scene.

        Raises:
            SceneError: something else.
        """
        return wall_forces(self, wall)

    def far_end(self, action: Action) -> np.ndarray:
        """(n, 4 or more) velocity (m/s), force (N), angular velocity (rad/s) and torque (N m) at the far end of an
        action that depends on earlier motion, such as the upper end of a `PipeAbove`, and then the speeds of its motors
        (rad/s): means over the time from the state saved before; NaN where no step led to a state.

        Args:
            action: of the scene.

        Raises:
            SceneError: something else.
        """
        known = [x for x in self.scene.actions if x.delayed is not None]
        found = next((k for k, x in enumerate(known) if x is action), None)
        if found is None:
            refuse("far_end", "action", action, "an action of the scene that depends on earlier motion: a PipeAbove")
        return self._stacked("far_ends")[:, found]

    def orbit(self, station: StationOrName, wall: Action | None = None) -> Orbit:
        """The axis of a section in the cross-section of its hole, and the wall's normal force on it.

        Args:
            station: of a rod that a wall of motions is around.
            wall: a `HoleWall` or `HoleRing` of the scene; None where only one is around the station.

        Raises:
            SceneError: another wall, another station, or no wall.
        """
        return orbit_of(self, station, wall)

    def whirl(self, station: StationOrName, wall: Action | None = None, since: float | None = None) -> Whirl:
        """How a section whirls in its hole: rate, ratio to the spin, radius, contact; `print` shows it with units.

        Args:
            station, wall: see `orbit`.
            since: the time from which on, s; None for the whole motion.

        Raises:
            SceneError: see `orbit`; or a time that leaves fewer than two states.
        """
        return whirl(self, station, wall, since)

    def plot_orbit(
        self,
        station: StationOrName,
        wall: Action | None = None,
        file: File | None = None,
        *,
        units: Any = "SI",
        width: int | None = None,
    ):
        """Chart of a section's orbit in the circle of the clearance, seen down the hole, coloured by time.

        Args:
            station, wall: see `orbit`.
            file, units, width: see `plot_energy`.
        """
        return self.orbit(station, wall).plot(file, units=units, width=width)

    def plot_whirl(
        self,
        station: StationOrName,
        wall: Action | None = None,
        file: File | None = None,
        *,
        units: Any = "SI",
        width: int | None = None,
    ):
        """Chart over time of a section's distance from the axis of the hole, of its rates of whirl and spin, and of the
        wall's normal force.

        Args: see `plot_orbit`.
        """
        return self.orbit(station, wall)._drawn("pictures.motion_charts.whirl_figure", file, units, width)

    def plot_campbell(
        self,
        station: StationOrName,
        wall: Action | None = None,
        file: File | None = None,
        *,
        units: Any = "SI",
        width: int | None = None,
    ):
        """Campbell diagram of a section over a run-up: amplitude of whirl and its spectrum, forward and backward, over
        the speed of rotation.

        Args: see `plot_orbit`.

        Raises:
            SceneError: the speed of rotation hardly changes, or too few times are saved.
        """
        return self.orbit(station, wall)._drawn("pictures.motion_charts.campbell_figure", file, units, width)

    def _at_clamp(self, point, joined):
        return self._stacked("clamp_forces")[:, point]

    def _viscous(self, which, rod):
        return super()._viscous(which, rod) if rod.damping is None else viscous_contact(self, which, rod)

    # n and m at the nodes are extrapolated by the polynomials through the Gauss points

    @property
    def _from_gauss(self):
        return self.rule.between_gauss(self.rule.nodes)

    def _contact_of(self, k):
        return np.einsum("jg,cgi->cji", self._from_gauss, self._records[k].gauss_fields[..., :6])

    def _contact_in(self, cell):
        return np.einsum("jg,kgi->kji", self._from_gauss, self._stacked("gauss_fields")[:, cell, :, :6])


def _named(scene):
    """The ends of all rods and the stations of supports, loads and joints, without repetitions."""
    places = {}
    for rod in scene.rods:
        for station in (rod.start, *scene.stations(rod), rod.end):
            places.setdefault(tuple(np.round(rod.curve.position(station.s), 9)), station)
    return places.values()
