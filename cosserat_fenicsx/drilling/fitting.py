"""Numbers of a drill-string in motion from readings at the rig: `fit`.

Least squares of readings less computed values, over their standard deviations, by `well.estimation`. Stick-slip has
many wrong minima, in which the computed cycles match the readings one cycle off. So the search begins with motions over
the whole range of the unknowns, compared by what does not depend on the phase: means, ranges and the period; and the
best of these are fitted to the first cycles, then to more and more of the readings.

Derivatives are differences of motions with the same step, one motion for each unknown. Changes of 1e-5 of an unknown
leave relative errors of at most 3e-4, in stick-slip and in smooth motions, by either model, against central differences
known to 1e-6; changes of 1e-3 up to 0.07 in stick-slip, those of 1e-8 up to 0.2. Linearised steps would take about as
long, and would miss the same jumps between stick and slip.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import qmc

from cosserat_fenicsx.checks import instance, number, refuse, warn
from cosserat_fenicsx.quantities import BY_UNIT, Quantity, in_si
from cosserat_fenicsx.drilling.choose import chosen, model_of
from cosserat_fenicsx.drilling.history import DrillingHistory
from cosserat_fenicsx.drilling.motion import simulate
from cosserat_fenicsx.drilling.readings import Readings, computed
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.progress import StageProgress
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.results.result import Charted, by_name
from cosserat_fenicsx.scene.parameters import parameter_of, scene_with
from cosserat_fenicsx.well.calibrate import estimated

# Change of an unknown for its derivative, over its range; shares of the readings that are fitted one after the other.
_STEP, _SHARES = 1e-5, (0.12, 0.25, 0.5)
# Motions over the range of the unknowns; how many of them are fitted; the misfit that ends the search.
_SAMPLES, _FITTED, _GOOD = 64, 4, 1.5
_ROUGH, _FINE = {"xtol": 1e-4, "ftol": 1e-4, "gtol": 1e-4, "max_nfev": 12}, {"xtol": 1e-8, "ftol": 1e-9, "gtol": 1e-9}
# Error of derivatives, over their size, above which they are doubted.
_ROUGHLY = 0.05
# Misfit above which scene or readings are wrong; correlation above which two unknowns cannot be distinguished; the
# least effect of an unknown over its range, in standard deviations of one reading; residual (sd) where no motion
# exists.
_BAD, _ALIKE, _SILENT, _NONE = 3.0, 0.95, 1e-3, 1e4


@dataclass(frozen=True, eq=False)
class DrillingFit(Charted):
    """Numbers of a drill-string in motion that fit readings best, from `fit`; `plot` draws the readings, and the motion
    with these numbers, over time.

    Attributes:
        scene: the `Drilling` with these numbers. history: its `DrillingHistory` over the readings.
        names: of the unknowns. units: their SI units. values: (m,).
        interval: (m, 2) Student's confidence intervals, of the linearised problem, scaled by the misfit.
        confidence: of the intervals, such as 0.95. standard_error: (m,).
        correlation: (m, m): close to 1 or -1 where readings determine only a sum or a difference of two.
        clock: s, how much the readings' clock is behind that of the motion, as given, or found as one of the unknowns.
        residuals: {quantity: (n,) readings less computed values, in standard deviations}, NaN where nothing was read.
        left_out: {quantity: times (s) of outliers}.
        misfit: root of the sum of squares of the residuals that are kept, over the readings in excess: 1 where noise
            and model are right.
        doubts: sentences on unknowns that lie on their bounds, on outliers, and on a large misfit; also given as
            warnings.
        readings: as given.
        derivative_error: (m,) of the derivatives at the end, over their size: half of what steps to both sides differ
            by; NaN where there is no motion on one side, or a bound.
    """

    scene: Drilling
    history: DrillingHistory
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    interval: np.ndarray
    confidence: float
    standard_error: np.ndarray
    correlation: np.ndarray
    clock: float
    residuals: dict[str, np.ndarray]
    left_out: dict[str, np.ndarray]
    misfit: float
    doubts: tuple[str, ...]
    readings: Readings
    derivative_error: np.ndarray

    _rows_axis, _chart = "unknown", "drilling.charts.fit_figure"
    _quantities = by_name(
        Quantity("unknown", axes=("unknown",), getter=lambda x: np.array(x.names)),
        Quantity("value", axes=("unknown",), digits=6, getter="values"),
        Quantity("interval", parts=("from", "to"), axes=("unknown",), digits=6),
        Quantity("standard_error", axes=("unknown",), digits=3),
        Quantity("unit", axes=("unknown",), getter=lambda x: np.array(x.units)),
        Quantity("derivative_error", axes=("unknown",), digits=2),
        Quantity("misfit", axes=()),
    )  # fmt: skip
    _on_screen = ("unknown", "value", "interval", "standard_error", "unit")

    def computed(self, name: str, times: Any = None) -> np.ndarray:
        """(n,) a quantity of the motion with these numbers, at times of the readings' clock (s); None for theirs."""
        times = self.readings.times if times is None else np.asarray(times, dtype=float)
        return computed(self.history, name, times + self.clock)

    def __len__(self):
        return len(self.values)

    def _answer(self, units):
        count = sum(np.isfinite(x).sum() for x in self.readings.values.values())
        yield (
            f"{len(self)} unknowns from {count} readings by least squares, with {100 * self.confidence:g} % intervals, "
            "in SI units."
        )
        yield f"misfit {self.misfit:.3g} (1: as the standard deviations say)"
        yield from (f"DOUBTFUL: {doubt}" for doubt in self.doubts)
        alike = [
            f"{a} and {b} ({self.correlation[i, j]:.3f})"
            for i, a in enumerate(self.names) for j, b in enumerate(self.names[:i])
            if abs(self.correlation[i, j]) > _ALIKE
        ]  # fmt: skip
        if alike:
            yield f"Hardly told apart, which change together (correlation): {', '.join(alike)}."


