"""Messages of the command line, printed by one MPI rank alone, and its exit codes."""

import sys
import warnings
from contextlib import contextmanager

from cosserat_fenicsx.errors import CacheWarning, SceneWarning
from cosserat_fenicsx.ranks import launched

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
        print(text, file=file or sys.stderr, flush=True)


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
