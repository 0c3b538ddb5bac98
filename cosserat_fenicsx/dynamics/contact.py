"""Contact of nodes with walls in a time step: set-valued friction, on the compliance of the moving rods.

Every Newton iteration has a tangent of the rods without contact, by whose inverse, the compliance, the nodes that may
touch respond linearly to their forces. With it the laws of all nodes are solved exactly (algebra/contact.c) before the
step is taken. So Newton's method sees smooth equations alone, whatever sticks, slips, touches or lifts off, and its
tangent stays valid. Along a rod, and one that is joined to its end, forces on one side of a node move the other side by
this node's motion alone, so that one matrix from node to node passes all of it on; what rods pass to each other
otherwise the next iteration corrects.
"""

from itertools import pairwise

import numpy as np

from cosserat_fenicsx.algebra.building import Pointers
from cosserat_fenicsx.numerics import lobatto_weights, small_rotations


class TouchingNodes:
    """Nodes of a `StepProblem` by their numbers (n,) in the scene; arrays over them are the same on all ranks."""

    def __init__(self, problem, slots):
        model, numbering = problem.model, problem.numbering
        self._comm, self.count = model.comm, len(slots)
        mine = model.slots[: model.owned_nodes]
        order = np.argsort(mine)
        found = np.minimum(np.searchsorted(mine, slots, sorter=order), max(len(mine) - 1, 0))
        local = order[found] if len(mine) else np.zeros(len(slots), dtype=int)
        #: which of the nodes this rank owns, and their local degrees of freedom
        self._here = np.flatnonzero(mine[local] == slots) if len(mine) else np.empty(0, dtype=int)
        self._dofs = model.nodal[local[self._here]]
        rows = np.zeros((self.count, 7), dtype=np.int64)
        rows[self._here] = numbering.rows[self._dofs]
        rows = self._sum(rows)
        again = (rows[1:] == rows[:-1]).all(axis=1) & (rows[1:] >= 0).any(axis=1)
        #: (n,) number of the point that a node is: those that follow each other may be the same, as of two walls
        self.points = np.concatenate([[0], np.cumsum(~again)])
        #: entries (of nodes and components) whose unknowns are in this rank's part of the solver's vector
        self._mine = np.nonzero((rows >= numbering.first) & (rows < numbering.first + numbering.size))
        self._rows = rows[self._mine] - numbering.first
        self._clamped = rows < 0
        self._shared = len(np.unique(self._rows)) < len(self._rows)
        self._problem, self._load, self._response = problem, numbering.vector(), numbering.vector()
        #: (n, 7) values where clamped, else zero; numbers in this rank's part of the solver's vector, or -1
        self.fixed = np.where(self._clamped, self.of_local(problem.state), 0.0)
        self.rows = np.full((self.count, 7), -1)
        self.rows[self._mine] = self._rows

    def _sum(self, values):
        return self._comm.allreduce(values) if self._comm.size > 1 else values

    def of_local(self, numbers):
        """(n, 7) values of local degrees of freedom at the nodes."""
        values = np.zeros((self.count, 7))
        values[self._here] = numbers[self._dofs]
        return self._sum(values)

    def of_vector(self, *vectors):
        """(n, 7) values at the nodes of a solver's vector, or of one minus another; zero where clamped."""
        values = np.zeros((self.count, 7))
        found = [vector[self._rows] for vector in vectors]
        values[self._mine] = found[0] if len(found) == 1 else found[0] - found[1]
        return self._sum(values)

    def unknowns(self, *vectors):
        """(n, 7) unknowns at the nodes, see `of_vector`."""
        return self.of_vector(*vectors) + self.fixed

    def subtract(self, forces, b):
        """Subtract forces and moments (n, 6) from this rank's part of a residual."""
        rows = np.zeros((self.count, 7))
        rows[:, :3], rows[:, 4:] = forces[:, :3], forces[:, 3:]
        if self._shared:
            np.subtract.at(b, self._rows, rows[self._mine])
        else:  # much faster
            b[self._rows] -= rows[self._mine]

    def response(self, forces):
        """Change of this rank's unknowns by forces and moments (n, 6), by the tangent; valid until the next call."""
        self._load.set(0.0)
        self.subtract(-forces, self._load.array_w)
        self._problem.solve(self._load, self._response)
        return self._response.array_r


