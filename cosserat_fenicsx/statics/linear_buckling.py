"""Linear buckling: the load factors at which the second variation, extrapolated linearly, becomes singular."""

import contextlib
import math
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.algebra import eigen
from cosserat_fenicsx.checks import number, whole
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.contacts import refuse_grazing, warn_of_contact
from cosserat_fenicsx.results.modes import Buckling
from cosserat_fenicsx.results.shapes import Equilibrium
from cosserat_fenicsx.scene.action import has_permanent
from cosserat_fenicsx.scene.scene import Scene, check_magnitudes, check_tensions
from cosserat_fenicsx.statics.critical import Energies, critical_sensitivity
from cosserat_fenicsx.statics.meshes import layers_of, until_two_meshes_agree
from cosserat_fenicsx.statics.path.follower import standing
from cosserat_fenicsx.statics.problem import check_arguments, look_beside, solvers_of
from cosserat_fenicsx.statics.small_motions import circulatory_part, edges_of_contact, static_bifurcations, switched
from cosserat_fenicsx.statics.stability import add_to, shapes_of

_MOST_ELEMENTS = 256
# Central difference of the second variation: largest displacement over the unit of length and rotation (rad); largest
# contact force and moment, in EI/L^2 and EI/L of their rod.
_MOVED, _LOADED = 1e-4, 1e-2
_NOTHING = 1e-2  # share of the tolerance below which rounding errors are not corrected
_SAMPLED = 1.5  # bound on the error by rounding of the state, over its sample at the Gauss points with one sign
# Largest share of the error by bounded stiffnesses after the correction by Rayleigh's quotient; and the factor on its
# square, of second order, unless the true stiffness is infinite.
_REMAINING, _SQUARED = 0.1, 100.0
# Linear extrapolation of the state ends where r' has changed by _TURNED (1: a deflection by half a right angle, or a
# stretch of 100 %), the contact force of a rod reaches the smallest of its EA and GA (the shear-flexible column has a
# spurious root under tension at about GA), or its contact force or moment reaches _HUGE times EI/L^2 or EI/L.
_TURNED, _HUGE = 1.5, 1e8
_BORNE = 1e-10  # contact forces over the loads below which supports carry these alone: what is found there is rounding


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
        Buckling. It holds fewer than `count` load factors, and says so, where no more are positive (counted from eta)
        and below that at which linear extrapolation ends, `Buckling.extent`; or, without a potential, where the others
        are rounding error.

    Raises:
        SceneError: an argument outside its range.
        NotConverged: the load factor is not reached, the structure is unstable there, or the accuracy is not met.
    """
    check_arguments(scene, tol, elements, owner="buckling")
    whole("buckling", "count", count)
    number("buckling", "load_factor", load_factor, "a finite number", math.isfinite)
    check_magnitudes(scene, load_factor)
    check_magnitudes(scene, 1.0, doubts=False)  # any load is a unit of load factors
    check_tensions(scene, [load_factor])
    comm = communicator(comm)

    (critical, _, state, shapes, shared, conservative, most, *_), error = until_two_meshes_agree(
        "buckling", scene, lambda layout: _critical(scene, layout, count, load_factor, tol, degree, comm), tol,
        most=_MOST_ELEMENTS, elements=elements, degree=degree, advice="a larger tol", progress=progress, comm=comm,
        least=lambda found: found[-2], places=lambda found: found[-1] and found[-1].places,
    )  # fmt: skip
    load_factors = load_factor + critical
    softness, rounding = shared
    error = np.maximum(error, softness) + rounding  # what both meshes share; NaN stays
    if (error > tol).any():
        why = (
            "rounding errors alone may be" if (rounding > tol).any() else
            "linear buckling bounds the stiffnesses against stretch and shear, which may leave an error of"
        )  # fmt: skip
        raise NotConverged(
            f"the accuracy tol = {tol:g} was not reached: {why} {error.max():.2g}. Ask for a larger tol, or for the "
            "events of `solve`."
        )
    if comm.rank == 0:
        warn_of_contact("buckling", state)
    bound = float(load_factors[0]) if len(load_factors) else most
    found = slice(0 if conservative else 1, None)  # without a potential the first one is the bound alone
    load_factors = load_factors[found]
    return Buckling(
        state, shapes, error[found], conservative, comm, load_factors, bound, most, count - len(load_factors),
        critical_sensitivity,
    )  # fmt: skip


def _critical(scene, layout, count, load_factor, tol, degree, comm):
    """The result on one mesh: changes of the load factor (n,), the lengths of boundary layers or None, the
    `Equilibrium`, shapes (m, N, 6), relative errors (2, n) of bounded stiffnesses and of rounding, whether the loads
    have a potential, and the largest load factor considered. With a potential n = m; else n = m + 1, and the bound
    comes first."""
    with (
        solvers_of(scene, layout, degree=degree, comm=comm) as (problem, newton, stability),
        circulatory_part(scene, layout, degree, comm) as circulatory,
    ):
        model = problem.model
        at_rest = problem.numbers()
        track, loaded = standing(problem, newton, stability, load_factor), load_factor or has_permanent(model.scene)
        if not loaded:
            _stay_at(track, at_rest)
        here = track.here
        layers = layers_of(model) if loaded else None
        if here.negative_modes:
            raise NotConverged(f"the structure is unstable at the load factor {load_factor:g}: expected a stable state")
        conservative = circulatory.vanishes(model.snapshot()[0], load_factor or 1.0)

        def skew():
            """The skew-symmetric part of the second variation at the state; None for loads with a potential."""
            return None if conservative else circulatory.skew(model.snapshot()[0], problem.load_factor)

        rates, unit = problem.rates(track.slope()), problem.load_derivative(problem.x).norm() or 1.0

        def moved(step):
            """Put the state extrapolated linearly by a change of the load factor; its fields at Gauss points."""
            numbers_there = [value + step * rate for value, rate in zip(here.numbers, rates, strict=True)]
            track.put(numbers_there, load_factor + step)
            problem.function(problem.x, problem.b)  # brings all that depends on the state up to date
            return model.snapshot()[1]

        change, most = _extent(model, moved, rates[0], unit)
        moved(0.0)
        state = Equilibrium.of(model, load_factor)
        look_beside(problem, load_factor)
        refuse_grazing(state, "buckling")
        if edges := edges_of_contact(model, state):
            stability.whole.lacking = edges.lacking
        slack, symmetric, modes = None, np.empty(0), []
        if math.isfinite(most):
            sides = []
            for step in (change, -change):
                moved(step)
                stability.whole.assemble(stress_alone=True)
                if scene.has_walls:  # where rods touch stays as it is
                    add_to(stability.whole.K, switched(model, state, Equilibrium.of(model, load_factor + step)))
                sides.append((stability.whole.K.copy(), skew()))
            slack, of_skew = (_decrease(*parts, change) for parts in zip(*sides, strict=True))
            moved(0.0)
            stability.whole.assemble()
            symmetric, modes = _below(most, *eigen.largest_of_pencil(slack, stability.whole.K, count + 2, 1 / most))
        values, vectors = symmetric, modes
        if conservative:
            critical, corrected = values[:count], np.ones(len(values[:count]), dtype=bool)
        else:
            if len(symmetric):
                found = static_bifurcations((slack, of_skew), (stability.whole.K, skew()), count)
                values, vectors = _below(most, *found)
            critical = np.append(symmetric[:1], values)
            corrected = np.arange(len(critical)) < 1
        chosen = [*([] if conservative else modes[:1]), *vectors][: len(critical)]
        found = quotients(problem, stability.whole, slack, chosen, _NOTHING * tol)
        of_state = _of_state(problem, stability.whole, chosen)
        # For a symmetric pencil, Rayleigh's quotient is more accurate than the eigenvalue.
        critical = np.where(corrected, found.values, 1 / critical)
        rounding = np.where(corrected, found.rounding, found.of_unsymmetric) + of_state
        remaining = _REMAINING
        if np.isfinite(model.section.K).all():
            remaining = np.minimum(_REMAINING, _SQUARED * found.softness)
        softness = np.where(corrected, remaining, 1.0) * found.softness
        whole = [np.concatenate(model.comm.allgather(vector.array_r)) for vector in vectors]
        shapes = shapes_of(whole, values, model.rows_of_nodes, model.scales.length)[:count]
        errors, beside = np.array([softness, rounding]), np.zeros(len(chosen))
        if edges:
            beside = _quadratic(edges.unknown, chosen, model.comm) / [(stability.whole.K * v).dot(v) for v in chosen]
        return critical, layers, state, shapes, errors, conservative, load_factor + most, beside, edges


def _stay_at(track, at_rest):
    """Return to the reference where it is in equilibrium: Newton's method leaves rounded contact forces there."""
    problem = track.problem
    found = problem.numbers()
    track.put(at_rest, 0.0)
    problem.function(problem.x, problem.b)
    if problem.b.norm() <= problem.model.round_off:
        track.begin_here()
    else:
        track.put(found, 0.0)
        problem.function(problem.x, problem.b)


