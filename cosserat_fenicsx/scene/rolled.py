"""Hot-rolled steel profiles by name: IPE, HEA, HEB and HEM.

Dimensions: EN 10365 (Euronorm 19-57 and 53-62), in rolled_profiles.csv. The radius of the fillets between web and
flanges counts in all properties.

- Area and second moments: sums over web, flanges and fillets, exact.
- Torsion constant: El Darwish & Johnston, J. Struct. Div. ASCE 91 (1965) ST1, 203, as in the tables of EN 10365; -2.4
  to +4.3 % from finite elements.
- Shear areas: I^2/(integral of S^2/t), with the shear flow V S/I of Jourawski over the thickness t, in the flanges
  along both axes. They belong to Timoshenko's stiffness, with the energy V^2/(2 G A_s), and are not the areas A_v of
  EN 1993 for the resistance to shear. They do not depend on Poisson's ratio. For ten sizes they exceed finite elements
  along d_1 by 3 to 5 % with nu = 0 and up to 6.6 % with nu = 0.3; along d_2 by 0 to 4.4 % with either.
"""

import csv
import functools
import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.polynomial.legendre import legvander

from cosserat_fenicsx.checks import instance, store
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import gauss
from cosserat_fenicsx.scene.sections import Material, Section, Stiffness, isotropic
from cosserat_fenicsx.scene.stresses import Stress

_TABLE = Path(__file__).with_name("rolled_profiles.csv")
_POINTS = 24  # Gauss points per piece of the integrals of shear areas
# Second moment of a fillet of radius 1 about its own centroid.
_FILLET = 1 / 3 - math.pi / 16 - 1 / (9 * (4 - math.pi))


@functools.cache
def _table():
    """{name: (h, b, tw, tf, r)}, m."""
    with _TABLE.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.reader(stream))[1:]
    return {name: tuple(float(x) / 1000 for x in sizes) for name, *sizes in rows}


