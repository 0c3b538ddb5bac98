"""The forms of `forms/planar.py` on a model's mesh, compiled."""

from functools import partial

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms import planar as eq
from cosserat_fenicsx.models.compiled import (
    action_densities,
    action_work,
    compile_all,
    derivative_in,
    measures,
)
from cosserat_fenicsx.models.laws import law_of, stiff_enough


def compile_forms(model, variations):
    """The `CompiledForms` of a `PlanarModel`; its second variations are the one in the plane and the one out of it.

    Args:
        model: supplies mesh, spaces, data and the terms of the actions.
        variations: space of three components per node.
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

    section = eq.section_of(law_of(data.K, data.K_inv, data.J, data.G), data.R_R, data.v_R)
    motion = motion_of(U)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = eq.tests_of(phi, along(phi))
    derivative = derivative_in(trial, U, U_node)
    force = model.signature.formulation.force
    n, phi_n = (None if a is None else eq.in_plane(a) for a in force.symbols(model, U, phi))
    along_step = partial(ufl.derivative, coefficient=before, argument=step)
    weak = force.weak_form(n, phi_n, motion, motion_of(before), section, test, ds, derivative, along_step)
    advance = None if weak.advance is None else ufl.as_vector([weak.advance[0], weak.advance[1]])

    def point_at(place, rest, frame):
        return eq.point_of(*((U, along(U)) if place == "line" else (U_node, along(U_node))), rest=rest, frame=frame)

    acting = action_work(model, dx, test, point_at, (U, U_node))

    psi, w = ufl.TestFunction(variations), ufl.TrialFunction(variations)
    stiff, seconds, variations_of = section._replace(law=stiff_enough(weak.n, data)), [], []
    for tests_of in (eq.tests_of, eq.sideways_tests_of):
        rigid, direction = tests_of(psi, along(psi)), tests_of(w, along(w))
        seconds.append(ds(equilibrium.second_variation(weak.n, motion, stiff, rigid, direction)))
        variations_of.append((rigid, direction))
    m = equilibrium.contact_moment(weak.n, motion, section)
    fields = ufl.as_vector([weak.n[0], weak.n[1], m[2], motion.r_s[0], motion.r_s[1]])
    densities = action_densities(model, point_at)
    contact = ufl.as_vector(list(equilibrium.contact(motion, section)[0])[:2]) if model.carried else None
    return compile_all(
        model, weak.internal, weak.tangent, acting, seconds, derivative, variations=variations_of, fields=fields,
        advance=advance, densities=densities, unknowns=(U, U_node), contact=contact,
    )  # fmt: skip
