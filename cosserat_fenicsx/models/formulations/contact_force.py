"""Representations of the contact force n of eq. (1): by the motion, by Gauss-point values, by unknowns, by statics."""

from collections import namedtuple
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium

#: The contact force that goes into fields and the second variation, the left side of eq. (1), its tangent, and the next
#: carried n or None.
WeakForm = namedtuple("WeakForm", "n internal tangent advance")


@dataclass(frozen=True)
class ContactForce:
    """A representation of n.

    Attributes:
        words: the same as text.
        carried: whether n at the Gauss points is stored separately from the unknowns and updated in every Newton step.
        unknown: whether n is a field of unknowns.
        of_motion: whether n is a function of the motion alone.
        stiff: bound on K in the second variation, in EI/L^2 of the rod (`rod_data.bounded`).
        rounding: the error of positions over `RodModel.round_off`.
    """

    words: str
    carried: bool = False
    unknown: bool = False
    of_motion: bool = False
    stiff: float = np.inf
    rounding: float = 0.0

    def elements(self, mesh, degree, size):
        """Finite elements in addition to the nodal one; `size`: components of n."""
        return [compat.lagrange(mesh, degree - 1, size, discontinuous=True)] if self.unknown else []

    def symbols(self, model, U, phi):
        """Components of n and of its test function in the unknowns or among the carried Functions, or None."""
        return None, None

    def put(self, model, n):
        """Take n at the Gauss points, (elements, points, force_size), the scene's order, along the model's axes."""

    def weak_form(self, n, phi_n, motion, before, section, test, ds, derivative, along_step):
        """The `WeakForm` of eq. (1).

        Args:
            n, phi_n: see `symbols`, as vectors of three components.
            motion, before: the `equilibrium.Motion`, now and before the step.
            section, test, ds: see forms/equilibrium.py.
            derivative: that of a form or expression in the direction of the trial function.
            along_step: that of an expression at `before` along the step.
        """
        raise NotImplementedError


class _OfMotion(ContactForce):
    def weak_form(self, n, phi_n, motion, before, section, test, ds, derivative, along_step):
        """See `ContactForce`."""
        internal = equilibrium.displacement(motion, section, test, ds)
        n, _ = equilibrium.contact(motion, section)
        return WeakForm(n, internal, derivative(internal), None)


class _Carried(ContactForce):
    def symbols(self, model, U, phi):
        """See `ContactForce`."""
        (n,) = model.carried
        return [n[i] for i in range(model.force_size)], None

    def put(self, model, n):
        """See `ContactForce`."""
        model.rods.fill(model.carried[0], n)

    def weak_form(self, n, phi_n, motion, before, section, test, ds, derivative, along_step):
        """See `ContactForce`: the residual uses n by the law; the carried n_k enters only the tangent."""
        internal = equilibrium.displacement(motion, section, test, ds)
        tangent = equilibrium.carried_force_tangent(n, motion, section, test, ds, derivative)
        return WeakForm(n, internal, tangent, equilibrium.carried_force_update(n, before, section, along_step))


class _Unknown(ContactForce):
    def symbols(self, model, U, phi):
        """See `ContactForce`: the components of n come after those of the nodal unknowns."""
        places = range(model.components, model.components + model.force_size)
        return [U[i] for i in places], [phi[i] for i in places]

    def put(self, model, n):
        """See `ContactForce`: the polynomial through the Gauss points."""
        p, x, rods = model.signature.degree, model.force_nodes, model.rods
        dofs = compat.cell_nodes(model.space)[:, model.components * (p + 1) :]
        for reverse in (False, True):
            cells = np.flatnonzero(rods.reversed == reverse)
            along = model.rule.between_gauss(1 - x if reverse else x)
            values = np.einsum("jg,cgi->cji", along, n[rods.cells[cells]])
            model.state.x.array[dofs[cells]] = values.reshape(len(cells), model.force_size * p)

    def weak_form(self, n, phi_n, motion, before, section, test, ds, derivative, along_step):
        """See `ContactForce`."""
        internal = equilibrium.mixed(n, motion, section, test, phi_n, ds)
        return WeakForm(n, internal, derivative(internal), None)


#: n by the law: on slender rods the rounding error of the residual then affects the solution.
OF_MOTION = _OfMotion("the contact force is that of the motion", of_motion=True, stiff=1e6, rounding=0.1)
CARRIED = _Carried("the contact force is carried at the Gauss points", carried=True, stiff=1e6)
UNKNOWN = _Unknown("a stiffness is infinite or next to it, so the contact force is an unknown", unknown=True, stiff=1e5)
#: for the determinate models, which have separate forms
KNOWN = ContactForce("the contact force follows from statics alone")
