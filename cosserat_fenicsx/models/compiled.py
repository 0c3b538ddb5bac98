"""What every rung compiles: the measures, the loads, and all forms signed before the first is compiled.

FFCx 0.5 completes the metadata of the integrals that it compiles in place, other forms share them, and a form signed
later would miss the code cache, which costs a second.
"""

from collections import namedtuple
from dataclasses import dataclass
from functools import partial

import basix
import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx.forms import equilibrium

#: Integrals over the rods: by Gauss's points, at the nodes of P_p, and at the two ends of every element.
Measures = namedtuple("Measures", "gauss nodes ends")
#: Virtual work of the loads: dead ones, per unit of load factor, or None; and live ones [(form, integral, work)].
LoadWork = namedtuple("LoadWork", "dead live")


@dataclass(frozen=True)
class CompiledForms:
    """What a solver assembles and evaluates.

    Attributes:
        residual, tangent: of the unknowns, live loads included.
        dead: virtual work of the loads that do not depend on the motion, per unit of load factor; or None.
        second_variations: symmetric forms in small displacements and rotations whose negative squares tell stability.
        fields, fields_size: what the Gauss points know of n, m and r', and how many numbers that is; or None.
        advance: the next carried n at the Gauss points; or None.
        force: virtual work of the dead forces alone on a displacement, where statics asks for it; or None.
        gauss, weights: points in [0, 1] of one element, and their weights.
    """

    residual: object
    tangent: object
    dead: object
    second_variations: tuple
    fields: object
    fields_size: int
    advance: object
    force: object
    gauss: np.ndarray
    weights: np.ndarray


def compile_all(model, residual, tangent, dead, seconds, *, fields=None, advance=None, force=None, compiled=fem.form):
    """The `CompiledForms` of UFL forms and expressions; of `seconds` the symmetric parts count. `compiled` makes residual
    and tangent."""
    seconds = [0.5 * (second + ufl.adjoint(second)) for second in seconds]
    for form in (residual, tangent, *seconds, dead, force):
        if form is not None:
            form.signature()
    points, weights = basix.make_quadrature(basix.CellType.interval, 2 * model.shape.points - 1)
    return CompiledForms(
        compiled(residual),
        compiled(tangent),
        _unless_none(fem.form, dead),
        tuple(fem.form(second) for second in seconds),
        _unless_none(lambda a: fem.Expression(a, points), fields),
        0 if fields is None else len(fields),
        _unless_none(lambda a: fem.Expression(a, points), advance),
        _unless_none(fem.form, force),
        points[:, 0],
        weights,
    )


def _unless_none(make, a):
    return None if a is None else make(a)


def measures(model):
    """The `Measures` of a model."""
    nodes = model.nodes
    weights = lobatto_weights(nodes)
    gauss = ufl.dx(domain=model.mesh, metadata={"quadrature_degree": 2 * model.shape.points - 1})
    ends = np.array([0.0, 1.0]), np.array([0.5, 0.5])
    return Measures(gauss, _rule(model.mesh, nodes, weights), _rule(model.mesh, *ends))


def lobatto_weights(nodes):
    """Weights of the rule on [0, 1] that has the nodes (n,) as points."""
    return np.linalg.solve(np.vander(nodes, increasing=True).T, 1 / np.arange(1, len(nodes) + 1))


def _rule(mesh, points, weights):
    # Tuples, and from 1 down to 0: UFL complains of arrays, and FFCx names a rule by three hexadecimal digits of a
    # hash of its points, in which the Gauss and the Lobatto points of P4 collide.
    return ufl.dx(
        domain=mesh,
        metadata={
            "quadrature_rule": "custom",
            "quadrature_degree": max(1, 2 * len(points) - 3),
            "quadrature_points": tuple((float(x),) for x in points[::-1]),
            "quadrature_weights": tuple(float(w) for w in weights[::-1]),
        },
    )


def load_work(model, dx, test, R, unknowns):
    """The loads' virtual work, sorted into dead and live.

    Args:
        dx: the `Measures`; test: test functions; R: the rotation, by names that the rule at the ends may have.
        unknowns: the Functions that make a load live.
    """
    dead, live = [], []
    for work, place, vectors in model.terms:
        measure = dx.ends if place == "point" else dx.gauss
        integrand = work(*vectors, test, R)
        if isinstance(integrand, ufl.constantvalue.Zero):
            continue  # the work of a force where there is no virtual displacement
        term = integrand * measure
        if set(unknowns) & set(term.coefficients()):
            live.append((term, measure, partial(work, *vectors)))
        else:
            dead.append(term)
    return LoadWork(sum(dead) if dead else None, live)


def with_live_loads(model, loads, residual, tangent, derivative):
    """Residual and tangent with the live loads in them."""
    for term, _, _ in loads.live:
        residual -= model.load_factor * term
        tangent -= model.load_factor * derivative(term)
    return residual, tangent


def turned_loads(model, loads, test, R, phi):
    """What a small inertial rotation phi changes in the work of the live loads, load factor included; or 0."""
    changes = [equilibrium.load_variation(work, test, R, phi) * measure for _, measure, work in loads.live]
    return model.load_factor * sum(changes) if changes else 0


def derivative_in(trial, *functions):
    """The derivative of a form or an expression in the direction `trial` of Functions that share their numbers."""

    def derivative(a):
        names = a.coefficients() if isinstance(a, ufl.Form) else ufl.algorithms.extract_coefficients(a)
        return sum(ufl.derivative(a, u, trial) for u in functions if u in names)

    return derivative