def _of_state(problem, part, vectors):
    """(n,) relative errors of critical load factors by the rounding of strains; part: of the second variation."""
    mismatch, numbers = problem.mismatch(), problem.numbers()
    stressed = mismatch is not None and problem.model.comm.allreduce(bool(numbers[1].any()), MPI.LOR)
    if not stressed or not vectors:
        return np.zeros(len(vectors))
    whole = np.array([(part.K * v).dot(v) for v in vectors])
    sides = []
    for sign in (1, -1):
        problem.put([numbers[0], numbers[1] + sign * np.abs(mismatch)])  # of one sign: nothing cancels along the rods
        part.assemble(stress_alone=True)
        sides.append(np.array([(part.K * v).dot(v) for v in vectors]))
    problem.put(numbers)
    part.assemble()
    off = np.abs(sides[0] - sides[1]) / 2 / np.abs(whole)
    return np.full(len(off), _SAMPLED * off.max())


def _decrease(ahead, behind, change):
    """The decrease of a matrix per unit of load factor by a central difference; None where `ahead` is None."""
    if ahead is None:
        return None
    ahead.axpy(-1.0, behind)
    ahead.scale(-0.5 / change)
    return ahead


def _extent(model, moved, slope, unit):
    """The step of the load factor for difference quotients, and its largest change with physical critical loads;
    infinite where no rod bears the loads. moved: (step) -> fields at the Gauss points of the state there; slope:
    derivative of the owned unknowns by the load factor; unit: size of the loads."""
    fastest = max(model.largest(slope), 1e-200)  # rods without extension do not move
    step = min(_MOVED / fastest, 1 / unit)
    rates = (moved(step) - moved(-step)) / (2 * step)
    force, moment, tangent = (np.maximum(np.linalg.norm(part, axis=2), 1e-200) for part in np.split(rates, 3, axis=2))
    if max(force.max(), moment.max()) < _BORNE * unit:
        return step, math.inf
    lengths = [rod.length / model.scales.length for rod in model.scene.rods]
    L = np.repeat(lengths, model.layout.counts)[:, None]
    EI = model.section.J[:, :, :2].max(axis=2)
    loaded = max((force * L**2 / EI).max(), (moment * L / EI).max())
    strength = np.minimum(model.section.K.min(axis=2), _HUGE * EI / L**2)
    most = min((strength / force).min(), (_HUGE * EI / L / moment).min(), (_TURNED / tangent).min())
    return min(_MOVED / fastest, _LOADED / loaded), float(most)


