"""The spatial rung: r and q in P_p, three formulations of eq. (1), dimensionless."""

import contextlib

import numpy as np
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.base import RodModel
from cosserat_fenicsx.models.spatial_forms import compile_forms
from cosserat_fenicsx.quaternions import small_rotations


class SpatialModel(RodModel):
    """Any scene."""

    name, components, moves, turn = "spatial", 7, 3, 2.0
    variations = ((6, False),)

    def _elements(self, degree):
        if self.shape.variant == "multiplier":
            return [compat.lagrange(self.mesh, 1, 1)]
        return super()._elements(degree)

    def _compile(self, spaces):
        self.stiffness = fem.Constant(self.mesh, np.float64(1))  # of the second variation, see `stress_alone`
        return compile_forms(self, *spaces, *(self.carried or (None,)))

    def _at_rest(self):
        return np.column_stack([self.reference, np.tile([1.0, 0, 0, 0], (len(self.reference), 1))])

    def _variation_axes(self):
        return (np.eye(6),)

    def tied_motion(self, values):
        """See `RodModel`."""
        return values

    def tie_maps(self, values):
        """See `RodModel`."""
        trial, test = np.zeros((len(values), 6, 7)), np.zeros((len(values), 7, 6))
        trial[:, :3, :3] = test[:, :3, :3] = np.eye(3)
        test[:, 4:, 3:] = np.eye(3)
        trial[:, 3:, 3:] = small_rotations(values[:, 3:])
        return trial, test

    def unknowns_of(self, rq):
        """See `RodModel`."""
        return rq

    @contextlib.contextmanager
    def stress_alone(self):
        """Within it the second variation has no stiffness: what is left is that of the contact force and moment, and of the
        load."""
        self.stiffness.value = 0.0
        try:
            yield
        finally:
            self.stiffness.value = 1.0

    def shape_of(self, change):
        """(N, 3) displacements of all nodes, in the scene's order on all ranks, in a change of this rank's part of the
        solver's vector."""
        vector, local = self.numbering.vector(), np.zeros_like(self.state.x.array)
        vector.array_w[:] = change
        self.numbering.to_local(vector, local)
        return self._gather_nodes(local[self._nodal[: self._owned_nodes, :3]])

    def change_of(self, motion):
        """This rank's part of the change of the solver's vector that a vector (r, theta) of the second variation's
        numbering stands for, at the state."""
        state, nodal = self.state.x.array, self._nodal
        moved, change = np.zeros(6 * len(nodal)), np.zeros_like(state)
        self.second_variations[0].numbering.to_local(motion, moved)
        moved, q = moved.reshape(-1, 6), state[nodal[:, 3:]]
        theta = moved[:, 3:]
        change[nodal[:, :3]] = moved[:, :3]
        change[nodal[:, 3]] = -np.einsum("ij,ij->i", theta, q[:, 1:]) / 2
        change[nodal[:, 4:]] = (q[:, :1] * theta + np.cross(theta, q[:, 1:])) / 2
        vector = self.numbering.vector()
        self.numbering.from_local(change, vector)
        return vector.array_r.copy()

    def expansion(self):
        """See `RodModel`."""
        return lambda load_factors, nodal, gauss: (nodal, gauss)
