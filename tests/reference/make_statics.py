"""Write statics.json into this folder: classic problems to more digits than in their papers, independent of the
package.

Run: python tests/reference/make_statics.py [name ...]. Every entry names its checks; they are printed, and one that
fails stops the script.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq, fsolve
from scipy.special import beta, ellipe, ellipeinc, ellipk, ellipkinc, jv

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

import bvp  # noqa: E402
from checked import check  # noqa: E402
from clamped_ring import critical_twist  # noqa: E402
from frames_by_shooting import hinged_frame, lee_frame, shallow_arch  # noqa: E402
from planar_truth import Frame, Leg, Section  # noqa: E402

RIGID = (np.inf, np.inf, np.inf)


def along_x(s):
    """A straight rod along x: d3 = x, d1 = y, d2 = z."""
    return np.broadcast_to(np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float), (len(s), 3, 3))


def bend_45():
    R, values, checks = 100.0, [], []
    known = {
        ("published section", 300): ((58.7791, 22.2448, 40.1919), 6e-5),
        ("published section", 600): ((47.15043857, 15.68480053, 53.47485879), 6e-9),
        ("shear factor 5/6", 600): ((46.89185, 15.55781, 53.60785), 6e-6),
    }

    def frame(s):
        a, o = s / R, 0 * s
        d3, d1 = np.array([np.cos(a), np.sin(a), o]), np.array([-np.sin(a), np.cos(a), o])
        return np.stack([d1.T, np.cross(d3.T, d1.T), d3.T], axis=2)

    for name, GA, GJ in (("published section", 5e6, 5e6 / 6), ("shear factor 5/6", 25e6 / 6, 0.1406 * 5e6)):
        for load in (300, 450, 600):
            problem = bvp.Problem(R * np.pi / 4, frame, (GA, GA, 1e7), (1e7 / 12, 1e7 / 12, GJ), (0, 0, load))
            found = bvp.equilibrium(problem)
            end = found(problem.length)
            if (name, load) in known:
                checks.append(check(f"REFERENCES, {name}, {load}", end["r"][:, 0], *known[name, load]))
            values.append(
                {
                    "section": name,
                    "GA": GA,
                    "GJ": GJ,
                    "load": load,
                    "position": end["r"][:, 0].tolist(),
                    "quaternion": end["q"][:, 0].tolist(),
                    "accuracy": found.accuracy * problem.length,
                    "verdict": found.verdict,
                }
            )
    about = (
        "45-degree bend (Bathe & Bolourchi 1979): arc of radius 100 in the x-y plane, clamped at the origin with "
        "tangent x, centre at (0, 100, 0); EA = 1e7, EI = 1e7/12, GA and GJ as given, dead load along z. Tip "
        "position, rotation q."
    )
    return {"about": about, "digits": 10, "checks": checks, "values": values}


def elastica():
    values, checks = [], []
    known = {
        1: (0.3017207738, 0.0564332363, 0.4613519497),
        2: (0.4934574804, 0.1606417208, 0.7817498316),
        5: (0.7137915236, 0.3876283607, 1.2153681176),
        10: (0.8106090249, 0.5549955978, 1.4302855388),
    }
    for load in range(1, 11):

        def length(k, load=load):
            return ellipk(k * k) - ellipkinc(np.arcsin(1 / (k * np.sqrt(2))), k * k) - np.sqrt(load)

        k = brentq(length, np.sqrt(0.5) + 1e-14, 1 - 1e-14, xtol=1e-16)
        rest = np.arcsin(1 / (k * np.sqrt(2)))
        w = 1 - 2 * (ellipe(k * k) - ellipeinc(rest, k * k)) / np.sqrt(load)
        angle = np.arcsin(2 * k * k - 1)
        u = 1 - np.sqrt(2 * np.sin(angle) / load)
        found = bvp.equilibrium(bvp.Problem(1.0, along_x, RIGID, (1.0, 1.0, 1.0), (0, load, 0)))
        r = found(1.0)["r"][:, 0]
        checks.append(check(f"shooting, {load}", [r[1], 1 - r[0]], [w, u], 1e-11))
        if load in known:
            checks.append(check(f"Mattiasson's table, {load}", [w, u, angle], known[load], 6e-11))
        values.append({"load": load, "w": w, "u": u, "angle": angle})
    about = (
        "Cantilever of length 1, EI = 1, inextensible, transverse dead tip force `load` = P L^2/EI (Mattiasson "
        "1981): w along the force, u towards the clamp, angle of the tip, by elliptic integrals."
    )
    return {"about": about, "digits": 11, "checks": checks, "values": values}


def helical_roll_up():
    values, checks = [], []
    for factor in (0.02, 0.05, *(np.arange(1, 11) / 10)):
        force, moment = (0, 0, 50 * factor), (0, 0, 200 * np.pi * factor)
        problem = bvp.Problem(10.0, along_x, (1e4, 1e4, 1e4), (100.0, 100.0, 100.0), force, moment)
        found = bvp.equilibrium(problem, tol=1e-9)
        end = found(10.0)
        position, q, m = end["r"][:, 0].tolist(), end["q"][:, 0].tolist(), found.clamp_moment.tolist()
        row = {"load_factor": float(factor), "position": position, "quaternion": q, "clamp_moment": m}
        print(f"  {row} {found.verdict} {found.index} {len(found.path)} points, {found.accuracy:.1e}")
        values.append(row | {"folds": found.folds, "crossings": found.crossings, "accuracy": found.accuracy * 10})
    known = (0.0048032, 0.0000725, -0.0764418)  # called a displacement there; it is the position from the clamp
    checks.append(check("REFERENCES, full load", values[-1]["position"], known, 1e-7))
    about = (
        "Helical roll-up (Ibrahimbegovic 1997): straight rod from the origin along x, L = 10, EA = GA = 1e4, EI ="
        " GJ = 100, dead tip force 50 f along z and dead tip moment 200 pi f about z, f = load_factor; tip "
        "position, rotation q, moment in the clamp, inertial; on the branch of the unloaded state, which passes "
        "no limit point and no singular tangent. accuracy: shooting against solve_bvp, length."
    )
    return {"about": about, "digits": 8, "checks": checks, "values": values}


def pendulum(load, angle):
    """Length of the inextensible rod whose tip turned by an angle: phi'^2 = 2 P sin(phi), up to pi and back."""
    half = beta(0.25, 0.5) / np.sqrt(2 * load)

    def until(a):  # phi = t^2 takes the singularity away
        return quad(lambda t: 2 * t / np.sqrt(2 * load * np.sin(t * t)), 0, np.sqrt(a), epsabs=1e-13, epsrel=1e-13)[0]

    length = until(angle) if angle < np.pi / 2 else half - until(np.pi - angle)
    return length if half > 1 else 2 * half - length


