"""Compilation shared by all models: measures, actions, and forms, all of whose signatures are computed first; and
derivatives of their equations by the data of a scene.

FFCx 0.5 modifies the metadata of the integrals that it compiles, which other forms share; a signature computed after
that would differ and miss the code cache, which costs a second.
"""

import pickle
from collections import defaultdict, namedtuple
from dataclasses import dataclass, fields, replace
from functools import partial

import basix
import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import code_cache, compat
from cosserat_fenicsx.compat import compiling
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms.equilibrium import VirtualMotion
from cosserat_fenicsx.forms.loads import thread_stretch
from cosserat_fenicsx.forms.point import NONE, resultants, variation
from cosserat_fenicsx.numerics import lobatto_weights


#: Integrals over the rods with Gauss points, with the nodes of P_p, and with the two ends of every element as points.
Measures = namedtuple("Measures", "gauss nodes ends")
#: Virtual work of the actions: {number of the term: its form}, of the dead ones per unit of the load factor and of the
#: permanent factor; and a list of `Live` for the others.
ActionWork = namedtuple("ActionWork", "dead permanent live")
#: Virtual work that depends on the state: the number of its term, its form, its factor (UFL), its measure, its point,
#: and its integrand, a function (point, test).
Live = namedtuple("Live", "number form factor measure point work")

#: UFL for derivatives by data: the residual with all loads and their factors; n by the law, where
#: n is carried, or None; the Functions of the unknowns; and the second variations.
Symbols = namedtuple("Symbols", "balance contact unknowns seconds")


@dataclass(frozen=True)
class CompiledForms:
    """What a solver assembles and evaluates. A tuple of forms or expressions stands for their sum: each kind of action
    has a part of its own, so that scenes with different actions share the rest.

    Attributes:
        residual, tangent: of the unknowns, live loads included; tuples.
        dead, permanent: virtual work of what does not depend on the motion, per unit of load factor and of the
            permanent factor; tuples, empty where there is none.
        second_variations: forms in small displacements and rotations, tuples; stable if the symmetric part of none has
            negative eigenvalues.
        fields, fields_size: the components of n, m and r' at the Gauss points, and their number; None and 0 without.
        advance: the next carried n at the Gauss points; or None.
        force, permanent_force: virtual work of the dead forces on displacements, for the determinate models; tuples.
        density, node_density: force and moment per length of the distributed actions, at the Gauss points and at the
            nodes, (6,), components along the model's axes; tuples.
        gauss, weights: points in [0, 1] of one element, and their weights.
        symbols: the `Symbols`, or None; see `symbols_of`.
    """

    gauss: np.ndarray
    weights: np.ndarray
    residual: tuple = ()
    tangent: tuple = ()
    dead: tuple = ()
    permanent: tuple = ()
    second_variations: tuple = ()
    fields: object = None
    fields_size: int = 0
    advance: object = None
    force: tuple = ()
    permanent_force: tuple = ()
    density: tuple = ()
    node_density: tuple = ()
    symbols: Symbols | None = None


def along(w):
    """w', because the coordinate of the mesh is arc length."""
    return w.dx(0)


# The `Pattern`s of this process by what they depend on, None for kinds that have none; and the most of them.
_PATTERNS, _MOST_PATTERNS = {}, 256


def shared(model, spaces, by_ufl):
    """The `CompiledForms` that `by_ufl()` compiles from a model's mesh, data and terms of the actions; spaces: of all
    their arguments. On one process, models that differ in their meshes alone share the work of UFL."""
    signature = model.signature
    kind = (
        type(model),
        replace(signature, counts=(), connections=None, slender=False),
        bool(signature.connections.clamped),
    )
    serial = model.comm.size == 1
    if serial and kind not in _PATTERNS and (stored := Pattern.stored(kind)):
        _keep(kind, stored)
    pattern = _PATTERNS.get(kind) if serial else None
    if pattern is not None:
        return pattern.on(model, spaces)
    before, model.given = {*vars(model), "given"}, {}
    found = by_ufl()
    compile_evolutions(model)
    if serial and kind not in _PATTERNS:
        pattern = Pattern.of(model, spaces, found) if before == set(vars(model)) else None
        _keep(kind, pattern)
        if pattern is not None:
            pattern.store(kind)
    del model.given
    return found


