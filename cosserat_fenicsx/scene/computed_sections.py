"""Sections of any shape computed by finite elements, as by the package sectionproperties.

Only methods of the computed section are called; the package is not imported. Its coordinates x and y run along d_1 and
d_2. With materials it weights all properties by Young's modulus, torsion and shear too,
which G/E turns into stiffnesses.
"""

import math
from collections import namedtuple

import numpy as np

from cosserat_fenicsx.checks import instance, positive, refuse, vector
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.materials import Material

# Offsets over the radius of gyration, and products of inertia over moments, that are errors of finite elements.
_OFFSET, _SKEW = 1e-5, 1e-6
_WHERE = "Stiffness.from_section"

#: Stiffnesses in the section's unit of length: EA; EI about x and y and their product, about the centroid; EI about the
#: principal axes; GA along x and y, and along the principal axes; GJ. mass per length; density over E where it is the
#: same everywhere, else None.
_Computed = namedtuple("_Computed", "axial about product principal shear principal_shear torsion mass heaviness")


def arguments_of(section, material, line, unit):
    """Arguments of `Stiffness.offset`, or of `Stiffness` where there is no offset; see `Stiffness.from_section`."""
    unit = positive(_WHERE, "unit", unit, "m")
    try:
        found = _with_materials(section, material) if section.is_composite() else _of_shape(section, material, unit)
        centroid, shear_centre, angle = section.get_c(), section.get_sc(), math.radians(section.get_phi())
    except AttributeError as missing:
        refuse(_WHERE, "section", section, f"a Section of sectionproperties, or another with its methods ({missing})")
    except RuntimeError as missing:
        raise SceneError(
            f"{_WHERE}: {missing} Expected a section after calculate_geometric_properties() and "
            "calculate_warping_properties()"
        ) from None
    line = np.array(centroid if line is None else vector(_WHERE, "line", line, "its coordinates in the section", 2))
    skew = abs(found.product) > _SKEW * max(found.about)
    shear, coupling = _principal_shear(found, angle) if skew else (found.shear, 0.0)
    arguments = {
        "shear": shear,
        "axial": found.axial,
        "bending": tuple(EI * unit**2 for EI in (found.principal if skew else found.about)),
        "torsion": found.torsion * unit**2,
        "outline": _outline(section, line, unit),
    }
    radius = math.sqrt(max(found.about) / found.axial)
    offsets = {}
    for name, place in (("centroid", centroid), ("shear_centre", shear_centre)):
        away = np.array(place) - line
        if np.abs(away).max() > _OFFSET * radius:
            turned = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]]) if skew else 1
            offsets[name] = tuple((unit * (turned @ away if skew else away)).tolist())
    heavy = centroid if found.heaviness is not None else _centre_of_mass(section)
    if found.mass is not None and heavy is not None and np.abs(heavy - line).max() <= _OFFSET * radius:
        arguments["mass"] = found.mass / unit
        if found.heaviness is not None and not skew:
            first, second = (found.heaviness * EI * unit for EI in found.about)
            arguments["inertia"] = (first, second, first + second)
    return arguments | offsets | ({"angle": angle, "shear_coupling": coupling} if skew else {})


def _principal_shear(found, angle):
    """GA along the principal axes of bending, which are not those of shear, and their coupling.

    The flexibilities along both pairs of axes are the diagonals of one tensor, which gives its product term.
    """
    (x, y), (one, two) = 1 / np.array(found.shear), 1 / np.array(found.principal_shear)
    product = (math.cos(2 * angle) * (one - two) - (x - y)) / (2 * math.sin(2 * angle))
    stiff = np.linalg.inv([[one, product], [product, two]])
    return (stiff[0, 0], stiff[1, 1]), stiff[0, 1]


def _of_shape(section, material, unit):
    """The `_Computed` of a section without materials, in a `Material`."""
    instance(_WHERE, "material", material, Material, "a Material, since the section has none of its own")
    E, G = material.E * unit**2, material.G * unit**2
    rho = None if material.density is None else material.density * unit**3
    *about, product = section.get_ic()
    return _Computed(
        E * section.get_area(),
        [E * I for I in about],
        E * product,
        [E * I for I in section.get_ip()],
        [G * A for A in section.get_as()],
        [G * A for A in section.get_as_p()],
        G * section.get_j(),
        None if rho is None else rho * section.get_area(),
        None if rho is None else rho / E,
    )


def _with_materials(section, material):
    """The `_Computed` of a section that has its own materials."""
    if material is not None:
        refuse(_WHERE, "material", material, "None, since the section has materials of its own")
    ratios = {part.poissons_ratio for part in section.materials}
    if max(ratios) - min(ratios) > 1e-9:
        known = ", ".join(f"{nu:g}" for nu in sorted(ratios))
        raise SceneError(
            f"{_WHERE}: its materials have the Poisson's ratios {known}: expected one for all, since torsion and shear "
            "are weighted by Young's modulus"
        )
    G_over_E = section.get_g_eff() / section.get_e_eff()
    heaviness = {part.density / part.elastic_modulus for part in section.materials}
    *about, product = section.get_eic()
    return _Computed(
        section.get_ea(),
        about,
        product,
        section.get_eip(),
        [G_over_E * EA for EA in section.get_eas()],
        [G_over_E * EA for EA in section.get_eas_p()],
        G_over_E * section.get_ej(),
        section.get_mass(),
        heaviness.pop() if len(heaviness) == 1 else None,
    )


def _centre_of_mass(section):
    """Of a section whose materials differ in density over E, from its regions; None where they are not known."""
    parts = getattr(getattr(section, "geometry", None), "geoms", None)
    if not parts:
        return None
    masses = [part.material.density * part.geom.area for part in parts]
    return np.average([(part.geom.centroid.x, part.geom.centroid.y) for part in parts], axis=0, weights=masses)


def _outline(section, line, unit):
    """The outer boundary of a section's shape, counterclockwise from the line, m; None where it is not known."""
    shape = getattr(getattr(section, "geometry", None), "geom", None)
    if shape is None:
        return None
    boundary = shape.exterior if hasattr(shape, "exterior") else shape.convex_hull.exterior
    corners = unit * (np.array(boundary.coords)[:-1, :2] - line)
    x, y = corners.T
    turns = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    return corners[:: 1 if turns > 0 else -1].tolist()
