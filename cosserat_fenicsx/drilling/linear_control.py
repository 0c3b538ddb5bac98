"""Controls of the drive that are linear: a state x of any size that follows the speed and the torque.

With the speed asked for Om, the speed om of the drive and the torque M that it hands down:

    x' = A x + B (Om - om, M),    y = C x + D (Om - om, M),    I om' = y - M,  or  om = Om + y

They run in C, in steps of the midpoint rule, and the linear theory takes them as they are. Where y acts late by a time
that steps divide, it is the mean of the step so long ago.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.top_drive import DriveControl, Gains, StateSpace
from cosserat_fenicsx.parts import Time, Torque, TorsionalDamping, at_least, positive

# Largest number of states. Misfit of a steady state, of its torque or speed.
_MOST, _STEADY = 20, 1e-9


class _Linear(DriveControl):
    """Base of the controls of this file."""

    @property
    def late(self):
        return self.delay


@dataclass(frozen=True)
class LinearControl(_Linear):
    """A control of continuous time, x' = A x + B u and y = C x + D u with u = (Om - om, M), rad/s and N m.

    Args:
        A, B, C, D: numbers in SI: A (n, n) in rows, B (n, 2) in rows, C (n,), D (2,); x begins at 0, or in a steady
            start where it holds the steady torque. Without states only D.
        commands: what y is: "torque" of the drive, N m, in I om' = y - M; or "speed", rad/s: om = Om + y.
        delay: s from x and u to the moment when y acts; steps of a motion divide it.

    Raises:
        SceneError: sizes that do not fit each other; a torque that follows M by a factor of 1 or more at once, or a
            speed that does not fall with M.
    """

    A: tuple[tuple[float, ...], ...] = ()
    B: tuple[tuple[float, ...], ...] = ()
    C: tuple[float, ...] = ()
    D: tuple[float, ...] = (0.0, 0.0)
    commands: Literal["torque", "speed"] = "torque"
    delay: Annotated[Time, at_least(0)] = 0.0

    def validate(self):
        n = len(self.A)
        if n > _MOST or any(len(row) != n for row in self.A):
            refuse(self, "A", self.A, f"a square matrix in rows, of at most {_MOST} states")
        if len(self.B) != n or any(len(row) != 2 for row in self.B):
            refuse(self, "B", self.B, f"{n} rows of two numbers, for Om - om and M")
        if len(self.C) != n:
            refuse(self, "C", self.C, f"{n} numbers, one for each state")
        if len(self.D) != 2:
            refuse(self, "D", self.D, "two numbers, for Om - om and M")
        if not np.any(self.D) and not (n and np.any(self.B) and np.any(self.C)):
            refuse(self, "D", self.D, "a control that answers to Om - om or M: C and B, or D, that are not all 0")
        if self.commands == "torque" and self.D[1] >= 1:
            refuse(self, "D", self.D, "a torque that follows M by a factor below 1 at once (D[1])")
        if self.commands == "speed":
            answers = [self.D[1], *self._powers()]
            first = next((x for x in answers if x), 0.0)
            if not first < 0:
                refuse(self, "D", self.D, "a speed that falls with the torque M: D[1] below 0; where it is 0, C B, or "
                       "C A B and so on for M, below 0")  # fmt: skip
            if self.D[0] <= -1:
                refuse(self, "D", self.D, "a speed whose difference from Om follows om by a factor above -1 at once")

    def _powers(self):
        """C B, C A B, ... for M: how the speed begins to follow a step of the torque."""
        A, x = np.reshape(self.A, (len(self.A),) * 2), np.reshape(self.B, (-1, 2))[:, 1]
        for _ in range(len(self.A)):
            yield float(np.dot(self.C, x))
            x = A @ x

    @property
    def _needs_inertia(self):
        return "" if self.commands == "speed" else "a linear control of the torque"

    def gains(self, impedance):
        return Gains(linear=StateSpace(self.A, self.B, self.C, self.D, self.commands == "speed", 0.0))


@dataclass(frozen=True)
class ZTorque(_Linear):
    """A speed that gives way to the torque like a string that goes on upwards: om = Om - H (M - torque)/Z, with the
    filter H = exp(-s delay)/(1 + filter s). Slow waves are absorbed; their reflection is (1 - H)/(1 + H).

    Args:
        impedance: Z, N m s/rad; None for the uppermost section of the string, J sqrt(G rho).
        filter, delay: s, of the torque that is measured; steps of a motion divide the delay.
        torque: N m, at which the drive has the speed asked for; None for that of a steady start, and 0 from rest.

    Raises:
        SceneError: an impedance that is not positive; a negative filter or delay.
    """

    impedance: Annotated[TorsionalDamping, positive()] | None = None
    filter: Annotated[Time, at_least(0)] = 0.02
    delay: Annotated[Time, at_least(0)] = 0.0
    torque: Torque | None = None

    def gains(self, impedance):
        if self.impedance is None and impedance is None:
            refuse(self, "impedance", None, "an impedance (N m s/rad): Discs have none")
        Z = self.impedance or impedance
        if not self.filter:
            return Gains(linear=StateSpace((), (), (), (0.0, -1 / Z), True, self.torque))
        rate = 1 / self.filter
        return Gains(linear=StateSpace(((-rate,),), ((0.0, rate),), (-1 / Z,), (0.0, 0.0), True, self.torque))


def arrays_of(space: StateSpace):
    """A (n, n), B (n, 2), C (n,) and D (2,)."""
    n = len(space.A)
    return tuple(np.array(x, dtype=float).reshape(shape) for x, shape in zip(space, ((n, n), (n, 2), (n,), (2,))))


def polynomials_of(gains: Gains):
    """(q, p_e, p_M), coefficients of polynomials of s: small motions follow y = (p_e (Om - om) + p_M M)/q."""
    space = gains.linear
    if space is None:
        return ([1.0, 0.0], [gains.Kp, gains.Ki], [0.0]) if gains.Ki else ([1.0], [gains.Kp], [0.0])
    A, B, C, D = arrays_of(space)
    q = np.poly(A) if len(A) else np.ones(1)
    return q, *((np.poly(A - np.outer(B[:, k], C)) if len(A) else q) + (D[k] - 1) * q for k in (0, 1))


def step_for(gains: Gains, dt: float) -> float:
    """At most dt (s): a quarter of the shortest time of a control, but not below a hundredth of dt."""
    rates = np.abs(np.linalg.eigvals(arrays_of(gains.linear)[0])) if gains.linear and gains.linear.A else [0.0]
    return min(dt, max(0.25 / max(rates), dt / 100)) if max(rates) > 0 else dt


def steady_control(control: DriveControl, space: StateSpace, torque: float):
    """(level, x, y) of steady rotation at the speed asked for: the torque at which M counts as 0, the state, and the
    output that holds a torque (N m). Raises SceneError: the control has another speed, or another torque, in steady
    motion."""
    A, B, C, D = arrays_of(space)
    level = torque if space.level is None else space.level
    u, y = np.array([0.0, torque - level]), 0.0 if space.of_speed else torque
    system, right = np.vstack([A, C[None]]), np.append(-B @ u, y - D @ u)
    x = np.linalg.lstsq(system, right, rcond=None)[0]
    size = np.abs(right).max() + np.abs(system * x).max(initial=0.0)
    if np.abs(system @ x - right).max() > _STEADY * size:
        refuse("Drilling", "start", "steady", f"'rest' with this drive: in steady rotation at the speed asked for, "
               f"{type(control).__name__} does not hold the {torque:.6g} N m of the string; that takes an integral of "
               "Om - om, or, of ZTorque, this torque")  # fmt: skip
    return level, x, y


def check_late(control: DriveControl, space: StateSpace | None, impedance: float | None, discs: bool = False) -> None:
    """Refuse a control that acts late and answers to fast torques so much that motions of all frequencies grow, the
    faster the shorter they are: a speed times the impedance (N m s/rad) of the string, a torque over that of a body.
    impedance: None where the drive turns a body, an element or a disc. discs: whether it is a disc. Raises SceneError:
    so it is."""
    if space is None or not control.late:
        return
    _, B, C, D = arrays_of(space)
    if not space.of_speed:
        grows = discs and abs(D[1]) > 1
    elif impedance is None:
        grows = D[1] != 0 or (discs and C @ B[:, 1] != 0)
    else:
        grows = abs(D[1]) * impedance > 1 - _STEADY
    if grows:
        order = " of the second order" if discs and space.of_speed else ""
        refuse(control, "delay", control.late, f"0 (s), or a filter{order}: {type(control).__name__} answers late to "
               "fast torques by as much as they are or more, and motions of all frequencies grow")  # fmt: skip


def check_answer(control: DriveControl, answer: float, dt: float) -> None:
    """Refuse a step dt (s) in which a control answers to the mean torque by a factor of 1 or more."""
    if not math.isfinite(answer) or answer >= 1:
        refuse("simulate", "dt", dt, f"a shorter step (s): in this one the torque of {type(control).__name__} follows "
               f"the torque of the string by a factor of {answer:.3g}, which has to be below 1")  # fmt: skip
