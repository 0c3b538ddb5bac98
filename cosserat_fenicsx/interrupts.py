"""Ctrl-C on the command line: a signal sets a flag, which solvers check between steps, so that results stay consistent.

Python runs signal handlers only between its own instructions. So long computations in C either call back (`obey` at
every step of an eigensolver), or run in a second thread, which the main thread waits for. Before and between
computations, a signal takes effect at once.
"""

import contextlib
import os
import signal
import threading

# Time (s) between checks for a requested stop while another thread computes.
_CHECK_INTERVAL = 0.2
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # the last one where a terminal is closed
_asked = _waits = False


def listen():
    """Let SIGINT, SIGTERM and SIGHUP request a stop, which says so; a second signal ends the process at once. To be
    called before dolfinx is imported, since PETSc would take SIGHUP for an error.

    Not under mpirun, which kills its ranks anyway, and where one rank must not stop without the others.
    """
    if any(os.environ.get(name, "1") != "1" for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE")):
        return
    if signal.getsignal(signal.SIGINT) is _ask:
        return
    os.environ["PETSC_OPTIONS"] = f"{os.environ.get('PETSC_OPTIONS', '')} -no_signal_handler"
    os.environ.setdefault("UCX_DEBUG_SIGNO", "0")  # MPI's library takes SIGHUP when it is loaded
    for number in _SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:  # nohup ignores SIGHUP
            signal.signal(number, _ask)


def renew():
    """Take the signals of `listen` again: MPI or PETSc may have taken some of them when they started. And that of a
    closed pipe, as in `script.py | head`, of which Python makes a BrokenPipeError and PETSc an abort of MPI."""
    if threading.current_thread() is threading.main_thread():
        for number in (*_SIGNALS, signal.SIGPIPE):
            known = signal.getsignal(number)
            if known is _ask or (number == signal.SIGPIPE and known is not None):
                signal.signal(number, known)


def ignore():
    """Ignore signals from now on: the work is done, and the process ends."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _ask(number, frame):
    global _asked
    _asked = True
    signal.signal(number, signal.SIG_DFL)
    _leave_closed_terminals()
    # at once, since a second signal may end the process before anything else is said; below the line of the terminal
    words = "; it ends after the step at work, Ctrl-C again ends it at once" if _waits else ""
    os.write(2, f"{chr(10) * os.isatty(2)}cosserat: interrupted{words}\n".encode())
    if not _waits:
        raise KeyboardInterrupt


def _leave_closed_terminals():
    """Discard output to a closed terminal, instead of raising errors that would end the writing of files."""
    for stream in (1, 2):
        try:
            os.write(stream, b"")
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)


@contextlib.contextmanager
def patience():
    """Context manager of computations that call `obey`: within it a signal only sets the flag."""
    global _waits
    before, _waits = _waits, True
    try:
        yield
    finally:
        _waits = before


def asked():
    """Whether a stop has been requested."""
    return _asked


def obey():
    """Raise KeyboardInterrupt where a stop has been requested."""
    if _asked:
        raise KeyboardInterrupt


def interruptible(action):
    """The result of `action()`, computed in a second thread, so that a stop takes effect at once; it may be abandoned
    at any point, and must release Python's global lock, as numpy's linear algebra does."""
    import queue
    import threading  # here, since the command line listens before it does anything else

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
