"""The forms of `forms/spatial.py` on a model's mesh, compiled.

All forms are signed before the first is compiled: FFCx 0.5 completes the metadata of the integrals that it compiles in
place, other forms share them, and a form signed later would miss the code cache, which costs a second.
"""

from dataclasses import dataclass
from functools import partial

import basix
import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.forms.rotation import rotation_matrix


@dataclass(frozen=True)
class CompiledForms:
    """What a solver assembles and evaluates.

    Attributes:
        residual, tangent: of the unknowns, live loads included.
        dead: virtual work of the loads that do not depend on the motion, per unit of load factor; or None.
        second_variation: symmetric form in (r, theta) whose negative squares tell stability.
        fields: (n, m, r') at the Gauss points.
        advance: the next carried n at the Gauss points; or None.
        gauss, weights: points in [0, 1] of one element, and their weights.
    """

    residual: object
    tangent: object
    dead: object
    second_variation: object
    fields: object
    advance: object
    gauss: np.ndarray
    weights: np.ndarray


def compile_forms(model, rotations, carried_n):
    """The `CompiledForms` of a `SpatialModel`.

    Args:
        model: supplies mesh, spaces, data and the load terms.
        rotations: space of (r, theta) for the second variation.
        carried_n: the Function n_k of the condensed variant, else None.
    """
    variant, points = model.shape.variant, model.shape.points
    U, before, step = model.state, model.before, model.step
    U_node = compat.alias(U)
    data = model.data
    gauss, at_nodes, at_ends = _measures(model)

    def ds(a):
        return a * gauss

    def ds_node(a):
        return a * at_nodes

    def at_points(a):
        return a * at_ends

    def along(w):
        return w.dx(0)  # the mesh is the line of arc length

    R_R = ufl.as_matrix([[data.R_R[3 * i + j] for j in range(3)] for i in range(3)])
    section = equilibrium.Section(data.K, data.K_inv, data.J, R_R, data.v_R)
    state = eq.state_of(U, along(U), U_node)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = load_test = eq.tests_of(phi, along(phi))

    def derivative(a):
        names = a.coefficients() if isinstance(a, ufl.Form) else ufl.algorithms.extract_coefficients(a)
        return sum(ufl.derivative(a, u, trial) for u in (U, U_node) if u in names)

    n, m = equilibrium.contact_force(state, section), equilibrium.contact_moment(state, section)
    advance = None
    if variant == "field":
        n = ufl.as_vector([U[i] for i in (7, 8, 9)])
        phi_n = ufl.as_vector([phi[i] for i in (7, 8, 9)])
        internal = eq.mixed(n, state, section, test, phi_n, ds, ds_node)
    elif variant == "multiplier":
        n, m = eq.multiplier_contact(state, section)
        load_test = eq.variation_tests_of(phi, state.q_node)
        lam = data.K[2] * U[7]  # lambda has the size of EA
        internal = eq.multiplier(lam, phi[7], state, section, ds, lambda a: ufl.derivative(a, U, phi))
    else:
        internal = eq.displacement(state, section, test, ds, ds_node)
    if variant == "condensed":
        n = carried_n
        tangent = eq.carried_force_tangent(n, state, section, test, ds, ds_node, derivative)
        state_before = eq.state_of(before, along(before), before)
        advance = equilibrium.carried_force_update(n, state_before, section, lambda a: ufl.derivative(a, before, step))
    else:
        tangent = derivative(internal)

    # Dead loads are a vector assembled once; live ones depend on q and enter residual and tangent.
    R_node = rotation_matrix(state.q_node)
    dead_terms, live_terms = [], []
    for work, place, vectors in model.terms:
        integral = at_points if place == "point" else ds
        term = integral(work(*vectors, load_test, R_node))
        if {U, U_node} & set(term.coefficients()):
            live_terms.append((term, (work, vectors, integral)))
        else:
            dead_terms.append(term)
    residual = internal
    for term, _ in live_terms:
        residual -= model.load_factor * term
        tangent -= model.load_factor * derivative(term)

    # The second variation in (r, theta) never leaves |q| = 1.
    psi, w = ufl.TestFunction(rotations), ufl.TrialFunction(rotations)
    rigid, direction = eq.rotation_tests_of(psi, along(psi)), eq.rotation_tests_of(w, along(w))
    stiff = section._replace(K=data.K_stiff) if variant in ("condensed", "field") else section
    second = ds(equilibrium.second_variation(n, state, stiff, rigid, direction))
    for _, (work, vectors, integral) in live_terms:
        change = equilibrium.load_variation(partial(work, *vectors), rigid, R_node, direction.phi)
        second -= model.load_factor * integral(change)
    second = 0.5 * (second + ufl.adjoint(second))

    fields = ufl.as_vector([*n, *m, *state.r_s])
    dead = sum(dead_terms) if dead_terms else None
    for form in (residual, tangent, second, dead):
        if form is not None:
            form.signature()
    points_2d, weights = basix.make_quadrature(basix.CellType.interval, 2 * points - 1)
    return CompiledForms(
        fem.form(residual),
        fem.form(tangent),
        fem.form(dead) if dead is not None else None,
        fem.form(second),
        fem.Expression(fields, points_2d),
        fem.Expression(advance, points_2d) if advance is not None else None,
        points_2d[:, 0],
        weights,
    )


def _measures(model):
    """Integrals by Gauss's points, at the nodes of P_p, and at the two ends of every element."""
    nodes = model.nodes
    weights = np.linalg.solve(np.vander(nodes, increasing=True).T, 1 / np.arange(1, len(nodes) + 1))
    gauss = ufl.dx(domain=model.mesh, metadata={"quadrature_degree": 2 * model.shape.points - 1})
    return gauss, _rule(model.mesh, nodes, weights), _rule(model.mesh, np.array([0.0, 1.0]), np.array([0.5, 0.5]))


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
