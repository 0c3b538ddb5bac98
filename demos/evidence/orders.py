"""The observed orders of convergence of motions in the time step and in the mesh.

    python demos/evidence/orders.py             writes out/orders.md
    python demos/evidence/orders.py --quick     fewer steps and elements

In time: changes of positions and rotations, velocities and angular velocities at the end when the steps are halved, for
two scenes: a rod that swings between two pins, and a chain with joint, damping, prescribed motion and follower loads.
In
space: errors at three element ends against a fine mesh, all with the same steps; the motion of the rod between pins is
smooth up to its ends. Changes and errors that may be affected by rounding are marked * and not used for orders.
"""

import math

import harness
import numpy as np
from harness import command, table, write

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat

QUERIES = ("position", "rotation", "velocity", "angular_velocity")
SCHEMES = {"momentum": 2, "energy": 2, "generalised-alpha": 2, "triple-jump": 4}
STEPS, QUICK_STEPS = (40, 80, 160, 320, 640), (40, 80, 160)
MESHES = {1: (8, 16, 32, 64), 2: (8, 16, 32, 64), 3: (4, 8, 16, 24), 4: (4, 8, 12)}
QUICK_MESHES = {1: (16, 32), 2: (16, 32), 3: (8, 12), 4: (4, 8)}
# Rounding errors: of changes in time, relative; in space, as a multiple of the difference of two fine meshes.
_ROUNDING, _ABOVE = 1e-10, 20
_DURATION, _DT = 0.4, 0.05


def pinned():
    """A soft rod between two pins that starts to bend and twist in space: (rod, scene)."""
    section = cf.Stiffness((30, 30), 100, (20, 30), 20, mass=1.0, inertia=(0.1, 0.2, 0.3))
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), section)
    k = math.pi / rod.length

    def linear(s):
        return 0.3 * math.sin(2 * k * s), 1.5 * math.sin(k * s), math.sin(2 * k * s)

    def angular(s):
        return 0.8 * math.cos(k * s), -2 * k * math.cos(2 * k * s), 1.5 * k * math.cos(k * s)

    given = cf.InitialVelocity(rod, linear, angular)
    return rod, cf.Scene([rod], [cf.Pin(rod.start), cf.Pin(rod.end)], velocities=[given])


def chain():
    """Two soft damped rods with a ball joint, rotated at the root,
    under loads that vary and follow: (last rod, scene)."""
    section = cf.Stiffness((100, 100), 100, (500, 500), 500, mass=1.0, inertia=(10, 10, 20))
    damping = cf.Damping(time=0.02, drag=0.1)
    a = cf.Rod(cf.Line((0, 0, 0), (6, 0, 0)), section, name="a", damping=damping)
    b = cf.Rod(cf.Line((6, 0, 0), (6, 3, 3)), section, name="b", damping=damping)

    def smoothly(vector, k):
        return lambda t: tuple(x * math.sin(k * t) ** 4 for x in vector)

    root = cf.Prescribed(a.start, displacement=(0, 0, 0), rotation=smoothly((0, 0.3, 0.5), 1.1))
    loads = [cf.FollowerForce(b.end, smoothly((5, 8, 3), 0.9)), cf.LineForce(a, smoothly((0, 1, 2), 1.3))]
    return b, cf.Scene([a, b], [root], loads, [cf.Joint(a.end, b.start, "all")])


def in_time(scene, station, duration, scheme, steps):
    """{query: (relative changes when steps are halved; orders between them, nan where affected by rounding)}."""
    runs = [
        cf.simulate(
            scene, duration, dt=duration / n, elements=2, degree=2, scheme=scheme, save_every=duration, model="spatial"
        )
        for n in steps
    ]
    found = {}
    for query in QUERIES:
        ends = np.array([getattr(run, query)(station)[-1] for run in runs])
        changes = np.linalg.norm(np.diff(ends, axis=0), axis=1) / np.linalg.norm(ends[-1])
        found[query] = changes, orders(changes, steps[1:], _ROUNDING)
    return found


