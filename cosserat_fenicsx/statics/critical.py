"""Derivatives of the critical load factors of linear buckling by numbers of a scene.

With the second variation K at a state and its derivative K' along the path due to stresses alone, the critical change
of the load factor is Rayleigh's quotient -phi K phi/phi K' phi, which is stationary in the mode phi: its derivative by
a parameter is that at fixed phi. State, contact force and their slopes by the load factor follow the parameter to first
order, by the direct method of `sensitivity`.
"""

import itertools

import numpy as np

from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.numerics import PLACES, derivative
from cosserat_fenicsx.results.sensitivity import Sensitivity
from cosserat_fenicsx.scene.parameters import parameter_of
from cosserat_fenicsx.statics.energies import Energies
from cosserat_fenicsx.statics.path.follower import Follower
from cosserat_fenicsx.statics.path.load_control import StepControl
from cosserat_fenicsx.statics.sensitivity import Direct, check_scene, scenes_near
from cosserat_fenicsx.statics.solvers import solvers_of

# Load factors are equal that differ by less, relative; derivatives of equal ones, likewise, with rounding.
_EQUAL, _TOGETHER = 1e-5, 1e-5
# Step of the load factor for K', over the critical change.
_STEP = 1e-3


def critical_sensitivity(buckling, parameters):
    """See `Buckling.sensitivity`."""
    if not len(buckling) or not buckling.conservative:
        why = "the loads have no potential" if not buckling.conservative else "there is no critical load factor"
        raise SceneError(f"sensitivity: {why}: expected a Buckling with load factors, of loads that have a potential")
    parameters = [parameters] if isinstance(parameters, str) else list(parameters)
    scene, layout, at = buckling.scene, buckling.equilibrium.layout, buckling.load_factor
    check_scene(scene, critical=True)
    found = [parameter_of(scene, given) for given in parameters]
    scenes = [scenes_near(scene, parameter) for parameter in found]
    with (
        solvers_of(scene, layout, degree=buckling.degree, comm=buckling.comm) as solvers,
        Direct(*solvers, scene, layout) as direct,
    ):
        direct.check(scenes, found)
        direct.points = [_state(direct, at)]
        modes, pairs = _modes(buckling, direct.model.scales.length)
        quotient = _Quotient(direct, modes, buckling.load_factors[0] - at)
        derivatives, errors = {}, {}
        for parameter, rates in zip(found, direct.rates(scenes, found), strict=True):
            relative, error = _relative(direct, quotient, parameter, rates)
            _check_pairs(buckling, parameter, relative, pairs)
            critical = buckling.load_factors - at
            derivatives[parameter.name] = critical * relative[: len(critical)]
            errors[parameter.name] = critical * error[: len(critical)]
    return Sensitivity(
        buckling.load_factors, derivatives, errors, {x.name: x.value for x in found}, {x.name: x.unit for x in found},
        "load factor",
    )  # fmt: skip


def _state(direct, load_factor):
    """(load factor, numbers, None) of the state that modes belong to."""
    follower = Follower(direct.problem, direct.newton, direct.stability, StepControl(), control="load")
    follower.begin()
    if load_factor and not follower.to(load_factor, abs(load_factor)):
        raise NotConverged(f"no equilibrium was found at the load factor {load_factor:g}: {follower.track.failure}")
    return load_factor, direct.problem.numbers(), None


def _modes(buckling, length):
    """The modes (m, N, 6), dimensionless, then the sums of those of equal load factors; and [(i, j, index of the sum)]
    of these."""
    modes = buckling.shapes / np.repeat([length, 1.0], 3)
    values, pairs, sums = buckling.load_factors, [], []
    for i, j in itertools.combinations(range(len(modes)), 2):
        if abs(values[i] - values[j]) <= _EQUAL * abs(values[i]):
            pairs.append((i, j, len(modes) + len(sums)))
            sums.append(modes[i] + modes[j])
    return [*modes, *sums], pairs


class _Quotient:
    """Rayleigh's quotients of modes at the state of a `Direct`.

    Args:
        direct: the `Direct`; modes: each (N, 6); critical: change of the load factor that matters.
    """

    def __init__(self, direct, modes, critical):
        self._direct, self._step, part = direct, _STEP * critical, direct.stability.whole
        if direct.problem.ties:
            part.form.refresh()
            part.assemble()  # for the springs in place of supports and joints
        self._energies = Energies(direct.problem, modes, part.resistance)

    def here(self):
        """(modes,) the critical changes of the load factor."""
        direct, eta, numbers = self._direct, self._direct.problem.load_factor, self._direct.problem.numbers()
        direct.factor(eta, numbers)
        slope, stiff = direct.slope(), self._energies.here()
        sides = []
        for k in PLACES:
            direct.put((eta + k * self._step, numbers, None), slope, k * self._step)
            with direct.model.stress_alone():
                sides.append(self._energies.here(springs=False))
        direct.put((eta, numbers, None), slope, 0.0)
        return -stiff / derivative(sides, self._step)[0]


def _relative(direct, quotient, parameter, rates):
    """(derivatives of the quotients over the quotients, their errors)."""
    step, values = direct.step(parameter, rates), []
    for k in PLACES:
        direct.load_near(parameter, k * step)
        direct.put(direct.points[0], rates[0], k * step)
        values.append(np.log(quotient.here()))
    return derivative(values, step)


def _check_pairs(buckling, parameter, relative, pairs):
    """Refuse a parameter that separates equal load factors."""
    for i, j, both in pairs:
        one, other, mixed = relative[[i, j, both]] * parameter.size
        if max(abs(one - other), abs(one - mixed)) > _TOGETHER * max(1.0, abs(one)):
            raise SceneError(
                f"parameter '{parameter.name}': it separates the critical load factors {i} and {j}, which are both "
                f"{buckling.load_factors[i]:.6g} and have no derivatives by it: expected a parameter that keeps the "
                "symmetry, or load factors that differ"
            )
