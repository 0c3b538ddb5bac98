"""Formulations of eq. (1): how the contact force n is represented, and how |q| = 1 is imposed."""

from collections import namedtuple
from dataclasses import dataclass, replace

import numpy as np

from cosserat_fenicsx import compat
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.forms import determinate, equilibrium, spatial
from cosserat_fenicsx.numerics import small_rotations

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
            derivative: differentiates a form or expression in the direction of the trial function.
            along_step: differentiates an expression at `before` along the step.
        """
        internal = self.internal(n, phi_n, motion, section, test, ds)
        return WeakForm(n, internal, derivative(internal), None)

    def internal(self, n, phi_n, motion, section, test, ds):
        """The left side of eq. (1), arguments as in `weak_form`."""
        return equilibrium.displacement(motion, section, test, ds)

    def second_variation(self, n, motion, data, section, test, direction, stiffness):
        """The density of the second variation, see `equilibrium.second_variation`; data: the `RodFields`."""
        stiff = section._replace(law=data.stiff_law(n))
        return equilibrium.second_variation(n, motion, stiff, test, direction, stiffness)


class _OfMotion(ContactForce):
    def weak_form(self, n, phi_n, motion, before, section, *others):
        found = super().weak_form(n, phi_n, motion, before, section, *others)
        return found._replace(n=equilibrium.contact(motion, section)[0])


class _Carried(ContactForce):
    def symbols(self, model, U, phi):
        (n,) = model.carried
        return [n[i] for i in range(model.force_size)], None

    def put(self, model, n):
        model.rods.fill(model.carried[0], n)

    def weak_form(self, n, phi_n, motion, before, section, test, ds, derivative, along_step):
        """See `ContactForce`: the residual uses n by the law; the carried n_k enters only the tangent."""
        internal = self.internal(n, phi_n, motion, section, test, ds)
        tangent = equilibrium.carried_force_tangent(n, motion, section, test, ds, derivative)
        return WeakForm(n, internal, tangent, equilibrium.carried_force_update(n, before, section, along_step))


class _Unknown(ContactForce):
    def symbols(self, model, U, phi):
        """See `ContactForce`: the components of n follow the nodal unknowns."""
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

    def internal(self, n, phi_n, motion, section, test, ds):
        return equilibrium.mixed(n, motion, section, test, phi_n, ds)


class _Known(ContactForce):
    def symbols(self, model, U, phi):
        return model.known_force(), None

    def internal(self, n, phi_n, motion, section, test, ds):
        return determinate.moments(n, motion, section, test, ds)

    def second_variation(self, n, motion, data, section, test, direction, stiffness):
        """See `ContactForce`: of the energy minimised over r."""
        return determinate.second_variation(n, motion, section, test, direction)


#: n by the law: on slender rods the rounding error of the residual then affects the solution.
OF_MOTION = _OfMotion("the contact force follows from the motion", of_motion=True, stiff=1e6, rounding=0.1)
CARRIED = _Carried("the contact force is carried at the Gauss points", carried=True, stiff=1e6)
UNKNOWN = _Unknown("a stiffness is infinite or next to it, so the contact force is an unknown", unknown=True, stiff=1e5)
#: for the determinate models
KNOWN = _Known("the contact force follows from statics alone")


# From a moment to the residual rows of q, the rows of its vector part.
_LAST_ROWS = np.eye(4)[None, :, 1:]


@dataclass(frozen=True)
class Formulation:
    """A formulation of eq. (1): how the contact force n is represented and |q| = 1 imposed.

    Here one equation |q|^2 = 1 per node stands in the row of the scalar component of q, and virtual rotations are small
    rotations, as in the paper. A subclass with a `name` of its own is a new formulation that `solve` and scene files
    take by that name; other code uses these attributes and methods, and never tests the name.

    Args:
        force: the representation of n.

    Attributes:
        name: as `solve` takes it.
        default_degree: polynomial degree of r and q.
        rigid_force: the representation of n where a stiffness is infinite, or so large that rounding requires it; None
            if not supported.
        models: names of the models that have it.
        advice: what else to try if it does not converge.
        says: text for `Path.why` in front of how n is represented.
        multipliers: number of a node's unknowns after r and q in the spatial model.
        galerkin: whether virtual rotations follow from changes of q.
    """

    force: ContactForce = CARRIED

    name, default_degree, rigid_force, models = "", 4, UNKNOWN, ("spatial",)
    advice, says = "the formulation 'mixed'", ""
    multipliers, galerkin = 0, False

    def __init_subclass__(cls, **options):
        super().__init_subclass__(**options)
        if "name" in vars(cls):
            FORMULATIONS[cls.name] = cls

    def for_stiffness(self, infinite, rounding):
        """The formulation for a mesh.

        Args:
            infinite: whether a stiffness is infinite.
            rounding: rounding error of the tangent's largest entries over the bending stiffness.

        Raises:
            SceneError: an infinite stiffness where there is no `rigid_force`.
        """
        if infinite and self.rigid_force is None:
            raise SceneError(
                f"formulation = '{self.name}' cannot take an infinite stiffness: expected 'mixed', "
                "which carries the contact force as an unknown"
            )
        return replace(self, force=self.rigid_force) if self.rigid_force and (infinite or rounding > 1.0) else self

    @property
    def words(self):
        """How n is represented and |q| = 1 imposed, as text."""
        return f"{self.says}{self.force.words} (formulation '{self.name}')"

    def tests(self, phi, phi_s, q, q_s):
        """The `VirtualMotion` of the test functions phi at q, UFL."""
        return spatial.tests_of(phi, phi_s)

    def equations(self, state, test, U_node, phi):
        """Residual terms added to eq. (1), integrated at the nodes, UFL.

        Args:
            state: the `spatial.State`; test: what `tests` returns.
            U_node, phi: the unknowns of a node (for the rule at the nodes) and their test functions: r, q, multipliers.
        """
        return spatial.unit_quaternion(state, test)

    def rows_of_moments(self, q):
        """(nodes, components after r, 3): matrices from moments at nodes with q (nodes, 4) to residual rows; only one
        where all nodes have the same."""
        return _LAST_ROWS

    def turned_rows(self, q, moments):
        """(nodes, c, c), c the components after r: derivative by q of the residual rows of moments (nodes, 3), where
        `galerkin`."""
        raise NotImplementedError


#: The classes of formulations by name; a subclass of `Formulation` enters itself.
FORMULATIONS = {}


class Mixed(Formulation):
    """Eq. (1) as in the paper, with n carried at the Gauss points."""

    name, models, advice = "mixed", ("determinate", "planar", "spatial"), "a larger tol"


@dataclass(frozen=True)
class Displacement(Formulation):
    """Eq. (1) with n by the law, the motion being the only unknown."""

    force: ContactForce = OF_MOTION

    name, default_degree, rigid_force = "displacement", 2, None


class Multiplier(Formulation):
    """lambda is the unknown after r and q; virtual rotations follow from changes of q."""

    name, says = "multiplier", "a multiplier at every node holds |q| = 1; "
    multipliers, galerkin = 1, True

    def tests(self, phi, phi_s, q, q_s):
        return spatial.variations_of(phi, phi_s, q, q_s)

    def equations(self, state, test, U_node, phi):
        return spatial.multiplier(U_node[7], phi[7], state.q_node, phi)

    def rows_of_moments(self, q):
        # a moment does work on the small rotation of a change of q
        rows = np.zeros((len(q), 4 + self.multipliers, 3))
        rows[:, :4] = small_rotations(q).swapaxes(1, 2)
        return rows

    def turned_rows(self, q, moments):
        squared = (q * q).sum(axis=1)[:, None, None]
        by_basis = np.einsum("jai,na->nij", small_rotations(np.eye(4)), moments)
        along_q = np.einsum("nai,na->ni", small_rotations(q), moments)
        turned = np.zeros((len(q), 4 + self.multipliers, 4 + self.multipliers))
        turned[:, :4, :4] = (by_basis - 2 * along_q[:, :, None] * q[:, None, :]) / squared
        return turned


def formulation_of(given=None):
    """A `Formulation`, the default for None, of a name (a SceneError for an unknown one), a subclass or an object."""
    if isinstance(given, Formulation):
        return given
    if isinstance(given, type) and issubclass(given, Formulation):
        return given()
    name = Mixed.name if given is None else given
    if not isinstance(name, str) or name not in FORMULATIONS:
        raise SceneError(f"formulation = {name!r}: {nearest(name, FORMULATIONS)}")
    return FORMULATIONS[name]()
