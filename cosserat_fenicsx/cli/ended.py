"""How a computation ended: what it returned, or what it had done when it failed or was interrupted."""

from cosserat_fenicsx.cli.say import BAD_INPUT, DONE, INTERRUPTED, NOT_CONVERGED
from cosserat_fenicsx.errors import Interrupted, NotConverged, NotStored, SceneError
from cosserat_fenicsx.interrupts import patience


def ended(compute):
    """(result or partial result, the exception or None, exit code) of a function without arguments.

    Raises:
        SceneError: bad input, found before anything was computed.
    """
    try:
        with patience():
            return compute(), None, DONE
    except (NotConverged, NotStored) as failure:
        return failure.path, failure, NOT_CONVERGED
    except SceneError as failure:
        if failure.path is None:
            raise
        return failure.path, failure, BAD_INPUT
    except Interrupted as stop:
        return stop.path, stop, INTERRUPTED
