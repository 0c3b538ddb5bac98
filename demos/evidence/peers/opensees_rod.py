"""OpenSeesPy: corotational frames in a plane or in space, Newton with load control; see `speak` for requests and
answers.

Elements: "elastic" is elasticBeamColumn, of second order; "CBDI" is forceBeamColumnCBDI, whose curvature-based
displacements carry the force's moment inside the element: of high order. A step that fails is halved.
The sample is the analysis over all load factors. The model is built again for each sample, which is not counted, since
`reset` does not restore its spatial corotational transformation.
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
    ops.load(n + 1, *((fx, fy, fz, mx, my, mz) if spatial else (fx, fy, mz)))
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", configuration["tol"], 12, 0)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    return n + 1


def prepare(problem, configuration):
    def solve():
        tip = _build(problem, configuration)
        began = time.process_time()
        tips = _analyse(problem, configuration.get("substeps", 1), tip)
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


def _analyse(problem, substeps, tip):
    tips, reached = [], 0.0
    for factor in problem["load_factors"]:
        reached, done = advance(reached, factor, (factor - reached) / substeps, 1e-3 * factor)
        if not done:
            raise Stopped(f"no convergence beyond the load factor {reached:g}")
        u = ops.nodeDisp(tip)
        tips.append((u[0], u[1], u[2] if ops.getNDM()[0] == 3 else 0.0))
    return tips


if __name__ == "__main__":
    serve(prepare, {"openseespy": ops.version()})
