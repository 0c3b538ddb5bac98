"""Derivatives of critical load factors by parameters of a scene: of linear buckling, limit points and bifurcations.

Linear buckling: with the second variation K at a state and its derivative K' along the path due to stresses alone, the
critical change of the load factor is Rayleigh's quotient -phi K phi/phi K' phi, which is stationary in the mode phi:
its derivative by a parameter is that at fixed phi. State, contact force and their slopes by the load factor follow the
parameter to first order, by the direct method of `sensitivity`.

Events: along an arc of the path, of points (x, eta) on planes c x = const., K dx + R_p dp + R_eta d eta = 0 and c dx =
0 give

    d eta/dp = -(c K^-1 R_p)/(c K^-1 R_eta),

with the residual R and its tangent K. At a limit point, where eta is stationary on the arc, that is the derivative of
the limit load. The load factor of a bifurcation is that at which the second variation mu along the mode vanishes on the
path, so that d eta/dp = -mu_p/mu_eta, both along the path: x follows p and eta to first order, by the direct method.

K is singular at the event, and a state interpolated from its neighbours is no equilibrium to rounding. So the means of
the values at two equilibria just before and behind it are taken, whose error is of second order in their distance.
"""

import itertools
from dataclasses import replace
from functools import partial

import numpy as np

from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.models.compiled import EnergyOfMotion, made_once
from cosserat_fenicsx.numerics import PLACES, derivative
from cosserat_fenicsx.results.records import Event
from cosserat_fenicsx.results.queries import Sensitivity, called
from cosserat_fenicsx.statics.path.follower import Follower, standing
from cosserat_fenicsx.statics.path.load_control import StepControl
from cosserat_fenicsx.statics.problem import refuse_given_lengths, refuse_rod_contact, refuse_rough_threads
from cosserat_fenicsx.statics.sensitivity import Direct, parameters_of, sensitivity

# Relative differences below which load factors are equal, and the derivatives of equal ones.
_EQUAL, _PAIRED = 1e-5, 1e-5
_STEP = 1e-3  # step of the load factor for K', over the critical change


def critical_sensitivity(buckling, parameters):
    """See `Buckling.sensitivity`."""
    if not len(buckling) or not buckling.conservative:
        why = "the loads have no potential" if not buckling.conservative else "there is no critical load factor"
        raise SceneError(f"sensitivity: {why}: expected a Buckling with load factors, of loads that have a potential")
    scene, layout, load_factor = buckling.scene, buckling.equilibrium.layout, buckling.load_factor
    found = parameters_of(scene, parameters, critical=True)
    with Direct.on(scene, layout, found, degree=buckling.degree, comm=buckling.comm) as direct:
        direct.points = [(load_factor, standing(*direct.solvers, load_factor).problem.numbers(), None)]
        modes, pairs = _buckling_modes(buckling, direct.model.scales.length)
        part, step = direct.stability.whole, _STEP * (buckling.load_factors[0] - load_factor)
        if direct.problem.ties:
            part.form.refresh()
            part.assemble()  # for the springs in place of supports and joints
        energies = Energies(direct.problem, modes, part.resistance)

        def logarithms():
            return np.log(_quotients(direct, energies, step))

        critical, derivatives, errors = buckling.load_factors - load_factor, {}, {}
        for parameter, rates in zip(found, direct.rates(), strict=True):
            (relative,), (error,) = _by_parameter(direct, parameter, rates, logarithms)
            _check_pairs(buckling, parameter, relative, pairs)
            derivatives[parameter.name] = critical * relative[: len(critical)]
            errors[parameter.name] = critical * error[: len(critical)]
    return Sensitivity.by(found, buckling.load_factors, derivatives, errors, "load factor")


def _buckling_modes(buckling, length):
    """The modes (m, N, 6), dimensionless, then the sums of those of equal load factors; and their [(i, j, index)]."""
    modes = buckling.shapes / np.repeat([length, 1.0], 3)
    values, pairs, sums = buckling.load_factors, [], []
    for i, j in itertools.combinations(range(len(modes)), 2):
        if abs(values[i] - values[j]) <= _EQUAL * abs(values[i]):
            pairs.append((i, j, len(modes) + len(sums)))
            sums.append(modes[i] + modes[j])
    return [*modes, *sums], pairs


