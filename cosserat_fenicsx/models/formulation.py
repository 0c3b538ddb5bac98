"""Formulations of eq. (1): how the contact force n is represented, and how |q| = 1 is imposed.

And properties of an action's virtual work, found from its UFL: what it depends on, and whether it preserves a plane.
"""

import json
from collections import namedtuple
from dataclasses import astuple, dataclass, replace
from functools import lru_cache

import numpy as np
import ufl

from cosserat_fenicsx import code_cache, compat
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.forms import determinate, equilibrium, loads as virtual_work, spatial
from cosserat_fenicsx.forms.point import Point, resultants
from cosserat_fenicsx.numerics import directors, small_rotations
from cosserat_fenicsx.scene.action import is_axial
from cosserat_fenicsx.scene.signals import at

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
OF_MOTION = _OfMotion("the internal force follows from the motion", of_motion=True, stiff=1e6, rounding=0.1)
CARRIED = _Carried("the internal force is carried at the Gauss points", carried=True, stiff=1e6)
UNKNOWN = _Unknown("a stiffness is (nearly) infinite, so the internal force is an unknown", unknown=True, stiff=1e5)
#: for the determinate models
KNOWN = _Known("the internal force follows from statics alone")


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
        """(nodes, components after r, 3) from moments at nodes to residual rows; one if all are equal."""
        return _LAST_ROWS

    def turned_rows(self, q, moments):
        """(nodes, c, c) derivative by q of residual rows of moments (nodes, 3), where `galerkin`."""
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


# Relative differences below this are rounding; number of random states that are tested.
_NOTHING, _TRIED = 1e-9, 3


@dataclass(frozen=True)
class Traits:
    """Properties of a virtual work: dead: depends on no position, rotation or velocity; known_force: its force does not
    depend on them; its moment may; rates: depends on velocities; turns: is invariant under a common rotation of data
    and state, so that a model may use components along other axes; flat: where its vectors lie in a plane (axial ones
    along the normal), so does its force (and its moment along the normal)."""

    dead: bool
    known_force: bool
    rates: bool
    turns: bool
    flat: bool


def work_of(action):
    """The virtual work of an action, a function (point, virtual motion, *data, *memory) -> UFL; or None."""
    return getattr(virtual_work, action.work) if isinstance(action.work, str) else action.work


def traits_of(action, rods):
    """The `Traits` of an action in a scene with these rods: its own, or those found from its virtual work."""
    return Traits(**action.traits) if action.traits else found_traits(action, rods)


def found_traits(action, rods):
    """The `Traits` of an action, found from its virtual work."""
    work = work_of(action)
    if work is None:
        return Traits(True, True, False, True, True)
    named = action.station.rod if action.station is not None else action.rod
    rod = named or next(rod for rod in rods if action.acts_on(rod))
    data = (*at(action, 0.0).data(rod, np.zeros(1)), *action.memory)
    return _traits(work, tuple((datum.size, is_axial(datum.unit)) for datum in data))


@lru_cache(maxsize=256)
def _resultant(work, sizes):
    """The `_Resultant` of a virtual work."""
    domain = compat.interval_domain()
    vectors = {name: ufl.Constant(domain, shape=(3,)) for name in ("r", "r_s", "theta", "rest", "r_t", "omega")}
    R, frame = (ufl.Constant(domain, shape=(3, 3)) for _ in range(2))
    rest = vectors.pop("rest")
    point = Point(R=R, rest=lambda: rest, frame=lambda: frame, **vectors)
    data = [ufl.Constant(domain, shape=(3,) if size == 3 else ()) for size in sizes]
    force, moment = resultants(lambda point, test: work(point, test, *data), point)
    return _Resultant(force, moment, {**vectors, "rest": rest, "R": R, "frame": frame}, data)


class _Resultant(namedtuple("_Resultant", "force moment symbols data")):
    """Force and moment of a virtual work, UFL (3,); {name: its Constant} of the state; Constants of the data."""

    def at(self, state, data):
        """(6,) force and moment at values of the symbols and of the data."""
        mapping = {self.symbols[name]: _nested(value) for name, value in state.items()}
        mapping |= {symbol: _nested(value) for symbol, value in zip(self.data, data, strict=True)}
        return np.array([float(a[i]((0.0,), mapping)) for a in (self.force, self.moment) for i in range(3)])