def _keep(kind, pattern):
    while len(_PATTERNS) >= _MOST_PATTERNS:
        _PATTERNS.pop(next(iter(_PATTERNS)), None)  # another thread may have done it
    _PATTERNS[kind] = pattern


def compile_static(model, spaces):
    """The `CompiledForms` of a model in statics, from its UFL of its unknowns; spaces: of the second variations."""
    return shared(model, [model.space, *spaces, model.displacements], partial(_compile_static, model, spaces))


class Pattern(namedtuple("Pattern", "made_on_demand kind numbers evolutions leaves")):
    """`CompiledForms` without a mesh: names of what each term made at the first call, class, attributes and each term's
    evolution with the positions of forms and Expressions, and the code and the places of each of these: numbers of
    spaces, and of what `_held` tells; of the alias of a Function there, its number and that of all.
    """

    @classmethod
    def of(cls, model, spaces, forms):
        """The pattern of a model's forms, None where a part is unknown."""
        held, leaves, given = _held(model), [], model.given

        def place(x):
            if (found := next((i for i, y in enumerate(held) if x is y), None)) is None and isinstance(x, fem.Function):
                vectors = (y.x if isinstance(y, fem.Function) else None for y in held)
                found = next((len(held) + i for i, y in enumerate(vectors) if x.x is y), None)  # see `compat.alias`
            return found

        def without_mesh(value):
            if isinstance(value, tuple):
                return tuple(map(without_mesh, value))
            if id(value) not in given:
                return value
            if (pieces := compat.pieces(given[id(value)], value)) is None:
                leaves.append((None, [None]))  # unknown
            else:
                code, arguments, *others = pieces
                places = [next((i for i, y in enumerate(spaces) if x is y), None) for x in arguments]
                leaves.append((code, places, *([place(x) for x in part] for part in others)))
            return _Leaf(len(leaves) - 1)

        numbers = {field.name: without_mesh(getattr(forms, field.name)) for field in fields(forms)}
        evolutions = [without_mesh(term.compiled_evolution) for term in model.actions.terms]
        if any(None in part for _, *parts in leaves for part in parts):
            return None
        on_demand = [[name for name in ("rest", "frame") if getattr(term, f"_{name}")] for term in model.actions.terms]
        return cls(on_demand, type(forms), numbers | {"symbols": None}, evolutions, leaves)

    def on(self, model, spaces):
        """The `CompiledForms` of another model of this kind, without `Symbols`."""
        for term, names in zip(model.actions.terms, self.made_on_demand, strict=True):
            for name in names:
                getattr(term, name)()
        held = dict(enumerate(_held(model)))
        of_all = len(held)
        for i in {i for _, _, functions, _ in self.leaves for i in functions if i >= of_all}:
            held[i] = compat.alias(held[i - of_all])
        made = [compat.from_pieces(code, model.mesh, [spaces[i] for i in places],
                                   *([held[i] for i in part] for part in parts))
                for code, places, *parts in self.leaves]  # fmt: skip

        def with_mesh(value):
            if isinstance(value, _Leaf):
                return made[value.number]
            return tuple(map(with_mesh, value)) if isinstance(value, tuple) else value

        for term, evolution in zip(model.actions.terms, self.evolutions, strict=True):
            term.compiled_evolution = with_mesh(evolution)
        return self.kind(**{name: with_mesh(value) for name, value in self.numbers.items()})

    def store(self, kind):
        """Keep the pattern of a kind for other processes, beside its code; not what classes of others take part in."""
        if (name := compat.name_of("pattern", kind)) and compat.name_of("pattern", self.kind):
            leaves = [(compat.to_names(code), *places) for code, *places in self.leaves]
            code_cache.keep(name, pickle.dumps(tuple(self._replace(leaves=leaves))))

    @classmethod
    def stored(cls, kind):
        """The pattern of a kind that another process has kept, or None."""
        content = code_cache.kept(compat.name_of("pattern", kind))
        if not content:
            return None
        pattern = cls(*pickle.loads(content))  # no less safe than the compiled code: the folder is the user's own
        try:
            return pattern._replace(leaves=[(compat.from_names(*code), *places) for code, *places in pattern.leaves])
        except LookupError:  # somebody has removed the code
            return None


@dataclass(frozen=True)
class _Leaf:
    number: int


