"""Schemes in time: one step from t to t + h. A new scheme is a class, here or elsewhere, and its forms."""

from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.algebra.equations import MATRICES, RESIDUAL
from cosserat_fenicsx.algebra.newton import Solved
from cosserat_fenicsx.dynamics.step_problem import MovingTies, StepProblem
from cosserat_fenicsx.dynamics.stepper import Stepper
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import small_rotations


class Momentum(Stepper):
    """The default scheme: averaged stress, exact balances of linear and of angular momentum (forms/inertia.py)."""

    forms, problem_class = "momentum", StepProblem


class TurnedStepProblem(StepProblem):
    """See `StepProblem`: the rows of q of every node are transformed to those of a rotation, and |q|^2 = 1 is added."""

    changes, takes_momentum = RESIDUAL | MATRICES, False

    def __init__(self, model):
        super().__init__(model)
        self._q_of_elements = model.cell_dofs.reshape(len(model.cell_dofs), model.cell_dofs.shape[1] // 7, 7)[:, :, 3:]
        self._of_q = np.zeros(len(self._state))
        # a node's own terms are shared among all elements that meet there
        meeting = np.zeros(len(self._state))
        np.add.at(meeting, self._q_of_elements.ravel(), 1.0)
        self.numbering.add_up(meeting, self._vector)
        self.numbering.to_local(self._vector, meeting)
        self._share = 1 / np.maximum(1.0, meeting[self._q_of_elements[..., :1]])

    def _pack(self):
        super()._pack()
        self._live_tangent = self._pack_form(self.model.forms.live_tangent)

    def _of_nodes(self, x):
        """(nodes, 4) q of the free nodes of this rank."""
        nodes = self.numbering.nodes
        return x[: 7 * nodes].reshape(-1, 7)[:, 3:]

    def begin_step(self, t, h):
        self._q_start = self._of_nodes(self.x.array_r).copy()
        super().begin_step(t, h)

    def _change_residual(self, x, b):
        q, rows = self._of_nodes(x), self._of_nodes(b)
        self._vector_of_x.array_w[:] = b
        self.numbering.to_local(self._vector_of_x, self._of_q)
        of_q = rows.copy()
        rows[:, 1:] = np.einsum("nij,nj->ni", _turning((self._q_start + q) / 2), of_q)
        rows[:, 0] = np.einsum("ni,ni->n", q, q) - 1
        if self._live:
            self._assemble(self._live, self._vector)
            b += self._vector.array_r
        super()._change_residual(x, b)

    def _change_matrices(self):
        places, share = self._q_of_elements, self._share
        q, start = self._state[places], self._start[places]  # (elements, nodes, 4)
        elements, nodes, width = *places.shape[:2], 7 * places.shape[1]
        rows = self.matrices.reshape(elements, nodes, 7, width)
        turned = _turning(((start + q) / 2).reshape(-1, 4)).reshape(elements, nodes, 3, 4)
        rows[:, :, 4:] = turned @ rows[:, :, 3:]
        rows[:, :, 3] = 0.0
        own = _turning_of(self._of_q[places].reshape(-1, 4)).reshape(elements, nodes, 3, 4)
        for k in range(nodes):
            columns = slice(7 * k + 3, 7 * k + 7)
            rows[:, k, 3, columns] += 2 * q[:, k] * share[:, k]
            rows[:, k, 4:, columns] += own[:, k] * share[:, k, :, None]
        if self._live_tangent:
            self.matrices += self._live_tangent.matrices()


# (12, 4): (3, 4) matrices T with T_ij = (e_i q)_j/2 for every component of q, with the product e_i q of quaternions.
_TURNING = small_rotations(np.eye(4)).transpose(1, 2, 0).reshape(12, 4) / 4


def _turning(q):
    """(nodes, 3, 4): maps residuals of q to those of a rotation: the transpose of phi -> phi q/2."""
    return (q @ _TURNING.T).reshape(-1, 3, 4)


def _turning_of(R):
    """(nodes, 3, 4): the derivative of `_turning`((q_0 + q)/2) R with respect to q, for residuals R (nodes, 4) of q."""
    return np.einsum("ijk,nj->nik", _TURNING.reshape(3, 4, 4), R) / 2


class Energy(Stepper):
    """The scheme with exact energy and linear momentum; angular momentum to second order (forms/energy.py).

    The test functions of the form are variations of (r, q). At every node the variation of q is that by a small
    rotation phi, delta q = phi q_m/2 with q_m the mean of q over the step, which is perpendicular to q_m. So three
    equations belong to the rotation, |q| = 1 is the fourth equation of the node and needs no multiplier, and loads and
    supports act as in the other schemes.
    """

    forms, problem_class = "energy", TurnedStepProblem
    error_ratio = 4.0  # the error is larger since averaged directors are shorter than one


_GAMMA = 1 / (2 - 2 ** (1 / 3))


class TripleJump(Momentum):
    """Fourth order by three steps of the default scheme, one of them back in time.

    A symmetric scheme of order 2 gains two orders by steps gamma h, (1 - 2 gamma) h, gamma h with gamma = 1/(2 -
    2^(1/3)) (Yoshida, Phys. Lett. A 150 (1990) 262, doi:10.1016/0375-9601(90)90092-3). Momenta stay exact. Loads are
    evaluated in the middle of each of the three, which lies inside the whole step; prescribed motions are also
    evaluated up to about a third of a step before its start and after its end.
    """

    order, adapts = 4, False

    def begin(self):
        """See `Stepper`. A SceneError for a rod with damping, which would make the motion grow without bound back in
        time; an action with memory; or a wall, a contact, a bit or a tendon whose law is not smooth."""
        model = self.problem.model
        for found, expected in (
            (model.damped, ": expected rods without damping"),
            (model.actions.memory or np.isfinite(model.delays.longest), ": expected actions without memory"),
            (self.problem.touching, ", which needs smooth motions: expected no walls, RodContact, bits, axial="),
        ):
            if found:
                raise SceneError(f"scheme = 'triple-jump' steps back in time{expected}, or another scheme")
        super().begin()

    def step(self, t, h):
        iterations = 0
        for done, share in enumerate((_GAMMA, 1 - 2 * _GAMMA, _GAMMA)):
            solved = super().step(t, share * h)
            t, iterations = t + share * h, iterations + solved.iterations
            if not solved.converged:
                for _ in range(done):
                    self.undo()
                return Solved(False, iterations, solved.reason)
        return Solved(True, iterations, "converged")


_BEFORE_END = 1e-6  # loads at the end of a step are evaluated this share of the step earlier, before a jump there
_TRIAL_STEP = 0.1  # length of the trial step that gives initial accelerations, over the first step's


class Rule(NamedTuple):
    """The coefficients of Chung & Hulbert."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float

    @classmethod
    def of(cls, rho_inf):
        alpha_m, alpha_f = (2 * rho_inf - 1) / (rho_inf + 1), rho_inf / (rho_inf + 1)
        return cls(alpha_m, alpha_f, (1 + alpha_f - alpha_m) ** 2 / 4, 0.5 + alpha_f - alpha_m)

    def ahead(self, h):
        """(3, 4): v, a and s = (b - a)/h at the end of a step as combinations of D, v, a and s at its start, for
        `Collocated.take_scheme`; s stays valid when h changes."""
        D, v0, a0, s0 = np.eye(4)
        b0 = a0 + h * s0
        b1 = (D - h * v0) / (self.beta * h**2) - (0.5 / self.beta - 1) * b0
        v1 = v0 + h * ((1 - self.gamma) * b0 + self.gamma * b1)
        a1 = ((1 - self.alpha_m) * b1 + self.alpha_m * b0 - self.alpha_f * a0) / (1 - self.alpha_f)
        return np.array([v1, a1, (b1 - a1) / h])


# The coefficients of a step that does not depend on the accelerations before it.
_TRIAL_RULE = Rule(0.0, 0.0, 0.5, 1.0)


class EndTies(MovingTies):
    """Constraints of supports and joints whose reactions act at the end of a step, where the constraints hold."""

    share = 1.0

    def begin(self, ties):
        super().begin(ties)
        self._shift[:] = 0.0
        self._reactions_before = self.multipliers.copy()

    def forget(self):
        """The current step has failed: restore the reactions before it."""
        self.multipliers[:] = self._reactions_before

    def shift(self, values):
        """Require these values of the constraints instead of zero in this step; see `values`."""
        self._shift[:] = values

    def values(self, ties, load_factor):
        """Values of the constraints at the current state, for `ties` of another time."""
        return ties.evaluate(self.model.tied_motion(self.nodal), load_factor)[0]

    def _acted(self):
        return (self._reactions_before + self.multipliers) / 2


class CollocationProblem(StepProblem):
    """See `StepProblem`: eq. (1) at the end of a step, with accelerations; rule: the `Rule` of the next steps."""

    ties_class, acting_share, loads_share, takes_momentum = EndTies, 1.0, 1 - _BEFORE_END, False

    def begin_step(self, t, h):
        self._start[:] = self._state
        self.model.take_scheme(self.rule.ahead(h / self.model.time))
        super().begin_step(t, h)

    def work(self):
        """See `StepProblem`: by loads at mid-step, and the mean of the reactions at both ends."""
        self._take_loads(self._middle)
        own = self.tensions and self.tensions.halfway(self._middle)
        done = super().work()
        if self.tensions:
            self.tensions.put(own)
        return done

    def clamp_forces(self):
        """See `StepProblem`: at the end of the step."""
        if self.model.clamps.count:
            self.take_where_it_acts()
        return super().clamp_forces()

    def free_velocities(self, t, h):
        """Let supports and joints keep the current velocities in the step from t to t + h, s: the constraints c at the
        end get the value c(t) + h c'(t), by three points of uniform motion, instead of 0, since the correction of small
        violations by the velocities would take large accelerations."""
        if not self.ties:
            return
        velocity, values = self.model.velocity.x.array, []
        for share in (0.0, 0.5, 1.0):
            self.guess(self._start + share * self.h * velocity)
            self.set_state(self.x)
            values.append(self.ties.values(self.model.ties_at(t + share * h), self.load_factor))
        self.ties.shift(4 * values[1] - values[2] - 2 * values[0])


class GeneralisedAlpha(Stepper):
    """Dissipation of unresolved modes: the generalised-alpha scheme, order 2, on the rotation group.

    Eq. (1) holds at the end of every step; velocities and positions are integrated by an auxiliary acceleration b
    beside the true one, a (Arnold & Bruels, Multibody Syst. Dyn. 18 (2007) 185, doi:10.1007/s11044-007-9084-0, and with
    rotation vectors as increments Bruels & Cardona, J. Comput. Nonlinear Dyn. 5 (2010) 031002, doi:10.1115/1.4001370):

        (1 - alpha_m) b_1 + alpha_m b_0 = (1 - alpha_f) a_1 + alpha_f a_0
        D = h v_0 + h^2 ((1/2 - beta) b_0 + beta b_1),   v_1 = v_0 + h ((1 - gamma) b_0 + gamma b_1)

    where D is r_1 - r_0 and the rotation vector from q_0 to q_1. The coefficients are those of Chung & Hulbert (J.
    Appl. Mech. 60 (1993) 371): vibrations much faster than the steps are multiplied by rho_inf a step. With rho_inf = 1
    it is the trapezoidal rule.

    `dissipated` excludes numerical dissipation, which the energy balance shows.
    """

    forms, problem_class, rho_inf, kinks_persist = "collocation", CollocationProblem, 0.8, False
    impulse_error = 1 / 12  # loads are evaluated at the ends of steps

    def begin(self):
        super().begin()
        self.problem.model.begin_rates()

    def jump(self):
        super().jump()
        self.kink()

    def kink(self):
        """See `Stepper`: b lags behind a, and momenta would vary for some steps after the end of a load."""
        self._accelerations_known = False

    def step(self, t, h):
        iterations = 0
        if self.problem.ties and self._h is not None and abs(h - self._h) > 1e-9 * abs(h):
            self._settle(t)
        if not self._accelerations_known:
            found = self._accelerate(t, _TRIAL_STEP * h)
            if not found.converged:
                return found
            iterations = found.iterations
        self.problem.rule = Rule.of(self.rho_inf)
        solved = super().step(t, h)
        if not solved.converged and self.problem.ties:
            self.problem.ties.forget()
        return Solved(solved.converged, iterations + solved.iterations, solved.reason)

    def _settle(self, t):
        """Before the step changes, correct the O(h^2) errors of velocities at ties, which take large accelerations."""
        self.drive(t)
        self._start[:] = self._state
        self.problem.model.follow_velocities()
        self.kink()

    def _accelerate(self, t, h):
        """Find accelerations and reactions at the time t by a trial step of length h, which is undone."""
        problem, model = self.problem, self.problem.model
        problem.rule, problem.fresh, self._h = _TRIAL_RULE, True, None
        problem.begin_step(t, h)
        problem.free_velocities(t, h)
        solved = self._newton.solve([self._start + problem.h * self._velocity])
        self._accelerations_known = solved.converged
        if solved.converged:
            model.take_accelerations()
        elif problem.ties:
            problem.ties.forget()
        self._state[:] = self._start
        problem.begin_again()
        return solved

    def error(self, early=False):
        found, rule = super().error(early), Rule.of(self.rho_inf)
        # the local error of positions over h^3 times their third derivative
        leading = abs((rule.alpha_m - rule.alpha_f) / 2 + rule.beta - 1 / 6)
        return None if found is None else 12 * leading * found

    def memory(self):
        return {**super().memory(), "accelerations_known": self._accelerations_known, "rho_inf": self.rho_inf}

    def recall(self, memory):
        super().recall(memory)
        self._accelerations_known, self.rho_inf = memory["accelerations_known"], memory["rho_inf"]


#: Steppers by the names of `simulate`.
SCHEMES = {"momentum": Momentum, "energy": Energy, "generalised-alpha": GeneralisedAlpha, "triple-jump": TripleJump}
