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
from scipy.spatial.transform import Rotation

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic

MODELS = ("Reissner", "shear-rigid")
_L, _ECCENTRICITY = 20.0, 0.2  # m, the paper's column


def numbers(length, radius, *, EA, GA, EI, GJ, force, moment, E=None, nu=0.3, load_factors=(1.0,)):
    """A problem; its rectangle has EA and EI, and with E None it is a square."""
    height = math.sqrt(12 * EI / EA)
    E = E or EA / height**2
    return {
        "length": length, "radius": radius, "EA": EA, "GA": GA, "EI": EI, "GJ": GJ, "E": E, "nu": nu,
        "area": EA / E, "width": EA / E / height, "height": height, "force": list(force), "moment": list(moment),
        "load_factors": [float(factor) for factor in load_factors],
    }  # fmt: skip


def _column(load_factors, force, moment):
    rod = cf.Rod(cf.Line((0, 0, 0), (_L, 0, 0)), cf.Circle(0.2), cf.Material(E=210e9, nu=0.3), name="column")
    k, P = rod.stiffness, cf.euler_load(rod)
    arm = P * _ECCENTRICITY if force[0] else k.bending[0] / _L
    stiff = {"EA": k.axial, "GA": k.shear[0], "EI": k.bending[0], "GJ": k.torsion, "E": 210e9}
    loads = {"force": [P * f for f in force], "moment": [m * arm for m in moment]}
    return numbers(_L, None, **stiff, **loads, load_factors=load_factors)


@cache
def problems():
    """{name: problem}."""
    compressed, bent, E = (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1e7
    # A full number of turns closes on any mesh, so that the load ends a quarter of a turn before.
    rolls = {f"roll-up {k}": _column([1 - 0.25 / k, 1.0], (0, 0, 0), (0, 0, 2 * math.pi * k)) for k in (1, 2, 4)}
    bend = {"EA": E, "GA": E / 2, "EI": E / 12, "GJ": E / 12, "E": E, "nu": 0.0}
    return {
        "sweep": _column(np.linspace(0.05, 1.5, 31), compressed, bent),
        "single": _column([0.9], compressed, bent),
        "bend": numbers(100 * math.pi / 4, 100.0, **bend, force=(0.0, 0.0, 600.0), moment=(0.0, 0.0, 0.0)),
        **rolls,
    }


def scene_of(problem, whole=None):
    """The rod and the scene of a problem, with keys of `trials.problems` too; `whole`: a (3, 3) rotation."""
    L, R, EI, GA = (problem[key] for key in ("length", "radius", "EI", "GA"))
    turn = Rotation.from_rotvec(problem.get("turn", (0, 0, 0))).as_matrix()
    every, Q = (np.eye(3), turn) if whole is None else (whole, whole)
    d1 = every @ [0, 0, 1]
    if R:
        curve = cf.Arc(every @ [0, R, 0], (0, 0, 0), L / R, axis=d1)
    else:
        curve = cf.Line((0, 0, 0), every @ [L, 0, 0], d1=d1)
    section = cf.Stiffness(shear=(GA, GA), axial=problem["EA"], bending=(EI, EI), torsion=problem["GJ"])
    rod = cf.Rod(curve, section, name="rod")
    if problem.get("follower"):
        loads = [cf.FollowerForce(rod.end, (0, 0, problem["force"][0]))]
    else:
        loads = [cf.Force(rod.end, Q @ problem["force"])] if any(problem["force"]) else []
        loads += [cf.Moment(rod.end, Q @ problem["moment"])] if any(problem["moment"]) else []
    supports = [cf.Clamp(rod.start)]
    if whole is None and "turn" in problem:
        supports = [cf.Prescribed(rod.start, displacement=(0, 0, 0), rotation=problem["turn"])]
    if problem.get("guided"):
        supports += [cf.Roller(rod.end, (1, 0, 0)), cf.Prescribed(rod.end, rotation=(0, 0, 0))]
    return rod, cf.Scene([rod], supports, loads)


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
    """Displacements of the tip at the load factors, (n, 3) m, independent of all solvers. name: of the problem; model:
    "Reissner", or "shear-rigid" (Euler-Bernoulli with extension: GA infinite)."""
    problem = problems()[name]
    GA = problem["GA"] if model == "Reissner" else math.inf
    if name.startswith("roll-up"):
        return roll_up_truth(problem)
    return shot(problem, GA) if name == "bend" else column_truth(problem, GA)


def roll_up_truth(problem):
    """The tip of a rod under an end moment on its circle, (n, 3) m."""
    L = problem["length"]
    angle = np.array(problem["load_factors"]) * problem["moment"][2] * L / problem["EI"]
    return np.column_stack([L * np.sin(angle) / angle - L, L * (1 - np.cos(angle)) / angle, 0 * angle])


def column_truth(problem, GA=None):
    """Displacements of the tip of the paper's column, (n, 3) m, by the quadrature of `analytic.reissner`."""
    stiff = {"bending": problem["EI"], "axial": problem["EA"], "shear": GA or problem["GA"]}
    L = problem["length"]
    tip = analytic.reissner(np.array(problem["load_factors"]), _ECCENTRICITY / _L * L, L, **stiff)
    return np.column_stack([-tip.shortening, tip.delta, 0 * tip.delta])


def shot(problem, GA=None):
    """The tip's displacement at load factor 1, (1, 3) m, of any rod under dead loads: the strong form, by shooting and
    collocation to 1e-10 (tests/bvp.py)."""
    sys.path.append(str(Path(__file__).resolve().parents[3] / "tests"))
    import bvp

    L, EI, R = (problem[key] for key in ("length", "EI", "radius"))
    GA = GA or problem["GA"]
    rod = bvp.Problem(L, lambda s: frames(s, R), (GA, GA, problem["EA"]), (EI, EI, problem["GJ"]),
                      force=tuple(problem["force"]), moment=tuple(problem["moment"]))  # fmt: skip
    return (bvp.equilibrium(rod)(L)["r"].reshape(3) - at_rest(problem, L))[None]


def frames(s, radius):
    """[d1 d2 d3] at arc lengths s (n,), (n, 3, 3): d1 along z, d3 along the rod."""
    angle = s / radius if radius else 0 * s
    cos, sin, zero = np.cos(angle), np.sin(angle), 0 * s
    columns = [[zero, zero, zero + 1], [sin, -cos, zero], [cos, sin, zero]]
    return np.moveaxis(np.array(columns), (0, 1), (2, 1))


def at_rest(problem, s):
    """(3,) m."""
    R = problem["radius"]
    return np.array([R * math.sin(s / R), R * (1 - math.cos(s / R)), 0.0] if R else [s, 0.0, 0.0])


def error(name, model, tip):
    """Relative error of displacements of the tip (n, 3), largest over the load factors.

    Of the transverse displacement delta on the eccentric cantilever, of the vector elsewhere.
    """
    exact, tip = truth(name, model), np.asarray(tip)
    if name in ("sweep", "single"):
        return float(np.abs(tip[:, 1] / exact[:, 1] - 1).max())
    return float((np.linalg.norm(tip - exact, axis=1) / np.linalg.norm(exact, axis=1)).max())
