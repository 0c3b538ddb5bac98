"""OpenSeesPy's runner of `demos/evidence/peers` with a history of loads, a held tip, a
clamp that turns, and a test on the residual; see `peers.speak`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "peers"))

import openseespy.opensees as ops
from opensees_rod import _analyse, _build, advance
from speak import Stopped, serve


def prepare(problem, configuration):
    return lambda: _solve(problem, configuration)


def _solve(problem, configuration):
    history = problem.get("history")
    tip = _build({**problem, "force": [0.0] * 3, "moment": [0.0] * 3} if history else problem, configuration)
    if problem.get("guided"):
        ops.fix(tip, 1, 0, 1)
    if "residual" in configuration:  # relative to the largest load
        size = max(map(abs, [*problem["force"], *problem["moment"]])) * max(problem["load_factors"])
        ops.test("NormUnbalance", configuration["residual"] * size, 12, 0)
    if "turn" in problem:
        _turn_the_clamp(problem["turn"], problem["load_factors"][-1])
    if not history:
        return _analyse(problem, configuration.get("substeps", 1), tip)
    times = [float(k) for k in range(len(history) + 1)]
    zero = [0.0] * 3
    for tag, vector, column in ((2, [*problem["force"], *zero], 0), (3, [*zero, *problem["moment"]], 1)):
        values = [0.0, *(stage[column] for stage in history)]
        ops.timeSeries("Path", tag, "-time", *times, "-values", *values)
        ops.pattern("Plain", tag, tag)
        ops.load(tip, *(vector if ops.getNDM()[0] == 3 else (vector[0], vector[1], vector[5])))
    reached, done = advance(0.0, len(history), 1.0 / configuration.get("substeps", 1), 1e-3)
    if not done:
        raise Stopped(f"no convergence in stage {reached:.4g} of {len(history)}")
    u = ops.nodeDisp(tip)
    return [(u[0], u[1], u[2] if ops.getNDM()[0] == 3 else 0.0)]


def _turn_the_clamp(vector, last):
    """The clamp's rotation grows with the load, about a fixed axis, up to the full one at the last load factor."""
    ops.wipeAnalysis()
    ops.timeSeries("Linear", 4, "-factor", 1 / last)
    ops.pattern("Plain", 4, 4)
    for axis, angle in zip((4, 5, 6), vector, strict=True):
        ops.remove("sp", 1, axis)
        ops.sp(1, axis, angle)
    ops.constraints("Transformation")
    ops.numberer("Plain")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", 1e-8, 30, 0)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")


if __name__ == "__main__":
    serve(prepare, {"openseespy": ops.version()})
