"""What the command line prints, by one MPI rank alone, its exit codes, and how all ranks end when one raises."""

import os
import sys
import warnings
from contextlib import contextmanager

from cosserat_fenicsx.errors import CacheWarning, CosseratError, SceneWarning
from cosserat_fenicsx.ranks import all_are_here, end_all, launched

#: Exit codes.
DONE, NOT_CONVERGED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def first_rank():
    """True on rank 0 alone."""
    if "mpi4py" not in sys.modules:
        return launched()[0] == 0
    from mpi4py import MPI

    return MPI.COMM_WORLD.rank == 0


def say(text, file=None):
    if first_rank():
        stream = file or sys.stderr
        try:
            print(text, file=stream, flush=True)
        except BrokenPipeError:  # the reader, such as `head`, has enough: files are still written
            with open(os.devnull, "w") as nowhere:
                os.dup2(nowhere.fileno(), stream.fileno())


@contextmanager
def warnings_in_words():
    """Say each warning about a scene, or the cache, once, without the place in the code that it comes from."""
    said = set()

    def show(message, category, *where, **more):
        if not issubclass(category, SceneWarning | CacheWarning):
            usual(message, category, *where, **more)
        elif str(message) not in said:
            said.add(str(message))
            say(f"cosserat: warning: {message}")

    with warnings.catch_warnings():
        usual, warnings.showwarning = warnings.showwarning, show
        warnings.simplefilter("always", SceneWarning)
        yield


def in_words(problem):
    """The text of an exception; of an OSError with its file and without its number."""
    if not isinstance(problem, OSError) or not problem.strerror:
        return str(problem) or type(problem).__name__
    return f"{problem.filename}: {problem.strerror}" if problem.filename else problem.strerror


# Time (s) within which ranks that fail together get here.
_PATIENCE = 10.0


def together(action):
    """The result of `action()`. Where this rank alone raises, it says so and ends all ranks; where all do, each raises.

    Ranks that raise meet at a barrier, which those that still compute do not reach. Every rank calls.
    """
    rank, size = launched()
    if size == 1:
        return action()
    try:
        from mpi4py import MPI
    except ImportError:  # the action says what to install
        return action()
    own = MPI.COMM_WORLD.Dup()
    try:
        return action()
    except Exception as problem:
        if not all_are_here(own, _PATIENCE):
            print(f"cosserat: rank {rank} of {size} alone: {_in_full(problem)}", file=sys.stderr, flush=True)
            end_all()
        raise


def _in_full(problem):
    if isinstance(problem, CosseratError | OSError):
        return in_words(problem)
    return f"{type(problem).__name__}: {problem}"
