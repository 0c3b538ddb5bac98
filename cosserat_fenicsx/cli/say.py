"""Messages of the command line, printed by one MPI rank alone, and its exit codes."""

import sys

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


def in_words(problem):
    """The text of an exception; of an OSError with its file and without its number."""
    if not isinstance(problem, OSError) or not problem.strerror:
        return str(problem) or type(problem).__name__
    return f"{problem.filename}: {problem.strerror}" if problem.filename else problem.strerror
