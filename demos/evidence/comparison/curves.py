"""The curves of Figure 3, each as a dict for JSON: eta, delta (m) and further results."""

import sys
import time
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from mpi4py import MPI

import cosserat_fenicsx as cf
from comparison import corotational, mcre
from comparison.column import Column
from comparison.follow import Stopped, follow, newton
from comparison.mcre_limit import TruncatedColumn
from comparison.solid_bar import SolidBar
from cosserat_fenicsx import analytic
from cosserat_fenicsx.progress import Progress


@dataclass(frozen=True)
class Settings:
    """Load factors of the rods, and of the co-rotational beam and the solid (coarse_etas); elements of that beam
    (rungs) and of the MCRE; along, refinement: of the solid's mesh, see `SolidBar`; finer, finer_etas: elements along
    its finer mesh, and where it is solved on that too; clamped_etas: where it is solved with all displacements of its
    foot fixed."""

    etas: tuple
    coarse_etas: tuple
    rungs: tuple
    mcre: tuple
    along: int
    refinement: int
    finer: int
    finer_etas: tuple
    clamped_etas: tuple


_WHOLE = np.round(
    np.union1d(np.arange(1, 41) / 20, [0.85, 0.875, 0.925, 0.96, 0.97, 0.98, 0.99, 1.01, 1.02, 1.03, 1.07]), 6
)
FULL = Settings(
    etas=tuple(_WHOLE.tolist()),
    coarse_etas=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.35, 1.5, 1.75, 2.0),
    rungs=(8, 16, 32, 64, 128, 256),
    mcre=(1, 2, 4, 8, 16, 32, 64, 128, 256),
    along=40,
    refinement=2,
    finer=64,
    finer_etas=(0.5, 0.9, 1.0, 1.5, 2.0),
    clamped_etas=(0.9, 1.0),
)
QUICK = Settings(
    etas=tuple(np.union1d(_WHOLE[1::4], 0.9).tolist()),
    coarse_etas=(0.5, 0.7, 0.9),
    rungs=(16, 32, 64),
    mcre=(1, 2, 32),
    along=12,
    refinement=1,
    finer=16,
    finer_etas=(0.9,),
    clamped_etas=(0.9,),
)
#: Number of elements that represents a fine mesh of the MCRE.
MANY = 32


def column(arm=False):
    """The paper's rod and scene: a constant tip moment, or the force on an arm that turns with the tip section."""
    data = Column()
    rod = cf.Rod(
        cf.Line((0, 0, 0), (0, 0, data.length)),
        cf.Circle(data.diameter),
        cf.Material(E=data.E, nu=data.nu),
        name="column",
    )
    P, e = cf.euler_load(rod), data.eccentricity
    if arm:
        loads = [cf.EccentricForce(rod.end, (0, 0, -P), (e, 0))]
    else:
        loads = [cf.Force(rod.end, (0, 0, -P)), cf.Moment(rod.end, (0, P * e, 0))]
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], loads)


def exact(etas, arm=False):
    """delta (m) of the exact extensible, shearable rod, by quadrature."""
    data = Column()
    stiffness = {"bending": data.bending, "axial": data.axial, "shear": data.shear}
    return analytic.reissner(np.asarray(etas, dtype=float), data.eccentricity, data.length, **stiffness, arm=arm).delta


def rod(settings, formulation, arm=False):
    """The Cosserat rod in space, eq. (1), to tol = 1e-6."""
    line, scene = column(arm)
    path = cf.solve(scene, list(settings.etas), model="spatial", formulation=formulation, tol=1e-6)
    delta = path.displacement(line.end)[:, 0]
    return {
        "eta": path.load_factors.tolist(),
        "delta": delta.tolist(),
        "stable": bool(path.stable.all()),
        "error": float(np.abs(delta / exact(path.load_factors, arm) - 1).max()),
        "degree": path.degree,
        "elements": int(sum(path.elements)),
    }


