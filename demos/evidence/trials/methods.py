"""The columns of the table, and the cell of a method on a trial.

The attributes and methods of a method:
    key, title, what        its name, its head, what it is in a sentence
    own                     whether it is part of this package
    spatial                 whether it supports rods that leave a plane
    turn                    rotation vector (rad) of the trial of objectivity
    solve(problem, jump)    an `Answer`; jump: the whole load at once. Raises Stopped, NotForIt, NotInstalled
    numerics(key)           (problem, Answer, number or None, unit) of a trial about loops; raises the same
"""

import time
from dataclasses import replace

import numpy as np

from trials.bare import Bare
from trials.cells import MISSING, NOT, STOPPED, Cell, NotForIt, NotInstalled, Stopped
from trials.chains import CHAINS
from trials.own import OWN
from trials.programs import PROGRAMS
from trials.rotation_vector import RotationVector
from trials.secant import Secant

METHODS = (*OWN, Bare(), RotationVector(), *CHAINS, Secant(), *PROGRAMS)
BY_KEY = {method.key: method for method in METHODS}


def cell(trial, method):
    """The `Cell` of a method on a trial, timed."""
    began = time.perf_counter()
    try:
        found = trial.run(method)
    except NotForIt as why:
        found = Cell(NOT, note=str(why))
    except NotInstalled as why:
        found = Cell(MISSING, note=str(why))
    except Stopped as stop:
        value = None if np.isnan(stop.reached) else float(stop.reached)
        found = Cell(STOPPED, value, "load factor reached", str(stop))
    return replace(found, seconds=round(time.perf_counter() - began, 3))