def _held(model):
    """The Functions and Constants of a model and of its terms, in the order of their attributes."""
    values = [value for owner in (model, *model.actions.terms) for value in vars(owner).values()]
    every = [x for value in values for x in (value if isinstance(value, tuple | list) else [value])]
    return [x for x in every if isinstance(x, fem.Function | fem.Constant)]


def together(model, forms, expressions):
    """See `compat.together`, on the mesh of a model, which notes {id of a compiled form or Expression: its UFL} where
    `shared` asks for it."""
    made = compat.together(model.mesh, forms, expressions)
    if model.given is not None:
        every = zip([*forms, *(a for a, _ in expressions)], [*made[0], *made[1]], strict=True)
        model.given |= {id(found): a for a, found in every if found is not None}
    return made


def compile_evolutions(model):
    """Compile the updates of memory that forms of a model have named."""
    _, updates = together(model, [], [term.evolution(point) for term, point in model.evolving])
    for (term, _), compiled in zip(model.evolving, updates, strict=True):
        term.compiled_evolution = compiled
    model.evolving = []


def symbols_of(model):
    """The `Symbols` of a model in statics; forms that were made by a `Pattern` are made anew, by UFL."""
    if model.forms.symbols is None:
        with compiling():
            model.forms = replace(model.forms, symbols=_compile_static(model, model.variation_spaces).symbols)
    return model.forms.symbols


def _compile_static(model, spaces):
    """`compile_static` by UFL."""
    force, data, dx = model.signature.formulation.force, model.data, measures(model)
    U, U_node = model.state, compat.alias(model.state)

    def ds(a):
        return a * dx.gauss

    section, motion = section_of(model), model.motion_of(U, U_node)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test, derivative = model.tests_of(phi, motion), derivative_in(trial, U, U_node)
    n, phi_n = (None if a is None else model.vector(a) for a in force.symbols(model, U, phi))
    along_step = partial(ufl.derivative, coefficient=model.before, argument=model.step)
    before = model.motion_of(model.before, model.before)
    n, residual, tangent, advance = force.weak_form(n, phi_n, motion, before, section, test, ds, derivative, along_step)
    held = model.constraint(motion, test, U_node, phi)
    if held is not None:
        residual, tangent = residual + held * dx.nodes, tangent + derivative(held * dx.nodes)

    def at(place):
        return U if place == "line" else U_node

    def point_at(place, rest, frame):
        return model.point_of(at(place), rest=rest, frame=frame)

    def test_at(place):
        return model.tests_of(phi, model.motion_of(at(place), U_node))

    acting = action_work(model, dx, test, point_at, (U, U_node), test_at=test_at)
    forces = ActionWork({}, {}, [])
    if model.displacements is not None:
        forces = action_work(model, dx, VirtualMotion(ufl.TestFunction(model.displacements), NONE), point_at, ())

    seconds, variations = [], []  # in small displacements and rotations, which satisfy |q| = 1 by construction
    for space, (_, _, small_motion) in zip(spaces, model.variations, strict=True):
        if small_motion is None:
            second, pair = tangent, None
        else:
            pair = small_motion(ufl.TestFunction(space)), small_motion(ufl.TrialFunction(space))
            second = ds(force.second_variation(n, motion, data, section, *pair, model.stiffness))
        seconds.append(second)
        variations.append(pair)
    strains = model.fields_of(n, equilibrium.contact_moment(n, motion, section), motion.r_s)
    contact = model.components_of(equilibrium.contact(motion, section)[0]) if model.carried else None
    lives = {live.number: live_parts(live, derivative, variations) for live in acting.live}
    found = compile_parts(
        model, {"residual": residual, "tangent": tangent, **dict(enumerate(seconds))}, lives, strains,
        advance=None if advance is None else model.components_of(advance), densities=action_densities(model, point_at),
        dead=acting.dead, permanent=acting.permanent, force=forces.dead, permanent_force=forces.permanent,
    )  # fmt: skip
    for parts in lives.values():
        residual += parts["residual"]
        seconds = [a if parts[i] is None else a + parts[i] for i, a in enumerate(seconds)]
    return CompiledForms(**found, symbols=Symbols(_balance(model, residual, acting), contact, (U, U_node), seconds))


