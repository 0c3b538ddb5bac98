"""Coefficients of friction from measured hook loads and torques, by least squares, with what outliers do to them.

A reading far from what all others say moves a fit by least squares as far as it likes. Cauchy's loss, whose weights
fall with the square of the distance, finds it: readings more than five deviations from that fit are left out, and the
least squares of the others are the answer. The deviation is 1, as the readings' standard deviations say, or, where all
scatter more, 1.48 times the median distance, which for a normal distribution is the same.
"""

import math
import warnings
from collections import namedtuple
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Annotated

import numpy as np
from scipy.optimize import least_squares, lsq_linear
from scipy.stats import t as student

from cosserat_fenicsx.checks import instance, number, refuse, warn
from cosserat_fenicsx.errors import SceneError, SceneWarning
from cosserat_fenicsx.parts import Depth, ForceSize, Part, Torque, positive
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.result import Charted, by_name
from cosserat_fenicsx.well.components import STEEL, DrillString
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.operations import Operation, doubt_load
from cosserat_fenicsx.well.solve import BUCKLED, SOFT, torque_and_drag


# Deviations beyond which a reading is an outlier; the largest share of the readings that may be; the scales of Cauchy's
# loss, one after the other, in deviations; the median distance of a normal distribution, over its deviation, inverted.
_FAR, _MOST, _SCALES, _MEDIAN = 5.0, 0.3, (4.0, 2.0, 1.0), 1.4826
# Width (%) of the interval of a change of the string's weight up to which readings tell whether it is right.
_TELLS = 5.0
_TOLERANCES = {"xtol": 1e-10, "ftol": 1e-12, "gtol": 1e-12}


