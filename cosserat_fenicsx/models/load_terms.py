"""The Functions that carry a scene's loads on a mesh, one term a kind."""

import numpy as np
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.rod_data import gauss_function
from cosserat_fenicsx.models.shape import place_loads
from cosserat_fenicsx.scene.signals import at, signals_of


class LoadTerms:
    """The load terms of a shape.

    Args:
        rods: the `RodMesh`.
        shape: the `Shape`, whose `terms` they are.

    Attributes:
        terms: (function of forms.loads, "point" or "line", Functions) of every term.
    """

    def __init__(self, rods, shape):
        self._rods, self._shape, self._ends = rods, shape, {}
        self.terms = [(work, place, [self._function(place) for _ in range(n)]) for work, place, n in shape.terms]

    def _function(self, place):
        mesh = self._rods.mesh
        if place == "line":
            return gauss_function(mesh, self._shape.points, 3)
        return fem.Function(compat.function_space(mesh, compat.lagrange(mesh, 1, 3, discontinuous=True)))

    def fill(self, scene, layout, scales, rule, axes):
        """Put a scene's loads into the Functions, as components along `axes` (3, 3); as at time 0 where they depend on it."""
        self._scene, self._layout, self._scales, self._rule, self._axes = scene, layout, scales, rule, axes
        self._sizes = layout.sizes(scene) / scales.length
        self._placed = [
            (functions, place, members)
            for (_, members), (_, place, functions) in zip(place_loads(scene, layout), self.terms, strict=True)
        ]
        for functions, place, members in self._placed:
            if place == "point":
                for function in functions:
                    function.x.array[:] = 0
            self._fill_term(functions, place, members, 0.0)
        self._moving = []  # the same for what depends on time: of a line load all that share its term
        for functions, place, members in self._placed:
            moving = [(load, where) for load, where in members if signals_of(load)]
            if moving:
                self._moving.append((functions, place, members if place == "line" else moving))

    def at(self, t):
        """Put the loads at the time t (s) into the Functions."""
        for functions, place, members in self._moving:
            self._fill_term(functions, place, members, t)

    @property
    def moving(self):
        """The Functions that depend on time."""
        return [function for functions, _, _ in self._moving for function in functions]

    def _fill_term(self, functions, place, members, t):
        if place == "line":
            densities = _densities(members, self._scene, self._layout, self._scales, self._rule, t)
            self._rods.fill(functions[0], densities @ self._axes.T)
            return
        for load, (rod, vertex) in members:
            vectors = at(load, t).vectors(self._scene.rods[rod])
            for function, (value, unit) in zip(functions, vectors, strict=True):
                scaled = self._axes @ np.asarray(value) / self._scales.of_unit(unit)
                self._at_end(function, rod, vertex, scaled, unit, self._sizes)

    def _at_end(self, function, rod, vertex, value, unit, sizes):
        """Put a point value on the one element that answers for an element end."""
        if (rod, vertex) not in self._ends:
            self._ends[rod, vertex] = self._end(function, rod, vertex)
        dof, element = self._ends[rod, vertex]
        if dof is not None:
            # the rule at the ends weighs each by half the element; arms are geometry, not densities
            density = value if unit == "length" else value * 2 / sizes[element]
            function.x.array.reshape(-1, 3)[dof] = density

    def _end(self, function, rod, vertex):
        """The local number of an element end in a term's Functions and the scene's of the element; None on other ranks."""
        inner = min(vertex, self._shape.counts[rod] - 1)
        cell = np.flatnonzero((self._rods.cell_rod == rod) & (self._rods.cell_inner == inner))
        if len(cell) == 0:
            return None, None
        end = int(vertex > inner) ^ int(self._rods.reversed[cell[0]])
        return compat.cell_nodes(function.function_space)[cell[0], end], self._rods.cells[cell[0]]


def _densities(members, scene, layout, scales, rule, t):
    """(elements, points, 3) of a line load's term at the time t (s), dimensionless, inertial."""
    inside = layout.inside(rule.gauss)
    parts = [np.zeros((*x.shape, 3)) for x in inside]
    for load, (rod, _) in members:
        s = inside[rod].ravel() * scene.rods[rod].length
        density = at(load, t).density(scene.rods[rod], s) / scales.of_unit(load.unit)
        parts[rod] += density.reshape(parts[rod].shape)
    return np.concatenate(parts)
