"""Curves along a string from what is accurate in each element."""

import numpy as np

#: The part of the string's length on which differences between two meshes are below the ones that are told: beside
#: concentrated forces they are not.
MOSTLY = 0.95


def along_elements(mean, sizes, nodes):
    """(elements, nodes) values that have the mean of each element, and a slope from the means of its neighbours.

    The slope is the smaller one of those to the two neighbours, and none at a peak (B. van Leer, J. Comput. Phys. 32
    (1979) 101, doi:10.1016/0021-9991(79)90145-1), so that no value is beyond the neighbours' means.

    Args:
        mean, sizes: (elements,) means, and lengths of the elements, m. nodes: in an element, from 0 to 1.
    """
    steps = np.diff(mean) / ((sizes[1:] + sizes[:-1]) / 2)
    before, after = np.append(steps[:1], steps), np.append(steps, steps[-1:])
    slope = np.where(before * after > 0, np.sign(before) * np.minimum(abs(before), abs(after)), 0.0)
    if len(mean) < 2:
        slope = np.zeros(1)
    return np.maximum(mean[:, None] + (slope * sizes)[:, None] * (nodes - 0.5), min(0.0, mean.min()))


def apart_mostly(here, there, lengths):
    """The difference of two arrays that `MOSTLY` of the length is below; lengths: those that the places stand for."""
    apart = np.abs(here - there)
    order = np.argsort(apart)
    so_far = np.cumsum(lengths[order])
    return float(apart[order[np.searchsorted(so_far, MOSTLY * so_far[-1])]])