def resultant_at_rest(action, scene, t):
    """(6,) force (N) and moment (N m), inertial, of a point action at rest, at the time t (s)."""
    work, rod = work_of(action), action.station.rod
    if work is None:
        return np.zeros(6)
    s, frame = np.array([action.station.s]), rod.curve.frame(action.station.s)
    place, origin = rod.curve.position(action.station.s), scene.origin(rod)
    now = at(action, t)
    data = (*(now.refreshed(rod, s, place[None]) if now.refreshed else now.data(rod, s)), *action.memory)
    values = [datum.value - origin if datum.unit == "m from origin" else datum.value for datum in data]
    none = np.zeros(3)
    state = {"r": place - origin, "rest": place - origin, "r_s": frame[:, 2], "theta": none, "r_t": none, "omega": none,
             "R": np.eye(3), "frame": frame}  # fmt: skip
    numbers = [np.reshape(value, (-1, datum.size))[0] for value, datum in zip(values, data, strict=True)]
    found = _resultant(work, tuple(datum.size for datum in data))
    return action.amplitude * found.at(state, [a if len(a) == 3 else a[0] for a in numbers])


@lru_cache(maxsize=256)
def _traits(work, kinds):
    name = compat.name_of("traits", work, kinds)  # UFL takes up to seconds
    content = code_cache.kept(name)
    found = Traits(*json.loads(content)) if content else _traits_by_ufl(work, kinds)
    if name and not content:
        code_cache.keep(name, json.dumps(astuple(found)).encode())
    return found


def _traits_by_ufl(work, kinds):
    resultant = _resultant(work, tuple(size for size, _ in kinds))
    force, moment, symbols, _ = resultant
    state = {symbol for name, symbol in symbols.items() if name not in ("rest", "frame")}

    def found(*expressions):
        return {c for a in expressions for c in ufl.algorithms.analysis.extract_type(a, ufl.Constant)}

    rates = {symbols["r_t"], symbols["omega"]}
    turns = all(_turns(resultant, kinds, seed) for seed in range(_TRIED))
    return Traits(
        dead=state.isdisjoint(found(force, moment)),
        known_force=state.isdisjoint(found(force)),
        rates=not rates.isdisjoint(found(force, moment)),
        turns=turns,
        flat=turns and all(_stays_flat(resultant, kinds, seed) for seed in range(_TRIED)),
    )


def _stays_flat(resultant, kinds, seed):
    """Whether force and moment preserve the plane of the first two axes where a random state and data do."""
    f, m = np.split(resultant.at(*_random_values(kinds, seed, flat=True)), 2)
    return max(abs(f[2]), abs(m[0]), abs(m[1])) <= _NOTHING * max(np.abs(f).max(), np.abs(m).max(), 1.0)


def _turns(resultant, kinds, seed):
    """Whether force and moment rotate with a random state and random data."""
    state, data = _random_values(kinds, seed)
    Q = _turned_by(np.random.default_rng(seed + 7).normal(size=3))
    turned = {name: Q @ value @ Q.T if name == "R" else Q @ value for name, value in state.items()}
    found = resultant.at(turned, [Q @ value if np.ndim(value) else value for value in data])
    expected = (resultant.at(state, data).reshape(2, 3) @ Q.T).ravel()
    return np.abs(found - expected).max() <= _NOTHING * max(np.abs(expected).max(), 1.0)


def _turned_by(theta):
    """(3, 3) matrix of a rotation vector, rad."""
    angle = np.linalg.norm(theta)
    return directors(np.array([[np.cos(angle / 2), *np.sin(angle / 2) / angle * theta]]))[0]


def _random_values(kinds, seed, *, flat=False):
    """A random state {name: value} and data for a `_Resultant`; kinds: (size, whether an axial vector) of the data."""
    random = np.random.default_rng(seed)

    def vector(axial=False):
        a = random.normal(size=3)
        return a * ([0, 0, 1] if axial else [1, 1, 0]) if flat else a

    theta, t = vector(axial=True), vector()
    t, e3 = t / np.linalg.norm(t), np.array([0.0, 0.0, 1.0])
    across = np.cross(t, e3) / np.linalg.norm(np.cross(t, e3))
    state = {name: vector(axial=name == "omega") for name in ("r", "r_s", "rest", "r_t", "omega")}
    state |= {"theta": theta, "R": _turned_by(theta)}
    state["frame"] = np.column_stack([across, np.cross(t, across), t])
    return state, [vector(axial) if size == 3 else abs(random.normal()) + 0.1 for size, axial in kinds]


def _nested(value):
    return tuple(map(_nested, value)) if np.ndim(value) else float(value)