def follower_force():
    """From tip to clamp it is an initial value problem, since the force is known in the frame of the tip."""
    values, checks = [], []
    for section in (Section(), Section(1.0, 400.0, 100.0)):
        for load in (0.01, 1, 2, 5, 10, 20, 40):
            tip = Frame(section, (Leg(-1.0),), (0, 0, 0), (0, 0, 0))
            x, y, theta, _ = tip.shoot(np.array([[0.0], [load], [0.0], [0.0]]))[1][0].y[:, -1]
            c, s = np.cos(theta), np.sin(theta)
            row = {"EA": section.EA, "GA": section.GA, "load": load}
            row |= {"x": -(c * x + s * y), "y": -(c * y - s * x), "angle": -theta}
            values.append({name: value if np.isfinite(value) else "inf" for name, value in row.items()})
            if load == 0.01:
                small = load / 3 + load / section.GA
                checks.append(check("linear theory, 0.01", row["y"], small, 3e-4 * small))
            if not np.isfinite(section.EA):
                checks.append(check(f"quadrature, {load}", pendulum(load, row["angle"]), 1.0, 1e-9))
    about = (
        "Cantilever from the origin along x, L = EI = 1, follower tip force `load` = P L^2/EI along (-sin, "
        "cos)(angle), that is perpendicular to the tip, towards +y at rest (as of Argyris & Symeonidis 1981); EA,"
        " GA as given; tip position and rotation in the plane. Statics only: a follower force may flutter before."
    )
    return {"about": about, "digits": 11, "checks": checks, "values": values}


