"""States of paths and motions, and the events of a path, which are found again on finer meshes."""

import dataclasses
from collections import namedtuple
from dataclasses import dataclass, field, fields
from typing import Self

import numpy as np


@dataclass
class Record:
    """One equilibrium, dimensionless and in inertial components.

    A record that is appended to a path may hold the arrays of its model's `snapshot` in `rq` and `gauss_fields`; the
    path converts them by the model's `expansion`.

    Attributes:
        rq: (N, 7) r and q at the nodes.
        gauss_fields: (elements, points, 9) n, m and r' at the Gauss points.
        negative_modes, iterations: see `Path`.
        reactions: multipliers of the constraint equations of supports and joints.
        neutral: whether a motion is neutral there, see `Track`.
        densities: force and moment per length along rods, at the Gauss points and at the nodes, see `models.densities`.
        tie_forces: (equations, 2, 6) force and moment that each constraint equation exerts on its two stations.
        clamp_loads: (points, 6) force and moment of the loads at every clamped point. Both are in the order of
            `Connections`.
        steps: see `Path`.
        rod_forces: (elements, p + 1, 3) forces at the nodes of elements, by other rods that touch them; or None.
    """

    load_factor: float
    rq: np.ndarray
    gauss_fields: np.ndarray | None
    negative_modes: int
    iterations: int
    reactions: np.ndarray
    neutral: bool = False
    densities: tuple = (None, None)
    tie_forces: np.ndarray | None = None
    clamp_loads: np.ndarray | None = None
    steps: int = 0
    rod_forces: np.ndarray | None = None


#: Energies (J), work and dissipation since the start (J), linear and angular momentum (kg m/s, kg m^2/s), inertial, the
#: latter about the inertial origin.
Ledger = namedtuple("Ledger", "kinetic strain work dissipated linear_momentum angular_momentum")


@dataclass
class Instant(Record):
    """A `Record` at a time (s).

    Attributes:
        rates: velocities and angular velocities of the nodes (N, 6), dimensionless, inertial.
        steps: number of steps since the start.
        ledger: the `Ledger`.
        clamp_forces: force and moment (points, 6) that held every clamped point in the last step, dimensionless,
            inertial: those of the clamp and of other supports and joints together; NaN where no step led to the state.
        wall_forces: (touching nodes, 3) see `at_walls.WallForces`, dimensionless, wall by wall and rod by rod; NaN
            likewise.
        far_ends: (actions, n), n from 4 on, of actions that depend on earlier motion, see `Action.delayed`, SI units;
            NaN likewise.
    """

    time: float = 0.0
    rates: np.ndarray = None
    steps: int = 0
    ledger: Ledger = None
    clamp_forces: np.ndarray = None
    wall_forces: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    far_ends: np.ndarray = field(default_factory=lambda: np.empty((0, 4)))


@dataclass(frozen=True, eq=False)
class Records:
    """States as arrays over them.

    Attributes:
        kind: the class of one, `Record` or `Instant`.
        columns: {field of it: array (n, ...)}, a tuple of arrays where the fields are tuples; None where they are None.
    """

    kind: type
    columns: dict

    @classmethod
    def of(cls, records):
        """Those of a list of records of one class, at least one."""
        kind = type(records[0])
        return cls(kind, {x.name: _along([getattr(r, x.name) for r in records], np.array) for x in fields(kind)})

    @classmethod
    def joined(cls, parts):
        """Several one after another."""
        if len(parts) == 1:
            return parts[0]
        names = parts[0].columns
        return cls(parts[0].kind, {name: _along([part[name] for part in parts], np.concatenate) for name in names})

    def __len__(self):
        return len(self["load_factor"])

    def __getitem__(self, name):
        return self.columns[name]

    def at(self, which) -> Self:
        """Those with the indices `which`, copied."""
        which = np.asarray(which, dtype=int)
        return type(self)(self.kind, {name: _taken(values, which) for name, values in self.columns.items()})

    def listed(self):
        """A list of the records, which share the arrays."""
        columns = self.columns.items()
        return [self.kind(**{name: _taken(values, k) for name, values in columns}) for k in range(len(self))]


def _along(values, join):
    """Values of many records, or of parts of them, as one."""
    if isinstance(values[0], tuple):
        return _like(values[0], (_along(part, join) for part in zip(*values, strict=True)))
    return None if values[0] is None else join(values)


