"""Base class of equilibrium and time step problems: unknowns in PETSc vectors, constraint equations, assembly."""

import numpy as np


class Equations:
    """Vectors and matrix of a model, in the solver's unknowns (`models.numbering`).

    Args:
        model: see `models.base.RodModel` for the protocol.

    Attributes:
        x, b, A: unknowns, residual, tangent; the model's state follows x.
        ties: the `TieRows` of the constraint equations of supports and joints, or None.
        tangent: the kind of factorisation of A, see `linear.factor_tangent`.
    """

    #: the class of `ties`, called with (model, numbering)
    ties_class = None

    def __init__(self, model):
        self.model, self.numbering = model, model.numbering
        numbering = self.numbering
        self.ties = self.ties_class(model, numbering) if model.signature.connections.ties else None
        tied = self.ties.rows if self.ties else np.empty(0, dtype=np.int64)
        self.tangent = self._kind()
        self.A = numbering.matrix(model.cell_dofs, tied[tied >= 0], blocks=self.tangent == "blocks")
        self.x, self.b = numbering.vector(), numbering.vector()
        self._local = np.zeros(len(numbering.rows))
        self._state = model.state.x.array

    def _kind(self):
        """See `tangent`."""
        raise NotImplementedError

    def _assemble(self, form, vector):
        """Assemble a packed form into a solver's vector; None gives zero."""
        self._local[:] = 0.0
        if form:
            form.add_to_vector(self._local)
        self.numbering.add_up(self._local, vector)

    def set_state(self, x):
        """Copy a vector of unknowns into the model's state, ghosts included."""
        self.numbering.to_local(x, self._state)
        if self.ties:
            self.ties.see(x)

    def tie_forces(self):
        """(ties, 2, 6) force and moment, inertial, that every equation of supports and joints exerts on its two
        stations, on all ranks; zero for the ground."""
        return self.ties.forces(self.eta) if self.ties else np.empty((0, 2, 6))

    def multipliers(self):
        """Multipliers (reactions) of the constraint equations, on all ranks."""
        return self.ties.everywhere() if self.ties else np.empty(0)
