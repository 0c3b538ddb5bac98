"""Exudyn: geometrically exact and ANCF rods with its static Newton solver; see `speak` for requests and answers.

The sample is one call of SolveStatic from the unloaded state over all load factors; the model is built and assembled
before it. The solver halves steps that fail. The tolerance is on the increments (residualMode 1): a tolerance on the
residual is either too coarse or below its rounding error.

Measured on the column, what makes it fastest: loads by symbolic functions, which never call Python (a fifth of the time
on few elements); Eigen's dense factors up to a hundred unknowns (a third to a half), its sparse ones with their pattern
analysed once (a seventh) beyond. No faster or slower, or less accurate: modified Newton, tolerances on residuals or for
each coordinate, numerical derivatives, fixed steps, loads on coordinates, memory kept between calls, one thread.

The trials' problems may have a history of loads and a tip that is held ("guided"), their configurations a tolerance on
the norm of the residual, and "dense": the solver with dense factors, since EigenDense sees no singular matrix.
"""

import math

import exudyn as exu
import exudyn_motion
import numpy as np
from exudyn import itemInterface as item
from exudyn.advancedUtilities import CreateSymbolicUserFunction
from speak import Stopped, serve

DISPLACEMENT = exu.OutputVariableType.Displacement
#: Unknowns up to which dense factors are faster than sparse ones.
DENSE = 100
#: Nodes of an element. "EP": rotations by Euler parameters; the other spatial one has rotation vectors.
NODES = {"planar 3-node": 3, "planar ANCF cable": 2, "spatial 2-node": 2, "spatial 2-node EP": 2}


def prepare(problem, configuration):
    if "duration" in problem:
        return exudyn_motion.prepare(problem, configuration)
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    tip = _rod(mbs, problem, configuration)
    stages = [(0.0, 0.0), *(problem.get("history") or [(factor, factor) for factor in problem["load_factors"]])]
    kept, last = _load(mbs, problem, tip, stages), len(stages) - 1
    if problem.get("guided"):
        exudyn_motion.hold(mbs, tip, (0, 2, 4, 5, 6) if configuration["element"].endswith("EP") else (0, 2))
    sensor = mbs.AddSensor(item.SensorNode(nodeNumber=tip, storeInternal=True, outputVariableType=DISPLACEMENT))
    mbs.Assemble()
    dense = configuration.get("dense", "EigenDense")
    settings = _settings(configuration, last, "EigenSparse" if mbs.systemData.ODE2Size() > DENSE else dense)

    def solve():
        done = mbs.SolveStatic(settings, showHints=False, showCausingItems=False)
        rows = np.reshape(mbs.GetSensorStoredData(sensor), (-1, 4))
        at = np.searchsorted(rows[:, 0], np.arange(1, last + 1) - 1e-6)
        if not done or at[-1] >= len(rows):
            reached = np.interp(rows[-1, 0] if len(rows) else 0.0, range(last + 1), [force for force, _ in stages])
            raise Stopped(f"SolveStatic failed beyond the load factor {reached:.6g}")
        return rows[at, 1:4].tolist()

    solve.keep = container, kept
    return solve


def _load(mbs, problem, tip, stages):
    """A dead force and a dead moment on the tip's node, with a unit of time for each of the `stages`, the factors of
    both; returns what has to be kept."""
    point = mbs.AddMarker(item.MarkerNodePosition(nodeNumber=tip))
    loads = [mbs.AddLoad(item.LoadForceVector(markerNumber=point, loadVector=problem["force"]))]
    if any(problem["moment"]):
        section = mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=tip))
        loads.append(mbs.AddLoad(item.LoadTorqueVector(markerNumber=section, loadVector=problem["moment"])))
    kept = [_scaled(mbs, load, factors) for load, factors in zip(loads, zip(*stages, strict=True), strict=False)]
    for load, scaled in zip(loads, kept, strict=True):
        mbs.SetLoadParameter(load, "loadVectorUserFunction", scaled)
    return kept


