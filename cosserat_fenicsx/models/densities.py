"""Force and moment per length of the distributed actions, from which results compute contact forces at element ends."""

import numpy as np


class Densities:
    """The densities of the actions of a model's current scene."""

    def load(self, model):
        """Prepare for the model's scene. Dead densities are evaluated once, per unit of each of the two factors."""
        self._model, self._dead = model, None
        if not model.forms.density or model.signature.lives_along_rods:
            return
        factors = model.load_factor, model.permanent_factor
        before = [float(factor.value) for factor in factors]
        self._dead = []
        for i in range(2):
            for j, factor in enumerate(factors):
                factor.value = float(i == j)
            self._dead.append(self._at(model.forms.density, len(model.forms.gauss)))
        for factor, value in zip(factors, before, strict=True):
            factor.value = value

    def at(self, load_factors):
        """`here` at several load factors (k,), for dead densities: (k, elements, points, 6) or None, and None."""
        if self._dead is None:
            return None, None
        of_load, of_permanent = self._dead
        permanent = float(self._model.permanent_factor.value) * of_permanent
        return np.multiply.outer(load_factors, of_load) + permanent, None

    def here(self):
        """The densities at the model's state, inertial, dimensionless, (elements, points, 6) each or None: at the Gauss
        points, and at the nodes for actions integrated there."""
        model, at_gauss = self._model, None
        if self._dead is not None:
            factors = (float(factor.value) for factor in (model.load_factor, model.permanent_factor))
            at_gauss = sum(factor * of_unit for factor, of_unit in zip(factors, self._dead, strict=True))
        elif model.forms.density:
            at_gauss = self._at(model.forms.density, len(model.forms.gauss))
        if not model.forms.node_density:
            return at_gauss, None
        return at_gauss, self._at(model.forms.node_density, len(model.nodes))

    def _at(self, expressions, points):
        values = sum(self._model.gathered(each, points, 6) for each in expressions).reshape(-1, points, 2, 3)
        return (values @ self._model.axes).reshape(-1, points, 6)
