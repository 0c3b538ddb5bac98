"""The columns of the table, each a `cells.Method`, and the cell of a method on a trial."""

import time
from dataclasses import replace

import numpy as np

from trials.bare import Bare
from trials.catalogue import TRIALS
from trials.cells import MISSING, NOT, STOPPED, Cell, NotForIt, NotInstalled, Stopped
from trials.chains import CHAINS
from trials.own import OWN
from trials.programs import PROGRAMS
from trials.rotation_vector import RotationVector
from trials.secant import Secant

METHODS = (*OWN, Bare(), RotationVector(), *CHAINS, Secant(), *PROGRAMS)
BY_KEY = {method.key: method for method in METHODS}


def shown(data):
    """The methods and the trials of failures.json."""
    columns = [method for method in METHODS if method.key in data["methods"]]
    return columns, [trial for trial in TRIALS if trial.key in data["trials"]]


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
