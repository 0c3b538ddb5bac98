"""A formulation of eq. (1): the multiplier form with a penalty on |q|^2 - 1, an augmented Lagrangian."""

import ufl

from cosserat_fenicsx.models.formulation import Multiplier


class Augmented(Multiplier):
    """lambda (|q|^2 - 1) + penalty (|q|^2 - 1)^2/2 at the nodes; the penalty, in EI/L, does no work at |q| = 1."""

    name, says = "augmented", "a multiplier and a penalty at every node hold |q| = 1; "
    penalty = 10.0

    def equations(self, state, test, U_node, phi):
        q, dq = state.q_node, ufl.as_vector([phi[i] for i in range(3, 7)])
        penalty = 2 * self.penalty * (ufl.dot(q, q) - 1) * ufl.dot(q, dq)
        return super().equations(state, test, U_node, phi) + penalty
