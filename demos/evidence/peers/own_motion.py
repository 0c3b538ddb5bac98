"""This package's motions; the sample is the whole call of `simulate` and the query of the ends."""

from itertools import pairwise

import numpy as np

import cosserat_fenicsx as cf


def scene_of(problem):
    """The stations that are watched and the scene of a problem of `motions`."""
    EA, GA, EI, GJ = (problem[key] for key in ("EA", "GA", "EI", "GJ"))
    section = cf.Stiffness((GA, GA), EA, (EI, EI), GJ, mass=problem["mass"], inertia=tuple(problem["inertia"]))
    rods = [cf.Rod(cf.Line(*line), section, name=f"rod {i}") for i, line in enumerate(problem["lines"])]
    joints = [cf.Joint(a.end, b.start) for a, b in pairwise(rods)]
    place = getattr(rods[0], problem["loaded"])
    loads = [
        load(place, cf.Triangle(problem[key], *problem["rise"]))
        for load, key in ((cf.Force, "force"), (cf.Moment, "moment"))
        if any(problem[key])
    ]
    supports = [cf.Clamp(rods[0].start)] if problem["clamped"] else []
    ends = {"start": rods[0].start, "end": rods[-1].end}
    return [ends[name] for name in problem["watched"]], cf.Scene(rods, supports, loads, joints)


def prepare(problem, configuration):
    """See `speak.serve`."""
    stations, scene = scene_of(problem)
    duration = problem["duration"]

    def move():
        history = cf.simulate(scene, duration, save_every=duration, progress=False, model="spatial", **configuration)
        return np.array([history.position(station)[-1] for station in stations])

    return move
