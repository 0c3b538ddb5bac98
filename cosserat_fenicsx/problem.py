"""A compiled model with its PETSc matrix and vectors: made once, used for every load, step and scene of its shape."""

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from cosserat_fenicsx import compat


class Problem:
    """Residual and tangent of a model as PETSc wants them.

    Args:
        model: see `models.spatial.SpatialModel` for the protocol.

    Attributes:
        x: the solution vector; the model's state follows it.
        b, A: residual and tangent.
    """

    def __init__(self, model):
        self.model = model
        self.A = fem_petsc.create_matrix(model.forms.tangent)
        self._functions = [fem.Function(model.space) for _ in range(2)]  # own the numbers of b and of the dead loads
        self._held = fem.Function(model.space)
        self.b, self._dead = (compat.petsc_vector(function) for function in self._functions)
        self.x = self.A.createVecRight()
        self._state = compat.petsc_vector(model.state)
        self._parallel = model.comm.size > 1
        self.load_factor = self.load_norm = 0.0

    def load(self, scene, layout):
        """Take the numbers of a scene; the state becomes its reference configuration."""
        model = self.model
        model.load(scene, layout)
        self._supports = [clamp(self._held, model.fixed)]
        self._fixed_owned = model.fixed[model.fixed < model.owned]
        self._dead.set(0.0)
        if model.forms.dead is not None:
            self._assemble(model.forms.dead, self._dead)
        self._dead.array_w[self._fixed_owned] = 0.0
        self.load_norm = self._dead.norm()
        self.set_load_factor(0.0)
        self.x.array_w[:] = model.state.x.array[: model.owned]

    def set_load_factor(self, eta):
        """Multiply all loads by eta from now on."""
        self.load_factor = eta
        self.model.load_factor.value = eta

    def _assemble(self, form, vector):
        if self._parallel:
            with vector.localForm() as numbers:
                numbers.set(0.0)
        else:
            vector.set(0.0)
        fem_petsc.assemble_vector(vector, form)
        if self._parallel:
            vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)

    def set_state(self, x):
        """Put a PETSc vector into the model's state, ghosts too."""
        x.copy(self._state)
        if self._parallel:
            self._state.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)

    def function(self, snes, x, b):
        """Residual at x for SNES; the supports' rows are zero because every guess satisfies them."""
        self.set_state(x)
        self._assemble(self.model.forms.residual, b)
        b.axpy(-self.load_factor, self._dead)
        b.array_w[self._fixed_owned] = 0.0

    def jacobian(self, snes, x, A, P):
        """Tangent at the state that `function` was last called with."""
        P.zeroEntries()
        fem_petsc.assemble_matrix(P, self.model.forms.tangent, bcs=self._supports)
        P.assemble()


def clamp(function, dofs):
    """A homogeneous support on whole nodes of a function's space, given by their single unknowns."""
    block = function.function_space.dofmap.index_map_bs
    return fem.dirichletbc(function, np.unique(dofs // block).astype(np.int32))
