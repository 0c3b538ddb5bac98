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


def along(w):
    """w', the mesh being the line of arc length."""
    return ufl.grad(w)[:, 0]


def parts_of(w):
    """r and q of seven components."""
    return ufl.as_vector([w[i] for i in range(3)]), ufl.as_vector([w[i] for i in range(3, 7)])


class StepForms:
    """A step of a moving model as its forms read it. A rung fills in what depends on its unknowns.

    Attributes:
        state, start, velocity: the Functions; nodal, nodal0, rates: the same by names for rules other than Gauss's.
        halfway, passed: the average of both ends, and their difference over h, at the nodes.
        before, after, middle: `Motion`s; section, viscosity: data; test: test functions.
        derivative: that of a form in the direction of the trial function.
    """

    def __init__(self, model):
        self.model, self.dx = model, measures(model)
        # other rules than Gauss's need names of their own where that has one point (compat.alias)
        named = compat.alias if model.shape.degree == 1 else (lambda function: function)
        self.state, self.start, self.velocity = U, U0, V = model.state, model.start, model.velocity
        self.nodal, self.nodal0, self.rates = nodal, nodal0, _ = named(U), named(U0), named(V)
        self.halfway, self.passed = (nodal + nodal0) / 2, (nodal - nodal0) / model.h
        self._take_data()
        self.before, self.after, self.middle = (self.motion_of(w) for w in (U0, U, (U + U0) / 2))
        phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
        self.test = self.tests_of(phi)
        self.derivative = derivative_in(trial, *dict.fromkeys((U, nodal)))

    # -- what a rung fills in ----------------------------------------------------------------------------------------

    def _take_data(self):
        """Set section and viscosity, and what else the rung needs."""
        raise NotImplementedError

    def motion_of(self, w):
        """The motion of the unknowns, under Gauss's rule."""
        raise NotImplementedError

    def tests_of(self, phi):
        """The test functions of eq. (1)."""
        raise NotImplementedError

    def rotation_of(self, w):
        """R from the reference."""
        raise NotImplementedError

    def momentum(self, w, w_t):
        """Momenta per length of unknowns and their rates, tested."""
        raise NotImplementedError

    def kinetic(self, w, w_t):
        """Kinetic energy per length."""
        raise NotImplementedError

    def constraint(self):
        """What the residual holds beside the balances, or 0."""
        return 0

    def fields(self, n, m):
        """The numbers of n, m and r' that are unknown on this rung."""
        raise NotImplementedError

    # -- forms -------------------------------------------------------------------------------------------------------

    def loads(self, w):
        """The `LoadWork` where the unknowns turn with w."""
        return load_work(self.model, self.dx, self.test, self.rotation_of(w), {self.state, self.nodal})

    def compiled(self, residual, acting, working):
        """`MotionForms` of a residual without loads.

        Args:
            acting: `LoadWork` in the balances; working: the one by which work is booked, half way.
        """
        model, dx, section, viscosity, h = self.model, self.dx, self.section, self.viscosity, self.model.h
        residual, tangent = with_live_loads(model, acting, residual, self.derivative(residual), self.derivative)
        n, m = inertia.contact(self.after, section, viscosity, lambda a: ufl.derivative(a, self.state, self.velocity))
        lost = inertia.viscous_loss(self.before, self.after, section, viscosity, h) * dx.gauss
        lost += 2 * h * model.drag[0] * self.kinetic(self.halfway, self.passed) * dx.nodes
        others = {
            "momentum": self.momentum(self.nodal, self.rates) * dx.nodes,
            "live": sum(term for term, _, _ in working.live) if working.live else None,
            "kinetic": self.kinetic(self.nodal, self.rates) * dx.nodes,
            "strain": inertia.strain_energy(self.after, section) * dx.gauss,
            "dissipated": lost,
        }
        return compile_motion(model, residual, tangent, acting.dead, self.fields(n, m), others)


def compile_momentum(step, stress=inertia.averaged_stress):
    """The `MotionForms` of the momentum scheme on the `StepForms` of a rung; `stress` makes the stress of the step."""
    model, dx, h = step.model, step.dx, step.model.h
    residual = 1 / h * step.momentum(step.nodal, 2 * step.passed - step.rates) * dx.nodes
    residual += stress(step.before, step.after, step.middle, step.section, step.viscosity, h, step.test) * dx.gauss
    # drag: -drag times the momenta half way, with the velocities (U - U0)/h
    residual += model.drag[0] * step.momentum(step.halfway, step.passed) * dx.nodes
    residual += step.constraint()
    loads = step.loads(step.halfway)
    return step.compiled(residual, loads, loads)


class SpatialStep(StepForms):
    """See `StepForms`."""

    def _take_data(self):
        data = SpatialData.of(self.model)
        self.section, self.viscosity, self.body = data.section, data.viscosity, data.body

    def motion_of(self, w):
        """See `StepForms`."""
        return eq.state_of(w, along(w), w)

    def tests_of(self, phi):
        """See `StepForms`."""
        return eq.tests_of(phi, along(phi))

    def rotation_of(self, w):
        """See `StepForms`."""
        return rotation_matrix(parts_of(w)[1])

    def momentum(self, w, w_t):
        """See `StepForms`."""
        (_, q), (r_t, q_t) = parts_of(w), parts_of(w_t)
        return inertia.momentum(r_t, inertia.angular_momentum(q, q_t, self.body), self.body, self.test)

    def kinetic(self, w, w_t):
        """See `StepForms`."""
        (_, q), (r_t, q_t) = parts_of(w), parts_of(w_t)
        return inertia.kinetic_energy(r_t, inertia.angular_velocity(q, q_t), self.body)

    def constraint(self):
        """See `StepForms`: |q| = 1 at the nodes."""
        at_nodes = self.after._replace(q_node=parts_of(self.nodal)[1])
        return eq.unit_quaternion(at_nodes, self.test) * self.dx.nodes

    def fields(self, n, m):
        """See `StepForms`."""
        return ufl.as_vector([*n, *m, *self.after.r_s])


def compile_motion(model, residual, tangent, dead, fields, others):
    """`MotionForms` of UFL forms; all are signed before the first is compiled, see `compiled`."""
    others = {name: form for name, form in others.items()}
    for form in others.values():
        if form is not None:
            form.signature()
    made = compat.form_for_speed
    steady = compile_all(model, residual, tangent, dead, [], fields=fields, compiled=made)
    return MotionForms(**vars(steady), **{name: form and made(form) for name, form in others.items()})
