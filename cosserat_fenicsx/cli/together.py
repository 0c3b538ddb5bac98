"""Under mpirun: what only one rank raises ends all of them, which would wait for it for ever otherwise."""

import sys

from cosserat_fenicsx.ranks import all_are_here, end_all, launched

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
    from cosserat_fenicsx.cli.say import in_words
    from cosserat_fenicsx.errors import CosseratError

    if isinstance(problem, CosseratError | OSError):
        return in_words(problem)
    return f"{type(problem).__name__}: {problem}"
