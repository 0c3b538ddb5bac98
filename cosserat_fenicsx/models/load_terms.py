"""The Functions that carry a scene's loads on a mesh, one term a kind."""

import numpy as np
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.rod_data import gauss_function
from cosserat_fenicsx.models.shape import place_loads


class LoadTerms:
    """The load terms of a shape.

    Args:
        rods: the `RodMesh`.
        shape: the `Shape`, whose `terms` they are.

    Attributes:
        terms: (function of forms.loads, "point" or "line", Functions) of every term.
    """

    def __init__(self, rods, shape):
        self._rods, self._shape = rods, shape
        self.terms = [(work, place, [self._function(place) for _ in range(n)]) for work, place, n in shape.terms]

    def _function(self, place):
        mesh = self._rods.mesh
        if place == "line":
            return gauss_function(mesh, self._shape.points, 3)
        return fem.Function(compat.function_space(mesh, compat.lagrange(mesh, 1, 3, discontinuous=True)))

    def fill(self, scene, layout, scales, rule, axes):
        """Put a scene's loads into the Functions, as components along `axes` (3, 3)."""
        sizes = layout.sizes(scene) / scales.length
        for (_, members), (_, place, functions) in zip(place_loads(scene, layout), self.terms, strict=True):
            if place == "line":
                self._rods.fill(functions[0], _densities(members, scene, layout, scales, rule) @ axes.T)
                continue
            for function in functions:
                function.x.array[:] = 0
            for load, (rod, vertex) in members:
                vectors = load.vectors(scene.rods[rod])
                for function, (value, unit) in zip(functions, vectors, strict=True):
                    self._at_end(function, rod, vertex, axes @ np.asarray(value) / scales.of_unit(unit), unit, sizes)

    def _at_end(self, function, rod, vertex, value, unit, sizes):
        """Put a point value on the one element that answers for an element end."""
        inner = min(vertex, self._shape.counts[rod] - 1)
        cell = np.flatnonzero((self._rods.cell_rod == rod) & (self._rods.cell_inner == inner))
        if len(cell) == 0:
            return
        end = int(vertex > inner) ^ int(self._rods.reversed[cell[0]])
        dof = compat.cell_nodes(function.function_space)[cell[0], end]
        # the rule at the ends weighs each by half the element; arms are geometry, not densities
        density = value if unit == "length" else value * 2 / sizes[self._rods.cells[cell[0]]]
        function.x.array.reshape(-1, 3)[dof] = density


def _densities(members, scene, layout, scales, rule):
    """(elements, points, 3) of a line load's term, dimensionless, inertial."""
    inside = layout.inside(rule.gauss)
    parts = [np.zeros((*x.shape, 3)) for x in inside]
    for load, (rod, _) in members:
        s = inside[rod].ravel() * scene.rods[rod].length
        density = load.density(scene.rods[rod], s) / scales.of_unit(load.unit)
        parts[rod] += density.reshape(parts[rod].shape)
    return np.concatenate(parts)
