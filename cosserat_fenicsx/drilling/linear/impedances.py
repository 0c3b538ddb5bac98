"""Waves of one frequency along a string, from its top down to the bit.

All depends on time like exp(s t), s complex (1/s). The state of a section is the pair (w, P): in torsion the rotation
om (rad/s) and the torque M (N m) handed down, in axial motion the velocity v (m/s) and the force F (N) handed down,
both downwards, which is minus the tension. Along a uniform part of length L, with stiffness K (GJ or EA), inertia mu
(rho J or rho A), drag rate d and damping time tau (Kelvin and Voigt), K (1 + tau s) g^2 = mu s (s + d):

    w(L) = cosh(g L) w(0) - s/(K (1 + tau s)) sinh(g L)/g P(0)
    P(L) = cosh(g L) P(0) - mu (s + d) sinh(g L)/g w(0)

which are entire functions of s, but for s = -1/tau. States are scaled by positive factors, whose logarithms are kept,
such that nothing overflows however large s L is.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from operator import itemgetter

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.linear_control import check_late, polynomials_of
from cosserat_fenicsx.drilling.protocol import follows_the_bit
from cosserat_fenicsx.drilling.top_drive import Hook

#: |g L|^2 below which sinh(g L)/g and its derivative are computed by series, truncated at 1e-16.
_SMALL = 1e-2
#: Points on one side of a contour at which a `Guide` keeps what it found, and how many such sides.
_LONG, _KEPT = 40, 64


@dataclass(frozen=True)
class State:
    """(w, P) at one section for many s, and the derivatives with respect to s, all times exp(-size)."""

    w: np.ndarray
    P: np.ndarray
    dw: np.ndarray
    dP: np.ndarray
    size: np.ndarray | float = 0.0

    def times(self, factor):
        """The same state, held times positive factors (n,)."""
        return State(*(x * factor for x in (self.w, self.P, self.dw, self.dP)), self.size - np.log(factor))

    def scaled(self, impedance):
        """Such that |impedance w|^2 + |P|^2 = 1."""
        return self.times(1 / np.hypot(np.abs(impedance * self.w), np.abs(self.P)))


class _Section:
    """A part of a string between two sections, with `through`, `impedance` and `travel`."""

    def give(self, s):
        """By which `through` multiplies the state."""
        return np.ones_like(s)

    def decay(self, s):
        """By how much the logarithm of a wave falls on its way through."""
        return 0.0

    def down(self, s, state):
        """The state at the lower end."""
        return self.through(s, state).scaled(self.impedance)


@dataclass(frozen=True)
class Uniform(_Section):
    """A uniform part: length (m), stiffness (N m^2 or N), inertia (kg m or kg/m), drag (1/s), name, damping (s)."""

    length: float
    stiffness: float
    inertia: float
    drag: float
    name: str
    damping: float = 0.0

    @property
    def impedance(self):
        """N m s/rad or N s/m."""
        return np.sqrt(self.stiffness * self.inertia)

    @property
    def travel(self):
        """Time that a wave takes, s."""
        return self.length * np.sqrt(self.inertia / self.stiffness)

    def through(self, s, state, length=None):
        """The state at a length (m) below the upper end, by default the lower end."""
        length = self.length if length is None else length
        square, turn, stiff = self._square(s)
        C, S, dC, dS = _hyperbolic(square, length)
        a, b = -s / stiff, -self.inertia * (s + self.drag)
        da = -self.stiffness / stiff**2
        w, P, dw, dP = state.w, state.P, state.dw, state.dP
        return State(
            C * w + a * S * P,
            C * P + b * S * w,
            C * dw + a * S * dP + dC * turn * w + (a * dS * turn + da * S) * P,
            C * dP + b * S * dw + dC * turn * P + (b * dS * turn - self.inertia * S) * w,
            state.size + (np.sqrt(square) * length).real,
        )

    def decay(self, s):
        return (np.sqrt(self._square(s)[0]) * self.length).real

    def _square(self, s):
        """g^2, its derivative by s, and K (1 + tau s)."""
        give, move = 1 + self.damping * s, s * (s + self.drag)
        scale = self.inertia / self.stiffness / give
        return scale * move, scale * (2 * s + self.drag - self.damping * move / give), self.stiffness * give

    def along(self, s, state, points, places):
        """Places (m) below the upper end, w there, and twice the kinetic energy by Gauss's rule of `points`."""
        nodes, weights = np.polynomial.legendre.leggauss(points)
        x = np.concatenate([self.length * (1 + nodes) / 2, np.linspace(0.0, self.length, places)])
        found = self.through(s, state, x)
        here = found.w * np.exp(found.size - state.size)
        return x[points:], here[points:], self.inertia * self.length / 2 * float(weights @ np.abs(here[:points]) ** 2)


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
        return np.zeros(1), state.w, self.inertia * abs(state.w[0]) ** 2

    def give(self, s):
        """By which `through` multiplies the state, such that it is entire."""
        return 1 + self.damping / self.spring * s if self.spring else np.ones_like(s)

    def through(self, s, state):
        """The state above the next disc, times `give`."""
        own = self.inertia * s + self.drag
        P, dP = state.P - own * state.w, state.dP - own * state.dw - self.inertia * state.w
        if self.spring is None:
            return State(state.w, P, state.dw, dP, state.size)
        give, dgive = self.give(s), self.damping / self.spring
        return State(
            give * state.w - s / self.spring * P,
            give * P,
            dgive * state.w + give * state.dw - (P + s * dP) / self.spring,
            dgive * P + give * dP,
            state.size,
        )