def _scaled(mbs, load, factors):
    """Exudyn's user function of a load: `factors` at whole times, linear in between; the solver may stop there."""
    first, *steps = np.diff(factors).tolist()
    then = steps[-1] if steps else 0.0
    if np.allclose(steps, then):

        def loaded(mbs, time, vector):
            factor = first * time + (then - first) * exu.symbolic.max(time - 1, 0)
            return [factor * vector[0], factor * vector[1], factor * vector[2]]

        return CreateSymbolicUserFunction(mbs, loaded, "loadVectorUserFunction", load)
    return lambda mbs, time, vector: [float(np.interp(time, range(len(factors)), factors)) * x for x in vector]


def _settings(configuration, steps, solver):
    settings = exu.SimulationSettings()
    static = settings.staticSolver
    static.numberOfLoadSteps = steps * configuration.get("substeps", 1)
    static.loadStepDuration = steps
    static.newton.residualMode = 1
    static.newton.relativeTolerance = configuration["tol"]
    static.newton.absoluteTolerance = configuration["tol"]
    static.computeLoadsJacobian = configuration["element"].startswith("spatial")  # dead moments need it there
    static.verboseMode = 0
    if "residual" in configuration:  # its own default test
        newton = static.newton
        newton.residualMode, newton.relativeTolerance, newton.absoluteTolerance = 0, configuration["residual"], 1e-12
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = 1e-9
    settings.linearSolver.solverType = getattr(exu.LinearSolverType, solver)
    settings.linearSolver.reuseAnalyzedPattern = True
    return settings


def _rod(mbs, problem, configuration):
    """Nodes, elements and the clamp; returns the tip's node."""
    element, n = configuration["element"], configuration["elements"]
    per = NODES[element] - 1
    L, R = problem["length"], problem["radius"]
    nodes = []
    for i in range(per * n + 1):
        s = L * i / (per * n)
        angle = s / R if R else 0.0
        place = [R * math.sin(angle), R * (1 - math.cos(angle))] if R else [s, 0.0]
        nodes.append(mbs.AddNode(_node(element, place, angle)))
    stiff = {"bendingStiffness": problem["EI"], "axialStiffness": problem["EA"]}
    if element.startswith("spatial"):
        section = exu.BeamSection()
        section.stiffnessMatrix = np.diag(
            [problem["EA"], problem["GA"], problem["GA"], problem["GJ"], problem["EI"], problem["EI"]]
        )
        section.massPerLength, section.inertia = 1.0, np.eye(3)
    for i in range(n):
        ends = nodes[per * i : per * i + per + 1]
        if element.startswith("spatial"):
            mbs.AddObject(item.ObjectBeamGeometricallyExact(nodeNumbers=ends, length=L / n, sectionData=section))
        elif element == "planar ANCF cable":
            mbs.AddObject(item.ObjectANCFCable2D(nodeNumbers=ends, length=L / n, massPerLength=1.0, **stiff))
        else:
            mbs.AddObject(
                item.ObjectBeamGeometricallyExact2D(
                    nodeNumbers=ends, length=L / n, massPerLength=1.0, crossSectionInertia=1.0,
                    shearStiffness=problem["GA"], **stiff,
                )
            )  # fmt: skip
    held = {"planar ANCF cable": (0, 1, 3), "spatial 2-node": range(6), "spatial 2-node EP": (0, 1, 2, 4, 5, 6)}
    exudyn_motion.hold(mbs, nodes[0], held.get(element, range(3)))
    return nodes[-1]


def _node(element, place, angle):
    if element == "planar ANCF cable":
        return item.NodePoint2DSlope1(referenceCoordinates=[*place, math.cos(angle), math.sin(angle)])
    if element == "spatial 2-node":
        return item.NodeRigidBodyRotVecLG(referenceCoordinates=[*place, 0.0, 0.0, 0.0, angle])
    if element == "spatial 2-node EP":
        return item.NodeRigidBodyEP(
            referenceCoordinates=[*place, 0.0, math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)]
        )
    return item.NodeRigidBody2D(referenceCoordinates=[*place, angle])


if __name__ == "__main__":
    exu.config.suppressWarnings = True
    serve(prepare, {"exudyn": exu.GetVersionString().split()[0]})
