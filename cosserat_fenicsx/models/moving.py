"""Models with inertia, between the two ends of a time step: in space, and for scenes that move in a plane."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.forms import inertia
from cosserat_fenicsx.forms import planar as eq
from cosserat_fenicsx.forms.equilibrium import VirtualMotion
from cosserat_fenicsx.forms.point import AXES, NONE
from cosserat_fenicsx.forms.spatial import parts_of
from cosserat_fenicsx.models.action_terms import Delays
from cosserat_fenicsx.models.base import Scales
from cosserat_fenicsx.models.compiled import (
    CompiledForms,
    acting_at,
    action_work,
    compile_parts,
    derivative_in,
    live_parts,
    measures,
    nonzero,
    section_of,
    shared,
    together,
)
from cosserat_fenicsx.models.connections import ties_of
from cosserat_fenicsx.models.spatial import Damped, PlanarModel, SpatialModel
from cosserat_fenicsx.models.rod_data import (
    check_inertia,
    element_function,
    law_of,
    nodal_inertia,
)
from cosserat_fenicsx.numerics import cross, spun
from cosserat_fenicsx.scene.action import describe, is_axial
from cosserat_fenicsx.scene.signals import signals_of


@dataclass(frozen=True)
class MotionForms(CompiledForms):
    """Forms that a time stepper assembles and evaluates; the residual belongs to a step from `start` to `state`.

    Attributes:
        residual: without the dead loads, and without the momenta at the start of the step, over h.
        momentum: momenta of the state and its velocity times the test functions.
        live: minus the virtual work of state-dependent actions at the middle of the step, factors included; a tuple.
        live_tangent: its derivative, where this is not part of the tangent; a tuple.
        kinetic, strain: energies of the state; dissipated: energy dissipated in the step.
        of_step, of_step_at_nodes: the two results of `virtual_work_of_step`, compiled, or None.
        strain_change, strain_rate: of the six strains over the step, and their rates; or None.
    """

    momentum: object = None
    live: tuple = ()
    kinetic: object = None
    strain: object = None
    dissipated: object = None
    live_tangent: tuple = ()
    of_step: object = None
    of_step_at_nodes: object = None
    strain_change: object = None
    strain_rate: object = None


class StepForms:
    """The UFL expressions of a time step. Subclasses define what depends on the unknowns of a model.

    Attributes:
        state, start, velocity: the Functions; nodal, nodal0, rates: their aliases for rules other than Gauss's.
        halfway, passed: the average of both ends of the step, and their difference over h, at the nodes.
        before, after, middle: `Motion`s; section, viscosity: data, and the law of the strain rates.
        phi, test: test functions of the unknowns, and their `VirtualMotion`.
        derivative: differentiates a form in the direction of the trial function.
    """

    def __init__(self, model):
        self.model, self.dx = model, measures(model)
        # where the Gauss rule has one point, the other rules need other coefficients (compat.alias)
        named = compat.alias if model.signature.degree == 1 else (lambda function: function)
        self.state, self.start, self.velocity = U, U0, V = model.state, model.start, model.velocity
        self.nodal, self.nodal0, self.rates = nodal, nodal0, _ = named(U), named(U0), named(V)
        self.halfway, self.passed = (nodal + nodal0) / 2, (nodal - nodal0) / model.h
        self.section, self.viscosity = section_of(model), law_of(*model.viscosity)
        self.before, self.after, self.middle = (model.motion_of(w, w) for w in (U0, U, (U + U0) / 2))
        self.phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
        self.test = model.tests_of(self.phi, self.after)
        self.derivative = derivative_in(trial, *dict.fromkeys((U, nodal)))

    # -- for subclasses to define ------------------------------------------------------------------------------------

    def momentum(self, w, w_t):
        """Momenta per unit length of unknowns and their rates, times the test functions."""
        raise NotImplementedError

    def kinetic(self, w, w_t):
        """Kinetic energy per length."""
        raise NotImplementedError

    def strain(self):
        """Strain energy per length of the state."""
        return inertia.strain_energy(self.after, self.section)

    def viscous_loss(self):
        """Energy per length that the viscous law dissipates in the step."""
        return inertia.viscous_loss(self.before, self.after, self.section, self.viscosity, self.model.h)

    def kinetic_passed(self):
        """`kinetic` halfway, with the mean velocities of the step."""
        return self.kinetic(self.halfway, self.passed)

    def momentum_before(self):
        """`momentum` at the state with `velocity`, before it is the start of a step."""
        return self.momentum(self.nodal, self.rates)

    def kinetic_before(self):
        """`kinetic` in the same way."""
        return self.kinetic(self.nodal, self.rates)

    def momentum_after(self):
        """`momentum` at the end of the step, by the trapezoidal rule."""
        return self.momentum(self.nodal, 2 * self.passed - self.rates)

    def of_moving_axis(self):
        """Terms of the balances per length in addition to the rates of `momentum`, or None."""
        return

    # -- forms -------------------------------------------------------------------------------------------------------

    def halfway_point(self, place, rest, frame):
        """The `Point` of the average of both ends of the step, with the average velocity."""
        w, w0 = (self.state, self.start) if place == "line" else (self.nodal, self.nodal0)
        return self.model.point_of((w + w0) / 2, (w - w0) / self.model.h, rest=rest, frame=frame)

    def actions(self, point_at):
        """The `ActionWork` at the points that `point_at` gives."""
        return action_work(self.model, self.dx, self.test, point_at, {self.state, self.nodal}, self.end_point)

    def end_point(self, place, rest, frame):
        """The `Point` at the end of the step."""
        w, w0 = (self.state, self.start) if place == "line" else (self.nodal, self.nodal0)
        return self.model.point_of(w, (w - w0) / self.model.h, rest=rest, frame=frame)

    def constraint(self):
        """The model's constraint in the residual, or 0."""
        held = self.model.constraint(self.model.motion_of(self.state, self.nodal), self.test, self.nodal, self.phi)
        return 0 if held is None else held * self.dx.nodes

    def compiled(self, residual, acting, working, of_step, *, turned=False):
        """`MotionForms` of a residual without actions; acting: `ActionWork` in the residual; working: in the energy
        balance, at the middle of the step, or None for the same; of_step: see `virtual_work_of_step`; turned: whether
        the live part of `working` has a tangent of its own."""
        model, dx, derivative = self.model, self.dx, self.derivative
        n, m = inertia.contact(
            self.after, self.section, self.viscosity, lambda a: ufl.derivative(a, self.state, self.velocity)
        )
        by_drag = 2 * model.h * model.drag[0] * self.kinetic_passed() * dx.nodes
        once = {
            "momentum": self.momentum_before() * dx.nodes,
            "kinetic": self.kinetic_before() * dx.nodes,
            "strain": self.strain() * dx.gauss,
            "dissipated": self.viscous_loss() * dx.gauss + by_drag,
        }
        terms = {live.number: live_parts(live, derivative) for live in acting.live}
        for live in () if working is None else working.live:  # after the parts of the residual
            change = nonzero(derivative(live.form)) if turned else None
            terms.setdefault(live.number, {}).update(
                live=-live.factor * live.form, live_tangent=None if change is None else -live.factor * change
            )
        core = {"residual": residual, "tangent": derivative(residual), **once}
        found = compile_parts(
            model, core, terms, model.fields_of(n, m, self.after.r_s), dead=acting.dead, permanent=acting.permanent
        )
        found |= {name: found[name][0] for name in once}
        if working is None:
            found["live"] = found["residual"][1:]
        pairs = list(zip(of_step, (found["gauss"], model.nodes), strict=True))
        _, (step, step_at_nodes) = together(model, [], pairs)
        return MotionForms(**found, of_step=step, of_step_at_nodes=step_at_nodes)


