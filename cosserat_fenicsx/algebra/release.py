"""The end of compiled problems: their memory is freed, which neither reference counts nor the garbage collector do.

A PETSc object keeps the Python functions that it calls back. Where these belong to its owner, as the convergence test
of `Newton` does, each keeps the other, and Python's garbage collector does not see the half of the cycle in PETSc. And
PETSc only puts aside what Python drops, until `garbage_cleanup`, since destruction is collective.
"""

from petsc4py import PETSc

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


def sweep(comm):
    """Free the PETSc objects that Python has dropped, on a communicator (collective) and on this rank alone."""
    PETSc.garbage_cleanup(comm)
    PETSc.garbage_cleanup(PETSc.COMM_SELF)


def _destroy(value, seen):
    """Destroy the PETSc objects in an object of this package, and in those that it refers to."""
    if id(value) in seen:
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
