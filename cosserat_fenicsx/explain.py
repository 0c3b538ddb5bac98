"""What would be solved, in plain sentences, without solving it."""

import dataclasses

import numpy as np

from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.shape import Shape
from cosserat_fenicsx.sections import Rectangle, Stiffness
from cosserat_fenicsx.statics import FIRST_ELEMENTS, check_arguments, default_degree
from cosserat_fenicsx.tables import describe


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
    check_arguments(scene, settings.get("model", "auto"), tol, elements)
    first = elements or FIRST_ELEMENTS
    layout = Layout.of(scene, first)
    shape = Shape.of(scene, layout, formulation=formulation, degree=degree)
    lines = [scene.title] if scene.title else []
    for rod in scene.rods:
        s = rod.stiffness
        slender = rod.length * np.sqrt(s.axial / max(s.bending)) if np.isfinite(s.axial) else np.inf
        lines.append(
            f"Rod '{rod.name}': {type(rod.curve).__name__}, length {rod.length:g} m, {_section(rod.section)}; "
            f"EI = {s.bending[0]:.4g}, {s.bending[1]:.4g} N m^2, GJ = {s.torsion:.4g} N m^2, EA = {s.axial:.4g} N, "
            f"GA = {s.shear[0]:.4g}, {s.shear[1]:.4g} N; slenderness L sqrt(EA/EI) = {slender:.4g}. "
            f"{_directions(rod)}"
        )
    lines.append(
        f"{len(scene.supports)} support(s): {', '.join(describe(x) for x in scene.supports)}. "
        f"{len(scene.loads)} load(s): {', '.join(describe(x) for x in scene.loads) or 'none'}."
    )
    lines.append("Model: spatial (centreline r and quaternion q in space), which takes any scene.")
    lines.append(
        {
            "condensed": "Formulation: mixed, the contact force carried at the Gauss points; unknowns r and q alone.",
            "field": "Formulation: mixed, the contact force as an unknown, because a stiffness is infinite or next to it.",
        }.get(shape.variant, f"Formulation: {formulation}, as asked.")
    )
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


def _section(section):
    """A section with its measures."""
    given = ((f.name, getattr(section, f.name)) for f in dataclasses.fields(section))
    measures = ", ".join(
        f"{name} {value:g} m" for name, value in given if isinstance(value, float) and "factor" not in name
    )
    return f"{type(section).__name__}" + (f" ({measures})" if measures and not isinstance(section, Stiffness) else "")


def _directions(rod):
    """Where d_1 and d_2 point at the start, which matters to every section that is not round."""
    d1, d2 = (", ".join(f"{x:.3g}" for x in rod.curve.frame(0.0)[:, i] + 0.0) for i in (0, 1))
    if isinstance(rod.section, Rectangle):
        return f"Its width runs along d1 = ({d1}), its height along d2 = ({d2})."
    return f"d1 = ({d1}), d2 = ({d2})."

