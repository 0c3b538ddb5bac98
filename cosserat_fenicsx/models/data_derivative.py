"""Derivatives of a model's equations and carried contact force by the data of a scene, by ufl.derivative; and the value
of its second variation."""

import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.compat import compiling


class DataDerivative:
    """The change of the residual, and of n, in a direction of the data: of all Functions that `RodModel.load` fills in,
    in statics; form: the compiled change of the residual at the model's state and data."""

    def __init__(self, model):
        self._model, symbols = model, model.forms.symbols
        live = (*symbols.unknowns, *model.carried)
        self._data = [f for f in symbols.balance.coefficients() if f not in live]
        self._directions = [fem.Function(f.function_space) for f in self._data]
        pairs = list(zip(self._data, self._directions, strict=True))
        with compiling():
            (self.form,) = compat.forms(model.mesh, [sum(ufl.derivative(symbols.balance, f, df) for f, df in pairs)])
            self._contact = None
            if symbols.contact is not None:
                self._moved = fem.Function(model.space)
                named = ufl.algorithms.extract_coefficients(symbols.contact)
                change = sum(ufl.derivative(symbols.contact, f, df) for f, df in pairs if f in named)
                change += ufl.derivative(symbols.contact, symbols.unknowns[0], self._moved)
                change = ufl.algorithms.expand_derivatives(change)
                (self._contact,) = compat.expressions(model.mesh, [(change, model.forms.gauss)])

    def data(self):
        """Copies of the arrays of the data, and of the state at rest, whose clamped part is data too."""
        return [*(f.x.array.copy() for f in self._data), self._model._rest_state.copy()]

    def take(self, changes):
        """Set the direction: changes of what `data` returns."""
        for df, change in zip(self._directions, changes, strict=False):
            df.x.array[:] = change

    def contact(self, moved):
        """The change of the carried n, an array like `model.carried`'s, with the model's state array (`moved`, ghosts
        and clamped nodes included); None where no n is carried."""
        if self._contact is None:
            return None
        model = self._model
        self._moved.x.array[:] = moved
        values = compat.evaluate(self._contact, model.mesh, model._local_cells)
        found = np.zeros_like(model.carried[0].x.array)
        found[model.carried_dofs] = values
        return found


class EnergyOfMotion:
    """The second variation of a `SpatialModel` along one motion, without supports and joints: a sum of squares of small
    strains, which keeps its digits where the entries of the matrix would lose them."""

    def __init__(self, model):
        (space,), (second,) = model.variation_spaces, model.forms.symbols.seconds
        self._model, self._motion = model, fem.Function(space)
        with compiling():
            (self._form,) = compat.forms(model.mesh, [ufl.action(ufl.action(second, self._motion), self._motion)])

    def along(self, motion):
        """The value at the model's state, over all ranks, along displacements and rotations (N, 6) of all nodes in the
        scene's order, inertial; all dimensionless."""
        self._motion.x.array.reshape(-1, 6)[:] = motion[self._model.slots]
        return self._model.comm.allreduce(fem.assemble_scalar(self._form))


def made_once(model, name, kind):
    """The model's attribute of this name, an object of a class that compiles forms; made when it is first needed."""
    if getattr(model, name) is None:
        setattr(model, name, kind(model))
    return getattr(model, name)
