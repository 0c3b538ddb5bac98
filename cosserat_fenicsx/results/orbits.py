"""The orbit of a section in a hole: where the axis of a rod moves, as seen along the axis of the hole."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.results.at_walls import wall_forces

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
