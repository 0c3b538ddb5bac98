"""Gauss quadrature on [-1, 1] with the polynomial through the values at its points."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre


class Gauss(NamedTuple):
    """Points (n,), weights (n,), and matrices from the values at the points to the coefficients of the Legendre series
    through them, (n, n), and of its integral from -1, (n + 1, n)."""

    points: np.ndarray
    weights: np.ndarray
    series: np.ndarray
    integral: np.ndarray


@cache
def gauss(n):
    """The `Gauss` rule of n points."""
    points, weights = legendre.leggauss(n)
    # By inversion: discrete orthogonality with Gauss weights loses two digits to the rounding of the points.
    series = np.linalg.inv(legendre.legvander(points, n - 1))
    return Gauss(points, weights, series, legendre.legint(series, lbnd=-1, axis=0))
