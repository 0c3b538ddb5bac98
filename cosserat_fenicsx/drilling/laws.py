"""Laws of friction, at the wall and at the bit.

The resistance is anything up to R(0) at rest, and R(s) against a slip speed s > 0. Models ask laws for a `Resistance`:
the exponential law in closed form, or any other one as a function in Python. C sees it as a small record (strings.h);
it calls the function at one place, such as the bit, or samples it for many, such as the wall. The linear theory takes
the slope.
"""

import functools
import math
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from cosserat_fenicsx.checks import call, number
from cosserat_fenicsx.errors import SceneError

#: C sources of the models of strings.
SOURCES = tuple(Path(__file__).with_name(f"{name}.c") for name in ("strings", "waves", "elements", "step"))
#: Slips at which functions are sampled, 128 a decade: the error of a smooth law is about 1e-9 of it.
SLIPS = np.geomspace(1e-6, 1e3, 9 * 128 + 1)
# Relative step of slopes by differences; share of the change between neighbours that is left of a drop; bisections.
_STEP, _STAYS, _HALVINGS = 1e-5, 0.5, 45
# Difference of slopes of the second and the fourth order at a jump, over that of secants, is 1/12.
_ROUGH = 0.02
# Value at the least slip, over the largest one, of a law that is smooth through zero; error of a table, likewise.
_SMOOTH, _CLOSE = 1e-3, 1e-8
# Intervals of loads, at first and at most.
_FEWEST, _MOST = 8, 64


@dataclass(frozen=True)
class Resistance:
    """R(s) = slipping + (still - slipping) exp(-s/decay), anything up to `still` at rest; or a function. still: largest
    resistance at rest, N m or a coefficient of friction. slipping: resistance to fast slip; of a function just above
    rest. decay: speed; 0 where the resistance drops at once, and for a function; function: R(s) for a number s above 0,
    m/s or rad/s. fall: its steepest fall where it is continuous. drops: whether it drops at some speed."""

    still: float
    slipping: float
    decay: float = 0.0
    function: Callable[[float], float] | None = None
    fall: float = 0.0
    drops: bool = False

    def __call__(self, s):
        """R at slips (n,) or a number, above 0."""
        if self.function is not None:
            return np.array([*map(self.function, np.ravel(s))]).reshape(np.shape(s))
        falling = np.exp(-np.asarray(s) / self.decay) if self.decay > 0 else 0.0
        return self.slipping + (self.still - self.slipping) * falling

    def slope(self, s: float) -> float:
        """dR/ds at a slip; the steepest one at 0."""
        if s == 0:
            return -self.steepest
        if self.function is not None:
            return slope_of(self.function, s)
        return -self.steepest * math.exp(-s / self.decay) if self.decay > 0 else 0.0

    @property
    def kinetic(self) -> float:
        """Resistance to fast slip; of a function at 1 m/s or 1 rad/s."""
        return self.slipping if self.function is None else self.function(1.0)

    @property
    def steepest(self) -> float:
        """The steepest fall, -dR/ds, where it does not drop at once."""
        return (self.still - self.slipping) / self.decay if self.decay > 0 else self.fall

    def slowest_with(self, slope: float) -> float:
        """The slip above which R falls less steeply than a (negative) slope; 0 where it does so everywhere."""
        if self.steepest <= -slope:
            return 0.0
        if self.function is None:
            return self.decay * math.log(-self.steepest / slope)
        steep = np.flatnonzero([self.slope(s) < slope for s in SLIPS])
        if not len(steep):
            return 0.0
        if steep[-1] == len(SLIPS) - 1:
            return math.inf
        return brentq(lambda s: self.slope(s) - slope, *SLIPS[steep[-1] : steep[-1] + 2], xtol=1e-12)


def slope_of(function, s):
    """dR/ds of a function at s > 0, by differences."""
    h = _STEP * s
    return (function(s + h) - function(s - h)) / (2 * h)


def by_method(owner, name, *more) -> Resistance:
    """The `Resistance` of a method of a user's object, see `checked`; cached for equal objects. Raises SceneError: its
    value is 0 at rest and not beyond; see `checked`."""
    return (_sampled if hashable(owner) else _sampled.__wrapped__)(owner, name, *more)


def hashable(owner) -> bool:
    """Whether what is found for an object can be kept for equal ones: not where a field is an array, for example."""
    try:
        hash(owner)
    except TypeError:
        return False
    return True


@functools.lru_cache(64)
def _sampled(owner, name, *more):
    function = checked(owner, name, *more)
    still, values = function(0.0), np.array([function(s) for s in SLIPS])
    if still == 0 and values[0] > _SMOOTH * values.max():
        raise SceneError(
            f"{type(owner).__name__}.{name} = 0 at the speed 0: expected the largest value at rest, above 0 where "
            "there is one in motion"
        )
    fall, drops = _steepest_fall(function, values)
    return Resistance(still, float(values[0]), 0.0, function, fall, drops or still > values[0] * (1 + 1e-3))


