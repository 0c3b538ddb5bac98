"""What an equilibrium and a step in time have in common: a model's unknowns in PETSc's vectors, added equations, assembly."""

import numpy as np


class Equations:
    """Vectors and matrix of a model, in the solver's unknowns (`models.numbering`).

    Args:
        model: see `models.base.RodModel` for the protocol.

    Attributes:
        x, b, A: unknowns, residual, tangent; the model's state follows x.
        ties: rows of the equations that supports and joints add, or None.
        tangent: what factors A, see `linear.factor_tangent`.
    """

    #: what makes `ties` of (model, numbering)
    ties_class = None

    def __init__(self, model):
        self.model, self.numbering = model, model.numbering
        numbering = self.numbering
        self.ties = self.ties_class(model, numbering) if model.shape.connections.ties else None
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
        """Put a packed form, or zero for None, into a solver's vector."""
        self._local[:] = 0.0
        if form:
            form.add_to_vector(self._local)
        self.numbering.add_up(self._local, vector)

    def set_state(self, x):
        """Put a vector of unknowns into the model's state, ghosts too."""
        self.numbering.to_local(x, self._state)
        if self.ties:
            self.ties.see(x)

    def multipliers(self):
        """Reactions of the added equations, on all ranks."""
        return self.ties.everywhere() if self.ties else np.empty(0)
