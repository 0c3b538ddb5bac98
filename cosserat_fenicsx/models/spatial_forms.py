"""The forms of `forms/spatial.py` on a model's mesh, compiled."""

from functools import partial

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.models.compiled import (
    action_densities,
    action_work,
    compile_all,
    derivative_in,
    measures,
)
from cosserat_fenicsx.models.laws import as_matrix, law_of, stiff_enough


def compile_forms(model, rotations):
    """The `CompiledForms` of a `SpatialModel`.

    Args:
        model: supplies mesh, spaces, data and the terms of the actions.
        rotations: space of (r, theta) for the second variation.
    """
    formulation = model.signature.formulation
    U, before, step = model.state, model.before, model.step
    U_node = compat.alias(U)
    data, dx = model.data, measures(model)

    def ds(a):
        return a * dx.gauss

    def along(w):
        return w.dx(0)  # the mesh is the line of arc length

    law = law_of(data.K, data.K_inv, data.J, data.G)
    section = equilibrium.Section(law, as_matrix(data.R_R), data.v_R)
    state = eq.state_of(U, along(U), U_node)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = formulation.unit_length.tests(phi, along(phi), state.q, state.q_s)
    derivative = derivative_in(trial, U, U_node)

    n, phi_n = (None if a is None else ufl.as_vector(a) for a in formulation.force.symbols(model, U, phi))
    state_before = eq.state_of(before, along(before), before)
    along_step = partial(ufl.derivative, coefficient=before, argument=step)
    weak = formulation.force.weak_form(n, phi_n, state, state_before, section, test, ds, derivative, along_step)
    held = formulation.unit_length.equations(state, test, U_node, phi) * dx.nodes
    internal, tangent = weak.internal + held, weak.tangent + derivative(held)

    def names_at(place):
        return (U, along(U)) if place == "line" else (U_node, along(U_node))

    def point_at(place, rest, frame):
        return eq.point_of(*names_at(place), rest=rest, frame=frame)

    def test_at(place):
        at = eq.state_of(*names_at(place), U_node)
        return formulation.unit_length.tests(phi, along(phi), at.q, at.q_s)

    acting = action_work(model, dx, test, point_at, (U, U_node), test_at=test_at)

    # The second variation in (r, theta) satisfies |q| = 1 by construction.
    psi, w = ufl.TestFunction(rotations), ufl.TrialFunction(rotations)
    rigid, direction = eq.rotation_tests_of(psi, along(psi)), eq.rotation_tests_of(w, along(w))
    stiff = section._replace(law=stiff_enough(weak.n, data))
    second = ds(equilibrium.second_variation(weak.n, state, stiff, rigid, direction, model.stiffness))
    fields = ufl.as_vector([*weak.n, *equilibrium.contact_moment(weak.n, state, section), *state.r_s])
    densities = action_densities(model, point_at)
    contact = equilibrium.contact(state, section)[0] if model.carried else None
    return compile_all(
        model, internal, tangent, acting, [second], derivative, variations=[(rigid, direction)], fields=fields,
        advance=weak.advance, densities=densities, unknowns=(U, U_node), contact=contact,
    )  # fmt: skip
