"""The problems, as dicts in the form of `peers.problems`, and reference solutions, which are independent of all
methods.

A rod of `length` starts at the origin along x, straight or as an arc of `radius` towards y; dead `force` and `moment`
on the tip, times the `load_factors`. Keys in addition to those of the peers' problems:
    guided    the tip's x and its rotation are held: half of a symmetric arch
    history   [(force factor, moment factor)] instead of the load factors
    turn      rotation vector, rad: the clamp is rotated by it, and the loads with it
    follower  the force turns with the tip's section
    coarse    whether to use few elements, to detect locking
    finer     factor on the number of elements; for this package the tolerance is divided by its square
    mesh      elements for the quick table, for methods of this package other than the default
"""

import math
import sys
from functools import cache
from pathlib import Path

import numpy as np
from peers.problems import problems as peers_problems
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve, minimize_scalar
from scipy.spatial.transform import Rotation

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic

#: Eccentricity of the column's load, over its length.
ECCENTRICITY = 0.01


def column(load_factors, slenderness=1e2, infinite=False):
    """The paper's column: force and constant moment. `slenderness` is L/d; `infinite`: EA and GA are."""
    base = {**peers_problems()["sweep"], "load_factors": [float(eta) for eta in load_factors]}
    if slenderness != 1e2:
        base = _thinner(base, slenderness / 1e2)
    return {**base, "EA": math.inf, "GA": math.inf} if infinite else base


def _thinner(problem, ratio):
    """The same length, the section's sizes divided by ratio, the load in proportion to the bending stiffness."""
    powers = {"EA": 2, "GA": 2, "area": 2, "EI": 4, "GJ": 4, "width": 1, "height": 1}
    found = {**problem, **{key: problem[key] / ratio**power for key, power in powers.items()}}
    return {**found, **{key: [x / ratio**4 for x in problem[key]] for key in ("force", "moment")}}


def in_other_units(problem, length=1e3, force=1e-6):
    """The same problem with numbers in mm and MN instead of m and N."""
    powers = {
        "length": (1, 0), "EA": (0, 1), "GA": (0, 1), "EI": (2, 1), "GJ": (2, 1), "E": (-2, 1), "area": (2, 0),
        "width": (1, 0), "height": (1, 0),
    }  # fmt: skip
    found = {**problem, **{key: problem[key] * length**a * force**b for key, (a, b) in powers.items()}}
    found["force"] = [x * force for x in problem["force"]]
    found["moment"] = [x * force * length for x in problem["moment"]]
    return found


def column_truth(problem):
    """Displacements of the column's tip, (n, 3) m, by the quadrature of `analytic.reissner`."""
    stiff = {"bending": problem["EI"], "axial": problem["EA"], "shear": problem["GA"]}
    tip = analytic.reissner(
        np.array(problem["load_factors"]), ECCENTRICITY * problem["length"], problem["length"], **stiff
    )
    return np.column_stack([-tip.shortening, tip.delta, 0 * tip.delta])


def roll_up(turns, steps):
    """A straight rod and an end moment that rolls it up, in equal steps."""
    base = peers_problems()["roll-up 1"]
    return {
        **base,
        "moment": [0, 0, turns * base["moment"][2]],
        "load_factors": [(k + 1) / steps for k in range(steps)],
    }


def roll_up_truth(problem):
    """The tip on its circle, (n, 3) m."""
    L = problem["length"]
    angle = np.array(problem["load_factors"]) * problem["moment"][2] * L / problem["EI"]
    return np.column_stack([L * np.sin(angle) / angle - L, L * (1 - np.cos(angle)) / angle, 0 * angle])


def twisted(steps=20):
    """A rod of small torsional stiffness whose tip is twisted by 1.25 turns while a force bends it."""
    EI = 1.0
    found = _numbers(
        1.0, None, EA=1e4, GA=5e3, EI=EI, GJ=0.1 * EI, force=(0.3, 1.0, 0.0), moment=(0.1 * 2.5 * math.pi, 0, 0)
    )
    return {**found, "load_factors": [(k + 1) / steps for k in range(steps)]}


def pushed_and_turned(plane, history=None):
    """A straight rod under a force and a moment, in a plane or in space; (force factor, moment factor) in stages."""
    force, moment = ((-0.4, 0.6, 0.0), (0, 0, -0.4)) if plane else ((-1.2, 1.4, 2.0), (0.6, 1.0, -0.8))
    found = _numbers(1.0, None, EA=3e3, GA=1e3, EI=1.0, GJ=0.8, force=force, moment=moment)
    return {**found, "load_factors": [(k + 1) / 10 for k in range(10)], **({"history": history} if history else {})}


