"""Stationary points of the energy under the constraint |q|^2 = 1, with a multiplier lambda at every node."""

import numpy as np

from cosserat_fenicsx.forms import spatial
from cosserat_fenicsx.models.formulations.contact_force import CARRIED, UNKNOWN
from cosserat_fenicsx.models.formulations.formulation import Formulation
from cosserat_fenicsx.models.formulations.unit_length import UnitLength
from cosserat_fenicsx.quaternions import small_rotations


class ByMultiplier(UnitLength):
    """lambda is the unknown after r and q; virtual rotations are those of changes of q."""

    unknowns, galerkin = 1, True

    def tests(self, phi, phi_s, q, q_s):
        """See `UnitLength`."""
        return spatial.variations_of(phi, phi_s, q, q_s)

    def equations(self, state, test, U_node, phi):
        """See `UnitLength`."""
        return spatial.multiplier(U_node[7], phi[7], state.q_node, phi)

    def rows_of_moments(self, q):
        """See `UnitLength`: a moment does work on the small rotation of a change of q."""
        rows = np.zeros((len(q), 5, 3))
        rows[:, :4] = small_rotations(q).swapaxes(1, 2)
        return rows

    def turned_rows(self, q, moments):
        """See `UnitLength`."""
        squared = (q * q).sum(axis=1)[:, None, None]
        by_basis = np.einsum("jai,na->nij", small_rotations(np.eye(4)), moments)
        along_q = np.einsum("nai,na->ni", small_rotations(q), moments)
        turned = np.zeros((len(q), 5, 5))
        turned[:, :4, :4] = (by_basis - 2 * along_q[:, :, None] * q[:, None, :]) / squared
        return turned


MULTIPLIER = Formulation(
    "multiplier",
    default_degree=4,
    force=CARRIED,
    rigid_force=UNKNOWN,
    unit_length=ByMultiplier(),
    says="a multiplier at every node holds |q| = 1; ",
)