def compile_momentum(step, stress=inertia.averaged_stress):
    """The `MotionForms` of the momentum-conserving scheme; `stress` gives the virtual work of the stress."""
    model, dx, h = step.model, step.dx, step.model.h
    residual = 1 / h * step.momentum_after() * dx.nodes
    if (of_axis := step.of_moving_axis()) is not None:
        residual += of_axis * dx.nodes

    def of_stress(test):
        return stress(step.before, step.after, step.middle, step.section, step.viscosity, h, test)

    residual += of_stress(step.test) * dx.gauss
    # drag: -drag times the momenta at the middle of the step, with the velocities (U - U0)/h
    residual += model.drag[0] * step.momentum(step.halfway, step.passed) * dx.nodes
    residual += step.constraint()
    acting = step.actions(step.halfway_point)
    return step.compiled(residual, acting, None, virtual_work_of_step(model, of_stress, step.halfway_point))


def virtual_work_of_step(model, stress, point_at):
    """Coefficients of the virtual work of a step per unit length, of the stress (a function of a `VirtualMotion`),
    minus the actions along rods: UFL (12,), of phi_r, phi, phi_r' and phi' at the Gauss points; and (6,), of phi_r and
    phi for the actions integrated at the nodes, None without such. (None, None) for a scene without clamps."""
    if not model.signature.connections.clamped:
        return None, None
    acting = list(acting_at(model, point_at))

    def less(test, place):
        return sum(factor * term.work(point, test) for _, term, factor, point in acting if term.kind.place == place)

    tests = [VirtualMotion(*(axis if k == i else NONE for k in range(4))) for i in range(4) for axis in AXES]
    at_gauss = ufl.as_vector([stress(test) - less(test, "line") for test in tests])
    if not any(term.kind.place == "node" for _, term, _, _ in acting):
        return at_gauss, None
    return at_gauss, ufl.as_vector([-less(test, "node") for test in tests[:6]])


