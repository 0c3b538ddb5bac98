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
from functools import cache

import numpy as np
from peers.problems import at_rest, column_truth, frames, numbers, roll_up_truth, scene_of, shot
from peers.problems import problems as peers_problems
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve, minimize_scalar

__all__ = ["column_truth", "frames", "roll_up_truth", "scene_of", "shot"]


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


def _even(steps, upto=1.0):
    return [upto * (k + 1) / steps for k in range(steps)]


def roll_up(turns, steps):
    """A straight rod and an end moment that rolls it up, in equal steps."""
    base = peers_problems()["roll-up 1"]
    return {**base, "moment": [0, 0, turns * base["moment"][2]], "load_factors": _even(steps)}


def twisted(steps=20):
    """A rod of small torsional stiffness whose tip is twisted by 1.25 turns while a force bends it."""
    loads = {"force": (0.3, 1.0, 0.0), "moment": (0.1 * 2.5 * math.pi, 0, 0), "load_factors": _even(steps)}
    return numbers(1.0, None, EA=1e4, GA=5e3, EI=1.0, GJ=0.1, **loads)


def pushed_and_turned(plane):
    """A straight rod under a force and a moment, in a plane or in space."""
    force, moment = ((-0.4, 0.6, 0.0), (0, 0, -0.4)) if plane else ((-1.2, 1.4, 2.0), (0.6, 1.0, -0.8))
    return numbers(1.0, None, EA=3e3, GA=1e3, EI=1.0, GJ=0.8, force=force, moment=moment, load_factors=_even(10))


def thin_arc():
    """A quarter of a circle, a thousand times longer than it is thick, bent open by a force in its plane."""
    radius, thickness = 2 / math.pi, 1e-3
    EA = 12 / thickness**2
    loads = {"force": (0.0, -2.0, 0.0), "moment": (0, 0, 0), "load_factors": _even(10)}
    return numbers(1.0, radius, EA=EA, GA=EA / 3.12, EI=1.0, GJ=0.8, **loads)


def arch(upto):
    """Half of a shallow clamped arch from its crown to its foot, which is displaced vertically without rotation."""
    found = numbers(1.0, 2.5, EA=1e4, GA=4e3, EI=1.0, GJ=0.8, force=(0.0, -1.0, 0.0), moment=(0, 0, 0))
    return {**found, "guided": True, "load_factors": _even(13, upto)}


def beck(upto=25.0):
    """Beck's column: a compressive force that follows the tip; it flutters from 20.05 EI/L^2 on."""
    found = numbers(1.0, None, EA=1e4, GA=5e3, EI=1.0, GJ=0.8, force=(-1.0, 0, 0), moment=(0, 0, 0))
    return {**found, "follower": True, "load_factors": _even(5, upto)}


def in_a_plane(problem):
    """Whether rod and loads lie in the x-y plane."""
    turn = problem.get("turn", (0, 0, 0))
    return not (problem["force"][2] or problem["moment"][0] or problem["moment"][1] or turn[0] or turn[1])


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
