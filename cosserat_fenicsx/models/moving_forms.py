"""The forms of `forms/inertia.py` on a model's mesh, compiled."""

from dataclasses import dataclass

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium, inertia
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.forms.equilibrium import VirtualMotion
from cosserat_fenicsx.forms.point import AXES, NONE
from cosserat_fenicsx.forms.rotation import small_rotation
from cosserat_fenicsx.models.compiled import (
    CompiledForms,
    action_work,
    compile_parts,
    derivative_in,
    live_parts,
    measures,
    nonzero,
)
from cosserat_fenicsx.models.laws import as_matrix, law_of


@dataclass(frozen=True)
class MotionForms(CompiledForms):
    """What a time stepper assembles and evaluates: the residual is that of a step from `start` to `state`.

    Attributes:
        residual: without the dead loads, and without the momenta at the start of the step, over h.
        momentum: momenta of the state and its velocity times the test functions.
        live: minus the virtual work of state-dependent actions at the middle of the step, factors included; a tuple.
        live_tangent: its derivative, where this is not part of the tangent; a tuple.
        kinetic, strain: energies of the state; dissipated: energy dissipated in the step.
        of_step, of_step_at_nodes: the two results of `virtual_work_of_step`, compiled, or None.
    """

    momentum: object
    live: object
    kinetic: object
    strain: object
    dissipated: object
    live_tangent: tuple = ()
    of_step: object = None
    of_step_at_nodes: object = None


@dataclass(frozen=True)
class SpatialData:
    """The data of a moving spatial model as used in forms; `viscosity` is the law of the strain rates."""

    section: equilibrium.Section
    viscosity: object
    body: inertia.Inertia

    @classmethod
    def of(cls, model):
        """The data of a model."""
        data, I = model.data, model.inertia
        I_R = ufl.as_matrix([[I[0], I[1], I[2]], [I[1], I[3], I[4]], [I[2], I[4], I[5]]])
        law = law_of(data.K, data.K_inv, data.J, data.G)
        section = equilibrium.Section(law, as_matrix(data.R_R), data.v_R)
        return cls(section, law_of(*model.viscosity), inertia.Inertia(model.mass[0], I_R, model.offset, model.lateral))


def along(w):
    """w', because the coordinate of the mesh is arc length."""
    return ufl.grad(w)[:, 0]


def parts_of(w):
    """r and q of seven components."""
    return ufl.as_vector([w[i] for i in range(3)]), ufl.as_vector([w[i] for i in range(3, 7)])


class StepForms:
    """The UFL expressions of a time step. Subclasses define what depends on the unknowns of a model.

    Attributes:
        state, start, velocity: the Functions; nodal, nodal0, rates: their aliases for rules other than Gauss's.
        halfway, passed: the average of both ends of the step, and their difference over h, at the nodes.
        before, after, middle: `Motion`s; section, viscosity: data; test: test functions.
        derivative: that of a form in the direction of the trial function.
    """

    def __init__(self, model):
        self.model, self.dx = model, measures(model)
        # where the Gauss rule has one point, the other rules need other coefficients (compat.alias)
        named = compat.alias if model.signature.degree == 1 else (lambda function: function)
        self.state, self.start, self.velocity = U, U0, V = model.state, model.start, model.velocity
        self.nodal, self.nodal0, self.rates = nodal, nodal0, _ = named(U), named(U0), named(V)
        self.halfway, self.passed = (nodal + nodal0) / 2, (nodal - nodal0) / model.h
        self._take_data()
        self.before, self.after, self.middle = (self.motion_of(w) for w in (U0, U, (U + U0) / 2))
        phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
        self.test = self.tests_of(phi)
        self.derivative = derivative_in(trial, *dict.fromkeys((U, nodal)))

    # -- for subclasses to define ------------------------------------------------------------------------------------

    def _take_data(self):
        """Set section and viscosity, and other data that the model needs."""
        raise NotImplementedError

    def motion_of(self, w):
        """The `Motion` of the unknowns, for Gauss's rule."""
        raise NotImplementedError

    def tests_of(self, phi):
        """The test functions of eq. (1)."""
        raise NotImplementedError

    def point_of(self, w, w_s, w_t, rest, frame):
        """The `Point` of unknowns, their derivatives along the rod and their rates."""
        raise NotImplementedError

    def momentum(self, w, w_t):
        """Momenta per unit length of unknowns and their rates, times the test functions."""
        raise NotImplementedError

    def kinetic(self, w, w_t):
        """Kinetic energy per length."""
        raise NotImplementedError

    def momentum_before(self):
        """`momentum` at the state with `velocity`, before it is the start of a step."""
        return self.momentum(self.nodal, self.rates)

    def kinetic_before(self):
        """`kinetic` likewise."""
        return self.kinetic(self.nodal, self.rates)

    def momentum_after(self):
        """`momentum` at the end of the step, by the trapezoidal rule."""
        return self.momentum(self.nodal, 2 * self.passed - self.rates)

    def of_moving_axis(self):
        """What the balances have per length besides the rates of `momentum`; or None."""
        return

    def constraint(self):
        """Terms of the residual in addition to the balances, or 0."""
        return 0

    def fields(self, n, m):
        """The components of n, m and r' that do not vanish identically in this model."""
        raise NotImplementedError

    # -- forms -------------------------------------------------------------------------------------------------------

    def halfway_point(self, place, rest, frame):
        """The `Point` of the average of both ends of the step, with the average velocity."""
        w, w0 = (self.state, self.start) if place == "line" else (self.nodal, self.nodal0)
        return self.point_of((w + w0) / 2, along((w + w0) / 2), (w - w0) / self.model.h, rest, frame)

    def actions(self, point_at):
        """The `ActionWork` at the points that `point_at` gives."""
        return action_work(self.model, self.dx, self.test, point_at, {self.state, self.nodal}, self.end_point)

    def end_point(self, place, rest, frame):
        """The `Point` at the end of the step."""
        w, w0 = (self.state, self.start) if place == "line" else (self.nodal, self.nodal0)
        return self.point_of(w, along(w), (w - w0) / self.model.h, rest, frame)

    def compiled(self, residual, acting, working, of_step):
        """`MotionForms` of a residual without loads.

        Args:
            of_step: see `virtual_work_of_step`.
            acting: `ActionWork` in the residual; working: that in the energy balance, at the middle of the step, or
                None for the same.
        """
        model, dx, section, viscosity, h = self.model, self.dx, self.section, self.viscosity, self.model.h
        n, m = inertia.contact(self.after, section, viscosity, lambda a: ufl.derivative(a, self.state, self.velocity))
        lost = inertia.viscous_loss(self.before, self.after, section, viscosity, h) * dx.gauss
        lost += 2 * h * model.drag[0] * self.kinetic(self.halfway, self.passed) * dx.nodes
        others = {
            "momentum": self.momentum_before() * dx.nodes,
            "kinetic": self.kinetic_before() * dx.nodes,
            "strain": inertia.strain_energy(self.after, section) * dx.gauss,
            "dissipated": lost,
        }
        return compile_motion(model, residual, acting, self.derivative, self.fields(n, m), others, of_step, working)