class SpatialStep(StepForms):
    """See `StepForms`; body: the `Inertia` of a section."""

    def __init__(self, model):
        I = model.inertia
        I_R = ufl.as_matrix([[I[0], I[1], I[2]], [I[1], I[3], I[4]], [I[2], I[4], I[5]]])
        self.body = inertia.Inertia(model.mass[0], I_R, model.offset, model.lateral)
        super().__init__(model)

    def momentum(self, w, w_t, z_t=None):
        """See `StepForms`; z_t: rate of the mass centre about the axis, by default from the rates of q."""
        (_, q), (r_t, q_t), body = parts_of(w), parts_of(w_t), self.body
        kappa = inertia.angular_momentum(q, q_t, body)
        z_t = inertia.arm_rate(q, q_t, body) if z_t is None else z_t
        return inertia.momentum(r_t, kappa, body, self.test, inertia.arm(q, body), z_t)

    def kinetic(self, w, w_t, z_t=None):
        (_, q), (r_t, q_t), body = parts_of(w), parts_of(w_t), self.body
        z_t = inertia.arm_rate(q, q_t, body) if z_t is None else z_t
        return inertia.kinetic_energy(r_t, inertia.angular_velocity(q, q_t), body, z_t)


class Moving(Damped):
    """Mixin that adds inertia to a `RodModel`; it must come first among the bases.

    Inertia is integrated with the nodes as points, as |q| = 1 is: the order of convergence is that of the elements,
    every nodal q is a unit quaternion, and the mass matrix is block diagonal.

    Attributes:
        state: unknowns of the nodes at the end of a step; start, velocity: unknowns and their rates at its beginning.
        h: the Constant h, the length of the step.
        time: unit of time, s.
        offset: Function, the mass centre from the axis, along the inertial axes at rest; None in a scene without
            eccentric rods.
        lateral: Function, see `rod_data.NodalInertia`; None in a scene without such masses.
        delays: the `Delays` of its actions.
    """

    variations = ()
    #: the `StepForms` of the model, and the function that compiles them
    step_forms, scheme = None, staticmethod(compile_momentum)
    #: independent components of a section's rotational inertia
    inertia_size = 0

    def _compile(self, spaces):
        self._motion_fields()
        return shared(self, [self.space], lambda: self.scheme(self.step_forms(self)))

    def _motion_fields(self):
        """Make the Functions that the forms need in addition to those of a `RodModel`."""
        mesh = self.mesh
        self.start, self.velocity = fem.Function(self.space), fem.Function(self.space)
        # dolfinx makes a new array at every access to `x.array`
        self._arrays = self.state.x.array, self.start.x.array, self.velocity.x.array
        self.h = fem.Constant(mesh, np.float64(1))
        at_nodes = partial(element_function, mesh, self.signature.degree)
        self.mass, self.drag, self.inertia = (at_nodes(size) for size in (1, 1, self.inertia_size))
        self.offset = at_nodes(3) if self.signature.eccentric else None
        self.lateral = at_nodes(self.moves) if self.signature.lateral else None
        self._viscous_fields()

    def load(self, scene, layout):
        """See `RodModel`; mass and inertia too. A SceneError for a rod without these."""
        check_inertia(scene)
        scales, heaviest = Scales.of(scene), max(float(rod.profile.range[1].mass) for rod in scene.rods)
        self.time = math.sqrt(heaviest * scales.length**2 / scales.force)
        super().load(scene, layout)
        self._origins = np.concatenate([
            np.tile(scene.origin(rod) / scales.length, (cells * self.signature.degree + 1, 1))
            for rod, cells in zip(scene.rods, layout.counts, strict=True)
        ])  # fmt: skip
        here = nodal_inertia(scene, layout, self.nodes)
        drags = [rod.damping.drag * self.time if rod.damping else 0.0 for rod in scene.rods]
        fill = partial(self.rods.fill, at_nodes=True)
        fill(self.mass, here.mass[..., None] / heaviest)
        inertia = self._section_inertia(here.J / (heaviest * scales.length**2), here.frames)
        if self.offset is not None:
            fill(self.offset, here.offset / scales.length)
            inertia = inertia + six_of(here.apart / (heaviest * scales.length**2))
        fill(self.inertia, inertia)
        if self.lateral is not None:
            fill(self.lateral, here.lateral / math.sqrt(heaviest) @ self.axes[: self.moves].T)
        fill(self.drag, np.repeat(drags, layout.counts)[:, None, None] * np.ones((1, len(self.nodes), 1)))
        self.start.x.array[:] = self.state.x.array
        self.velocity.x.array[:] = 0.0
        self._damp()
        self.delays = Delays(self)

    # -- for subclasses to define ------------------------------------------------------------------------------------

    def _section_inertia(self, J, frames):
        """(elements, p + 1, inertia_size) from Jrho about d_1, d_2, d_3 (.., 3) and the frames at rest (.., 3, 3)."""
        raise NotImplementedError

    def set_velocity(self, linear, angular):
        """Set velocities and angular velocities (N, 3) of all nodes, dimensionless, inertial, scene's order."""
        raise NotImplementedError

    def rates(self):
        """A function from the nodes' unknowns and their rates to velocities (.., 6), inertial, dimensionless."""
        raise NotImplementedError

    def _momenta_of(self, p):
        """Linear and angular momenta, (n, 3) each, inertial, from assembled rows (n, components) of nodes."""
        raise NotImplementedError

    # -- for time steppers and results -------------------------------------------------------------------------------

    def slot_of(self, station):
        """The scene's number of the node at a station."""
        return self.slot(self.layout.vertex(self.scene, station))

    @property
    def rate_arrays(self):
        """The arrays of the rates of the state."""
        return (self._arrays[2],)

    @property
    def ends(self):
        """The Functions of a step that forms depend on; only the first, the state, changes within it."""
        return self.state, self.start, self.velocity

    def accept(self, h):
        """Update the rates to those of `state` after a step of length h, by the trapezoidal rule."""
        now, before, rates = self._arrays
        rates[:] = 2 / h * (now - before) - rates

    def loads_at(self, t):
        """Fill the forms' Functions with the loads at the time t (s); returns whether they have changed."""
        return self.actions.at(t)

    def ties_at(self, t):
        """The `Ties` at the time t (s)."""
        driven = any(signals_of(support) for support in self.scene.supports)
        return self.ties.with_numbers_of(ties_of(self.scene, t)) if driven else self.ties

    def largest_of(self, change, turns):
        """Largest displacement (lengths), or rotation (rad) times `turns`, in a change of the state, over all ranks."""
        moved, turned = self._largest_in(change[self.nodal])
        return max(moved, turns * turned)

    def turned_over(self):
        """Whether a node of any rank rotated by half a turn or more in the step: the solution is then spurious."""
        return False

    def snapshot_of_rates(self):
        """(N, components) `velocity` at the nodes, in the scene's order, on all ranks, dimensionless."""
        return self._gather_nodes(self._arrays[2][self.nodal[: self.owned_nodes]])

    def momenta(self, tested):
        """Linear (3,) and angular momentum (3,) about the inertial origin, over all ranks, dimensionless; tested:
        (local degrees of freedom,) the assembled `forms.momentum`, contributions of this rank's elements."""
        linear, angular = self._momenta_of(tested[self.nodal])
        place = self.positions() + self._origins[self.slots]
        both = np.concatenate([linear.sum(axis=0), (cross(place, linear) + angular).sum(axis=0)])
        both = self.comm.allreduce(both) if self.comm.size > 1 else both
        return both[:3], both[3:]