@dataclass(frozen=True)
class Estimate:
    """Unknowns that fit readings best.

    Attributes:
        values: (m,). jacobian: (k, m) of the residuals of the readings that are kept.
        residuals: (n,) of all readings, in standard deviations. kept: (n,) False for outliers.
        misfit: root of the sum of squares of the k residuals over their excess k - m.
        covariance: (m, m) of the linearised problem, scaled by the misfit; infinite where it is singular.
    """

    values: np.ndarray
    jacobian: np.ndarray
    residuals: np.ndarray
    kept: np.ndarray
    misfit: float
    covariance: np.ndarray

    @property
    def excess(self):
        """Readings that are kept, less unknowns."""
        return len(self.jacobian) - len(self.values)

    @property
    def spread(self):
        """(m,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    def half_widths(self, confidence):
        """(m,) halves of Student's confidence intervals."""
        return student.ppf((1 + confidence) / 2, self.excess) * self.spread

    @property
    def correlation(self):
        """(m, m)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.covariance / np.outer(self.spread, self.spread)


def estimated(residuals, jacobian, start, bounds, leave_out=True, settings=_TOLERANCES):
    """The `Estimate` of unknowns.

    Args:
        residuals: function of the unknowns (m,) that gives (n,) measured less computed values, in standard deviations.
        jacobian: function that gives their derivatives (n, m), or "2-point".
        start: (m,) first values. bounds: two of (m,).
        leave_out: whether outliers are left out. settings: tolerances of `scipy.optimize.least_squares`.
    """

    def fit(kept, first, loss="linear", scale=1.0):
        of_kept = jacobian if isinstance(jacobian, str) else lambda x: jacobian(x)[kept]
        return least_squares(lambda x: residuals(x)[kept], first, of_kept, bounds, loss=loss, f_scale=scale, **settings)

    def outliers(found):
        size = np.abs(residuals(found.x))
        return size > _FAR * max(1.0, _MEDIAN * np.median(size))

    everything = np.full(len(residuals(np.asarray(start, dtype=float))), True)
    found, kept = fit(everything, start), everything
    if leave_out and np.abs(found.fun).max() > _FAR:
        robust = found
        for factor in _SCALES:
            deviation = max(1.0, _MEDIAN * np.median(np.abs(robust.fun)))
            robust = fit(everything, robust.x, "cauchy", factor * deviation)
        far = outliers(robust)
        if 0 < far.sum() <= _MOST * len(far) and (~far).sum() > len(start):
            again = fit(~far, robust.x)
            if np.array_equal(outliers(again), far):  # and not a matter of which ones are left out first
                found, kept = again, ~far
    excess = len(found.fun) - len(found.x)
    misfit = float(np.sqrt(2 * found.cost / excess))
    information = found.jac.T @ found.jac
    try:
        covariance = np.linalg.inv(information) * misfit**2
    except np.linalg.LinAlgError:
        covariance = np.full_like(information, np.inf)
    return Estimate(found.x, found.jac, residuals(found.x), kept, misfit, covariance)


@dataclass(frozen=True)
class _Fit:
    """Settings of the fit."""

    start: float = 0.2  # first value of the coefficients
    most: float = 2.0  # upper bound of the coefficients
    tol: float = 1e-10  # of the answers that are compared
    block: float = 1e5  # unit of the block's weight in the search, N
    bad: float = 3.0  # misfit above which readings or string are wrong; its fall where the cause is found
    other_unit: float = 50.0  # least factor between hook loads in different units
    singular: float = 1e-6  # smallest singular value of the sensitivities, over the largest one
    # A trend is a change of the string's weight, or the block's over it, above this, and beyond what scatter explains
    # with this probability, or by as many standard deviations as they are given.
    trend: float = 0.01
    sure: float = 0.99
    deviations: float = 3.3


_SET = _Fit()


@dataclass(frozen=True)
class RigMeasurement(Part):
    """Readings at the rig at one depth of the bit.

    Args:
        depth: measured depth of the bit, m.
        operation: with weight and torque on bit.
        hook_load: N, as the indicator shows it; None if not read. It includes the weight of block and top drive, the
            `block_weight` of `calibrate_friction`, which is zero unless given or fitted.
        torque: at the surface, N m; None if not read.
        hook_load_sd, torque_sd: their standard deviations, N and N m: the weights of the readings. Those that are not
            given are assumed, 10 kN and 500 N m, which the printed fit says.

    Raises:
        SceneError: neither was read, or numbers outside their range.
    """

    depth: Depth
    operation: Operation
    hook_load: ForceSize | None = None
    torque: Torque | None = None
    hook_load_sd: Annotated[ForceSize, positive()] = 10e3
    torque_sd: Annotated[Torque, positive()] = 500.0

    def validate(self):
        """Refuse a measurement without a reading."""
        if self.hook_load is None and self.torque is None:
            refuse(self, "hook_load", None, "a hook load (N) or a torque (N m)")


#: One number that was read: its `RigMeasurement`; the name of what it is in `TorqueAndDrag`; its value and standard
#: deviation, N or N m.
_Reading = namedtuple("_Reading", "at query value sd")


def _readings_of(measurements):
    """[`_Reading`] of measurements, hook loads before torques."""
    loads = [_Reading(m, "hook_load", m.hook_load, m.hook_load_sd) for m in measurements]
    torques = [_Reading(m, "surface_torque", m.torque, m.torque_sd) for m in measurements]
    return [x for x in loads + torques if x.value is not None]


@dataclass(frozen=True, eq=False)
class FrictionFit(Charted):
    """Coefficients of friction by least squares, from `calibrate_friction`; `plot` draws measured loads and those
    computed with these coefficients, over the depth of the bit.

    Attributes:
        hole: the `Borehole` with these coefficients.
        friction: (n,) of its sections. interval: (n, 2) confidence intervals; no end is below 0.
        block_weight: N, as given or found; block_interval: (2,), NaN where it was given.
        confidence: of the intervals, such as 0.95.
        correlation: (m, m) of the estimates: close to 1 or -1 where the readings determine only sums or differences.
        standard_error: (m,) of the coefficients, and of the block's weight (N) where it was found: the root of the
            diagonal of the covariance, scaled by the misfit.
        residuals: (k,) measured less computed over the standard deviations, hook loads before torques.
        kept: (k,) False for outliers, readings that differ by more than five deviations from what all others say, and
            were left out.
        misfit: root of the sum of squares of the residuals that are kept, over the readings in excess: 1 where the
            standard deviations are right.
        weight_change: (2,) confidence interval of the relative change of the string's weight in mud with which the
            readings would fit best, of the linearised problem; NaN where they do not tell it from friction.
        doubts: sentences on readings that were left out, on possible mistakes where the misfit is far above 1 or the
            residuals have a trend that friction cannot make, and on a bend, which the models of the fit have not; also
            given as warnings.
        measurements: as given.
    """

    hole: Borehole
    friction: np.ndarray
    interval: np.ndarray
    block_weight: float
    block_interval: np.ndarray
    confidence: float
    correlation: np.ndarray
    standard_error: np.ndarray
    residuals: np.ndarray
    kept: np.ndarray
    misfit: float
    weight_change: np.ndarray
    doubts: tuple[str, ...] = ()
    measurements: tuple[RigMeasurement, ...] = ()

    _rows_axis, _chart = "section", "well.charts.fit_figure"
    _quantities = by_name(
        Quantity("section", axes=("section",),
                 getter=lambda x: np.array([one.name or str(i) for i, one in enumerate(x.hole.sections, start=1)])),
        Quantity("to", unit="m", axes=("section",), getter=lambda x: np.array([one.to for one in x.hole.sections])),
        Quantity("friction", axes=("section",), digits=4, noise=1e-6),
        Quantity("interval", parts=("from", "to"), axes=("section",), digits=4),
        Quantity("block_weight", unit="N", axes=()),
        Quantity("block_interval", unit="N", parts=("from", "to"), axes=()),
        Quantity("residuals", axes=("reading",)),
        Quantity("misfit", axes=()),
        Quantity("weight_change", parts=("from", "to"), axes=()),
    )  # fmt: skip
    _on_screen = ("section", "to", "friction", "interval")

    _readings = property(lambda self: _readings_of(self.measurements))

    def __len__(self):
        return len(self.friction)

    def _answer(self, units):
        yield f"Coefficients of friction by least squares, with {100 * self.confidence:g} % intervals."
        yield f"misfit {self.misfit:.3g} (1: as the standard deviations say)"
        yield f"Standard deviations: {' and '.join(self._deviations(units))}."
        low, high = 100 * self.weight_change
        if high - low < _TELLS:
            yield f"The readings fit best with {low:+.2g} to {high:+.2g} % on the string's weight in mud."
        else:
            yield ("The readings do not tell a wrong weight of the string in mud from friction; hook loads of "
                   "RotateOffBottom do, which friction hardly changes.")  # fmt: skip
        for section, friction in zip(self.quantities["section"].of(self), self.friction, strict=True):
            if friction < 1e-6:
                yield f"The friction of section {section} is at 0, its bound: the readings ask for less than none."
        if np.isfinite(self.block_interval).all():
            low, high = (self._told("block_weight", units, x) for x in self.block_interval)
            yield f"block weight {self._told('block_weight', units)}, from {low} to {high}"
        yield from (f"DOUBTFUL: {units.sentence(doubt)}" for doubt in self.doubts)

    def _deviations(self, units):
        """The standard deviations of the readings in words, hook loads before torques."""
        for query, name, unit in (("hook_load", "hook_load_sd", "N"), ("surface_torque", "torque_sd", "N m")):
            sizes = sorted({x.sd for x in self._readings if x.query == query})
            if sizes:
                told = " to ".join(dict.fromkeys(units.told(x, unit, form=".4g") for x in (sizes[0], sizes[-1])))
                assumed = " (assumed where none is given)" if getattr(RigMeasurement, name) in sizes else ""
                yield f"{told} of {query.replace('_', ' ')}s{assumed}"


def calibrate_friction(
    hole: Borehole,
    string: DrillString,
    measurements: Sequence[RigMeasurement],
    *,
    mud: Mud | None = None,
    block_weight: float | None = 0.0,
    model: str = SOFT,
    torque_convention: str = "coulomb",
    confidence: float = 0.95,
    leave_out: bool = True,
) -> FrictionFit:
    """One coefficient of friction for each section of a hole, such that hook loads and torques fit measured ones best.

    Where they fit badly, a warning names possible causes. Weighted least squares by SciPy, with the exact
    derivatives of the soft string. The intervals are Student's, of the linearised problem, scaled by the misfit.

    Args:
        hole: its own friction is not used.
        measurements: each a `RigMeasurement`, more than there are unknowns.
        block_weight: of block and top drive in the hook loads, N: 0 where they were subtracted, None where they were
            not and it is one more unknown.
        model: "soft", or "buckled". mud, string, torque_convention: see `torque_and_drag`.
        confidence: between 0 and 1.
        leave_out: whether outliers are left out, which a warning names: readings more than five deviations from what
            all others say.

    Raises:
        SceneError: too few readings, or readings that do not depend on a section's friction (named); see also
            `torque_and_drag`.
    """
    measurements = [
        instance("calibrate_friction", "measurements", m, RigMeasurement, "Measurements") for m in measurements
    ]
    for field in ("hook_load", "torque"):
        largest = max((getattr(m, field) or 0.0 for m in measurements), key=abs, default=0.0)
        doubt_load(f"RigMeasurement.{field}, at most", largest, field.replace("_", " "), of="string")
    if model not in (SOFT, BUCKLED):
        refuse("calibrate_friction", "model", model, f"'{SOFT}' or '{BUCKLED}'")
    confidence = number("calibrate_friction", "confidence", confidence, "a number between 0 and 1", lambda x: 0 < x < 1)
    settings = {"mud": mud, "model": model, "tol": _SET.tol, "torque_convention": torque_convention}
    if block_weight is not None:
        block_weight = number(
            "calibrate_friction",
            "block_weight",
            block_weight,
            "a weight (N), or None where it is not known",
            np.isfinite,
        )
    unknown_block, sections = block_weight is None, len(hole.sections)
    readings, wanted = _readings_of(measurements), sections + unknown_block
    excess = len(readings) - wanted
    if excess <= 0:
        raise SceneError(f"calibrate_friction: {len(readings)} readings for {wanted} unknowns: expected more")
    of_block = np.array([float(x.query == "hook_load") for x in readings])
    sd = np.array([x.sd for x in readings])

    @lru_cache(maxsize=1)
    def answers_of(friction):
        with warnings.catch_warnings():  # of values that are tried
            warnings.simplefilter("ignore", SceneWarning)
            with_friction = hole.with_friction(np.maximum(friction, 0.0))
        answers = {id(m): torque_and_drag(with_friction, string, m.operation, depth=m.depth, **settings)
                   for m in measurements}  # fmt: skip
        return [answers[id(x.at)] for x in readings]

    def residuals(unknowns):
        block = unknowns[sections] * _SET.block if unknown_block else block_weight
        answers = answers_of(tuple(unknowns[:sections]))
        computed = [getattr(answer, x.query) for answer, x in zip(answers, readings, strict=True)]
        return ([x.value for x in readings] - np.array(computed) - block * of_block) / sd

    def slopes(unknowns):
        answers = answers_of(tuple(unknowns[:sections]))
        names = [f"hole.sections[{i}].friction" for i in range(sections)]
        rows = [list(answer.sensitivity(names, x.query).values()) for answer, x in zip(answers, readings, strict=True)]
        return -np.column_stack([rows, *[_SET.block * of_block] * unknown_block]) / sd[:, None]

    free = [np.inf] * unknown_block  # of the block's weight
    bounds = [0.0] * sections + [-x for x in free], [_SET.most] * sections + free
    start = [_SET.start] * sections + [0.5] * unknown_block
    jacobian = slopes if model == SOFT else "2-point"  # of buckled strings no derivative is known
    found = estimated(residuals, jacobian, start, bounds, leave_out)
    _check_determined(hole, found.jacobian, unknown_block)
    misfit, half = found.misfit, found.half_widths(confidence)
    scale = np.array([1.0] * sections + [_SET.block] * unknown_block)
    values, half = found.values * scale, half * scale
    ends = np.stack([values - half, values + half], axis=1)
    friction = values[:sections]
    block = float(values[-1]) if unknown_block else float(block_weight)
    doubts = tuple(_left_out(readings, found))
    if string.bent:
        doubts += (f"the bend of {string.bent} is not in the {model} string: its friction counts as the hole's",)
    hung = np.array([x.value for x in readings]) - found.residuals * sd - block * of_block  # as computed
    hung += [x.at.operation.weight if x.query == "hook_load" else -x.at.operation.torque for x in readings]
    changes = {"string": _changed(found, -hung / sd, bounds, confidence)}
    if not unknown_block and of_block.any():
        changes["block"] = _changed(found, -np.abs(hung * of_block).max() * of_block / sd, bounds, confidence)
    trend = tuple(_trend(readings, found, misfit, changes, np.abs(hung * of_block).max(), mud))
    if misfit > _SET.bad:
        with_block = partial(calibrate_friction, hole, string, measurements, mud=mud, block_weight=None, model=model,
                             torque_convention=torque_convention)  # fmt: skip
        doubts += (
            f"misfit {misfit:.3g} where 1 is as the standard deviations say: neither coefficients nor intervals are to "
            "be relied on",
            *_causes(readings, found.residuals * sd, misfit, None if unknown_block else with_block, trend),
        )
    else:
        doubts += trend
    if doubts:
        warn(hole.path.told(f"calibrate_friction: {'; '.join(doubts)}"))
    return FrictionFit(
        hole.with_friction(friction), friction, np.maximum(ends[:sections], 0.0), block,
        ends[-1] if unknown_block else np.full(2, np.nan), confidence, found.correlation,
        found.spread * scale, found.residuals, found.kept, misfit, changes["string"].interval, doubts,
        tuple(measurements),
    )  # fmt: skip


def _left_out(readings, found):
    """Sentences on the outliers of an `Estimate`."""
    for x, residual, kept in zip(readings, found.residuals, found.kept, strict=True):
        if not kept:
            unit = {"hook_load": "N"}.get(x.query, "N m")
            yield (
                f"left out: the {x.query.replace('_', ' ')} {x.value:g} {unit} of {x.at.operation.name} at "
                f"{x.at.depth:g} m, {residual * x.sd:+.3g} {unit} from what the other readings say; leave_out=False "
                "keeps it"
            )


#: One more unknown, linearised: its best value, its confidence interval (2,), the misfit with it, and whether it is of
#: a size that scatter does not explain.
_Change = namedtuple("_Change", "value interval misfit sure")


def _changed(found, column, bounds, confidence):
    """The `_Change` of an unknown beside those of an `Estimate`, from the derivatives (n,) of all residuals by it."""
    column, excess = column[found.kept], found.excess - 1
    apart = column - found.jacobian @ np.linalg.lstsq(found.jacobian, column, rcond=None)[0]
    size = np.linalg.norm(apart)
    if excess < 1 or size <= _SET.singular * np.linalg.norm(column):
        return _Change(np.nan, np.full(2, np.nan), np.inf, False)
    limits = [np.append(x - found.values, far) for x, far in zip(bounds, (-np.inf, np.inf), strict=True)]
    best = lsq_linear(np.column_stack([found.jacobian, column]), -found.residuals[found.kept], limits)
    value, misfit = best.x[-1], math.sqrt(2 * best.cost / excess)
    half = student.ppf((1 + confidence) / 2, excess) * misfit / size
    least = min(student.ppf((1 + _SET.sure) / 2, excess) * misfit, _SET.deviations * max(1.0, misfit)) / size
    return _Change(value, np.array([value - half, value + half]), misfit, abs(value) > max(_SET.trend, least))


def _trend(readings, found, misfit, changes, largest, mud):
    """A sentence on residuals that another weight of the string (the whole of it), or of the block (N over `largest`),
    would explain and friction does not, by their `changes`."""
    told = []
    for name, change in sorted(changes.items(), key=lambda x: x[1].misfit):
        if change.sure and name == "string":
            uniform = mud is not None and not isinstance(mud.density, tuple)
            other = mud.density - change.value * (STEEL.density - mud.density) if uniform else -1.0
            fluid = f", as in mud of {other:.4g} kg/m^3 in place of {mud.density:.4g} kg/m^3" if other > 0 else ""
            told.append(f"{100 * change.value:+.2g} % on the string's weight in mud{fluid}")
        elif change.sure:
            told.append(f"{change.value * largest / 1e3:+.3g} kN on block and top drive")
        if change.sure:
            told[-1] += f" (misfit {change.misfit:.2g})"
    if not told:
        return
    turning = [found.residuals[i] * x.sd for i, x in enumerate(readings)
               if x.query == "hook_load" and found.kept[i] and x.at.operation.direction(1.0)[0] == 0]  # fmt: skip
    mean = np.mean(turning or 0.0) / 1e3
    side = f"{abs(mean):.3g} kN {'above' if mean > 0 else 'below'}"
    seen = f": hook loads without drag, as of RotateOffBottom, are {side} those computed" if turning else ""
    yield (
        f"the residuals have a trend that friction cannot make{seen}. They would fit better than now (misfit "
        f"{misfit:.2g}), and with other friction, with {' or with '.join(told)}: check the mud weight, weights and "
        "lengths of the string, and block_weight"
    )


def _causes(readings, apart, misfit, with_block, trend):
    """Sentences on why readings may not fit, by their differences (n,) and their `_trend`; `with_block`: a fit of the
    block's weight."""
    hooks = [(x.at, x.value - more) for x, more in zip(readings, apart, strict=True) if x.query == "hook_load"]
    sizes = sum(abs(m.hook_load) for m, _ in hooks), sum(abs(computed) for _, computed in hooks)
    if hooks and not sizes[1] / _SET.other_unit < sizes[0] < sizes[1] * _SET.other_unit:
        yield f"the hook loads are {sizes[0] / sizes[1]:.1e} times those computed: expected N"
        return
    out, into = ([m for m, _ in hooks if m.operation.direction(1.0)[0] * sign > 0] for sign in (1, -1))
    swapped = [up.depth for up in out for down in into if up.depth == down.depth and up.hook_load < down.hook_load]
    if swapped:
        yield f"at the depth {swapped[0]:g} m the hook load out is below that in: are they swapped?"
        return
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            free = with_block() if with_block and hooks else None
    except SceneError:  # the readings do not determine it
        free = None
    if free is not None and free.misfit < misfit / _SET.bad:
        yield (
            f"with block_weight=None it is {free.misfit:.3g}, and block and top drive weigh "
            f"{free.block_weight / 1e3:.4g} kN: hook loads include them unless they were subtracted"
        )
    else:
        yield from trend or [
            "expected depths in m, hook loads in N, torques in N m, and the string and mud of the readings"
        ]


def _check_determined(hole, sensitivity, unknown_block):
    """Refuse readings that leave an unknown open."""
    names = [f"section {i + 1} (to {section.to:g} m)" for i, section in enumerate(hole.sections)]
    names += ["block_weight"] * unknown_block
    effects = np.linalg.norm(sensitivity, axis=0)[: len(hole.sections)]
    least = _SET.singular * np.linalg.norm(sensitivity)
    silent = [name for name, size in zip(names, effects, strict=False) if size <= least]
    if silent:
        told = f"calibrate_friction: no reading depends on friction of {' and '.join(silent)}: expected readings with "
        told += "the string there, of hook loads up or down or of torques where it rotates"
        raise SceneError(hole.path.told(told))
    _, sizes, rows = np.linalg.svd(sensitivity, full_matrices=False)
    if sizes[-1] > _SET.singular * sizes[0]:
        return
    open_ones = [name for name, share in zip(names, np.abs(rows[-1]), strict=True) if share > 0.1]
    told = f"calibrate_friction: the measurements do not separate {' and '.join(open_ones)}: expected readings with "
    told += "friction there, at several depths, and both up and down or rotating where block_weight is None"
    raise SceneError(hole.path.told(told))
