"""Reserves of strength of a string: overpull when stuck, and the largest weight on bit."""

from dataclasses import dataclass, fields, replace
from functools import cache, partial

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.progress import StageProgress
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.results.result import Result, by_name
from cosserat_fenicsx.well.criteria import LockUp, buckled_string
from cosserat_fenicsx.well.pieces import sections_of
from cosserat_fenicsx.well.softstring import chain_of, soft_string
from cosserat_fenicsx.well.strength import MODES, UNKNOWN
from cosserat_fenicsx.well.utilisation import Utilisation, strengths_of

_PARTS, _LIMITS = ("component",), ("limit",)
# Relative accuracy of weights on bit; a string that locks up under this much more weight than uses up its hook load is
# said to lock up.
_ACCURATE, _BEYOND = 3e-4, 1.05
# Of the rod: relative accuracy of its hook load over the largest tension, and of the weight found, also where beyond it
# no equilibrium is found; how many equilibria are solved at most; factor from one weight to the next until it is known
# between which two the limit is.
_ROD_TOL, _NEAR, _NEAR_UNSOLVED, _MOST_SOLVED, _AWAY = 1e-3, 4e-3, 0.04, 14, 1.15
# Relative difference of two weights on bit below which the limits are reached together.
_TOGETHER = 2 * _ACCURATE
_UNSTABLE, _UNSOLVED = "loss of stability", "no equilibrium of the rod found"


def _safety(owner, safety):
    return number(owner, "safety", safety, "a factor from 1 to 10", lambda x: 1 <= x <= 10)


@dataclass(frozen=True, eq=False, repr=False)
class MarginOfOverpull(Result):
    """Margin of overpull by component, from `TorqueAndDrag.margin_of_overpull`; `float` gives the smallest, N.

    What the surface pulls beyond the hook load is taken to arrive at every place in full, as without friction: exact at
    the surface, and on the safe side below. The tension at yield is that with the torque at the place (API RP 7G).

    Attributes:
        margins: (components,) N, from the surface down; negative where the limit is exceeded. md: of the weakest place
            of each, m. tension: effective, there, N. allowed: there, N. safety: the factor in it.
        component: its name.
    """

    component: np.ndarray
    md: np.ndarray
    tension: np.ndarray
    allowed: np.ndarray
    safety: float
    operation: str

    _rows_axis = "component"
    _quantities = by_name(
        Quantity("margin", "margin of overpull", "N", axes=()),
        Quantity("component", axes=_PARTS),
        Quantity("margins", "margin", "N", axes=_PARTS, digits=5),
        Quantity("md", "weakest at md", "m", axes=_PARTS),
        Quantity("tension", "tension there", "N", axes=_PARTS, digits=5),
        Quantity("allowed", "allowed there", "N", axes=_PARTS, digits=5),
    )

    margins = property(lambda self: self.allowed - self.tension, doc="(components,) N.")

    @property
    def margin(self) -> float:
        """The smallest, N."""
        return float(self.margins.min())

    __float__ = margin.fget

    def __len__(self):
        return len(self.md)

    def _about(self):
        return {"kind": "MarginOfOverpull", "operation": self.operation, "safety": self.safety}

    def _answer(self, units):
        i = int(np.argmin(self.margins))
        yield (
            f"{self.operation}: margin of overpull {self._told('margin', units, form='.5g')}, by the "
            f"{self.component[i]} at md = {self._told('md', units, self.md[i])}, with a safety factor of "
            f"{self.safety:g}."
        )

    def __repr__(self):
        return f"MarginOfOverpull({self.margin:.6g} N)"


def overpull_of(answer, strengths, safety):
    """The `MarginOfOverpull` of an answer."""
    safety, rows = _safety("margin_of_overpull", safety), []
    for i in range(len(strengths))[::-1]:
        here = answer.component == i
        if strengths[i] is None or not here.any():
            continue
        allowed, tension = strengths[i].tension_at(answer.torque[here]) / safety, answer.tension[here]
        k = int(np.argmin(allowed - tension))
        rows.append((answer.laid[i].component.name, answer.md[here][k], tension[k], allowed[k]))
    if not rows:
        raise SceneError("margin_of_overpull: the string is a bit alone: expected drill pipe or collars above it")
    return MarginOfOverpull(*map(np.array, zip(*rows, strict=True)), safety, answer.operation.name)


