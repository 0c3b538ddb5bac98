"""Surveys and numbers of reference wells, found independently of this package (reference/wells.json).

Wells P, Volve 15/9-F-12 and ISCWSA 2: hook loads and torques of the soft string (a differential equation at 1e-13),
lock-up lengths and critical loads (closed forms).
"""

import json
from pathlib import Path

import numpy as np

import cosserat_fenicsx as cf

WELLS = json.loads((Path(__file__).parent / "reference" / "wells.json").read_text(encoding="utf-8"))


def well(name):
    """The `WellPath` of a reference well."""
    return cf.WellPath.from_survey(*np.transpose(WELLS[name]["stations_md_inc_azi"]))
