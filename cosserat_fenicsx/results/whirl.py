"""Rods in holes in motion: forces of walls, orbits of sections in the hole, and their whirl."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import File, number, refuse
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.results.compared import in_turn
from cosserat_fenicsx.results.result import Result, by_name


@dataclass(frozen=True, eq=False)
class WallForces:
    """Forces of a wall on m nodes at n states of a motion, N.

    Attributes:
        s: (m,) arc length of the nodes, m; of all rods that the wall acts along, one after another.
        normal: (n, m) towards the axis of the hole.
        around: (n, m) friction round the axis, by a right-handed rotation about its tangent.
        along: (n, m) friction along the axis.
    """

    s: np.ndarray
    normal: np.ndarray
    around: np.ndarray
    along: np.ndarray


def wall_forces(history, wall):
    """See `History.wall_forces`."""
    walls = _walls(history, wall, "wall_forces")
    places = [np.concatenate(_touched(history, one)) for one in walls]
    own = next(k for k, one in enumerate(walls) if one is wall)
    found = history._stacked("wall_forces")[:, in_turn(map(len, places))[own]]
    return WallForces(places[own], *np.moveaxis(history.scales.force * found, 2, 0))


def _walls(history, wall, where, *, optional=False):
    """The walls of the scene that act in motions; refuses a `wall` that is none of them, but None if it is optional."""
    walls = [action for action in history.scene.actions if action.touches]
    if not (optional and wall is None) and not any(wall is one for one in walls):
        refuse(where, "wall", wall, "a wall of the scene that acts in motions, such as a HoleWall")
    return walls


def _touched(history, wall):
    """For every rod (m,) arc lengths of the nodes that may touch a wall, m."""
    if wall.station is not None:
        return [np.full(int(wall.station.rod is rod), wall.station.s) for rod in history.scene.rods]
    nodes = zip(history.scene.rods, history.layout.node_s(history.rule.nodes), strict=True)
    return [x * rod.length if wall.acts_on(rod) else np.empty(0) for rod, x in nodes]


# A hole whose inclination has a smaller sine counts as vertical: its high side is not defined well.
_VERTICAL = 0.05
# Share of the largest radius below which the angle of an orbit is not counted.
_NEAR_AXIS = 0.01
_IN_SECTION = {"parts": ("up", "right"), "frame": "cross-section of the hole, seen down the hole, its high side up"}
_ACROSS = {"shown": "mm", "dimension": "diameter"}


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(Result):
    """The axis of a section in the cross-section of a hole, at n times of a motion.

    The two axes of the cross-section: the first points to the high side of the hole (north where the hole is vertical),
    the second is the tangent of the hole's axis times the first. Seen down the hole the first is up, the second to the
    right, and positive angles and rates are clockwise: right-handed about the tangent.

    Attributes:
        times: (n,) s.
        position: (n, 2) of the rod's axis from the axis of the hole, m.
        velocity: (n, 2) m/s.
        clearance: (n,) radius of the hole minus radius of the rod, m.
        spin: (n,) rate of rotation of the section about the tangent, rad/s.
        contact_radius: of the rod's surface, m.
        normal: (n,) normal force of the wall on the node of the mesh nearest to the section, N, in the step that led to
            the state; NaN where none did.
        vertical: whether the hole is vertical there, so that the first axis points north.
        place: title of the motion and the station, for titles of charts.
        comm: the MPI communicator whose rank 0 writes files; None for all ranks.
    """

    times: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    clearance: np.ndarray
    spin: np.ndarray
    contact_radius: float
    normal: np.ndarray
    vertical: bool = True
    place: tuple[str, str] = ("Motion", "a section")
    comm: object = None

    _quantities = by_name(
        Quantity("time", unit="s", getter="times"),
        Quantity("position", "position in the hole", "m", **_IN_SECTION, **_ACROSS, digits=5),
        Quantity("velocity", "velocity in the hole", "m/s", **_IN_SECTION, digits=4),
        Quantity("radius", "distance from the axis", "m", **_ACROSS, digits=5),
        Quantity("clearance", unit="m", **_ACROSS, digits=5),
        Quantity("spin", unit="rad/s", shown="rpm", digits=5),
        Quantity("normal", "normal force of the wall", "N", dimension="force", digits=4),
        Quantity("contact_radius", unit="m", axes=(), **_ACROSS),
        Quantity("vertical", axes=()),
    )
    _on_screen = ("time", "position", "radius", "clearance", "spin", "normal")

    def __len__(self):
        return len(self.times)

    def __getstate__(self):
        return {name: value for name, value in vars(self).items() if name != "comm"}

    def __repr__(self):
        reach = f"t = {self.times[0]:g} .. {self.times[-1]:g} s" if len(self) else "empty"
        return f"<Orbit of {self.place[1]}: {len(self)} times, {reach}>"

    @property
    def _ranks(self):
        return self.comm or world()

    def _answer(self, units):
        yield f"{self.place[0]}: {self.place[1]} in the cross-section of its hole, seen down the hole."
        if len(self):
            largest, least = (self._told("radius", units, x) for x in (self.radius.max(), self.clearance.min()))
            yield f"The largest distance from the axis is {largest}, the smallest clearance {least}."
            yield f"Up is {'north' if self.vertical else 'the high side of the hole'}."

    def plot(self, file: File | None = None, *, units: Any = "SI", width: int | None = None):
        """Chart of the orbit in the circle of the clearance, seen down the hole, coloured by time.

        Args:
            file, units, width: see `History.plot_energy`.
        """
        return self._drawn("pictures.motion_charts.orbit_figure", file, units, width)

    @property
    def radius(self) -> np.ndarray:
        """(n,) distance from the axis of the hole, m."""
        return np.hypot(*self.position.T)

    @property
    def turns(self) -> np.ndarray:
        """(n - 1,) whether the angle is counted between two times: the radius is above a hundredth of the largest."""
        far = self.radius > _NEAR_AXIS * self.radius.max(initial=0.0)
        return far[1:] & far[:-1]

    @property
    def steps(self) -> np.ndarray:
        """(n - 1,) change of the angle between two times, rad; 0 where it is not counted.

        Of all changes that lead to the same place it is the nearest to the prediction of the velocities, so that whole
        turns between two times are counted.
        """
        return self._predicted + self._remainder

    @property
    def resolved(self) -> bool:
        """Whether the times are close enough to count turns: the velocities predict all changes of the angle to a
        quarter of a turn."""
        return bool(np.abs(self._remainder).max(initial=0.0) < np.pi / 2)

    @property
    def _predicted(self):
        (x, y), (u, v) = self.position.T, self.velocity.T
        squares = np.maximum(x * x + y * y, np.finfo(float).tiny)
        rate = (x * v - y * u) / squares
        return np.where(self.turns, np.diff(self.times) * (rate[1:] + rate[:-1]) / 2, 0.0)

    @property
    def _remainder(self):
        change = np.diff(np.arctan2(self.position[:, 1], self.position[:, 0])) - self._predicted
        return np.where(self.turns, (change + np.pi) % (2 * np.pi) - np.pi, 0.0)

    def _means(self, windows=1, least=0.0):
        """Means (m,) over parts of the duration: middle (s), rates of whirl and spin (rad/s), radius (m)."""
        count, lengths = len(self.times) - 1, np.diff(self.times)
        edges = np.unique(np.linspace(0, count, min(windows, count) + 1).astype(int))

        def whole(values):
            return np.add.reduceat(values, edges[:-1])

        counted, duration = whole(lengths * self.turns), whole(lengths)
        unknown = np.full(len(counted), np.nan)
        rate = np.divide(whole(self.steps), counted, out=unknown, where=counted > least * duration)
        spin, radius = (whole(lengths * (x[1:] + x[:-1]) / 2) / duration for x in (self.spin, self.radius))
        at = (self.times[edges[1:]] + self.times[edges[:-1]]) / 2
        return at, rate * np.where(spin < 0, -1.0, 1.0), spin, radius

    def since(self, time: float) -> "Orbit":
        """The orbit from a time (s) on."""
        rows = self.times >= time
        arrays = {name: x[rows] for name, x in vars(self).items() if isinstance(x, np.ndarray)}
        return Orbit(**{**vars(self), **arrays})


def orbit_of(history, station, wall=None, where="orbit"):
    """See `History.orbit`."""
    station = history.station(station)
    wall = wall_around(history, station, wall, where)
    points = history.position(station)
    s = np.full(len(points), station.s)
    around = wall.tube_around(s, points, s + wall.begins)
    tangent, away = around.tangent, points - around.position
    down = np.array([0.0, 0.0, 1.0])
    vertical = bool(np.linalg.norm(np.cross(tangent[0], down)) < _VERTICAL)
    first = np.array([1.0, 0.0, 0.0]) if vertical else -down
    first = first - np.outer(tangent @ first, np.ones(3)) * tangent
    first /= np.linalg.norm(first, axis=1)[:, None]
    axes = np.stack([first, np.cross(tangent, first)], axis=1)
    return Orbit(
        times=history.times,
        position=np.einsum("nij,nj->ni", axes, away),
        velocity=np.einsum("nij,nj->ni", axes, history.velocity(station)),
        clearance=around.clearance,
        spin=np.einsum("ni,ni->n", tangent, history.angular_velocity(station)),
        contact_radius=float(around.arm[0]),
        normal=wall_forces(history, wall).normal[:, _node(history, wall, station)],
        vertical=vertical,
        place=(history.scene.title or "Motion", str(station)),
        comm=history.comm,
    )


def wall_around(history, station, wall, where):
    """The wall of motions around a station: the one given, which is checked, or the only one."""
    walls = _walls(history, wall, where, optional=True)
    here = [one for one in walls if (one.station == station if one.station is not None else one.acts_on(station.rod))]
    if wall is None:
        if len(here) != 1:
            raise SceneError(
                f"{where}.wall: expected one of the scene's walls of motions, such as a HoleWall; "
                f"{len(here)} are around {station}"
            )
        return here[0]
    if not any(wall is one for one in here):
        refuse(where, "station", station, "a station that the wall is around")
    return wall


def _node(history, wall, station):
    """The number of the node nearest to a station among those that may touch a wall."""
    places, i = _touched(history, wall), history.scene.rods.index(station.rod)
    return in_turn(map(len, places))[i].start + int(np.argmin(np.abs(places[i] - station.s)))


# A section that stays within this share of the clearance from the axis does not whirl.
_LITTLE = 1e-3


def _of_whirl(name, label="", unit="1", **more):
    """A quantity of the one row of a `Whirl`."""
    return Quantity(name, label, unit, axes=("section",), getter=lambda found: np.array([getattr(found, name)]), **more)


@dataclass(frozen=True, repr=False)
class Whirl(Result):
    """The whirl of a section between two times. All means are over time.

    Attributes:
        since, until: s.
        rate: mean rate at which the section's axis goes round the hole's axis, rad/s: positive in the direction of the
            spin (forward whirl), negative against it (backward whirl). Found from the angle that it covers, without the
            times when it is nearer to the axis than a hundredth of the largest radius; NaN where it has no angle.
        spin: mean rate of rotation of the section about the axis of the hole, right-handed about its tangent, rad/s.
        radius, largest: mean and largest distance from the axis, m.
        clearance: smallest clearance, m.
        contact_radius: of the rod's surface, m.
        contact: share of the time in contact.
        force: (smallest, mean, largest) normal force of the wall on the nearest node of the mesh while it is in
            contact, N; zeros without contact.
        resolved: False where states were saved too seldom to count the turns.
        orbit: the `Orbit` that it is of.
    """

    since: float
    until: float
    rate: float
    spin: float
    radius: float
    largest: float
    clearance: float
    contact_radius: float
    contact: float
    force: tuple[float, float, float]
    resolved: bool
    orbit: Orbit | None = field(default=None, compare=False)

    _rows_axis = "section"
    _quantities = by_name(
        _of_whirl("since", unit="s"),
        _of_whirl("until", unit="s"),
        _of_whirl("direction"),
        _of_whirl("rate", "rate of whirl", "rad/s", shown="rpm", digits=5, short="whirl"),
        _of_whirl("spin", unit="rad/s", shown="rpm", digits=5),
        _of_whirl("ratio", "rate over spin", digits=5, short="ratio"),
        _of_whirl("rolling", "ratio of rolling without slip", digits=5, short="rolling"),
        _of_whirl("radius", "mean radius", "m", **_ACROSS, digits=4),
        _of_whirl("largest", "largest radius", "m", **_ACROSS, digits=4),
        _of_whirl("clearance", unit="m", **_ACROSS, digits=4),
        _of_whirl("contact_radius", unit="m", **_ACROSS, digits=4),
        _of_whirl("contact", "share of the time in contact", digits=3, short="in contact"),
        _of_whirl("force", "normal force", "N", parts=("smallest", "mean", "largest"), dimension="force", digits=4),
        _of_whirl("resolved"),
    )
    _on_screen = ("rate", "spin", "ratio", "rolling", "radius", "largest", "clearance", "contact")

    def __len__(self):
        return 1

    @property
    def _ranks(self):
        return self.orbit._ranks if self.orbit is not None else world()

    @property
    def ratio(self) -> float:
        """The rate over the size of the spin: 1 in synchronous whirl, negative backward; NaN without spin."""
        return self.rate / abs(self.spin) if self.spin else np.nan

    @property
    def rolling(self) -> float:
        """The ratio of backward rolling without slip at this radius: minus the contact radius over the radius."""
        return -self.contact_radius / self.radius if self.radius > _LITTLE * self.clearance else np.nan

    @property
    def direction(self) -> str:
        """Which way it goes round: "forward", "backward", or "none" where it stays within a thousandth of the clearance
        from the axis."""
        if np.isnan(self.rate) or self.rate == 0 or self.largest <= _LITTLE * self.clearance:
            return "none"
        return "forward" if self.rate > 0 else "backward"

    def __repr__(self):
        return f"<Whirl: {self.direction}, rate {self.rate:.5g} rad/s, spin {self.spin:.5g} rad/s>"

    def _answer(self, units):
        rate, spin = (f"{value:.5g} rad/s ({self._told(name, units, value, '.4g')})"
                      for name, value in (("rate", self.rate), ("spin", self.spin)))  # fmt: skip
        whirls = self.direction != "none"
        yield (
            f"From {self.since:g} to {self.until:g} s: "
            f"{f'{self.direction} whirl at {rate}' if whirls else 'no whirl'}, spin {spin}."
        )
        if whirls and not np.isnan(self.ratio):
            yield f"Rate over spin {self.ratio:.4f}; rolling without slip: {self.rolling:.4f}."
        mean, most, clearance = (
            self._told("radius", units, x, ".4g") for x in (self.radius, self.largest, self.clearance)
        )
        yield f"The radius is {mean} in the mean, {most} at most, of a clearance of {clearance}."
        if self.contact:
            unit, size = units.on_screen(self.quantities["force"], self.force)
            low, mean, high = (f"{x / size:.4g}" for x in self.force)
            force = f"normal force {low} to {high} {unit}, mean {mean} {unit}"
            yield f"It is in contact {100 * self.contact:.3g} % of the time, {force}."
        else:
            yield "It has no contact."
        if not self.resolved:
            yield "States were saved too seldom to count the turns: the rate is uncertain."

    def _more(self, units):
        yield "Rates are positive in the direction of the spin. Rolling: -(contact radius)/(mean radius)."

    def plot(self, file: File | None = None, *, units: Any = "SI", width: int | None = None):
        """Chart over time of the distance from the axis of the hole, of the rates of whirl and spin, and of the wall's
        normal force.

        Args:
            file, units, width: see `History.plot_energy`.

        Raises:
            SceneError: the Whirl was made without its orbit.
        """
        if self.orbit is None:
            raise SceneError("plot: expected a Whirl with its orbit, as History.whirl returns it")
        return self.orbit._drawn("pictures.motion_charts.whirl_figure", file, units, width)


def whirl(history, station, wall=None, since=None):
    """See `History.whirl`."""
    found = orbit_of(history, station, wall, "whirl")
    if len(found.times) < 2:
        raise SceneError("whirl: expected a motion with at least two times")
    first, last = float(found.times[0]), float(found.times[-1])
    if since is not None:
        before = float(found.times[-2])
        since = number("whirl", "since", since, f"a time (s), at most {before:g}, the last but one saved",
                       lambda t: t <= before)  # fmt: skip
    return whirl_of(found.since(first if since is None else since), last)


def whirl_of(orbit, until=None):
    """The `Whirl` of an `Orbit` of at least two times."""
    lengths, (_, *means) = np.diff(orbit.times), orbit._means()
    rate, spin, radius = (float(mean[0]) for mean in means)
    touching = orbit.normal > 0  # unknown counts as none
    force = orbit.normal[touching]
    return Whirl(
        since=float(orbit.times[0]),
        until=float(orbit.times[-1] if until is None else until),
        rate=rate,
        spin=spin,
        radius=radius,
        largest=float(orbit.radius.max()),
        clearance=float(orbit.clearance.min()),
        contact_radius=orbit.contact_radius,
        contact=float(lengths @ touching[1:] / lengths.sum()),  # a force belongs to the step before its state
        force=(float(force.min()), float(force.mean()), float(force.max())) if len(force) else (0.0, 0.0, 0.0),
        resolved=orbit.resolved,
        orbit=orbit,
    )
