"""Work that one MPI rank does for all: files and pictures."""

from cosserat_fenicsx.errors import SceneError


def on_first(comm, action):
    """Run `action()` on rank 0; where it fails, every rank raises the same exception.

    Raises:
        OSError, SceneError: as `action` did.
    """
    trouble = None
    if comm.rank == 0:
        try:
            action()
        except (OSError, SceneError) as problem:
            trouble = problem
    trouble = comm.bcast(trouble)
    if trouble is not None:
        raise trouble
