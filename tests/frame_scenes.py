"""Frames of many rods, and small random ones."""

import numpy as np

import cosserat_fenicsx as cf

SECTION = cf.Stiffness(shear=(3e3, 3e3), axial=8e3, bending=(10.0, 10.0), torsion=8.0, mass=1.0)


def grid_shell(n, release=None, m=None):
    """A shell of squares with diagonals, clamped along its edge, about 3 n m rods of 1 to 1.6 m, loaded at a point.

    Args:
        n, m: squares along x and y, m = n where it is None.
        release: of a joint by its number, as for `Joint`; None for rigid ones.

    Returns:
        Rods, supports, loads and joints, as `Scene` takes them.
    """
    m, rods, joints, first = m or n, [], [], {}
    places = {(i, j): (i, j, 0.2 * n * np.sin(np.pi * i / n) * np.sin(np.pi * j / m) + 0.013 * ((7 * i + 3 * j) % 5))
              for i in range(n + 1) for j in range(m + 1)}  # fmt: skip
    for i, j in places:
        for other in ((i + 1, j), (i, j + 1), (i + 1, j + 1)):
            if other in places:
                rods.append(cf.Rod(cf.Line(places[i, j], places[other]), SECTION, name=f"r{len(rods)}"))
                for point, station in (((i, j), rods[-1].start), (other, rods[-1].end)):
                    if point in first:
                        joints.append(cf.Joint(first[point], station, release and release(len(joints))))
                    first.setdefault(point, station)
    supports = [cf.Clamp(first[i, j]) for i, j in places if i in (0, n) or j in (0, m)]
    return rods, supports, [cf.Force(first[n // 2, m // 2], (0.2, 0, -1.0))], joints


def random_frame(rng):
    """Few rods between corners of a cube, and points near them, with random supports, springs and joints.

    Returns:
        Rods, supports, loads and joints; some supports and joints may be redundant, and motions may be free.
    """

    def axis():
        return tuple(rng.choice([-1.0, 0.0, 1.0, 0.7], 3) + rng.choice([0.0, 1e-3]) * rng.standard_normal(3) + 1e-12)

    corners = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    corners = np.vstack([corners, [0.5, 0.5, 1.5]]) + rng.choice([0.0, 0.1]) * rng.standard_normal((9, 3))
    rods, ends = [], {}
    for k in range(rng.integers(1, 9)):
        a, b = (int(x) for x in rng.choice(9, 2, replace=False))
        rods.append(cf.Rod(cf.Line(corners[a], corners[b]), SECTION, name=f"r{k}"))
        ends.setdefault(a, []).append(rods[-1].start)
        ends.setdefault(b, []).append(rods[-1].end)
    released, joints = rng.choice([0.2, 0.6, 1.0]), []
    for meeting in ends.values():
        for k, station in enumerate(meeting):
            for other in meeting[:k]:
                if other is meeting[0] or rng.random() < 0.05:
                    release = None if rng.random() > released else ("all" if rng.random() < 0.5 else axis())
                    joints.append(cf.Joint(station, other, release))
    supports, loads = [], []
    for meeting in ends.values():
        for station in meeting[:2]:
            kind = rng.integers(0, 14)
            supports += {0: [cf.Clamp(station)], 1: [cf.Pin(station)], 2: [cf.Pin(station)],
                         3: [cf.Hinge(station, axis())], 4: [cf.Roller(station, axis())],
                         5: [cf.Prescribed(station, rotation=(0, 0, 0.1))]}.get(kind, [])  # fmt: skip
            if kind == 6:
                loads.append(cf.Spring(station, stiffness=3.0, direction=axis()))
    return rods, supports, loads, joints