@dataclass(frozen=True, eq=False, repr=False)
class MostWeightOnBit(Result):
    """The largest weight on bit by each of its limits, from `TorqueAndDrag.most_weight_on_bit`; `float` gives the
    smallest, N.

    Attributes:
        limits: names, such as "helical buckling". weights: (limits,) N; NaN where the string has not enough weight to
            reach the limit. md: where it is reached first, m. component: there.
        counts: (limits,) whether it counts: the kind of buckling that was not asked for does not.
        model: "soft", "buckled", or "rod", of which the first limit alone is known, NaN elsewhere, with a weight within
            it and at most 0.4 % below it, 4 % where beyond it no equilibrium was found.
        incomplete: whether strength leaves out pipe whose bending between its tool joints is not known, in compression;
            see `Utilisation`.
    """

    limits: np.ndarray
    weights: np.ndarray
    md: np.ndarray
    component: np.ndarray
    counts: np.ndarray
    operation: str
    safety: float
    model: str = "buckled"
    incomplete: bool = False

    _rows_axis = "limit"
    _quantities = by_name(
        Quantity("weight", "most weight on bit", "N", axes=()),
        Quantity("limits", "limit", axes=_LIMITS),
        Quantity("weights", "weight on bit", "N", axes=_LIMITS, digits=5),
        Quantity("md", "reached at md", "m", axes=_LIMITS),
        Quantity("component", axes=_LIMITS),
        Quantity("counts", axes=_LIMITS),
    )

    @property
    def _first(self):
        counted = np.where(self.counts & np.isfinite(self.weights), self.weights, np.inf)
        # a helix takes the hook load at once: then it is the limit, and not the weight, which is first in the list
        return int(np.flatnonzero(counted <= counted.min() * (1 + _TOGETHER))[-1])

    weight = property(lambda self: float(self.weights[self._first]), doc="N.")
    limit = property(lambda self: str(self.limits[self._first]), doc="What limits it.")

    def __float__(self):
        return self.weight

    def __len__(self):
        return len(self.limits)

    def _about(self):
        names = "operation", "safety", "model", "incomplete"
        return {"kind": "MostWeightOnBit"} | {name: getattr(self, name) for name in names}

    def _answer(self, units):
        i = self._first
        where = (
            f" at md = {self._told('md', units, self.md[i])}, {self.component[i]}" if self.md[i] == self.md[i] else ""
        )
        yield (
            f"{self.operation}: at most {self._told('weight', units, form='.4g')} on bit, limited by "
            f"{self.limit}{where}; strength with a safety factor of {self.safety:g}; buckling by He and Kyllingstad's "
            "criterion and Lubinski's."
        )
        if self.incomplete:
            yield (
                "NOT KNOWN: how much compressed pipe bends between its tool joints, which strength leaves out: see "
                "`utilisation` at this weight."
            )
        if self.model == "rod":
            yield "By the exact rod in contact. '-': not reached up to this weight, and not looked for beyond it."
        else:
            yield "'-': the hook load is 0 before this limit is reached."

    def __repr__(self):
        return f"MostWeightOnBit({self.weight:.6g} N, {self.limit})"


