"""The forms of `forms/spatial.py` on a model's mesh, compiled."""

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.forms.rotation import rotation_matrix
from cosserat_fenicsx.models.compiled import (
    compile_all,
    derivative_in,
    load_work,
    measures,
    turned_loads,
    with_live_loads,
)


def compile_forms(model, rotations, carried_n):
    """The `CompiledForms` of a `SpatialModel`.

    Args:
        model: supplies mesh, spaces, data and the load terms.
        rotations: space of (r, theta) for the second variation.
        carried_n: the Function n_k of the condensed variant, else None.
    """
    variant = model.shape.variant
    U, before, step = model.state, model.before, model.step
    U_node = compat.alias(U)
    data, dx = model.data, measures(model)

    def ds(a):
        return a * dx.gauss

    def ds_node(a):
        return a * dx.nodes

    def along(w):
        return w.dx(0)  # the mesh is the line of arc length

    R_R = ufl.as_matrix([[data.R_R[3 * i + j] for j in range(3)] for i in range(3)])
    section = equilibrium.Section(data.K, data.K_inv, data.J, R_R, data.v_R)
    state = eq.state_of(U, along(U), U_node)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = load_test = eq.tests_of(phi, along(phi))
    derivative = derivative_in(trial, U, U_node)

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

    R_node = rotation_matrix(state.q_node)
    loads = load_work(model, dx, load_test, R_node, (U, U_node))
    residual, tangent = with_live_loads(model, loads, internal, tangent, derivative)

    # The second variation in (r, theta) never leaves |q| = 1.
    psi, w = ufl.TestFunction(rotations), ufl.TrialFunction(rotations)
    rigid, direction = eq.rotation_tests_of(psi, along(psi)), eq.rotation_tests_of(w, along(w))
    stiff = section._replace(K=data.K_stiff) if variant in ("condensed", "field") else section
    second = ds(equilibrium.second_variation(n, state, stiff, rigid, direction, model.stiffness))
    second -= turned_loads(model, loads, rigid, R_node, direction.phi)
    fields = ufl.as_vector([*n, *m, *state.r_s])
    return compile_all(model, residual, tangent, loads.dead, [second], fields=fields, advance=advance)
