"""Linear buckling: the load factors at which a stable state, extrapolated, loses its stability."""

import math
import numbers
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.algebra import eigen
from cosserat_fenicsx.checks import number
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.results.on_nodes import OnNodes
from cosserat_fenicsx.statics.continuation import StepControl
from cosserat_fenicsx.statics.first_mesh import FIRST_ELEMENTS
from cosserat_fenicsx.statics.follow import Follower
from cosserat_fenicsx.statics.refinement import until_two_meshes_agree
from cosserat_fenicsx.statics.solve import check_arguments
from cosserat_fenicsx.statics.solvers import solvers_of
from cosserat_fenicsx.statics.stability import oriented

_MOST_ELEMENTS = 256
# The state is moved by this much of a unit load (EI/L^2, EI/L) to either side for the change of the second variation.
_STEP = 1e-3
# What Rayleigh's quotient leaves of the error of bounded stiffnesses, at most.
_LEFT = 0.1
# No rod bears more than this, in the same units, nor more than EA or GA: at about GA the pencil has a root under tension.
_HUGE = 1e8
# Load factors nearer than this to one another are one, with several modes.
_SAME = 1e-6


@dataclass(frozen=True, eq=False)
class Buckling(OnNodes):
    """Result of `buckling`.

    Attributes:
        scene: the scene.
        load_factors: (n,) critical load factors, ascending from the state they are counted from.
        modes: (n, N, 3) displacements, inertial, of all nodes of all rods in the scene's order; the largest has length 1.
        error: (n,) estimated relative error of the load factors; NaN where the mesh was given.
        elements: of each rod.
        degree: of the elements.
    """

    scene: object = field(repr=False)
    load_factors: np.ndarray
    modes: np.ndarray = field(repr=False)
    error: np.ndarray
    elements: tuple
    degree: int

    def mode(self, k, rod=None):
        """(nodes, 3) the k-th mode at the nodes of a rod (default the first)."""
        return self.modes[k, self._rows(rod)[1]]


def buckling(scene, count=1, *, load_factor=0.0, tol=1e-5, elements=None, degree=4, comm=None):
    """Critical load factors and modes by linear buckling.

    K(eta) + lambda dK/deta is singular, with K the second variation at the load factor eta (0: the unloaded
    reference) and dK/deta its change with the contact force and moment alone, as in textbooks and codes: the rod is
    prestressed there, but neither bent nor shortened further; shear counts, P (1 + P/GA) = P_Euler of a column. Where a
    structure bends much before it buckles, as an arch does, this is an estimate, and the events of `solve` are the answer; a
    straight column's critical load is off by its strain at buckling. From a prestressed state (`load_factor`) near the answer
    the estimate is good.

    Args:
        scene: a `Scene`.
        count: how many.
        load_factor: eta, a stable point of the path of load control.
        tol: relative accuracy of the load factors: elements are doubled until two meshes agree to it, unless
            `elements` is given.
        elements: elements per rod; fixes the mesh.
        degree: 1 to 4, of r and q.
        comm: MPI communicator; default all ranks. Every rank calls.

    Returns:
        Buckling. It holds fewer than `count` load factors where no more lie on the side of positive load, below the smallest EA
        and GA.

    Raises:
        SceneError: an argument outside its range.
        NotConverged: the load factor is not reached, or the structure is unstable there; or the accuracy is not met.
    """
    check_arguments(scene, tol, elements)
    if isinstance(count, bool) or not isinstance(count, numbers.Integral) or count < 1:
        raise SceneError(f"count = {count!r}: expected a whole number above zero")
    number("buckling", "load_factor", load_factor, "a finite number", math.isfinite)
    comm = comm or MPI.COMM_WORLD

    def apart(fine, coarse):
        return np.abs(fine - coarse) / np.abs(fine - load_factor)

    (load_factors, modes, softness), error, layout = until_two_meshes_agree(
        scene,
        lambda layout: _critical(scene, layout, count, load_factor, degree, comm),
        apart,
        tol,
        first=FIRST_ELEMENTS,
        most=_MOST_ELEMENTS,
        elements=elements,
        degree=degree,
        advice="a larger tol",
    )
    error = np.maximum(error, softness)  # which both meshes have in common; NaN stays
    if (error > tol).any():
        raise NotConverged(
            f"the accuracy tol = {tol:g} was not reached: linear buckling bounds the stiffnesses against stretch and shear, which may "
            f"leave an error of {error.max():.2g}. Ask for a larger tol, or for the events of `solve`."
        )
    return Buckling(scene, load_factors, modes, error, layout.counts, degree)


