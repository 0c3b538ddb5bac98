"""Excitation by rotation: the Campbell diagram, and the bounce of a bit on lobes of the rock; and by the torque on bit:
how far modes of high frequencies grow, by the balance of power over a cycle.

The bit turns at Om + a cos(w t). Its torque, -T(-om) where it turns backwards, then acts on this frequency like a slope

    N(a) = 1/(pi a) int T(Om + a cos x) cos x dx    over a cycle, N(0) = T'(Om),

and the motion goes on where string and drive take the power that the bit gives: at the frequencies and slopes of
`critical_slopes`, N(a) = kappa_c. Other frequencies are left out, as is what sticks.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import Numbers, number, positive, refuse
from cosserat_fenicsx.drilling.bit_laws import Lobes
from cosserat_fenicsx.drilling.linear.characteristic import Steady, speeds_and_weights
from cosserat_fenicsx.drilling.linear.frequencies import natural_frequencies
from cosserat_fenicsx.drilling.linear.impedances import Disc
from cosserat_fenicsx.drilling.linear.limits import critical_slopes
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.stick_slip import SPEED, TORQUE, WEIGHT
from cosserat_fenicsx.numerics import gauss
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.results.result import Charted, by_name


@dataclass(frozen=True, eq=False, repr=False)
class Campbell(Charted):
    """Result of `campbell`; `plot` draws natural frequencies as lines and excitations as rays.

    Attributes:
        fastest: highest speed of rotation, rad/s. frequencies: {"torsion": (n,), "axial": (m,)} Hz, without what
            lies above `up_to`; they do not depend on the speed. excitations: {name: times a revolution}. up_to: Hz.
        ends: {"torsion": "free", "axial": "fixed"}, how the lower end was held.
    """

    fastest: float
    frequencies: dict[str, np.ndarray]
    excitations: dict[str, float]
    up_to: float
    ends: dict[str, str]

    def critical_speeds(self) -> dict[tuple[str, str], np.ndarray]:
        """{(kind, excitation): speeds in rad/s up to the highest one where it meets a natural frequency}."""
        found = {}
        for kind, frequencies in self.frequencies.items():
            for name, times in self.excitations.items():
                speeds = 2 * math.pi * frequencies / times
                found[kind, name] = speeds[speeds <= self.fastest]
        return found

    def __repr__(self):
        found = ", ".join(f"{len(x)} {kind}" for kind, x in self.frequencies.items())
        return f"<Campbell: {found} frequencies up to {self.up_to:.4g} Hz; {', '.join(self.excitations)}>"

    _chart = "drilling.charts.campbell_figure"
    axis = _rows_axis = "critical speed"
    _quantities = by_name(
        Quantity("motion", "kind", axes=("critical speed",), getter=lambda x: x._column(0)),
        Quantity("excitation", axes=("critical speed",), getter=lambda x: x._column(1)),
        Quantity("critical_speed", unit="rad/s", axes=("critical speed",), getter=lambda x: x._column(2), shown="rpm"),
        Quantity("frequency", unit="Hz", axes=("critical speed",), getter=lambda x: x._column(3)),
    )

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def _rows(self):
        """(kind, excitation, speed, frequency) of every critical speed."""
        return [
            (kind, name, float(speed), self.excitations[name] * speed / (2 * math.pi))
            for (kind, name), speeds in self.critical_speeds().items()
            for speed in speeds
        ]

    def _column(self, k):
        return np.array([row[k] for row in self._rows])

    def _answer(self, units):
        rpm, turning = units.on_screen(SPEED)
        kinds = self.frequencies.items()
        found = " and ".join(f"{len(x)} of {kind} (bit {self.ends[kind]})" for kind, x in kinds)
        yield f"{len(self)} critical speeds up to {self.fastest / turning:.4g} {rpm}."
        yield f"Natural frequencies up to {self.up_to:.4g} Hz: {found}; excitations: {', '.join(self.excitations)}."


def campbell(
    scene: Drilling,
    fastest: float,
    *,
    up_to: float = 10.0,
    torsion: str = "free",
    axial: str = "fixed",
    excitations: dict[str, float] | None = None,
) -> Campbell:
    """Natural frequencies of torsion and axial motion, and the speeds at which rotation excites them.

    Args:
        scene: a `Drilling`. fastest: highest speed of rotation, rad/s. up_to: highest frequency, Hz.
        torsion, axial: the lower end: "free" or "fixed". A bit on the rock turns freely and hardly moves axially, so
            the defaults differ; `natural_frequencies` takes the end as free in both unless asked.
        excitations: {name: times a revolution}; None for once a revolution, and the blades or lobes of a bit
            that turns with the string: a motor turns it faster.

    Raises:
        SceneError: numbers that are not positive, or an unknown end.
    """
    fastest = positive("campbell", "fastest", fastest, "rad/s")
    up_to = positive("campbell", "up_to", up_to, "Hz")
    if excitations is None:
        repeats = scene.bit.law.repeats if scene.bit and scene.motor is None else None
        excitations = {"1 x": 1.0} | ({f"{repeats[0]} x ({repeats[1]})": float(repeats[0])} if repeats else {})
    for name, times in excitations.items():
        number("campbell", f"excitations[{name!r}]", times, "a positive number", lambda x: 0 < x < math.inf)
    kinds = {"torsion": torsion} | ({} if scene.discs else {"axial": axial})
    for kind, end in kinds.items():
        if end not in ("free", "fixed"):
            refuse("campbell", kind, end, "'free' or 'fixed'")
    frequencies = {kind: _up_to(scene, kind, end, up_to) for kind, end in kinds.items()}
    return Campbell(fastest, frequencies, dict(excitations), up_to, kinds)


def _up_to(scene, kind, end, up_to):
    count = 8
    while True:
        found = natural_frequencies(scene, count, end, kind)
        if len(found) < count or found[-1] > up_to:
            return found[found <= up_to]
        count *= 2


@dataclass(frozen=True, eq=False, repr=False)
class BitBounce(Charted):
    """Result of `bit_bounce`; `plot` draws the amplitude over speed beside the static weight.

    Attributes:
        scene: the `Drilling`. speeds: (n,) rad/s. frequency: (n,) Hz, lobes times rotation. amplitude: (n,) N, of the
            weight on bit about the static one, while bit and rock stay in touch.
    """

    scene: Drilling
    speeds: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray

    @property
    def lifts_off(self) -> np.ndarray:
        """(n,) bool: the amplitude is more than the static weight; the motion is then another one."""
        return self.amplitude > self.scene.bit.weight

    def limits(self) -> np.ndarray:
        """Speeds between the first and the last one where the bit begins or ceases to lift off, rad/s, ascending.

        They are found between neighbours of `speeds`: two limits between the same ones are missed.
        """
        weight = self.scene.bit.weight

        def excess(speed):
            return float(_amplitude(self.scene, np.array([speed]))[0] - weight)

        order = np.argsort(self.speeds)
        speeds, above = self.speeds[order], self.lifts_off[order]
        changes = np.flatnonzero(above[1:] != above[:-1])
        return np.array([brentq(excess, speeds[k], speeds[k + 1], xtol=1e-12) for k in changes])

    def __repr__(self):
        return f"<BitBounce: {self._lifted(Units())}>"

    def _lifted(self, units):
        """Where the bit lifts off, in words."""
        rpm, turning = units.on_screen(SPEED)
        lifted = self.speeds[self.lifts_off] / turning
        text = f"the bit lifts off at {len(lifted)} of {len(self.speeds)} speeds"
        return text + (f", from {lifted.min():.4g} to {lifted.max():.4g} {rpm}" if len(lifted) else "")

    _chart = "drilling.charts.bounce_figure"
    axis = _rows_axis = "speed"
    _quantities = by_name(
        Quantity("speed", unit="rad/s", axes=("speed",), getter="speeds", shown="rpm"),
        Quantity("frequency", unit="Hz", axes=("speed",)),
        Quantity("amplitude", "amplitude of weight", "N", axes=("speed",)),
        Quantity("lifts_off", axes=("speed",)),
    )

    def __len__(self) -> int:
        return len(self.speeds)

    def _answer(self, units):
        unit, size = units.on_screen(WEIGHT)
        yield f"{self._lifted(units)}; the static weight on bit is {self.scene.bit.weight / size:.4g} {unit}."


def bit_bounce(scene: Drilling, speeds: Numbers) -> BitBounce:
    """Forced axial vibration of a string whose bit follows the lobes of the rock.

    The bit moves by amplitude sin(count theta); the weight on bit shakes by the modulus of i w Z(i w) - m w^2, times
    the amplitude, with w = count Om, the axial impedance Z of the string below its hook (braked by drag,
    damping and friction at the wall) and the mass m of the bit. Rock of the stiffness k takes a part of the motion: of
    that dynamic stiffness D there acts D k/(D + k). It is linear: it holds while the weight shakes by less than the
    static one.

    Args:
        scene: a `Drilling` whose bit has the law `Lobes`.
        speeds: rotation, rad/s, (n,).

    Raises:
        SceneError: another law, or speeds that are not positive.
    """
    if scene.bit is None or not isinstance(scene.bit.law, Lobes):
        refuse("bit_bounce", "scene", scene.bit, "a bit with the law Lobes(count, amplitude)")
    speeds, _ = speeds_and_weights("bit_bounce", scene, speeds, None)
    frequency = scene.bit.law.count * _of_bit(scene, speeds) / (2 * math.pi)
    return BitBounce(scene, speeds, frequency, _amplitude(scene, speeds))


def _of_bit(scene, speeds):
    steady = Steady(scene, "axial")
    return np.array([steady.speed_of_bit(float(speed), None) for speed in speeds])


def _amplitude(scene, speeds):
    bit, steady = scene.bit, Steady(scene, "axial")
    s = 1j * bit.law.count * _of_bit(scene, speeds)
    guides = [steady.guides(float(speed), bit.weight)[0] for speed in speeds]
    with np.errstate(divide="ignore"):
        impedance = np.array([guide.impedance_at_bit(x) for guide, x in zip(guides, s, strict=True)])
        stiffness, rock = s * (impedance + bit.mass * s), bit.rock_stiffness
        return np.abs(stiffness if math.isinf(rock) else 1 / (1 / stiffness + 1 / rock)) * bit.law.amplitude


# Gauss points in each half cycle without a jump; amplitudes tried, over the mean speed; places in a wave;
# oscillations in a table.
_RULE = gauss(64)
_TRIED = np.concatenate([np.linspace(0.02, 1.0, 50), 1 + np.geomspace(1e-7, 30.0, 150)])
_PLACES, _LISTED = 16, 12


@dataclass(frozen=True, eq=False, repr=False)
class Hfto(Charted):
    """Result of `Stability.hfto`: oscillations of one frequency each, by frequency; `plot` draws amplitudes over it.

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

    _chart = "drilling.charts.hfto_figure"
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
    (1/s) of its modes. Raises SceneError: the torque of the bit does not follow from its speed."""
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
    amplitude = np.array([_of_mode(law, speed, slope) for slope in slopes])
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


def _of_mode(law, speed, slope):
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
