"""Messages of the command line, printed by one MPI rank alone, and its exit codes."""

import sys

#: Exit codes.
DONE, NOT_CONVERGED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def first_rank():
    """True on rank 0, and where MPI is not loaded."""
    if "mpi4py" not in sys.modules:
        return True
    from mpi4py import MPI

    return MPI.COMM_WORLD.rank == 0


def say(text, file=None):
    if first_rank():
        print(text, file=file or sys.stderr, flush=True)
