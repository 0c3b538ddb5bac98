"""A pool of compiled problems: each is used by one caller at a time, and kept for the next one that fits.

At the end of a problem its memory is freed, which neither reference counts nor the garbage collector do. A PETSc object
keeps the Python functions that it calls back. Where these belong to its owner, as the convergence test of `Newton`
does, each keeps the other, and Python's garbage collector does not see the half of the cycle in PETSc. And PETSc only
puts aside what Python drops, until `garbage_cleanup`, since destruction is collective.
"""

import contextlib
import ctypes
import threading

from mpi4py import MPI
from petsc4py import PETSc

from cosserat_fenicsx.algebra.building import begin

#: Largest number of idle problems kept for each communicator; the least recently used one is dropped first.
MOST_IDLE = 24
# Problems given back by one process until what Python has dropped meanwhile is freed, which takes as long as a few
# points.
_SOME = 8


class ProblemPool:
    """Owns compiled problems and lends them; most_idle: largest number of idle ones kept for each communicator; made:
    how many were made so far.

    A problem that is lent belongs to its caller alone until it is given back: a call inside another one (from `until`,
    from a force as a function of time, from another thread) gets a problem of its own. All ranks of a communicator must
    borrow and return in the same order, which they do if every rank makes the same calls. Each communicator has a
    separate limit: what one rank does on its own must not decide what all ranks have to create collectively.
    """

    def __init__(self, most_idle=MOST_IDLE):
        self._lock, self._most_idle, self.made, self._returns = threading.Lock(), most_idle, 0, 0
        self._idle_of_all, self._idle_of_one = [], []  # (key, problem, large), the one used last at the end

    @contextlib.contextmanager
    def lend(self, key, comm, make, outcomes=(), *, large=False):
        """A context whose value is a problem of a hashable key that nobody else uses within it; make: called where none
        that fits is idle. Problems on a communicator created by the user are not kept, since the user may free it.
        outcomes: exceptions that leave a problem usable; after any other it is dropped, since it may be half way
        through an assembly or a solution. large: whether it takes so much memory that no other such problem stays idle
        when it is made."""
        idle = self._idle_on(comm)
        problem = self._take(idle, key)
        if problem is None:
            if large:
                self._drop_large(idle, comm)
            begin()
            problem = make()
        try:
            yield problem
        except outcomes:
            self._give_back(idle, (key, problem, large), comm)
            raise
        except Exception:  # under mpirun the other ranks may not have raised it
            if comm.size == 1:
                release(problem)
            raise
        self._give_back(idle, (key, problem, large), comm)

    def _idle_on(self, comm):
        """The list of idle problems on a communicator; None for one created by the user."""
        if comm == MPI.COMM_WORLD:
            return self._idle_of_all
        return self._idle_of_one if comm == MPI.COMM_SELF else None

    def _take(self, idle, key):
        with self._lock:
            for i in reversed(range(len(idle or ()))):
                if idle[i][0] == key:
                    return idle.pop(i)[1]
            self.made += 1
        return None

    def _give_back(self, idle, lent, comm):
        with self._lock:
            if idle is None:
                dropped = [lent]
            else:
                idle.append(lent)
                dropped = idle[: max(0, len(idle) - self._most_idle)]
                del idle[: len(dropped)]
        self._release(dropped, comm)

    def _drop_large(self, idle, comm):
        with self._lock:
            dropped = [old for old in idle or () if old[2]]
            if dropped:
                idle[:] = [old for old in idle if not old[2]]
        self._release(dropped, comm)
        if dropped and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)):
            trim(0)  # MPI may keep glibc from returning what is freed; room that MUMPS never writes to would take it

    def _release(self, dropped, comm):
        for _, old, _ in dropped:
            release(old)
        self._returns += 1
        if dropped or comm.size > 1 or self._returns % _SOME == 0:
            free_dropped(comm)


_PACKAGE = __name__.partition(".")[0]


def release(problem):
    """Destroy a problem's PETSc objects and take it and its model apart. Collective; nobody may use it any more.

    Args:
        problem: an object of this package, or a tuple of such.
    """
    _destroy(problem, set())
    for part in problem if isinstance(problem, tuple) else (problem,):
        model = getattr(part, "model", None)
        for hub in (part, model):  # all cycles lead through these; without them reference counts free the rest at once
            getattr(hub, "__dict__", {}).clear()


def free_dropped(comm):
    """Free the PETSc objects that Python has dropped, on a communicator (collective) and on this rank alone."""
    PETSc.garbage_cleanup(comm)
    PETSc.garbage_cleanup(PETSc.COMM_SELF)


def _destroy(value, seen):
    """Destroy the PETSc objects in an object of this package and in those it refers to, but in frozen data."""
    if id(value) in seen or getattr(getattr(value, "__dataclass_params__", None), "frozen", False):
        return
    seen.add(id(value))
    if isinstance(value, PETSc.Object):
        value.destroy()
    elif isinstance(value, tuple | list):
        for item in value:
            _destroy(item, seen)
    elif type(value).__module__.partition(".")[0] == _PACKAGE:
        for item in getattr(value, "__dict__", {}).values():
            _destroy(item, seen)


#: Where `solve`, `simulate`, `buckling` and `modes` borrow their problems.
PROBLEMS = ProblemPool()
