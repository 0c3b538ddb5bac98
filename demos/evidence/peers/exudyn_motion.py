"""Exudyn's motions: geometrically exact rods of two nodes in space under generalised alpha.

The sample is one call of SolveDynamic from rest; the model is built and assembled before it. Rods are connected by a
joint of two nodes, since a node's frame is that of its section at rest.
"""

from itertools import pairwise

import exudyn as exu
import numpy as np
from exudyn import itemInterface as item
from exudyn.rigidBodyUtilities import RotationMatrix2EulerParameters, RotationMatrix2RotationVector
from speak import Stopped

POSITION = exu.OutputVariableType.Position
SHORTEST = 1e-4  # s: below, a step that fails would be halved for minutes


def prepare(problem, configuration):
    """See `speak.serve`."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    rods = [_rod(mbs, problem, configuration, line) for line in problem["lines"]]
    for (nodes, frame), (others, other_frame) in pairwise(rods):
        ends = [mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=n)) for n in (nodes[-1], others[0])]
        turned = {"rotationMarker0": frame.T, "rotationMarker1": other_frame.T}
        mbs.AddObject(item.ObjectJointGeneric(markerNumbers=ends, constrainedAxes=[1] * 6, **turned))
    ends = {"start": rods[0][0][0], "end": rods[0][0][-1]}
    _load(mbs, problem, ends[problem["loaded"]])
    if problem["clamped"]:
        # the scalar Euler parameter has its own equation
        hold(mbs, ends["start"], range(6) if configuration["node"] == "LG" else (0, 1, 2, 4, 5, 6))
    mbs.Assemble()
    settings = _settings(configuration, problem["duration"])
    watched = {"start": rods[0][0][0], "end": rods[-1][0][-1]}

    def move():
        if not mbs.SolveDynamic(settings, showHints=False, showCausingItems=False):
            raise Stopped("SolveDynamic failed")
        return [list(mbs.GetNodeOutput(watched[name], POSITION)) for name in problem["watched"]]

    move.keep = container
    return move


def _settings(configuration, duration):
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps = round(duration / configuration["dt"])
    integration.endTime = duration
    integration.minimumStepSize = SHORTEST
    integration.newton.useModifiedNewton = True
    integration.newton.relativeTolerance = integration.newton.absoluteTolerance = configuration["tol"]
    integration.verboseMode = 0
    settings.solution.file.write = False
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    return settings


def _rod(mbs, problem, configuration, line):
    """Nodes and elements along a line; returns the nodes and the frame (axis first)."""
    n, (start, end) = configuration["elements"], np.array(line)
    along = end - start
    length = float(np.linalg.norm(along))
    across = np.array([0.0, 0.0, 1.0])  # every line is level
    frame = np.column_stack([along / length, np.cross(across, along / length), across])
    if configuration["node"] == "LG":
        make, turned = item.NodeRigidBodyRotVecLG, RotationMatrix2RotationVector(frame)
    else:
        make, turned = item.NodeRigidBodyEP, RotationMatrix2EulerParameters(frame)
    nodes = [mbs.AddNode(make(referenceCoordinates=[*(start + along * i / n), *turned])) for i in range(n + 1)]
    section, (J1, J2, J3) = exu.BeamSection(), problem["inertia"]
    EA, GA, EI, GJ = (problem[key] for key in ("EA", "GA", "EI", "GJ"))
    section.stiffnessMatrix = np.diag([EA, GA, GA, GJ, EI, EI])
    section.massPerLength, section.inertia = problem["mass"], np.diag([J3, J1, J2])
    for i in range(n):
        pair = nodes[i : i + 2]
        mbs.AddObject(item.ObjectBeamGeometricallyExact(nodeNumbers=pair, length=length / n, sectionData=section))
    return nodes, frame


def _load(mbs, problem, node):
    first, peak, last = problem["rise"]

    def share(t):
        return max(0.0, min((t - first) / (peak - first), (last - t) / (last - peak)))

    def scaled(mbs, time, vector):
        now = share(time)
        return [now * vector[0], now * vector[1], now * vector[2]]

    marker = mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=node))
    for load, key in ((item.LoadForceVector, "force"), (item.LoadTorqueVector, "moment")):
        if any(problem[key]):
            mbs.AddLoad(load(markerNumber=marker, loadVector=problem[key], loadVectorUserFunction=scaled))


def hold(mbs, node, coordinates):
    """Hold coordinates of a node at 0."""
    ground = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(item.NodePointGround()), coordinate=0))
    for coordinate in coordinates:
        held = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
        mbs.AddObject(item.ObjectConnectorCoordinate(markerNumbers=[ground, held]))
