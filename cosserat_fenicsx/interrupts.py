"""Ctrl-C on the command line: a signal sets a flag, which solvers check between steps, so that results stay consistent.

Python runs signal handlers only between its own instructions. So long computations in C either call back (`obey` at
every step of an eigensolver), or run in a second thread, which the main thread waits for.
"""

import os
import queue
import signal
import threading

# Time (s) between checks for a requested stop while another thread computes.
_CHECK_INTERVAL = 0.2
_asked = False


def listen():
    """Let SIGINT and SIGTERM request a stop; a second signal ends the process at once.

    Not under mpirun, which kills its ranks anyway, and where one rank must not stop without the others.
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
    """Raise KeyboardInterrupt where a stop has been requested."""
    if _asked:
        raise KeyboardInterrupt


def interruptible(action):
    """The result of `action()`, computed in a second thread, so that a stop takes effect at once.

    The action may be abandoned at any point, and must release Python's global lock, as numpy's linear algebra does.
    """
    results = queue.SimpleQueue()

    def work():
        try:
            results.put((action(), None))
        except BaseException as problem:  # raised again in the waiting thread
            results.put((None, problem))

    threading.Thread(target=work, daemon=True).start()
    while True:
        obey()
        try:
            result, problem = results.get(timeout=_CHECK_INTERVAL)
        except queue.Empty:
            continue
        if problem is not None:
            raise problem
        return result
