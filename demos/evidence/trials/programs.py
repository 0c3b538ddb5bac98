"""The peers of `demos/evidence/peers`, each in a separate process; cells of peers that are not installed say so."""

import math

import numpy as np
from peers.environments import Missing
from peers.process import Peer
from scipy.spatial.transform import Rotation

from trials import problems
from trials.cells import Answer, Method, NotForIt, NotInstalled, Stopped, load_factor_in
from trials.chains import NEXT_TO_INFINITE

LIMIT = 16.0  # time limit of an answer, s, unless a program has another


class Program(Method):
    """See `cells.Method`. Its process starts at the first request; planar, spatial: configurations for plane rods and
    for others; coarse: few elements; limit: of an answer, s.

    can: features of its runner: "history", "guided", "residual", "turned clamp"; "free": stiffnesses need not be those
    of a rectangle; "relaxes": it answers at the last load factor only; "arcs in space": its planar element is straight.
    """

    def __init__(self, key, planar, spatial, coarse, can=(), what="", limit=LIMIT):
        self.key, self.title = key, f"{key}"
        self._planar, self._spatial, self._coarse, self._can = planar, spatial, coarse, can
        self.what, self._limit = f"{what}; {limit:g} s for an answer", limit
        self._peer, self.versions = None, ""

    @property
    def turn(self):
        return (0.8, -0.6, 0.88) if "turned clamp" in self._can else (0.7, 0.0, 0.0)

    def process(self):
        """Its process, or NotInstalled."""
        if self._peer is None:
            try:
                self._peer = Peer(self.key, install=False)
            except Missing as why:
                raise NotInstalled(str(why)) from None
        return self._peer

    def end(self):
        """End its process."""
        if self._peer is not None:
            self._peer.end()
            self._peer = None

    def solve(self, problem, jump=False, **more):
        """An `Answer`."""
        for need in {"history", "guided", "follower"} & set(problem):
            if need not in self._can:
                raise NotForIt({"history": "its runner loads in proportion",
                                "guided": "its runner clamps one end alone",
                                "follower": "its runner has dead loads"}[need])  # fmt: skip
        plain = "turn" not in problem
        problem = _as_it_takes(problem, "free" in self._can, "turned clamp" in self._can)
        curved = problem["radius"] and "arcs in space" in self._can
        plane = problems.in_a_plane(problem) and plain and not curved
        configuration = {**(self._planar if plane else self._spatial), **more}
        if problem.pop("coarse", False):
            configuration["elements"] = self._coarse
        configuration["elements"] *= problem.pop("finer", 1)
        if "relaxes" in self._can:  # it is a motion to the final equilibrium, without intermediate equilibria
            problem["load_factors"] = problem["load_factors"][-1:]
        if "substeps" in configuration:
            few = len(problem["load_factors"]) < 8 or "history" in problem
            configuration["substeps"] = configuration["substeps"] if few and not jump else 1
        reply = self.process().ask(problem, configuration, warm=0, samples=1, limit=self._limit)
        told = reply.get("versions", {})
        self.versions = next(
            (release for name, release in told.items() if name not in ("python", "numpy")), self.versions
        )
        if "failed" in reply:
            raise Stopped(reply["failed"], load_factor_in(reply["failed"]))
        tip = np.array(reply["tip"], dtype=float)
        elements = f"{configuration['element']}, {configuration['elements']} elements"
        return Answer(tip, "", elements)

    def numerics(self, key):
        if key != "residual":
            return super().numerics(key)
        if "residual" not in self._can:
            raise NotForIt("its runner's test is its own")
        problem = problems.column([0.3, 0.6, 0.9], 1e3)
        answer = self.solve(problem, residual=1e-6)
        best = self.solve(problem)
        ratio = problems.column_truth(problem)[:, 1] / best.tip[:, 1]
        found = Answer(answer.tip * [[1, r, 1] for r in ratio], "", "against the same mesh, stopped on the increment")
        return problem, found, None, ""


def _as_it_takes(problem, free, turns_clamp):
    """The problem in numbers that a program supports; where no clamp turns, with the loads turned about the axis."""
    found = {**problem}
    for key in ("EA", "GA"):
        if math.isinf(found[key]):
            if not free:
                raise NotForIt("stiffness comes from its solid section")
            found[key] = NEXT_TO_INFINITE * found["EI"] / found["length"] ** 2
    if not free and found["GJ"] < 0.5 * found["EI"]:
        raise NotForIt("stiffness comes from its solid section")
    turn = found.get("turn")
    if turn is not None:
        Q = Rotation.from_rotvec(turn).as_matrix()
        found |= {key: (Q @ found[key]).tolist() for key in ("force", "moment")}
        if not turns_clamp:
            del found["turn"]
    return found


PROGRAMS = (
    Program("Exudyn", {"element": "planar 3-node", "elements": 32, "tol": 1e-8, "substeps": 4, "dense": "EXUdense"},
            {"element": "spatial 2-node EP", "elements": 32, "tol": 1e-8, "substeps": 4, "dense": "EXUdense"}, 8,
            ("free", "history", "guided", "residual", "arcs in space"),
            "Exudyn 1.13.6, geometrically exact rods: 3-node in a plane, 2-node with Euler parameters in space"),
    Program("OpenSeesPy", {"element": "planar CBDI", "elements": 48, "tol": 1e-6, "substeps": 4, "inner": 1e-16},
            {"element": "spatial CBDI", "elements": 48, "tol": 1e-8, "substeps": 4, "inner": 1e-16}, 8,
            ("free", "history", "guided", "residual", "turned clamp"),
            "OpenSeesPy 3.7.1.2, force-based frames with curvature-based displacements, co-rotational"),
    Program("PyElastica", {"element": "spatial rod", "elements": 20, "tol": 1e-6},
            {"element": "spatial rod", "elements": 20, "tol": 1e-6}, 8,
            ("free", "relaxes"), "PyElastica 1.0.0, an explicit dynamic rod under the whole load, damped until it "
                                 "rests; 20 elements, 0.35 % of error at "
            "eta = 1 (12 have 1.06 %): more than the time allows for thinner rods", 25.0),
    Program("CalculiX", {"element": "spatial B32R", "elements": 32, "tol": 1e-5},
            {"element": "spatial B32R", "elements": 32, "tol": 1e-5}, 8,
            (), "CalculiX 2.20, quadratic beams that become solids (B32R)"),
)  # fmt: skip