def motion_between(before, after):
    """(n, 6) displacements and rotations from nodal unknowns (n, 7) to others, by the mean rotation: with them the work
    of a force and a moment in a step is exact."""
    change = after - before
    turned = small_rotations((before[:, 3:] + after[:, 3:]) / 2) @ change[:, 3:, None]
    return np.concatenate([change[:, :3], turned[..., 0]], axis=1)


# Number of nodes up to which one is loaded at a time to find the compliance; of more, how far those that are loaded
# together reach on each side.
_FEW, _NEIGHBOURS = 16, 10
# The compliance, which differs little from step to step, is updated where its relative error exceeds the second number
# and this many times its smallest error. Responses below the third number (dimensionless) may be rounding.
_WORSE, _MISSED, _ROUNDING = 10.0, 1e-3, 1e-9
# Sweeps over the nodes: largest number, and changes of the motion that end them, over the first one (of few nodes, and
# of many, which the next iteration corrects) and dimensionless.
_MOST, _SHARE, _OF_NEIGHBOURS, _SMALLEST = 200, 1e-6, 1e-4, 1e-16
# Numbers of positions and of nodes in C, see `contact`.
_OF_POSITIONS = {"motion": 6, "forces": 4, "late": 4, "walled": 11, "axes": 10}
_TRANSFERS = {"compliance": 4, "right": 6, "left": 6}
_INSIDE = "preceding", "following"  # by nodes inside an element
_OF_NODES = "clearance", "stiffness", "friction", "damping", "arm", "multiplier"


