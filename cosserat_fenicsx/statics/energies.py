"""The second variation along given motions, from small strains instead of the entries of its matrix."""

import numpy as np

from cosserat_fenicsx.models.data_derivative import EnergyOfMotion, made_once


class Energies:
    """The second variation along modes at the state of a `Problem`, supports and joints included.

    Args:
        problem: the `Problem`, in space.
        modes: each (N, 6) displacements and rotations of all nodes in the scene's order, inertial, dimensionless.
        resistance: see `Part`; None for modes that satisfy all constraint equations.
    """

    def __init__(self, problem, modes, resistance=None):
        model = problem.model
        self._problem, self._modes, self._resistance = problem, modes, resistance
        self._energy = made_once(model, "energy_of_motion", EnergyOfMotion)
        (variation,) = model.second_variations
        self._axes = variation.axes
        self._tied = np.array([mode[model.tied_slots] for mode in modes])

    def here(self, springs=True):
        """(modes,) dimensionless; springs: whether those in place of supports and joints count."""
        ties, eta, tied = self._problem.ties, self._problem.eta, self._tied
        found = np.array([self._energy.along(mode) for mode in self._modes])
        if ties:
            found += ties.energy(ties.second_variation(self._axes, eta), tied)
            if springs and self._resistance is not None:
                found += ties.energies_of_springs(self._axes, eta, self._resistance, tied)
        return found
