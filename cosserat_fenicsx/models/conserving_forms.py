"""The forms of `forms/energy.py` on a model's mesh, compiled."""

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import eccentric, energy, inertia
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.forms.rotation import small_rotation
from cosserat_fenicsx.models.compiled import action_work, derivative_in, measures
from cosserat_fenicsx.models.moving_forms import (
    SpatialData,
    along,
    compile_motion,
    parts_of,
    virtual_work_of_step,
)


def compile_conserving(model):
    """The `MotionForms` of the energy-conserving scheme of a moving spatial model.

    Test functions are changes of (r, q). The residual has all terms of the step except loads, and no equation |q| = 1.
    """
    dx, data = measures(model), SpatialData.of(model)
    named = compat.alias if model.signature.degree == 1 else (lambda function: function)
    U, U0, V, W = model.state, model.start, model.velocity, model.turning
    nodal, nodal0, rates, turning = named(U), named(U0), named(V), named(W)
    h, section, viscosity, body = model.h, data.section, data.viscosity, data.body

    def line(w):
        (_, q), (r_s, q_s) = parts_of(w), parts_of(along(w))
        return energy.Configuration(r_s, q, q_s)

    before, after = line(U0), line(U)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = energy.Variation(*parts_of(phi), *parts_of(along(phi)))
    derivative = derivative_in(trial, *dict.fromkeys((U, nodal)))

    (r0, q0), (r1, q1), (r_t, _) = parts_of(nodal0), parts_of(nodal), parts_of(rates)
    spin = ufl.as_matrix([[turning[3 * i + j] for j in range(3)] for i in range(3)])
    moved, turned = (r1 - r0) / h, (energy.directors(q1) - energy.directors(q0)) / h
    half = (q0 + q1) / 2
    residual = energy.rate_work(2 * (moved - r_t) / h, 2 * (turned - spin) / h, half, body, test) * dx.nodes
    residual += model.drag[0] * energy.rate_work(moved, turned, half, body, test) * dx.nodes
    residual += energy.stress_work(before, after, section, viscosity, h, test) * dx.gauss

    def point_at(place, rest, frame):
        w, w0 = (U, U0) if place == "line" else (nodal, nodal0)
        r_t, q_t = parts_of((w - w0) / h)
        middle = (w + w0) / 2
        omega = small_rotation(q_t, parts_of(middle)[1])
        return eq.point_of(middle, along(middle), rest=rest, frame=frame, r_t=r_t, omega=omega)

    def end_point(place, rest, frame):
        w = U if place == "line" else nodal
        return eq.point_of(w, along(w), rest=rest, frame=frame)

    def of_stress(test):
        """At a clamped point delta q = phi/2: q is (1, 0, 0, 0) there."""
        q, q_s = (ufl.as_vector([0, *(a[i] / 2 for i in range(3))]) for a in (test.phi, test.phi_s))
        varied = energy.Variation(test.phi_r, q, test.phi_r_s, q_s)
        return energy.stress_work(before, after, section, viscosity, h, varied)

    of_step = virtual_work_of_step(model, of_stress, point_at)
    acting = action_work(model, dx, eq.tests_of(phi, along(phi)), point_at, {U, nodal}, end_point)
    state = eq.state_of(U, along(U), U)
    n, m = inertia.contact(state, section, viscosity, lambda a: ufl.derivative(a, U, V))
    tests, kappa = eq.tests_of(phi, along(phi)), energy.angular_momentum(q1, spin, body)
    if body.offset is None:
        momentum = inertia.momentum(r_t, kappa, body, tests)
    else:
        momentum = eccentric.momentum(r_t, eccentric.arm(q1, body), spin * body.offset, kappa, body, tests)
    lost = energy.viscous_loss(before, after, section, viscosity, h) * dx.gauss
    lost += 2 * h * model.drag[0] * energy.kinetic_energy(moved, turned, body) * dx.nodes
    others = {
        "momentum": momentum * dx.nodes,
        "kinetic": energy.kinetic_energy(r_t, spin, body) * dx.nodes,
        "strain": energy.strain_energy(after, section) * dx.gauss,
        "dissipated": lost,
    }
    fields = ufl.as_vector([*n, *m, *state.r_s])
    dead = acting._replace(live=[])
    return compile_motion(model, residual, dead, derivative, fields, others, of_step, acting, turned=True)
