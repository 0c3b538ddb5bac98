"""Cross-sections: d_1 and d_2 span the section, d_3 is the tangent.

Shear factors: Cowper, J. Appl. Mech. 33 (1966) 335, doi:10.1115/1.3625046; torsion of a rectangle: Saint-Venant's series.
"""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import number, positive, refuse, stiffness, store

_ZETA_5 = 1.0369277551433699263  # sum of 1/n^5


@dataclass(frozen=True)
class Stiffness:
    """A section by its stiffnesses, in the order of the directors d_1, d_2, d_3; needs no material.

    Args:
        shear: (GA1, GA2) with the shear factors in them, N; infinity means unshearable.
        axial: EA, N; infinity means inextensible.
        bending: (EI1, EI2), about d_1 and about d_2, N m^2; finite.
        torsion: GJ, N m^2; finite.
        mass: rho A, kg/m, where a load or a motion asks for mass.
        inertia: (Jrho_1, Jrho_2, Jrho_3), about d_1, d_2 and the tangent d_3, kg m, where a motion asks for them:
            (rho I_1, rho I_2, rho (I_1 + I_2)) where the density rho is the same all over the section.
        outline: corners (x1, x2) along d_1 and d_2 of what a picture draws, m; None lets the picture choose.

    Raises:
        SceneError: a value that is not positive.
    """

    shear: tuple
    axial: float
    bending: tuple
    torsion: float
    mass: float | None = None
    outline: tuple | None = None
    inertia: tuple | None = None

    def __post_init__(self):
        for field, unit, check in (("shear", "N", stiffness), ("bending", "N m^2", positive)):
            _check_numbers(self, field, f"two numbers, about or along d_1 and d_2 ({unit})", unit, check, 2)
        store(self, axial=stiffness(self, "axial", self.axial, "N"))
        store(self, torsion=positive(self, "torsion", self.torsion, "N m^2"))
        if self.mass is not None:
            store(self, mass=positive(self, "mass", self.mass, "kg/m"))
        if self.inertia is not None:
            _check_numbers(self, "inertia", "three numbers, about d_1, d_2 and d_3 (kg m)", "kg m", positive, 3)
        if self.outline is not None:
            store(self, outline=_corners(self, self.outline))

    def stiffness(self, material=None):
        """The section itself (a material is not needed)."""
        return self


@dataclass(frozen=True)
class Circle:
    """A solid circular section.

    Args:
        diameter: m.
        shear_factor: None for Cowper's 6(1+nu)/(7+6nu).

    Raises:
        SceneError: a value that is not positive.
    """

    diameter: float
    shear_factor: float | None = None

    def __post_init__(self):
        _check_lengths(self, "diameter")

    def stiffness(self, material):
        """The section's `Stiffness` in a material."""
        nu = material.nu
        A, I = math.pi * self.diameter**2 / 4, math.pi * self.diameter**4 / 64
        k = self.shear_factor or 6 * (1 + nu) / (7 + 6 * nu)
        return _isotropic(material, A, (I, I), 2 * I, k, _circle(self.diameter / 2))


@dataclass(frozen=True)
class Tube:
    """A circular tube.

    Args:
        outer_diameter: m.
        inner_diameter: m, below the outer one.
        shear_factor: None for Cowper's value for a hollow circle.

    Raises:
        SceneError: a value that is not positive, or an inner diameter that is not below the outer one.
    """

    outer_diameter: float
    inner_diameter: float
    shear_factor: float | None = None

    def __post_init__(self):
        _check_lengths(self, "outer_diameter", "inner_diameter")
        if self.inner_diameter >= self.outer_diameter:
            refuse(self, "inner_diameter", self.inner_diameter, f"less than outer_diameter = {self.outer_diameter}")

    def stiffness(self, material):
        """The section's `Stiffness` in a material."""
        D, d, nu = self.outer_diameter, self.inner_diameter, material.nu
        A, I = math.pi * (D**2 - d**2) / 4, math.pi * (D**4 - d**4) / 64
        m2 = (d / D) ** 2
        cowper = 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)
        k = self.shear_factor or cowper
        return _isotropic(material, A, (I, I), 2 * I, k, _circle(D / 2))


@dataclass(frozen=True)
class Rectangle:
    """A solid rectangular section.

    Args:
        width: along d_1, m.
        height: along d_2, m.
        shear_factor: None for Cowper's 10(1+nu)/(12+11nu).

    Raises:
        SceneError: a value that is not positive.
    """

    width: float
    height: float
    shear_factor: float | None = None

    def __post_init__(self):
        _check_lengths(self, "width", "height")

    def stiffness(self, material):
        """The section's `Stiffness` in a material."""
        b, h, nu = self.width, self.height, material.nu
        k = self.shear_factor or 10 * (1 + nu) / (12 + 11 * nu)
        corners = ((b / 2, h / 2), (-b / 2, h / 2), (-b / 2, -h / 2), (b / 2, -h / 2))
        return _isotropic(material, b * h, (b * h**3 / 12, h * b**3 / 12), _rectangle_torsion(b, h), k, corners)


def _check_numbers(section, field, expected, unit, check, size):
    values = getattr(section, field)
    if not isinstance(values, tuple | list) or len(values) != size:
        refuse(section, field, values, expected)
    store(section, **{field: tuple(check(section, field, value, unit) for value in values)})


def _check_lengths(section, *fields):
    for field in fields:
        store(section, **{field: positive(section, field, getattr(section, field), "m")})
    if section.shear_factor is not None:
        k = number(section, "shear_factor", section.shear_factor, "a number in (0, 1]", lambda x: 0 < x <= 1)
        store(section, shear_factor=k)


def _corners(section, outline):
    expected = "three or more corners (x1, x2) of finite numbers (m)"
    try:
        corners = np.asarray(outline)
    except ValueError:
        refuse(section, "outline", outline, expected)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or corners.dtype.kind not in "iuf":
        refuse(section, "outline", outline, expected)
    if not np.isfinite(corners).all():
        refuse(section, "outline", outline, expected)
    return tuple(map(tuple, corners.astype(float).tolist()))


def _circle(radius, corners=24):
    angles = [2 * math.pi * i / corners for i in range(corners)]
    return tuple((radius * math.cos(a), radius * math.sin(a)) for a in angles)


def _isotropic(material, A, I, J, k, outline):
    rho = material.density
    return Stiffness(
        shear=(k * material.G * A, k * material.G * A),
        axial=material.E * A,
        bending=(material.E * I[0], material.E * I[1]),
        torsion=material.G * J,
        mass=None if rho is None else rho * A,
        outline=outline,
        inertia=None if rho is None else (rho * I[0], rho * I[1], rho * (I[0] + I[1])),
    )


def _rectangle_torsion(b, h):
    """Saint-Venant's torsion constant: of the series of tanh(n x)/n^5 in odd n, the part of 1/n^5 is summed exactly."""
    long, short = max(b, h), min(b, h)
    x = math.pi * long / (2 * short)
    series = 31 / 32 * _ZETA_5 - sum((1 - math.tanh(n * x)) / n**5 for n in range(1, 15, 2))
    return long * short**3 / 3 * (1 - 192 * short / (math.pi**5 * long) * series)


#: Sections by the words of the scene file.
SECTIONS = (Circle, Tube, Rectangle, Stiffness)
