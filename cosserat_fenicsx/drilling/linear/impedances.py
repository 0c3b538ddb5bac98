"""Waves of one frequency along a string, from its top down to the bit.

All depends on time like exp(s t), s complex (1/s). The state of a section is the pair (w, P): in torsion the rotation
om (rad/s) and the torque M (N m) handed down, in axial motion the velocity v (m/s) and the force F (N) handed down,
both downwards, which is minus the tension. Along a uniform part of length L, with stiffness K (GJ or EA), inertia mu
(rho J or rho A) and drag rate d, K g^2 = mu s (s + d):

    w(L) = cosh(g L) w(0) - s/K sinh(g L)/g P(0)
    P(L) = cosh(g L) P(0) - mu (s + d) sinh(g L)/g w(0)

which are entire functions of s. States are scaled by positive factors, such that nothing overflows however large s L
is: phases, ratios and logarithmic derivatives are exact, sizes are not.
"""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.steady_start import follows_the_bit
from cosserat_fenicsx.drilling.top_drive import Hook

#: |g L|^2 below which sinh(g L)/g and its derivative are computed by series, truncated at 1e-16.
_SMALL = 1e-2


@dataclass(frozen=True)
class State:
    """(w, P) at one section for many s, and the derivatives with respect to s, all by the same positive factors."""

    w: np.ndarray
    P: np.ndarray
    dw: np.ndarray
    dP: np.ndarray

    def times(self, factor):
        """All of it by positive factors (n,)."""
        return State(self.w * factor, self.P * factor, self.dw * factor, self.dP * factor)

    def scaled(self, impedance):
        """Such that |impedance w|^2 + |P|^2 = 1."""
        return self.times(1 / np.hypot(np.abs(impedance * self.w), np.abs(self.P)))


class _Section:
    """A part of a string between two sections, with `through`, `impedance` and `travel`."""

    def down(self, s, state):
        """The state at the lower end."""
        return self.through(s, state).scaled(self.impedance)


@dataclass(frozen=True)
class Uniform(_Section):
    """A uniform part: length (m), stiffness (N m^2 or N), inertia (kg m or kg/m), drag (1/s), name."""

    length: float
    stiffness: float
    inertia: float
    drag: float
    name: str

    @property
    def impedance(self):
        """N m s/rad or N s/m."""
        return np.sqrt(self.stiffness * self.inertia)

    @property
    def travel(self):
        """Time that a wave takes, s."""
        return self.length * np.sqrt(self.inertia / self.stiffness)

    def through(self, s, state, length=None):
        """The state at a length (m) below the upper end, by default the lower end, times exp(-Re(g length))."""
        length = self.length if length is None else length
        square = self.inertia / self.stiffness * s * (s + self.drag)
        C, S, dC, dS = _hyperbolic(square, length)
        turn = self.inertia / self.stiffness * (2 * s + self.drag)  # derivative of the square
        a, b = -s / self.stiffness, -self.inertia * (s + self.drag)
        w, P, dw, dP = state.w, state.P, state.dw, state.dP
        return State(
            C * w + a * S * P,
            C * P + b * S * w,
            C * dw + a * S * dP + dC * turn * w + (a * dS * turn - S / self.stiffness) * P,
            C * dP + b * S * dw + dC * turn * P + (b * dS * turn - self.inertia * S) * w,
        )

    def along(self, s, state, points, places):
        """Places (m) below the upper end, w there, twice the kinetic energy by Gauss's rule with so many points, and
        the state at the lower end, all but the places by one and the same factor."""
        nodes, weights = np.polynomial.legendre.leggauss(points)
        x = np.concatenate([self.length * (1 + nodes) / 2, np.linspace(0.0, self.length, places)])
        here = self.through(s, state, x).w * np.exp(self._decay(s, x))
        twice = self.inertia * self.length / 2 * float(weights @ np.abs(here[:points]) ** 2)
        below = self.through(s, state).times(np.exp(self._decay(s, self.length)))
        return x[points:], here[points:], twice, below

    def _decay(self, s, length):
        """Re(g length)."""
        return (np.sqrt(self.inertia / self.stiffness * s * (s + self.drag)) * length).real


def _hyperbolic(square, length):
    """cosh(g L) and sinh(g L)/g of g^2 = square, and their derivatives by it, all times exp(-Re(g L))."""
    g = np.sqrt(square)  # of positive real part
    x = g * length
    up, down = np.exp(1j * x.imag), np.exp(-x - x.real)
    C, q = (up + down) / 2, square * length**2
    small = np.abs(q) < _SMALL
    safe = np.where(small, 1.0, g)
    S = np.where(small, length * (1 + q / 6 * (1 + q / 20 * (1 + q / 42 * (1 + q / 72)))) * np.exp(-x.real),
                 (up - down) / (2 * safe))  # fmt: skip
    series = length**3 / 6 * (1 + q / 10 * (1 + q / 28 * (1 + q / 54 * (1 + q / 88)))) * np.exp(-x.real)
    return C, S, length * S / 2, np.where(small, series, (length * C - S) / (2 * safe**2))


