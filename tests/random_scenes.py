"""Random scenes of one clamped rod in space, as plain numbers: for the package, and for the reference in bvp.py."""

from dataclasses import dataclass

import bvp
import numpy as np


@dataclass(frozen=True)
class RandomScene:
    """SI units; force, moment and line_force dead and inertial, at the end and along the rod.

    stiffness: K = (GA1, GA2, EA), J = (EI1, EI2, GJ); curvature: (u1, u2, u3) of the rest state, material, 1/m, whose
    frame at s = 0 is that of the quaternion `frame` at the point `start`.
    """

    seed: int
    length: float
    slenderness: float
    K: tuple
    J: tuple
    curvature: tuple
    start: tuple
    frame: tuple
    force: tuple
    moment: tuple
    line_force: tuple

    def rest_frame(self, s):
        """[d1R d2R d3R] at s (n,), (n, 3, 3)."""
        first = bvp.matrix(np.array(self.frame)[:, None])[0]
        u, s = np.array(self.curvature), np.asarray(s)[:, None, None]
        size = np.linalg.norm(u)
        if size == 0:
            return np.broadcast_to(first, (len(s), 3, 3))
        k = np.cross(np.eye(3), u / size)  # rows e_i x u: the matrix of u x
        return first @ (np.eye(3) + np.sin(s * size) * k + (1 - np.cos(s * size)) * k @ k)

    def rest(self, s):
        """r_R - start at s (n,), (3, n): the integral of d3R in closed form."""
        first = bvp.matrix(np.array(self.frame)[:, None])[0]
        u, s, e3 = np.array(self.curvature), np.asarray(s), np.array([0, 0, 1.0])
        size = np.linalg.norm(u)
        if size == 0:
            return np.outer(first @ e3, s)
        a = u / size
        side, along = np.cross(a, e3), np.cross(a, np.cross(a, e3))
        turn = s * size
        return first @ (
            np.outer(e3, s) + np.outer(side, (1 - np.cos(turn)) / size) + np.outer(along, s - np.sin(turn) / size)
        )

    def problem(self):
        return bvp.Problem(
            self.length, self.rest_frame, self.K, self.J, self.force, self.moment, line_force=self.line_force
        )

    def scene(self):
        """The package's rod and scene."""
        import cosserat_fenicsx as cf

        curve = cf.UniformCurvature(self.length, self.curvature, self.start, self.frame)
        rod = cf.Rod(curve, cf.Stiffness(shear=self.K[:2], axial=self.K[2], bending=self.J[:2], torsion=self.J[2]))
        loads = [cf.Force(rod.end, self.force)]
        loads += [cf.Moment(rod.end, self.moment)] if any(self.moment) else []
        loads += [cf.LineForce(rod, self.line_force)] if any(self.line_force) else []
        return rod, cf.Scene([rod], [cf.Clamp(rod.start)], loads)


def draw(seed):
    """One scene. EI is the smaller bending stiffness; random numbers are rounded to few digits, as in a file."""
    rng = np.random.default_rng(20250 + seed)

    def direction():
        v = rng.normal(size=3)
        return v / np.linalg.norm(v)

    def numbers(v):
        return tuple(float(f"{x:.9g}") for x in v)

    length, EI = 10 ** rng.uniform(-1, 2), 10 ** rng.uniform(-1, 6)
    slenderness, anisotropy = 10 ** rng.uniform(np.log10(20), np.log10(3e4)), rng.uniform(1, 4)
    bending = [1.0, anisotropy] if rng.random() < 0.5 else [anisotropy, 1.0]
    J = EI * np.array([*bending, rng.uniform(0.4, 1.6)])
    EA = 16 * EI * (slenderness / length) ** 2  # as of a round section of diameter length/slenderness
    K = EA * np.array([rng.uniform(0.25, 0.45), rng.uniform(0.25, 0.45), 1.0])
    about, bend, twist = rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi), rng.uniform(-2 * np.pi, 2 * np.pi)
    shape = seed % 5  # 0: straight, 1: bent, 2: twisted, 3 and 4: both
    bend, twist = bend * (shape in (1, 3, 4)), twist * (shape in (2, 3, 4))
    curvature = np.array([bend * np.cos(about), bend * np.sin(about), twist]) / length
    towards = direction()
    moment = rng.uniform(0, 4) * EI / length * direction() * (rng.random() < 0.5)
    line = rng.uniform(0, 4) * EI / length**3 * direction() * (rng.random() < 0.5)
    frame, start = rng.normal(size=4), rng.normal(size=3) * length
    frame /= np.linalg.norm(frame)
    if seed % 10 == 0:  # a straight rod beyond its Euler load, pressed within 0.1 .. 6 degrees of its axis
        towards = 10 ** rng.uniform(-3, -1) * towards - bvp.matrix(frame[:, None])[0, :, 2]
    force = (rng.uniform(2.5, 4) if seed % 10 == 0 else rng.uniform(0, 4)) * EI / length**2 * towards
    return RandomScene(
        seed, *numbers((length, slenderness)), *map(numbers, (K, J, curvature, start, frame, force, moment, line))
    )


def scenes(count=200, first=0):
    return [draw(seed) for seed in range(first, first + count)]
