"""Criteria of errors: the bending energy of rods of round section, and the displacement of one station."""

import numpy as np

from cosserat_fenicsx.results.compared import Criterion

_X, _WEIGHTS = np.polynomial.legendre.leggauss(16)


class BendingEnergy(Criterion):
    """The integral of |m|^2/(2 EI) over all rods, J."""

    name, words = "bending_energy", "bending energies"

    def values(self, path):
        energy = np.zeros(len(path))
        for rod in path.scene.rods:
            for x, weight in zip(_X, _WEIGHTS, strict=True):
                s = (1 + x) / 2 * rod.length
                moment = np.linalg.norm(path.moment(rod.at(s)), axis=1)
                energy += weight * rod.length / 4 * moment**2 / rod.stiffness_at(s).J[0]
        return energy


class Sway(Criterion):
    """The displacement of a station along x, relative to 1 mm where it is less."""

    name, words = "sway", "sways"

    def __init__(self, station="column.end"):
        self.station = station

    def values(self, path):
        return path.displacement(self.station)[:, 0]

    def sizes(self, path):
        return np.maximum(np.abs(self.values(path)), 1e-3)