def _below(most, values, vectors):
    """Eigenvalues (n,), descending, and eigenvectors of critical load factors 1/value up to `most`."""
    values = values[values * most > 1]
    return values, vectors[: len(values)]


_SAFETY = 2.0  # bound on the rounding error of x^T K x with an assembled K, over eps |x|^T |K| |x|
# With the relative error d of an eigenvalue of the assembled matrices: error of its mode's quotient over d^2, and of an
# eigenvalue of an unsymmetric pencil over the d of its mode's energy.
_OFF, _UNSYMMETRIC = 10.0, 3.0


class Quotients(NamedTuple):
    """Of n modes, (n,) each: Rayleigh's quotients K/slack, corrected for bounded stiffnesses; the shares of the
    energies due to these bounds; relative rounding errors of the quotients, and of eigenvalues of unsymmetric
    matrices."""

    values: np.ndarray
    softness: np.ndarray
    rounding: np.ndarray
    of_unsymmetric: np.ndarray


def quotients(problem, part, slack, vectors, small):
    """The `Quotients` of modes (PETSc vectors); part: assembled at the state; slack: the decrease of the second
    variation per unit of load factor; small: relative rounding errors below this may stay.

    The entries of K are as large as the stiffnesses against stretch and shear, and their rounding may exceed by far the
    stiffness of a slender rod in bending. Where it is not small, energies are computed from small strains instead; the
    errors of the quotients are then the squares of the modes' errors.
    """
    if not vectors:
        return Quotients(*(np.empty(0),) * 4)
    comm = problem.model.comm
    whole, decrease = (np.array([(A * v).dot(v) for v in vectors]) for A in (part.K, slack))
    of_slack = _rounding(slack, vectors, comm) / np.abs(decrease)
    of_matrix = _rounding(part.K, vectors, comm) / whole
    if of_matrix.max() <= small:
        softness = _softness(part, vectors, whole)
        rounding, values = of_matrix, (1 + softness) * whole / decrease
    else:
        bounded, less = _energies(problem, part, vectors)
        softness, values = less / bounded - 1, less / decrease
        of_matrix = np.abs(whole / bounded - 1)
        rounding = _OFF * of_matrix**2 + _mixed(values, of_matrix)
    return Quotients(values, softness, rounding + of_slack, _UNSYMMETRIC * of_matrix + of_slack)


