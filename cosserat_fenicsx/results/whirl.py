"""Rods in holes in motion: forces of walls, orbits of sections in the hole, and their whirl."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.errors import SceneError


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
    scene, first = history.scene, 0
    touched = [action for action in scene.actions if action.touches]
    if not any(wall is other for other in touched):
        refuse("wall_forces", "wall", wall, "a wall of the scene that acts in motions, such as a HoleWall")
    for other in touched:
        s = np.concatenate([_nodes(history, other, i, rod) for i, rod in enumerate(scene.rods)])
        if other is wall:
            found = history.scales.force * history._stacked("wall_forces")[:, first : first + len(s)]
            return WallForces(s, *np.moveaxis(found, 2, 0))
        first += len(s)


def _nodes(history, wall, i, rod):
    """(m,) arc lengths of the nodes of a rod, the i-th, that may touch a wall."""
    if wall.station is not None:
        return np.full(int(wall.station.rod is rod), wall.station.s)
    return history.layout.node_s(history.rule.nodes)[i] * rod.length if wall.acts_on(rod) else np.empty(0)


# A hole whose inclination has a smaller sine counts as vertical: its high side is not defined well.
_VERTICAL = 0.05
# Below this share of the largest radius an orbit has no angle worth counting.
_NEAR_AXIS = 0.01


@dataclass(frozen=True, eq=False)
class Orbit:
    """The axis of a section in the cross-section of a hole, at n times of a motion.

    The two axes of the cross-section: the first points to the high side of the hole (north where the hole is vertical),
    the second is the tangent of the hole's axis times the first. Seen down the hole the first is up, the second to the
    right, and positive angles and rates are clockwise: right-handed about the tangent.

    Attributes:
        times: (n,) s.
        position: (n, 2) of the rod's axis from that of the hole, m.
        velocity: (n, 2) m/s.
        clearance: (n,) radius of the hole minus that of the rod, m.
        spin: (n,) rate of rotation of the section about the tangent, rad/s.
        contact_radius: of the rod's surface, m.
        normal: (n,) normal force of the wall on the node of the mesh nearest to the section, N, in the step that led to
            the state; NaN where none did.
        vertical: whether the hole is vertical there, so that the first axis points north.
    """

    times: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    clearance: np.ndarray
    spin: np.ndarray
    contact_radius: float
    normal: np.ndarray
    vertical: bool = True

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

        Of all changes that lead to the same place that nearest to the one foretold by the velocities, so that whole
        turns between two times are counted.
        """
        return self._foretold + self._beside

    @property
    def resolved(self) -> bool:
        """Whether the times are close enough to count turns: the changes of the angle are those foretold by the
        velocities to a quarter of a turn."""
        return bool(np.abs(self._beside).max(initial=0.0) < np.pi / 2)

    @property
    def _foretold(self):
        (x, y), (u, v) = self.position.T, self.velocity.T
        squares = np.maximum(x * x + y * y, np.finfo(float).tiny)
        rate = (x * v - y * u) / squares
        return np.where(self.turns, np.diff(self.times) * (rate[1:] + rate[:-1]) / 2, 0.0)

    @property
    def _beside(self):
        change = np.diff(np.arctan2(self.position[:, 1], self.position[:, 0])) - self._foretold
        return np.where(self.turns, (change + np.pi) % (2 * np.pi) - np.pi, 0.0)

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
    forces = wall_forces(history, wall)
    return Orbit(
        times=history.times,
        position=np.einsum("nij,nj->ni", axes, away),
        velocity=np.einsum("nij,nj->ni", axes, history.velocity(station)),
        clearance=around.clearance,
        spin=np.einsum("ni,ni->n", tangent, history.angular_velocity(station)),
        contact_radius=float(around.arm[0]),
        normal=forces.normal[:, _node(history, wall, station, forces.s)],
        vertical=vertical,
    )


