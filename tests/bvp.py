"""An independent reference solution for one rod in space: the strong form, clamped at s = 0, under dead loads.

The path from the unloaded state is followed by arc length in the clamp's moment and the load factor (shooting with
DOP853 at 1e-7, derivatives by complex steps), its end is shot again at 1e-13, and scipy's solve_bvp (collocation)
solves the same equations from there. The difference of the last two is the reported accuracy; if it is worse than
requested, nothing is returned.
"""

from dataclasses import dataclass, field

import numpy as np
from clamped_rod import START, NoTruth, Problem, index, matrix
from scipy.integrate import solve_bvp

__all__ = ["Equilibrium", "NoTruth", "Problem", "at", "equilibrium", "follow", "index", "matrix"]


@dataclass
class Equilibrium:
    """The solution and its accuracy.

    accuracy: largest difference of r over L (and of q) between shooting and solve_bvp; nodes, rms: of solve_bvp.
    folds: limit points that the path from the unloaded state passed; crossings: steps of 1e-5 or less in which the
    determinant of the tangent or the number of negative modes changed, limit points included. index: number of negative
    modes of the (symmetric part of the) second variation; None under a line moment.
    """

    problem: Problem
    accuracy: float
    nodes: int
    rms: float
    folds: int
    crossings: int
    index: int | None
    clamp_moment: np.ndarray
    path: np.ndarray  # rows (clamp moment, load factor), in units of EI/L
    dense: object = field(repr=False)

    @property
    def verdict(self):
        """Text: how certain it is that load control with small steps from the unloaded state arrives here.

        "connected": the path met no singular tangent and ends stable; "connected, indefinite": the same, but a dead
        moment makes the symmetric part indefinite, which says nothing about stability; "beyond a bifurcation" or
        "beyond a limit point": other equilibria are also valid; "near a clamp moment": no path was followed.
        """
        if len(self.path) == 1:
            return "near a clamp moment"
        if self.folds:
            return "beyond a limit point"
        if self.crossings or (self.problem.conservative and self.index):
            return "beyond a bifurcation"
        return "connected, indefinite" if self.index or self.index is None else "connected"

    def __call__(self, s):
        """r from the clamp, q (from the reference), n, m at s (n,): arrays (3 or 4, n), SI units, inertial."""
        p, x = self.problem, np.atleast_1d(s) / self.problem.length
        y = self.dense(x)
        n = p.dimensionless["F"][:, None] + p.dimensionless["f"][:, None] * (1 - x)
        q = y[3:7] / np.linalg.norm(y[3:7], axis=0)
        return dict(r=y[:3] * p.length, q=q, n=n * p.units["force"], m=y[7:10] * p.units["moment"])


def tangent(D, before):
    t = np.linalg.svd(D)[2][3]
    return t * (1 if t @ before > 0 else -1)


def correct(problem, z, normal, rtol, tol, limit=6):
    """Newton on the end condition and normal . (z - z0) = 0; (z, derivative, number of iterations) or None."""
    z0 = z.copy()
    for k in range(limit):
        G, D = problem.misfit(z, rtol)
        step = np.linalg.solve(np.vstack([D, normal]), -np.r_[G, normal @ (z - z0)])
        z = z + step
        if not np.all(np.isfinite(z)):
            return None
        if np.abs(step).max() < tol * (1 + np.abs(z).max()):
            return z, D, k + 1
    return None