def most_weight_of(answer, grade, wear, safety, buckling, model, progress=None):
    """The `MostWeightOnBit` of an answer's string and operation, see `TorqueAndDrag.most_weight_on_bit`."""
    who = "most_weight_on_bit"
    safety = _safety(who, safety)
    if buckling not in ("helical", "sinusoidal"):
        refuse(who, "buckling", buckling, "'helical' or 'sinusoidal'")
    if model not in ("soft", "buckled", "rod"):
        refuse(who, "model", model, "'soft', 'buckled' or 'rod'")
    if "weight" not in {field.name for field in fields(answer.operation)}:
        refuse(who, "operation", answer.operation.name, "one with a weight on bit, such as Sliding(weight)")
    if answer.operation.direction(1.0)[0] > 0:
        refuse(who, "operation", answer.operation.name, "one that goes down or rotates, such as Sliding(weight)")
    if model == "rod":
        start = most_weight_of(answer, grade, wear, safety, buckling, "buckled")
        return _by_rod(answer, start.weight, strengths_of(who, answer.laid, grade, wear), safety, buckling, progress)
    strengths = strengths_of(who, answer.laid, grade, wear)
    soft, solved = (cache(partial(_solved, answer, x)) for x in ("soft", model))
    high, least = float(answer.pieces.weight @ (answer.pieces.bottom - answer.pieces.top)), soft(0.0)
    if not 0 < least.hook_load < np.inf:
        raise SceneError(
            f"{who}: the string cannot go down by its own weight even without weight on bit: expected less friction, "
            "or heavier pipe in the upper part"
        )
    # up to the first helix the buckled string is the soft one
    high = _first_zero(lambda w: soft(w).hook_load, 0.0, high)
    begin = _first_zero(lambda w: float(np.nanmin(_to_load(soft(w), 1), initial=1.0)), 0.0, high)
    if np.isnan(begin):
        solved, begin = soft, high
    most = high
    if solved is not soft:
        most = np.nan_to_num(_first_zero(lambda w: max(_hook_load(solved(w)), -least.hook_load), begin, high), nan=high)
    beyond = solved(_BEYOND * most)
    locks = isinstance(beyond, LockUp)
    rows = [("lock-up" if locks else "weight of the string", most, beyond.md if locks else 0.0, True)]
    margins = {
        "sinusoidal buckling": (lambda found: _to_load(found, 0), buckling == "sinusoidal"),
        "helical buckling": (lambda found: _to_load(found, 1), True),
        "strength": (lambda found: 1 - safety * Utilisation(found, strengths).von_mises, True),
    }
    for name, (margin, counts) in margins.items():

        def least_of(w, at, margin=margin):
            return float(np.nanmin(margin(at(w)), initial=1.0))

        weight, at = _first_zero(partial(least_of, at=soft), 0.0, begin), soft
        if np.isnan(weight) and solved is not soft:
            if name.startswith("helical"):
                weight = begin
            else:
                at = solved
                weight = _first_zero(partial(least_of, at=at), begin, most * (1 - 2 * _ACCURATE))
        md = np.nan if np.isnan(weight) else at(weight).md[np.nanargmin(margin(at(weight)))]
        rows.append((name, weight, md, counts))
    limits, weights, md, counts = map(np.array, zip(*rows, strict=True))
    place = np.searchsorted(least.md, md).clip(max=len(least.md) - 1)
    part = np.where(np.isnan(md), "", least.value("component_name")[place])
    return _told(answer, strengths, MostWeightOnBit(limits, weights, md, part, counts, answer.operation.name, safety))


def _by_rod(answer, start, strengths, safety, buckling, progress):
    """The `MostWeightOnBit` of the rod in contact, looked for from a weight (N) on; NotConverged by too many solves."""
    whole = float(answer.pieces.weight @ (answer.pieces.bottom - answer.pieces.top))
    low, high, weight, near = (0.0, None), (np.inf, None), min(start, whole), None
    with StageProgress("most weight on bit", progress, world()) as bar:
        for k in range(_MOST_SOLVED):
            bar.at(f"rod in contact {k + 1} of at most {_MOST_SOLVED}, {weight / 1e3:.4g} kN on bit")
            limits, found = _limits_of_rod(answer, weight, strengths, safety, buckling, near)
            name = min(limits, key=lambda x: limits[x][0])
            inside = limits[name][0] > 0
            before = low if inside else high
            low, high = ((weight, limits), high) if inside else (low, (weight, limits))
            near = found if inside or near is None else near
            if high[1] is None or low[1] is None:
                weight = min(_outwards(before, weight, limits, inside), whole)
            elif high[0] - low[0] <= (_NEAR_UNSOLVED if _UNSOLVED in high[1] else _NEAR) * high[0]:
                break
            else:
                weight = _between(low, high, inside)
        else:
            raise NotConverged(
                f"most_weight_on_bit: {_MOST_SOLVED} equilibria of the rod in contact leave it between {low[0]:.4g} "
                f"and {high[0]:.4g} N: expected a model='buckled', or a stronger string"
            )
    names = list(dict.fromkeys((*limits, *low[1], *high[1])))
    first = min(high[1], key=lambda x: high[1][x][0])
    of_first = [x == first for x in names]
    md = high[1][first][1]
    reached = np.where(of_first, md, np.nan)
    part = answer.value("component_name")[min(np.searchsorted(answer.md, np.nan_to_num(md)), len(answer.md) - 1)]
    return _told(answer, strengths, MostWeightOnBit(
        np.array(names), np.where(of_first, low[0], np.nan), reached, np.where(of_first & ~np.isnan(reached), part, ""),
        np.full(len(names), True), answer.operation.name, safety, "rod",
    ))  # fmt: skip