def critical_loads():
    checks, values = [], {}
    weight = 9 / 4 * brentq(lambda z: jv(-1 / 3, z), 1.5, 2.2, xtol=1e-15) ** 2
    lateral = 2 * brentq(lambda z: jv(-1 / 4, z), 1.5, 2.5, xtol=1e-15)
    checks.append(check("REFERENCES, self-weight", weight, 7.8373474, 6e-8))
    checks.append(check("REFERENCES, lateral", lateral, 4.0126, 6e-5))

    def beck(p, w):
        root = np.sqrt(p * p / 4 + w * w)
        a, b = np.sqrt(root + p / 2), np.sqrt(root - p / 2)
        return p * p + 2 * w * w * (1 + np.cos(a) * np.cosh(b)) + p * w * np.sin(a) * np.sinh(b)

    def double(z):  # a double root in the frequency: flutter
        p, w = z
        slope = beck(complex(p), w + 1e-30j).imag / 1e-30
        return [beck(p, w) / 100, slope / 100]

    p, w = fsolve(double, [20.0, 11.0], xtol=1e-12)
    checks.append(check("REFERENCES, Beck", [p, w], [20.05095, 11.01556], 2e-5))
    values |= {"self_weight": weight, "lateral": lateral, "beck": p, "beck_frequency": w}

    def modes(problem, moment):
        return bvp.index(problem, np.array([moment, 0, 0, 1.0]), 1e-11)

    def straight(s):
        return np.broadcast_to(np.eye(3), (len(s), 3, 3))

    def column(load):
        return modes(bvp.Problem(1.0, straight, RIGID, (1.0, 1.5, 0.7), line_force=(0, 0, -load)), 0.0)

    def beam(load):
        load = load * np.sqrt(0.7)
        return modes(bvp.Problem(1.0, straight, RIGID, (1e9, 1.0, 0.7), (0, load, 0)), -load)

    for name, count, load in (("self_weight", column, weight), ("lateral", beam, lateral)):
        pair = (count(load * (1 - 1e-6)), count(load * (1 + 1e-6)))
        checks.append(check(f"conjugate points either side of {name}, 1e-6", pair, (0, 1), 0.5))
    about = (
        "self_weight: q L^3/EI of a clamped-free column (Greenhill), root of J_-1/3; lateral: P L^2/sqrt(EI GJ) "
        "of a cantilever of thin section under a tip force, root of J_-1/4 (the stiff bending infinite); beck: P "
        "L^2/EI of flutter under a tangential tip force, and beck_frequency omega L^2 sqrt(rho A/EI), no rotary "
        "inertia, no shear."
    )
    return {"about": about, "digits": 9, "checks": checks, "values": values}


def ring():
    checks = []
    for torsion in (1.0, 0.7):
        free = 2 * np.pi * np.sqrt(3) / torsion
        found = critical_twist(torsion, 0.3 * free, 1.2 * free)
        checks.append(check(f"shooting of the clamped ring, GJ/EI = {torsion}", found / free, 1.0, 1e-9))
    about = (
        "Zajac's ring (1962; Michell 1889): straight, round, inextensible and unshearable rod bent to a circle, "
        "both ends clamped at one place, one of them turned about the tangent: the plane ring writhes at this "
        "twist times EI/GJ, rad. A clamped ring and a free one have the same critical twist: a closed field less "
        "a rigid motion is a clamped field. The clamped ring of a round rod may always turn about its tangent at "
        "the clamp (its sections hold): one mode of no stiffness."
    )
    return {"about": about, "digits": 10, "checks": checks, "values": {"twist_GJ_over_EI": 2 * np.pi * np.sqrt(3)}}


ENTRIES = (
    bend_45,
    elastica,
    helical_roll_up,
    lee_frame,
    hinged_frame,
    shallow_arch,
    follower_force,
    critical_loads,
    ring,
)


def main(names):
    file = HERE / "statics.json"
    entries = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    for make in ENTRIES:
        if not names or make.__name__ in names:
            began = time.perf_counter()
            print(make.__name__)
            entries[make.__name__] = make()
            print(f"  {time.perf_counter() - began:.0f} s")
    file.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
