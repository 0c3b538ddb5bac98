"""The frames and the arch of statics.json: by shooting and arc length, checked by solve_bvp."""

import numpy as np
from checked import check
from planar_truth import Frame, Leg, Section


def signed(frame, points, row):
    """Rows with the sign of the determinant, which vanishes at a limit point."""
    return [row(frame.move(p, 0.0)) | {"determinant": int(p.sign)} for p in points]  # to round-off


def lee(shear_factor):
    """In units of L = 120 and EI/L^2 = 1000."""
    section = Section(1.0, 43200.0, shear_factor * 43200.0 / 2.6)
    legs = (Leg(1.0, turn=-np.pi / 2), Leg(0.2, load=(0, -1)), Leg(0.8))
    frame = Frame(section, legs, (0, 0, np.pi / 2), (1, 1, 0), (True, True))
    points = frame.follow(1.0, lambda p: p.z[-1] > 20)
    return frame, points, frame.limits(points)


def lee_frame():
    frame, points, limits = lee(1.0)

    def row(p):
        place = (frame.places(p)[1][:2] - [0.2, 1.0]) * 120
        return {"load": p.z[-1] * 1000, "u": place[0], "v": place[1]}

    checks = []
    for p, known, within in zip(limits, (18546.6, -9396.2), (0.05, 0.06), strict=True):
        checks.append(check("REFERENCES, limit load", p.z[-1] * 1000, known, within))
        other = frame.collocate(p, 1, 1)
        checks.append(check("solve_bvp at the limit's displacement", other * 1000, p.z[-1] * 1000, 1e-6))
    others = {name: [p.z[-1] * 1000 for p in lee(k)[2]] for name, k in (("unshearable", np.inf), ("5/6", 5 / 6))}
    about = (
        "Lee's frame: column (0, 0)-(0, 120), beam to (120, 120), both feet pinned, rigid corner; E = 7.2e6, A = "
        "6, I = 2, nu = 0.3, GA = E A/2.6 (shear factor 1: this is what REFERENCES' numbers belong to), dead load"
        " downwards on the beam 24 from the corner. limits: the two limit points; path: load, displacement of the"
        " load's point (u along x, v along y), sign of the determinant of the tangent; limit_loads: with other "
        "shear factors."
    )
    rows = {"limits": [row(p) for p in limits], "path": signed(frame, points[::2], row), "limit_loads": others}
    return {"about": about, "digits": 10, "checks": checks, **rows}


def hinged_frame():
    legs = (Leg(0.5, load=(1, 0)), Leg(0.5, turn=-np.pi / 2, hinge=True), Leg(1.0))
    frame = Frame(Section(1.0, 1e4, 5e3), legs, (0, 0, np.pi / 2), (1, 1, 0))
    points, values, checks = frame.follow(2.0, lambda p: p.z[-1] > 45), [], []
    for load in (5, 10, 20, 30, 40):
        p = frame.at_load(points, load)
        places = frame.places(p)
        checks.append(check(f"solve_bvp, {load}", frame.collocate(p, 0, 0), load, 1e-9))
        values.append(
            {
                "load": load,
                "mid_column": (places[0, :2] - [0, 0.5]).tolist(),
                "elbow": (places[1, :2] - [0, 1]).tolist(),
                "column_angle": float(np.pi / 2 - places[1, 2]),
                "beam_angle": float(np.pi / 2 - p.z[3]),
                "foot_force": p.z[:2].tolist(),
                "foot_moment": float(p.z[2]),
            }
        )
    assert all(p.sign > 0 for p in points)
    about = (
        "Two legs and a hinge: column (0, 0)-(0, 1), beam (0, 1)-(1, 1), clamped at (0, 0) and (1, 1), hinged at "
        "the elbow; EI = 1, EA = 1e4, GA = 5e3; dead force (load, 0) on the middle of the column. Displacements; "
        "clockwise rotations of column and beam at the hinge; n and m (about z) in the column at its foot. No "
        "singular tangent on the way."
    )
    return {"about": about, "digits": 10, "checks": checks, "values": values}


def shallow_arch():
    R, span, E, height = 133.114, 34.0, 1e7, 0.1875
    half = np.arcsin(span / 2 / R)
    L, EI, EA = 2 * half * R, E * height**3 / 12, E * height
    unit, GA = EI / L**2, 5 / 6 * E / 2 * height
    legs = (Leg(0.5, -2 * half, load=(0, -1)), Leg(0.5, -2 * half))
    frame = Frame(Section(1.0, EA / unit, GA / unit), legs, (0, 0, half), (span / L, 0, -half))
    points = frame.follow(2.0, lambda p: p.z[-1] > 12, most=90)
    top = R * (1 - np.cos(half)) / L

    def row(p):
        return {
            "load": p.z[-1] * unit,
            "v": (frame.places(p)[0, 1] - top) * L,
            "clamp_force": (p.z[:2] * unit).tolist(),
        }

    checks, values = [], []
    for p in frame.limits(points):
        other = frame.collocate(p, 0, 1)
        checks.append(check("solve_bvp at the limit's displacement", other * unit, p.z[-1] * unit, 1e-8))
        values.append(row(p))
    about = (
        "Shallow clamped circular arch (of Belytschko & Glaum 1979): R = 133.114, span 34, feet at (0, 0) and "
        "(34, 0), section 1 x 0.1875, E = 1e7, nu = 0, GA = 5/6 E/2 A, EI = E 0.1875^3/12; dead force downwards "
        "at the crown. limits: the limit points of the symmetric path (snap-through from the first); path: load, "
        "vertical displacement v of the crown. Between the limit points the determinant changes its sign twice "
        "more: a skew mode comes and goes on the unstable part."
    )
    return {"about": about, "digits": 10, "checks": checks, "limits": values, "path": signed(frame, points[::2], row)}
