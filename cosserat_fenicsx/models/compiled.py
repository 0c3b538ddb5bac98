"""Compilation shared by all models: measures, actions, and forms, all of whose signatures are computed first.

FFCx 0.5 modifies the metadata of the integrals that it compiles, which other forms share; a signature computed after
that would differ and miss the code cache, which costs a second.
"""

from collections import namedtuple
from dataclasses import dataclass
from dataclasses import fields as fields_of

import basix
import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.element import lobatto_weights
from cosserat_fenicsx.forms.point import resultants, variation

#: Integrals over the rods with Gauss points, with the nodes of P_p, and with the two ends of every element as points.
Measures = namedtuple("Measures", "gauss nodes ends")
#: Virtual work of the actions: forms of the dead ones per unit of the load factor and of the permanent factor, or None;
#: and a list of `Live` for the others.
ActionWork = namedtuple("ActionWork", "dead permanent live")
#: Virtual work that depends on the state: its form, its factor (UFL), its measure, its point, and its integrand, a
#: function (point, test).
Live = namedtuple("Live", "form factor measure point work")

#: What derivatives by data need, UFL: the forms that are balanced in equilibrium, factors included; n by the law, where
#: n is carried, or None; the Functions of the unknowns; and the second variations.
Symbols = namedtuple("Symbols", "balance contact unknowns seconds")


@dataclass(frozen=True)
class CompiledForms:
    """What a solver assembles and evaluates.

    Attributes:
        residual, tangent: of the unknowns, live loads included.
        dead, permanent: virtual work of what does not depend on the motion, per unit of load factor and of the
            permanent factor; or None.
        second_variations: symmetric forms in small displacements and rotations; stable if none has negative
            eigenvalues.
        fields, fields_size: the components of n, m and r' at the Gauss points, and their number; None and 0 without.
        advance: the next carried n at the Gauss points; or None.
        force, permanent_force: virtual work of the dead forces on displacements, for the determinate models; or None.
        density, node_density: force and moment per length of the distributed actions, at the Gauss points and at the
            nodes, (6,), components along the model's axes; or None.
        gauss, weights: points in [0, 1] of one element, and their weights.
        symbols: the `Symbols`, or None.
    """

    residual: object
    tangent: object
    dead: object
    permanent: object
    second_variations: tuple
    fields: object
    fields_size: int
    advance: object
    force: object
    permanent_force: object
    density: object
    node_density: object
    gauss: np.ndarray
    weights: np.ndarray
    symbols: object


def compile_all(
    model, residual, tangent, acting, seconds, *, fields=None, advance=None, forces=None, densities=(None, None),
    unknowns=None, contact=None,
):  # fmt: skip
    """The `CompiledForms` of UFL forms and expressions.

    Args:
        acting: the `ActionWork`; forces: that of forces on displacements alone, or None.
        seconds: second variations, whose symmetric parts count.
        densities: see `action_densities`.
        unknowns, contact: see `Symbols`, of models in statics.
    """
    seconds = [0.5 * (second + ufl.adjoint(second)) for second in seconds]
    forces = forces or ActionWork(None, None, [])
    for form in (residual, tangent, *seconds, acting.dead, acting.permanent, forces.dead, forces.permanent):
        if form is not None:
            form.signature()
    points, weights = basix.make_quadrature(basix.CellType.interval, 2 * model.signature.points - 1)
    at_gauss, at_nodes = densities
    return CompiledForms(
        compat.form_for_speed(residual),
        compat.form_for_speed(tangent),
        _unless_none(fem.form, acting.dead),
        _unless_none(fem.form, acting.permanent),
        tuple(compat.form_for_speed(second) for second in seconds),
        _unless_none(lambda a: fem.Expression(a, points), fields),
        0 if fields is None else len(fields),
        _unless_none(lambda a: fem.Expression(a, points), advance),
        _unless_none(fem.form, forces.dead),
        _unless_none(fem.form, forces.permanent),
        _unless_none(lambda a: fem.Expression(a, points), at_gauss),
        _unless_none(lambda a: fem.Expression(a, model.nodes[:, None]), at_nodes),
        points[:, 0],
        weights,
        unknowns and Symbols(_balance(model, residual, acting), contact, unknowns, seconds),
    )


