"""Which MPI ranks work together, and work that one of them does for all: files and pictures."""

import contextlib
import os
import pickle

from cosserat_fenicsx.errors import SceneError

_apart = False


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


@contextlib.contextmanager
def apart():
    """Context manager in which this rank computes without the others, as in a case of a study: what takes no
    communicator gets that of this process alone."""
    global _apart
    before, _apart = _apart, True
    try:
        yield
    finally:
        _apart = before


def are_apart():
    """Whether this rank is within `apart`."""
    return _apart


def communicator(comm=None):
    """The MPI communicator of a computation: `comm`, or by default that of all ranks; within `apart`, of this one.

    Raises:
        SceneError: within `apart`, one of several ranks, which would wait for the others for ever.
    """
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