def beam(settings):
    """The co-rotational beam: its finest curve, and delta on every mesh at the same load factors."""
    meshes = {n: corotational.solve(settings.coarse_etas, n) for n in settings.rungs}
    finest = meshes[settings.rungs[-1]]
    return {
        "eta": finest.eta.tolist(),
        "delta": finest.delta.tolist(),
        "elements": settings.rungs[-1],
        "meshes": {str(n): curve.delta.tolist() for n, curve in meshes.items()},
    }


def truncated(settings):
    """The reconstructed MCRE: branches through the limit point with 1, 2 and many elements, all limit points found, and
    the truncated energy, the limit under mesh refinement."""
    found = {}
    for name, problem in [(str(n), mcre.problem(n)) for n in settings.mcre] + [("limit", TruncatedColumn())]:
        top = mcre.limit(problem)
        found[name] = {"limit_point": {"eta": top.eta, "delta": float(top.delta), "rotation": float(top.rotation)}}
        if name in ("1", "2", str(MANY), "limit"):
            points = mcre.branch(problem, 1.6 * top.delta)
            found[name]["eta"] = [p.eta for p in points]
            found[name]["delta"] = [float(problem.tip(p.x)[0]) for p in points]
            found[name]["negative_modes"] = [p.negative_modes for p in points]
    at = mcre.solve([0.6], MANY)
    return {"elements": found, "delta_at_0.6": float(at.delta[0]), "stopped": mcre.solve([1.0], MANY).stopped}


def solid(settings, keep, clamp, points=(), so_far=None):
    """The three-dimensional bar.

    Args:
        keep: called after every point with the curve so far and the last three points.
        clamp: see `SolidBar`.
        points, so_far: the last arguments of `keep` of an interrupted run.
    """
    bar = SolidBar(Column(arm=True), settings.along, settings.refinement, clamp)
    finer = SolidBar(Column(arm=True), settings.finer, settings.refinement) if clamp == "plane" else None
    wanted = settings.coarse_etas if clamp == "plane" else settings.clamped_etas
    curve = so_far or {"eta": [], "delta": [], "unknowns": bar.size, "along": bar.along, "elements": bar.elements,
                        "iterations": []}  # fmt: skip
    known, began = list(points), time.perf_counter() - curve.get("seconds", 0.0)
    etas = [eta for eta in wanted if eta not in curve["eta"]]
    with Progress(etas, None, MPI.COMM_SELF) as progress:
        progress.start("3D elasticity" + (", foot fixed" if clamp == "face" else ""))
        for point in follow(bar, etas, points=known, tolerance=1e-4):  # of the last step: the error is its square
            known = [*known[-2:], point]
            curve["eta"].append(point.eta)
            curve["delta"].append(float(bar.tip(point.x)[0]))
            curve["iterations"].append(point.iterations)
            if finer and point.eta in settings.finer_etas:
                _on_finer(finer, bar, point, curve)
            curve["seconds"] = round(time.perf_counter() - began, 2)
            keep(curve, known)
            progress.at(SimpleNamespace(load_factor=point.eta))
    return curve


def _on_finer(finer, bar, point, curve):
    """Solve on the finer mesh, starting from the point on the coarser one, and store delta."""
    x, _ = newton(finer, finer.carried(bar, point.x), point.eta, tolerance=1e-4)
    if x is None:
        raise Stopped(f"Newton's method does not converge on the finer mesh at the load factor {point.eta:g}")
    found = curve.setdefault("finer", {"eta": [], "delta": [], "along": finer.along, "unknowns": finer.size})
    found["eta"].append(point.eta)
    found["delta"].append(float(finer.tip(x)[0]))


def timed(name, compute):
    """The curve that `compute()` returns, with its computing time; prints a line of progress."""
    began = time.perf_counter()
    found = compute()
    found.setdefault("seconds", round(time.perf_counter() - began, 2))
    print(f"{name}: {found['seconds']:.1f} s", file=sys.stderr, flush=True)
    return found
