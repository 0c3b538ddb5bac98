"""Exudyn's runner of `demos/evidence/peers` with a history of loads, a held
tip, and a test on the residual; see `peers.speak`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "peers"))

import exudyn as exu
import numpy as np
from exudyn import itemInterface as item
from exudyn_motion import hold
from exudyn_rod import DISPLACEMENT, NODES, _rod, _settings, load
from speak import Stopped, serve


def prepare(problem, configuration):
    return lambda: _solve(problem, configuration)


def _solve(problem, configuration):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    element, tip = configuration["element"], _rod(mbs, problem, configuration)
    stages = problem.get("history") or [(factor, factor) for factor in problem["load_factors"]]
    stages = [(0.0, 0.0), *stages]
    last = len(stages) - 1

    def loaded(column):
        def vector(mbs, time, whole):  # one unit of time per stage, with substeps of the solver in between
            i = min(int(time + 1e-9), last - 1)
            factor = stages[i][column] + (time - i) * (stages[i + 1][column] - stages[i][column])
            return [factor * x for x in whole]

        return vector

    load(mbs, problem, tip, loaded(0), loaded(1))
    if problem.get("guided"):
        hold(mbs, tip, (0, 2, 4, 5, 6) if element.endswith("EP") else (0, 2))
    sensor = mbs.AddSensor(item.SensorNode(nodeNumber=tip, storeInternal=True, outputVariableType=DISPLACEMENT))
    mbs.Assemble()
    solver = "EigenSparse" if configuration["elements"] * NODES[element] > 16 else "EXUdense"
    settings = _settings(configuration, last, solver)  # EigenDense does not see that a matrix is singular
    # a dead moment on a node's rotation parameters is a load that depends on them
    settings.staticSolver.computeLoadsJacobian = configuration.get("load_jacobian", False)
    if "residual" in configuration:  # its own default test
        newton = settings.staticSolver.newton
        newton.residualMode, newton.relativeTolerance, newton.absoluteTolerance = 0, configuration["residual"], 1e-12
    done = mbs.SolveStatic(settings, showHints=False, showCausingItems=False)
    rows = mbs.GetSensorStoredData(sensor)
    if not done:
        raise Stopped(
            f"SolveStatic failed beyond the load factor {_factor(stages, rows[-1, 0] if len(rows) else 0.0):.6g}"
        )
    at = np.searchsorted(rows[:, 0], np.arange(1, last + 1) - 1e-6)
    if at[-1] >= len(rows):
        raise Stopped(f"it stopped beyond the load factor {_factor(stages, rows[-1, 0]):.6g}")
    return rows[at, 1:4].tolist()


def _factor(stages, time):
    """The force's factor at a time."""
    return float(np.interp(time, np.arange(len(stages)), [stage[0] for stage in stages]))


if __name__ == "__main__":
    exu.config.suppressWarnings = True
    serve(prepare, {"exudyn": exu.GetVersionString().split()[0]})