def _told(answer, strengths, most):
    """A `MostWeightOnBit` that knows whether it is incomplete, by the tension of the soft string."""
    use = Utilisation(_solved(answer, "soft", most.weight), strengths)
    return replace(most, incomplete=bool((use.contact_mode == MODES[UNKNOWN]).any()))


def _outwards(before, weight, limits, inside):
    """The weight to try next where all that are known are within their limits, or all beyond: a little farther than
    where the first margin vanishes on a line through the one before, or through that of 1 without weight."""
    name = min(limits, key=lambda x: limits[x][0])
    share, (other, known) = limits[name][0], before
    other, there = (other, known[name][0]) if known and name in known else (0.0, 1.0)
    zero = weight - share * (weight - other) / (share - there) if np.isfinite(share - there) else np.nan
    if not np.isfinite(zero) or name == _UNSTABLE:
        return weight * _AWAY if inside else weight / _AWAY
    if inside:
        return float(np.clip(zero * (1 + _NEAR / 3), weight * (1 + _NEAR / 2), weight * _AWAY**2))
    return float(np.clip(zero * (1 - _NEAR / 3), weight / _AWAY**2, weight * (1 - _NEAR / 2)))


def _between(low, high, above):
    """The weight to try next: where the margin vanishes on a line and a little beyond; else in the middle."""
    name = min(high[1], key=lambda x: high[1][x][0])
    left, right = (found.get(name, (np.nan, 0))[0] for _, found in (low, high))
    middle, width = (low[0] + high[0]) / 2, high[0] - low[0]
    if not np.isfinite(left - right) or name == _UNSTABLE:
        return middle
    zero = low[0] + width * left / (left - right)
    zero += (1 if above else -1) * _NEAR * zero / 3
    return float(np.clip(zero, low[0] + width / 20, high[0] - width / 20))


def _limits_of_rod(answer, weight, strengths, safety, buckling, near):
    """{limit: (what is left of it, a share, below 0 beyond it; measured depth, m)} of the rod with a weight on bit, and
    its `InHole`; None without an equilibrium. near: the `InHole` of another weight."""
    start = _solved(answer, "soft", weight)
    most = float(np.abs(start.tension).max())
    # the rod's tolerance is relative to the hook load, which may be small
    tol = min(0.5, _ROD_TOL * most / max(abs(start.hook_load), 1e-3 * most))
    try:
        rod = answer.by_rod(replace(start, tol=tol), (), False, helix=buckling == "helical", start=near)
    except NotConverged:
        return {_UNSOLVED: (-np.inf, np.nan)}, None
    found = {"weight of the string": (rod.hook_load / most, 0.0)}
    shares = {"helical buckling": _to_load(rod, 1), "strength": 1 - safety * Utilisation(rod, strengths).von_mises}
    if buckling == "sinusoidal":
        stable = rod.solved.negative_modes == 0
        found[_UNSTABLE] = 1.0 if stable else -1.0, float(rod.md[np.argmin(rod.tension)])
        shares["sinusoidal buckling"] = _to_load(rod, 0)  # beyond it the rod may be a snake, which is stable
    for name, share in shares.items():
        if np.isfinite(share).any():
            at = int(np.nanargmin(share))
            found[name] = float(share[at]), float(rod.md[at])
    return found, rod.solved


def _solved(answer, model, weight):
    """The `TorqueAndDrag` of the flexible string with another weight on bit (N), or the `LockUp`."""
    operation = replace(answer.operation, weight=weight)
    chain = chain_of(answer.pieces, answer.torque_convention == "coulomb")
    solved = soft_string(chain, -weight, operation.torque, _ACCURATE)
    if model == "buckled":
        sections = sections_of([place.component for place in answer.laid])
        try:
            solved = buckled_string(solved, answer.pieces, sections, _ACCURATE) or solved
        except LockUp as locked:
            return locked
    return answer.of_flexible(operation, model, solved)


def _hook_load(found):
    return -np.inf if isinstance(found, LockUp) else found.hook_load


def _to_load(found, which):
    """(n,) tension above that of buckling, over its size: 0 where the string begins to buckle."""
    load = found.buckling_loads[which]
    return 1 + found.tension / load


def _first_zero(margin, low, high):
    """The weight (N) at which a margin, a function of the weight, vanishes; NaN where it is above 0 up to `high`."""
    if margin(high) > 0:
        return np.nan
    if margin(low) <= 0:
        return low
    return brentq(margin, low, high, xtol=_ACCURATE * high, rtol=_ACCURATE)
