"""What a path is made of: equilibria, and what was met between them."""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Record:
    """One equilibrium, dimensionless: (r, q) at the nodes (N, 7), (n, m, r') at the Gauss points (cells, points, 9), and
    the reactions of the equations that supports and joints add; whether a motion is neutral there, see `Track`.

    A record that is appended to a path may hold its model's own numbers; the path's `expand` makes these of them.
    """

    load_factor: float
    rq: np.ndarray
    gauss_fields: np.ndarray | None
    negative_modes: int
    iterations: int
    reactions: np.ndarray
    neutral: bool = False


@dataclass(frozen=True, eq=False)
class Event:
    """A limit point or a bifurcation of a path.

    Attributes:
        kind: "limit", where the load factor turns, or "bifurcation", where another path crosses.
        load_factor: located to a relative 1e-6.
        mode: (N, 3) displacements, inertial, of all nodes of all rods in the scene's order, the largest of length 1: the
            path's own direction at a limit point, the buckling mode at a bifurcation. `Path.mode` picks a rod.
        after: index of the path's last point before it; -1 where there is none.
    """

    kind: str
    load_factor: float
    mode: np.ndarray = field(repr=False)
    after: int