@dataclass(frozen=True)
class Profile(Section):
    """A hot-rolled profile of steel by its name: "IPE 200", "HEA 160", "HEB 300", "HEM 100".

    Its flanges are parallel to d_1, its web to d_2: its larger bending stiffness is about d_1.

    Torsion is Saint-Venant's: a warping stiffness is not modelled, so that open sections are too soft in torsion where
    warping is held, and lateral torsional buckling loads are too low.

    Args:
        name: as above; spaces, capitals and the order of "HE 160 A" do not matter.

    Attributes:
        height, width, web, flange, fillet: h, b, t_w, t_f, r, m.
        area: m^2. second_moments: about d_1 and d_2, m^4. torsion_constant: m^4. shear_areas: along d_1 and d_2, m^2,
            of Timoshenko's stiffness, which are not A_v of EN 1993.

    Raises:
        SceneError: an unknown name, with those that are near.
    """

    name: str

    def __post_init__(self):
        instance(self, "name", self.name, str, "a name such as 'IPE 200'")
        plain = "".join(self.name.upper().split())
        if plain.startswith("HE") and plain[2:3].isdigit():  # HE 160 A
            plain = f"HE{plain[-1]}{plain[2:-1]}"
        known = {name.replace(" ", ""): name for name in _table()}
        if plain not in known:
            raise SceneError(f"Profile.name = {self.name!r}: {_near(plain)}")
        store(self, name=known[plain])

    height = property(lambda self: _table()[self.name][0])
    width = property(lambda self: _table()[self.name][1])
    web = property(lambda self: _table()[self.name][2])
    flange = property(lambda self: _table()[self.name][3])
    fillet = property(lambda self: _table()[self.name][4])

    @property
    def area(self):
        """m^2."""
        h, b, tw, tf, r = _table()[self.name]
        return 2 * b * tf + (h - 2 * tf) * tw + (4 - math.pi) * r**2

    @property
    def second_moments(self):
        """(I_1, I_2) about d_1 and d_2, m^4."""
        h, b, tw, tf, r = _table()[self.name]
        area = (1 - math.pi / 4) * r**2  # of one fillet, about its own centroid at (c, c) from the corner
        c, own = r * (10 - 3 * math.pi) / (12 - 3 * math.pi), _FILLET * r**4
        return (
            (b * h**3 - (b - tw) * (h - 2 * tf) ** 3) / 12 + 4 * (own + area * (h / 2 - tf - c) ** 2),
            (2 * tf * b**3 + (h - 2 * tf) * tw**3) / 12 + 4 * (own + area * (tw / 2 + c) ** 2),
        )

    @property
    def torsion_constant(self):
        """Saint-Venant's, m^4."""
        h, b, tw, tf, r = _table()[self.name]
        junction = ((r + tw / 2) ** 2 + (r + tf) ** 2 - r**2) / (2 * r + tf)  # diameter of the circle inscribed there
        return (
            2 / 3 * (b - 0.63 * tf) * tf**3
            + (h - 2 * tf) * tw**3 / 3
            + 2 * tw / tf * (0.145 + 0.1 * r / tf) * junction**4
        )

    @property
    def shear_areas(self):
        """Along d_1 and d_2, m^2."""
        h, b, tw, tf, r = _table()[self.name]
        I1, I2 = self.second_moments
        inner = h / 2 - tf

        def fillet(u):  # its thickness at the distance u from the surface that it rises from
            return r - np.sqrt(r**2 - (r - u) ** 2)

        def across_web(y):
            return tw + 2 * fillet(inner - y)

        def across_flanges(x):
            return 2 * tf + 2 * fillet(x - tw / 2)

        # under a force along d_1 the web has no shear flow
        within = (tw / 2, lambda x: h + 0 * x, lambda x: 2 * tf + 2 * r + 0 * x)
        along_1 = _flow(((b / 2, lambda x: 2 * tf + 0 * x), (tw / 2 + r, across_flanges), within))
        along_2 = _flow(((h / 2, lambda y: b + 0 * y), (inner, across_web), (inner - r, lambda y: tw + 0 * y)))
        # under a force along d_2 the flanges have a flow along d_1, from zero at their four tips
        flanges = 4 / 3 * tf * ((h - tf) / 2) ** 2 * ((b - tw) / 2) ** 3
        return I2**2 / (2 * along_1), I1**2 / (2 * along_2 + flanges)

    def outline(self):
        """Corners along d_1 and d_2 for pictures, without fillets, m."""
        h, b, tw, tf, _ = _table()[self.name]
        inner = h / 2 - tf
        half = ((b / 2, h / 2), (-b / 2, h / 2), (-b / 2, inner), (-tw / 2, inner), (-tw / 2, -inner), (-b / 2, -inner))
        return (*half, *((-x, -y) for x, y in half))

    def stiffness(self, material: Material) -> Stiffness:
        """The section's `Stiffness` in a material."""
        J, shear_areas = self.torsion_constant, self.shear_areas
        return isotropic(material, self.area, self.second_moments, J, shear_areas, self.outline())

    def stresses(self, material, force, moment):
        """The `Stress` for contact forces and moments (..., 3), N and N m, along d_1, d_2, d_3: normal stresses at the
        flanges' edges; von Mises stresses are NaN, since shear stresses of rolled profiles are not computed."""
        I1, I2 = self.second_moments
        axial = force[..., 2] / self.area
        bending = np.abs(moment[..., 0]) * self.height / (2 * I1) + np.abs(moment[..., 1]) * self.width / (2 * I2)
        return Stress(np.full_like(axial, np.nan), axial + bending, axial - bending)


def _flow(pieces):
    """The integral of S^2/t over half a section, m^5; pieces: (distance, thickness, and that of the flow)."""
    rule = gauss(_POINTS)
    inner = legvander(rule.points, _POINTS) @ rule.integral
    total = moment = 0.0
    for (start, thickness, *spread), (end, *_) in itertools.pairwise((*pieces, (0.0,))):
        half = (start - end) / 2
        x = start - half * (1 + rule.points)
        outside = half * x * thickness(x)
        S = moment + inner @ outside
        total += half * rule.weights @ (S**2 / (spread[0] if spread else thickness)(x))
        moment += rule.weights @ outside
    return total


def _near(name):
    """A hint for an unknown name: the nearest sizes of its series, or the known series."""
    series, size = name[:3], name[3:]
    sizes = [int(known.split()[1]) for known in _table() if known.startswith(f"{series} ")]
    if not sizes or not size.isdigit():
        return (
            "expected IPE, HEA, HEB or HEM with its size, such as 'IPE 200'; other series, such as IPE A, HE AA "
            "and UPN, are not in the table: see Stiffness.from_section"
        )
    near = sorted(sorted(sizes, key=lambda known: abs(known - int(size)))[:3])
    return f"did you mean {' or '.join(f'{series} {known}' for known in near)}?"
