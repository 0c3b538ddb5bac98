"""Linear buckling: the load factors at which the second variation, extrapolated linearly, becomes singular."""

import math
import numbers

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.algebra import eigen
from cosserat_fenicsx.checks import number
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.progress import MeshProgress
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.buckling import Buckling
from cosserat_fenicsx.results.shapes import Equilibrium
from cosserat_fenicsx.scene.action import has_permanent
from cosserat_fenicsx.scene.magnitudes import check_magnitudes
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.statics.agreement import until_two_meshes_agree
from cosserat_fenicsx.statics.circulatory import circulatory_part
from cosserat_fenicsx.statics.critical import critical_sensitivity
from cosserat_fenicsx.statics.divergence import static_bifurcations
from cosserat_fenicsx.statics.first_mesh import FIRST_ELEMENTS
from cosserat_fenicsx.statics.grading import layers_of
from cosserat_fenicsx.statics.path.follower import Follower
from cosserat_fenicsx.statics.path.load_control import StepControl
from cosserat_fenicsx.statics.shapes import shapes_of
from cosserat_fenicsx.statics.solve import check_arguments
from cosserat_fenicsx.statics.solvers import solvers_of

_MOST_ELEMENTS = 256
# Step of the load factor in the central difference of the second variation: first such that the load changes by this
# much, in the units EI/L^2 and EI/L; then as a share of the lowest critical load factor, counted from the state.
_STEP, _SHARE = 1e-3, 1e-2
# Largest share of the error of bounded stiffnesses that remains after the correction by Rayleigh's quotient.
_REMAINING = 0.1
# Largest critical load, in the same units. It is also bounded by the load at which the force in a rod reaches the
# smallest of its EA and GA: the shear-flexible column has a spurious root under tension at about GA.
_HUGE = 1e8


def buckling(
    scene: Scene,
    count: int = 1,
    *,
    load_factor: float = 0.0,
    tol: float = 1e-5,
    elements: int | None = None,
    degree: int = 4,
    comm: MPI.Comm | None = None,
    progress: bool | None = None,
) -> Buckling:
    """Critical load factors and modes by linear buckling.

    The critical load factors are eta + lambda where K(eta) + lambda dK/deta is singular. K is the second variation at
    the load factor eta (0: the unloaded reference) and dK/deta its derivative due to the contact force and moment
    alone (geometric stiffness), as in textbooks and codes: prestress counts, further bending and shortening do not.
    Shear counts, P (1 + P/GA) = P_Euler of a column. Where a structure bends much before it buckles, as an arch does,
    this is an estimate, and the events of `solve` are the answer; for a straight column the relative error of the
    critical load is its axial strain at buckling. From a prestressed state (`load_factor`) close to the critical load
    the estimate is good.

    Loads without a potential make K and dK/deta unsymmetric. The load factors are then the real ones at which the
    unsymmetric sum is singular (static bifurcations, also called divergence), of which there may be none, as in Beck's
    column; flutter is not detected. See `Buckling.conservative` and `Buckling.bound`.

    Args:
        scene: a `Scene`.
        count: number of critical load factors.
        load_factor: eta, a stable point of the path of load control.
        tol: relative accuracy of the load factors: elements are doubled until two meshes agree to it, unless
            `elements` is given.
        elements: elements per rod; fixes the mesh.
        degree: 1 to 4, of r and q.
        comm: MPI communicator; default all ranks. Every rank calls.
        progress: True, False, or None to show it in runs of more than two seconds.

    Returns:
        Buckling. It holds fewer than `count` load factors where no more are positive (counted from eta) and below that
        at which the contact force of a rod reaches the smallest of its EA and GA; or, without a potential, where the
        others are rounding error.

    Raises:
        SceneError: an argument outside its range.
        NotConverged: the load factor is not reached, the structure is unstable there, or the accuracy is not met.
    """
    check_arguments(scene, tol, elements)
    if isinstance(count, bool) or not isinstance(count, numbers.Integral) or count < 1:
        raise SceneError(f"count = {count!r}: expected a whole number above zero")
    number("buckling", "load_factor", load_factor, "a finite number", math.isfinite)
    check_magnitudes(scene, max(abs(load_factor), 1.0))
    comm = communicator(comm)

    def apart(fine, coarse):
        return np.abs(fine - coarse) / np.abs(fine - load_factor)

    with MeshProgress("buckling", tol, progress, comm) as bar:
        (load_factors, _, state, shapes, softness, conservative, most), error, _ = until_two_meshes_agree(
            scene,
            lambda layout: _critical(scene, layout, count, load_factor, degree, comm),
            apart,
            tol,
            first=FIRST_ELEMENTS,
            most=_MOST_ELEMENTS,
            elements=elements,
            degree=degree,
            progress=bar,
            advice="a larger tol",
        )
    error = np.maximum(error, softness)  # an error that both meshes share; NaN stays
    if (error > tol).any():
        raise NotConverged(
            f"the accuracy tol = {tol:g} was not reached: linear buckling bounds the stiffnesses against stretch and "
            f"shear, which may leave an error of {error.max():.2g}. Ask for a larger tol, or for the events of `solve`."
        )
    bound = float(load_factors[0]) if len(load_factors) else most
    found = slice(0 if conservative else 1, None)  # without a potential the first one is the bound alone
    return Buckling(state, shapes, error[found], conservative, comm, load_factors[found], bound, critical_sensitivity)


