"""The compiled dynamic problem and stepper of a scene on one mesh, cached and used by one caller at a time."""

import contextlib

from cosserat_fenicsx.algebra.pool import PROBLEMS
from cosserat_fenicsx.dynamics.start import starts_in
from cosserat_fenicsx.dynamics.steppers import SCHEMES
from cosserat_fenicsx.errors import NotConverged, SceneError, nearest
from cosserat_fenicsx.models.choose import not_flat
from cosserat_fenicsx.models.collocated import CollocatedPlanar, CollocatedSpatial
from cosserat_fenicsx.models.directors import ConservingSpatial, EccentricSpatial
from cosserat_fenicsx.models.moving import MovingSpatial
from cosserat_fenicsx.models.moving_planar import MovingPlanar
from cosserat_fenicsx.models.signature import Signature

_MODELS = {
    ("momentum", "spatial"): MovingSpatial,
    ("momentum", "eccentric"): EccentricSpatial,
    ("momentum", "planar"): MovingPlanar,
    ("energy", "spatial"): ConservingSpatial,
    ("collocation", "spatial"): CollocatedSpatial,
    ("collocation", "planar"): CollocatedPlanar,
}


def chosen_model(scene, model, scheme, start=None):
    """The model's name, and the reason for its choice.

    Args:
        scene, model, scheme: as `simulate` takes them; start: None, a Path or (Path, k).

    Raises:
        SceneError: an unknown model, or one that the scene does not fit.
    """
    flat = ("momentum" if scheme not in SCHEMES else SCHEMES[scheme].forms, "planar") in _MODELS
    if model not in ("auto", "planar", "spatial"):
        raise SceneError(f"model = {model!r}: {nearest(model, ('auto', 'planar', 'spatial'))}")
    if model == "spatial":
        return model, "the spatial model was requested"
    plane, reason = scene.plane, not_flat(scene)
    plane = None if reason else plane
    if plane is not None and any(rod.mass_centre for rod in scene.rods):
        plane, reason = None, "the planar model has no mass centre off the axis (Rod.eccentricity)"
    if plane is not None and not starts_in(scene, plane, start):
        plane, reason = None, "the start leaves the plane of the rods"
    if plane is not None and not flat:
        plane, reason = None, f"the scheme '{scheme}' has no planar model"
    if plane is not None:
        return "planar", f"the whole scene moves in {plane.words}"
    if model == "planar":
        raise SceneError(f"model = 'planar': {reason}; expected 'spatial' or 'auto'")
    return "spatial", reason


@contextlib.contextmanager
def solvers_of(scene, layout, degree, scheme, load_factor, comm, model):
    """Context manager that gives the loaded problem and stepper of a scene on a mesh.

    No other caller uses them within the context; afterwards another one may, so that results must not refer to them.
    """
    signature = Signature.of(scene, layout, formulation="displacement", degree=degree, model=model)
    with PROBLEMS.lend((scheme, signature), comm, lambda: _make(comm, signature, scheme), NotConverged) as solvers:
        solvers[0].load(scene, layout, load_factor)
        yield solvers


def _make(comm, signature, scheme):
    """Problem and stepper of a signature."""
    stepper = SCHEMES[scheme]
    model = _MODELS[stepper.forms, signature.model]
    if signature.eccentric:
        model = _MODELS.get((stepper.forms, "eccentric"), model)
    problem = stepper.problem_class(model(comm, signature))
    return problem, stepper(problem)