def checked(owner, name, *more):
    """A method of a user's object as a checked function of a speed s from 0 on, with more arguments. Raises SceneError:
    by the function, where the method fails, or its value is no number from 0 on."""
    method, where = getattr(owner, name), f"{type(owner).__name__}.{name}"

    def function(s):
        value = call(lambda x: method(x, *more), float(s), where, " at the speed {:g}")
        if type(value) is float and 0 <= value < math.inf:  # every step asks
            return value
        return number(owner, name, value, f"a number, not negative, at the speed {s:g}", lambda x: 0 <= x < math.inf)

    return function


def _steepest_fall(function, values):
    """The steepest fall between neighbours of `SLIPS` where a function is continuous; whether it drops elsewhere."""
    falls, drops = -np.diff(values) / np.diff(SLIPS), False
    for k in np.argsort(falls)[::-1]:
        if falls[k] <= 0:
            break
        low, high, above, below = SLIPS[k], SLIPS[k + 1], values[k], values[k + 1]
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            value = function(middle)
            if above - value > value - below:
                high, below = middle, value
            else:
                low, above = middle, value
        if above - below < _STAYS * (values[k] - values[k + 1]):
            return float(falls[k]), drops
        drops = True
    return 0.0, drops


def _slopes(values, h):
    """Slopes at points a distance h apart, of the fourth order where smooth; cubics are monotone where values are."""
    secants, slopes = np.diff(values, axis=0) / h, np.empty_like(values)
    slopes[2:-2] = (8 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / (12 * h)
    ends = np.array([[-25, 48, -36, 16, -3], [-3, -10, 18, -6, 1]]) / (12 * h)
    slopes[:2], slopes[-1:-3:-1] = ends @ values[:5], -ends @ values[-1:-6:-1]
    before, after = secants[:-1], secants[1:]
    most = np.where(before * after > 0, 3 * np.minimum(abs(before), abs(after)), np.maximum(abs(before), abs(after)))
    # beside a smooth maximum a secant may vanish, but slopes of second and fourth order agree
    rough = np.abs(slopes[1:-1] - (before + after) / 2) > _ROUGH * np.abs(after - before)
    slopes[1:-1] = np.where(rough, np.clip(slopes[1:-1], -most, most), slopes[1:-1])
    return slopes


def _cubics(values):
    """Cubics over ln s through values at `SLIPS`."""
    x = np.log(SLIPS)
    return CubicHermiteSpline(x, values, _slopes(values, x[1] - x[0]))


@dataclass(frozen=True)
class Surface:
    """R over slip and load: cubics over the slip at some loads, and cubics between the loads. loads: (m,) ascending, N,
    or (1,) where R does not depend on them. values, rise: splines over ln s, or over s where not `logarithmic`, of R
    (m,) and of its slope by the load at these loads; constant beyond; still: (2, m) the same at rest."""

    loads: np.ndarray
    values: CubicHermiteSpline
    rise: CubicHermiteSpline
    still: np.ndarray
    logarithmic: bool = False

    def __call__(self, slip: float, load: float) -> float:
        x = np.clip(math.log(slip) if self.logarithmic else slip, *self.values.x[[0, -1]])
        if len(self.loads) == 1:
            return float(self.values(x)[0])
        return max(0.0, float(CubicHermiteSpline(self.loads, self.values(x), self.rise(x))(load)))


@functools.lru_cache(16)
def surface_of(owner, name: str, most: float) -> Surface | None:
    """A method (slip, load) of a user as a `Surface` for loads up to `most` (N); None where that is not accurate."""
    loads, x = np.linspace(0.0, most, _FEWEST + 1), np.log(SLIPS)
    for load in loads[:: _FEWEST // 2]:
        if tabulated(by_method(owner, name, float(load))) is None:
            return None

    def at(load):
        function = checked(owner, name, float(load))
        return np.array([function(0.0), *map(function, SLIPS)])

    rows = np.array([at(load) for load in loads]).T
    while len(loads) <= _MOST + 1:
        rise = _slopes(rows.T, loads[1]).T
        values, rises = (CubicHermiteSpline(x, y[1:], _slopes(y[1:], x[1] - x[0])) for y in (rows, rise))
        middles = (loads[:-1] + loads[1:]) / 2
        between = np.array([at(load) for load in middles]).T
        found = CubicHermiteSpline(loads, rows, rise, axis=1)(middles)
        if np.abs(found - between).max() <= _CLOSE * rows.max():
            return Surface(loads, values, rises, np.array([rows[0], rise[0]]), True)
        loads = np.sort(np.append(loads, middles))
        both = np.empty((len(rows), len(loads)))
        both[:, ::2], both[:, 1::2] = rows, between
        rows = both
    return None


def tabulated(resistance: Resistance) -> CubicHermiteSpline | None:
    """The table of a function over ln s which differs from it by at most 1e-8 of its range, None where it has none."""
    if resistance.function is None or resistance.drops:
        return None
    values, middles = resistance(SLIPS), np.sqrt(SLIPS[:-1] * SLIPS[1:])
    table = _cubics(values)
    close = np.abs(table(np.log(middles)) - resistance(middles)).max() <= _CLOSE * values.max()
    return table if close else None


class InC:
    """A `Resistance` for C, with the memory that C refers to. ffi: of the module in C. resistance: the `Resistance`.
    function: of slip (a number) and load (N), which C calls for every value, or beyond the loads of the surface; None
    to sample the resistance's own function, if it has one. surface: a `Surface`, or None. failure: the exception that
    ended the last call of the function, if any."""

    def __init__(self, ffi, resistance: Resistance, function=None, surface=None):
        self.failure, self.function, self._ffi, self._resistance = None, function, ffi, resistance
        if function is not None:
            _answers(ffi)
            self._handle = ffi.new_handle(weakref.ref(self))
        elif surface is None and resistance.function is not None:
            values = _cubics(resistance(SLIPS)[:, None])
            surface = Surface(np.zeros(1), values, values, np.zeros((2, 1)), True)
        self._surface = surface
        if surface is not None:
            splines = [np.ascontiguousarray(x.c.transpose(2, 1, 0)) for x in (surface.values, surface.rise)]
            self._arrays = {"cubics": splines[0], "rise": splines[1], "loads": np.array(surface.loads),
                            "still": np.array(surface.still), "knots": np.array(surface.values.x)}  # fmt: skip

    def fill(self, curve):
        """Fill C's record of a `curve`; a law in closed form needs none, and leaves it empty."""
        law = self._resistance
        if law.function is None:
            return
        curve.fall, curve.drop = law.fall, math.inf if law.drops else law.fall
        if self.function is not None:
            curve.self = self._handle
        if self._surface is not None:
            knots = self._surface.values.x
            curve.count, curve.rows, curve.logarithmic = (
                len(knots) - 1,
                len(self._surface.loads),
                self._surface.logarithmic,
            )
            curve.first, curve.width = knots[0], (knots[-1] - knots[0]) / curve.count
            for name, array in self._arrays.items():
                setattr(curve, name, self._ffi.cast("double *", array.ctypes.data))

    def put(self, friction, curve):
        """Fill C's record of a `friction`, and that of its curve; both are pointers."""
        law = self._resistance
        friction.still, friction.slipping, friction.decay = law.still, law.slipping, law.decay
        friction.scale = friction.reach = 1.0
        self.fill(curve)
        if law.function is not None:
            friction.other = curve

    def raise_failure(self):
        """Raise the exception that was kept, if any."""
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure


@functools.cache
def _answers(ffi):
    """Let C call the functions of `InC`."""

    def keep(kind, failure, trace):  # C cannot pass it on
        ffi.from_handle(trace.tb_frame.f_locals["owner"])().failure = failure.with_traceback(trace)

    @ffi.def_extern(name="call_law", error=math.nan, onerror=keep)
    def called(owner, slip, load, slope):
        function = ffi.from_handle(owner)().function
        slope[0] = slope_of(lambda s: function(s, load), slip) if slip > 0 else 0.0
        return function(slip, load)

    return called


def refuse_several_speeds(slope: float, impedance: float, inertia: float, where: str = "") -> None:
    """Refuse a bit whose torque falls faster than the string can follow.

    Without inertia at the lower end, a wave with the torque M_in meets T(om) + Z om = 2 M_in, Z the impedance of the
    lowest section. Where the torque T of the bit falls faster than Z om grows, several speeds satisfy it, and the
    linear theory has unstable roots at all frequencies.

    Args:
        slope: dT/dom, N m s/rad, negative where the torque falls. impedance: Z, J sqrt(G rho), N m s/rad.
        inertia: at the bit, kg m^2; with any, the speed is single-valued. where: words, such as " at 3 rad/s".

    Raises:
        SceneError: -slope is not below the impedance, and there is no inertia.
    """
    if inertia == 0 and -slope >= impedance:
        raise SceneError(
            f"BitOnRock.law: its torque falls by {-slope:.6g} N m per rad/s{where}, and the impedance of the string at "
            f"the bit is {impedance:.6g} N m s/rad: expected a law less steep than that, or BitOnRock.inertia (kg m^2) "
            "above 0; without inertia several speeds of the bit are possible at the same time"
        )


def check_bit(scene) -> None:
    """Refuse a bit of a `Drilling` whose law falls too steeply at slow rotation; a torque that drops at once passes.
    Raises SceneError: see `refuse_several_speeds`."""
    law = None if scene.bit is None else scene.bit.law.resistance(scene.bit.most)
    if law is not None and scene.discs is None:  # the last one of Discs has inertia
        impedance = scene.segments[-1].torsional_impedance
        refuse_several_speeds(-law.steepest, impedance, scene.bit_inertia, " at slow rotation")
