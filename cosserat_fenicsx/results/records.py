"""What a path is made of: equilibria, and what was met between them."""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Record:
    """One equilibrium, dimensionless: (r, q) at the nodes (N, 7), (n, m, r') at the Gauss points (cells, points, 9),
    and the reactions of the equations that supports and joints add; whether a motion is neutral there, see `Track`;
    force and moment per length of what acts along rods, at the Gauss points and at the nodes, see `models.densities`;
    force and moment, inertial, that each of those equations exerts on its two stations (equations, 2, 6), and of what
    acts at every clamped point (points, 6), both in the order of `Connections`.

    A record that is appended to a path may hold its model's own numbers; the path's `expand` makes these of them.
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
            unloaded state, 1e-5 at most, or the event is not listed. It is 1/(v S^-1 v) against a motion v, with S the
            tangent in displacements and rotations. It hardly depends on the mesh; where the stiffness decreases in
            proportion to the load, as that of a straight column does, it is the relative error of the load factor.
        error: relative difference of the load factor to that of the same event on the mesh before; NaN where the mesh
            was given.
    """

    kind: str
    load_factor: float
    mode: np.ndarray = field(repr=False)
    after: int
    residual: float = np.nan
    error: float = np.nan
