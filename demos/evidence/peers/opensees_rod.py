"""OpenSeesPy: corotational frames in a plane or in space, Newton with load control; see `speak` for requests and
answers.

Elements: "elastic" is elasticBeamColumn, of second order; "CBDI" is forceBeamColumnCBDI, whose curvature-based
displacements carry the force's moment inside the element: of high order. A step that fails is halved.
The sample is the analysis over all load factors. The model is built again for each sample, which is not counted, since
`reset` does not restore its spatial corotational transformation.

The trials' problems may have a history of loads, a tip that is held ("guided") and a clamp that turns, and their
configurations a tolerance on the norm of the residual.
"""

import math
import time

import openseespy.opensees as ops
from speak import Stopped, serve


def _build(problem, configuration):
    n, spatial = configuration["elements"], configuration["element"].startswith("spatial")
    kind = configuration["element"].split()[1]
    L, R = problem["length"], problem["radius"]
    ops.wipe()
    ops.model("basic", "-ndm", 3 if spatial else 2, "-ndf", 6 if spatial else 3)
    for i in range(n + 1):
        s = L * i / n
        x, y = (R * math.sin(s / R), R * (1 - math.cos(s / R))) if R else (s, 0.0)
        ops.node(i + 1, *((x, y, 0.0) if spatial else (x, y)))
    ops.fix(1, *([1] * (6 if spatial else 3)))
    ops.geomTransf("Corotational", 1, *((0, 0, 1) if spatial else ()))
    E, EI = 1.0, problem["EI"]
    section = (problem["EA"], E, EI) if not spatial else (problem["EA"], E, E, problem["GJ"], EI, EI)
    if kind == "CBDI":
        numbers = (E, problem["EA"], EI) if not spatial else (E, problem["EA"], EI, EI, E, problem["GJ"])
        ops.section("Elastic", 1, *numbers)
        ops.beamIntegration("Legendre", 1, 1, 2)  # more points were slower and less accurate
    for i in range(1, n + 1):
        if kind == "elastic":
            ops.element("elasticBeamColumn", i, i, i + 1, *section, 1)
        else:
            inner = ("-iter", 10, configuration["inner"]) if "inner" in configuration else ()
            ops.element("forceBeamColumnCBDI", i, i, i + 1, 1, 1, *inner)
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    (fx, fy, fz), (mx, my, mz) = problem["force"], problem["moment"]
    if "history" not in problem:
        ops.load(n + 1, *((fx, fy, fz, mx, my, mz) if spatial else (fx, fy, mz)))
    if problem.get("guided"):
        ops.fix(n + 1, 1, 0, 1)
    _set_analysis("Plain", "NormDispIncr", configuration["tol"], 12)
    if "residual" in configuration:  # relative to the largest load
        size = max(map(abs, [*problem["force"], *problem["moment"]])) * max(problem["load_factors"])
        ops.test("NormUnbalance", configuration["residual"] * size, 12, 0)
    if "turn" in problem:
        _turn_the_clamp(problem["turn"], problem["load_factors"][-1])
    return n + 1


def _set_analysis(constraints, test, tol, most):
    """Newton's method under load control, with a test and at most so many iterations."""
    ops.constraints(constraints)
    ops.numberer("Plain")
    ops.system("BandGeneral")
    ops.test(test, tol, most, 0)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")


def _turn_the_clamp(vector, last):
    """The clamp's rotation grows with the load, about a fixed axis, up to the full one at the last load factor."""
    ops.wipeAnalysis()
    ops.timeSeries("Linear", 4, "-factor", 1 / last)
    ops.pattern("Plain", 4, 4)
    for axis, angle in zip((4, 5, 6), vector, strict=True):
        ops.remove("sp", 1, axis)
        ops.sp(1, axis, angle)
    _set_analysis("Transformation", "NormDispIncr", 1e-8, 30)


def prepare(problem, configuration):
    def solve():
        tip = _build(problem, configuration)
        began = time.process_time()
        analyse = _in_stages if "history" in problem else _analyse
        tips = analyse(problem, configuration.get("substeps", 1), tip)
        return tips, time.process_time() - began

    return solve


def advance(reached, target, step, smallest):
    """Load steps from `reached` to `target`, halved where they fail; (the load reached, whether it is the target)."""
    while reached < target - 1e-12:
        step = min(step, target - reached)
        ops.integrator("LoadControl", step)
        if ops.analyze(1) == 0:
            reached += step
        elif step > smallest:
            step /= 2  # the failed step was undone
        else:
            return reached, False
    return reached, True


def _moved(tip):
    u = ops.nodeDisp(tip)
    return u[0], u[1], u[2] if ops.getNDM()[0] == 3 else 0.0


def _analyse(problem, substeps, tip):
    tips, reached = [], 0.0
    for factor in problem["load_factors"]:
        reached, done = advance(reached, factor, (factor - reached) / substeps, 1e-3 * factor)
        if not done:
            raise Stopped(f"no convergence beyond the load factor {reached:g}")
        tips.append(_moved(tip))
    return tips


def _in_stages(problem, substeps, tip):
    """The displacement at the end of a history of force and moment."""
    history, zero = problem["history"], [0.0] * 3
    times = [float(k) for k in range(len(history) + 1)]
    for tag, vector, column in ((2, [*problem["force"], *zero], 0), (3, [*zero, *problem["moment"]], 1)):
        values = [0.0, *(stage[column] for stage in history)]
        ops.timeSeries("Path", tag, "-time", *times, "-values", *values)
        ops.pattern("Plain", tag, tag)
        ops.load(tip, *(vector if ops.getNDM()[0] == 3 else (vector[0], vector[1], vector[5])))
    reached, done = advance(0.0, len(history), 1.0 / substeps, 1e-3)
    if not done:
        raise Stopped(f"no convergence in stage {reached:.4g} of {len(history)}")
    return [_moved(tip)]


if __name__ == "__main__":
    serve(prepare, {"openseespy": ops.version()})
