"""The motions of the chart of speed against accuracy: problems, reference solutions and configurations.

A problem is a dict for JSON: straight rods, rigidly joined, each from the first to the second point of an entry of
`lines` (m), clamped at the start if `clamped`; EA, GA (N), EI, GJ (N m^2), `mass` (kg/m), `inertia` (kg m, about d1, d2
and the tangent); a dead `force` (N) and `moment` (N m) at the end of the first rod that is named ("start" or "end"), a
triangle in time over `rise` (start, peak, end, s); the `duration` (s), and which ends are `watched`.
"""

import numpy as np

from cosserat_fenicsx.dynamics.schemes import SCHEMES
from peers.environments import OWN

PEERS = (OWN, "Exudyn")
_SPAGHETTI = {"EA": 1e4, "GA": 1e4, "EI": 500.0, "GJ": 500.0, "mass": 1.0, "inertia": [10.0, 10.0, 20.0]}
_FRAME = {"EA": 1e6, "GA": 1e6, "EI": 1e3, "GJ": 1e3, "mass": 1.0, "inertia": [10.0, 10.0, 20.0]}
_PROBLEMS = {
    "spaghetti": {
        **_SPAGHETTI, "lines": [[[6.0, 0.0, 0.0], [0.0, 8.0, 0.0]]], "clamped": False, "loaded": "start",
        "force": [20.0, 0.0, 0.0], "moment": [0.0, -200.0, -100.0], "rise": [0.0, 2.5, 5.0],
        "duration": 10.0, "watched": ["start", "end"],
    },
    "right angle": {
        **_FRAME, "lines": [[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]], [[10.0, 0.0, 0.0], [10.0, 10.0, 0.0]]],
        "clamped": True, "loaded": "end", "force": [0.0, 0.0, 50.0], "moment": [0.0, 0.0, 0.0],
        "rise": [0.0, 1.0, 2.0], "duration": 30.0, "watched": ["end"],
    },
}  # fmt: skip
TITLES = {
    "spaghetti": "Flying spaghetti in space, ends at t = 10 s",
    "right angle": "Right-angle cantilever, free end at t = 30 s",
}
_LENGTH = 10.0  # m, of every rod
#: Positions (m) of the watched ends at the end: triple jump, 32 P3 elements a rod. Steps of 5 and of 2.5 ms agree to
#: 2e-5 m in the first, of 10 and of 5 ms to 2e-6 m in the second; Exudyn's rods, which are the same mechanical model,
#: come nearer with order 2 in the size of their elements.
TRUTHS = {
    "spaghetti": [[40.69107, 0.15775, -3.03159], [40.47846, 8.55413, 1.68107]],
    "right angle": [[8.263446, 8.498988, 0.168538]],
}


def problems():
    """{name: problem}."""
    return _PROBLEMS


def error(name, model, ends):
    """Largest error of the positions of the ends (n, 3), over the length of a rod. name: of the problem; model: the
    mechanical model, one for all here."""
    return float(np.linalg.norm(np.asarray(ends) - TRUTHS[name], axis=1).max() / _LENGTH)


def model(peer, configuration):
    """The mechanical model whose reference solution a configuration is compared with."""
    return "Reissner"


def kind(peer, configuration):
    """(name of this package's scheme, or of the peer's node and integrator; whether it is spatial)."""
    if peer == OWN:
        return configuration["scheme"] + (", by tol" if "tol" in configuration else ""), True
    return f"{configuration['node']}, {configuration['solver']}", True


def configurations(peer, problem, quick=False):
    """Configurations of a peer on a problem (both by name), as a list of dicts."""
    found = _own(problem) if peer == OWN else _exudyn(problem)
    if not quick:
        return found
    if peer == OWN:
        elements = 8 if problem == "spaghetti" else 4
        return [c for c in found if c.get("dt") == 0.05 and c["degree"] == 2 and c["elements"] == elements]
    return [c for c in found if c["dt"] == 0.05 and c["elements"] == 16 and c["tol"] == 1e-4]


def _own(problem):
    found, spatial = [], problem == "spaghetti"
    meshes = ((4, 3), (4, 2), (8, 2), (8, 3)) if spatial else ((4, 3), (2, 3), (4, 2), (3, 2))
    steps = (0.1, 0.05, 0.03125, 0.025, 0.0125) if spatial else (0.1, 0.0625, 0.05, 0.025)
    for scheme, stepper in SCHEMES.items():
        grid = [{"scheme": scheme, "elements": elements, "degree": degree} for elements, degree in meshes]
        found += [{**mesh, "dt": dt} for mesh in grid for dt in steps]
        found += [{**grid[0], "tol": tol} for tol in (1e-2, 1e-3, 1e-4) if stepper.adapts]
    return found


def _exudyn(problem):
    """Nodes with rotation vectors (Lie group) and with Euler parameters; tolerances of Newton's method that affect the
    result and that do not; sparse LU, faster from about 20 elements on; modified Newton (full Newton takes twice as
    long).

    Also tried on the spaghetti, and left out: no numerical damping (the same time and error), EXUdense (slower), the
    trapezoidal index-2 solver (the same as generalised alpha), and the explicit Runge-Kutta method of order 4, ten
    times slower at the largest stable step, 2 ms.
    """
    spatial = problem == "spaghetti"
    meshes = (16, 28, 32, 40, 64) if spatial else (16, 24, 28, 32, 40)
    steps = (0.05, 0.025, 0.02, 0.0125) if spatial else (0.1, 0.0625, 0.05, 0.025)
    return [
        {"node": node, "solver": "generalised alpha", "elements": n, "dt": dt, "tol": tol}
        for node in ("LG", "EP")
        for n in meshes
        for dt in steps
        for tol in (1e-3, 1e-4)
        if n < 40 or tol < 1e-3
    ]
