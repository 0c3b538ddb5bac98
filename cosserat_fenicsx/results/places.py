"""Nodal values of a result between its nodes: the weights for two meshes are found once."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np


class Places(NamedTuple):
    """Places on a mesh: (places, nodes per element) the nodes of their elements, all rods one after another, and the
    weights of these; rods: for every rod the slice of its places."""

    nodes: np.ndarray
    weights: np.ndarray
    rods: tuple

    @classmethod
    def on(cls, layout, rule, xs):
        """Those at arc lengths over the rod's length, an array for every rod."""
        p, first, start = len(rule.nodes) - 1, 0, 0
        nodes, weights, rods = [], [], []
        for breaks, x in zip(layout.breaks, xs, strict=True):
            cells, values = rule.locate_all(breaks, x)
            nodes.append(first + cells[:, None] * p + np.arange(p + 1))
            weights.append(values)
            rods.append(slice(start, start + len(x)))
            first, start = first + (len(breaks) - 1) * p + 1, start + len(x)
        return cls(np.concatenate(nodes), np.concatenate(weights), tuple(rods))

    def of(self, values):
        """(n, places, k) from nodal values (n, N, k)."""
        return np.einsum("xj,nxjk->nxk", self.weights, values[:, self.nodes])


class Compared(NamedTuple):
    """Where two meshes are compared: at the nodes of every element of the coarse one and half way between them.

    inside: (places per element, nodes per element) weights of a coarse element's nodes, the same in all elements;
    cells (places,), weights (places, nodes per element): of the fine elements, on the same side of a jump;
    ends: (places,) whether at an end of a coarse element; rods: for every rod the slice of its places.
    """

    inside: np.ndarray
    cells: np.ndarray
    weights: np.ndarray
    ends: np.ndarray
    rods: tuple


# Distance from the end of an element, over its length, at which a place surely belongs to it.
_INWARDS = 1e-6


@lru_cache(maxsize=16)
def compared(coarse, fine, rule):
    """`Compared` for two `Layout`s with elements of the same `ElementRule`."""
    local = halfway(rule.nodes)
    ends = (local == local[0]) | (local == local[-1])
    near = np.clip(local, _INWARDS, 1 - _INWARDS)
    found, rods, first, start = [], [], 0, 0
    for breaks, x, sure in zip(fine.breaks, coarse.inside(local), coarse.inside(near), strict=True):
        cells, _ = rule.locate_all(breaks, sure.ravel())
        of_cells = (x.ravel() - breaks[cells]) / np.diff(breaks)[cells]
        found.append((first + cells, rule.basis(np.clip(of_cells, 0.0, 1.0)), np.tile(ends, len(x))))
        rods.append(slice(start, start + x.size))
        first, start = first + len(breaks) - 1, start + x.size
    return Compared(rule.basis(local), *map(np.concatenate, zip(*found, strict=True)), tuple(rods))


@lru_cache(maxsize=32)
def all_cell_nodes(layout, degree):
    """(elements, degree + 1) the nodes of the elements of all rods one after another."""
    return np.concatenate([nodes for nodes, _ in cell_nodes(layout, degree)])


@lru_cache(maxsize=16)
def transferred(coarse, fine, rule):
    """What takes a state to another mesh: `Places` of the fine nodes on the coarse mesh, and for every rod the coarse
    elements and the weights of their Gauss points for the fine Gauss points."""
    gauss = [
        rule.locate_all(breaks, inside.ravel(), rule.between_gauss)
        for breaks, inside in zip(coarse.breaks, fine.inside(rule.gauss), strict=True)
    ]
    return Places.on(coarse, rule, fine.node_s(rule.nodes)), gauss


@lru_cache(maxsize=32)
def cell_nodes(layout, degree):
    """For every rod (elements, degree + 1) the nodes of its elements, and the slice of its nodes among those of all."""
    found, first = [], 0
    for count in layout.counts:
        nodes = first + degree * np.arange(count)[:, None] + np.arange(degree + 1)
        found.append((nodes, slice(first, first + degree * count + 1)))
        first += degree * count + 1
    return found


def halfway(places):
    """Coordinates in ascending order with the midpoints of their intervals."""
    return np.sort(np.concatenate([places, (places[:-1] + places[1:]) / 2]))
