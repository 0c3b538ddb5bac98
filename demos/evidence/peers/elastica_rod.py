"""PyElastica: an explicit dynamic rod, damped until it rests; see `speak` for requests and answers.

The sample is the whole relaxation from the unloaded state, load factor after load factor; numba has compiled before.
Inertia does not affect the equilibrium: the density only sets the unit of time, and the rotational inertia is raised so
that only axial waves limit the step (thousands of steps less for slender rods). The damping is below critical for the
lowest bending mode, and a load factor is finished when the tip moves by less than `tol` of the length in a period.
"""

import math

import elastica as ea
import numpy as np
from elastica.version import VERSION
from speak import Stopped, serve


class _Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):
    pass


class _TipLoad(ea.NoForces):
    """A dead force and a dead moment on the tip, times factor[0]; PyElastica keeps torques in the directors' frame."""

    def __init__(self, factor, force, moment):
        super().__init__()
        self.factor, self.force, self.moment = factor, np.array(force), np.array(moment)

    def apply_forces(self, system, time=0.0):
        system.external_forces[..., -1] += self.factor[0] * self.force

    def apply_torques(self, system, time=0.0):
        system.external_torques[..., -1] += system.director_collection[..., -1] @ (self.factor[0] * self.moment)


def prepare(problem, configuration):
    _relax({**problem, "load_factors": [0.0]}, {**configuration, "elements": 4, "tol": 1.0})  # numba compiles here
    return lambda: _relax(problem, configuration)


def _relax(problem, configuration):
    L, n = problem["length"], configuration["elements"]
    A, density = problem["area"], 1.0
    simulator, rod = _Simulator(), _rod(problem, n, density)
    simulator.append(rod)
    simulator.constrain(rod).using(ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,))
    applied = [0.0]
    simulator.add_forcing_to(rod).using(_TipLoad, applied, problem["force"], problem["moment"])
    period = 2 * math.pi / (3.516 * math.sqrt(problem["EI"] / (density * A * L**4)))
    step = configuration.get("courant", 0.6) * _size(problem, n) / math.sqrt(problem["EA"] / (density * A))
    damping = {"uniform_damping_constant": configuration.get("damping", 0.3) * 2 * math.pi / period, "time_step": step}
    simulator.dampen(rod).using(ea.AnalyticalLinearDamper, **damping)
    simulator.finalize()
    rod.compute_internal_forces_and_torques(0.0)
    rod.rest_kappa[:] = rod.kappa
    stepper, time, tips = ea.PositionVerlet(), 0.0, []
    start, steps = rod.position_collection[..., -1].copy(), math.ceil(period / step)
    for factor in problem["load_factors"]:
        applied[0] = factor
        before = np.full(3, np.inf)
        while np.linalg.norm(rod.position_collection[..., -1] - before) > configuration["tol"] * L:
            before = rod.position_collection[..., -1].copy()
            for _ in range(steps):
                time = stepper.step(simulator, time, step)
            if not np.isfinite(rod.position_collection).all():
                raise Stopped(f"the motion blew up at the load factor {factor:g}")
        tips.append(rod.position_collection[..., -1] - start)
    return tips


def _size(problem, n):
    """Length of an element: half of the first one lies before the clamp, whose director is then at the clamp."""
    return problem["length"] / (n - 0.5)


def _rod(problem, n, density):
    R = problem["radius"]
    size = _size(problem, n)
    s = size * (np.arange(n + 1) - 0.5)
    place = [R * np.sin(s / R), R * (1 - np.cos(s / R)), 0 * s] if R else [s, 0 * s, 0 * s]
    given = {"position": np.array(place)}
    tangents = np.diff(given["position"], axis=1)
    tangents /= np.linalg.norm(tangents, axis=0)
    normals = np.tile([[0.0], [0.0], [1.0]], n)
    given["directors"] = np.stack([normals, np.cross(tangents, normals, axis=0), tangents])
    rod = ea.CosseratRod.straight_rod(
        n, given["position"][:, 0], tangents[:, 0], normals[:, 0], size * n, math.sqrt(problem["area"] / math.pi),
        density,
        youngs_modulus=problem["EA"] / problem["area"], shear_modulus=problem["GA"] / problem["area"], **given,
    )  # fmt: skip
    shear = np.diag([problem["GA"], problem["GA"], problem["EA"]])
    bending = np.diag([problem["EI"], problem["EI"], problem["GJ"]])
    rod.shear_matrix[:] = shear[..., None]
    rod.bend_matrix[:] = bending[..., None]
    raised = max(1.0, size**2 * problem["EA"] / (4 * problem["EI"]))
    rod.mass_second_moment_of_inertia *= raised
    rod.inv_mass_second_moment_of_inertia /= raised
    return rod


if __name__ == "__main__":
    serve(prepare, {"pyelastica": VERSION, "numpy": np.__version__})
