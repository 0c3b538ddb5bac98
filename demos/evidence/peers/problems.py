"""The problems of the chart of speed against accuracy, and their reference solutions, one for each mechanical model.

A problem is a dict for JSON: a rod of `length` (m), straight along x or an arc of `radius` (m) that starts along x and
bends towards y, clamped at its start; EA, GA (N), EI, GJ (N m^2), and the rectangle and material that have them;
dead `force` (N) and `moment` (N m) on the tip, times each of the `load_factors`.
"""

import math
import sys
from functools import cache
from pathlib import Path

import numpy as np

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic

MODELS = ("Reissner", "shear-rigid")
_L, _ECCENTRICITY = 20.0, 0.2  # m, the paper's column


def _column(load_factors, force, moment):
    rod = cf.Rod(cf.Line((0, 0, 0), (_L, 0, 0)), cf.Circle(0.2), cf.Material(E=210e9, nu=0.3), name="column")
    k = rod.stiffness
    P = cf.euler_load(rod)
    numbers = {"EA": k.axial, "GA": k.shear[0], "EI": k.bending[0], "GJ": k.torsion, "E": 210e9, "nu": 0.3}
    area = numbers["EA"] / numbers["E"]
    height = math.sqrt(12 * numbers["EI"] / numbers["EA"])  # of the rectangle with the same EA and EI
    return {
        "length": _L,
        "radius": None,
        **numbers,
        "area": area,
        "width": area / height,
        "height": height,
        "force": [P * f for f in force],
        "moment": [m * P * _ECCENTRICITY if force[0] else m * numbers["EI"] / _L for m in moment],
        "load_factors": [float(factor) for factor in load_factors],
    }


def _bend():
    E = 1e7
    numbers = {"EA": E, "GA": E / 2, "EI": E / 12, "GJ": E / 12, "E": E, "nu": 0.0}
    return {
        "length": 100 * math.pi / 4,
        "radius": 100.0,
        **numbers,
        "area": 1.0,
        "width": 1.0,
        "height": 1.0,
        "force": [0.0, 0.0, 600.0],
        "moment": [0.0, 0.0, 0.0],
        "load_factors": [1.0],
    }


@cache
def problems():
    """{name: problem}."""
    compressed, bent = (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    # A full number of turns closes on any mesh, so that the load ends a quarter of a turn before.
    rolls = {f"roll-up {k}": _column([1 - 0.25 / k, 1.0], (0, 0, 0), (0, 0, 2 * math.pi * k)) for k in (1, 2, 4)}
    return {
        "sweep": _column(np.linspace(0.05, 1.5, 31), compressed, bent),
        "single": _column([0.9], compressed, bent),
        "bend": _bend(),
        **rolls,
    }


#: Titles of the charts.
TITLES = {
    "sweep": "Eccentric cantilever, 31 load factors from 0.05 to 1.5",
    "single": "Eccentric cantilever, one answer at load factor 0.9",
    "bend": "45-degree bend, load 600 out of its plane",
    "roll-up 1": "Cantilever rolled up by an end moment, 1 turn",
    "roll-up 2": "Cantilever rolled up by an end moment, 2 turns",
    "roll-up 4": "Cantilever rolled up by an end moment, 4 turns",
}


@cache
def truth(name, model):
    """Displacements of the tip at the load factors, (n, 3) m, independent of all solvers.

    Args:
        name: of the problem.
        model: "Reissner", or "shear-rigid" (Euler-Bernoulli with extension: GA infinite).
    """
    problem = problems()[name]
    GA = problem["GA"] if model == "Reissner" else math.inf
    factors = np.array(problem["load_factors"])
    if name.startswith("roll-up"):  # a circle, closed a whole number of times in the end
        L, turned = problem["length"], factors * problem["moment"][2] * problem["length"] / problem["EI"]
        return np.column_stack([L * np.sin(turned) / turned - L, L * (1 - np.cos(turned)) / turned, 0 * turned])
    if name == "bend":
        return _shot(problem, GA)
    stiff = {"bending": problem["EI"], "axial": problem["EA"], "shear": GA}
    tip = analytic.reissner(factors, _ECCENTRICITY, problem["length"], **stiff)
    return np.column_stack([-tip.shortening, tip.delta, 0 * tip.delta])


def _shot(problem, GA):
    """The strong form of the bend, by shooting and collocation to 1e-10 (tests/bvp.py)."""
    sys.path.append(str(Path(__file__).resolve().parents[3] / "tests"))
    import bvp

    R, L = problem["radius"], problem["length"]

    def frame(s):  # d1 out of the plane, d3 along the arc
        cos, sin, zero = np.cos(s / R), np.sin(s / R), 0 * s
        columns = [[zero, zero, zero + 1], [sin, -cos, zero], [cos, sin, zero]]
        return np.moveaxis(np.array(columns), (0, 1), (2, 1))

    EI = problem["EI"]
    rod = bvp.Problem(L, frame, (GA, GA, problem["EA"]), (EI, EI, problem["GJ"]), force=tuple(problem["force"]))
    end = bvp.equilibrium(rod)(L)["r"].reshape(3)
    return (end - [R * math.sin(L / R), R * (1 - math.cos(L / R)), 0.0])[None]


def error(name, model, tip):
    """Relative error of displacements of the tip (n, 3), largest over the load factors.

    Of the transverse displacement delta on the eccentric cantilever, of the vector elsewhere.
    """
    exact, tip = truth(name, model), np.asarray(tip)
    if name in ("sweep", "single"):
        return float(np.abs(tip[:, 1] / exact[:, 1] - 1).max())
    return float((np.linalg.norm(tip - exact, axis=1) / np.linalg.norm(exact, axis=1)).max())