def _critical(scene, layout, count, load_factor, degree, comm):
    """Load factors (n,), modes (n, N, 3), and relative errors (n,) of bounded stiffnesses, on one mesh."""
    problem, newton, stability = solvers_of(scene, layout, degree=degree, comm=comm)
    model = problem.model
    follower = Follower(problem, newton, stability, StepControl(), control="load")
    track = follower.track
    if load_factor and not follower.to(load_factor, abs(load_factor)):
        raise NotConverged(f"no equilibrium was found at the load factor {load_factor:g}: {track.failure}")
    here = track.here
    if here.negative_modes:
        raise NotConverged(f"the structure is unstable at the load factor {load_factor:g}: expected a stable state")
    slope = track.slope()
    unit = problem.load_derivative(problem.x).norm() or 1.0
    change = _STEP / unit
    sides = []
    for step in (change, -change):
        numbers_there = [here.numbers[0] + step * slope, *(values.copy() for values in here.numbers[1:])]
        if not track.at_load(numbers_there, load_factor + step).converged:
            raise NotConverged(f"no equilibrium was found next to the load factor {load_factor:g}: {track.failure}")
        stability.whole.assemble(stress_alone=True)
        sides.append(stability.whole.K.copy())
    slack, other = sides
    slack.axpy(-1.0, other)
    slack.scale(-0.5 / change)
    track.restore()
    stability.whole.assemble()
    values, vectors = eigen.largest_of_pencil(slack, stability.whole.K, count + 2)
    true = model.data.K.x.array
    softest = comm.allreduce(true[true > 0].min(initial=_HUGE), op=MPI.MIN)  # an infinite one is kept as 0
    values = values[values * softest > unit]  # others are rounding of zero, or buckle under the opposite load
    modes, k = [], 0
    while k < len(values):
        same = int(np.count_nonzero(np.abs(values[k:] - values[k]) <= _SAME * values[k]))
        modes += oriented(model, vectors[k : k + same])
        k += same
    softness = _softness(stability.whole, vectors[: len(values[:count])])
    shapes = np.array([model.shape_of(mode) for mode in modes[:count]])
    nodes = sum(cells * degree + 1 for cells in layout.counts)
    critical = (1 + softness) / values[:count]  # Rayleigh's quotient without that energy
    return load_factor + critical, shapes.reshape(-1, nodes, 3), _LEFT * softness


def _softness(part, vectors):
    """The share of the energy of modes (n,) in stretch and shear that is there because stiffnesses against them are bounded.

    Args:
        part: the `Part` of the second variation, assembled at the state.
        vectors: in its numbers.
    """
    data = part.model.data
    stiff, true, whole = data.K_stiff.x.array, data.K.x.array, part.K.copy()
    kept = stiff.copy()
    excess = np.where(true > 0, 1 - kept / np.where(true > 0, true, 1.0), 1.0)  # an infinite one is kept as 0
    stiff *= 1 - excess / 2
    part.load()
    part.assemble()
    part.K.aypx(-1.0, whole)
    energies = [((part.K * v).dot(v), (whole * v).dot(v)) for v in vectors]
    stiff[:] = kept
    part.load()
    return np.array([2 * of_excess / of_all for of_excess, of_all in energies])