def compile_momentum(step, stress=inertia.averaged_stress):
    """The `MotionForms` of the momentum-conserving scheme; `stress` gives the virtual work of the stress."""
    model, dx, h = step.model, step.dx, step.model.h
    residual = 1 / h * step.momentum_after() * dx.nodes
    besides = step.of_moving_axis()
    if besides is not None:
        residual += besides * dx.nodes

    def of_stress(test):
        return stress(step.before, step.after, step.middle, step.section, step.viscosity, h, test)

    residual += of_stress(step.test) * dx.gauss
    # drag: -drag times the momenta at the middle of the step, with the velocities (U - U0)/h
    residual += model.drag[0] * step.momentum(step.halfway, step.passed) * dx.nodes
    residual += step.constraint()
    acting = step.actions(step.halfway_point)
    return step.compiled(residual, acting, None, virtual_work_of_step(model, of_stress, step.halfway_point))


def virtual_work_of_step(model, stress, point_at):
    """Coefficients of the virtual work of a step per unit length: that of the stress minus that of actions along rods.

    Args:
        stress: function from a `VirtualMotion` to the virtual work of the stress; point_at: see `action_work`.

    Returns:
        UFL (12,), the coefficients of phi_r, phi, phi_r' and phi' at the Gauss points; and (6,), those of phi_r and phi
        for the actions integrated at the nodes, None without such. (None, None) for a scene without clamps.
    """
    if not model.signature.connections.clamped:
        return None, None
    factors = {"load": model.load_factor, "permanent": model.permanent_factor, "full": 1}
    acting = [(term, factors[term.kind.scaled], point_at(term.kind.place, term.rest, term.frame))
              for term in model.actions.terms]  # fmt: skip

    def less(test, place):
        return sum(factor * term.work(point, test) for term, factor, point in acting if term.kind.place == place)

    tests = [VirtualMotion(*(axis if k == i else NONE for k in range(4))) for i in range(4) for axis in AXES]
    at_gauss = ufl.as_vector([stress(test) - less(test, "line") for test in tests])
    if not any(term.kind.place == "node" for term, _, _ in acting):
        return at_gauss, None
    return at_gauss, ufl.as_vector([-less(test, "node") for test in tests[:6]])


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

    def point_of(self, w, w_s, w_t, rest, frame):
        """See `StepForms`."""
        (_, q), (r_t, q_t) = parts_of(w), parts_of(w_t)
        return eq.point_of(w, w_s, rest=rest, frame=frame, r_t=r_t, omega=small_rotation(q_t, q))

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


def compile_motion(model, residual, acting, derivative, fields, others, of_step, working=None, *, turned=False):
    """`MotionForms` of UFL forms; see `compile_parts`.

    Args:
        residual: without actions; acting: the `ActionWork` in it; derivative: see `compile_all`.
        others: {name in `MotionForms`: form}.
        working: the `ActionWork` in the energy balance, where it is another one.
        turned: whether the live part of `working` has a tangent of its own.
    """
    booked = {} if working is None else {live.number: _booked(live, derivative, turned) for live in working.live}
    lives = {live.number: live_parts(live, derivative, ()) for live in acting.live}
    core = [residual, derivative(residual)]
    steady, of_others, of_lives = compile_parts(
        model, core, lives, acting, fields, others=list(others.values()), of_terms=booked
    )
    live, live_tangent = (tuple(pair[i] for pair in of_lives if pair[i]) for i in range(2))
    step, step_at_nodes = compat.expressions(model.mesh, zip(of_step, (steady.gauss, model.nodes), strict=True))
    return MotionForms(
        **vars(steady), **dict(zip(others, of_others, strict=True)), of_step=step, of_step_at_nodes=step_at_nodes,
        live=steady.residual[1:] if working is None else live, live_tangent=live_tangent,
    )  # fmt: skip


def _booked(live, derivative, turned):
    """[form, its derivative or None] of a `Live` of the energy balance."""
    change = nonzero(derivative(live.form)) if turned else None
    return [-live.factor * live.form, None if change is None else -live.factor * change]
