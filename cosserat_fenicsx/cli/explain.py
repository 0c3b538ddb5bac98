"""What would be solved, in plain sentences, without solving it."""

import dataclasses

import numpy as np

from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.shape import Shape
from cosserat_fenicsx.scene.choose import choose, fitting, force_in_words
from cosserat_fenicsx.scene.curves import Line, Spline
from cosserat_fenicsx.scene.sections import Rectangle, Stiffness
from cosserat_fenicsx.scene.words import describe
from cosserat_fenicsx.statics.first_mesh import FIRST_ELEMENTS
from cosserat_fenicsx.statics.solve import check_arguments
from cosserat_fenicsx.statics.solvers import default_degree

#: What the unknowns of a model are, in a plane (True) or in space.
_UNKNOWNS = {
    ("determinate", True): "the angle theta along the rods alone",
    ("determinate", False): "the quaternion q along the rods alone",
    ("planar", True): "centreline and angle theta in a plane",
    ("spatial", False): "centreline r and quaternion q in space",
}


def explain(scene, load_factors, settings):
    """Text on the model of a scene and its size.

    Args:
        scene: a `Scene`.
        load_factors, settings: the arguments of `solve`.

    Raises:
        SceneError: arguments that `solve` would refuse.
    """
    formulation = settings.get("formulation", "mixed")
    elements, tol = settings.get("elements"), settings.get("tol", 1e-6)
    degree = settings.get("degree", default_degree(formulation))
    check_arguments(scene, tol, elements)
    follows = settings.get("branch") is not None or settings.get("control") == "arc"
    choice = choose(scene, model=settings.get("model", "auto"), formulation=formulation, degree=degree, follows=follows)
    first = elements or FIRST_ELEMENTS
    layout = Layout.of(scene, first)

    def shape_of(model):
        return Shape.of(scene, layout, formulation=formulation, degree=degree, model=model)

    shape = shape_of(choice.model)
    lines = of_the_scene(scene)
    what = _UNKNOWNS[choice.model, shape.flat]
    lines.append(f"Model: {choice.model} ({what}): {'; '.join(choice.why)}.")
    if choice.promoted:
        lines.append("Should it lose its stability, in its plane or out of it, the spatial model takes over.")
    costs = (f"{shape_of(name).unknowns} {name}" for name in fitting(scene, formulation=formulation, degree=degree))
    lines.append(f"Unknowns on the first mesh by model: {', '.join(costs)}.")
    words = force_in_words(shape.variant, formulation)
    lines.append(f"{words[0].upper()}{words[1:]}.")
    unknowns = shape.unknowns
    if elements:
        lines.append(
            f"Mesh: {elements} element(s) of degree {degree} per rod, as asked: {unknowns} unknowns, no error estimate."
        )
    else:
        lines.append(
            f"Mesh: elements of degree {degree}, from {first} per rod ({unknowns} unknowns) doubled until two meshes agree "
            f"to tol = {tol:g}."
        )
    if isinstance(load_factors, tuple):
        lines.append(f"Path: load factor {load_factors[0]:g} to {load_factors[1]:g} in steps the solver chooses.")
    else:
        listed = ", ".join(f"{x:g}" for x in np.atleast_1d(load_factors))
        lines.append(f"Path: load factors {listed}, landed on exactly, with steps between where needed.")
    return "\n".join(lines)


def of_the_scene(scene):
    """Sentences on rods, supports, loads and joints."""
    lines = [scene.title] if scene.title else []
    for rod in scene.rods:
        lines.append(
            f"Rod '{rod.name}': {_curve(rod.curve)}, length {rod.length:g} m, {_sections(rod)}; "
            f"{_stiffnesses(rod)}. {_directions(rod)}"
        )
    lines.append(
        f"{len(scene.supports)} support(s): {', '.join(describe(x) for x in scene.supports) or 'none'}. "
        f"{len(scene.loads)} load(s): {', '.join(describe(x) for x in scene.loads) or 'none'}."
        + "".join(f" {joint.first} is joined to {joint.second}{_release(joint)}." for joint in scene.joints)
    )
    return lines


def _curve(curve):
    """A curve with what matters of its shape."""
    if isinstance(curve, Spline):
        return f"{'closed ' if curve.closed else ''}Spline through {len(curve.points)} points"
    shape = {"Arc": ("angle", "rad"), "Helix": ("turns", "turns"), "UniformCurvature": ("curvature", "1/m")}
    if type(curve).__name__ not in shape:
        return type(curve).__name__
    name, unit = shape[type(curve).__name__]
    values = np.atleast_1d(getattr(curve, name))
    return f"{type(curve).__name__} ({', '.join(f'{x:g}' for x in values)} {unit})"


def _sections(rod):
    """The sections of a rod, one after the other."""
    parts, before = [], 0.0
    for end, section in rod.profile.pieces:
        if callable(section):
            part = " to ".join(_section(rod.section_at(s, side)) for s, side in ((before, "right"), (end, "left")))
            part = f"changing from {part}"
        else:
            part = _section(section)
        parts.append(part if len(rod.profile.pieces) == 1 else f"{part} up to s = {end:g} m")
        before = end
    return ", then ".join(parts)


def _release(joint):
    """What a joint lets go."""
    if joint.rigid:
        return " rigidly"
    axis = joint.release if joint.release == "all" else "(" + ", ".join(f"{x:.3g}" for x in joint.release) + ")"
    return " by a ball" if axis == "all" else f" by a hinge about {axis}"


def _section(section):
    """A section with its measures."""
    given = ((f.name, getattr(section, f.name)) for f in dataclasses.fields(section))
    measures = ", ".join(
        f"{name} {value:g} m" for name, value in given if isinstance(value, float) and "factor" not in name
    )
    return f"{type(section).__name__}" + (f" ({measures})" if measures and not isinstance(section, Stiffness) else "")


def _stiffnesses(rod):
    """The stiffnesses of a rod, least to largest where they change, and its slenderness."""
    low, high = rod.profile.range

    def spread(name, i):
        least, most = getattr(low, name)[i], getattr(high, name)[i]
        return f"{least:.4g}" + (f" to {most:.4g}" if most > least else "")

    slender = rod.length * np.sqrt(high.K[2] / max(low.J[:2]))
    return (
        f"EI = {spread('J', 0)}, {spread('J', 1)} N m^2, GJ = {spread('J', 2)} N m^2, EA = {spread('K', 2)} N, "
        f"GA = {spread('K', 0)}, {spread('K', 1)} N; slenderness L sqrt(EA/EI) = {slender:.4g}"
    )


def _directions(rod):
    """Where d_1 and d_2 point at the start, which matters to every section that is not round."""
    d1, d2 = (", ".join(f"{x:.3g}" for x in rod.curve.frame(0.0)[:, i] + 0.0) for i in (0, 1))
    at = "" if isinstance(rod.curve, Line) else " at the start"
    if isinstance(rod.section_at(0.0), Rectangle):
        return f"Its width runs along d1 = ({d1}), its height along d2 = ({d2}){at}."
    return f"d1 = ({d1}), d2 = ({d2}){at}."