def _rounding(A, vectors, comm):
    """(n,) bounds on the rounding errors of x^T A x."""
    starts, columns, values = A.getValuesCSR()
    rows, values, found = np.repeat(np.arange(len(starts) - 1), np.diff(starts)), np.abs(values), []
    for v in vectors:
        x = np.abs(v.array_r)
        found.append(float((x[rows] * values) @ np.concatenate(comm.allgather(x))[columns]))
    return _SAFETY * np.finfo(float).eps * comm.allreduce(np.array(found))


def _mixed(values, off):
    """(n,) relative errors of quotients whose modes are mixed by relative errors `off` of the eigenvalues."""
    apart = np.abs(values[:, None] - values) / np.abs(values)
    mixed = np.minimum(apart, off[:, None] ** 2 / np.where(apart > 0, apart, 1.0))
    return mixed.max(axis=1)


@contextlib.contextmanager
def _less_bounded(model):
    """Context with b (2 - b/K) instead of the bounded b, by which a mode of b has about the true mode's energy."""
    bound = model.bounded_stiffness()
    model.stiffen(bound * (2 - bound / model.section.K))
    try:
        yield
    finally:
        model.stiffen(model.bounded_K)


def _softness(part, vectors, whole):
    """(n,) shares of energies that are due to bounds; whole: (n,) the energies."""
    matrix = part.K.copy()
    with _less_bounded(part.model):
        part.load()
        part.assemble()
        part.K.axpy(-1.0, matrix)
        excess = np.array([(part.K * v).dot(v) for v in vectors])
    part.load()
    matrix.copy(part.K)
    return excess / whole


def _energies(problem, part, vectors):
    """(2, n) energies of modes from small strains: with the bounded stiffnesses, and with less of their excess."""
    model = problem.model
    rows = model.rows_of_nodes
    whole = [np.concatenate(model.comm.allgather(vector.array_r)) for vector in vectors]
    modes = [np.where(rows >= 0, vector[rows], 0.0) for vector in whole]
    energies = Energies(problem, modes, part.resistance)
    bounded = energies.here()
    more = 0.0 if part.lacking is None else _quadratic(part.lacking, vectors, model.comm)
    with _less_bounded(model):
        return np.array([bounded, energies.here()]) + more


def _quadratic(matrix, vectors, comm):
    """(n,) x^T A x of a sparse matrix of scipy and PETSc vectors."""
    whole = [np.concatenate(comm.allgather(v.array_r)) for v in vectors]
    return np.array([x @ (matrix @ x) for x in whole])
