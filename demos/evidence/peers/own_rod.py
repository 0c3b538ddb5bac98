"""This package through its public interface; see `speak` for requests and answers.

The sample is the whole call of `cosserat_fenicsx.solve` and the query of the tip, stability count included. Compiled
forms and solvers are those of the previous call (a warm cache); load, mesh data and path are new. Of a motion it is the
whole call of `simulate` and the query of the ends.
"""

from itertools import pairwise

import numpy as np
from problems import scene_of
from speak import serve

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat


def prepare(problem, configuration):
    if "duration" in problem:
        return _prepare_motion(problem, configuration)
    rod, scene = scene_of(problem)
    factors = [float(factor) for factor in problem["load_factors"]]

    def solve():
        return np.array(cf.solve(scene, factors, progress=False, **configuration).displacement(rod.end))

    return solve


def motion_of(problem):
    """The stations that are watched and the scene of a problem of `motions`."""
    EA, GA, EI, GJ = (problem[key] for key in ("EA", "GA", "EI", "GJ"))
    section = cf.Stiffness((GA, GA), EA, (EI, EI), GJ, mass=problem["mass"], inertia=tuple(problem["inertia"]))
    rods = [cf.Rod(cf.Line(*line), section, name=f"rod {i}") for i, line in enumerate(problem["lines"])]
    joints = [cf.Joint(a.end, b.start) for a, b in pairwise(rods)]
    place = getattr(rods[0], problem["loaded"])
    loads = [
        load(place, cf.signals.Triangle(problem[key], *problem["rise"]))
        for load, key in ((cf.Force, "force"), (cf.Moment, "moment"))
        if any(problem[key])
    ]
    supports = [cf.Clamp(rods[0].start)] if problem["clamped"] else []
    ends = {"start": rods[0].start, "end": rods[-1].end}
    return [ends[name] for name in problem["watched"]], cf.Scene(rods, supports, loads, joints)


def _prepare_motion(problem, configuration):
    stations, scene = motion_of(problem)
    duration = problem["duration"]

    def move():
        history = cf.simulate(scene, duration, save_every=duration, progress=False, model="spatial", **configuration)
        return np.array([history.position(station)[-1] for station in stations])

    return move


if __name__ == "__main__":
    serve(prepare, {"cosserat_fenicsx": cf.__version__, "dolfinx": compat.version()})