@dataclass(frozen=True)
class Parted(_Section):
    """A place where a tool parts the string: a dashpot c (`damping`) or a spring k between both sides, the other one 0:
    w below = w above - P/c, or - s P/k; and the inertia of a rotor below it, kg m^2.

    Its impedance, for scaling, is c, or 1 N s/m times the rate k/(1 N s/m).
    """

    damping: float
    spring: float
    name: str
    rotor: float = 0.0

    length = travel = inertia = drag = 0.0

    @property
    def impedance(self):
        """For scaling."""
        return self.damping or np.sqrt(self.spring)

    def along(self, s, state, points, places):
        return np.zeros(1), state.w, self.rotor * abs(self.through(s, state).w[0]) ** 2

    def through(self, s, state):
        """The state below."""
        give, slope = (1 / self.damping, 0.0) if self.damping else (s / self.spring, 1 / self.spring)
        w, dw = state.w - give * state.P, state.dw - give * state.dP - slope * state.P
        return State(w, state.P - self.rotor * s * w, dw, state.dP - self.rotor * (w + s * dw), state.size)


@dataclass(frozen=True)
class Guide:
    """A string as a waveguide, with the condition at its top and the inertia at its lower end.

    Attributes:
        kind: "torsion" or "axial". parts: `Uniform` parts or `Disc`s from the top down. inertia: of the bit, kg m^2 or
        kg. top: function of s that gives (w, P) there and their derivatives. top_inertia: kg m^2, of the drive. fed:
        the largest growth (1/s) that the drive feeds, see `_fed`.
    """

    kind: str
    parts: tuple
    inertia: float
    top: object
    top_inertia: float = 0.0
    fed: float = 0.0

    @cached_property
    def _ends(self):
        """The states of `bottom` at some s, by their bytes."""
        return {}

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
        return self._down(s, self.start(s))

    def factor(self, s):
        """(n,) by which states below are more than they are, in products of dampers between discs."""
        return np.prod([part.give(s) for part in self.parts], axis=0)

    def below_top(self, s, w, P):
        """The state at the lower end of any one (w, P) at the top, whatever the condition there."""
        zero = np.zeros_like(w)
        return self._down(s, State(w, P, zero, zero).scaled(self.parts[0].impedance))

    def _down(self, s, state):
        for part in self.parts:
            state = part.down(s, state)
        return state

    def bit(self, s):
        """w at the bit, the action on it B = (Z + J s) w, and their derivatives: (w, B, dw, dB)."""
        # every case of a map walks along the same contour
        if len(s) < _LONG:
            end = self.bottom(s)
        elif (end := self._ends.get(key := s.tobytes())) is None:
            if len(self._ends) == _KEPT:
                self._ends.clear()
            end = self._ends[key] = self.bottom(s)
        return end.w, self.inertia * s * end.w - end.P, end.dw, self.inertia * (s * end.dw + end.w) - end.dP

    def impedance_at_bit(self, s):
        """Z(s) from the bit up, without its inertia: -P/w, N m s/rad or N s/m."""
        end = self.bottom(np.asarray(s, dtype=complex))
        return -end.P / end.w

    @cached_property
    def drive(self):
        """The largest rate at which drive or friction that falls with the slip feeds motions, 1/s; 0 for none."""
        return max(self.fed, *(-part.drag for part in self.parts if part.length), 0.0)

    def least(self, x):
        """A lower bound of Re Z at the bit for all s of the real part x (1/s) above `drive`, without its inertia.

        In the lowest part, of the impedance Z and the travel time T, the power p = -Re(w* P) handed down and the energy
        e = mu |w|^2 + |P|^2/K grow as p' >= (x - D) e and e' <= (4/c^2) (x + d/2) p, with the drive D and the largest
        drag d. So 2 p/(c e) is at least the theta below, and p at least Z tanh(y) |w|^2 with tanh(2 y) = theta: without
        drag Z tanh(x T), whatever is above. Damping of Kelvin and Voigt adds to it. A motor's dashpot c below a string
        of Re Z >= y leaves c y/(c + y) at least.
        """
        if isinstance(self.parts[-1], Parted):
            y, c = replace(self, parts=self.parts[:-1]).least(x), self.parts[-1].damping
            return c * y / (c + y)
        impedance, travel, drag = self._lowest
        fed, lost = x - self.drive, x + drag / 2
        theta = math.sqrt(fed / lost) * math.tanh(2 * travel * math.sqrt(fed * lost))
        return impedance * theta / (1 + math.sqrt(max(1 - theta**2, 0.0)))

    @cached_property
    def _lowest(self):
        """Impedance, travel time and largest drag of the uniform part at the lower end, see `least`."""
        lowest, travel, drag = self.impedance, 0.0, 0.0
        for part in reversed(self.parts):
            if not part.length or not math.isclose(part.impedance, lowest, rel_tol=1e-9):
                break
            travel, drag = travel + part.travel, max(drag, part.drag)
        # less what is spent on what the drive feeds
        return lowest, float(travel - (self.fed > 0 and self.parts[0].travel / 2)), drag