def _quotients(direct, energies, step):
    """(modes,) Rayleigh's quotients, the critical changes of the load factor; step: of it, for differences."""
    point = direct.problem.load_factor, direct.problem.numbers(), None
    direct.factor(*point[:2])
    slope, stiff = direct.slope(), energies.here()

    def by_stress_alone():
        with direct.model.stress_alone():
            return energies.here(springs=False)

    softer = _by_load_factor(direct, point, slope, step, by_stress_alone)
    direct.put(point, slope, 0.0)
    return -stiff / softer


def _by_load_factor(direct, point, slope, step, value):
    """The derivative of a function of the state along the path, of a slope (see `Direct.slope`), at a point."""
    load_factor, numbers, _ = point
    values = []
    for k in PLACES:
        direct.put((load_factor + k * step, numbers, None), slope, k * step)
        values.append(value())
    return derivative(values, step)[0]


def _by_parameter(direct, parameter, rates, value):
    """(points, ...) derivatives of a function of the state by a parameter, and their errors; rates: of the points."""
    step, values = direct.step(parameter, rates), []
    for k in PLACES:
        direct.load_near(parameter, k * step)
        values.append([])
        for point, rate in zip(direct.points, rates, strict=True):
            direct.put(point, rate, k * step)
            values[-1].append(value())
    return derivative(values, step)


def _check_pairs(buckling, parameter, relative, pairs):
    """Refuse a parameter that separates equal load factors."""
    for i, j, both in pairs:
        one, other, mixed = relative[[i, j, both]] * parameter.size
        if max(abs(one - other), abs(one - mixed)) > _PAIRED * max(1.0, abs(one)):
            raise SceneError(
                f"parameter '{parameter.name}': it separates the critical load factors {i} and {j}, which are both "
                f"{buckling.load_factors[i]:.6g} and have no derivatives by it: expected a parameter that keeps the "
                "symmetry, or load factors that differ"
            )


class Energies:
    """The second variation along modes at the state of a `Problem` in space, supports and joints included; modes: each
    (N, 6) displacements and rotations of all nodes in the scene's order, inertial, dimensionless; resistance: see
    `Part`, None for modes that satisfy all constraint equations."""

    def __init__(self, problem, modes, resistance=None):
        model = problem.model
        self._problem, self._modes, self._resistance = problem, modes, resistance
        self._energy = made_once(model, "energy_of_motion", EnergyOfMotion)
        (variation,) = model.second_variations
        self._axes = variation.axes
        self._tied = np.array([mode[model.tied_slots] for mode in modes])

    def here(self, springs=True):
        """(modes,) dimensionless; springs: whether those in place of supports and joints count."""
        ties, load_factor, tied = self._problem.ties, self._problem.tie_load_factor, self._tied
        found = np.array([self._energy.along(mode) for mode in self._modes])
        if ties:
            found += ties.energy(ties.second_variation(self._axes, load_factor), tied)
            if springs and self._resistance is not None:
                found += ties.energies_of_springs(self._axes, load_factor, self._resistance, tied)
        return found


_SAME = 1e-4  # relative difference of the load factors of the same event
# Distance of the two points from an event: of the load factor, relative; of the state (lengths, rad), tried in turn;
# largest distance of the event from their middle, over their distance.
_BESIDE, _ASIDE, _BENT = 2e-5, (1e-5, 1e-4, 1e-3), 0.1
# An imperfection changes the state with opposite signs at the two points: the difference exceeds this share of the sum.
_OPPOSITE = 0.5
_NOTHING = 1e-6  # changes below this are rounding (lengths, rad)
_HELD = 1e-7  # largest violation of constraint equations by a mode
_TOGETHER = 1e-5  # largest relative difference of the derivatives of a double bifurcation