def in_space(rod, scene, degree, meshes, reference, floor):
    """(largest errors of positions over the length and of q at three element ends; orders between the meshes)."""
    errors = np.array([np.abs(at_ends(rod, scene, n, degree) - reference).max() for n in meshes])
    return errors, orders(errors, meshes, floor)


def at_ends(rod, scene, elements, degree):
    """Positions over the length and q at quarters of the rod, at the end of a motion of a few steps."""
    run = cf.simulate(scene, _DURATION, dt=_DT, elements=elements, degree=degree, save_every=_DURATION, model="spatial")
    stations = [rod.at(x * rod.length) for x in (0.25, 0.5, 0.75)]
    return np.array([[*run.position(at)[-1] / rod.length, *run.rotation(at)[-1]] for at in stations])


def orders(errors, counts, floor):
    """Orders between errors for numbers of steps or elements; nan where one of two errors is below `floor`."""
    return np.where(np.minimum(errors[:-1], errors[1:]) > floor, harness.orders(errors, counts), math.nan)


def last(observed):
    """The order of the finest two that are not affected by rounding."""
    return float(observed[np.isfinite(observed)][-1])


def words(observed):
    """Orders as text."""
    return ", ".join("*" if math.isnan(order) else f"{order:.2f}" for order in observed)


def time_table(steps):
    """(lines of the table, {(scene, scheme): {query: the finest order in dt}})."""
    (rod, swinging), (b, driven) = pinned(), chain()
    text = (
        f"Relative changes at the end from {steps[-2]} to {steps[-1]} steps, and the orders in dt observed from"
        f" {steps[0]} steps on (2 P2 elements a rod):"
    )
    rows, observed = [], {}
    for name, scene, station, duration in (("pinned", swinging, rod.at(0.5), 0.4), ("chain", driven, b.end, 2.0)):
        for scheme in SCHEMES:
            if (name, scheme) == ("chain", "triple-jump"):
                continue  # it does not allow damping
            found = in_time(scene, station, duration, scheme, steps)
            observed[name, scheme] = {query: last(ways) for query, (_, ways) in found.items()}
            rows.append((name, scheme, *(f"{changes[-1]:.1e} ({words(ways)})" for changes, ways in found.values())))
            print(*rows[-1], sep=" | ", flush=True)
    heads = "scene | scheme | position | rotation | velocity | angular velocity"
    return [text, "", *table(heads, rows)], observed


def space_table(meshes, fine):
    """(lines of the table, {degree: the finest order in h}); two fine meshes give reference and rounding."""
    rod, scene = pinned()
    other, reference = (at_ends(rod, scene, n, 4) for n in fine)
    floor = _ABOVE * np.abs(other - reference).max()
    text = (
        f"Largest errors of positions over the length and of q at element ends, rod between pins, {_DURATION / _DT:.0f}"
        f" steps of the momentum scheme, and the orders in h between the meshes (*: below {floor:.0e}, where rounding"
        " takes part):"
    )
    rows, observed = [], {}
    for degree, counts in meshes.items():
        errors, ways = in_space(rod, scene, degree, counts, reference, floor)
        observed[degree] = last(ways)
        sizes, found = ", ".join(map(str, counts)), ", ".join(f"{error:.1e}" for error in errors)
        rows.append((degree, sizes, found, words(ways), 2 * degree))
        print(*rows[-1], sep=" | ", flush=True)
    return [text, "", *table("degree p | elements | errors | orders | 2p", rows)], observed


def main(quick=False, out="out"):
    """Print the tables, write them to out/orders.md. Returns {(scene, scheme): {query: order in dt}} and {degree: order
    in h}, of the finest two that are used."""
    in_dt, temporal = time_table(QUICK_STEPS if quick else STEPS)
    in_h, spatial = space_table(QUICK_MESHES if quick else MESHES, (12, 16) if quick else (24, 32))
    lines = [f"{compat.version()}.", "", *in_dt, "", *in_h]
    write("orders", lines, out)
    return temporal, spatial


if __name__ == "__main__":
    command(__doc__, main, {"quick": True})