def _held(s):
    return 0.0, 1.0, 0.0, 0.0


def _free(s):
    return 1.0, 0.0, 0.0, 0.0


def _drive_top(drive, impedance):
    """The condition of the drive: (om, M) at the top and derivatives, free of poles; it acts late by exp(-s late)."""
    gains, inertia, late = drive.control.gains(impedance), drive.inertia, drive.control.late
    check_late(drive.control, gains.linear, impedance, impedance is None)
    if gains.rigid:
        return _held
    given = [np.atleast_1d(p) for p in polynomials_of(gains)]
    slopes = [np.polyder(p) for p in given]

    def top(s):
        hold = np.exp(-late * s) if late else 1.0
        (q, e, M), (dq, de, dM) = ([np.polyval(p, s) for p in of] for of in (given, slopes))
        e, M, de, dM = e * hold, M * hold, (de - late * e) * hold, (dM - late * M) * hold
        if gains.linear and gains.linear.of_speed:
            return M, q + e, dM, dq + de
        return q - M, -(inertia * s * q + e), dq - dM, -(inertia * (q + s * dq) + de)

    return top


# Samples of a line, their range over the rate of the first part, ratio of lines.
_SAMPLES, _RANGE, _RATIO = 600, (1e-4, 1e5), 1.3


def _fed(drive, first, top):
    """The growth (1/s) above which string and drive only take energy, seen from the middle of the first part; 0 for
    controls that do so everywhere.

    A drive reflects the wave Q that comes up as P = R Q. In the middle of the part waves have lost exp(x T) on their
    way up and down, for the growth x: there R decides where it is above that. Lines of one x are sampled, from the
    right, beside the frequencies of the control's own roots, and x is not below the growth of these.
    """
    gains = drive.control.gains(first.impedance if first.length else None)
    if gains.rigid or (gains.linear is None and not drive.control.late):
        return 0.0
    q, e, M = map(np.poly1d, polynomials_of(gains))
    Z, rate = float(first.impedance), 1 / first.travel if first.travel else 1.0
    own = np.concatenate([q.roots, (Z * (q - M) + np.poly1d([drive.inertia, 0]) * q + e).roots, [0.0]])
    if gains.linear and gains.linear.of_speed:
        own = np.concatenate([q.roots, (q + e - Z * M).roots, [0.0]])
    heights = np.concatenate([[0.0], np.abs(own.imag), np.geomspace(*_RANGE, _SAMPLES) * rate])
    least, x = max(0.0, own.real.max()) * (1 + 1e-6) + _RANGE[0] * rate, max(_RANGE[1] * rate, 2 * abs(own).max())
    while x > least:
        s = x + 1j * heights
        w, P, *_ = top(s)
        if first.length:
            fits = np.exp(-x * first.travel) * np.abs(P + Z * w) <= np.abs(P - Z * w)
        else:
            fits = (-np.conj(w) * P).real + x * first.inertia / 2 * np.abs(w) ** 2 >= 0
        if not fits.all():
            break
        x /= _RATIO
    return max(x, least / _RATIO) * _RATIO