class NodalContact(Pointers):
    """Contact of nodes of a loaded `StepProblem` with walls; at_end: whether forces are those of a step's end."""

    def __init__(self, problem, walls, *, at_end):
        super().__init__()
        self._problem, model = problem, problem.model
        self._walls = touched = _places(model, walls)
        scales, slots = model.scales, np.concatenate([place.slots for place in touched])
        order = np.argsort(slots, kind="stable")
        self._nodes = nodes = TouchingNodes(problem, slots[order])
        self._slots = np.empty(len(order), dtype=int)  # of the walls' nodes in turn: their places here
        self._slots[order] = np.arange(len(order))
        self._ends = np.cumsum([len(place.slots) for place in touched])[:-1]
        self._slots_of_walls = np.split(self._slots.astype(np.int32), self._ends)
        self._origin = np.concatenate([np.tile(p.origin, (len(p.slots), 1)) for p in touched])[order]
        n, coupled = nodes.count, nodes.count - 1 if nodes.count <= _FEW else _NEIGHBOURS
        of, along = nodes.points, np.arange(n)  # nodes at the same point, as of two walls, count as one
        inner = np.concatenate([place.inner for place in touched])[order]
        ends = np.flatnonzero(np.diff(np.concatenate([[False], inner, [False]])))
        inside = int((ends[1::2] - ends[::2]).max(initial=0))  # nodes in a row, each as often as there are walls
        reach = int((np.searchsorted(of, of + coupled, side="right") - 1 - along).max())
        self._numbers = {name: np.zeros(n) for name in _OF_NODES}
        units = {"stiffness": scales.force / scales.length, "damping": model.time / scales.length}
        for name in ("stiffness", "damping"):
            self._numbers[name][:] = np.concatenate([getattr(p, name) for p in touched])[order] / units[name]
        sizes = {"tangent": 3, "across": 3, "start": 2, "moved": 6, "force": 6, "law": 3, "before": 7, "now": 7,
                 "free": 6, "last": 6}  # fmt: skip
        self._vectors = {name: np.zeros((n, size)) for name, size in sizes.items()}
        lanes = self._lib.LANES if n >= self._lib.LANES * (reach + 1) else 1  # their nodes must not move each other
        positions = -(-n // lanes)
        arrays = {name: np.zeros((positions, size, self._lib.LANES)) for name, size in _OF_POSITIONS.items()}
        # of half the numbers' accuracy: it guides iterations, and its reading takes most of their time
        self._transfers = {
            name: np.zeros((positions, size, 6, self._lib.LANES), dtype=np.float32)
            for name, size in {**_TRANSFERS, **dict.fromkeys(_INSIDE, 4 * inside)}.items()
        }
        self._weaker = np.concatenate([np.full((len(p.slots), 2), p.weaker) for p in touched])[order]
        self._weaker[:, 1] *= model.time / scales.length
        # speeds of slip in the last step, where they decide on friction
        self._weakens = bool((self._weaker[:, 0] != 1.0).any())
        self._slip, self._slip_begun = np.full(n, np.nan if self._weakens else 0.0), np.zeros(n)
        self._begun, self._law_begun = (self._vectors[name].copy() for name in ("force", "law"))
        self._at_start = self.doubles(self._law_begun)
        self.c = contact = self._ffi.new("contact *")
        contact.nodes, contact.reach, contact.at_end = n, reach, at_end
        contact.most, contact.share, contact.smallest = _MOST, _SHARE if n <= _FEW else _OF_NEIGHBOURS, _SMALLEST
        contact.worse, contact.least, contact.rounding = _WORSE, _MISSED, _ROUNDING
        contact.exact, contact.rows = n <= _FEW, self.integers(nodes.rows)
        contact.lanes, contact.positions = lanes, positions
        chain, many, size = problem.c.chain, self._lib.AT_ONCE, problem.numbering.size
        counts = {"load": size, "response": size}
        if not problem.c.interfaces:
            work = chain.elements * chain.wide + 2 * chain.room
            counts |= {"loads": many * size, "responded": many * size, "substituted": many * work}
        for name, array in self._transfers.items():
            setattr(contact, name, self._ffi.from_buffer("float[]", array))
        numbers = np.concatenate([np.full(len(place.slots), place.number) for place in touched])[order]
        contact.inside, contact.inner = inside, self.integers(inner)
        contact.parted = self.integers(_parted(model.scene, numbers))
        arrays |= {"passing": np.zeros((2, 6 + 4 * inside, self._lib.LANES)),
                   "responses": np.zeros((3, n, 2 * inside + 3, 6, 6))}  # fmt: skip
        arrays |= {"fixed": nodes.fixed, **{name: np.zeros(count) for name, count in counts.items()}}
        for name, array in {**self._numbers, **self._vectors, **arrays}.items():
            setattr(contact, name, self.doubles(array))
        contact.known_for, contact.stale, contact.usual, contact.missing = np.nan, True, np.inf, 1.0

    # -- a step ------------------------------------------------------------------------------------------------------

    def begin(self, h):
        """Begin a step of length h (dimensionless) at the problem's state."""
        self._vectors["before"][:] = now = self._nodes.of_local(self._problem.state)
        scales = self._problem.model.scales
        points = now[:, :3] * scales.length + self._origin
        vectors, numbers = self._vectors, self._numbers
        for place, at in zip(self._walls, self._slots_of_walls, strict=True):
            tube = place.wall.tube_around(place.s, here := points[at], place.md)
            place.md = tube.md
            away, tangent = (here - tube.position) / scales.length, np.ascontiguousarray(tube.tangent)
            buffers = (self._ffi.from_buffer("double[]", array) for array in (away, tangent))
            self._lib.begin_contact(self.c, self._ffi.from_buffer("int[]", at), len(at), *buffers)
            numbers["clearance"][at], numbers["arm"][at] = tube.clearance / scales.length, tube.arm / scales.length
            numbers["friction"][at] = tube.friction
        self.c.h = h
        self._lib.pack_contact(self.c)
        if self._weakens:
            self._weaken(h, now)
            self._lib.pack_contact(self.c)
        if not abs(h - self.c.known_for) <= 1e-9 * h:
            self.c.stale = True
        self._begun[:], self._law_begun[:] = vectors["force"], vectors["law"]

    def _weaken(self, h, now):
        """Take the coefficients of friction by the slip in the last step."""
        if np.isnan(self._slip).any():  # the first step
            velocity = self._nodes.of_local(self._problem.model.velocity.x.array)
            self._vectors["moved"][:] = h * np.concatenate(
                [velocity[:, :3], (small_rotations(now[:, 3:]) @ velocity[:, 3:, None])[..., 0]], axis=1
            )
            self.accept()
        self._slip_begun[:] = self._slip
        kinetic, speed = self._weaker.T
        self._numbers["friction"] *= kinetic + (1 - kinetic) * np.exp(-self._slip / speed)

    def give_up(self):
        """Undo a failed step: restore the forces at its start."""
        self._vectors["force"][:], self._vectors["law"][:] = self._begun, self._law_begun
        self._slip[:] = self._slip_begun

    @property
    def broken(self):
        """Whether the forces violate the laws of contact after the last iteration."""
        return bool(self._lib.broken(self.c))

    # -- books -------------------------------------------------------------------------------------------------------

    def accept(self):
        """Accept the step; its slip speeds give the coefficients of friction of the next one."""
        if self._weakens:
            self._lib.slips(self.c, self._ffi.from_buffer("double[]", self._slip))
            self._slip /= self.c.h

    def books(self):
        """Stored and dissipated energy of the step, dimensionless."""
        vectors = self._vectors
        gained = self._lib.gained(self.c)
        if self.c.at_end:
            return gained, self._lib.lost(self.c, self._at_start)
        return gained, -float(np.vdot(vectors["force"], vectors["moved"])) - gained

    @property
    def count(self):
        """Number of nodes that may touch, counted for each wall."""
        return self.c.nodes

    def of_step(self):
        """(count, 3) normal force, friction round and along the axis in the last step, wall by wall."""
        return self._vectors["law"][self._slots]

    def memory(self):
        kept = {name: self._vectors[name].copy() for name in ("force", "law")}
        md = np.concatenate([place.md for place in self._walls])
        kept |= {"md": md, "slip": self._slip.copy(), "across": self._vectors["across"].copy()}
        kept |= {name: array.copy() for name, array in self._transfers.items()}
        kept["multiplier"] = self._numbers["multiplier"].copy()
        return {**kept, "known_for": self.c.known_for, "usual": self.c.usual, "missing": self.c.missing,
                "stale": bool(self.c.stale)}  # fmt: skip

    def recall(self, memory):
        for name in ("force", "law"):
            self._vectors[name][:] = memory[name]
        self._vectors["across"][:], self._slip[:] = memory["across"], memory["slip"]
        for name, array in self._transfers.items():
            array[:] = memory[name]
        self._numbers["multiplier"][:] = memory["multiplier"]
        self.c.known_for, self.c.usual = float(memory["known_for"]), float(memory["usual"])
        self.c.missing, self.c.stale = float(memory["missing"]), bool(memory["stale"])
        for place, md in zip(self._walls, np.split(memory["md"], self._ends), strict=True):
            place.md = md


class _Place:
    """The nodes that may touch one wall along the rod of a number: numbers in the scene, whether they are inside an
    element, arc lengths (m), stiffness (N/m)."""

    def __init__(self, wall, number, slots, inner, s, lengths, origin):
        self.number, self.inner = number, inner
        self.wall, self.slots, self.s, self.origin = wall, slots, s, origin
        self.stiffness, self.damping = wall.stiffness * lengths, np.full(len(s), wall.damping)
        self.weaker = wall.kinetic, wall.speed
        self.md = s + wall.begins


def _places(model, walls):
    scene, layout, p = model.scene, model.layout, model.signature.degree
    first = np.concatenate([[0], np.cumsum(np.asarray(layout.counts) * p + 1)])
    along, found = layout.node_s(model.nodes), []
    for wall in walls:
        for i, rod in enumerate(scene.rods):
            here, at = np.arange(len(along[i])), along[i] * rod.length
            above, below = _shares(layout.breaks[i], model.nodes) * rod.length
            lengths = above + below
            if wall.station is not None:
                if wall.station.rod is not rod:
                    continue
                here, lengths = here[[layout.vertex(scene, wall.station)[1] * p]], np.ones(1)
            elif not wall.acts_on(rod):
                continue
            else:  # where the surface has a step, a node touches with the part that stands out
                beside = wall.beside(at)
                lengths = np.where(beside < at, above, np.where(beside > at, below, lengths))
                at = beside
            found.append(_Place(wall, i, first[i] + here, here % p > 0, at[here], lengths, scene.origin(rod)))
    return found


def _parted(scene, numbers):
    """(n,) of nodes on rods of these numbers: whether the next one is on a rod whose start is not joined to this rod's
    end, so that the motion of one does not tell that of the other."""
    joined = {
        (id(one.rod), id(other.rod))
        for joint in scene.joints
        for one, other in ((joint.first, joint.second), (joint.second, joint.first))
        if one.s == one.rod.length and other.s == 0.0
    }
    rods = [id(scene.rods[i]) for i in numbers]
    return np.array([a != b and (a, b) not in joined for a, b in pairwise(rods)] + [False])


def _shares(breaks, nodes):
    """(2, nodes) shares of a rod's length: of the elements that end at a node, and of the others."""
    sizes, p = np.diff(breaks), len(nodes) - 1
    weights, shares = sizes[:, None] * lobatto_weights(nodes), np.zeros((2, len(sizes) * p + 1))
    shares[0, p::p] = weights[:, -1]
    shares[1, :-1] = weights[:, :-1].ravel()
    return shares
