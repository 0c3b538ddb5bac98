"""Elimination along the rods, in C: the unknowns of elements in turn, the interface last.

The interface has the unknowns that cannot be eliminated along a rod: of nodes in constraint equations, of nodes where
rods meet other than end to start, and of nodes that several ranks share; and the multipliers. Every rank condenses its
segments of rods, and all ranks solve the whole interface, with the same numbers.
"""

import contextlib
import functools

import numpy as np

from cosserat_fenicsx.algebra import eigen
from cosserat_fenicsx.algebra.building import MANY_AT_REST, Pointers, module

#: Relative to the largest number in its column, smaller pivots are zero to rounding.
ZERO_PIVOT = 2e-15
#: Unknowns that an element may leave to the next one, where contact forces are unknowns: see `chain.c`.
_DELAYS = 3
# Numbers of a front that C takes together.
_BESIDE = 4


def _round_up(number):
    return -(-number // _BESIDE) * _BESIDE


class Elimination(Pointers):
    """The C structure `chain` for the elements of this rank.

    cell_dofs: (elements, width) local degrees of freedom in the order of the kernel; order: (elements,) in turn along
    the rods; tied: numbers of the unknowns in constraint equations, the same on all ranks; delays: whether some pivots
    may be zero; factors: whether they are kept, for solutions; without them only pivots can be counted. many: whether
    several elements are to be computed at once, which must be in turn. interface: (interfaces,) numbers of its
    unknowns; places: (entries,) rows and columns, in it, of the entries of all ranks' condensed matrices.
    """

    many = False

    def __init__(self, numbering, cell_dofs, order, tied, *, delays=False, factors=True):
        super().__init__()
        self.numbering = numbering
        rows = numbering.rows[cell_dofs][order].astype(np.int64)
        turn = np.repeat(np.arange(len(rows)), rows.shape[1])
        number, at, inverse = np.unique(rows.ravel(), return_index=True, return_inverse=True)
        first, last = turn[at], np.empty(len(number), dtype=turn.dtype)
        last[inverse] = turn  # the latest of equal numbers
        kept = self._kept(number, last - first > 1, tied)
        multipliers = numbering.first_multiplier + np.arange(numbering.multipliers)
        self.interface = np.concatenate([kept, multipliers])
        self._arrange(rows, number, inverse.reshape(rows.shape), first, last, np.isin(number, kept))
        self._allocate(order, rows.shape[1], _DELAYS if delays else 0, len(order) if factors else 2)

    def _kept(self, number, apart, tied):
        """Numbers of the nodes' unknowns on the interface, of all ranks."""
        numbering, comm = self.numbering, self.numbering.comm
        here = number[number >= 0]
        mine = (here >= numbering.first) & (here < numbering.first + numbering.size)
        needed = np.unique(np.concatenate([here[~mine], number[apart & (number >= 0)], tied[tied >= 0]]))
        return np.unique(np.concatenate(comm.allgather(needed))) if comm.size > 1 else needed

    def _arrange(self, rows, number, inverse, first, last, kept):
        """Sort every element's unknowns: shared with the one before, its own, shared with the next, the interface's."""
        turn = np.arange(len(rows))[:, None]
        kind = np.where(last[inverse] > turn, 2, 1)
        kind[first[inverse] < turn] = 0
        kind[kept[inverse]] = 3
        kind[rows < 0] = 4
        self._begins, self._ends = ~(kind == 0).any(axis=1), ~(kind == 2).any(axis=1)
        at_end = self._ends & ~self._begins  # there the interface's unknowns follow where the next element's would
        kind[(kind == 3) & at_end[:, None]] = 2
        order = np.lexsort((rows, kind), axis=1)
        rows, kind = np.take_along_axis(rows, order, 1), np.take_along_axis(kind, order, 1)
        new = np.ones(rows.shape, dtype=bool)  # the two ends of an element may share their unknowns
        new[:, 1:] = (rows[:, 1:] != rows[:, :-1]) | (kind[:, 1:] != kind[:, :-1])
        place = np.cumsum(new, axis=1) - 1
        place[kind == 4] = -1
        self._place = np.empty_like(place)
        np.put_along_axis(self._place, order, place, 1)
        self._shape = np.stack([(new & (kind == k)).sum(axis=1) for k in range(4)], axis=1)
        started = np.maximum.accumulate(np.where(self._begins, np.arange(len(rows)), 0))
        self._shape[:, 3] = self._shape[started, 3]
        room = self._shape.sum(axis=1).max(initial=1)
        self._rows = np.full((len(rows), room), -1)
        element, j = np.nonzero(new & (kind < 4))
        self._rows[element, place[element, j]] = rows[element, j]
        starts, before = self._shape[:, 3], self._shape[:, :3].sum(axis=1)
        later = np.flatnonzero((starts > 0) & ~self._begins)
        for t in later:
            s = started[t]
            self._rows[t, before[t] : before[t] + starts[t]] = self._rows[s, before[s] : before[s] + starts[t]]

    def _allocate(self, order, width, delays, fronts):
        ffi, numbering = self._ffi, self.numbering
        elements, room = len(order), self._rows.shape[1] + delays
        kept = self._shape[:, 2:].sum(axis=1) * self._ends
        slots = delays * (self._ends & (kept > 0))
        comm = numbering.comm
        before = np.cumsum([0, *comm.allgather(int(slots.sum()))])
        self.unknowns = len(self.interface)
        slot = self.unknowns + before[comm.rank] + np.cumsum(slots) - slots
        self.unknowns += int(before[-1])
        size = kept + slots
        block = np.where(self._ends & (size > 0), np.cumsum(size**2) - size**2, -1)
        ends = np.where(self._ends, np.where(slots > 0, slot, -2), -1)
        rows = np.full((elements, room), -1)
        place = np.searchsorted(self.interface, self._rows)
        on = np.isin(self._rows, self.interface)
        mine = self._rows - numbering.first
        rows[:, : self._rows.shape[1]] = np.where(self._rows < 0, -1, np.where(on, numbering.size + place, mine))
        self.condensed = np.zeros(int((size**2).sum()))
        self.diagonal = np.zeros(self.unknowns)
        self._find_places(np.flatnonzero(size), ends, rows, slots)
        self.c = chain = ffi.new("chain *")
        chain.elements, chain.width, chain.size = elements, width, numbering.size
        chain.zero_pivot = ZERO_PIVOT
        chain.room, chain.delays, chain.kept = room, delays, self.unknowns
        room_for = {"row": (fronts, room), "column": (fronts, room), "done": (fronts, 2)}
        self._factors = {name: np.zeros(shape, dtype=np.int32) for name, shape in room_for.items()}
        for name, array in (
            ("order", order), ("place", self._place), ("shape", self._shape), ("rows", rows), ("ends", ends),
            ("block", block), *self._factors.items(),
        ):  # fmt: skip
            setattr(chain, name, self.integers(array))
        chain.wide = wide = _round_up(room)
        start = self._starts(room, delays)
        chain.start = self.integers(start)
        self._factors["factor"] = np.zeros(int(start[-1]) * _BESIDE if fronts == elements else 0)
        self._factors["inverse"] = np.zeros((fronts, room))
        for name, array in (
            ("front", np.zeros((2, wide, wide))), ("factor", self._factors["factor"]),
            ("inverse", self._factors["inverse"]), ("forward", np.zeros((fronts, wide))), ("condensed", self.condensed),
            ("diagonal", self.diagonal), ("carry", np.zeros(room)), ("work", np.zeros(2 * room + _BESIDE)),
        ):  # fmt: skip
            setattr(chain, name, self.doubles(array))

    def _starts(self, room, delays):
        """(elements + 1,) where the factors of an element's front begin, over _BESIDE: see `keep_factors` in C."""
        n, k = self._shape.sum(axis=1) + delays, self._shape[:, :2].sum(axis=1) + delays
        column = np.arange(room + 1)
        before = np.cumsum([0, *(column + 1) // _BESIDE * _BESIDE])  # of columns of L, the numbers left out above
        above = np.cumsum([0, *_round_up(column)])
        size = k * _round_up(n) - before[k] + above[k] + (n - k) * _round_up(k)
        return np.cumsum([0, *size // _BESIDE])

    def _find_places(self, at, ends, rows, slots):
        numbering, first, kept = self.numbering, self._shape[at, :2].sum(axis=1), self._shape[at, 2:].sum(axis=1)
        slot, column = np.arange(slots.max(initial=0)), np.arange(rows.shape[1]) - first[:, None]
        places = np.hstack([ends[at, None] + slot, rows[at] - numbering.size])
        where = places[np.hstack([slot < slots[at, None], (column >= 0) & (column < kept[:, None])])]
        here = np.empty((2, len(self.condensed)), dtype=np.int32)
        sizes, where = self.integers(slots[at] + kept), self.integers(where)
        self._lib.spread(len(at), sizes, where, *(self._ffi.from_buffer("int[]", part) for part in here))
        comm = numbering.comm
        everywhere = comm.allgather(here) if comm.size > 1 else [here]
        self.places = np.concatenate(everywhere, axis=1) if comm.size > 1 else here
        self._counts = [part.shape[1] for part in everywhere]

    def all_condensed(self):
        """(entries,) the condensed matrices of all ranks, at `places`."""
        comm = self.numbering.comm
        if comm.size == 1:
            return self.condensed
        everything = np.empty(sum(self._counts))
        comm.Allgatherv(self.condensed, (everything, self._counts))
        return everything

    def memory(self):
        """Copies of the arrays of the factors."""
        return {name: array.copy() for name, array in self._factors.items()}

    def recall(self, memory):
        """Restore what `memory` returned."""
        for name, array in self._factors.items():
            array[:] = memory[name]

    def count(self, kernel):
        """Count the pivots of the symmetric sum of a kernel's elements, apart from the interface's: `c.negative`,
        `c.zero`; and sum the elements' diagonals there: `diagonal`."""
        self._lib.count(self.c, kernel.c)


# Pivots and eigenvalues of a matrix with a diagonal of ones that are zero to rounding. Those of slender rods with
# hinges may be almost as small.
_ROUNDING = 1e-15
# Largest number of unknowns of a system that is solved as a dense one.
_DENSE = 150


def condensed(model, numbering, cell_dofs, tied, **options):
    """The `Elimination` along a model's rods, and the `Interface` that it leaves, or None where it leaves nothing;
    tied: (tied nodes, block) numbers of the unknowns in constraint equations, -1 where clamped."""
    order = np.argsort(model.rods.cells[: len(cell_dofs)])
    elimination = Elimination(numbering, cell_dofs, order, tied.ravel(), **options)
    elimination.many = sum(model.signature.counts) >= MANY_AT_REST and bool((np.diff(order) == 1).all())
    if not elimination.unknowns and numbering.comm.size == 1:
        return elimination, None
    links = model.signature.connections
    equations = links.equations if numbering.multipliers else ()
    return elimination, Interface(elimination, tied, links.pattern, equations)


class Interface:
    """The system of the unknowns that `Elimination` leaves, with the constraint equations; tied: see `condensed`;
    pattern: the `TiePattern`; equations: indices of the ties whose multipliers belong to the system; nodes: places in
    it of the tied nodes' unknowns, -1 where clamped; dense: the C structure of a small system of one process, which C
    assembles and solves, else None."""

    def __init__(self, elimination, tied, pattern, equations=()):
        self._elimination, self._size = elimination, elimination.unknowns
        known = elimination.interface
        self.nodes = nodes = np.where(tied.ravel() >= 0, np.searchsorted(known, tied.ravel()), -1)
        of_nodes, ends, multipliers = pattern.places(nodes.reshape(tied.shape), np.array(equations, dtype=np.intp))
        multipliers = multipliers + (len(known) - len(equations))
        added = [np.stack(pair) for pair in ((ends, multipliers), (multipliers, ends))]
        rows, columns = np.concatenate([elimination.places, of_nodes, *added], axis=1)
        self._here = (rows >= 0) & (columns >= 0)
        self._everywhere = bool(self._here.all())
        self._solver = _Dense(self._size) if self._size <= _DENSE else _Sparse(self._size)
        own = slice(None) if self._everywhere else self._here  # a view where it serves: these are long
        self._entry = self._solver.entries(rows[own], columns[own])
        self.dense = None
        if self._size <= _DENSE and elimination.numbering.comm.size == 1:
            every = np.full(len(rows), -1)
            every[self._here] = self._entry
            self.dense = self._solver.adds(every, len(elimination.condensed))

    def _values(self, of_nodes, *others):
        """The entries of all ranks' condensed matrices and of the constraint equations' derivatives."""
        parts = [x for x in (self._elimination.all_condensed(), *map(np.ravel, (of_nodes, *others))) if len(x)]
        values = parts[0] if len(parts) == 1 else np.concatenate(parts) if parts else np.empty(0)
        if not self._everywhere:
            values = values[self._here[: len(values)]]
        return np.bincount(self._entry[: len(values)], values, minlength=self._solver.room)

    def factor(self, *derivatives):
        """Factors of the system, see `_values`; False where it is singular."""
        return self._solver.factor(self._values(*derivatives), self._elimination.c.zero_pivot)

    def begin_with(self, other, maps, count):
        """Let solutions begin with the factors of another interface, which counts signs (count: at the state); only
        where both have the same nodes and no constraint equations; maps: see `RodModel.small_motion_maps`."""
        ours, theirs = (x._elimination.numbering.block for x in (self, other))
        known = [x._elimination.interface // x._elimination.numbering.block for x in (self, other)]
        alike = len(known[0]) * theirs == len(known[1]) * ours and np.array_equal(known[0][::ours], known[1][::theirs])
        large = isinstance(self._solver, _Sparse) and isinstance(other._solver, _Sparse)
        if alike and large and self._size == len(known[0]) and not len(self.nodes):
            self._solver.near = _Near(self._solver, other._solver, ours, maps, count)

    @property
    def inertia(self):
        """The `RepeatedInertia` of a large system whose signs were counted, else None."""
        return vars(self._solver).get("_symmetric")

    def memory(self):
        """The entries of the last matrix."""
        return self._solver.kept.copy()

    def recall(self, memory):
        """Factorise the matrix whose entries `memory` returned."""
        self._solver.factor(np.array(memory), self._elimination.c.zero_pivot)

    def solve(self, b):
        """Replace a right-hand side (unknowns,) by the solution, from the last factors."""
        self._solver.solve(b)

    @contextlib.contextmanager
    def corrected(self):
        """Context manager: solutions of large systems are less exact, as Newton's method corrects what they leave."""
        self._solver.corrected = True
        try:
            yield
        finally:
            self._solver.corrected = False

    def signs(self, of_nodes):
        """(negative, zero) numbers of eigenvalues of the system, which is symmetric, and the logarithm of the product
        of the absolute values of those that are not zero (of large systems NaN where some are)."""
        return self._solver.signs(self._values(of_nodes))


class _Dense(Pointers):
    """A system as a dense matrix, row by row; kept: (size * size,) the last one."""

    def __init__(self, size):
        super().__init__()
        self._size, self.room = size, size * size
        self.c, self.kept = self._ffi.new("dense *"), np.zeros(size * size)
        self.c.size, self.c.matrix = size, self.doubles(self.kept)
        for name, count in (("factors", size * _round_up(size)), ("scale", size), ("work", 2 * size + _BESIDE)):
            setattr(self.c, name, self.doubles(np.zeros(count)))
        self.c.row, self.c.column = (self.integers(np.zeros(size, dtype=np.int32)) for _ in range(2))

    def adds(self, entry, condensed):
        """The C structure, which adds to these entries of the matrix, -1 for none; condensed: how many of segments."""
        self.c.entry, self.c.entries, self.c.condensed = self.integers(entry), len(entry), condensed
        return self.c

    def entries(self, rows, columns):
        return rows * self._size + columns

    def factor(self, values, zero):
        self.kept[:] = values
        return not self._lib.factor_matrix(self.c, zero)

    def solve(self, b):
        self._lib.solve_matrix(self.c, self._ffi.from_buffer("double[]", b))

    def signs(self, values):
        self.kept[:] = values
        logarithm = self._ffi.new("double *")
        if self._lib.is_positive(self.c, logarithm):
            return 0, 0, logarithm[0]
        matrix = values.reshape(self._size, self._size)
        scale = _scale(np.diag(matrix))
        matrix = scale[:, None] * matrix * scale
        values = np.linalg.eigvalsh(matrix)
        zero = np.abs(values) <= _ROUNDING
        logarithm = float(np.log(np.abs(values[~zero])).sum()) - 2 * float(np.log(scale).sum())
        return int((values[~zero] < 0).sum()), int(zero.sum()), logarithm


class _Near:
    """Nearly the inverse of a `_Sparse` system: that of the second variation; see `Interface.begin_with`."""

    def __init__(self, system, variation, block, maps, count):
        self._variation, self._maps, self._block, self._count = variation, maps, block, count
        self._own, self._left = system.diagonal_blocks(block), 0

    def leave(self):
        """Leave it aside until signs are counted again."""
        self._left = self._variation.counts

    def take(self, values):
        """Take the entries of the system; False where there are no factors that serve."""
        if not self._variation.counts:
            self._count()
        if self._variation.inverse is None or self._variation.counts == self._left:
            return False
        self._of_rows, self._of_motion, self._rest = self._maps(values[self._own])
        return True

    def apply(self, pc, b, x):
        """PETSc calls this as a preconditioner."""
        rows = b.array_r.reshape(-1, self._block, 1)
        motion = self._variation.inverse((self._of_rows @ rows).ravel())
        x.array_w[:] = (self._of_motion @ motion.reshape(len(rows), -1, 1) + self._rest @ rows).ravel()


class _Sparse:
    """A system by its rows, with factors by MUMPS; near: a `_Near` or None; corrected: see `Interface.corrected`."""

    near, corrected = None, False

    def __init__(self, size):
        self._size = size

    def diagonal_blocks(self, block):
        """(nodes, block, block) which entries the blocks of the diagonal are."""
        rows = np.arange(self._size).reshape(-1, block)
        keys = np.repeat(np.arange(self._size), np.diff(self._starts)) * self._size + self._columns
        return np.searchsorted(keys, rows[:, :, None] * self._size + rows[:, None, :])

    def entries(self, rows, columns):
        """Where the entries at rows and columns are added."""
        each = np.arange(self._size)  # a diagonal of zeros is part of the pattern
        rows, columns = (np.append(x, each).astype(np.int32) for x in (rows, columns))
        self._starts, found = np.empty(self._size + 1, dtype=np.int32), np.empty((3, len(rows)), dtype=np.int32)
        ffi, lib = module()
        arrays = (ffi.from_buffer("int[]", x) for x in (rows, columns, self._starts, *found))
        self.room = lib.number_entries(self._size, len(rows), *arrays)
        self._columns = found[0, : self.room].copy()
        return found[1, : len(rows) - self._size].astype(np.intp)  # as `bincount` takes them

    @functools.cached_property
    def _factors(self):
        """Made when they are first asked for: many systems only count signs."""
        return eigen.RepeatedFactors(self._starts, self._columns, self.near)

    def factor(self, values, zero):
        self.kept = values
        return bool(np.isfinite(values).all()) and self._factors.factor(values)

    def solve(self, b):
        b[:] = self._factors.solve(b, self.corrected)

    @functools.cached_property
    def _symmetric(self):
        return eigen.inertia_of(self._starts, self._columns, _ROUNDING)

    @property
    def counts(self):
        """How often signs were counted, of this system or one that shares the factors."""
        return self._symmetric.counts

    @property
    def inverse(self):
        """(unknowns,) -> (unknowns,): the inverse of the last matrix whose signs were counted; None where singular."""
        return self._symmetric.solve if self._symmetric.regular else None

    def signs(self, values):
        rows = np.repeat(np.arange(self._size), np.diff(self._starts))
        scale = _scale(values[rows == self._columns])
        negative, zero, logarithm = self._symmetric.of(values * scale[rows] * scale[self._columns], scale)
        return negative, zero, logarithm - 2 * float(np.log(scale).sum())


def _scale(diagonal):
    """Factors that scale the diagonal to ones and keep the signs, for any units of the unknowns."""
    size = np.sqrt(np.abs(diagonal))
    return 1 / np.where(size > 0, size, 1.0)
