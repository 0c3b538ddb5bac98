"""The soft string: a perfectly flexible string on the axis of the hole, with friction in a known direction of slip.

With the distance u up the hole, the effective tension T, the weight in mud w, the axis' tangent t, normal n and
curvature k, and e the unit vector downwards:

    q = T k n + w (e - (e.t) t),    N = |q| / sqrt(1 + (e_s mu)^2)  or  |q|,
    dT/du = w e.t + c mu N,    dM/du = e_s mu N R,                  (c, e_s) the direction of slip

The first N is Coulomb's law: friction across the hole holds a part of q, N^2 + (e_s mu N)^2 = |q|^2; the pipe climbs
the wall. The second is the field's convention: C. A. Johancsik, D. B. Friesen & R. Dawson, J. Petr. Technol. 36 (1984)
987, doi:10.2118/11380-PA.

Method: T = T_bottom + w (height) + P is exact but for the friction P, P' = c mu N(P). On pieces without jumps, from the
lower end up, P follows from collocation at Gauss's points, in C. Pieces are cut where N has a kink, which is where q
vanishes and turns round, and halved, until the friction on pieces and on their halves agrees to the tolerance.

Derivatives of tension and torque by weight, friction and the loads on the lower end follow from the equations
linearised at the solution: with V = T k + w (n cos ku + t sin ku) and N = sqrt(V^2 + (w b)^2), for the change dP

    dP' = d k V/N dP + N dd + d (V (k dT_0 + dV_w) + w b^2 dw)/N,

dT_0 and dV_w the explicit parts. It is linear and is solved by its integrating factor on the same pieces.
Where N has a kink pieces are cut, and N is continuous there, so that the place of a cut has no part in it.

`Differentiated`: the derivatives of an answer by friction, weights, mud and loads on the bit, and its uncertainty.
"""

import math
from collections import namedtuple
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legval, legvander
from scipy.linalg.blas import dtbsv
from scipy.optimize import brentq

from cosserat_fenicsx.algebra.building import module
from cosserat_fenicsx.checks import finite_array, refuse
from cosserat_fenicsx.errors import NotConverged, SceneError, nearest
from cosserat_fenicsx.numerics import gauss
from cosserat_fenicsx.results.queries import Sensitivity, Uncertainty
from cosserat_fenicsx.statics.cases import Cases
from cosserat_fenicsx.well.hole import doubt_value
from cosserat_fenicsx.well.pieces import down_along
from cosserat_fenicsx.well.tools import MudMotor


_POINTS = 8  # Gauss points a piece
_ROUNDS = 60
_SHORTEST = 1e-9  # m, of pieces that are still cut
_EPS = np.finfo(float).eps
_AT_ONCE = 1024  # cases of a batch whose arrays are in memory together


class Chain(NamedTuple):
    """A string as arrays over pieces, from its lower end up.

    Attributes:
        length: m. weight: N/m. curvature: 1/m.
        t, n, b: downward components of tangent, normal and binormal at the lower end of the piece.
        drag: c mu over the root of Coulomb's law. turn: e_s mu R over the same root, m. climb: the root.
        origin: index of the piece in `Pieces`.
    """

    length: np.ndarray
    weight: np.ndarray
    curvature: np.ndarray
    t: np.ndarray
    n: np.ndarray
    b: np.ndarray
    drag: np.ndarray
    turn: np.ndarray
    climb: np.ndarray
    origin: np.ndarray

    @property
    def columns(self):
        """The same with columns (n, 1), for several places on each piece."""
        return Chain(*(array[:, None] for array in self))

    def down(self, u):
        """Downward components of tangent and normal at distances u (m) above the lower ends."""
        return down_along(self.t, self.n, self.curvature * u)

    def height(self, u):
        """Height (m) of places at distances u (m) above the lower ends."""
        angle = self.curvature * u
        bent = self.n * self.curvature * u**2 / 2 * np.sinc(angle / 2 / np.pi) ** 2
        return self.t * u * np.sinc(angle / np.pi) - bent


