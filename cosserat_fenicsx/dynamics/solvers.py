"""What moves a scene on one mesh, compiled once and kept."""

import functools

from mpi4py import MPI

from cosserat_fenicsx.dynamics.start import starts_in
from cosserat_fenicsx.dynamics.steppers import SCHEMES
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.models.collocated import CollocatedPlanar, CollocatedSpatial
from cosserat_fenicsx.models.conserving import ConservingSpatial
from cosserat_fenicsx.models.moving import MovingSpatial
from cosserat_fenicsx.models.moving_planar import MovingPlanar
from cosserat_fenicsx.models.shape import Shape

_MODELS = {
    ("momentum", "spatial"): MovingSpatial,
    ("momentum", "planar"): MovingPlanar,
    ("energy", "spatial"): ConservingSpatial,
    ("collocation", "spatial"): CollocatedSpatial,
    ("collocation", "planar"): CollocatedPlanar,
}


def chosen_model(scene, model, scheme, start=None):
    """The model's name, and why it is that one.

    Args:
        scene, model, scheme: as `simulate` takes them; start: None, a Path or (Path, k).

    Raises:
        SceneError: an unknown model, or one that the scene does not fit.
    """
    flat = ("momentum" if scheme not in SCHEMES else SCHEMES[scheme].forms, "planar") in _MODELS
    if model not in ("auto", "planar", "spatial"):
        raise SceneError(f"model = {model!r}: {nearest(model, ('auto', 'planar', 'spatial'))}")
    if model == "spatial":
        return model, "the spatial model was asked for"
    plane, reason = scene.flatness
    if plane is not None and not starts_in(scene, plane, start):
        plane, reason = None, "the start leaves the plane of the rods"
    if plane is not None and not flat:
        plane, reason = None, f"the scheme '{scheme}' knows space alone"
    if plane is not None:
        return "planar", f"everything keeps to {plane.words}"
    if model == "planar":
        raise SceneError(f"model = 'planar': {reason}; expected 'spatial' or 'auto'")
    return "spatial", reason


def solvers_of(scene, layout, degree, scheme, load_factor, comm, model):
    """The loaded problem and stepper of a scene on a mesh."""
    shape = Shape.of(scene, layout, formulation="displacement", degree=degree, model=model)
    if comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        problem, stepper = _kept(comm == MPI.COMM_SELF, shape, scheme)
    else:  # a user's communicator may be freed, and its handle given to another
        problem, stepper = _make(comm, shape, scheme)
    problem.load(scene, layout, load_factor)
    return problem, stepper


def _make(comm, shape, scheme):
    stepper = SCHEMES[scheme]
    problem = stepper.problem_class(_MODELS[stepper.forms, shape.model](comm, shape))
    return problem, stepper(problem)


@functools.lru_cache(maxsize=8)
def _kept(alone, shape, scheme):
    """Compiled once, used for every scene of that shape."""
    return _make(MPI.COMM_SELF if alone else MPI.COMM_WORLD, shape, scheme)