def fit(
    scene: Drilling,
    readings: Readings,
    unknowns: Mapping[str, tuple[float, float]],
    *,
    clock: float | None = 0.0,
    model: str = "auto",
    dt: float | None = None,
    confidence: float = 0.95,
    leave_out: bool = True,
    progress: bool | None = None,
) -> DrillingFit:
    """Numbers of a drill-string such that its motion fits readings at the rig best, by weighted least squares.

    Args:
        scene: a `Drilling`, whose motion begins at time 0.
        readings: `Readings`, with standard deviations.
        unknowns: {name: (least, largest)} of numbers of the scene, in SI, such as "bit.law.static",
            "hole.sections[0].friction" or "drag.torsion".
        clock: s that the readings' time 0 is after the start of the motion; None where it is one more unknown, within
            5 s of it.
        model, dt: see `simulate`.
        confidence: of the intervals, between 0 and 1.
        leave_out: whether outliers are left out, which a warning names: readings more than five deviations from what
            all others say.
        progress: True, False, or None, which shows it in runs of more than two seconds.

    Returns:
        a `DrillingFit`.

    Raises:
        SceneError: an unknown that is no number of the scene, bounds that do not ascend, fewer readings than unknowns,
            or an unknown that no reading depends on (named).
        NotConverged: no motion within the bounds could be computed.
    """
    instance("fit", "scene", scene, Drilling, "a Drilling")
    instance("fit", "readings", readings, Readings, "Readings")
    confidence = number("fit", "confidence", confidence, "a number between 0 and 1", lambda x: 0 < x < 1)
    problem = _Problem(scene, readings, ranges_of(scene, unknowns), clock, model, dt)
    with StageProgress("fit", progress, world()) as at:
        found = []
        for k, start in enumerate(problem.starts(at)):
            found.append(problem.fitted(start, leave_out, at, k))
            if found[-1].misfit < _GOOD:
                break
    # by medians, which outliers do not change
    best = min(found, key=lambda estimate: np.median(np.abs(estimate.residuals)))
    return problem.answer(best, confidence)


