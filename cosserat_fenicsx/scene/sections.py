"""Materials and cross-sections: d_1 and d_2 span the section, d_3 is the tangent.

A section has a `stiffness` and, where its shape is known, `stresses`, both in a material.

Shear factors: Cowper, J. Appl. Mech. 33 (1966) 335, doi:10.1115/1.3625046; torsion of a rectangle: Saint-Venant's
series.
"""

import math
from collections import namedtuple
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from cosserat_fenicsx import parts
from cosserat_fenicsx.checks import Numbers, Rows, finite_array, instance, number, positive, refuse, store, vector
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.stresses import rectangle_fibres, round_stress


@dataclass(frozen=True)
class Material(parts.Part):
    """A linear elastic, isotropic material.

    Args:
        E: Young's modulus, Pa.
        nu: Poisson's ratio, in (-1, 0.5].
        density: kg/m^3; required by `Weight` and by motions.

    Raises:
        SceneError: a value outside its range.
    """

    E: parts.Pressure
    nu: Annotated[float, parts.Number(limits=parts.Limits(-1, 0.5, above=True, what="a Poisson's ratio"))] = 0.3
    density: Annotated[parts.Density, parts.positive()] | None = None

    @property
    def G(self) -> float:
        """Shear modulus E/(2(1 + nu)), Pa."""
        return self.E / (2 * (1 + self.nu))


# Offsets over the radius of gyration, and products of inertia over moments, below these are finite-element errors.
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
        found = _computed(section, material, unit)
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
    """GA along the principal axes of bending, which differ from the principal axes of shear, and their coupling: the
    flexibilities along both pairs of axes are the diagonals of one tensor, which gives its product term."""
    (x, y), (one, two) = 1 / np.array(found.shear), 1 / np.array(found.principal_shear)
    product = (math.cos(2 * angle) * (one - two) - (x - y)) / (2 * math.sin(2 * angle))
    stiff = np.linalg.inv([[one, product], [product, two]])
    return (stiff[0, 0], stiff[1, 1]), stiff[0, 1]


def _computed(section, material, unit):
    """The `_Computed` of a section with its own materials, or of one without, in a `Material`."""
    if section.is_composite():
        _check_composite(section, material)
        E, G_over_E, prefix = 1.0, section.get_g_eff() / section.get_e_eff(), "get_e"
        axial, mass = section.get_ea(), section.get_mass()
        heaviness = {part.density / part.elastic_modulus for part in section.materials}
    else:
        instance(_WHERE, "material", material, Material, "a Material, since the section has none of its own")
        E, G_over_E, prefix = material.E * unit**2, 1 / (2 * (1 + material.nu)), "get_"
        axial = E * section.get_area()
        rho = None if material.density is None else material.density * unit**3
        mass, heaviness = (None, ()) if rho is None else (rho * section.get_area(), [rho / E])

    def stiffness(name, factor=E):
        return factor * np.array(getattr(section, prefix + name)())

    *about, product = stiffness("ic").tolist()
    principal, shear, principal_shear = (
        stiffness(name, factor).tolist() for name, factor in (("ip", E), ("as", G_over_E * E), ("as_p", G_over_E * E))
    )
    torsion = float(stiffness("j", G_over_E * E))
    only = next(iter(heaviness)) if len(heaviness) == 1 else None
    return _Computed(axial, about, product, principal, shear, principal_shear, torsion, mass, only)


