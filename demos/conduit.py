"""A cable pulled round a bend in a conduit: the scene of a demo and of a published problem."""

import itertools
import math

import numpy as np

import cosserat_fenicsx as cf

#: Radius of the bend and straight length before and behind it, m; friction; diameters of cable and conduit, m;
#: stiffness of the wall, N/m^2; the cable's material.
BEND, STRAIGHT, FRICTION, CABLE, CONDUIT, WALL = 1.0, 0.5, 0.3, 0.012, 0.032, 1e6
POLYMER = cf.Material(E=2e9, nu=0.4)


def pulled_cable():
    """The cable pulled by 3 cm.

    Returns:
        its `Path`, its forces (N) on the holder and of the pull at the last state, each (3,).
    """
    md = np.cumsum([0.0, STRAIGHT, BEND * math.pi / 2, STRAIGHT])
    axis = cf.well.WellPath.from_survey(md, [90, 90, 90, 90], [0, 0, 90, 90])  # a horizontal one
    ends = [tuple(row) for row in axis.position(md)]
    curves = cf.Line(*ends[:2]), cf.Arc((STRAIGHT, BEND, 0.0), ends[1], math.pi / 2), cf.Line(*ends[2:])
    names = "held", "bend", "pulled"
    rods = [cf.Rod(curve, cf.Circle(CABLE), POLYMER, name=name) for curve, name in zip(curves, names, strict=True)]
    conduit = [
        cf.well.TubeWall(rod, axis, radius=CONDUIT / 2, contact_radius=CABLE / 2, stiffness=WALL, friction=FRICTION,
                         slip=(-1.0, 0.0), begins=begin, has_arm=False)
        for rod, begin in zip(rods, md.tolist(), strict=False)
    ]  # fmt: skip
    held, pulled = cf.Clamp(rods[0].start), cf.Prescribed(rods[2].end, displacement=(0.0, 0.03, 0.0))
    joints = [cf.Joint(a.end, b.start) for a, b in itertools.pairwise(rods)]
    scene = cf.Scene(rods, [held, pulled], conduit, joints=joints, title="A cable pulled round a bend in a conduit")
    path = cf.solve(scene, [0.0, 1.0], tol=1e-4)
    return path, *(path.reaction(support)[0][-1] for support in (held, pulled))