def ranges_of(scene, unknowns):
    """{name: (least, largest)}, checked."""
    if not isinstance(unknowns, Mapping) or not unknowns:
        refuse("fit", "unknowns", unknowns, "{'bit.law.static': (least, largest)}")
    found = {}
    for name, ends in unknowns.items():
        here = parameter_of(scene, name)
        unit = here.unit
        if np.shape(ends) == (2,) and unit in BY_UNIT:
            ends = [in_si(f"fit.unknowns['{name}']", x, BY_UNIT[unit]) for x in ends]
        if (
            np.shape(ends) != (2,)
            or any(isinstance(x, str) for x in ends)
            or not -math.inf < ends[0] < ends[1] < math.inf
        ):
            refuse("fit", f"unknowns['{name}']", ends, "two numbers, (least, largest), ascending")
        found[name] = low, high = tuple(map(float, ends))
        if not low <= here.value <= high:
            warn(f"fit: {name} = {here.value:g} {unit} in the scene is outside its bounds, {low:g} to {high:g}: the "
                 "search begins in their middle; expected a value between them, or wider bounds")  # fmt: skip
    return found


class _Problem:
    """Residuals of readings, as functions of unknowns in units of their ranges, from 0 to 1."""

    def __init__(self, scene, readings, ranges, clock, model, dt):
        self._scene, self._readings, self._names = scene, readings, list(ranges)
        self._free_clock = clock is None
        self._clock = 0.0 if clock is None else number("fit", "clock", clock, "a time (s)", math.isfinite)
        low, high = np.array([*ranges.values(), *[(-5.0, 5.0)] * self._free_clock]).T
        self._low, self._size = low, high - low
        self._read = {name: np.isfinite(values) for name, values in readings.values.items()}
        count = sum(x.sum() for x in self._read.values())
        if count <= len(low):
            raise SceneError(f"fit: {count} readings for {len(low)} unknowns: expected more")
        name, _ = chosen(scene, model)
        self._how = {"model": name, "dt": dt or model_of(scene, name, None, None).dt}
        self._known = {}
        for name in self._read:  # a quantity that the model does not have
            if np.isnan(getattr(self.motion(self._middle(), readings.times[0] + 1.0), name)).all():
                raise SceneError(f"fit: readings of {name}: the {self._how['model']} model has none: expected model="
                                 "'axial and torsional', or no such readings")  # fmt: skip

    def _middle(self):
        """The scene's own numbers where they are in range, else the middles."""
        own = [parameter_of(self._scene, name).value for name in self._names] + [self._clock] * self._free_clock
        share = (np.array(own) - self._low) / self._size
        return np.where((share >= 0) & (share <= 1), share, 0.5)

    def numbers(self, shares):
        """(values of the unknowns of the scene, clock)."""
        values = self._low + self._size * shares
        return (values[:-1], values[-1]) if self._free_clock else (values, self._clock)

    def scene_at(self, shares):
        return scene_with(self._scene, self._names, self.numbers(shares)[0])

    def motion(self, shares, until):
        """The `DrillingHistory` up to a time of the readings (s). Raises SceneError, NotConverged: there is none with
        these numbers."""
        values, clock = self.numbers(shares)
        key, duration = tuple(values), max(until + clock, 10 * self._how["dt"]) + 3 * self._how["dt"]
        found = self._known.get(key)
        if found is None or found.times[-1] < duration - 2 * self._how["dt"]:
            # without profiles, which take most of the time of a short motion
            found = simulate(self.scene_at(shares), duration, **self._how, profile_every=duration, progress=False)
            self._known = {key: found}  # the last one; differences of the clock alone use it again
        return found

    def residuals(self, shares, share=1.0):
        """(n,) readings less computed values up to a share of the time, in standard deviations; None without motion."""
        times, clock = self._readings.times, self.numbers(shares)[1]
        until = times[0] + share * (times[-1] - times[0])
        try:
            history = self.motion(shares, until)
        except (SceneError, NotConverged):
            return None
        found = []
        for name, read in self._read.items():
            rows = read & (times <= until)
            apart = self._readings.values[name][rows] - computed(history, name, times[rows] + clock)
            found.append(apart / self._readings.noise[name])
        return np.concatenate(found)

    def starts(self, at):
        """Shares to start from, the most promising first."""
        sampler = qmc.Sobol(len(self._low), seed=1)
        points = [self._middle(), *sampler.random(_SAMPLES)]
        distances = []
        for k, point in enumerate(points):
            if k % 8 == 0:
                at.at(f"search, motion {k + 1} of {len(points)}")
            distances.append(self._distance(point))
        order = [k for k in np.argsort(distances, kind="stable") if distances[k] < math.inf]
        if not order:
            raise NotConverged(
                "fit: no motion within the bounds of the unknowns could be computed: expected narrower bounds"
            )
        return [points[k] for k in order[:_FITTED]]

    def _distance(self, shares):
        """How far a motion is from the readings by what does not depend on the phase; infinite without motion."""
        times = self._readings.times
        try:
            history = self.motion(shares, times[-1])
        except (SceneError, NotConverged):
            return math.inf
        total = 0.0
        for name, read in self._read.items():
            t, measured = times[read], self._readings.values[name][read]
            found = computed(history, name, t + self.numbers(shares)[1])
            scale = max(float(measured.std()), self._readings.noise[name])
            shape = [np.array([x.mean(), x.std(), *np.quantile(x, (0.05, 0.5, 0.95))]) for x in (measured, found)]
            total += float((((shape[0] - shape[1]) / scale) ** 2).sum())
            periods = [_period(t, x) for x in (measured, found)]
            total += float(np.log(periods[0] / periods[1]) ** 2) * 10
        return total

    def fitted(self, start, leave_out, at, k):
        """The `Estimate` from a start."""
        bounds, shares = (np.zeros(len(start)), np.ones(len(start))), np.clip(start, 1e-3, 1 - 1e-3)
        for share in _SHARES:
            if sum((x & (self._readings.times <= self._readings.times[0] + share * np.ptp(self._readings.times))).sum()
                   for x in self._read.values()) > len(start):  # fmt: skip
                at.at(f"start {k + 1}, the first {100 * share:g} % of the readings")
                shares = self._estimate(shares, share, bounds, False, _ROUGH).values
        at.at(f"start {k + 1}, all readings")
        return self._estimate(shares, 1.0, bounds, leave_out, _FINE)

    def _estimate(self, start, share, bounds, leave_out, settings):
        last = {}

        def residuals(x):
            key = tuple(x)
            if key not in last:
                found = self.residuals(x, share)
                last.clear()
                last[key] = np.full(len(first), _NONE) if found is None else found
            return last[key]

        def jacobian(x):
            base, columns = residuals(x), []
            for i in range(len(x)):
                column = self._derivative(x, i, 1, base, share)
                column = self._derivative(x, i, -1, base, share) if column is None else column
                if column is None:
                    raise NotConverged(f"fit: no motion beside {self._told(x)}: expected narrower bounds of unknowns")
                columns.append(column)
            return np.stack(columns, axis=1)

        first = self.residuals(start, share)
        if first is None:
            raise NotConverged(f"fit: no motion with {self._told(start)}: expected narrower bounds of unknowns")
        return estimated(residuals, jacobian, start, bounds, leave_out, settings)

    def _derivative(self, shares, i, sign, base, share=1.0):
        """Of the residuals, which are `base` here, by an unknown; None where there is no motion, or a bound."""
        moved = shares + sign * _STEP * np.eye(len(shares))[i]
        found = self.residuals(moved, share) if 0 <= moved[i] <= 1 else None
        return None if found is None else (found - base) / (sign * _STEP)

    def _derivative_errors(self, shares):
        """(m,) see `DrillingFit`."""
        base, errors = self.residuals(shares), np.full(len(shares), np.nan)
        for i in range(len(shares)):
            up, down = (self._derivative(shares, i, sign, base) for sign in (1, -1))
            if up is not None and down is not None and (up + down).any():
                errors[i] = np.linalg.norm(up - down) / np.linalg.norm(up + down)
        return errors

    def _told(self, shares):
        return ", ".join(f"{name} = {x:.6g}" for name, x in zip(self._names, self.numbers(shares)[0], strict=True))

    def answer(self, found, confidence):
        """The `DrillingFit` of an `Estimate`."""
        names = [*self._names, *["clock"] * self._free_clock]
        effects = np.linalg.norm(found.jacobian, axis=0)
        silent = [name for name, size in zip(names, effects, strict=True) if size < _SILENT]
        if silent:
            raise SceneError(f"fit: no reading depends on {' and '.join(silent)}: expected other unknowns or readings")
        if not np.isfinite(found.covariance).all():
            raise SceneError(
                "fit: the readings do not separate the unknowns: expected fewer of them, or other readings"
            )
        values = self._low + self._size * found.values
        half, error = found.half_widths(confidence) * self._size, found.spread * self._size
        count, scene = len(self._names), self.scene_at(found.values)
        residuals, left_out, at, times = {}, {}, 0, self._readings.times
        for name, read in self._read.items():
            part = slice(at, at + read.sum())
            residuals[name] = np.full(len(times), np.nan)
            residuals[name][read] = found.residuals[part]
            left_out[name] = times[read][~found.kept[part]]
            at = part.stop
        errors = self._derivative_errors(found.values)
        doubts = tuple(self._doubts(found, names, left_out, errors))
        if doubts:
            warn(f"fit: {'; '.join(doubts)}")
        units = [parameter_of(self._scene, name).unit for name in self._names] + ["s"] * self._free_clock
        return DrillingFit(
            scene, self.motion(found.values, times[-1]), tuple(names), tuple(units), values,
            np.stack([values - half, values + half], axis=1), confidence, error, found.correlation,
            float(values[count]) if self._free_clock else self._clock, residuals, left_out, found.misfit, doubts,
            self._readings, errors,
        )  # fmt: skip

    def _doubts(self, found, names, left_out, errors):
        for name, error in zip(names, errors, strict=True):
            if error > _ROUGHLY:
                yield (
                    f"the derivative by {name} is known to {100 * error:.2g} % alone, and its interval no better: the "
                    "motion changes at once between stick and slip; expected other readings, or a fixed number"
                )
        for name, times in left_out.items():
            if len(times):
                first = ", ".join(f"{t:.5g}" for t in times[:5]) + (", ..." if len(times) > 5 else "")
                yield (
                    f"left out: {len(times)} readings of {name} far from what all others say, at t = {first} s; "
                    "leave_out=False keeps them"
                )
        if found.misfit > _BAD:
            yield (
                f"misfit {found.misfit:.3g} where 1 is as the noise says: the numbers are not to be relied on: "
                "expected other unknowns, a scene closer to the rig, or the clock of the readings (clock=None finds it)"
            )
        for i, name in enumerate(names):
            if found.values[i] < 1e-6 or found.values[i] > 1 - 1e-6:
                yield f"{name} lies on its bound: expected a wider one"


def _period(times, values):
    """The time (s) between two maxima of the autocorrelation of values; the whole time where they do not oscillate."""
    span = times[-1] - times[0]
    if len(times) < 8 or not np.ptp(values) > 0:
        return span
    even = np.interp(np.linspace(times[0], times[-1], len(times)), times, values - values.mean())
    power = np.abs(np.fft.rfft(even, 2 * len(even))) ** 2
    auto = np.fft.irfft(power)[: len(even)] / np.arange(len(even), 0, -1)
    below = np.flatnonzero(auto < 0)
    if not len(below) or below[0] > len(auto) // 2:
        return span
    lag = below[0] + int(np.argmax(auto[below[0] : len(auto) // 2 + below[0]]))
    return max(lag, 1) * span / (len(times) - 1)
