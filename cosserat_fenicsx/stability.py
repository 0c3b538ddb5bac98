"""Stability of an equilibrium by the negative squares of the second variation in (r, theta).

The form never leaves |q| = 1, so that a stable state has none, whatever the formulation. A dead moment in space is not
conservative and makes the tangent unsymmetric; its symmetric part in the rotation variables is what is counted.
"""

from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from cosserat_fenicsx import linear
from cosserat_fenicsx.problem import clamp


class NegativeModes:
    """Counts negative squares at the model's state.

    Args:
        model: a loaded model; its `rotations` space carries the second variation.
    """

    def __init__(self, model):
        self.model = model
        self._held = fem.Function(model.rotations)
        self.K = fem_petsc.create_matrix(model.forms.second_variation)
        self.K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.pc = PETSc.PC().create(model.comm)
        linear.factor_second_variation(self.pc, self.K)

    def load(self):
        """Take the supports of the scene the model was loaded with."""
        self._supports = [clamp(self._held, self.model.fixed_rotations)]

    def count(self):
        """Number of negative squares at the model's state and load factor.

        Returns:
            int, or -1 where the second variation is singular to round-off.
        """
        self.K.zeroEntries()
        fem_petsc.assemble_matrix(self.K, self.model.forms.second_variation, bcs=self._supports)
        self.K.assemble()
        self.pc.setOperators(self.K)
        self.pc.setUp()
        negative, zero, _ = self.pc.getFactorMatrix().getInertia()
        return -1 if zero else negative