def thin_arc():
    """A quarter of a circle, a thousand times longer than it is thick, bent open by a force in its plane."""
    radius, thickness = 2 / math.pi, 1e-3
    EA = 12 / thickness**2
    loads = {"force": (0.0, -2.0, 0.0), "moment": (0, 0, 0)}
    found = _numbers(1.0, radius, EA=EA, GA=EA / 3.12, EI=1.0, GJ=0.8, size=thickness, **loads)
    return {**found, "load_factors": [(k + 1) / 10 for k in range(10)]}


def arch(upto):
    """Half of a shallow clamped arch from its crown to its foot, which is displaced vertically without rotation."""
    found = _numbers(1.0, 2.5, EA=1e4, GA=4e3, EI=1.0, GJ=0.8, force=(0.0, -1.0, 0.0), moment=(0, 0, 0))
    return {**found, "guided": True, "load_factors": [upto * (k + 1) / 13 for k in range(13)]}


def beck(upto=25.0):
    """Beck's column: a compressive force that follows the tip; it flutters from 20.05 EI/L^2 on."""
    found = _numbers(1.0, None, EA=1e4, GA=5e3, EI=1.0, GJ=0.8, force=(-1.0, 0, 0), moment=(0, 0, 0))
    return {**found, "follower": True, "load_factors": [upto * (k + 1) / 5 for k in range(5)]}


def _numbers(length, radius, *, EA, GA, EI, GJ, force, moment, size=None):
    height = size or math.sqrt(12 * EI / EA)
    E = 12 * EI / height**4 if size else EA / height**2
    return {
        "length": length, "radius": radius, "EA": EA, "GA": GA, "EI": EI, "GJ": GJ, "E": E, "nu": 0.3,
        "area": EA / E, "width": EA / E / height, "height": height, "force": list(force), "moment": list(moment),
        "load_factors": [1.0],
    }  # fmt: skip


def in_a_plane(problem):
    """Whether rod and loads lie in the x-y plane."""
    turn = problem.get("turn", (0, 0, 0))
    return not (problem["force"][2] or problem["moment"][0] or problem["moment"][1] or turn[0] or turn[1])


def shot(problem):
    """The tip's displacement at load factor 1, (1, 3) m, of any rod under dead loads:
    the strong form, by shooting and collocation to 1e-10 (tests/bvp.py)."""
    sys.path.append(str(Path(__file__).resolve().parents[3] / "tests"))
    import bvp

    L, EI, GA, R = (problem[key] for key in ("length", "EI", "GA", "radius"))
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


def scene_of(problem, whole=None):
    """The rod and the scene, for this package; `whole`: a (3, 3) rotation of everything."""
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


@cache
def arch_limit():
    """The load factor of the arch's limit point, by shooting of Reissner's plane
    equations: the largest force over all displacements of the foot."""
    problem = arch(1.0)
    L, R, EI, EA, GA = (problem[key] for key in ("length", "radius", "EI", "EA", "GA"))
    foot = at_rest(problem, L)

    def end(start):
        moment, H, V = start

        def slope(_, y):
            _, _, theta, m = y
            c, s = math.cos(theta), math.sin(theta)
            stretch, shear = 1 + (H * c + V * s) / EA, (V * c - H * s) / GA
            r_x, r_y = stretch * c - shear * s, stretch * s + shear * c
            return r_x, r_y, m / EI + 1 / R, r_y * H - r_x * V

        return solve_ivp(slope, (0, L), (0, 0, 0, moment), method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]

    def force(down, start):
        found, _, ok, _ = fsolve(
            lambda p: end(p)[:3] - [foot[0], foot[1] - down, L / R], start, full_output=True, xtol=1e-12
        )
        if ok != 1:
            raise RuntimeError(f"the arch was not shot at {down}")
        return found

    known, downs = np.zeros(3), np.linspace(0, foot[1], 41)[1:]
    forces = []
    for down in downs:
        known = force(down, known)
        forces.append(known)
        if len(forces) > 1 and -forces[-1][2] < -forces[-2][2]:
            break
    k = len(forces) - 2
    low, high = downs[max(k - 1, 0)], downs[k + 1]
    return float(-minimize_scalar(lambda d: force(d, forces[k])[2], bounds=(low, high), method="bounded",
                                  options={"xatol": 1e-9}).fun)  # fmt: skip
