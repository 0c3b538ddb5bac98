"""Tasks handed out to ranks as they ask, so that ranks with short ones compute more of them."""

import time

import numpy as np

# Time (s) between looks of a rank that has nothing left to do and waits for the others.
_LOOK = 0.005
_NEXT, _DONE, _FAILED = range(3)


class TaskPool:
    """Hands out the numbers below `count`, each to one rank, in ascending order.

    The numbers are counted in memory of rank 0 by one-sided operations of MPI, which it need not answer: it computes
    as the others do. Ranks that share a computer, or a network with remote access to memory, do not wait for it; on
    other networks a rank waits until rank 0 next enters MPI, which is the end of its task at the latest.

    Every rank makes it, iterates over it until it ends, calls `meet`, and then `close`.

    Args:
        comm: MPI communicator; count: number of tasks.
    """

    def __init__(self, comm, count):
        self._comm, self._count, self._met, self._window = comm, count, None, None
        self._counters = np.zeros(3, np.int64)
        if comm.size > 1:
            from mpi4py import MPI

            size = self._counters.itemsize
            self._window = MPI.Win.Allocate(len(self._counters) * size if comm.rank == 0 else 0, size, comm=comm)
            if comm.rank == 0:
                self._counters = np.frombuffer(self._window.tomemory(), np.int64)
                self._counters[:] = 0
            comm.Barrier()
            self._window.Lock_all()

    def __iter__(self):
        while (number := self._add(_NEXT, 1)) < self._count:
            yield number

    def _add(self, counter, amount):
        """Add to a counter and return what it was."""
        if self._window is None:
            before = int(self._counters[counter])
            self._counters[counter] += amount
            return before
        added, before = np.array([amount], np.int64), np.empty(1, np.int64)
        self._window.Fetch_and_op(added, before, 0, counter)
        self._window.Flush(0)
        return int(before[0])

    def tell(self, failed):
        """This rank has done a task."""
        self._add(_FAILED, int(failed))
        self._add(_DONE, 1)

    def counts(self):
        """(tasks done, those of them that failed) on all ranks; on rank 0 alone."""
        return int(self._counters[_DONE]), int(self._counters[_FAILED])

    def stop(self):
        """Hand out no more, to no rank."""
        self._add(_NEXT, self._count)

    def meet(self):
        """Wait until no rank has more to do. Unlike a barrier of MPI it leaves the processor to others, and can be
        interrupted and called again."""
        if self._window is None:
            return
        self._met = self._met or self._comm.Ibarrier()
        while not self._met.Test():
            time.sleep(_LOOK)

    def close(self):
        """Give the memory back. Collective."""
        if self._window is not None:
            self._counters = self._counters.copy()
            self._window.Unlock_all()
            self._window.Free()
            self._window = None
