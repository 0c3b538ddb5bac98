"""The sections of a string under what they carry: true tension, strains, von Mises stress."""

from collections import namedtuple

import numpy as np

#: Arrays over the components of a string, from the bit up; NaN where a component does not tell. EI (N m^2), EA (N), GJ
#: (N m^2), poisson; outer, inner: radii of the body (m).
Sections = namedtuple("Sections", "EI EA GJ poisson outer inner")


def sections_of(components):
    """The `Sections` of components."""
    rows = []
    for part in components:
        S, material = part.stiffness, getattr(part, "material", None)
        stiff = (np.nan,) * 3 if S is None or S.matrix is not None else (min(S.bending), S.axial, S.torsion)
        known = part.outer_diameter is not None
        sizes = (material.nu, part.outer_diameter / 2, part.inner_diameter / 2) if known else (np.nan,) * 3
        rows.append((*stiff, *sizes))
    return Sections(*np.array(rows).T)


def areas(sections):
    """Of the bore and of the outer circle, m^2."""
    return np.pi * sections.inner**2, np.pi * sections.outer**2


def true_tension(sections, tension, outside, inside):
    """The force in the wall of the pipe, N, from the effective tension and the pressures (Pa)."""
    bore, whole = areas(sections)
    return tension + inside * bore - outside * whole


def stretch(sections, tension, outside, inside):
    """Strain along the pipe: of the true tension and of the pressures by Poisson's ratio; where the areas are not
    known, of the effective tension."""
    bore, whole = areas(sections)
    pressures = 2 * sections.poisson * (inside * bore - outside * whole)
    force = true_tension(sections, tension, outside, inside) - pressures
    return np.where(np.isnan(force), tension, force) / sections.EA


def von_mises(sections, tension, torque, moment, outside, inside):
    """The largest von Mises stress of the body, Pa: of tension, bending, torsion and pressures (Lame), at the outer and
    the inner surface."""
    bore, whole = areas(sections)
    area = whole - bore
    second = np.pi / 4 * (sections.outer**4 - sections.inner**4)
    axial = true_tension(sections, tension, outside, inside) / area
    mean = (inside * bore - outside * whole) / area
    rises = (inside - outside) * whole * bore / (np.pi * area)
    largest = 0.0
    for radius in (sections.outer, sections.inner):
        with np.errstate(divide="ignore", invalid="ignore"):
            differs = np.where(radius > 0, rises / radius**2, 0.0)
        hoop, radial, shear = mean + differs, mean - differs, torque * radius / (2 * second)
        for side in (-1, 1):
            along = axial + side * moment * radius / second
            squares = (along - hoop) ** 2 + (hoop - radial) ** 2 + (radial - along) ** 2
            largest = np.maximum(largest, np.sqrt(squares / 2 + 3 * shear**2))
    return largest
