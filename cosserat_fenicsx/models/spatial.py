"""The spatial model: r and q in P_p, dimensionless."""

import contextlib

import numpy as np
from dolfinx import fem

from cosserat_fenicsx.models.base import RodModel
from cosserat_fenicsx.models.spatial_forms import compile_forms
from cosserat_fenicsx.quaternions import small_rotations

_SAME = np.eye(3)


class SpatialModel(RodModel):
    """The model for any scene."""

    name, moves, turn = "spatial", 3, 2.0
    variations = ((6, False),)

    def __init__(self, comm, signature):
        unit_length = signature.formulation.unit_length
        self.multipliers, self.rows_turn = unit_length.unknowns, unit_length.galerkin
        self.components = 7 + self.multipliers
        super().__init__(comm, signature)

    def _compile(self, spaces):
        self.stiffness = fem.Constant(self.mesh, np.float64(1))  # of the second variation, see `stress_alone`
        return compile_forms(self, *spaces)

    def _at_rest(self):
        others = [1.0, 0, 0, 0, *self.multipliers * [0.0]]
        return np.column_stack([self.reference, np.tile(others, (len(self.reference), 1))])

    def _variation_axes(self):
        return (np.eye(6),)

    def positions(self):
        """See `RodModel`."""
        return self.state.x.array[self._nodal[:, :3]]

    def tied_motion(self, values):
        """See `RodModel`."""
        return values[:, :7]

    def tie_maps(self, values):
        """See `RodModel`."""
        size, q = self.components, values[:, 3:7]
        of_moments = self.signature.formulation.unit_length.rows_of_moments(q)
        trial, test = np.zeros((len(values), 6, size)), np.zeros((len(of_moments), size, 6))
        trial[:, :3, :3] = test[:, :3, :3] = _SAME
        test[:, 3:, 3:] = of_moments
        trial[:, 3:, 3:7] = small_rotations(q)
        return trial, test

    def turned_reactions(self, values, reactions):
        """See `RodModel`."""
        turned = self.signature.formulation.unit_length.turned_rows(values[:, 3:7], reactions[:, 3:])
        return np.pad(turned, ((0, 0), (3, 0), (3, 0)))

    def unknowns_of(self, rq):
        """See `RodModel`; multipliers start at zero, to which they converge under refinement."""
        return np.pad(rq, ((0, 0),) * (rq.ndim - 1) + ((0, self.multipliers),)) if self.multipliers else rq

    @contextlib.contextmanager
    def stress_alone(self):
        """Context in which the second variation has only the geometric stiffness of contact force, moment and loads."""
        self.stiffness.value = 0.0
        try:
            yield
        finally:
            self.stiffness.value = 1.0

    def shape_of(self, change):
        """(N, 3) displacements of all nodes, in the scene's order on all ranks, from a change of this rank's part of
        the solver's vector."""
        vector, local = self.numbering.vector(), np.zeros_like(self.state.x.array)
        vector.array_w[:] = change
        self.numbering.to_local(vector, local)
        return self._gather_nodes(local[self._nodal[: self._owned_nodes, :3]])

    def everywhere(self, motion):
        """(N, 6) a motion of all nodes in the scene's order, on all ranks, from that of this rank's free nodes, (nodes,
        6), in the order of its part of the solver's vector."""
        numbering, local = self.second_variations[0].numbering, np.zeros((len(self._nodal), 6))
        vector = numbering.vector()
        vector.array_w[:] = motion.ravel()
        numbering.to_local(vector, local.reshape(-1))
        return self._gather_nodes(local[: self._owned_nodes])

    def change_of(self, motion):
        """This rank's part of the change of the solver's vector, at the state, that corresponds to a vector (r, theta)
        in the second variation's numbering."""
        state, nodal = self.state.x.array, self._nodal
        moved, change = np.zeros(6 * len(nodal)), np.zeros_like(state)
        self.second_variations[0].numbering.to_local(motion, moved)
        moved, q = moved.reshape(-1, 6), state[nodal[:, 3:7]]
        theta = moved[:, 3:]
        change[nodal[:, :3]] = moved[:, :3]
        change[nodal[:, 3]] = -np.einsum("ij,ij->i", theta, q[:, 1:]) / 2
        change[nodal[:, 4:7]] = (q[:, :1] * theta + np.cross(theta, q[:, 1:])) / 2
        vector = self.numbering.vector()
        self.numbering.from_local(change, vector)
        return vector.array_r.copy()

    def expansion(self):
        """See `RodModel`."""
        return lambda load_factors, nodal, gauss: (nodal[..., :7], gauss)
