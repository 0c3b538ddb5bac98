"""This package through its public interface; see `speak` for requests and answers.

The sample is the whole call of `cosserat_fenicsx.solve` and the query of the tip, stability count included. Compiled
forms and solvers are those of the previous call (a warm cache); load, mesh data and path are new.
"""

import numpy as np
import own_motion
from speak import serve

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat


def scene_of(problem):
    """The rod and the scene of a problem."""
    L, R = problem["length"], problem["radius"]
    curve = cf.Arc((0, R, 0), (0, 0, 0), L / R, axis=(0, 0, 1)) if R else cf.Line((0, 0, 0), (L, 0, 0))
    EI, GA = problem["EI"], problem["GA"]
    section = cf.Stiffness(shear=(GA, GA), axial=problem["EA"], bending=(EI, EI), torsion=problem["GJ"])
    rod = cf.Rod(curve, section, name="rod")
    loads = [cf.Force(rod.end, problem["force"])] if any(problem["force"]) else []
    loads += [cf.Moment(rod.end, problem["moment"])] if any(problem["moment"]) else []
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], loads)


def prepare(problem, configuration):
    if "duration" in problem:
        return own_motion.prepare(problem, configuration)
    rod, scene = scene_of(problem)
    factors = [float(factor) for factor in problem["load_factors"]]

    def solve():
        return np.array(cf.solve(scene, factors, progress=False, **configuration).displacement(rod.end))

    return solve


if __name__ == "__main__":
    serve(prepare, {"cosserat_fenicsx": cf.__version__, "dolfinx": compat.version()})
