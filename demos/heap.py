"""A heap of thirty rods that falls onto a floor and comes to rest, with friction, and numbers that are checked.

    python demos/heap.py              30 rods (about two minutes)
    python demos/heap.py --quick      six rods, without a picture

Writes to out/: heap.png.
"""

import math
from itertools import combinations
from pathlib import Path

import numpy as np
from known_numbers import Check, command, run_all

import cosserat_fenicsx as cf

#: Of the rods: diameter, length, distance of two side by side, m; coefficient of friction; times of the motions, s.
DIAMETER, LENGTH, APART, FRICTION, LONG, SHORT = 0.012, 0.3, 0.1, 0.3, 0.6, 0.1


def heap(layers, seed=3):
    """Layers of two rods each, turned at random, one above the other at a quarter of the diameter.

    Returns:
        a `Scene`.
    """
    random, angle, rods = np.random.default_rng(seed), 0.0, []
    aluminium, damping = cf.Material(E=70e9, nu=0.3, density=2700.0), cf.Damping(drag=4.0, time=1e-4)
    for layer in range(layers):
        angle += random.uniform(0.6, 2.5)
        along, across = (
            np.array((math.cos(angle), math.sin(angle), 0)),
            np.array((-math.sin(angle), math.cos(angle), 0)),
        )
        for side in (-0.5, 0.5):
            middle = side * APART * across + random.uniform(-0.02, 0.02) * along
            middle[2] = DIAMETER * (0.6 + 1.25 * layer)
            line = cf.Line(tuple(middle - LENGTH / 2 * along), tuple(middle + LENGTH / 2 * along))
            rods.append(cf.Rod(line, cf.Circle(DIAMETER), aluminium, name=f"rod {len(rods)}", damping=damping))
    touch = cf.RodContact(stiffness=1e7, damping=20.0, friction=FRICTION, itself=False)
    floor = cf.Plane((0, 0, 0), (0, 0, 1), friction=FRICTION, stiffness=1e7)
    return cf.Scene(rods, [], [touch, cf.Weight(), floor])


def closest(history, k):
    """The smallest distance of two axes in state k over the diameter, by samples alone."""
    axes = [history.sample(k, rod, np.linspace(0, 1, 200))[0] for rod in history.scene.rods]
    return min(np.linalg.norm(a[:, None] - b, axis=2).min() for a, b in combinations(axes, 2)) / DIAMETER


def comes_to_rest(layers, duration, dt, still, folder=None):
    """Its history, and the `Check`s: what is left of the energy that it had above the floor (at most `still`), how deep
    rods overlap at any time, and between which heights they lie."""
    scene = heap(layers)
    history = cf.simulate(scene, duration, dt=dt, elements=3, degree=2, save_every=0.02)
    z = np.array([history.position(rod.at(LENGTH / 2))[:, 2] for rod in scene.rods])
    weight = 9.81 * sum(rod.length * rod.profile.range[0].mass for rod in scene.rods)
    left = history.kinetic[-1] / (weight * (z[:, 0].mean() - DIAMETER / 2))
    deepest = 1 - min(closest(history, k) for k in range(len(history)))
    below, above = DIAMETER / 2 - z[:, -1].min(), z[:, -1].max() - DIAMETER * (layers - 0.5)
    checks = [
        Check("kinetic energy at the end, of all energy", left, 0.0, still, "rest"),
        Check("deepest overlap, of the diameter", max(deepest, 0.0), 0.0, 0.06, "surfaces are elastic"),
        Check("below the lowest height, mm", max(1e3 * below, 0.0), 0.0, 0.1, "a rod on the floor"),
        Check("above the highest one, mm", max(1e3 * above, 0.0), 0.0, 0.1, "layers on each other"),
    ]
    if folder is not None:
        history.plot(Path(folder) / "heap.png", [0, len(history) - 1])
    return history, checks


def thirty_rods(folder):
    """Thirty rods."""
    return comes_to_rest(15, LONG, 5e-4, 1e-4, folder)


def six_rods(folder=None):
    """Six rods."""
    return comes_to_rest(3, SHORT, 1e-3, 1e-2)


def main(names=(), out="out"):
    """Run the demo, and print its numbers; `out`: the folder for the picture, or None for six rods. Returns a list of
    `Check`s."""
    demos = (thirty_rods,) if out is not None else (six_rods,)

    def solved(demo):
        history, checks = demo(out)
        return history.model, checks, history.steps[-1]

    return run_all("demos/heap.py", "demo", "A heap that comes to rest", demos, names, solved, ["steps"])


if __name__ == "__main__":
    command(__doc__, (thirty_rods, six_rods), main, "out")