def derivatives_of(path, query, parameters):
    """See `Path.sensitivity`."""
    refuse_rod_contact("sensitivity", path.scene)
    if isinstance(query, Event):
        refuse_rough_threads("sensitivity of an event", path.scene)
        refuse_given_lengths("sensitivity of an event", path.scene)
        return _of_event(path, query, parameters)
    return replace(sensitivity(path, query, parameters), quantity=called(query))


def _of_event(path, event, parameters):
    if not any(event is known for known in path.events):
        raise SceneError("sensitivity: the event does not belong to this path: expected one of path.events")
    if event.kind == "flutter":
        raise SceneError("sensitivity: the event is the onset of flutter: expected a limit point or a bifurcation")
    if event.kind == "bifurcation" and not path.conservative:
        raise SceneError("sensitivity: derivatives of bifurcations are known for loads with a potential alone")
    found = parameters_of(path.scene, parameters, critical=True)
    with Direct.along(path, found) as direct:
        track, crossing, before = _located(direct, path, event)
        direct.points = _beside(direct, track, crossing, before)
        of = _of_limit if event.kind == "limit" else _of_bifurcation
        derivatives, errors = (
            {x.name: np.asarray(value) for x, value in zip(found, values, strict=True)}
            for values in of(direct, crossing, found, direct.rates())
        )
    value, quantity = np.asarray(event.load_factor), f"load factor of the {event.kind}"
    return Sensitivity.by(found, value, derivatives, errors, quantity)


class _Met(Exception):
    """Raised with the `Crossing` of the event and the `PathPoint` before it."""


def _located(direct, path, event):
    """The `Track`, the `Crossing` of an event and the `PathPoint` before it, by following the path again."""

    def meet(crossing):
        apart = abs(crossing.point.load_factor - event.load_factor)
        if crossing.kind == event.kind and apart <= _SAME * abs(event.load_factor):
            raise _Met(crossing, follower.track.here)

    control = "arc" if path.control == "arc" else "auto"
    follower = Follower(*direct.solvers, StepControl(), control=control, on_event=meet)
    # the next point of the path may have been passed already at a limit point, which the last load factor lies beyond
    ends = [path.load_factors[event.after + 1 :][:1], path.load_factors[-1:], event.load_factor * np.array([1.1, 0.9])]
    load_factors = np.concatenate([path.load_factors[: event.after + 1], *ends]).tolist()
    try:
        follower.begin(load_factors)
        for load_factor in load_factors:
            if load_factor != follower.track.here.load_factor and not follower.to(load_factor):
                break
    except _Met as met:
        return follower.track, *met.args
    raise NotConverged(
        f"sensitivity: the {event.kind} at the load factor {event.load_factor:.6g} was not found again on the path "
        "from rest: expected an event before the path leaves for a branch"
    )


def _beside(direct, track, crossing, before):
    """[(load factor, numbers, None)] of two equilibria before and behind a `Crossing`; before: a `PathPoint`."""
    middle, inner = crossing.point, direct.model.inner
    for distance in _ASIDE if crossing.kind == "limit" else (None, *_ASIDE):
        pair = [_one_beside(direct, track, crossing, before, side, distance) for side in (-1, 1)]
        if None in pair:
            continue
        low, high = (numbers[0] for _, numbers, _ in pair)
        off, apart = (np.sqrt(inner(x, x)) for x in (low + high - 2 * middle.numbers[0], high - low))
        if off <= _BENT * apart + _NOTHING:  # else one of them is on another branch
            return pair
    raise NotConverged(f"sensitivity: the path was not found again on both sides of the {crossing.kind}")


def _one_beside(direct, track, crossing, before, side, distance):
    """One of `_beside`, or None; distance: along the path, or None for a step of the load factor."""
    numbers, load_factor = [values.copy() for values in crossing.point.numbers], crossing.point.load_factor
    limit = crossing.kind == "limit"
    track.neutral = None if limit else crossing.direction.copy()  # Newton's steps leave out the mode, and its branch
    if distance is None:
        solved = track.at_load(numbers, load_factor * (1 + side * _BESIDE))
    else:
        normal = crossing.direction if limit else numbers[0] - before.numbers[0]
        numbers[0] += side * distance / direct.model.largest(normal) * normal
        solved = track.on_plane(numbers, load_factor, normal, 0.0)
    track.neutral = track.newton.bordered.neutral = None
    if solved.converged and not limit:  # what is left of the mode in the interpolated state goes
        solved = track.at_load(direct.problem.numbers(), direct.problem.load_factor)
    return (direct.problem.load_factor, direct.problem.numbers(), None) if solved.converged else None


