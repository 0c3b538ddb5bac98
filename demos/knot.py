"""An overhand knot in a nylon rod without friction, at rest under a pull, and numbers that are checked.

    python demos/knot.py              half a minute
    python demos/knot.py --quick      without a picture

The rod is given as a curve that is tied in a knot, knot.csv (lengths over the radius, in rough equilibrium). An
`Actuation` that is `permanent` takes its curvature away: a straight rod that is tied. Then its ends are pulled apart by
a little. Writes to out/: knot.png.
"""

import math
from pathlib import Path

import numpy as np
from known_numbers import Check, command, run_all

import cosserat_fenicsx as cf

#: Radius of the rod and how far its ends are pulled apart, m; Young's modulus, Pa.
RADIUS, PULL, E = 5e-4, 2.5e-5, 3e9


def knot():
    """The scene, its rod and its `RodContact`."""
    points = np.loadtxt(Path(__file__).with_name("knot.csv"), delimiter=",") * RADIUS
    curve = cf.Spline(points)
    rod = cf.Rod(curve, cf.Circle(2 * RADIUS), cf.Material(E=E, nu=0.3, density=1150.0), name="rod")

    def straight(s):
        """The opposite of the curvature, from the turn of the sections over a short length."""
        a, b = max(s - 1e-4 * RADIUS, 0.0), min(s + 1e-4 * RADIUS, rod.length)
        (before, after), here = curve.frame([a, b]), curve.frame([s])[0]
        turn = here.T @ (after - before) / (a - b)
        return turn[2, 1], turn[0, 2], turn[1, 0]

    half, touch = (PULL / 2, 0, 0), cf.RodContact()
    supports = [
        cf.Prescribed(rod.start, displacement=(-PULL / 2, 0, 0), rotation=(0, 0, 0)),
        cf.Prescribed(rod.end, displacement=half, rotation=(0, 0, 0)),
        # without friction a knot slides along the rod and turns about it: its middle is held, by forces that vanish
        *(cf.Roller(rod.at(rod.length / 2), normal) for normal in ((1, 0, 0), (0, 0, 1))),
    ]
    tied = cf.Actuation(rod, curvature=cf.signals.Along(straight), permanent=True)
    return cf.Scene([rod], supports, [touch, tied]), rod, touch


def energy(path, k, rod):
    """The strain energy of a state, J, from its forces and moments."""
    fields = path.fields(k, rod)
    axes = np.stack([fields[name] for name in ("d1", "d2", "d3")], axis=1)
    force, moment = (np.einsum("nki,ni->nk", axes, fields[name]) for name in ("force", "moment"))
    stiffness = rod.stiffness
    density = (force**2 / (*stiffness.shear, stiffness.axial) + moment**2 / (*stiffness.bending, stiffness.torsion)) / 2
    weights, degree = path.rule.lobatto, path.degree
    ends = fields["s"][::degree]
    parts = density.sum(axis=1)
    return sum(size * weights @ parts[degree * i : degree * (i + 1) + 1] for i, size in enumerate(np.diff(ends)))


def closest(path, k, rod):
    """The least distance of the axis from itself, more than pi radii apart along it, over the diameter; by samples."""
    s = np.linspace(0, 1, 3000)
    points = path.sample(k, rod, s)[0]
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    apart[np.abs(s[:, None] - s) * rod.length < math.pi * RADIUS] = np.inf
    return apart.min() / (2 * RADIUS)


def at_rest(folder=None):
    """The path of two states, and its `Check`s."""
    scene, rod, touch = knot()
    path = cf.solve(scene, [0.0, 1.0], elements=1)
    pulls = path.force(rod.end)[:, 0]
    work = energy(path, 1, rod) - energy(path, 0, rod)
    contacts = path[0].contacts(touch)
    alone, line = contacts.s[~contacts.line], contacts.s[contacts.line]
    flanked = len(alone) == 2 and alone.min() < line.min() and line.max() < alone.max()
    apart = min(closest(path, k, rod) for k in (0, 1))
    held = max(np.abs(path.reaction(support)[0]).max() for support in scene.supports[2:])
    checks = [
        Check("work of the pull, over that of the strain energy", pulls.mean() * PULL / work, 1.0, 2e-3, "no friction"),
        Check("contact along a line between two points (1: yes)", float(flanked), 1.0, 0.0, "arXiv:0812.2881"),
        Check("least distance of the axis from itself, diameters", apart, 1.0, 2e-3, "hard surfaces"),
        Check("force that holds the middle, of the pull", held / pulls[0], 0.0, 1e-3, "the knot may slide and turn"),
    ]
    if folder is not None:
        path.plot(Path(folder) / "knot.png", [0])
    return path, checks


def main(names=(), out="out"):
    """Run the demo, and print its numbers; `out`: the folder for the picture, or None. Returns a list of `Check`s."""

    def solved(demo):
        path, checks = demo(out)
        return path.model, checks

    return run_all("demos/knot.py", "demo", "An overhand knot", (at_rest,), names, solved)


if __name__ == "__main__":
    command(__doc__, (at_rest,), main, "out")
