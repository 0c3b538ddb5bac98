"""Limits of stability: slope of the bit's torque, speed and weight at which a first mode begins to grow; and waves that
a drive, or a bit without inertia, sends back larger than they come.

At a real frequency a drive of the impedance Zd reflects waves in a string of the impedance Z by |(Zd - Z)/(Zd + Z)|.
Where that is R, above 1, and waves lose exp(-2 a) on their way down the string and up again, in the time 2 T, they
grow by about (log R - 2 a)/(2 T) 1/s, where the lower end reflects them whole. A control that acts late does so at high
frequencies, and one with two filters in a row, unless another filter or the losses of the string prevent it.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import brentq

from cosserat_fenicsx.checks import number, positive, refuse, warn
from cosserat_fenicsx.drilling.linear.characteristic import Steady, box_up_to, speed_of
from cosserat_fenicsx.drilling.linear.impedances import torsional
from cosserat_fenicsx.drilling.linear.roots import all_roots
from cosserat_fenicsx.drilling.linear_control import arrays_of
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.errors import NotConverged, SceneError


# Degree of the polynomials on pieces of the imaginary axis; their largest relative error.
_DEGREE, _RESOLVED = 24, 1e-11
# Most times that a piece is halved; most pieces at a time over those at first.
_HALVED, _MORE = 32, 16
# Steps in a period that resolve it; samples of the impedance from mode to mode.
_STEPS, _TO_A_MODE = 4, 40
# Weight on bit (N) that is as good as infinite.
_HEAVIEST = 1e8


def critical_slopes(scene: Drilling, up_to: float = 10.0, speed: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """All slopes of the bit's torque at which some mode neither grows nor decays.

    Falling and rising torques, where Im(Jb s + Z(s)) = 0 at s = i w: kappa = -Re Z.

    Args:
        scene: a `Drilling`; its bit gives the inertia alone, and its weight on bit the force at the wall.
        up_to: highest frequency, Hz. speed: rotation, rad/s, on which friction at the wall depends; None for that of
            the drive.

    Returns:
        circular frequencies w (n,), rad/s, ascending, and slopes kappa = dT/dom (n,), N m s/rad, negative for a torque
        that falls with the speed. The largest one is where the first mode begins to grow. The slope at w = 0 where a
        drive without an integral part gives way is the first of them; there the speed itself runs away.

    Raises:
        SceneError: a frequency that is not positive; a speed that is needed, and that the drive does not have.
        NotConverged: the impedance could not be resolved.
    """
    guide = _torsion(scene, speed)
    top = 2 * math.pi * positive("critical_slopes", "up_to", up_to, "Hz")

    def parts(w):
        om, B, *_ = guide.bit(1j * np.asarray(w))
        return B * np.conj(om), np.abs(om) ** 2

    width = 0.47 * math.pi / guide.travel  # no edge at a frequency of a uniform string
    found = _real_roots(lambda w: parts(w)[0].imag, np.linspace(0.0, top, 1 + max(1, math.ceil(top / width))))
    # at rest: both are 0 by symmetry; the slope is a limit unless the drive holds the string there
    at = found[found > 1e-9 * width]
    ends, sizes = parts(np.append(0.0, at))
    keep = sizes > 1e-24 * np.abs(ends)
    return np.append(0.0, at)[keep], -(ends.real[keep] / sizes[keep])


def _torsion(scene, speed):
    """The torsional `Guide` of a scene at a speed (rad/s), None for that of its drive."""
    if scene.hole is None and not any(motor.curves for motor in scene.motors):
        return torsional(scene)
    speed = speed_of("critical_slopes", scene, speed)
    return Steady(scene).guides(speed, scene.bit and scene.bit.weight)[0]


def _real_roots(f, edges):
    """All real roots of a smooth function from the first to the last of the edges, ascending, by interpolating
    polynomials between these, all at once."""
    nodes, near = chebyshev.chebpts1(_DEGREE + 1), []
    to_series = chebyshev.chebvander(nodes, _DEGREE) * 2 / len(nodes)
    to_series[:, 0] /= 2
    low, high = edges[:-1], edges[1:]
    for halved in range(_HALVED + 1):
        middle, half = (low + high) / 2, (high - low) / 2
        places = middle[:, None] + half[:, None] * nodes
        series = f(places.ravel()).reshape(places.shape) @ to_series
        size = np.abs(series).max(axis=1)
        fine = np.abs(series[:, -3:]).max(axis=1) <= _RESOLVED * size
        if halved == _HALVED and not fine.all() or np.count_nonzero(~fine) > _MORE * len(edges):
            k = fine.argmin()
            raise NotConverged(f"the impedance from {low[k]:.6g} to {high[k]:.6g} rad/s could not be resolved")
        for k in np.flatnonzero(fine & (size > 0)):
            roots = chebyshev.chebroots(chebyshev.chebtrim(series[k], 1e-15 * size[k]))
            inside = (np.abs(roots.imag) < 1e-7) & (roots.real >= -1) & (roots.real < 1)
            near += [(middle[k] + half[k] * x, 2e-6 * half[k]) for x in roots.real[inside]]
        low, high, middle = low[~fine], high[~fine], middle[~fine]
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        if not len(low):
            break
    if not near:
        return np.zeros(0)
    w, h = np.array(sorted(near)).T
    start, end = w - h, w + h
    before, after = f(start), f(end)
    changes = before * after < 0
    # within these 1e-6 of a piece the function is a line, its curvature 1e-12 of the piece: two secants are exact
    for _ in range(2):
        share = np.divide(before, before - after, out=np.full_like(w, 0.5), where=before != after)
        w = np.where(changes, start + share * (end - start), w)
        start, end, before, after = end, w, after, f(w)
    return w[np.diff(w, prepend=-1.0) > 1e-12 * edges[-1]]


def critical_slope(scene: Drilling, up_to: float = 10.0, speed: float | None = None) -> tuple[float, float]:
    """(kappa, w): the largest critical slope (N m s/rad) and its circular frequency (rad/s), see `critical_slopes`.

    With a torque that falls less steeply all modes up to that frequency decay. Minus infinity where no slope is
    critical.
    """
    frequencies, slopes = critical_slopes(scene, up_to, speed)
    if not len(slopes):  # nothing to lose in so narrow a band
        return -math.inf, math.nan
    first = int(slopes.argmax())
    # a string without losses: the slope is 0 up to rounding
    lost = abs(slopes[first]) < _RESOLVED * torsional(scene).impedance
    return 0.0 if lost else float(slopes[first]), float(frequencies[first])


def limit_weight(scene: Drilling, speed: float, *, up_to: float = 10.0) -> float:
    """The weight on bit up to which all modes decay at a speed. A drive that feeds waves faster than `up_to` is warned
    of.

    Args:
        scene: a `Drilling` whose bit has a `Stribeck` law with a radius.
        speed: rotation, rad/s.
        up_to: highest frequency of modes, Hz.

    Returns:
        N; infinite where the torque does not fall, 0 where the string has no losses.

    Raises:
        SceneError: a law whose torque does not depend on the weight.
    """
    speed = positive("limit_weight", "speed", speed, "rad/s")
    _doubt_drive("limit_weight", scene, up_to)
    law = scene.bit.law if scene.bit else None
    if law is None or law.drills or not law.needs_weight or law.resistance(1.0) is None:
        refuse("limit_weight", "scene", scene.bit, "a bit with a Stribeck law and a radius")
    if scene.motor is not None:
        refuse("limit_weight", "scene", scene.motor, "a string without a motor, the speed of whose bit depends on the "
               "weight; stability takes any weights")  # fmt: skip
    per_newton, per_kilonewton = (law.resistance(weight).slope(speed) / weight for weight in (1.0, 1e3))
    if not math.isclose(per_newton, per_kilonewton, rel_tol=1e-4):
        refuse("limit_weight", "scene", scene.bit, "a bit whose torque is proportional to the weight on bit; stability "
               "takes any law")  # fmt: skip
    if not per_newton:
        return math.inf

    @cache
    def excess(weight):  # of the critical slope over the bit's; it grows with the weight
        return critical_slope(scene.with_case(weight=weight), up_to, speed)[0] - per_newton * weight

    first = abs(critical_slope(scene, up_to, speed)[0] / per_newton)
    if not _falls_at_wall(scene):
        return first
    low = high = min(max(first, 1.0), _HEAVIEST)
    while excess(low) > 0:
        low, high = low / 4, low
        if high < 1.0:
            return 0.0
    while excess(high) < 0:
        low, high = high, 2 * high
        if low > _HEAVIEST:
            return math.inf
    return brentq(excess, low, high, rtol=1e-10)


def _doubt_drive(owner, scene, up_to):
    """Warn of a drive that feeds waves above a frequency, Hz."""
    if fed := fed_waves(scene, up_to):
        warn(f"{owner}: at every speed and weight {fed}")


def searches(scene):
    """Whether `limit_speed` looks at many speeds, for seconds: friction at the wall falls with the slip, a motor
    turns what is below, or the bit cuts."""
    cuts = scene.bit is not None and scene.bit.law.drills
    return cuts or _falls_at_wall(scene) or scene.motor is not None


def _falls_at_wall(scene):
    """Whether friction at the wall falls with the slip."""
    return scene.hole is not None and scene.friction is not None and scene.friction.decays


def limit_speed(
    scene: Drilling,
    weight: float | None = None,
    *,
    up_to: float = 10.0,
    between: tuple[float, float] = (0.5, 50.0),
    points: int = 60,
) -> float:
    """The lowest speed from which on all modes decay, up to a frequency; a drive that feeds faster waves is warned of.

    Of small motions about a steady rotation: from rest a bit may stick and slip on at higher speeds, see `simulate`.

    Args:
        scene: a `Drilling`. weight: on bit, N; None for that of the scene.
        up_to: highest frequency of modes, Hz.
        between, points: range (rad/s) and number of the speeds searched for a bit that cuts, or where friction at the
            wall falls with the slip; a range of growth between two of them is missed.

    Returns:
        rad/s; 0 where all modes decay at every speed, infinite where the string has no losses. Where speeds are
        searched: infinite where some mode grows at the highest of the speeds, 0 where none does at any.

    Raises:
        SceneError: numbers that are not positive, or a bit without a law.
        NotConverged: the roots that were found are fewer than those counted.
    """
    up_to = positive("limit_speed", "up_to", up_to, "Hz")
    _doubt_drive("limit_speed", scene, up_to)
    if scene.bit is None and not searches(scene):
        refuse(scene, "bit", None, "a BitOnRock with a law, or a WallFriction that falls with the slip")
    if weight is not None:
        weight = positive("limit_speed", "weight", weight, "N")
    elif scene.bit is not None:
        weight = scene.bit.weight
    steady = Steady(scene)
    if searches(scene):
        return _searched_limit(steady, weight, up_to, between, points)
    law = scene.bit.law.resistance(weight)
    if law is None or law.steepest == 0:
        return 0.0
    kappa, _ = critical_slope(scene.with_case(weight=weight), up_to, 1.0)  # nothing falls at the wall
    if -law.steepest >= kappa:
        return 0.0
    return math.inf if kappa >= 0 else law.slowest_with(kappa)


def _searched_limit(steady, weight, up_to, between, points):
    number("limit_speed", "points", points, "a number from 2", lambda x: x >= 2 and x == int(x))
    low, high = (positive("limit_speed", "between", x, "rad/s") for x in between)
    box = box_up_to(steady, 2 * math.pi * up_to)

    def growth(speed):
        f = steady.equation(steady.parameters(speed, weight))
        roots, _ = all_roots(f, box(f), f.spacing)
        return float(roots.real.max(initial=box(f).left))

    speeds = np.geomspace(high, low, int(points))
    for k, speed in enumerate(speeds):
        if growth(speed) > 0:
            return math.inf if k == 0 else brentq(growth, speed, speeds[k - 1], xtol=1e-12, rtol=1e-10)
    return 0.0


# Sampled frequencies (Hz); the lowest times the travel time of the string, the highest over the rates of the control,
# 1/s. A slower growth (1/s) is not told.
_SAMPLES, _LOWEST, _HIGHEST, _SLOW = 6000, 0.1, 10.0, 1e-3


class FedWaves(NamedTuple):
    """Waves that grow: lowest, highest and fastest of the frequencies (Hz), and how fast, 1/s."""

    low: float
    high: float
    fastest: float
    growth: float

    def __str__(self):
        return (
            f"the drive sends waves of {self.low:.3g} to {self.high:.3g} Hz back larger than they come, by more than "
            f"the string loses: those of {self.fastest:.3g} Hz grow by about {self.growth:.2g} 1/s. A longer filter or "
            "a shorter delay of its control helps; "
            f"stability(..., up_to={math.ceil(1.2 * self.fastest)}) has the fastest"
        )


def fed_waves(scene, above: float = 0.0) -> FedWaves | None:
    """The `FedWaves` of a `Drilling` above a frequency (Hz), in torsion; None where there are none, for `Discs`, and
    for controls that the linear theory does not know."""
    control = scene.drive.control
    if scene.discs:
        return None
    try:
        Z = scene.segments[0].torsional_impedance
        gains = control.gains(Z)
        rates = [] if gains.linear is None else [*np.abs(np.linalg.eigvals(arrays_of(gains.linear)[0]))]
        rates += [1 / control.late] if control.late else []
        if not rates:  # of most controls
            return None
        guide = torsional(scene)
    except SceneError:  # a control without gains
        return None
    lowest, highest = max(above, _LOWEST / guide.travel), _HIGHEST * max(rates)
    if lowest >= highest:
        return None
    f = np.geomspace(lowest, highest, _SAMPLES)
    s = 2j * math.pi * f
    w, P, *_ = guide.top(s)
    sent, come = np.abs(P + Z * w), np.abs(P - Z * w)
    lost = sum(part.decay(s) for part in guide.parts)
    growth = (np.log(sent / np.maximum(come, 1e-12 * sent)) - 2 * lost) / (2 * guide.travel)
    k, grows = int(growth.argmax()), growth > _SLOW
    if not grows[k]:
        return None
    first, last = np.flatnonzero(grows)[[0, -1]]
    return FedWaves(*map(float, (f[first], f[last], f[k], growth[k])))


def fed_by_bit(scene: Drilling, dt: float) -> str:
    """A sentence on modes that a bit without inertia feeds at the speed of the drive, as fast as steps of dt (s)
    resolve: they grow however fast they are, so that the motion depends on the step. "" where there are none, and where
    the linear theory does not know the speed or the torque.

    Modes are where Im Z(iw) = 0, of the impedance at the bit; they grow if the torque falls by more than Re Z there.
    """
    if scene.bit is None or scene.discs or scene.bit_inertia or scene.bit.law.drills:
        return ""
    top = 2 * math.pi / (_STEPS * dt)
    try:
        speed = speed_of("simulate", scene)
        kappa = Steady(scene).parameters(speed, scene.bit.weight)[0]
        if not kappa < 0:
            return ""
        guide = _torsion(scene, speed)
    except SceneError:
        return ""
    w = np.linspace(top / 2, top, 1 + math.ceil(_TO_A_MODE * top / 2 * guide.travel / math.pi))
    Z = guide.impedance_at_bit(1j * w)
    small = np.abs(Z) < guide.impedance  # elsewhere Im Z changes its sign between two modes
    at = np.flatnonzero((Z.imag[:-1] * Z.imag[1:] <= 0) & small[:-1] & small[1:])
    share = Z.imag[at] / (Z.imag[at] - Z.imag[at + 1])
    grows = w[at][(1 - share) * Z.real[at] + share * Z.real[at + 1] < -kappa]
    if not len(grows):
        return ""
    return (
        "the bit has no inertia and its torque falls with the speed, so that modes up to "
        f"{grows[-1] / (2 * math.pi):.3g} Hz and more grow at {speed * 30 / math.pi:.4g} rpm: the motion depends on "
        "the step, and may have stick-slip with another one; give BitOnRock.inertia, kg m^2"
    )
