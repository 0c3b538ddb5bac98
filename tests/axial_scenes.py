"""Strings that move along their axis, whose motion is known in closed form or was computed elsewhere."""

import numpy as np
from torsion_scenes import COLLARS, COLUMN, DENSITY, PIPE, G

import cosserat_fenicsx as cf

E = 206e9
#: J sqrt(G rho) and A sqrt(E rho) of the pipe and of the collars; speed of axial waves.
IMPEDANCE, SPEED = (136846.52335174856, 757744.4013516483), 5122.698333550446
WEIGHT, MU = 222.00153767384313, 0.25  # of the pipe in mud, N/m, and its friction


def string(*parts, weight=0.0):
    """Parts (length, outer, inner diameter), from the top down, of one weight in mud (N/m)."""
    material = cf.Material(E=E, nu=E / 2 / G - 1, density=DENSITY)
    return cf.well.DrillString(
        [cf.well.Component(length, cf.Tube(outer, inner).stiffness(material), weight, outer / 2)
         for length, outer, inner in parts], order="top down",
    )  # fmt: skip


def hanging(hook=None, drive=None, bit=None, weight=0.0, **more):
    """Pipe and collars in a straight vertical hole without walls."""
    return cf.drilling.Drilling(
        string(PIPE, COLLARS, weight=weight), drive or cf.drilling.TopDrive(0.0), bit, hook=hook, **more
    )


def in_a_well(md, inclination, hook=None, turns=0.0, **more):
    """The pipe in a well of some stations, pulled by a hook and turned (rad/s)."""
    path = cf.well.WellPath.from_survey(md, inclination, np.zeros(len(md)), degrees=True)
    hole = cf.well.Borehole(path, cf.well.HoleSection(md[-1], 0.2159, MU))
    pipe = string((md[-1], *PIPE[1:]), weight=WEIGHT)
    return cf.drilling.Drilling(pipe, cf.drilling.TopDrive(turns), hole=hole, hook=hook, **more)


def column(rows, name):
    """(n,) of what `advance` returned."""
    return rows[:, COLUMN[name]]


def unbalanced(rows):
    """The largest part of the energies and works that the books miss."""
    signs = {"kinetic": 1, "strain": 1, "work_of_drive": -1, "work_of_hook": -1, "work_of_weight": -1, "lost_at_bit": 1,
             "lost_at_wall": 1, "lost_in_mud": 1}  # fmt: skip
    terms = np.array([sign * column(rows, name) for name, sign in signs.items()])
    return np.abs(terms.sum(axis=0)).max() / np.abs(terms).max()
