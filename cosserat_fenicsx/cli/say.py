"""What the command line prints, by one MPI rank alone, its exit codes, the files that it writes, and how all ranks end
when one of them raises."""

import os
import sys
import warnings
from contextlib import contextmanager
from pathlib import Path

from cosserat_fenicsx.errors import (
    CacheWarning,
    Interrupted,
    LibraryMissing,
    NotConverged,
    NotStored,
    SceneError,
    SceneWarning,
)
from cosserat_fenicsx.interrupts import obey, patience
from cosserat_fenicsx.ranks import all_are_here, end_all, launched

#: Exit codes.
DONE, NOT_CONVERGED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def first_rank():
    """True on rank 0 alone."""
    if "mpi4py" not in sys.modules:
        return launched()[0] == 0
    from mpi4py import MPI

    return MPI.COMM_WORLD.rank == 0


def say(text, file=None):
    if first_rank():
        stream = file or sys.stderr
        try:
            print(text, file=stream, flush=True)
        except BrokenPipeError:  # the reader, such as `head`, has enough: files are still written
            with open(os.devnull, "w") as nowhere:
                os.dup2(nowhere.fileno(), stream.fileno())


@contextmanager
def warnings_in_words():
    """Say each warning about a scene, or the cache, once, without the place in the code that it comes from."""
    said = set()

    def show(message, category, *where, **more):
        if not issubclass(category, SceneWarning | CacheWarning):
            usual(message, category, *where, **more)
        elif str(message) not in said:
            said.add(str(message))
            say(f"cosserat: warning: {message}")

    with warnings.catch_warnings():
        usual, warnings.showwarning = warnings.showwarning, show
        warnings.simplefilter("always", SceneWarning)
        yield


def in_words(problem):
    """The text of an exception; of an OSError with its file and without its number."""
    if not isinstance(problem, OSError) or not problem.strerror:
        return str(problem) or type(problem).__name__
    return f"{problem.filename}: {problem.strerror}" if problem.filename else problem.strerror


class Files:
    """Files in a folder, one after another.

    Args:
        out: the folder, a Path. stops: whether a signal ends the writing between two files.
    """

    def __init__(self, out, stops=True):
        self._out, self._stops = out, stops
        self.names, self._left_out = [], {}

    def put(self, name, write, *more):
        """Call `write` with a file of this name; `more`: names of files that it writes too. A picture whose library is
        missing is left out.

        Raises:
            KeyboardInterrupt: a signal asked for a stop.
            OSError, SceneError: as `write` does.
        """
        if self._stops:
            obey()
        try:
            write(self._out / name)
        except LibraryMissing as problem:
            self._left_out.setdefault(str(problem), []).append(name)
        else:
            self.names += [name, *more]

    def tell(self):
        """Say what was written, and what was left out."""
        if self.names:
            say(f"written to {self._out}/: {', '.join(self.names)}", file=sys.stdout)
        for why, names in self._left_out.items():
            say(f"cosserat: left out: {', '.join(names)}: {why}")


def keep_inputs(out, names, scene, tables):
    """Refuse an output that would replace the scene file, or a file that it names.

    Args:
        out: the output folder, a Path. names: of all files that may be written there.
        scene: the name of the scene file. tables: what is in it.

    Raises:
        SceneError: naming the file.
    """
    folder = Path(scene).parent
    read = {os.path.realpath(scene)} | {os.path.realpath(folder / text) for text in _texts(tables) if "\0" not in text}
    for name in names:
        if os.path.realpath(out / name) in read:
            raise SceneError(
                f"-o {out}: {name} would replace the file of that name which the scene is read from: expected another "
                "folder, or another name of that file"
            )


def _texts(value):
    """All texts in nested tables and lists."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _texts(inner)


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
    from cosserat_fenicsx.errors import CosseratError

    if isinstance(problem, CosseratError | OSError):
        return in_words(problem)
    return f"{type(problem).__name__}: {problem}"


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
