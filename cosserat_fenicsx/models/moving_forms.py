"""The forms of `forms/inertia.py` on a model's mesh, compiled."""

from dataclasses import dataclass

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium, inertia
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.forms.rotation import rotation_matrix
from cosserat_fenicsx.models.compiled import (
    CompiledForms,
    compile_all,
    derivative_in,
    load_work,
    measures,
    with_live_loads,
)


@dataclass(frozen=True)
class MotionForms(CompiledForms):
    """What a stepper assembles and evaluates: the residual is that of a step from `start` to `state`.

    Attributes:
        residual: without the dead loads, and without the momenta at the start of the step, over h.
        momentum: momenta of the state and its velocity, tested.
        live: virtual work of the live loads half way, per unit of load factor; or None. live_tangent: its derivative,
            where it is no part of the tangent.
        kinetic, strain: energies of the state; dissipated: what damping takes in the step.
    """

    momentum: object
    live: object
    kinetic: object
    strain: object
    dissipated: object
    live_tangent: object = None


@dataclass(frozen=True)
class SpatialData:
    """The data of a moving spatial model as forms read them."""

    section: equilibrium.Section
    viscosity: inertia.Viscosity
    body: inertia.Inertia

    @classmethod
    def of(cls, model):
        """Those of a model."""
        data, I = model.data, model.inertia
        R_R = ufl.as_matrix([[data.R_R[3 * i + j] for j in range(3)] for i in range(3)])
        I_R = ufl.as_matrix([[I[0], I[1], I[2]], [I[1], I[3], I[4]], [I[2], I[4], I[5]]])
        section = equilibrium.Section(data.K, data.K_inv, data.J, R_R, data.v_R)
        return cls(section, inertia.Viscosity(model.Kt, model.Jt), inertia.Inertia(model.mass[0], I_R))


def parts_of(w):
    """r and q of seven components."""
    return ufl.as_vector([w[i] for i in range(3)]), ufl.as_vector([w[i] for i in range(3, 7)])


def compile_spatial(model):
    """The `MotionForms` of a moving spatial model, momentum scheme."""
    dx, data = measures(model), SpatialData.of(model)
    section, viscosity, body = data.section, data.viscosity, data.body
    # other rules than Gauss's need names of their own where that has one point (compat.alias)
    named = compat.alias if model.shape.degree == 1 else (lambda function: function)
    U, U0, V = model.state, model.start, model.velocity
    nodal, nodal0, rates = named(U), named(U0), named(V)

    def along(w):
        return ufl.grad(w)[:, 0]  # the mesh is the line of arc length

    before, after, middle = (eq.state_of(w, along(w), w) for w in (U0, U, (U + U0) / 2))
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = eq.tests_of(phi, along(phi))

    def momentum(w, w_t):
        (_, q), (r_t, q_t) = parts_of(w), parts_of(w_t)
        return inertia.momentum(r_t, inertia.angular_momentum(q, q_t, body), body, test)

    rates_after = 2 * (nodal - nodal0) / model.h - rates
    residual = 1 / model.h * momentum(nodal, rates_after) * dx.nodes
    residual += inertia.averaged_stress(before, after, middle, section, viscosity, model.h, test) * dx.gauss
    # drag: -drag times the momenta half way, with the velocities (U - U0)/h
    passed, halfway = (nodal - nodal0) / model.h, (nodal + nodal0) / 2
    residual += model.drag[0] * momentum(halfway, passed) * dx.nodes
    residual += eq.unit_quaternion(after._replace(q_node=parts_of(nodal)[1]), test) * dx.nodes
    R_middle = rotation_matrix(parts_of(halfway)[1])
    loads = load_work(model, dx, test, R_middle, {U, nodal})
    derivative = derivative_in(trial, *dict.fromkeys((U, nodal)))
    residual, tangent = with_live_loads(model, loads, residual, derivative(residual), derivative)

    def kinetic(w, w_t):
        (_, q), (r_t, q_t) = parts_of(w), parts_of(w_t)
        return inertia.kinetic_energy(r_t, inertia.angular_velocity(q, q_t), body)

    n, m = inertia.contact(after, section, viscosity, lambda a: ufl.derivative(a, U, V))
    lost = inertia.viscous_loss(before, after, section, viscosity, model.h) * dx.gauss
    lost += 2 * model.h * model.drag[0] * kinetic(halfway, passed) * dx.nodes
    live = sum(term for term, _, _ in loads.live) if loads.live else None
    others = {
        "momentum": momentum(nodal, rates) * dx.nodes,
        "live": live,
        "kinetic": kinetic(nodal, rates) * dx.nodes,
        "strain": inertia.strain_energy(after, section) * dx.gauss,
        "dissipated": lost,
    }
    return compile_motion(model, residual, tangent, loads.dead, ufl.as_vector([*n, *m, *after.r_s]), others)


def compile_motion(model, residual, tangent, dead, fields, others):
    """`MotionForms` of UFL forms; all are signed before the first is compiled, see `compiled`."""
    others = {name: form for name, form in others.items()}
    for form in others.values():
        if form is not None:
            form.signature()
    made = compat.form_for_speed
    steady = compile_all(model, residual, tangent, dead, [], fields=fields, compiled=made)
    return MotionForms(**vars(steady), **{name: form and made(form) for name, form in others.items()})
