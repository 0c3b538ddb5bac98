"""Characteristic equations of a string that drills steadily: their roots s are growth rates and frequencies.

Where the torque on bit depends on its speed alone, with the slope kappa = dT/dom:

    Jb s + kappa + Z(s) = 0,        Z the torsional impedance of string and drive from the bit up.

Where the bit cuts, at the rotation Om and the rate of penetration V, with n blades and the delay tau = 2 pi/(n Om):

    (s Za(s) + ka E) (s Zt(s) - kt rho E) + ka kt rho E^2 = 0,   E = 1 - exp(-s tau),  rho = V/Om,

which is s Za Zt + E (ka Zt - kt rho Za) = 0, Za and Zt with the mass and the inertia of the bit, ka and kt weight and
torque per depth of cut. Both are written without denominators, as entire functions of s.

`Steady` makes them from a scene; `box_up_to` is the searched part of the complex plane.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.laws import refuse_several_speeds
from cosserat_fenicsx.drilling.linear.impedances import Guide, axial, torsional
from cosserat_fenicsx.drilling.linear.roots import Box
from cosserat_fenicsx.drilling.signals import doubt_speed
from cosserat_fenicsx.drilling.steady_start import penetration
from cosserat_fenicsx.parts import Number, Values, positive


class Characteristic:
    """Base of characteristic functions, see roots.py.

    Attributes:
        guides: the waveguides that move. delay: of the function, s. fastest: a growth rate that no root reaches, 1/s.
    """

    delay = 0.0

    @property
    def travel(self):
        """Travel time of waves from the top to the bit, of all guides together, s."""
        return sum(guide.travel for guide in self.guides)

    @property
    def spacing(self):
        """Typical distance of roots along the imaginary axis, rad/s."""
        return 2 * math.pi / (2 * self.travel + self.delay)

    @property
    def exponents(self):
        """See roots.py."""
        travel = self.travel
        return -travel - self.delay, travel

    def motion(self, s):
        """Relative motion of the bit in each guide: rotation, and axial velocity where there is some."""
        raise NotImplementedError


@dataclass(frozen=True)
class FallingTorque(Characteristic):
    """The function B + kappa om at the bit; kappa in N m s/rad, negative where the torque falls with the speed."""

    torsion: Guide
    kappa: float

    def __call__(self, s):
        om, B, dom, dB = self.torsion.bit(s)
        return B + self.kappa * om, dB + self.kappa * dom

    @property
    def fastest(self):
        # drive and string only take energy: Re Z > 0 for Re s > 0. So x Jb < -kappa for the growth x; and Re Z is at
        # least Z tanh(x T), Z and T impedance and travel time of the lowest part, whatever is above it
        fall, last = max(-self.kappa, 0.0), self.torsion.parts[-1]
        inertia = self.torsion.inertia + (last.inertia if last.travel == 0 else 0.0)
        bounds = [fall / inertia] if inertia else []
        if last.travel and fall < last.impedance:
            bounds.append(math.atanh(fall / last.impedance) / last.travel)
        return 1.5 * min(bounds) + self.spacing / 2

    @property
    def guides(self):
        return (self.torsion,)

    def motion(self, s):
        return (1.0 + 0j,)


@dataclass(frozen=True)
class Regenerative(Characteristic):
    """The function of a bit that cuts: rotation Om (rad/s), rate of penetration V (m/s), see the head of this file.

    Attributes:
        ka: N/m; kt: N; blades: n.
    """

    torsion: Guide
    axial: Guide
    ka: float
    kt: float
    blades: int
    speed: float
    penetration: float

    @property
    def delay(self):
        return 2 * math.pi / (self.blades * self.speed)

    def _memory(self, s):
        """q E/s, q times its derivative, and q = exp(tau min(Re s, 0)), with which nothing overflows."""
        tau = self.delay
        x = s * tau
        small = np.abs(x) < 1e-2
        y = np.where(small, 1.0, x)
        size = np.exp(np.minimum(x.real, 0.0))
        decayed, q = np.exp(-1j * y.imag - np.maximum(y.real, 0.0)), np.exp(np.minimum(y.real, 0.0))
        series = 1 - x / 2 * (1 - x / 3 * (1 - x / 4 * (1 - x / 5 * (1 - x / 6 * (1 - x / 7)))))
        value = np.where(small, size * series, (q - decayed) / y)
        series = -1 / 2 + x / 3 * (1 - 3 * x / 8 * (1 - 4 * x / 15 * (1 - 5 * x / 24 * (1 - 6 * x / 35))))
        slope = np.where(small, size * series, (decayed * (1 + y) - q) / y**2)
        return tau * value, tau**2 * slope, size

    def __call__(self, s):
        om, T, dom, dT = self.torsion.bit(s)
        v, A, dv, dA = self.axial.bit(s)
        e, de, q = self._memory(s)
        ka, kt = self.ka, self.kt * self.penetration / self.speed
        cut, dcut = ka * v * T - kt * om * A, ka * (dv * T + v * dT) - kt * (dom * A + om * dA)
        return q * A * T + e * cut, q * (dA * T + A * dT) + de * cut + e * dcut

    @property
    def fastest(self):
        # s = -E (ka/Za - kt rho/Zt), where E is below 2 and Za and Zt, for a growth x, are at least Z tanh(x T) + m x,
        # see `FallingTorque.fastest`
        rho = self.penetration / self.speed

        def excess(x):
            least = [y.impedance * math.tanh(x * y.parts[-1].travel) + y.inertia * x for y in self.guides]
            return x - 2 * (self.kt * rho / least[0] + self.ka / least[1])

        low, high = 1e-6 * self.spacing, self.spacing
        while excess(high) < 0:
            low, high = high, 2 * high
        return 1.2 * brentq(excess, low, high)

    @property
    def guides(self):
        return self.torsion, self.axial

    def motion(self, s):
        at = np.array([s], dtype=complex)
        (om, T, *_), (v, A, *_), (e, _, q) = self.torsion.bit(at), self.axial.bit(at), self._memory(at)
        rho = self.penetration / self.speed
        # per unit of rotation, from the better conditioned one of both equations
        axial, torsional = q * A / v + self.ka * e, q * T / om - self.kt * rho * e
        if abs(axial[0]) > abs(self.ka * e[0]) * 1e-6:
            return 1.0 + 0j, complex(self.ka * e[0] * rho / axial[0])
        return 1.0 + 0j, complex(-torsional[0] / (self.kt * e[0]))


class Steady:
    """Steady rotations of a scene at any speed and weight.

    Attributes:
        torsion, axial: `Guide`s; axial is None where nothing moves axially.

    Raises:
        SceneError: discs with a bit that cuts.
    """

    def __init__(self, scene):
        self.scene = scene
        self.law = scene.bit.law if scene.bit else None
        self.torsion = torsional(scene)
        self.cuts = self.law is not None and self.law.drills
        self.axial = axial(scene) if self.cuts else None

    def parameters(self, speed, weight):
        """Parameters of the equation: (kappa,) or (rotation, rate of penetration), for a weight (N) or None.

        Raises:
            SceneError: a weight that is missing, or borne by wear flats; or a torque that falls too fast.
        """
        if self.cuts:
            return np.array([speed, self._penetration(speed, weight)])
        if self.law is None:
            return np.zeros(1)
        if self.law.needs_weight and weight is None:
            refuse(self.scene.bit, "weight", None, "the weight on bit (N), which the law needs")
        law = self.law.resistance(weight)
        if law is None:
            return np.zeros(1)
        kappa = law.slope(speed)
        if not self.scene.discs:
            at = f" at {speed:.4g} rad/s" + (f" under {weight / 1e3:.4g} kN" if weight is not None else "")
            refuse_several_speeds(kappa, self.torsion.impedance, self.torsion.inertia, at)
        return np.array([kappa])

    def _penetration(self, speed, weight):
        """V from the weight on bit less the load of wear flats; or from the speed of the hook."""
        if weight is None:
            hook = self.scene.hook
            rate = -hook.signal()(0.0) if hook is not None and hook.signal().constant else 0.0
            if not rate > 0:
                refuse(self.scene.bit, "weight", None, "the weight on bit (N), or a Hook whose speed (m/s) is a "
                       "negative number: that of the block downwards")  # fmt: skip
            return rate
        return penetration(replace(self.scene.bit, weight=weight), speed)

    def equation(self, parameters):
        """The characteristic function of `parameters`."""
        if self.cuts:
            stiffnesses = self.law.axial_stiffness, self.law.torsional_stiffness
            return Regenerative(self.torsion, self.axial, *stiffnesses, self.law.blades, *map(float, parameters))
        return FallingTorque(self.torsion, float(parameters[0]))


def speeds_and_weights(owner, scene, speeds, weights):
    """Both as checked arrays; weights (1,) of NaN where there is none.

    Raises:
        SceneError: speeds or weights that are not positive, or weights without a bit.
    """
    speeds = _numbers(owner, "speeds", speeds, "angular velocity")
    doubt_speed(owner, "speeds", float(speeds.max()))
    if weights is None:
        own = scene.bit.weight if scene.bit else None
        return speeds, np.array([np.nan if own is None else own])
    if scene.bit is None:
        refuse(scene, "bit", None, "a BitOnRock, whose weight is to change")
    return speeds, _numbers(owner, "weights", weights, "force")


def _numbers(owner, field, values, dimension):
    """(n,) positive numbers, given as one or several."""
    several = values if isinstance(values, dict) else list(values) if np.ndim(values) else [values]
    return np.array(Values(Number(dimension, positive())).check(owner, field, several))


def or_none(weight):
    """A weight, None for NaN."""
    return None if math.isnan(weight) else float(weight)


# Modes that decay by more than exp(-this) while a wave goes down the string once are not listed.
_DECAY = 4.0


def box_up_to(steady, top):
    """The box of a characteristic function of a `Steady`, up to a frequency (rad/s)."""
    left = -_DECAY / steady.torsion.travel
    return lambda f: Box(left, f.fastest, 0.0, top)