def wall_around(history, station, wall, where):
    """The wall of motions around a station: the one given, or the only one.

    Raises:
        SceneError: it is none of the scene, not around that station; or there is not exactly one.
    """
    walls = [action for action in history.scene.actions if action.touches]
    here = [one for one in walls if (one.station == station if one.station is not None else one.acts_on(station.rod))]
    if wall is None:
        if len(here) != 1:
            raise SceneError(
                f"{where}.wall: expected one of the scene's walls of motions, such as a HoleWall; "
                f"{len(here)} are around {station}"
            )
        return here[0]
    if not any(wall is one for one in walls):
        refuse(where, "wall", wall, "a wall of the scene that acts in motions, such as a HoleWall")
    if not any(wall is one for one in here):
        refuse(where, "station", station, "a station that the wall is around")
    return wall


def _node(history, wall, station, places):
    """The number of the node nearest to a station among those at arc lengths `places` of all rods that touch a wall."""
    if wall.station is not None:
        return 0
    first = 0
    for i, rod in enumerate(history.scene.rods):
        count = len(history.layout.node_s(history.rule.nodes)[i]) if wall.acts_on(rod) else 0
        if rod is station.rod:
            return first + int(np.argmin(np.abs(places[first : first + count] - station.s)))
        first += count


_RPM = 30 / np.pi
# A section that stays within this share of the clearance from the axis does not whirl.
_LITTLE = 1e-3


@dataclass(frozen=True)
class Whirl:
    """The whirl of a section between two times. All means are over time.

    Attributes:
        since, until: s.
        rate: mean rate at which the section's axis goes round that of the hole, rad/s: positive in the direction of the
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

    def __str__(self):
        when = f"From {self.since:g} to {self.until:g} s"
        spin = f"spin {self.spin:.4g} rad/s ({self.spin * _RPM:.4g} rpm)"
        radius = f"radius {1e3 * self.radius:.4g} mm in the mean, {1e3 * self.largest:.4g} mm at most, of a clearance "
        radius += f"of {1e3 * self.clearance:.4g} mm"
        if self.direction == "none":
            what = f"no whirl, {spin}"
        else:
            ratio = (
                "" if np.isnan(self.ratio) else f", ratio {self.ratio:.4f} (rolling without slip: {self.rolling:.4f})"
            )
            what = f"{self.direction} whirl at {self.rate:.5g} rad/s ({self.rate * _RPM:.4g} rpm), {spin}{ratio}"
        contact = "no contact"
        if self.contact:
            low, mean, high = (x / 1e3 for x in self.force)
            contact = f"in contact {100 * self.contact:.3g} % of the time, normal force {low:.4g} to {high:.4g} kN, "
            contact += f"mean {mean:.4g} kN"
        doubt = "" if self.resolved else " States were saved too seldom to count the turns: the rate is uncertain."
        return f"{when}: {what}; {radius}; {contact}.{doubt}"


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
    lengths = np.diff(orbit.times)
    counted, whole = lengths @ orbit.turns, lengths.sum()
    spin = _mean(orbit.spin, lengths)
    rate = orbit.steps.sum() / counted if counted > 0 else np.nan
    touching = orbit.normal > 0  # unknown counts as none
    force = orbit.normal[touching]
    return Whirl(
        since=float(orbit.times[0]),
        until=float(orbit.times[-1] if until is None else until),
        rate=float(rate * (-1.0 if spin < 0 else 1.0)),
        spin=spin,
        radius=_mean(orbit.radius, lengths),
        largest=float(orbit.radius.max()),
        clearance=float(orbit.clearance.min()),
        contact_radius=orbit.contact_radius,
        contact=float(lengths @ touching[1:] / whole),  # a force is that of the step before its state
        force=(float(force.min()), float(force.mean()), float(force.max())) if len(force) else (0.0, 0.0, 0.0),
        resolved=orbit.resolved,
    )


def _mean(values, lengths):
    """Over time, by trapezoids."""
    return float(lengths @ (values[1:] + values[:-1]) / 2 / lengths.sum())
