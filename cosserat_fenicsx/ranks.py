"""Work that one MPI rank does for all: files and pictures."""

import pickle


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
