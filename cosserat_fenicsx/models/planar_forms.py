"""The forms of `forms/planar.py` on a model's mesh, compiled."""

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms import planar as eq
from cosserat_fenicsx.models.compiled import (
    compile_all,
    derivative_in,
    load_work,
    measures,
    turned_loads,
    with_live_loads,
)


def compile_forms(model, variations, carried_n):
    """The `CompiledForms` of a `PlanarModel`; its second variations are the one in the plane and the one out of it.

    Args:
        model: supplies mesh, spaces, data and the load terms.
        variations: space of three components a node.
        carried_n: the Function n_k of the condensed variant, else None.
    """
    U, before, step = model.state, model.before, model.step
    U_node = compat.alias(U)
    data, dx = model.data, measures(model)

    def ds(a):
        return a * dx.gauss

    def along(w):
        return w.dx(0)  # the mesh is the line of arc length

    def motion_of(u):
        return eq.motion_of(along(u), u[2], along(u)[2])

    section = eq.section_of(data.K, data.K_inv, data.J, data.R_R, data.v_R)
    motion = motion_of(U)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = eq.tests_of(phi, along(phi))
    derivative = derivative_in(trial, U, U_node)
    advance = None
    if carried_n is None:
        n = eq.in_plane((U[3], U[4]))
        internal = equilibrium.mixed(n, motion, section, test, eq.in_plane((phi[3], phi[4])), ds)
        tangent = derivative(internal)
    else:
        n = eq.in_plane(carried_n)
        internal = equilibrium.displacement(motion, section, test, ds)
        tangent = equilibrium.carried_force_tangent(n, motion, section, test, ds, derivative)
        update = equilibrium.carried_force_update(
            n, motion_of(before), section, lambda a: ufl.derivative(a, before, step)
        )
        advance = ufl.as_vector([update[0], update[1]])

    R_node = eq.rotation_matrix(U_node[2])
    loads = load_work(model, dx, test, R_node, (U, U_node))
    residual, tangent = with_live_loads(model, loads, internal, tangent, derivative)

    psi, w = ufl.TestFunction(variations), ufl.TrialFunction(variations)
    stiff, seconds = section._replace(K=data.K_stiff), []
    for tests_of in (eq.tests_of, eq.sideways_tests_of):
        rigid, direction = tests_of(psi, along(psi)), tests_of(w, along(w))
        second = ds(equilibrium.second_variation(n, motion, stiff, rigid, direction))
        seconds.append(second - turned_loads(model, loads, rigid, R_node, direction.phi))
    m = equilibrium.contact_moment(motion, section)
    fields = ufl.as_vector([n[0], n[1], m[2], motion.r_s[0], motion.r_s[1]])
    return compile_all(model, residual, tangent, loads.dead, seconds, fields=fields, advance=advance)