def _critical(scene, layout, count, load_factor, degree, comm):
    """The result on one mesh.

    Returns:
        Load factors (n,), the lengths of boundary layers or None, the `Equilibrium`, shapes (m, N, 6), relative errors
        (n,) of bounded stiffnesses, whether the loads have a potential, and the largest load factor that is considered.
        With a potential n = m; else n = m + 1, and the bound comes first.
    """
    with (
        solvers_of(scene, layout, degree=degree, comm=comm) as solvers,
        circulatory_part(scene, layout, degree, comm) as circulatory,
    ):
        return _critical_by(*solvers, circulatory, count, load_factor)


def _critical_by(problem, newton, stability, circulatory, count, load_factor):
    model = problem.model
    follower = Follower(problem, newton, stability, StepControl(), control="load")
    track = follower.track
    follower.begin()
    if load_factor and not follower.to(load_factor, abs(load_factor)):
        raise NotConverged(f"no equilibrium was found at the load factor {load_factor:g}: {track.failure}")
    here = track.here
    layers = layers_of(model) if load_factor or has_permanent(model.scene) else None
    if here.negative_modes:
        raise NotConverged(f"the structure is unstable at the load factor {load_factor:g}: expected a stable state")
    conservative = circulatory.vanishes(model.snapshot()[0], load_factor or 1.0)

    def skew():
        """The skew-symmetric part of the second variation at the state; None for loads with a potential."""
        return None if conservative else circulatory.skew(model.snapshot()[0], problem.load_factor)

    slope = track.slope()
    unit = problem.load_derivative(problem.x).norm() or 1.0

    def pencil(change):
        """-dK/deta by a central difference with this change of the load factor, that of the skew part, the largest
        physical load factor, and the eigenvalues and modes of the symmetric pencil."""
        sides, forces = [], []
        for step in (change, -change):
            numbers_there = [here.numbers[0] + step * slope, *(values.copy() for values in here.numbers[1:])]
            if not track.at_load(numbers_there, load_factor + step).converged:
                raise NotConverged(f"no equilibrium was found next to the load factor {load_factor:g}: {track.failure}")
            stability.whole.assemble(stress_alone=True)
            sides.append((stability.whole.K.copy(), skew()))
            forces.append(model.snapshot()[1][..., : model.force_size])
        slack, of_skew = (_decrease(*parts, change) for parts in zip(*sides, strict=True))
        most = _most(model, (forces[0] - forces[1]) / (2 * change), unit)
        track.restore()
        stability.whole.assemble()
        found = _below(most, *eigen.largest_of_pencil(slack, stability.whole.K, count + 2))
        return slack, of_skew, most, *found

    slack, of_skew, most, symmetric, modes = pencil(_STEP / unit)
    if len(symmetric) and not 0.3 < symmetric[0] * _STEP / (unit * _SHARE) < 3:
        slack, of_skew, most, symmetric, modes = pencil(_SHARE / symmetric[0])
    if conservative:
        values, vectors = symmetric, modes
        critical, corrected = values[:count], np.ones(len(values[:count]), dtype=bool)
    else:
        whole = (slack, of_skew), (stability.whole.K, skew())
        found = static_bifurcations(*whole, count) if len(symmetric) else (symmetric, modes)
        values, vectors = _below(most, *found)
        critical = np.append(symmetric[:1], values)
        corrected = np.arange(len(critical)) < 1
    softness = _softness(stability.whole, [*([] if conservative else modes[:1]), *vectors][: len(critical)])
    # For a symmetric pencil, Rayleigh's quotient without that share of the energy is more accurate.
    critical = np.where(corrected, 1 + softness, 1.0) / critical
    softness = np.where(corrected, _REMAINING, 1.0) * softness
    whole = [np.concatenate(model.comm.allgather(vector.array_r)) for vector in vectors]
    shapes = shapes_of(whole, values, model.rows_of_nodes, model.scales.length)[:count]
    state = Equilibrium.of(model, load_factor)
    return load_factor + critical, layers, state, shapes, softness, conservative, load_factor + most


def _decrease(ahead, behind, change):
    """The decrease of a matrix per unit of load factor by a central difference; None where `ahead` is None."""
    if ahead is None:
        return None
    ahead.axpy(-1.0, behind)
    ahead.scale(-0.5 / change)
    return ahead


def _most(model, rates, unit):
    """The largest change of the load factor for which critical loads are physical.

    Args:
        rates: (elements, points, 3) derivative of the contact force by the load factor, dimensionless; unit: the size
            of the loads.
    """
    rates = np.maximum(np.linalg.norm(rates, axis=2), 1e-300)
    return float(min(_HUGE / unit, (np.minimum(model.section.K, _HUGE).min(axis=2) / rates).min()))


def _below(most, values, vectors):
    """The eigenvalues (n,), descending, and eigenvectors with critical load factors 1/value up to `most`.

    The others are zero but for rounding, or negative: those of the opposite load.
    """
    values = values[values * most > 1]
    return values, vectors[: len(values)]


def _softness(part, vectors):
    """(n,) shares of the modes' energies in stretch and shear that are due to the bounds of these stiffnesses.

    Args:
        part: the `Part` of the second variation, assembled at the state.
        vectors: modes, PETSc vectors in its numbering.
    """
    model, whole = part.model, part.K.copy()
    bound = model.bounded_stiffness()
    model.stiffen(bound * (2 - bound / model.section.K))  # increases the energy by the excess of bounded stiffnesses
    part.load()
    part.assemble()
    part.K.axpy(-1.0, whole)
    energies = [((part.K * v).dot(v), (whole * v).dot(v)) for v in vectors]
    model.stiffen(model.bounded_K)
    part.load()
    return np.array([of_excess / of_all for of_excess, of_all in energies])