def _taken(values, which):
    if isinstance(values, tuple):
        return _like(values, (_taken(part, which) for part in values))
    taken = None if values is None else values[which]
    return taken.item() if isinstance(taken, np.generic) else taken


def _like(values, parts):
    """A tuple of parts, named as another one."""
    return values._make(parts) if hasattr(values, "_make") else tuple(parts)


@dataclass(frozen=True, eq=False, repr=False)
class Event:
    """A limit point, a bifurcation, or the onset of flutter on a path.

    Attributes:
        kind: "limit", where the load factor turns, "bifurcation", where another path crosses, or "flutter" (of
            `Path.modes`), where a vibration begins to grow.
        load_factor: located to a relative 1e-6.
        mode: (N, 3) displacements, inertial, of all nodes of all rods in the scene's order, the largest of length 1:
            the path's own direction at a limit point, the buckling mode at a bifurcation, the mode that grows in
            flutter. `Path.mode` picks a rod.
        after: index of the path's last point before it; -1 where there is none.
        residual: how nearly the tangent is singular: the stiffness against the mode at the event over that in the
            unloaded state; events with more than 1e-5 are not listed. The stiffness against a motion v is
            1/(v S^-1 v), with S the tangent in displacements and rotations. The ratio hardly depends on the mesh; where
            the stiffness decreases linearly with the load, as of a straight column, it is the relative error
            of the load factor. Of flutter: the growth rate over the size of the eigenvalue.
        error: relative difference of the load factor from the same event on the previous mesh; NaN where the
            mesh was given.
        stage: see `Path`.
    """

    kind: str
    load_factor: float
    mode: np.ndarray
    after: int
    residual: float = np.nan
    error: float = np.nan
    stage: int = -1

    def __repr__(self):
        words = {"limit": "limit point"}.get(self.kind, self.kind)
        return f"<{words} at load factor {self.load_factor:.7g}, after point {self.after}>"


def lost_at(path):
    """Where a path with events loses its stability first, and what to ask for, in words."""
    first = path.events[0]
    ahead = "" if path.left else ", or branch=1 or -1 for what a structure does that buckles there"
    ahead = ahead if first.kind == "bifurcation" else ""
    return (
        f"It loses its stability at the load factor {first.load_factor:.7g} ({first.kind}): ask for load factors up to "
        f"there{ahead}"
    )


# Largest relative difference of the load factors of corresponding events on two meshes.
_SAME = 1e-2
_KINDS = {"limit": "a limit point", "bifurcation": "a bifurcation"}
#: All kinds of events, as files number them.
KINDS = ("bifurcation", "limit", "flutter")
# Differences are relative to the event's load factor, or to this times the largest one of the path if that is larger:
# near zero, events are located to a share of the steps there (`Search.fine`).
_LEAST = 1e-2


def find_again(fine, coarse):
    """Set the `error` of a path's events from those on a coarser mesh; returns those there without a counterpart."""
    left, least = list(coarse.events), _LEAST * float(np.abs(fine.load_factors).max(initial=0.0))

    def apart(event, other):
        return abs(event.load_factor - other.load_factor) / max(abs(event.load_factor), least)

    for k, event in enumerate(fine.events):
        alike = (x for x in left if (x.kind, x.stage) == (event.kind, event.stage))
        near = min(alike, key=lambda other: apart(event, other), default=None)
        error = np.nan
        if near is not None and apart(event, near) < _SAME:
            left.remove(near)
            error = apart(event, near)
        fine.events[k] = dataclasses.replace(event, error=error)
    return left


def keep_confirmed(path, largest, left):
    """Remove the events whose `error` is unknown or larger than `largest` from a path's list, and report them in its
    `why`; left: events of a coarser mesh without a counterpart."""
    unsure = [event for event in path.events if not event.error <= largest]
    path.events = [event for event in path.events if event.error <= largest]
    meshes = [(event, "could not be confirmed on another mesh") for event in unsure]
    meshes += [(event, "of a coarser mesh was not found again on a finer one") for event in left]
    for event, what in meshes:
        apart = f" (load factors that differ by {event.error:.1g})" if np.isfinite(event.error) else ""
        where = f"{_KINDS[event.kind]} near the load factor {event.load_factor:.6g}"
        path.why.append(f"{where} {what}{apart}: it is not listed")
