"""Loads at which a string in a hole buckles, by the usual criteria, each by its name.

EI: bending stiffness (N m^2); clearance: radius of the hole less the contact radius (m); weight: in mud (N/m);
compression: N, positive. All functions take arrays.

- Dawson-Paslay: sinusoidal, straight inclined hole, 2 sqrt(EI w sin i/r). R. Dawson & P. R. Paslay, J. Petr. Technol.
  36 (1984) 1734, doi:10.2118/11167-PA.
- Chen: helical, sqrt(2) times that: a uniform helix has the energy of the straight string. Y.-C. Chen, Y.-H. Lin &
  J. B. Cheatham, J. Petr. Technol. 42 (1990) 140, doi:10.2118/19176-PA.
- Wu: helical, 2 sqrt(2) - 1 times that: the mean over the transition. J. Wu & H. C. Juvkam-Wold, SPE 25503 (1993),
  doi:10.2118/25503-MS.
- He-Kyllingstad: sinusoidal, any hole: 2 sqrt(EI N/r) with the wall force per length N of the straight string under
  this load. X. He & A. Kyllingstad, SPE Drilling & Completion 10 (1995) 10, doi:10.2118/25370-PA.
- Lubinski: vertical hole, 1.94 (EI w^2)^(1/3). A. Lubinski, Drilling and Production Practice (1950) 178, API-50-178.
- Wu, Juvkam-Wold & Lu: helical, vertical hole, 5.55 (EI w^2)^(1/3) at the lower end when the first turn of a helix
  appears there, at whose top the compression is 0.14 (EI w^2)^(1/3). Oil & Gas J. 91 (1993) no. 33, 76. With the energy
  of the straight string a turn of length L bears 4 pi^2 EI/L^2 + w L/2 at its lower end, at least 4.05 (EI w^2)^(1/3),
  and half a sine wave 2.55: 4.05 is the mean of 2.55 and 5.55, and 0.14 is w L less than 5.55, L^3 = 16 pi^2 EI/w.

The compression at each place decides the state of a string: a snake above the greater of He-Kyllingstad's and
Lubinski's loads, a helix above the greater of sqrt(2) He-Kyllingstad's and 5.55 (EI w^2)^(1/3). A helix adds
r F^2/(4 EI) to the wall force per length.

The last three numbers belong to weight on the lower end of a string in a vertical hole. Taken at each place they leave
out the uppermost turn of a helix, from 5.55 down to 0.14 (EI w^2)^(1/3), and hold for compression that friction built
up farther below as well. The estimate of the model's error includes the possible effect: there the string is a helix
from the lowest load at which one is known, `earliest_helix_load`.
"""

import numpy as np

from cosserat_fenicsx.checks import refuse

_CHEN, _WU = np.sqrt(2.0), 2 * np.sqrt(2.0) - 1
_LUBINSKI, _VERTICAL_HELIX, _VERTICAL_TOP = 1.94, 5.55, 0.14
#: States of a string, and their names.
STRAIGHT, SNAKE, HELIX = 0, 1, 2
STATES = ("straight", "sinusoidal", "helical")


def dawson_paslay(EI, clearance, weight, inclination):
    """N; inclination in rad."""
    return 2 * np.sqrt(EI * np.abs(weight) * np.sin(inclination) / clearance)


def chen(EI, clearance, weight, inclination):
    """N; inclination in rad."""
    return _CHEN * dawson_paslay(EI, clearance, weight, inclination)


def wu(EI, clearance, weight, inclination):
    """N; inclination in rad."""
    return _WU * dawson_paslay(EI, clearance, weight, inclination)


def lubinski(EI, weight):
    """N."""
    return _LUBINSKI * np.cbrt(EI * weight**2)


def he_kyllingstad(EI, clearance, along, across, curvature):
    """N: the smallest F > 0 with F = 2 sqrt(EI N(F)/r), N^2 = (across - curvature F)^2 + along^2. along, across: weight
    per length along the binormal and along the normal of the axis (which points to the centre of its curvature), N/m;
    curvature: of the axis, 1/m. Returns infinity where no load fulfils it."""
    EI, clearance, along, across, curvature = np.broadcast_arrays(EI, clearance, along, across, curvature)
    # with F = f x: x^4 - (curvature f/q)^2 x^2 + 2 curvature f across/q^2 x - (across^2 + along^2)/q^2 = 0
    f = 2 * np.sqrt(EI * np.maximum(np.hypot(along, across), 1e-9) / clearance)
    q = f**2 * clearance / (4 * EI)
    companion = np.zeros((*f.shape, 4, 4))
    companion[..., 1, 0] = companion[..., 2, 1] = companion[..., 3, 2] = 1.0
    companion[..., 0, 3] = (across**2 + along**2) / q**2
    companion[..., 1, 3] = -2 * curvature * f * across / q**2
    companion[..., 2, 3] = (curvature * f / q) ** 2
    roots = np.linalg.eigvals(companion)
    real = (np.abs(roots.imag) < 1e-7 * np.abs(roots)) & (roots.real > 0)
    return f * np.where(real, roots.real, np.inf).min(axis=-1)


def load_of(name, EI, clearance, weight, inclination, along, across, curvature):
    """N: by the criterion of a name, see the functions above; NaN where EI or a clearance is missing. Raises
    SceneError: an unknown name."""
    loose = np.where(clearance > 1e-9, clearance, np.nan)
    straight = {"Dawson-Paslay": dawson_paslay, "Chen": chen, "Wu": wu}
    if name in straight:
        return straight[name](EI, loose, weight, inclination)
    if name == "Lubinski":
        return lubinski(EI, weight)
    if name != "He-Kyllingstad":
        refuse("TorqueAndDrag", "critical_load", name, f"{', '.join(straight)}, He-Kyllingstad or Lubinski")
    found, known = np.full(len(EI), np.nan), ~np.isnan(EI * loose)
    found[known] = he_kyllingstad(*(x[known] for x in (EI, loose, along, across, curvature)))
    return found


def snake_load(EI, clearance, weight, side):
    """N: above it the string is a snake; side: wall force per length without buckling, N/m."""
    return np.maximum(2 * np.sqrt(EI * side / clearance), lubinski(EI, weight))


def helix_load(EI, clearance, weight, side):
    """N: above it the string is a helix; side: wall force per length without buckling, N/m."""
    return np.maximum(2 * _CHEN * np.sqrt(EI * side / clearance), _VERTICAL_HELIX * np.cbrt(EI * weight**2))


def earliest_helix_load(EI, clearance, weight, side):
    """N: below it no part of a helix is expected: the load of a snake, in a vertical hole that at a helix' top."""
    return np.maximum(2 * np.sqrt(EI * side / clearance), _VERTICAL_TOP * np.cbrt(EI * weight**2))


def helix_side(EI, clearance, compression):
    """Wall force per length that a helix adds, N/m."""
    return clearance * compression**2 / (4 * EI)
