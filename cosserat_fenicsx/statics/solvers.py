"""The compiled static problem and solvers of a scene on one mesh, cached and used by one caller at a time; what is kept
of a state that they find."""

import contextlib

from cosserat_fenicsx.algebra.newton import Newton
from cosserat_fenicsx.algebra.pool import PROBLEMS
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.models.determinate import DeterminateInPlane, DeterminateInSpace
from cosserat_fenicsx.models.planar import PlanarModel
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.records import Record
from cosserat_fenicsx.statics.problem import Problem
from cosserat_fenicsx.statics.stability import NegativeModes

_MODELS = {
    ("determinate", True): DeterminateInPlane,
    ("determinate", False): DeterminateInSpace,
    ("planar", True): PlanarModel,
    ("spatial", False): SpatialModel,
}
# Largest ratio of the load factors at which two meshes find negative modes, for the finding to be confirmed.
_ALIKE = 1.5


class Promoted(Exception):
    """A planar solution that has to be continued with the spatial model.

    Args:
        reason: a sentence for `Path.why`.
        between: the two load factors between which negative modes appeared, where the mesh is too coarse to be sure of
            them; else None.
    """

    def __init__(self, reason, between=None):
        super().__init__(reason)
        self.reason, self.between = reason, between

    def agrees(self, before):
        """Whether the exception on the mesh before (None where none was raised) confirms the negative modes.

        On a mesh that does not resolve the contact force, its directions at the Gauss points are wrong: a taut wire
        then seems to buckle, at a load factor that grows with mesh refinement.
        """
        if self.between is None:
            return True
        if before is None or before.between is None:
            return False
        (a, b), (c, d) = (sorted(map(abs, found.between)) for found in (self, before))
        return max(a, c) <= _ALIKE * min(b, d)


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


def record_of(problem, load_factor, negative_modes, iterations, steps, neutral=False):
    """The `Record` of a problem's state, an equilibrium; see there for what is given."""
    model = problem.model
    return Record(load_factor, *model.snapshot(), negative_modes, iterations, problem.multipliers(), neutral,
                  model.densities.here(), problem.tie_forces(), model.clamps.loads(load_factor), steps)  # fmt: skip
