"""What solves the equilibria of a scene on one mesh, compiled once and kept."""

import functools

from mpi4py import MPI

from cosserat_fenicsx.models.determinate import DeterminateInPlane, DeterminateInSpace
from cosserat_fenicsx.models.planar import PlanarModel
from cosserat_fenicsx.models.shape import Shape
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.statics.problem import Problem
from cosserat_fenicsx.statics.snes import Newton
from cosserat_fenicsx.statics.stability import NegativeModes

_MODELS = {
    ("determinate", True): DeterminateInPlane,
    ("determinate", False): DeterminateInSpace,
    ("planar", True): PlanarModel,
    ("spatial", False): SpatialModel,
}


def _make(comm, shape):
    """Problem, Newton solver and stability count of a shape."""
    model = _MODELS[shape.model, shape.flat](comm, shape)
    problem = Problem(model)
    return problem, Newton(problem), NegativeModes(problem)


@functools.lru_cache(maxsize=16)
def _kept(alone, shape):
    """Compiled once, used for every scene of that shape."""
    return _make(MPI.COMM_SELF if alone else MPI.COMM_WORLD, shape)


def solvers_of(scene, layout, *, formulation="mixed", degree=4, points=None, comm=None, model="spatial"):
    """The loaded problem, Newton solver and stability count for a scene on a given mesh, as `solve` uses them."""
    comm = comm or MPI.COMM_WORLD
    shape = Shape.of(scene, layout, formulation=formulation, degree=degree, points=points, model=model)
    if comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        problem, newton, stability = _kept(comm == MPI.COMM_SELF, shape)
    else:  # a user's communicator may be freed, and its handle given to another
        problem, newton, stability = _make(comm, shape)
    if problem.load(scene, layout):
        stability.load()
    return problem, newton, stability


def default_degree(formulation):
    """Degree of r and q where none is asked for."""
    return 4 if formulation == "mixed" else 2
