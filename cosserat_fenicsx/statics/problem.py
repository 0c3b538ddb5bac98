"""A compiled model with its PETSc matrix and vectors: made once, used for every load, step and scene of its shape."""

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx.algebra.equations import Equations
from cosserat_fenicsx.algebra.packed import Packed
from cosserat_fenicsx.algebra.tie_rows import TieRows

# Of the load factor, for derivatives by differences: the error is its square times that of prescribed rotations.
_CHANGE = 1e-4


class Problem(Equations):
    """Residual and tangent of a model as PETSc wants them, in the solver's unknowns (`models.numbering`).

    Args:
        model: see `models.base.RodModel` for the protocol.

    Attributes:
        see `Equations`.
        load_factor: what all loads and prescribed motions are multiplied by.
        load_norm: size of the dead loads at load factor 1.
    """

    ties_class = TieRows

    def __init__(self, model):
        super().__init__(model)
        self.A.setOption(PETSc.Mat.Option.SYMMETRIC, self.tangent == "symmetric")
        self._dead, *self._difference = (self.numbering.vector() for _ in range(3))
        moving = (model.state, *model.carried)
        self._residual, self._tangent = Packed(model.forms.residual, moving), Packed(model.forms.tangent, moving)
        self._loads = None if model.forms.dead is None else Packed(model.forms.dead, ())
        self._live = [function.x.array for function in model.carried]
        self.load_factor = self.load_norm = 0.0
        # Written in place: the property's setter costs as much as a residual of few elements.
        self._eta = model.load_factor.value
        self._loaded = None

    def _kind(self):
        return self.model.tangent

    def load(self, scene, layout):
        """Take the numbers of a scene; the state becomes its reference configuration.

        Returns:
            bool: False where they were the numbers at hand.
        """
        model = self.model
        anew = not self._holds(scene, layout)
        if anew:
            self._loaded = None
            model.load(scene, layout)
            self._residual.refresh()
            self._tangent.refresh()
            if self._loads:
                self._loads.refresh()
            self._assemble(self._loads, self._dead)
            self.load_norm = self._dead.norm() + model.load_norm
            self._loaded = scene, layout
        else:
            model.rest()
        self.set_load_factor(0.0)
        self.numbering.from_local(self._state, self.x)
        self.set_state(self.x)
        return anew

    def _holds(self, scene, layout):
        """Whether this very scene is loaded, on this mesh, and nothing in it is a function, or a load of a user's own, that might say
        something else now."""
        if self._loaded is None or self._loaded[0] is not scene or not all(rod.uniform for rod in scene.rods):
            return False
        if not all(type(load).__module__.startswith("cosserat_fenicsx.") for load in scene.loads):
            return False
        return all(map(np.array_equal, self._loaded[1].breaks, layout.breaks))

    def set_load_factor(self, eta):
        """Multiply all loads and prescribed motions by eta from now on."""
        self.load_factor = eta
        self._eta[...] = eta

    def numbers(self):
        """Everything that says where the problem is, to be kept: this rank's unknowns and carried fields."""
        return [self.x.array_r.copy(), *(live.copy() for live in self._live)]

    def put(self, numbers):
        """Go back to where `numbers` were taken, or to a combination of such."""
        self.x.array_w[:] = numbers[0]
        for live, values in zip(self._live, numbers[1:], strict=True):
            live[:] = values
        self.set_state(self.x)

    def begin_at(self, values, n, multipliers):
        """Start from a motion and contact force that another mesh found.

        Args:
            values, n: see `RodModel.set_motion`; multipliers: reactions of added equations.
        """
        self.model.set_motion(values, n)
        self.numbering.from_local(self._state, self.x)
        if self.ties:
            self.ties.put(self.x, multipliers)
        self.set_state(self.x)

    def function(self, snes, x, b):
        """Residual at x for SNES."""
        self.set_state(x)
        self._assemble(self._residual, b)
        b.axpy(-self.load_factor, self._dead)
        if self.ties:
            self.ties.add_residual(b, self.load_factor)

    def load_derivative(self, x):
        """d residual/d load factor at x by a central difference, exact for loads, which are affine in it; a vector that
        the next call overwrites."""
        eta = self.load_factor
        change = _CHANGE * max(1.0, abs(eta))
        for vector, ahead in zip(self._difference, (change, -change), strict=True):
            self.set_load_factor(eta + ahead)
            self.function(None, x, vector)
        self.set_load_factor(eta)
        derivative, behind = self._difference
        derivative.axpy(-1.0, behind)
        derivative.scale(0.5 / change)
        return derivative

    def jacobian(self, snes, x, A, P):
        """Tangent at the state that `function` was last called with."""
        P.zeroEntries()
        self._tangent.add_to_matrix(P)
        if self.ties:
            self.ties.add_tangent(P, self.load_factor)
        P.assemble()