def compile_parts(model, core, terms, fields, *, advance=None, densities=None, **works):
    """Compile UFL: one module for the model without actions (core: {name: form}), and one for each term of the actions
    (terms: {its number: {name: form}}; works: for a name {its number: form}). Names are attributes of `CompiledForms`
    or of a subclass, or the numbers of second variations; forms may be None. densities: see `action_densities`.
    Returns these attributes, symbols excepted; tuples of all forms of a name."""
    densities = densities or {}
    points, weights = basix.make_quadrature(basix.CellType.interval, 2 * model.signature.points - 1)
    places = {"line": points, "node": model.nodes}
    groups = [(core, [(fields, points), (advance, points)])]
    numbers = sorted({*terms, *densities, *(number for forms in works.values() for number in forms)})
    for number in numbers:
        parts = terms.get(number, {}) | {name: forms.get(number) for name, forms in works.items()}
        place, density = densities.get(number, ("line", None))
        groups.append((parts, [(density, places[place])]))
    for form in (form for parts, _ in groups for form in parts.values()):
        if form is not None:
            form.signature()
    compiled = [together(model, list(parts.values()), expressions) for parts, expressions in groups]
    found = defaultdict(tuple)
    for (parts, _), (forms, _) in zip(groups, compiled, strict=True):
        for name, form in zip(parts, forms, strict=True):
            found[name] += (form,) if form else ()
    for number, (_, (density,)) in zip(numbers, compiled[1:], strict=True):
        name = "density" if densities.get(number, ("line",))[0] == "line" else "node_density"
        found[name] += (density,) if density else ()
    seconds = tuple(found.pop(name) for name in core if isinstance(name, int))
    _, (fields_there, advance_there) = compiled[0]
    return dict(
        found, gauss=points[:, 0], weights=weights, second_variations=seconds, fields=fields_there,
        fields_size=0 if fields is None else len(fields), advance=advance_there,
    )  # fmt: skip


def live_parts(live, derivative, variations=()):
    """Contributions of a `Live` to residual, tangent and second variations (by number): {name: UFL form or None};
    variations: pairs of test and trial `VirtualMotion`, None for the tangent."""
    tangent = nonzero(derivative(live.form))
    parts = {"residual": -live.factor * live.form, "tangent": None if tangent is None else -live.factor * tangent}
    for i, pair in enumerate(variations):
        second = parts["tangent"]
        if pair is not None:
            change = variation(live.work, live.point, *pair)
            second = None if _is_zero(change) else nonzero(-live.factor * change * live.measure)
        parts[i] = second
    return parts


def nonzero(form):
    """A UFL form; None where it is zero, such as the derivative of an action that only remembers the motion."""
    if not isinstance(form, ufl.Form) or ufl.algorithms.expand_derivatives(form).empty():
        return None
    return form


def _is_zero(a):
    return isinstance(a, ufl.constantvalue.Zero) or (isinstance(a, int) and a == 0)


def _balance(model, residual, acting):
    for factor, forms in ((model.load_factor, acting.dead), (model.permanent_factor, acting.permanent)):
        for form in forms.values():
            residual = residual - factor * form
    return residual


def measures(model):
    """The `Measures` of a model."""
    nodes = model.nodes
    weights = lobatto_weights(nodes)
    gauss = ufl.dx(domain=model.mesh, metadata={"quadrature_degree": 2 * model.signature.points - 1})
    ends = np.array([0.0, 1.0]), np.array([0.5, 0.5])
    return Measures(gauss, _rule(model.mesh, nodes, weights), _rule(model.mesh, *ends))


def _rule(mesh, points, weights):
    # Tuples because UFL rejects arrays; from 1 down to 0 because FFCx names a rule by three hexadecimal digits of a
    # hash of its points, in which ascending Gauss and Lobatto points of P4 collide.
    return ufl.dx(
        domain=mesh,
        metadata={
            "quadrature_rule": "custom",
            "quadrature_degree": max(1, 2 * len(points) - 3),
            "quadrature_points": tuple((float(x),) for x in points[::-1]),
            "quadrature_weights": tuple(float(w) for w in weights[::-1]),
        },
    )


def section_of(model):
    """The `equilibrium.Section` of a model, with the actions in its law (`Action.in_law`)."""
    section = model.cross_section()
    for _, term, factor in _terms(model, in_law=True):
        k, e = (section.R_R.T * (factor * a) for a in term.data)
        section = section._replace(v_0=section.v_0 + e, k_0=k if section.k_0 is None else section.k_0 + k)
    return section


