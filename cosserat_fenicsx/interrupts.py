"""Ctrl-C on the command line: asked for by a signal, obeyed between two steps, so that nothing is left half done."""

import os
import signal

_asked = False


def listen():
    """From now on SIGINT and SIGTERM ask for a stop; a second one ends the process at once.

    Not under mpirun, which ends its ranks by force anyway, and where one rank must not stop without the others.
    """
    if any(os.environ.get(name, "1") != "1" for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE")):
        return
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _ask)


def _ask(number, frame):
    global _asked
    _asked = True
    signal.signal(number, signal.SIG_DFL)


def obey():
    """Raise KeyboardInterrupt if a stop was asked for."""
    if _asked:
        raise KeyboardInterrupt
