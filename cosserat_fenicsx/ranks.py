"""MPI ranks: communicators, work of rank 0 for all (files and pictures), and a common end.

Under mpirun a rank that ends with an exception, also a thread that does, or by `sys.exit` with a failure, ends all
ranks: the others would wait for it in MPI_Finalize forever. `python -m mpi4py` does the same for scripts that it
starts. Where all ranks fail, each ends by itself.
"""

import builtins
import contextlib
import os
import sys
import threading
import time

from cosserat_fenicsx.errors import SceneError

#: Time (s) within which the other ranks get here where all of them fail.
PATIENCE = 3.0
#: Environment variables of launchers with the number of processes: Open MPI, Hydra of MPICH and of Intel, MVAPICH,
#: Slurm's srun.
SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")

_apart, _counting = 0, threading.Lock()  # how many cases this process computes now, in threads of its own
_watched = None  # the process that `watch` was called in


class Alone:
    """Communicator of a single process, without loading MPI."""

    rank, size = 0, 1

    @staticmethod
    def bcast(value):
        return value

    @staticmethod
    def gather(value):
        return [value]

    allgather = gather


def launched():
    """(rank, number of ranks) of this process, without loading MPI."""
    for rank, size in (("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), ("PMI_RANK", "PMI_SIZE")):
        if size in os.environ:
            return int(os.environ.get(rank, 0)), int(os.environ[size])
    return 0, 1


@contextlib.contextmanager
def apart():
    """Context manager in which this rank computes without the others, and alone is the default communicator."""
    _count(1)
    try:
        yield
    finally:
        _count(-1)


def _count(more):
    global _apart
    with _counting:
        _apart += more


def are_apart():
    """Whether this rank is within `apart`."""
    return _apart > 0


def communicator(comm=None):
    """The MPI communicator of a computation: `comm`, by default all ranks; within `apart`, this one. Raises SceneError:
    within `apart`, a communicator of several ranks, which would wait for the others forever."""
    from mpi4py import MPI

    if _apart and comm is not None and comm.size > 1:
        raise SceneError(
            f"comm = a communicator of {comm.size} ranks: expected None or MPI.COMM_SELF within a study, where each "
            "case is computed by one rank"
        )
    return comm or (MPI.COMM_SELF if _apart else MPI.COMM_WORLD)


def world():
    """The communicator of all ranks, within `apart` of this one; MPI is loaded where there are others alone."""
    return Alone if _apart or launched()[1] == 1 else communicator()


def on_first(comm, action):
    """Run `action()` on rank 0; where it fails, all ranks raise the same exception, or a RuntimeError with its text."""
    trouble = None
    if comm.rank == 0:
        try:
            action()
        except Exception as problem:
            trouble = problem
    sent = comm.bcast(_that_can_be_sent(trouble))
    if sent is not None:
        raise trouble or sent


def _that_can_be_sent(problem):
    import pickle  # here, since this module is imported with the package

    try:
        pickle.loads(pickle.dumps(problem))
        return problem
    except Exception:  # of the user's own
        return RuntimeError(f"{type(problem).__name__}: {problem}")


def watch():
    """Watch how this process ends, if it is one of several."""
    global _watched
    if _watched is None and any(os.environ.get(name, "1") != "1" for name in SIZES):
        import threading  # here, since this module is imported with the package

        _watched = os.getpid()  # not those that it forks
        sys.excepthook = _after(sys.excepthook)
        threading.excepthook = _after(threading.excepthook)
        sys.exit = _exit
        if hasattr(builtins, "exit"):  # of the module site
            builtins.exit = builtins.quit = _exit


def leave():
    """Watch no longer: the program itself sees to it that ranks end together."""
    global _watched
    _watched = 0


def end_all(code=1):
    """End all ranks at once."""
    from mpi4py import MPI

    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError, AttributeError):  # it is closed
            continue
    MPI.COMM_WORLD.Abort(code)


def all_are_here(comm, patience=None):
    """Whether all ranks call this within `patience` (s; None for `PATIENCE`)."""
    from mpi4py import MPI

    until = time.monotonic() + (PATIENCE if patience is None else patience)
    try:
        met = comm.Ibarrier()
        while not met.Test():
            if time.monotonic() > until:
                return False
            time.sleep(0.01)
    except MPI.Exception:  # another rank is in another collective operation, which the barrier does not match
        return False
    return True


def _after(hook):
    """A hook for uncaught exceptions that ends all ranks after calling another hook."""

    def hooked(*given):
        hook(*given)
        _end_unless_all_end("an exception")

    return hooked


def _end_unless_all_end(what, code=1):
    """End all ranks, unless each of them fails now. Without MPI at work this process just ends, which launchers see."""
    interactive = hasattr(sys, "ps1") or sys.flags.interactive
    if _watched != os.getpid() or interactive or "mpi4py.MPI" not in sys.modules:
        return
    from mpi4py import MPI

    world = MPI.COMM_WORLD if MPI.Is_initialized() and not MPI.Is_finalized() else None
    if world is None or world.size == 1 or all_are_here(world):
        return
    print(f"cosserat_fenicsx: rank {world.rank} of {world.size} alone ended with {what}: all ranks are ended, which "
          "would wait for it", file=sys.stderr, flush=True)  # fmt: skip
    end_all(code)


class _Exit(SystemExit):
    """Exception of `sys.exit`: Python reads its `code` outside any function if it was not caught."""

    @property
    def code(self):
        code = SystemExit.code.__get__(self)
        if code not in (None, 0) and _is_asked_by_python():
            if not isinstance(code, int):
                print(code, file=sys.stderr)
            _end_unless_all_end("a failure", code if isinstance(code, int) and 0 < code < 256 else 1)
            return code if isinstance(code, int) else 1
        return code

    def __reduce__(self):
        return SystemExit, self.args


def _exit(status=None, /):
    """Exit the interpreter by raising SystemExit(status), as `sys.exit` of Python does."""
    raise _Exit(*(() if status is None else status if isinstance(status, tuple) else (status,)))


def _is_asked_by_python():
    try:
        sys._getframe(2)  # the caller of `code`
    except ValueError:
        return True
    return False