def _balance(model, residual, acting):
    for factor, form in ((model.load_factor, acting.dead), (model.permanent_factor, acting.permanent)):
        residual = residual if form is None else residual - factor * form
    return residual


def compile_single(model, second):
    """The `CompiledForms` of a model that has only a second variation, unsymmetric, or None."""
    points, weights = basix.make_quadrature(basix.CellType.interval, 2 * model.signature.points - 1)
    none = {field.name: None for field in fields_of(CompiledForms)}
    seconds = (_unless_none(fem.form, second),)
    given = {"second_variations": seconds, "fields_size": 0, "gauss": points[:, 0], "weights": weights}
    return CompiledForms(**none | given)


def _unless_none(make, a):
    return None if a is None else make(a)


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


def action_work(model, dx, test, point_at, unknowns, accepted_at=None, test_at=None):
    """The `ActionWork` of a model's actions.

    Args:
        dx: the `Measures`; test: a `VirtualMotion`.
        point_at: function (place of a `TermKind`, rest, frame) -> the `Point` there; see `Point` for the last two.
        unknowns: Functions; an action whose form contains one of them depends on the state.
        accepted_at: as `point_at`, for the update of memory at an accepted state; by default the same.
        test_at: function place -> the `VirtualMotion` there; given where test functions depend on the state.
    """
    sums, live = {"load": [], "permanent": []}, []
    factors = {"load": model.load_factor, "permanent": model.permanent_factor, "full": 1}
    for term in model.actions.terms:
        kind = term.kind
        measure = {"point": dx.ends, "line": dx.gauss, "node": dx.nodes}[kind.place]
        point = point_at(kind.place, term.rest, term.frame)
        integrand = term.work(point, test_at(kind.place) if test_at else test)
        if isinstance(integrand, ufl.constantvalue.Zero):
            continue  # such as a force in a determinate model, or a dashpot in statics
        form = integrand * measure
        if set(unknowns) & set(form.coefficients()) or kind.memory or kind.refreshed:
            live.append(Live(form, factors[kind.scaled], measure, point, term.work))
        else:
            sums["load" if kind.scaled == "load" else "permanent"].append(form)
        if kind.memory and term not in (known for known, _ in model.evolving):
            model.evolving.append((term, (accepted_at or point_at)(kind.place, term.rest, term.frame)))
    return ActionWork(*(sum(forms) if forms else None for forms in sums.values()), live)


def action_densities(model, point_at):
    """Force and moment per length of all distributed actions, UFL (6,): at the Gauss points, and at the nodes for
    actions integrated there; None where there are none, or only such as resist velocities, in statics."""
    factors = {"load": model.load_factor, "permanent": model.permanent_factor, "full": 1}
    found = []
    for place in ("line", "node"):
        terms = [term for term in model.actions.terms if term.kind.place == place]
        total = 0
        for term in terms:
            force, moment = resultants(term.work, point_at(place, term.rest, term.frame))
            total += factors[term.kind.scaled] * ufl.as_vector([*force, *moment])
        found.append(total if terms and not isinstance(total, ufl.constantvalue.Zero) else None)
    return tuple(found)


def with_live_actions(acting, residual, tangent, derivative):
    """Residual and tangent with the work of state-dependent actions added."""
    for live in acting.live:
        residual -= live.factor * live.form
        tangent -= live.factor * derivative(live.form)
    return residual, tangent


def varied_actions(acting, test, direction):
    """The derivative of the virtual work of state-dependent actions in a direction of small displacement and rotation,
    factors included; or 0."""
    changes = [live.factor * variation(live.work, live.point, test, direction) * live.measure for live in acting.live]
    return sum(changes) if changes else 0


def derivative_in(trial, *functions):
    """The derivative of a form or an expression in the direction `trial`, summed over aliases of one Function."""

    def derivative(a):
        names = a.coefficients() if isinstance(a, ufl.Form) else ufl.algorithms.extract_coefficients(a)
        return sum(ufl.derivative(a, u, trial) for u in functions if u in names)

    return derivative