#: Solution on a chain. at: (m,) places on a piece, as shares of its length from its lower end; tension (N), torque
#: (N m), side (wall force per length, N/m): (n, m) there; side_force: of each piece (N); error, torque_error: estimates
#: for the uppermost values (N, N m); helical: (n,) True where the string is buckled into a helix.
Solved = namedtuple("Solved", "chain at tension torque side side_force error torque_error helical")


# On [0, 1]: points, weights, matrix of the integrals from 0 to the points, and that from the values at the points of an
# interval to those at the points of its halves.
_RULE = gauss(_POINTS)
_X = (1 + _RULE.points) / 2
#: The integral over a piece from values at Gauss's points, and those up to these points.
WEIGHTS = _RULE.weights / 2
POINTS_TO = legvander(_RULE.points, _POINTS) @ _RULE.integral / 2
AT = np.concatenate([[0.0], _X, [1.0]])
#: The integrals over a piece up to the places AT, from values at them.
UP_TO = np.concatenate([np.zeros((1, _POINTS)), POINTS_TO, WEIGHTS[None]])
UP_TO = np.concatenate([np.zeros((_POINTS + 2, 1)), UP_TO, np.zeros((_POINTS + 2, 1))], axis=1)
_HALVES = legvander(np.concatenate([_X - 1, _X]), _POINTS - 1) @ _RULE.series
_SOURCE = Path(__file__).with_name("softstring.c")
# What C reads: the places, and by columns the integrals up to the points, the weights, the values at the points of the
# halves, and the last two coefficients of Legendre's series.
_TABLES = np.concatenate([x.ravel() for x in (AT, POINTS_TO.T, WEIGHTS, _HALVES.T, _RULE.series[-2:])])


def chain_of(pieces, coulomb=True):
    """The `Chain` of `Pieces`."""
    up = slice(None, None, -1)
    climb = np.sqrt(1 + (pieces.around * pieces.friction) ** 2) if coulomb else np.ones_like(pieces.friction)
    found = Chain(
        pieces.bottom - pieces.top, pieces.weight, pieces.curvature, pieces.t, pieces.n, pieces.b,
        pieces.axial * pieces.friction / climb, pieces.around * pieces.friction * pieces.radius / climb, climb,
        np.arange(len(pieces.top)),
    )  # fmt: skip
    return Chain(*(np.ascontiguousarray(array[up]) for array in found))


