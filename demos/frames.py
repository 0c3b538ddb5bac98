"""Frames of many rods from arrays: a gridshell, a lattice tower and a net, each with a picture and a number.

python demos/frames.py                     all of them; writes to out/frames/: NAME.png
python demos/frames.py gridshell           some
python demos/frames.py --quick             without pictures
"""

from pathlib import Path

import numpy as np
from known_numbers import Check, command, run_all

import cosserat_fenicsx as cf

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)


def grid(n, size):
    """(points (n^2, 3) of a square grid about the origin, m; edges (rods, 2) along both directions)."""
    x, y = np.meshgrid(*[np.linspace(-size / 2, size / 2, n)] * 2, indexing="ij")
    number = np.arange(n * n).reshape(n, n)
    along = [np.column_stack([number[:-1].ravel(), number[1:].ravel()])]
    along.append(np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()]))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)]), np.concatenate(along)


def gridshell():
    """A shallow dome of 20 m x 20 m, clamped along its border, under snow, up to where it buckles."""
    points, edges = grid(9, 20.0)
    points[:, 2] = 2.0 * np.cos(np.pi * points[:, 0] / 20) * np.cos(np.pi * points[:, 1] / 20)
    border = np.abs(points[:, :2]).max(axis=1) > 9.99
    edges = edges[~border[edges].all(axis=1)]
    held = np.flatnonzero(border & np.isin(np.arange(len(points)), edges))
    shell = cf.frame(points, edges, cf.Tube(0.1143, 0.1043), STEEL, clamped=held)
    snow = 1e3 * 2.5**2  # N at each point: 1 kN/m^2
    scene = shell.scene([cf.Force(shell.at(k), (0, 0, -snow)) for k in np.flatnonzero(~border).tolist()])
    linear = cf.buckling(scene, count=1).load_factors[0]
    path = cf.solve(scene, (0.0, 1.2 * linear), until=lambda path: bool(path.events))
    print(
        f"gridshell: {len(shell)} rods; linear buckling at {linear:.4f} times the snow, "
        f"exact: {path.events[0].kind} at {path.events[0].load_factor:.4f} times"
    )
    carried = sum(path.reaction(clamp)[0][-1] for clamp in shell.supports)
    load = path.load_factors[-1] * snow * np.count_nonzero(~border)
    return path, Check("the border carries (N)", carried, [0.0, 0.0, load], 1e-3, "balance of forces")


def lattice():
    """A tower of 3 x 3 m and 12 storeys that leans under a horizontal force at its top."""
    storeys, height = 12, 2.5
    corners = np.array([[-1.5, -1.5], [1.5, -1.5], [1.5, 1.5], [-1.5, 1.5]])
    points = np.array([[*corner, k * height] for k in range(storeys + 1) for corner in corners])
    edges = []
    for k in range(storeys):
        for i in range(4):
            a, b = 4 * k + i, 4 * k + (i + 1) % 4
            edges += [[a, a + 4], [a + 4, b + 4], [a, b + 4]]  # a column, a beam and a brace
    tower = cf.frame(points, edges, cf.Tube(0.1143, 0.1043), STEEL, clamped=range(4))
    top = [4 * storeys + i for i in range(4)]
    loads = [cf.Force(tower.at(k), (1e4, 0, -5e4)) for k in top]
    path = cf.solve(tower.scene([*loads, cf.Weight()]), [0.5, 1.0])
    foot = sum(path.reaction(clamp)[0][-1] for clamp in tower.supports)
    mass = sum(rod.length * rod.stiffness.mass for rod in tower.rods)
    print(f"lattice: {len(tower)} rods; the top moves by {path.displacement(tower.at(top[0]))[-1].round(4)} m")
    return path, Check("the feet carry (N)", foot, [-4e4, 0.0, 2e5 + 9.81 * mass], 1e-3, "balance of forces")


def net():
    """A net of 4 m x 4 m of thin ropes, held at its four corners, that sags under its weight and a ball of 20 kg."""
    points, edges = grid(11, 4.0)
    points[:, 2] = 0.04 * np.abs(points[:, :2]).max(axis=1) ** 2  # it hangs down from the start
    rope = cf.Material(E=1e9, nu=0.3, density=1000.0)
    corners = [0, 10, 110, 120]
    ropes = cf.frame(points, edges, cf.Circle(0.012), rope, clamped=corners)
    middle = ropes.nearest((0, 0, 0))
    path = cf.solve(
        ropes.scene([cf.Weight(), cf.Force(ropes.at(middle), (0, 0, -20 * 9.81))]), [0.1, 0.3, 1.0], tol=1e-4
    )
    carried = sum(path.reaction(clamp)[0][-1] for clamp in ropes.supports)
    mass = sum(rod.length * rod.stiffness.mass for rod in ropes.rods)
    print(f"net: {len(ropes)} rods; the ball sinks by {-path.displacement(ropes.at(middle))[-1, 2]:.4f} m")
    return path, Check("the corners carry (N)", carried, [0.0, 0.0, 9.81 * (mass + 20)], 1e-3, "balance of forces")


FRAMES = (gridshell, lattice, net)


def main(names=(), out="out/frames"):
    """Run demos, and print their numbers and whether all are right; `names`: of demos, none for all; `out`: folder for
    pictures, or None. Returns a list of `Check`s."""

    def solved(demo):
        path, check = demo()
        if out is not None:
            path.plot(Path(out) / f"{demo.__name__}.png")
        return path.model, [check]

    return run_all("demos/frames.py", "frame", "Frames: what must come out", FRAMES, names, solved)


if __name__ == "__main__":
    command(__doc__, FRAMES, main, "out/frames")