def _check_composite(section, material):
    if material is not None:
        refuse(_WHERE, "material", material, "None, since the section has materials of its own")
    ratios = {part.poissons_ratio for part in section.materials}
    if max(ratios) - min(ratios) > 1e-9:
        known = ", ".join(f"{nu:g}" for nu in sorted(ratios))
        raise SceneError(
            f"{_WHERE}: its materials have the Poisson's ratios {known}: expected one for all, since torsion and shear "
            "are weighted by Young's modulus"
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


_ZETA_5 = 1.0369277551433699263  # sum of 1/n^5
# Tolerance of the asymmetry and of the smallest eigenvalue of a matrix scaled to a unit diagonal.
_ROUNDING = 1e-12


ShearFactor = Annotated[float, parts.Number(limits=parts.Limits(0, 1, above=True))]
_FORCE = parts.Number("force", parts.positive(infinite=True))
_BENDING = parts.Number("bending stiffness", parts.positive())


@dataclass(frozen=True)
class PerDirector(parts.Items):
    """`size` numbers of one kind, one for each of the first directors."""

    size: int = 3

    @property
    def words(self):
        many, names = ("two", "d_1 and d_2") if self.size == 2 else ("three", "d_1, d_2 and d_3")
        return f"{many} numbers, along or about {names}, each {self.inner.words}"

    def check(self, owner, field, value):
        if not isinstance(value, tuple | list) or len(value) != self.size:
            refuse(owner, field, value, self.words)
        return tuple(self.inner.check(owner, field, x) for x in value)


class Section(parts.Part, family="section"):
    """Base of cross-sections.

    Attributes:
        round_radius: of the surface, m; None where the section is not round.
    """

    round_radius = None

    def moduli(self, material: Material | None) -> tuple:
        """(GA1, GA2, EA, EI1, EI2, GJ) in a material, N and N m^2: numbers, or arrays where fields of either are."""
        k = self.stiffness(material)
        return *k.shear, k.axial, *k.bending, k.torsion


def sizes_across(section):
    """The sizes across a rod that its section tells, m; none where it tells none."""
    known = ("diameter", "outer_diameter", "width", "height")
    return [size for name in known if (size := getattr(section, name, None))]


@dataclass(frozen=True)
class Stiffness(Section):
    """A section by its stiffnesses, in the order of the directors d_1, d_2, d_3; needs no material.

    They are given one by one, or as the matrix of a section that couples strains: an anisotropic one, or one whose
    centroid or shear centre is off the rod's line (see `offset`).

    Args:
        shear: (GA1, GA2) including the shear factors, N; infinity means unshearable.
        axial: EA, N; infinity means inextensible.
        bending: (EI1, EI2), about d_1 and about d_2, N m^2; finite.
        torsion: GJ, N m^2; finite.
        mass: rho A, kg/m; required by `Weight` and by motions.
        inertia: (Jrho_1, Jrho_2, Jrho_3), about d_1, d_2 and the tangent d_3, kg m; required by motions. It is
            (rho I_1, rho I_2, rho (I_1 + I_2)) where the density rho is constant. The centre of mass is on the rod's
            line.
        outline: corners (x1, x2) along d_1 and d_2 of the section as drawn in pictures, m; None draws a circle.
        matrix: 6 x 6 numbers, symmetric and positive definite, instead of shear, axial, bending and torsion: rows are
            the contact force along d_1, d_2, d_3 (N) and the contact moment about them (N m), columns the strains:
            shear along d_1 and d_2, stretch (1), bending about d_1 and d_2, twist (1/m). The units of its 3 x 3 blocks
            are N, N m in the first rows, and N m, N m^2 in the last.

    Raises:
        SceneError: a value that is not positive, a matrix that is not symmetric or not positive definite, or
            stiffnesses given twice or not at all.
    """

    shear: Annotated[Numbers, PerDirector(_FORCE, 2)] | None = None
    axial: Annotated[float, _FORCE] | None = None
    bending: Annotated[Numbers, PerDirector(_BENDING, 2)] | None = None
    torsion: Annotated[float, _BENDING] | None = None
    mass: parts.MassPerLength | None = None
    outline: Rows | None = None
    inertia: Annotated[Numbers, PerDirector(parts.Number(limits=parts.positive("a number (kg m)")))] | None = None
    matrix: Rows | None = None

    def validate(self):
        for field in ("shear", "axial", "bending", "torsion"):
            value = getattr(self, field)
            if self.matrix is not None and value is not None:
                refuse(self, field, value, "None beside a matrix, which holds all stiffnesses")
            if self.matrix is None and value is None:
                refuse(self, field, None, parts.fields_of(Stiffness)[field].inner.words)
        if self.matrix is not None:
            store(self, matrix=_checked(self, self.matrix))
        if self.outline is not None:
            store(self, outline=_corners(self, self.outline))

    @classmethod
    def offset(
        cls,
        shear: Numbers,
        axial: float,
        bending: Numbers,
        torsion: float,
        *,
        centroid: Numbers = (0.0, 0.0),
        shear_centre: Numbers = (0.0, 0.0),
        angle: float = 0.0,
        shear_coupling: float = 0.0,
        **others: Any,
    ) -> "Stiffness":
        """A section whose centroid and shear centre are off the rod's line.

        A point (x1, x2) of the section has the strains e + k x (x1, x2, 0), where e and k are those at the line. EA
        acts on the stretch at the centroid, GA on the shear at the shear centre. The strain energy per length is half
        the sum of GA1 (e1 - k3 x2)^2 + GA2 (e2 + k3 x1)^2 at the shear centre, EA (e3 + k1 x2 - k2 x1)^2 at the
        centroid, and EI1 k1^2 + EI2 k2^2 + GJ k3^2; its second derivatives are the matrix.

        Args:
            shear, axial, bending, torsion: as of `Stiffness`, finite, along and about the principal axes; bending about
                axes through the centroid.
            centroid, shear_centre: (x1, x2) along the principal axes, m, from the rod's line.
            angle: of the first principal axis, from d_1 towards d_2, rad.
            shear_coupling: GA12, N: the shear force along one axis per shear along the other; zero where the section is
                symmetric.
            others: mass, outline and inertia as of `Stiffness`, along d_1 and d_2.

        Raises:
            SceneError: see `Stiffness`.
        """
        given = cls(shear, axial, bending, torsion)
        for value, field in ((max(given.shear), "shear"), (given.axial, "axial")):
            number("Stiffness.offset", field, value, "finite numbers (N)", math.isfinite)
        (c1, c2), (s1, s2) = (
            vector("Stiffness.offset", field, place, "m", 2)
            for field, place in (("centroid", centroid), ("shear_centre", shear_centre))
        )
        angle = number("Stiffness.offset", "angle", angle, "a number (rad)", math.isfinite)
        coupling = number("Stiffness.offset", "shear_coupling", shear_coupling, "a number (N)", math.isfinite)
        cos, sin = math.cos(angle), math.sin(angle)
        strains, turn = np.eye(6), np.kron(np.eye(2), [[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        strains[:3, 3:] = [[0, 0, -s2], [0, 0, s1], [c2, -c1, 0]]
        strains = strains @ turn  # rotated to the principal axes, then taken at the two points
        diagonal = np.diag((*given.shear, given.axial, *given.bending, given.torsion))
        diagonal[0, 1] = diagonal[1, 0] = coupling
        return cls(matrix=(strains.T @ diagonal @ strains).tolist(), **others)

    @classmethod
    def constructors(cls):
        return cls, cls.offset

    @classmethod
    def from_section(
        cls, section: Any, material: Material | None = None, *, line: Numbers | None = None, unit: float = 1.0
    ) -> "Stiffness":
        """A section of any shape, computed by the package sectionproperties after its geometric and warping analysis.

        Its x is along d_1, its y along d_2. Where centroid or shear centre is off the rod's line, or the principal axes
        are turned, it is a matrix, see `offset`.

        Args:
            section: a `Section` of sectionproperties, or any object with the same methods.
            material: a `Material` for a section without materials; its shear stiffnesses then have a Poisson's ratio of
                zero in the distribution of stresses. None where the section has its own materials.
            line: (x, y) in the section, in its unit of length: the place of the rod's line; None for the centroid.
            unit: the section's unit of length, m, such as 1e-3 for mm; its Young's moduli have N per square of it, its
                densities kg per cube of it.

        Mass is left out where the line is not through the centre of mass (where materials differ in density over E, it
        is not the centroid; it is taken from the regions of `section.geometry`), and inertia also where the principal
        axes are turned, or the materials differ in density over E: `Weight` or motions need them, and refuse such a
        section.

        Raises:
            SceneError: not such a section, an analysis that is missing, or materials that differ in Poisson's ratio.
        """
        arguments = arguments_of(section, material, line, unit)
        off = {"centroid", "shear_centre", "angle"} & arguments.keys()
        return cls.offset(**arguments) if off else cls(**arguments)

    def stiffness(self, material: Material | None = None) -> "Stiffness":
        """The section itself (a material is not needed)."""
        return self

    def stresses(self, material, force, moment):
        """None: the shape is not known (the outline serves pictures only)."""
        return None


class _Round(Section):
    """Circles and tubes, by their outer and inner `_diameters`, m."""

    def stiffness(self, material: Material) -> Stiffness:
        """The section's `Stiffness` in a material."""
        return isotropic(material, *self._shape(material.nu), _circle(self._diameters[0] / 2))

    def moduli(self, material):
        """See `Section`."""
        return moduli_of(material, *self._shape(material.nu))

    def _shape(self, nu):
        D, d = self._diameters
        A, I = math.pi * (D**2 - d**2) / 4, math.pi * (D**4 - d**4) / 64
        m2 = (d / D) ** 2
        cowper = 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)
        area = (cowper if self.shear_factor is None else self.shear_factor) * A
        return A, (I, I), 2 * I, (area, area)

    @property
    def round_radius(self):
        return self._diameters[0] / 2

    def stresses(self, material, force, moment):
        """The `Stress` for contact forces and moments (..., 3), N and N m, along d_1, d_2, d_3."""
        outer, inner = self._diameters
        return round_stress(outer / 2, inner / 2, material.nu, force, moment)


@dataclass(frozen=True)
class Circle(_Round):
    """A solid circular section.

    Args:
        diameter: m.
        shear_factor: None for Cowper's 6(1+nu)/(7+6nu).

    Raises:
        SceneError: a value that is not positive.
    """

    diameter: parts.Diameter
    shear_factor: ShearFactor | None = None

    _diameters = property(lambda self: (self.diameter, 0.0))


@dataclass(frozen=True)
class Tube(_Round):
    """A circular tube.

    Args:
        outer_diameter: m.
        inner_diameter: m, below the outer one.
        shear_factor: None for Cowper's value for a hollow circle.

    Raises:
        SceneError: a value that is not positive, or an inner diameter that is not below the outer one.
    """

    outer_diameter: parts.Diameter
    inner_diameter: parts.Diameter
    shear_factor: ShearFactor | None = None

    _diameters = property(lambda self: (self.outer_diameter, self.inner_diameter))

    def validate(self):
        if self.inner_diameter >= self.outer_diameter:
            refuse(self, "inner_diameter", self.inner_diameter, f"less than outer_diameter = {self.outer_diameter}")


@dataclass(frozen=True)
class Rectangle(Section):
    """A solid rectangular section.

    Args:
        width: along d_1, m.
        height: along d_2, m.
        shear_factor: None for Cowper's 10(1+nu)/(12+11nu).

    Raises:
        SceneError: a value that is not positive.
    """

    width: parts.Diameter
    height: parts.Diameter
    shear_factor: ShearFactor | None = None

    def stiffness(self, material: Material) -> Stiffness:
        """The section's `Stiffness` in a material."""
        b, h = self.width, self.height
        corners = ((b / 2, h / 2), (-b / 2, h / 2), (-b / 2, -h / 2), (b / 2, -h / 2))
        return isotropic(material, *self._shape(material.nu), corners)

    def moduli(self, material):
        """See `Section`."""
        return moduli_of(material, *self._shape(material.nu))

    def _shape(self, nu):
        b, h = self.width, self.height
        area = (10 * (1 + nu) / (12 + 11 * nu) if self.shear_factor is None else self.shear_factor) * (b * h)
        return b * h, (b * h**3 / 12, h * b**3 / 12), _rectangle_torsion(b, h), (area, area)

    def stresses(self, material, force, moment):
        """The `Stress` for contact forces and moments (..., 3), N and N m, along d_1, d_2, d_3."""
        b, h = self.width, self.height
        return rectangle_fibres(b, h, material.nu, _rectangle_torsion(b, h)).stress(force, moment)


def _checked(section, matrix):
    """The checked matrix as a tuple of rows, made exactly symmetric."""
    expected = "6 x 6 finite numbers, symmetric and positive definite (N, N m and N m^2)"
    M = finite_array(section, "matrix", matrix, expected)
    if M.shape != (6, 6) or not (np.diag(M) > 0).all():
        refuse(section, "matrix", matrix, expected)
    size = np.sqrt(np.outer(np.diag(M), np.diag(M)))
    if (np.abs(M - M.T) > _ROUNDING * size).any() or np.linalg.eigvalsh((M + M.T) / (2 * size))[0] < _ROUNDING:
        refuse(section, "matrix", matrix, expected)
    return tuple(map(tuple, ((M + M.T) / 2).tolist()))


def inverse(matrix):
    """Inverses of stiffness matrices (..., 6, 6), scaled first, so that units do not affect the accuracy."""
    size = np.sqrt(np.einsum("...ii->...i", np.asarray(matrix)))
    size = size[..., :, None] * size[..., None, :]
    return np.linalg.inv(matrix / size) / size


def representative(matrix):
    """Representative stiffnesses (GA1, GA2, EA, EI1, EI2, GJ) of a stiffness matrix.

    GA and EA are its diagonal: other strains are zero. EI about the two principal axes of bending (that near d_1 first)
    and GJ are from the inverse: contact forces and other moments are zero.
    """
    flexible = inverse(matrix)
    small, large = 1 / np.linalg.eigvalsh(flexible[3:5, 3:5])[::-1]
    bending = (small, large) if flexible[3, 3] >= flexible[4, 4] else (large, small)
    return *np.diag(matrix)[:3], *bending, 1 / flexible[5, 5]


def _corners(section, outline):
    expected = "three or more corners (x1, x2) of finite numbers (m)"
    corners = finite_array(section, "outline", outline, expected)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        refuse(section, "outline", outline, expected)
    return tuple(map(tuple, corners.tolist()))


def _circle(radius, corners=24):
    angles = [2 * math.pi * i / corners for i in range(corners)]
    return tuple((radius * math.cos(a), radius * math.sin(a)) for a in angles)


def moduli_of(material, A, I, J, shear_areas):
    """`Section.moduli` of a shape in a material, from its properties (m^2, m^4)."""
    E, G = material.E, material.G
    return G * shear_areas[0], G * shear_areas[1], E * A, E * I[0], E * I[1], G * J


def isotropic(material, A, I, J, shear_areas, outline):
    """The `Stiffness` of a shape in a material, from its properties (m^2, m^4)."""
    rho, (*shear, axial, EI1, EI2, torsion) = material.density, moduli_of(material, A, I, J, shear_areas)
    return Stiffness(
        shear=tuple(shear),
        axial=axial,
        bending=(EI1, EI2),
        torsion=torsion,
        mass=None if rho is None else rho * A,
        outline=outline,
        inertia=None if rho is None else (rho * I[0], rho * I[1], rho * (I[0] + I[1])),
    )


def _rectangle_torsion(b, h):
    """Saint-Venant's torsion constant, m^4: the series of tanh(n x)/n^5 over odd n is the exact sum of 1/n^5 minus the
    fast series of (1 - tanh(n x))/n^5."""
    long, short = np.maximum(b, h), np.minimum(b, h)
    x = math.pi * long / (2 * short)
    series = 31 / 32 * _ZETA_5 - sum((1 - np.tanh(n * x)) / n**5 for n in range(1, 15, 2))
    return long * short**3 / 3 * (1 - 192 * short / (math.pi**5 * long) * series)
