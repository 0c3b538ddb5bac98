"""Surveys and numbers of reference wells, found independently of this package (reference/wells.json).

Wells P, Volve 15/9-F-12 and ISCWSA 2: hook loads and torques of the soft string (a differential equation at 1e-13),
lock-up lengths and critical loads (closed forms).
"""

import json
import math
from pathlib import Path

import numpy as np

import cosserat_fenicsx as cf

WELLS = json.loads((Path(__file__).parent / "reference" / "wells.json").read_text(encoding="utf-8"))


def well(name):
    """The `WellPath` of a reference well."""
    return cf.well.WellPath.from_survey(*np.transpose(WELLS[name]["stations_md_inc_azi"]))


def in_build_section(case):
    """The rod of `torque_and_drag` in a build section of reference/rod_in_hole.json."""
    given, alpha = case["input"], case["input"]["alpha"]
    md = np.cumsum([0, given["h"], given["R"] * math.radians(alpha), given["D"] + 50.0])
    path = cf.well.WellPath.from_survey(md, [0, 0, alpha, alpha], [0, 0, 0, 0])
    stiff = cf.Stiffness((1e12, 1e12), 1e12, (given["EI"],) * 2, given["EI"])
    string = cf.well.DrillString([cf.well.Component(None, stiff, given["w"], 0.06)])
    operation = {1: cf.well.TripOut, -1: cf.well.TripIn, 0: cf.well.Static}[given["c"]](weight=-given["T0"])
    hole = cf.well.Borehole(path, cf.well.HoleSection(path.length, 2 * (0.06 + given["r"]), given["mu"]))
    return cf.well.torque_and_drag(hole, string, operation, depth=case["rod_length"], model="rod")
