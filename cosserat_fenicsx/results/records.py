"""The contents of a path: equilibria, and the events between them."""

from dataclasses import dataclass, field

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


@dataclass(frozen=True, eq=False)
class Event:
    """A limit point or a bifurcation of a path.

    Attributes:
        kind: "limit", where the load factor turns, or "bifurcation", where another path crosses.
        load_factor: located to a relative 1e-6.
        mode: (N, 3) displacements, inertial, of all nodes of all rods in the scene's order, the largest of length 1:
            the path's own direction at a limit point, the buckling mode at a bifurcation. `Path.mode` picks a rod.
        after: index of the path's last point before it; -1 where there is none.
        residual: how nearly the tangent is singular: the stiffness against the mode at the event over that in the
            unloaded state; events with more than 1e-5 are not listed. The stiffness against a motion v is
            1/(v S^-1 v), with S the tangent in displacements and rotations. The ratio hardly depends on the mesh; where
            the stiffness decreases linearly with the load, as that of a straight column does, it is the relative error
            of the load factor.
        error: relative difference of the load factor from that of the same event on the previous mesh; NaN where the
            mesh was given.
    """

    kind: str
    load_factor: float
    mode: np.ndarray = field(repr=False)
    after: int
    residual: float = np.nan
    error: float = np.nan
