"""Work that one MPI rank does for all: files and pictures."""

import os
import pickle


class Alone:
    """The communicator of a process that is alone, for what needs no MPI otherwise."""

    rank = 0

    @staticmethod
    def bcast(value):
        return value


def launched():
    """(rank, number of ranks) of this process, without loading MPI."""
    for rank, size in (("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), ("PMI_RANK", "PMI_SIZE")):
        if size in os.environ:
            return int(os.environ.get(rank, 0)), int(os.environ[size])
    return 0, 1


def world():
    """The communicator of all ranks; MPI is loaded where there are others alone."""
    if launched()[1] == 1:
        return Alone
    from mpi4py import MPI

    return MPI.COMM_WORLD


def on_first(comm, action):
    """Run `action()` on rank 0; where it fails, every rank raises the same exception.

    Raises:
        Exception: as `action` did, such as OSError; RuntimeError with its text, on the other ranks, where it cannot be
            sent to them.
    """
    trouble = None
    if comm.rank == 0:
        try:
            action()
        except Exception as problem:
            trouble = problem
    told = comm.bcast(_that_can_be_sent(trouble))
    if told is not None:
        raise trouble or told


def _that_can_be_sent(problem):
    try:
        pickle.loads(pickle.dumps(problem))
        return problem
    except Exception:  # of the user's own
        return RuntimeError(f"{type(problem).__name__}: {problem}")
