"""Derivatives of smooth functions by central differences of eighth order, for data that Python computes from numbers.

Nothing that a solver iterates is differenced: only data, or what follows explicitly from a state and its derivative.
"""

import numpy as np

#: Multiples of the step at which the function is evaluated.
PLACES = (-4, -3, -2, -1, 1, 2, 3, 4)
#: The usual step over the size of the number: for the power -4 of it, truncation and rounding are below 1e-13.
STEP = 4e-3
# Weights of f(k h) - f(-k h), k = 1 .. 4, of orders eight and six.
_EIGHT, _SIX = (4 / 5, -1 / 5, 4 / 105, -1 / 280), (3 / 4, -3 / 20, 1 / 60, 0.0)
# Largest relative error of a derivative of what is smooth, and relative rounding of the values.
_SMOOTH, _ROUNDING = 1e-6, 1e-9


def is_smooth(values, step, of_all=lambda sizes: sizes):
    """Whether the estimated error of `derivative` is small: that the step is short, and no jump is near.

    Args:
        of_all: makes (3,) sizes the largest ones of all ranks, where these hold parts of the values.
    """
    sizes = of_all(np.array([np.abs(x).max(initial=0.0) for x in (*derivative(values, step), values)]))
    return sizes[1] <= _SMOOTH * sizes[0] + _ROUNDING * sizes[2] / step


def derivative(values, step):
    """The derivative of a function and an estimate of its error.

    Args:
        values: those at `PLACES` times the step, arrays of one shape; step: a number.

    Returns:
        (derivative, error), arrays: the error is the difference from a formula of sixth order, an upper bound where the
        step is small.
    """
    odd = [np.subtract(values[4 + k], values[3 - k]) for k in range(4)]
    eight, six = (sum(w * part for w, part in zip(weights, odd, strict=True)) / step for weights in (_EIGHT, _SIX))
    return eight, np.abs(eight - six)
