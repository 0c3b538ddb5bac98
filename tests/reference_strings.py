"""Drill-strings of reference/string_stability.json, whose numbers were found independently of this package."""

import json
import math
from pathlib import Path

import cosserat_fenicsx as cf

GIVEN = json.loads((Path(__file__).parent / "reference" / "string_stability.json").read_text(encoding="utf-8"))
RPM = math.pi / 30


def tubes(*sections):
    """A `DrillString` of sections from the top down: pipe, then collars."""
    kinds = (cf.well.DrillPipe, cf.well.Collar)
    parts = []
    for kind, s in zip(kinds, sections, strict=False):
        steel = cf.Material(E=s["E"], nu=s["E"] / (2 * s["G"]) - 1, density=s["rho"])
        parts.append(kind(s["length"], None, s["od"], s["id"], material=steel))
    return cf.well.DrillString(tuple(parts), order="top down")


def drive_of(name, speed=1.0):
    top = GIVEN["tops"][name]
    if top["type"] == "rigid":
        return cf.drilling.TopDrive(speed)
    if top["type"] == "PI":
        return cf.drilling.TopDrive(speed, top["I"], cf.drilling.PI(top["Kp"], top["Ki"]))
    return cf.drilling.TopDrive(speed, control=cf.drilling.Matched())


def falling(rate=0.3):
    law = GIVEN["law"]
    return cf.drilling.Stribeck(law["mu_s"], law["mu_c"], law["v_f"] / rate, radius=law["R"])


def pipe_and_collars(top="rigid", drag=0.1, inertia=0.0, **changes):
    """Pipe and collars with a falling torque on bit of 100 kN."""
    bit = cf.drilling.BitOnRock(falling(), weight=1e5, inertia=inertia)
    given = {"string": tubes(*GIVEN["sections"]), "drive": drive_of(top), "bit": bit}
    return cf.drilling.Drilling(**(given | {"drag": cf.drilling.ViscousDrag(drag, drag)} | changes))


def weight_of_slope(slope, speed):
    """The weight on bit (N) at which the falling law has a slope (N m s/rad) at a speed."""
    law = falling()
    per_newton = (law.static - law.dynamic) * law.radius / law.speed * math.exp(-speed / law.speed)
    return -slope / per_newton


def public_discs(control, weight):
    """The four discs of Navarro-Lopez & Cortes, J. Sound Vib. 307 (2007) 152, doi:10.1016/j.jsv.2007.06.037."""
    given = GIVEN["discs"]
    discs = cf.drilling.Discs(given["J"], given["k"], given["c"], (given["c_r"], 0, 0, given["c_b"]))
    law = cf.drilling.Stribeck(given["mu_sb"], given["mu_cb"], given["v_f"] / given["gamma_b"], radius=given["R_b"])
    drive = (
        cf.drilling.TopDrive(1.0) if isinstance(control, cf.drilling.Stiff) else cf.drilling.TopDrive(control=control)
    )
    return cf.drilling.Drilling(discs, drive, cf.drilling.BitOnRock(law, weight=weight))