def _terms(model, *, in_law):
    """(number, `Term`, its factor, UFL) of the actions in a model's law, or of all others."""
    factors = {"load": model.load_factor, "permanent": model.permanent_factor, "full": 1}
    for number, term in enumerate(model.actions.terms):
        if (term.kind.place == "law") == in_law:
            yield number, term, factors[term.kind.scaled]


def acting_at(model, point_at):
    """(number, `Term`, its factor, UFL, and `Point`) of all actions with virtual work; point_at: see `action_work`."""
    for number, term, factor in _terms(model, in_law=False):
        yield number, term, factor, point_at(term.kind.place, term.rest, term.frame)


def action_work(model, dx, test, point_at, unknowns, accepted_at=None, test_at=None):
    """The `ActionWork` of a model's actions, by the `Measures` dx and a `VirtualMotion`; point_at: function (place of a
    `TermKind`, rest, frame) -> the `Point` there; unknowns: Functions; an action whose form contains one of them
    depends on the state; accepted_at: as `point_at`, for the update of memory at an accepted state; test_at: function
    place -> the `VirtualMotion` there; given where test functions depend on the state."""
    dead, live = {"load": {}, "permanent": {}}, []
    for number, term, factor, point in acting_at(model, point_at):
        kind = term.kind
        measure = {"point": dx.ends, "line": dx.gauss, "node": dx.nodes}[kind.place]
        integrand = term.work(point, test_at(kind.place) if test_at else test)
        if isinstance(integrand, ufl.constantvalue.Zero):
            continue  # such as a force in a determinate model, or a dashpot in statics
        form = integrand * measure
        if set(unknowns) & set(form.coefficients()) or kind.memory or kind.refreshed:
            live.append(Live(number, form, factor, measure, point, term.work))
        else:
            dead["load" if kind.scaled == "load" else "permanent"][number] = form
        if kind.memory and term not in (known for known, _ in model.evolving):
            model.evolving.append((term, (accepted_at or point_at)(kind.place, term.rest, term.frame)))
    return ActionWork(*dead.values(), live)


def action_densities(model, point_at):
    """Force and moment per length of the distributed actions, threads excepted: {number of the term: (place, UFL
    (6,))}, place "line" (Gauss points) or "node" (for actions integrated there)."""
    found = {}
    for number, term, factor, point in acting_at(model, point_at):
        place = term.kind.place
        if place != "point" and not term.kind.thread:
            force, moment = resultants(term.work, point)
            density = factor * ufl.as_vector([*force, *moment])
            if not isinstance(density, ufl.constantvalue.Zero):  # as of what resists velocities, in statics
                found[number] = place, density
    return found


def threads_of(model, terms, along):
    """Forms of the `Term`s of threads of a model, UFL: the sum of tensions times lengths; its change along a change of
    the state (`along`, a Function); and what the tensions add to the residual."""
    state, gauss = model.state, measures(model).gauss
    test = model.tests_of(ufl.TestFunction(model.space), model.motion_of(state, state))
    points = [model.point_of(state, rest=term.rest, frame=term.frame) for term in terms]
    pairs = list(zip(terms, points, strict=True))
    energy = sum(term.numbers[0] * thread_stretch(at, *term.numbers[1:]) * gauss for term, at in pairs)
    force = -sum(term.work(at, test) * gauss for term, at in pairs)
    return [energy, ufl.derivative(energy, state, along), force]


def varied_actions(acting, test, direction):
    """The derivative of the work of state-dependent actions in a direction of small motions, with factors; or 0."""
    changes = [live.factor * variation(live.work, live.point, test, direction) * live.measure for live in acting.live]
    return sum(changes) if changes else 0


def derivative_in(trial, *functions):
    """The derivative of a form or an expression in the direction `trial`, summed over aliases of one Function."""

    def derivative(a):
        names = a.coefficients() if isinstance(a, ufl.Form) else ufl.algorithms.extract_coefficients(a)
        return sum(ufl.derivative(a, u, trial) for u in functions if u in names)

    return derivative


class DataDerivative:
    """The change of the residual, and of n, in a direction of the data: of all Functions that `RodModel.load` fills in,
    in statics; form: the compiled change of the residual at the model's state and data."""

    def __init__(self, model):
        self._model, symbols = model, symbols_of(model)
        live = (*symbols.unknowns, *model.carried, *model.actions.tensions)
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
        (space,), (second,) = model.variation_spaces, symbols_of(model).seconds
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