def soft_string(chain, tension, torque, tol):
    """Tension and torque along a `Chain`.

    Args:
        tension, torque: at the lower end, N and N m.
        tol: of the uppermost tension and torque, over their largest values.

    Returns:
        a `Solved`, on the halves of the last pieces.

    Raises:
        NotConverged: the tolerance was not reached.
    """
    for _ in range(_ROUNDS):
        rows, size = np.array(chain[:-1]), 2 * len(chain.length)
        pieces, halves, sums = np.empty((size // 2, 12)), np.empty((4 + 3 * len(AT)) * size), np.empty(6)
        ffi, lib = module(_SOURCE)
        arrays = (ffi.from_buffer("double[]", x) for x in (rows, _TABLES))
        found = (ffi.from_buffer("double[]", x) for x in (pieces, halves, sums))
        if lib.soft_string(size // 2, *arrays, tension, torque, *found):
            raise NotConverged("torque_and_drag: the friction of the soft string did not converge")
        (pulls, turns), (pull, turn, scale, largest) = pieces.T[:2], sums[:4].tolist()
        if pull <= tol * scale and turn <= tol * largest:
            parts, along = halves[: 4 * size].reshape(4, size), halves[4 * size :].reshape(3, size, len(AT))
            rows = np.repeat(rows, 2, axis=1)
            rows[[0, 3, 4]] = parts[:3]
            rounding = _EPS * size
            return Solved(Chain(*rows, np.repeat(chain.origin, 2)), AT, *along, parts[3], pull + rounding * scale,
                          turn + rounding * largest, np.zeros(size, dtype=bool))  # fmt: skip
        share = np.maximum(pulls / scale, turns / max(largest, _EPS * scale))
        split = (share > tol / (2 * len(share))) & (chain.length > _SHORTEST)
        if not split.any():
            break
        chain = _cut(chain, _places(chain, pieces[:, 2:], split))
    raise NotConverged("torque_and_drag: the soft string did not reach its tolerance: expected a larger tol")


def _many(pieces, coulomb, weight, friction, tension, torque):
    """The sums (cases, 6) of softstring.c of strings on the same `Pieces`, which differ in weight and friction (cases,
    pieces), and in tension and torque (cases,)."""
    found, (ffi, lib) = np.empty((len(tension), 6)), module(_SOURCE)
    rows, work = np.array(chain_of(pieces, coulomb)[:-1]), np.empty(21 * len(pieces.top))
    slip = np.array([pieces.axial, pieces.around, pieces.radius])[:, ::-1]
    of_cases = (weight[:, ::-1], friction[:, ::-1], tension, torque, work, found)
    arrays = [ffi.from_buffer("double[]", np.ascontiguousarray(x)) for x in (rows, _TABLES, slip, *of_cases)]
    lib.soft_strings(*found.shape[:1], len(pieces.top), *arrays[:3], coulomb, *arrays[3:])
    return found


def _places(chain, loads, split):
    """Where pieces are cut, as shares of their lengths (NaN: not): in the middle, and round a sharp turn of q; loads:
    (n, 10) V at the places of all pieces."""
    cuts = np.full((len(split), 7), np.nan)
    cuts[split, 0] = 0.5
    below, above, least = loads[:, 0], loads[:, -1], np.abs(chain.weight * chain.b)
    for i in np.flatnonzero(split & (below * above < 0)):
        zero = _zero(loads[i])
        width = 2 * least[i] / abs(above[i] - below[i])
        cuts[i] = [zero, *(zero + side * width * far for far in (1, 5, 25) for side in (-1, 1))]
        if width < 1e-7:
            cuts[i, 1:] = np.nan
    cuts[~((cuts > 1e-12) & (cuts < 1 - 1e-12))] = np.nan
    cuts[split & np.isnan(cuts).all(axis=1), 0] = 0.5
    return cuts


def _integrated(slope, source, length):
    """P with P' = slope P + source from 0 at the lower end: at ends of pieces (n + 1,) and at their Gauss points."""
    A, gain = (slope @ POINTS_TO.T) * length[:, None], np.exp((slope @ WEIGHTS) * length)
    shrunk = np.exp(-A)
    decay = source * shrunk
    starts = chained(gain, gain * (decay @ WEIGHTS) * length)
    return starts, (starts[:-1, None] + (decay @ POINTS_TO.T) * length[:, None]) / shrunk


def chained(gain, added):
    """(n + 1,) recurrence from 0: each value is gain times the value before, plus `added` (n,)."""
    below = np.stack([np.ones(len(added) + 1), np.append(-gain, 0.0)])  # diagonal and what is below it
    return dtbsv(1, below, np.append(0.0, added), lower=1, diag=1)


def _zero(loads):
    """Where a load changes its sign on a piece, as a share of it, from its values at the places AT."""
    j = int(np.flatnonzero(np.diff(np.sign(loads)))[0])
    series = _RULE.series @ loads[1:-1]
    values = legval(2 * AT[j : j + 2] - 1, series)
    if values[0] * values[1] >= 0:
        return AT[j + int(abs(values[1]) < abs(values[0]))]
    return brentq(lambda x: legval(2 * x - 1, series), AT[j], AT[j + 1], xtol=1e-15)


def _cut(chain, places):
    """The chain with its pieces cut at places, (n, any) shares of their lengths, NaN where there is none."""
    ends = np.sort(np.concatenate([np.zeros((len(places), 1)), places], axis=1), axis=1)
    which, _ = np.nonzero(~np.isnan(ends))
    start = ends[~np.isnan(ends)]
    last = np.append(which[1:] != which[:-1], True)
    end = np.where(last, 1.0, np.append(start[1:], 1.0))
    parts = Chain(*(array[which] for array in chain))
    t, n = parts.down(start * parts.length)
    return parts._replace(length=(end - start) * parts.length, t=t, n=n)


#: Changes per unit of a parameter: arrays over `Pieces`, of weight (N/m) and friction, and numbers at the lower end, of
#: tension (N) and torque (N m).
Change = namedtuple("Change", "weight friction tension torque")


def rates_of(solved, pieces, change, coulomb):
    """Derivatives of tension and torque by the parameter of a `Change`, (n, m) each, at the places of a `Solved`."""
    chain, at = solved.chain, solved.at
    rows, dw = chain.columns, change.weight[chain.origin][:, None]
    k, length, weight, drag = rows.curvature, rows.length, rows.weight, rows.drag
    # mu/sqrt(1 + (e mu)^2) has the derivative 1/(..)^(3/2); without the root it is 1
    of_friction = change.friction[chain.origin] / (chain.climb**3 if coulomb else 1.0)
    d_drag = (pieces.axial[chain.origin] * of_friction)[:, None]
    d_turn = ((pieces.around * pieces.radius)[chain.origin] * of_friction)[:, None]
    u = length * at
    (_, across), height = rows.down(u), rows.height(u)  # per unit of weight
    b2 = rows.b**2
    V = k * solved.tension + weight * across
    N = np.sqrt(V * V + weight**2 * b2)
    known = change.tension + np.concatenate([[0.0], np.cumsum((dw * height)[:-1, -1])])[:, None] + dw * height

    def of_load(d_tension):
        """dN of a change of the tension and of the weight."""
        moved = V * (k * d_tension + dw * across) + weight * b2 * dw
        return np.divide(moved, N, out=np.zeros_like(N), where=N > 0)

    inner = slice(1, -1)
    slope = (drag * k * np.divide(V, N, out=np.zeros_like(V), where=N > 0))[:, inner]
    starts, inside = _integrated(slope, (d_drag * N + drag * of_load(known))[:, inner], chain.length)
    tension = known + np.concatenate([starts[:-1, None], inside, starts[1:, None]], axis=1)
    turned = length * ((d_turn * N + rows.turn * of_load(tension)) @ UP_TO.T)
    torque = change.torque + np.concatenate([[0.0], np.cumsum(turned[:-1, -1])])[:, None] + turned
    return tension, torque


#: {query: its unit}
_QUERIES = {"hook_load": "N", "surface_torque": "N m", "tension": "N", "torque": "N m"}


class Differentiated:
    """Base of `TorqueAndDrag` with its derivatives."""

    def sensitivity(self, parameters: Iterable[str], query: str = "hook_load") -> Sensitivity:
        """Derivatives of a soft string's loads, exactly: the linearised equations are solved on the same pieces.

        Args:
            parameters: names: "friction" (the same change everywhere), "hole.sections[0].friction", "mud.density"
                (inside the string too where it is the same there), "weight" (N/m in mud, of all components),
                "string.components[0].weight" (in mud), "operation.weight" and "operation.torque" (on bit).
            query: "hook_load" (N), "surface_torque" (N m), or "tension" and "torque" at all of `md`.

        Returns:
            Sensitivity, in SI units.

        Raises:
            SceneError: an unknown name or query, a string with a helix, or the rod in contact.
        """
        rod = self.model not in ("soft", "buckled")
        if rod or self.solved.helical.any():
            why = "by the rod in contact" if rod else "for a string with a helix"
            raise SceneError(
                f"sensitivity: this answer is {why} (model = '{self.model}'), which has no derivatives: "
                "expected the answer of torque_and_drag(..., model='soft')"
            )
        if query not in _QUERIES:
            raise SceneError(f"query = {query!r}: {nearest(query, _QUERIES)}")
        found = self._known(parameters)
        rates = {name: self._rate(change, query) for name, (change, _, _) in found.items()}
        zero = {name: np.zeros_like(rate) for name, rate in rates.items()}
        return Sensitivity(
            np.asarray(getattr(self, query)), rates, zero, {name: value for name, (_, value, _) in found.items()},
            {name: unit for name, (_, _, unit) in found.items()}, query, _QUERIES[query],
        )  # fmt: skip

    def batch(self, over: Iterable[str], values: np.ndarray) -> Cases:
        """Hook load and surface torque of the soft string for many values of its numbers, solved in C one after
        another: each as of `torque_and_drag` with these numbers and the same `tol`.

        Args:
            over: names as of `sensitivity`; "friction" and "weight" are those of the whole hole and string, but for
                sections and components that are named too.
            values: (cases, names) of them, in SI units.

        Returns:
            Cases: its values are (cases, 2) hook load (N) and surface torque (N m), with the estimated errors of the
            solution; those of the model are `model_error` of single answers. `by_solve`: pieces were cut.

        Raises:
            SceneError: unknown names, values of another shape or out of range, or an answer of another model.
        """
        if self.model != "soft":
            raise SceneError(
                f"batch: model = {self.model!r}: expected the answer of torque_and_drag(..., model='soft')"
            )
        known, pieces, coulomb = self._known(over, "batch.over"), self.pieces, self.torque_convention == "coulomb"
        values = finite_array("batch", "values", values, f"(cases, {len(known)}) finite numbers")
        if values.ndim != 2 or values.shape[1] != len(known):
            refuse("batch", "values", values, f"rows of {len(known)} numbers: {', '.join(known)}")
        for name, each in zip(known, values.T, strict=True):
            least = 0.0 if name.endswith("friction") or "mud" in name else -np.inf
            most = 5.0 if name.endswith("friction") else np.inf
            if each.min(initial=0.0) < least or each.max(initial=0.0) > most:
                refuse("batch", name, each, f"numbers from {least:g} to {most:g}")
            if least == 0:
                told = f"batch: {name} = {{value:g}}, in {{count}} of {len(each)} cases,"
                doubt_value("density" if "mud" in name else "friction", told, each)
            for motor in self.string.components if name == "operation.torque" and len(each) else ():
                if isinstance(motor, MudMotor) and not motor.stands(float(np.abs(each).max())):
                    motor.running(type(self.operation).__name__, float(each.max()))
        found = np.empty((len(values), 6))
        for i in range(0, len(values), _AT_ONCE):
            found[i : i + _AT_ONCE] = _many(pieces, coulomb, *self._strings(known, values[i : i + _AT_ONCE]))
        sizes, rounding = np.abs(found[:, 2:4]), 2 * _EPS * len(pieces.top)
        cut, failures = ~(found[:, :2] <= self.tol * sizes).all(axis=1), {}
        loads, errors = found[:, 4:].copy(), found[:, :2] + rounding * sizes
        for i in np.flatnonzero(cut).tolist():
            weight, friction, *lower = (x[0] for x in self._strings(known, values[i : i + 1]))
            chain = chain_of(pieces._replace(weight=weight, friction=friction), coulomb)
            try:
                one = soft_string(chain, *lower, self.tol)
            except NotConverged as problem:
                loads[i] = errors[i] = np.nan
                failures[i] = str(problem)
            else:
                loads[i], errors[i] = (one.tension[-1, -1], one.torque[-1, -1]), (one.error, one.torque_error)
        return Cases(loads, errors, cut, failures)

    def _strings(self, known, values):
        """Weight and friction (cases, pieces), tension and torque at the lower end (cases,), of cases of `batch`."""
        weight, friction = (np.tile(x, (len(values), 1)) for x in (self.pieces.weight, self.pieces.friction))
        tension, torque = (np.full(len(values), x) for x in (-self.operation.weight, self.operation.torque))
        given = dict(zip(known, values.T, strict=True))
        for name in sorted(known, key=lambda x: ("mud" not in x, "[" in x)):  # what is for a part of the string last
            (change, value, _), each = known[name], given[name]
            if name.startswith("operation"):
                tension, torque = (-each, torque) if name == "operation.weight" else (tension, each)
            elif "mud" in name:
                weight += np.outer(each - value, change.weight)
            else:
                weight += (each[:, None] - weight) * change.weight
                friction += (each[:, None] - friction) * change.friction
        return weight, friction, tension, torque

    def uncertainty(
        self,
        standard_deviations: Mapping[str, float | str],
        query: str = "hook_load",
        correlation: np.ndarray | None = None,
    ) -> Uncertainty:
        """The first-order standard deviation of a load, with the share of each parameter; it can be printed.

        Args:
            standard_deviations: {name: standard deviation}; names and query as of `sensitivity`.
            correlation: see `Sensitivity.uncertainty`; that of a `FrictionFit` for its coefficients.

        Raises:
            SceneError: as of `sensitivity` and `Sensitivity.uncertainty`.
        """
        return self.sensitivity(standard_deviations, query).uncertainty(standard_deviations, correlation)

    def _rate(self, change, query):
        tension, torque = rates_of(self.solved, self.pieces, change, self.torque_convention == "coulomb")
        if query in ("tension", "torque"):
            return self._down(tension if query == "tension" else torque)
        return np.asarray((tension if query == "hook_load" else torque)[-1, -1])

    def _known(self, parameters, called="sensitivity.parameters"):
        """{name: (`Change`, value, unit)} of parameters by their names; `called` in errors."""
        known = self._parameters()
        if not isinstance(parameters, Iterable):
            refuse(*called.split("."), parameters, "a list of names, such as ['friction', 'mud.density']")
        names = [parameters] if isinstance(parameters, str) else list(parameters)
        for name in names:
            if name in ("mud.density", "mud.inside") and isinstance(self.mud and self.mud.density, tuple):
                raise SceneError(
                    f"parameter {name!r} of a string: it is rows of depth and density, which have no one derivative: "
                    "expected one density, Mud(density), or the difference of the answers of two Mud([...])"
                )
            if name not in known:
                plain = ", ".join(x for x in known if "[" not in x)
                raise SceneError(
                    f"parameter {name!r} of a string: known: {plain}, hole.sections[i].friction with i from 0 to "
                    f"{len(self.hole.sections) - 1}, string.components[i].weight with i from 0 to {len(self.laid) - 1}"
                )
        return {name: known[name] for name in names}

    def _parameters(self):
        """{name: (`Change`, value, unit)} of all parameters."""
        pieces, operation, mud = self.pieces, self.operation, self.mud
        none, ones = np.zeros(len(pieces.top)), np.ones(len(pieces.top))
        found = {
            "friction": (Change(none, ones, 0.0, 0.0), math.nan, "1"),
            "weight": (Change(ones, none, 0.0, 0.0), math.nan, "N/m"),
            "operation.weight": (Change(none, none, -1.0, 0.0), operation.weight, "N"),
            "operation.torque": (Change(none, none, 0.0, 1.0), operation.torque, "N m"),
        }
        if mud is not None and not isinstance(mud.density, tuple):
            weights = np.array([_by_density(place.component, mud) for place in self.laid])[pieces.component]
            found["mud.density"] = Change(weights, none, 0.0, 0.0), mud.density, "kg/m^3"
        section = np.searchsorted([x.to for x in self.hole.sections[:-1]], (pieces.top + pieces.bottom) / 2)
        for i, one in enumerate(self.hole.sections):
            change = Change(none, (section == i).astype(float), 0.0, 0.0)
            found[f"hole.sections[{i}].friction"] = change, one.friction, "1"
        for i in range(len(self.laid)):
            here = pieces.component == i
            weights = set(pieces.weight[here])
            weight = float(weights.pop()) if len(weights) == 1 else math.nan  # of several, or of none
            found[f"string.components[{i}].weight"] = Change(here.astype(float), none, 0.0, 0.0), weight, "N/m"
        return found


def _by_density(component, mud):
    """Derivative of the weight in mud (N/m) by its density; 0 where given. See `components.weight_in_mud`."""
    if component.weight is not None:
        return 0.0
    bore = math.pi / 4 * component.inner_diameter**2
    lifted = component.mass / component.material.density + bore
    return -mud.gravity * (lifted - bore * (mud.inside == mud.density))