@dataclass(frozen=True)
class Disc(_Section):
    """A disc (inertia, drag: N m s/rad) and the spring below it (N m/rad, N m s/rad; None below the last one)."""

    inertia: float
    drag: float
    spring: float | None
    damping: float
    name: str

    length = 0.0

    @property
    def impedance(self):
        """For scaling, N m s/rad."""
        return np.sqrt(self.inertia * self.spring) if self.spring else self.inertia

    @property
    def travel(self):
        """In place of the time of a wave, s."""
        return np.sqrt(self.inertia / self.spring) if self.spring else 0.0

    def along(self, s, state, points, places):
        return np.zeros(1), state.w, self.inertia * abs(state.w[0]) ** 2, self.through(s, state)

    def through(self, s, state):
        """The state above the next disc."""
        own = self.inertia * s + self.drag
        P, dP = state.P - own * state.w, state.dP - own * state.dw - self.inertia * state.w
        if self.spring is None:
            return State(state.w, P, state.dw, dP)
        give, dgive = 1 + self.damping / self.spring * s, self.damping / self.spring
        return State(
            give * state.w - s / self.spring * P,
            give * P,
            dgive * state.w + give * state.dw - (P + s * dP) / self.spring,
            dgive * P + give * dP,
        )


@dataclass(frozen=True)
class Guide:
    """A string as a waveguide, with the condition at its top and the inertia at its lower end.

    Attributes:
        kind: "torsion" or "axial". parts: `Uniform` parts or `Disc`s from the top down. inertia: of the bit, kg m^2 or
        kg. top: function of s that gives (w, P) there and their derivatives. top_inertia: kg m^2, of the drive.
    """

    kind: str
    parts: tuple
    inertia: float
    top: object
    top_inertia: float = 0.0

    @property
    def travel(self):
        """Time of a wave from the top to the bit, s."""
        return float(sum(part.travel for part in self.parts))

    @property
    def impedance(self):
        """Of the lowest part, N m s/rad or N s/m: it resists sudden motions of the bit."""
        return float(self.parts[-1].impedance)

    def start(self, s):
        """The state at the top."""
        ones = np.ones_like(s)
        return State(*(np.asarray(x * ones, dtype=complex) for x in self.top(s))).scaled(self.parts[0].impedance)

    def bottom(self, s):
        """The state at the lower end, above its inertia."""
        state = self.start(s)
        for part in self.parts:
            state = part.down(s, state)
        return state

    def bit(self, s):
        """w at the bit, the action on it B = (Z + J s) w, and their derivatives: (w, B, dw, dB)."""
        end = self.bottom(s)
        return end.w, self.inertia * s * end.w - end.P, end.dw, self.inertia * (s * end.dw + end.w) - end.dP

    def impedance_at_bit(self, s):
        """Z(s) from the bit up, without its inertia: -P/w, N m s/rad or N s/m."""
        end = self.bottom(np.asarray(s, dtype=complex))
        return -end.P / end.w


def _held(s):
    return 0.0, 1.0, 0.0, 0.0


def _free(s):
    return 1.0, 0.0, 0.0, 0.0


def _drive_top(drive, impedance):
    """The condition of the drive: (om, M) at the top and their derivatives, free of poles."""
    (rigid, _, Kp, Ki), inertia = drive.control.gains(impedance), drive.inertia
    if rigid:
        return _held
    if Ki:
        return lambda s: (s, -(inertia * s**2 + Kp * s + Ki), 1.0, -(2 * inertia * s + Kp))
    return lambda s: (1.0, -(inertia * s + Kp), 0.0, -inertia)


def torsional(scene) -> Guide:
    """Torsional waveguide of a `Drilling` scene."""
    drive, string, bit = scene.drive, scene.discs, scene.bit.inertia if scene.bit else 0.0
    if string:
        lower = zip((*string.stiffnesses, None), (*string.dampings, 0.0), strict=True)
        parts = tuple(
            Disc(J, c, k, d, f"disc {i + 1}")
            for i, (J, c, (k, d)) in enumerate(zip(string.inertias, string.drags, lower, strict=True))
        )
        return Guide("torsion", parts, bit, _drive_top(drive, None), drive.inertia)
    rate = scene.drag.torsion if scene.drag else 0.0
    parts = tuple(Uniform(x.length, x.GJ, x.rhoJ, rate, x.name) for x in scene.segments)
    return Guide("torsion", parts, bit, _drive_top(drive, parts[0].impedance), drive.inertia)


def axial(scene) -> Guide:
    """Axial waveguide of a `Drilling` scene below its hook.

    Raises:
        SceneError: the string is made of discs, which turn alone.
    """
    if scene.discs:
        refuse(scene, "string", scene.string, "a DrillString: discs turn alone")
    stiffness = (scene.hook or Hook()).stiffness
    top = _held if np.isinf(stiffness) else lambda s: (s, -stiffness, 1.0, 0.0)
    if follows_the_bit(scene):
        top = _free
    rate = scene.drag.axial if scene.drag else 0.0
    parts = tuple(Uniform(x.length, x.EA, x.rhoA, rate, x.name) for x in scene.segments)
    return Guide("axial", parts, scene.bit.mass if scene.bit else 0.0, top)
