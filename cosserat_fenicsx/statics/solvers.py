"""The compiled static problem and solvers of a scene on one mesh, cached and used by one caller at a time."""

import contextlib

from cosserat_fenicsx.algebra.newton import Newton
from cosserat_fenicsx.algebra.pool import PROBLEMS
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.models.determinate import DeterminateInPlane, DeterminateInSpace
from cosserat_fenicsx.models.planar import PlanarModel
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.statics.path.recorder import Promoted
from cosserat_fenicsx.statics.problem import Problem
from cosserat_fenicsx.statics.stability import NegativeModes

_MODELS = {
    ("determinate", True): DeterminateInPlane,
    ("determinate", False): DeterminateInSpace,
    ("planar", True): PlanarModel,
    ("spatial", False): SpatialModel,
}
# Exceptions that leave the problem and its solvers fit for use: they are raised between two steps.
_OUTCOMES = (NotConverged, Promoted)


def _make(comm, signature):
    """(Problem, Newton solver, `NegativeModes`) of a signature."""
    model = _MODELS[signature.model, signature.flat](comm, signature)
    problem = Problem(model)
    return problem, Newton(problem), NegativeModes(problem)


@contextlib.contextmanager
def solvers_of(scene, layout, *, formulation="mixed", degree=4, points=None, comm=None, model="spatial"):
    """Context manager that gives the loaded `Problem`, its Newton solver and its `NegativeModes` for a scene on a mesh.

    No other caller uses them within the context; afterwards another one may, so that results must not refer to them.
    """
    comm = communicator(comm)
    signature = Signature.of(scene, layout, formulation=formulation, degree=degree, points=points, model=model)
    with PROBLEMS.lend(("equilibrium", signature), comm, lambda: _make(comm, signature), _OUTCOMES) as solvers:
        problem, _, stability = solvers
        if problem.load(scene, layout):
            stability.load()
        yield solvers