def follow(problem, most=400, rtol=1e-7):
    """The branch from the unloaded state to the first point of load factor 1.

    Returns:
        rows (clamp moment, load factor), number of limit points, number of singular tangents (limit points among them).
    """
    z = np.zeros(4)
    _, D = problem.misfit(z, rtol)
    t = tangent(D, np.array([0, 0, 0, 1.0]))
    path, folds, crossings, ds = [z], 0, 0, 0.25
    character = (1.0, 0)
    reach = 20 * (
        1
        + np.linalg.norm(problem.dimensionless["F"])
        + np.linalg.norm(problem.dimensionless["f"])
        + np.linalg.norm(problem.dimensionless["M"])
    )
    while len(path) < most and ds > 1e-6:
        last = t[3] > 0 and z[3] + ds * t[3] >= 1
        size = (1 - z[3]) / t[3] if last else ds
        guess = z + size * t
        if last:
            guess[3] = 1.0
        try:
            found = correct(problem, guess, np.array([0, 0, 0, 1.0]) if last else t, rtol, 1e-6)
        except (NoTruth, np.linalg.LinAlgError):
            found = None
        if found is not None:
            new, D, iterations = found
            after = tangent(D, t)
            # a step that turns sharply, or whose correction is a large part of its length, may have left the branch
            if after @ t < 0.9 or np.linalg.norm(new - guess) > 0.2 * size + 1e-9 or new[3] > 1:
                found = None
        if found is None:
            ds = 0.5 * min(ds, size)
            continue
        fold = after[3] * t[3] < 0
        kind = (np.sign(np.linalg.det(D[:, :3])), index(problem, new, rtol) if problem.conservative else 0)
        if kind != character and not fold and size > 1e-5:
            # a bifurcation, or a jump between two branches close to one: only short steps distinguish these
            ds = 0.5 * size
            continue
        folds, crossings = folds + int(fold), crossings + int(kind != character)
        z, t, character = new, after, kind
        path.append(z)
        if last:
            return np.array(path), folds, crossings
        if np.linalg.norm(z[:3]) > reach:
            break
        ds *= 1.6 if iterations <= 3 else 1.0
    raise NoTruth(f"the path stopped at load factor {z[3]:.4f} after {len(path)} points and {folds} limit points")


def at(problem, clamp_moment, path=None, folds=0, crossings=0, tol=1e-10, nodes=20000):
    """The equilibrium at full load nearest to a clamp moment (3,) N m, or the end of a path, to the accuracy tol."""
    z = np.r_[np.asarray(clamp_moment) / problem.units["moment"], 1.0]
    found = correct(problem, z, np.array([0, 0, 0, 1.0]), 1e-13, 1e-9)
    if found is None:
        raise NoTruth("shooting did not converge at full load")
    z = found[0]
    y = np.zeros((10, 1))
    y[:7, 0], y[7:10, 0] = START, z[:3]
    shot = problem.shoot(y, 1.0, 1e-13, dense=True)
    x = np.linspace(0, 1, 101)

    def ends(a, b):
        return np.r_[a[:7] - START, b[7:10] - problem.end_moment(b[3:7, None], 1.0)[:, 0]]

    solved = solve_bvp(
        lambda s, v: problem.slope(s, v, 1.0),
        ends,
        x,
        shot.sol(x),
        tol=100 * tol,  # of the residual; the solution is two orders more accurate
        bc_tol=0.01 * tol,
        max_nodes=nodes,
    )
    if not solved.success:
        raise NoTruth(f"solve_bvp: {solved.message}")
    x = np.linspace(0, 1, 301)
    difference = float(np.abs(solved.sol(x)[:7] - shot.sol(x)[:7]).max())
    if not difference <= tol:
        raise NoTruth(f"shooting and solve_bvp differ by {difference:.1e} of the length, asked was {tol:.1e}")
    return Equilibrium(
        problem,
        difference,
        nodes=len(solved.x),
        rms=float(solved.rms_residuals.max()),
        folds=folds,
        crossings=crossings,
        index=None if np.any(problem.dimensionless["mu"]) else index(problem, z),
        clamp_moment=z[:3] * problem.units["moment"],
        path=np.array([z]) if path is None else path,
        dense=shot.sol,
    )


def equilibrium(problem, tol=1e-10):
    """The first state at full load on the branch of the unloaded state.

    Raises:
        NoTruth: the branch does not reach full load, or not to the accuracy tol.
    """
    path, folds, crossings = follow(problem)
    return at(problem, path[-1][:3] * problem.units["moment"], path, folds, crossings, tol)