def torsional(scene, walls=None, damping=None) -> Guide:
    """Torsional waveguide of a `Drilling` scene; `walls`: rates of friction at the wall, see `WallDashpots`;
    `damping`: of each motor at its speed, N m s/rad, from the top down, None where they do not depend on it."""
    drive, string, bit = scene.drive, scene.discs, scene.bit_inertia
    if string:
        lower = zip((*string.stiffnesses, None), (*string.dampings, 0.0), strict=True)
        parts = tuple(
            Disc(J, c, k, d, f"disc {i + 1}")
            for i, (J, c, (k, d)) in enumerate(zip(string.inertias, string.drags, lower, strict=True))
        )
    else:
        parts = _uniform(scene, "torsion", walls, damping)
    top = _drive_top(drive, None if string else parts[0].impedance)
    return Guide("torsion", parts, bit, top, drive.inertia, _fed(drive, parts[0], top))


def axial(scene, walls=None) -> Guide:
    """Axial waveguide of a `Drilling` scene below its hook; `walls` as in `torsional`.

    Raises:
        SceneError: the string is made of discs, which turn alone.
    """
    if scene.discs:
        refuse(scene, "string", scene.string, "a DrillString: discs turn alone")
    stiffness = (scene.hook or Hook()).stiffness
    top = _held if np.isinf(stiffness) else lambda s: (s, -stiffness, 1.0, 0.0)
    if follows_the_bit(scene):
        top = _free
    return Guide("axial", _uniform(scene, "axial", walls), scene.bit.mass if scene.bit else 0.0, top)


def _uniform(scene, kind, walls, damping=None):
    """The `Uniform` parts of a string, divided where the friction at the wall changes."""
    stiffness, inertia = ("GJ", "rhoJ") if kind == "torsion" else ("EA", "rhoA")
    rate, found = getattr(scene.drag, kind) if scene.drag else 0.0, []
    for k, x in enumerate(scene.segments):
        for wall, pieces in groupby(walls[k] if walls else [(x.length, 0.0, 0.0)], itemgetter(1 + (kind == "axial"))):
            length = sum(piece[0] for piece in pieces)
            section = getattr(x, stiffness), getattr(x, inertia), rate + wall
            found.append(Uniform(length, *section, x.name, x.damping_time))
        for joint in scene.joints:
            if joint.segment == k and joint.turns == (kind == "torsion"):
                found.append(Parted(joint.damping, joint.spring, joint.tool.name))
    motors = [i for i, part in enumerate(found) if isinstance(part, Parted) and part.damping]
    for k, i in enumerate(motors):  # the lowest one's rotor is a part of the bit's inertia
        rotor = scene.motors[k].rotor_inertia if i != motors[-1] else 0.0
        found[i] = replace(found[i], damping=damping[k] if damping else found[i].damping, rotor=rotor)
    return tuple(found)
