"""Axes of drawings: round limits, and ticks as texts in a suitable unit of length."""

import math
from dataclasses import dataclass

import numpy as np

_UNITS = ((2e4, 1e3, "km"), (0.05, 1.0, "m"), (5e-5, 1e-3, "mm"), (5e-8, 1e-6, "µm"), (0.0, 1e-9, "nm"))
# At most this many intervals between ticks on the longest axis; a flat axis extends by this share of the longest.
_INTERVALS, _FLAT = 6, 0.03


@dataclass(frozen=True)
class Axis:
    """An axis of the box around a drawing.

    Attributes:
        name: with the unit; low, high: m; ticks: (position in m, text), none where the drawing is flat.
    """

    name: str
    low: float
    high: float
    ticks: tuple


def axes_of(points):
    """The three `Axis` of a drawing of points (n, 3), m."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    scale, unit = next((scale, unit) for least, scale, unit in _UNITS if size >= least)
    step = round_step(size, _INTERVALS)
    first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
    return tuple(
        _axis(f"{name} ({unit})", int(a), int(b), step, scale, size) if b > a else _flat(f"{name} ({unit})", x, size)
        for name, a, b, x in zip("xyz", first, last, (low + high) / 2, strict=True)
    )


def _axis(name, first, last, step, scale, size):
    return Axis(
        name,
        first * step,
        last * step,
        tuple((k * step, text_of(k * step, step, scale)) for k in range(first, last + 1)),
    )


def _flat(name, middle, size):
    return Axis(name, middle - _FLAT * size, middle + _FLAT * size, ())


def round_step(size, most):
    """The least of 1, 2 and 5 times a power of ten that divides `size` into at most `most` intervals."""
    decade = 10.0 ** math.floor(math.log10(size / most))
    return next(f * decade for f in (1, 2, 5, 10) if size / (f * decade) <= most * (1 + 1e-9))


def text_of(value, step, scale=1.0):
    """A tick's value, a multiple of `step`, in a unit of size `scale`, with the digits that the step needs."""
    digits = max(0, -math.floor(math.log10(step / scale) + 1e-9))
    text = f"{value / scale:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text