def _of_limit(direct, crossing, parameters, rates):
    """(derivatives of the load factor, bounds on their errors)."""
    inner, slopes = direct.model.inner, []
    for load_factor, numbers, _ in direct.points:
        direct.factor(load_factor, numbers)
        slopes.append(inner(crossing.direction, direct.slope()[0]))
    found = np.array([
        [-inner(crossing.direction, rate[0]) / slope for rate, slope in zip(each, slopes, strict=True)]
        for each in rates
    ])  # fmt: skip
    return found.mean(axis=1), _ASIDE[0] * np.abs(np.diff(found))[:, 0]


# -- bifurcations -----------------------------------------------------------------------------------------------------


def _of_bifurcation(direct, crossing, parameters, rates):
    """(derivatives of the load factor, bounds on their errors)."""
    for parameter, each in zip(parameters, rates, strict=True):
        _check_perfect(direct.model, parameter, each)
    modes = _modes(direct, crossing)
    energies = Energies(direct.problem, modes)
    tied, size = np.array(modes)[:, direct.model.tied_slots], np.abs(modes).max()

    def stiffness():
        """(modes,) the second variation with the true stiffnesses where they are finite."""
        K = direct.model.section.K
        direct.model.stiffen(np.where(np.isfinite(K), K, direct.model.bounded_K))
        return energies.here()

    def along_path(point):
        direct.factor(*point[:2])
        return _by_load_factor(direct, point, direct.slope(), 0.1 * _BESIDE * point[0], stiffness)

    def held_stiffness(parameter):
        found, ties = stiffness(), direct.problem.ties
        if ties and np.abs(np.einsum("tni,mni->tm", ties.gradients(), tied)).max() > _HELD * size:
            raise SceneError(
                f"parameter '{parameter.name}' turns supports or joints in which the mode moves: the derivative of "
                "this bifurcation by it is not known"
            )
        return found

    by_load = np.mean([along_path(point) for point in direct.points], axis=0)
    found, errors = [], []
    for parameter, each in zip(parameters, rates, strict=True):
        slopes, error = _by_parameter(direct, parameter, each, partial(held_stiffness, parameter))
        of_modes = -slopes.mean(axis=0) / by_load
        if np.ptp(of_modes) * parameter.size > _TOGETHER * abs(crossing.point.load_factor):
            raise SceneError(
                f"parameter '{parameter.name}': it separates the two bifurcations at the load factor "
                f"{crossing.point.load_factor:.6g}, which have no derivatives by it: expected a parameter that keeps "
                "the symmetry"
            )
        found.append(of_modes[0])
        errors.append((error / np.abs(by_load)).max())
    return found, errors


def _check_perfect(model, parameter, rates):
    low, high = (parameter.size * rate[0] for rate in rates)
    apart, together = model.largest(high - low), model.largest(high + low)
    if apart > _OPPOSITE * together + _NOTHING:
        raise SceneError(
            f"parameter '{parameter.name}': it is an imperfection, with which the bifurcation disappears and the load "
            "has no derivative: expected a parameter that keeps the symmetry, or a limit point"
        )


def _modes(direct, crossing):
    """(N, 6) the mode of all nodes, the mean of both points; of a double bifurcation also the other, and their sum."""
    bordered = direct.newton.bordered
    found = [0.0] * (1 if crossing.partner is None else 2)
    for load_factor, numbers, _ in direct.points:
        direct.factor(load_factor, numbers)
        starts = [crossing.null] if crossing.partner is None else [crossing.null, bordered.motion_of(crossing.partner)]
        for k, start in enumerate(starts):
            _, motion = bordered.response(start)
            found[k] = found[k] + np.sign(bordered.work(motion, start)) / 2 * direct.model.everywhere(motion)
    return found if crossing.partner is None else [*found, found[0] + found[1]]
