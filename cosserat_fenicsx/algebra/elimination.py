"""Elimination along the rods, in C: the unknowns of elements in turn, those of the interface last.

The interface has the unknowns that cannot be eliminated along a rod: of nodes in constraint equations, of nodes where
rods meet other than end to start, and of nodes that several ranks share; and the multipliers. Every rank condenses its
segments of rods, and all ranks solve the whole interface, with the same numbers.
"""

import numpy as np

from cosserat_fenicsx.algebra.pointers import Pointers

#: Relative to the largest number in its column, smaller pivots are zero to rounding.
ZERO_PIVOT = 2e-15
#: Unknowns that an element may leave to the next one, where contact forces are unknowns: see `chain.c`.
_DELAYS = 3


class Elimination(Pointers):
    """The C structure `chain` for the elements of this rank.

    Args:
        numbering: the `Numbering` of the unknowns.
        cell_dofs: (elements, width) local degrees of freedom in the order of the kernel.
        order: (elements,) this rank's elements in turn along the rods.
        tied: numbers of the unknowns in constraint equations; the same on all ranks.
        delays: whether some pivots may be zero.
        factors: whether factors are kept, for solutions; without them only pivots can be counted.

    Attributes:
        interface: (interfaces,) numbers of its unknowns; the same on all ranks.
        places: (entries,) rows and columns, in the interface, of the entries of all ranks' condensed matrices.
    """

    def __init__(self, numbering, cell_dofs, order, tied, *, delays=False, factors=True):
        super().__init__()
        self.numbering = numbering
        rows = numbering.rows[cell_dofs][order].astype(np.int64)
        turn = np.repeat(np.arange(len(rows)), rows.shape[1])
        number, inverse = np.unique(rows.ravel(), return_inverse=True)
        first, last = np.full(len(number), len(rows)), np.full(len(number), -1)
        np.minimum.at(first, inverse, turn)
        np.maximum.at(last, inverse, turn)
        kept = self._kept(number, last - first > 1, tied)
        multipliers = numbering.first_multiplier + np.arange(numbering.multipliers)
        self.interface = np.concatenate([kept, multipliers])
        self._arrange(rows, number, inverse.reshape(rows.shape), first, last, np.isin(number, kept))
        self._allocate(order, rows.shape[1], _DELAYS if delays else 0, len(order) if factors else 2)

    def _kept(self, number, apart, tied):
        """The numbers of the nodes' unknowns on the interface, those of all ranks."""
        numbering, comm = self.numbering, self.numbering.comm
        here = number[number >= 0]
        mine = (here >= numbering.first) & (here < numbering.first + numbering.size)
        needed = np.unique(np.concatenate([here[~mine], number[apart & (number >= 0)], tied[tied >= 0]]))
        return np.unique(np.concatenate(comm.allgather(needed))) if comm.size > 1 else needed

    def _arrange(self, rows, number, inverse, first, last, kept):
        """Sort the unknowns of every element: those shared with the element before, its own, those shared with the
        next, and those of the interface."""
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
        self._factors["front"] = np.zeros((fronts, room, room))
        for name, array in (
            ("front", self._factors["front"]), ("forward", np.zeros((fronts, room))), ("condensed", self.condensed),
            ("diagonal", self.diagonal), ("carry", np.zeros(room)), ("work", np.zeros(room)),
        ):  # fmt: skip
            setattr(chain, name, self.doubles(array))

    def _find_places(self, at, ends, rows, slots):
        numbering, places = self.numbering, []
        for t in at:
            first = self._shape[t, :2].sum()
            kept = rows[t, first : first + self._shape[t, 2:].sum()] - numbering.size
            where = np.concatenate([ends[t] + np.arange(slots[t]), kept]).astype(np.int64)
            places.append(np.stack([np.repeat(where, len(where)), np.tile(where, len(where))]))
        here = np.concatenate(places, axis=1) if places else np.empty((2, 0), dtype=np.int64)
        comm = numbering.comm
        everywhere = comm.allgather(here) if comm.size > 1 else [here]
        self.places, self._counts = np.concatenate(everywhere, axis=1), [part.shape[1] for part in everywhere]

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
