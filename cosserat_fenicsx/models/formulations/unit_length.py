"""How |q| = 1 is imposed in the spatial model, and the matching virtual motions."""

import numpy as np

from cosserat_fenicsx.forms import spatial

_LAST_ROWS = np.eye(4)[None, :, 1:]


class UnitLength:
    """One equation |q|^2 = 1 per node, in the row of the scalar component of q.

    Attributes:
        unknowns: number of a node's unknowns after r and q.
        galerkin: whether virtual rotations are those of changes of q.
    """

    unknowns, galerkin = 0, False

    def __eq__(self, other):
        return type(self) is type(other)

    def __hash__(self):
        return hash(type(self))

    def tests(self, phi, phi_s, q, q_s):
        """The `VirtualMotion` of the test functions phi at q."""
        return spatial.tests_of(phi, phi_s)

    def equations(self, state, test, U_node, phi):
        """Residual terms added to eq. (1), integrated at the nodes; U_node: alias of the unknowns for that rule."""
        return spatial.unit_quaternion(state, test)

    def rows_of_moments(self, q):
        """(nodes, components after r, 3): matrices from moments at nodes with q (nodes, 4) to residual rows; only one
        where all nodes have the same."""
        return _LAST_ROWS

    def turned_rows(self, q, moments):
        """(nodes, c, c), c the components after r: derivative by q of the residual rows of moments (nodes, 3), where
        `galerkin`."""
        raise NotImplementedError


#: Eq. (1) as in the paper: small rotations are test functions.
AT_NODES = UnitLength()