_OF_Q = np.repeat([0.0, 1.0], [3, 4])


class MovingSpatial(Moving, SpatialModel):
    """The spatial model with inertia."""

    step_forms, inertia_size = SpatialStep, 6

    def _section_inertia(self, J, frames):
        return six_of(np.einsum("...ij,...j,...kj->...ik", frames, J, frames))

    def turned_over(self):
        """See `Moving`; a q of the other sign also satisfies |q| = 1."""
        products = (self._arrays[0] * self._arrays[1]).reshape(-1, 7) @ _OF_Q  # node by node
        here = bool((products <= 0).any())
        return self.comm.allreduce(here, op=MPI.LOR) if self.comm.size > 1 else here

    def set_velocity(self, linear, angular):
        slots, nodal, x = self.slots, self.nodal, self.velocity.x.array
        x[nodal[:, :3]] = linear[slots]
        x[nodal[:, 3:]] = spun(self.state.x.array[nodal[:, 3:]], angular[slots])

    def rates(self):
        return lambda nodal, rates: np.concatenate([rates[..., :3], turned_by(rates[..., 3:], nodal[..., 3:])], axis=-1)

    def _momenta_of(self, p):
        return p[:, :3], p[:, 4:]


def six_of(I):
    """(.., 6) components of symmetric matrices (.., 3, 3), row by row from the diagonal on."""
    return I[..., [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]


def turned_by(dq, q):
    """(.., 3) the inertial rotations 2 vec(dq conj(q))/|q|^2 of changes dq of q, (.., 4) each."""
    (a, b, c, d), (da, db, dc, dd) = ([x[..., i] for i in range(4)] for x in (q, dq))
    factor, turned = 2 / np.einsum("...i,...i->...", q, q), np.empty((*np.shape(a), 3))
    turned[..., 0] = factor * (a * db - b * da - d * dc + c * dd)
    turned[..., 1] = factor * (a * dc - c * da + d * db - b * dd)
    turned[..., 2] = factor * (a * dd - d * da - c * db + b * dc)
    return turned


_OFF = 1e-9


class PlanarStep(StepForms):
    """See `StepForms`."""

    def momentum(self, w, w_t):
        test, mass, J = self.test, self.model.mass[0], self.model.inertia[0]
        both = mass * (w_t[0] * test.phi_r[0] + w_t[1] * test.phi_r[1]) + J * w_t[2] * test.phi[2]
        return both + _lateral(self.model, w_t, test.phi_r)

    def kinetic(self, w, w_t):
        both = self.model.mass[0] * (w_t[0] ** 2 + w_t[1] ** 2) + self.model.inertia[0] * w_t[2] ** 2
        return (both + _lateral(self.model, w_t, w_t)) / 2


def _lateral(model, *pair):
    """`inertia.lateral` in the plane."""
    direction = None if model.lateral is None else eq.in_plane(model.lateral)
    return inertia.lateral(direction, *map(eq.in_plane, pair))


class MovingPlanar(Moving, PlanarModel):
    """The planar model with inertia."""

    step_forms, inertia_size = PlanarStep, 1

    def _section_inertia(self, J, frames):
        along = np.einsum("...ik,i->...k", frames, self.axes[2])
        return np.einsum("...k,...k->...", along**2, J)[..., None]

    def set_velocity(self, linear, angular):
        e1, e2, normal = self.axes
        off = max(np.abs(linear @ normal).max(), np.abs(angular @ e1).max(), np.abs(angular @ e2).max())
        if off > _OFF * max(np.abs(linear).max(), np.abs(angular).max(), 1e-300):
            raise SceneError("Scene.velocities leave the plane of the scene: expected model = 'spatial' in simulate")
        x = self.velocity.x.array
        x[self.nodal[:, :2]] = (linear @ self.axes[:2].T)[self.slots]
        x[self.nodal[:, 2]] = (angular @ normal)[self.slots]

    def unknowns_of(self, rq):
        off = np.abs((rq[:, :3] - self.reference) @ self.axes[2]).max(), np.abs(rq[:, 4:] @ self.axes[:2].T).max()
        if max(off) > _OFF:
            raise SceneError(
                "simulate.start lies outside the plane of the scene: expected model = 'spatial' in simulate"
            )
        return super().unknowns_of(rq)

    def loads_at(self, t):
        """See `Moving`; a SceneError for a load that leaves the plane at this time."""
        if not super().loads_at(t):
            return False
        for load, rod in (pair for term in self.actions.terms for pair in term.acting):
            for datum in load.data(rod, np.array([0.0, rod.length])):
                if datum.size != 3:
                    continue
                given = datum.value.reshape(-1, 3) @ self.axes.T
                off = given[:, :2] if is_axial(datum.unit) else given[:, 2]
                if np.abs(off).max() > _OFF * np.abs(given).max():
                    self._refuse(describe(load), t)
        return True

    def ties_at(self, t):
        """See `Moving`; a SceneError for a prescribed motion that leaves the plane at this time."""
        across = self.axes[2], self.axes[:2]
        for support in self.scene.supports:
            for field, signal in signals_of(support).items():
                given = np.array(signal(t))
                off = across[field == "rotation"] @ given
                if np.abs(off).max() > _OFF * np.abs(given).max():
                    self._refuse(f"the {field} of the {type(support).__name__} at {support.station}", t)
        return super().ties_at(t)

    def _refuse(self, what, t):
        raise SceneError(f"{what} leaves the plane at t = {t:g} s: expected model = 'spatial' in simulate")

    def rates(self):
        axes = self.axes
        return lambda nodal, rates: np.concatenate([rates[..., :2] @ axes[:2], rates[..., 2:] * axes[2]], axis=-1)

    def _momenta_of(self, p):
        return p[:, :2] @ self.axes[:2], p[:, 2:] * self.axes[2]
