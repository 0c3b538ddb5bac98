"""High-frequency torsional oscillations: how far modes grow, by the balance of power over a cycle.

The bit turns at Om + a cos(w t). Its torque, -T(-om) where it turns backwards, then acts on this frequency like a slope

    N(a) = 1/(pi a) int T(Om + a cos x) cos x dx    over a cycle, N(0) = T'(Om),

and the motion goes on where string and drive take the power that the bit gives: at the frequencies and slopes of
`critical_slopes`, N(a) = kappa_c. Other frequencies are left out, as is what sticks.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.linear.characteristic import Steady
from cosserat_fenicsx.drilling.linear.excitation import Drawn
from cosserat_fenicsx.drilling.linear.impedances import Disc
from cosserat_fenicsx.drilling.linear.limits import critical_slopes
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.stick_slip import SPEED, TORQUE
from cosserat_fenicsx.numerics import gauss
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.result import by_name

# Gauss points in each half cycle without a jump; amplitudes tried, over the mean speed; places in a wave;
# oscillations in a table.
_RULE = gauss(64)
_TRIED = np.concatenate([np.linspace(0.02, 1.0, 50), 1 + np.geomspace(1e-7, 30.0, 150)])
_PLACES, _LISTED = 16, 12


@dataclass(frozen=True, eq=False, repr=False)
class Hfto(Drawn):
    """Result of `Stability.hfto`: oscillations of one frequency each, by frequency.

    Attributes:
        scene: the `Drilling` at the speed and weight. speed: of the bit, rad/s. unbounded: how many more modes grow,
            which friction at the wall feeds whatever the bit takes.
        frequency: (n,) Hz. slope: (n,) N m s/rad, kappa_c, which the string's damping takes at the bit. growth: (n,)
            1/s, of the nearest mode while it is small. amplitude: (n,) of the bit's speed, rad/s; NaN where the law of
            the bit bounds none. torque, torque_depth: (n,) largest amplitude of the torque in the string, N m, and its
            depth below the drive, m; the number of the disc above it for discs.
    """

    scene: Drilling
    speed: float
    unbounded: int
    frequency: np.ndarray
    slope: np.ndarray
    growth: np.ndarray
    amplitude: np.ndarray
    torque: np.ndarray
    torque_depth: np.ndarray

    _chart = "draw_hfto"
    axis = _rows_axis = "oscillation"
    _may_be_empty = True
    _quantities = by_name(
        Quantity("frequency", unit="Hz", axes=("oscillation",)),
        Quantity("growth", "growth while small", "1/s", axes=("oscillation",)),
        Quantity("amplitude", "amplitude of bit speed", "rad/s", axes=("oscillation",), shown="rpm"),
        Quantity("over_mean", "over mean speed", axes=("oscillation",), getter=lambda x: x.amplitude / x.speed),
        Quantity("acceleration", "of bit", "rad/s^2", axes=("oscillation",)),
        Quantity("torque", "largest torque amplitude", "N m", axes=("oscillation",)),
        Quantity("torque_depth", "at", "m", axes=("oscillation",), dimension="length"),
    )

    @property
    def acceleration(self) -> np.ndarray:
        """(n,) amplitude of the angular acceleration of the bit, rad/s^2; times a radius the tangential one."""
        return 2 * math.pi * self.frequency * self.amplitude

    def __len__(self) -> int:
        return len(self.frequency)

    def _about(self):
        return {"kind": "Hfto", "speed": self.speed, "unbounded": self.unbounded}

    def _answer(self, units):
        rpm, size = units.on_screen(SPEED)
        bounded = np.isfinite(self.amplitude)
        if fed := self.unbounded + int((~bounded).sum()):
            yield f"{fed} modes grow that friction at the wall feeds and the bit does not bound: see simulate."
        if not len(self):
            yield f"No oscillation is kept up at {self.speed / size:.4g} {rpm}."
            return
        if not bounded.any():
            return
        k, still = (
            int(np.argmax(np.where(bounded, self.growth, -np.inf))),
            self.scene.bit.law.resistance(self.scene.bit.weight).still,
        )
        torque, scale = units.on_screen(TORQUE)
        yield (
            f"{len(self)} possible {'oscillation' if len(self) == 1 else 'oscillations'} at "
            f"{self.speed / size:.4g} {rpm}, each alone. Fastest to grow: "
            f"{self.frequency[k]:.4g} Hz, bit speed +- {self.amplitude[k] / size:.4g} {rpm}, "
            f"{self.amplitude[k] / self.speed:.4g} times the mean; torque +- {self.torque[k] / scale:.4g} {torque}."
        )
        if stuck := int((self.torque < still).sum()):
            yield f"In {stuck} of them the torque stays below that which holds the bit: it sticks, see simulate."
        if len(self) > _LISTED:
            yield f"Below: the {_LISTED} that grow fastest; to_dataframe() has all."

    def _table(self, units, rows):
        if not len(self):
            return None
        kept = np.sort(np.argsort(-self.growth)[: min(rows, _LISTED)])
        arrays = {x.name: getattr(self, x.name)[kept] for x in fields(self)[3:]}
        return super(Hfto, replace(self, **arrays))._table(units, rows)

    def __repr__(self):
        return f"<Hfto: {len(self)} oscillations at {self.speed:.4g} rad/s>"


def oscillations(scene, up_to, frequencies, growth):
    """The `Hfto` of a scene at its speed and weight on bit, up to a frequency (Hz); (n,) frequencies (Hz) and growth
    (1/s) of its modes.

    Raises:
        SceneError: the torque of the bit does not follow from its speed.
    """
    law = scene.bit.law.resistance(scene.bit.weight) if scene.bit is not None else None
    if law is None:
        refuse("Stability", "hfto", scene.bit, "a bit whose torque follows from its speed, such as one with Stribeck")
    steady, turning = Steady(scene), scene.drive.signal()(0.0)
    guide, speed = steady.guides(turning, scene.bit.weight)[0], steady.speed_of_bit(turning, scene.bit.weight)
    w, slopes = critical_slopes(scene, up_to, turning)
    om, B, dom, dB = guide.bit(1j * w)
    # where a mode begins to grow as the slope falls; where friction at the wall feeds the string there are others
    kept = (w > 0) & (slopes > law.slope(speed)) & (((dB * om - B * dom) / om**2).real > 0)
    frequency, slopes = w[kept] / (2 * math.pi), slopes[kept]
    amplitude = np.array([_amplitude(law, speed, slope) for slope in slopes])
    nearest = np.abs(frequency[:, None] - np.asarray(frequencies)[None, :])
    unbounded = max(int((np.asarray(growth) > 0).sum()) - len(frequency), 0)
    growth = np.asarray(growth)[nearest.argmin(axis=1)] if len(frequency) else np.zeros(0)
    largest = np.array([_largest_torque(guide, x) for x in w[kept]]).reshape(-1, 2)
    return Hfto(scene, speed, unbounded, frequency, slopes, growth, amplitude, largest[:, 0] * amplitude, largest[:, 1])


def equivalent_slope(law, speed, amplitude):
    """N(a) of a `Resistance` at a mean speed, see the head of this file, N m s/rad."""
    turns = math.acos(-min(speed / amplitude, 1.0))  # from there on the bit turns backwards

    def half(low, high, sign):
        x = (low + high) / 2 + (high - low) / 2 * _RULE.points
        moved = np.maximum(sign * (speed + amplitude * np.cos(x)), 0.0)
        return sign * (high - low) / 2 * float(_RULE.weights @ (law(moved) * np.cos(x)))

    return 2 * (half(0.0, turns, 1.0) + half(turns, math.pi, -1.0)) / (math.pi * amplitude)


def _amplitude(law, speed, slope):
    """The least amplitude (rad/s) at which the bit gives no more power than the slope takes; NaN without one."""

    def excess(a):
        return equivalent_slope(law, speed, a) - slope

    low = 0.0
    for a in speed * _TRIED:
        if excess(a) >= 0:
            return brentq(excess, low or 1e-3 * a, a, xtol=1e-14 * speed, rtol=1e-14)
        low = a
    return math.nan


def _largest_torque(guide, w):
    """(N m s/rad, m) the largest torque in the string over the speed of the bit, and its depth."""
    s, found, top = np.array([1j * w]), [], 0.0
    state = guide.start(s)
    for k, part in enumerate(guide.parts):
        places = np.linspace(0.0, part.length, 2 + int(_PLACES * w * part.travel / (2 * math.pi)))
        here = part.through(s, state, places) if part.length else part.through(s, state)
        disc = isinstance(part, Disc)
        sizes = np.abs(here.P / part.give(s)) if not disc or part.spring else np.zeros(1)
        worst = int(sizes.argmax())
        size = here.size if np.ndim(here.size) == 0 else np.broadcast_to(here.size, sizes.shape)[worst]
        found.append((np.log(sizes[worst] or 1e-300) + size, float(k + 1) if disc else top + places[worst]))
        top += part.length
        state = part.down(s, state)
    logarithm, depth = max(found)
    return math.exp(float(logarithm - state.size[0])) / abs(state.w[0]), depth
