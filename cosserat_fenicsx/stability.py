"""Stability of an equilibrium by the negative squares of the second variation in (r, theta).

The form never leaves |q| = 1, so that a stable state has none, whatever the formulation. A dead moment in space is not
conservative and makes the tangent unsymmetric; its symmetric part in the rotation variables is what is counted.
"""

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx import linear
from cosserat_fenicsx.packed import Packed


class NegativeModes:
    """Counts negative squares at a problem's state.

    Args:
        problem: a `Problem`; its model carries the second variation and the numbering of its own.
    """

    def __init__(self, problem):
        self.problem, self.model = problem, problem.model
        numbering = self.model.variation_numbering
        self._tied = self.model.rows_of_tied(numbering) if problem.ties else np.empty((0, 6), dtype=np.int64)
        self.K = numbering.matrix(self.model.variation_cell_dofs, self._tied[self._tied >= 0])
        self.K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._form = Packed(self.model.forms.second_variation, (self.model.state, *self.model.carried))
        self.pc = PETSc.PC().create(self.model.comm)
        linear.factor_second_variation(self.pc, self.K)

    def load(self):
        """Take the numbers of the scene that the model was loaded with."""
        self._form.refresh()

    def assemble(self):
        """The second variation at the problem's state and load factor, in K."""
        problem = self.problem
        self.K.zeroEntries()
        self._form.add_to_matrix(self.K)
        if problem.ties:
            problem.ties.add_second_variation(self.K, self._tied, problem.load_factor)
        self.K.assemble()

    def count(self):
        """Number of negative squares at the problem's state and load factor.

        Returns:
            int, or -1 where the second variation is singular to round-off.
        """
        self.assemble()
        self.pc.setOperators(self.K)
        self.pc.setUp()
        negative, zero, _ = self.pc.getFactorMatrix().getInertia()
        return -1 if zero else negative
