"""Results of the command line: printed and written, also the partial ones after a failure or an interruption; what
else is printed, by one MPI rank alone, exit codes, and how all ranks end when one raises."""

import os
import shlex
import sys
import tempfile
import warnings
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path

from cosserat_fenicsx.errors import (
    CacheWarning,
    CosseratError,
    Interrupted,
    LibraryMissing,
    NotConverged,
    NotStored,
    SceneError,
    SceneWarning,
)
from cosserat_fenicsx.interrupts import obey, patience
from cosserat_fenicsx.ranks import all_are_here, end_all, launched

# Options that are for rods alone, but for those that a kind of scene takes; and the kinds in words.
_OPTIONS = ("load_factors", "tol", "bound", "elements", "degree", "formulation", "model", "control", "branch",
            "duration", "dt", "scheme", "save_every", "start", "folder", "station", "at", "animate", "speed", "color",
            "magnify")  # fmt: skip
_TAKEN = {
    "a well": ("tol", "model"),
    "a drill-string in motion": ("duration", "dt", "elements", "model", "save_every", "folder", "animate", "speed"),
}
# Endings of files that are written last, since their libraries take seconds and hundreds of MB.
_PICTURES = (".png", ".gif", ".mp4")


def given(options, names):
    """{name: value} of the options with these names that were given."""
    found = {name: getattr(options, name, None) for name in names}
    return {name: value for name, value in found.items() if value is not None}


def units_of(options):
    """The value of --units, by default "SI"; a SceneError where `Units` does not take it."""
    from cosserat_fenicsx.quantities import Units  # loads numpy, which --help does without

    asked = getattr(options, "units", None) or "SI"
    Units(asked)
    return asked


def refuse_of_rods(options, kind):
    """Refuse options of rods for another kind of scene, such as "a well"."""
    for name in given(options, [name for name in _OPTIONS if name not in _TAKEN[kind]]):
        raise SceneError(f"--{name.replace('_', '-')} is for rods, and this scene is {kind}")


def charted(stem, options, result, *, beside=()):
    """The files of a result with a table and a chart, for `deliver`: `stem`.csv, with which those whose names end in
    `beside` are written, and `stem`.png where pictures are wanted and it has a chart."""
    asked = {"units": units_of(options)}
    chart = not options.no_picture and len(result) and getattr(result, "plot", None)
    files = {f"{stem}.csv": partial(result.write, **asked)} | {f"{stem}{ending}.csv": True for ending in beside}
    return files | {f"{stem}.png": chart and partial(chart, **asked)}


def deliver(computed, options, names, files_of, tables=None, *, moving=False, obeys=True):
    """Compute, then print and write the result, or the partial one; returns the exit code.

    names: of all files that may be written; files_of: function of the result that returns {name: function that writes
    this file; True where the one before writes it as well; or what is false for none}; tables: of the scene file, where
    there is one; obeys: whether the computation looks for requested stops itself, by `interrupts.obey`; others end at
    once.
    """
    film = getattr(options, "animate", None)
    if film is not None:
        _check_film(film, options, moving)
    out = output_of(options, [*names, *filter(None, [film])], tables)
    result, trouble, code = _ended(lambda: together(computed), patience() if obeys else nullcontext())
    if result is not None and (code == DONE or len(result)):
        brief = getattr(options, "brief", False)
        told = result.summary if brief else partial(result.details, **given(options, ["station"]))
        say(told(units_of(options)), file=sys.stdout)
        if out is not None:
            if code == INTERRUPTED:
                say("cosserat: interrupted; writing the partial result, Ctrl-C again skips what is not written yet")
            try:
                with patience():
                    files = files_of(result)
                    if code == INTERRUPTED:  # a film would take long
                        files.pop(film, None)
                    _write(files, out, stops=code != INTERRUPTED)
            except KeyboardInterrupt:
                trouble, code = "interrupted; what is not written yet is left out", INTERRUPTED
            except (OSError, SceneError) as problem:
                say(f"cosserat: {in_words(problem)}")
                code = code or BAD_INPUT
    if trouble is not None:
        reached = f" (t = {result.times[-1]:.6g} s)" if isinstance(trouble, Interrupted) and moving and result else ""
        words = str(getattr(trouble, "words", trouble))
        say(f"cosserat: {words}{reached}")
        if getattr(options, "folder", None) and not isinstance(trouble, NotConverged | SceneError):
            if "cosserat resume" not in words:
                say(f"cosserat: `cosserat resume {shlex.quote(options.folder)}` continues from there")
        elif moving and code == INTERRUPTED:
            say("cosserat: a motion that is run with --folder DIR can be continued by `cosserat resume DIR`")
    return code


def _write(files, out, stops):
    """Write files, those without pictures first, and say which; with `stops` a signal ends it between two files."""
    for pictures in (False, True):
        some = {name: write for name, write in files.items() if write and name.endswith(_PICTURES) == pictures}
        _write_some(some, out, stops)


def _write_some(files, out, stops):
    """Write some of the files, and say which; pictures whose library is missing are left out."""
    written, left_out = [], {}
    try:
        for name, write in files.items():
            if stops:
                obey()
            try:
                if callable(write):
                    write(out / name)
                written.append(name)
            except LibraryMissing as problem:
                left_out.setdefault(str(problem), []).append(name)
    finally:
        if written:
            say(f"written to {out}/: {', '.join(written)}", file=sys.stdout)
        for why, names in left_out.items():
            say(f"cosserat: left out: {', '.join(names)}: {why}")


def _ended(compute, waiting):
    """(result or partial result, the exception or None, exit code) of a function called in a context manager."""
    try:
        with waiting:
            return compute(), None, DONE
    except (NotConverged, NotStored) as failure:
        return failure.path, failure, NOT_CONVERGED
    except SceneError as failure:
        if failure.path is None:
            raise
        return failure.path, failure, BAD_INPUT
    except Interrupted as stop:
        return stop.path, stop, INTERRUPTED


def output_of(options, names, tables=None):
    """The output folder, a Path, made before anything is computed; None without one. names: of all files that may be
    written; a SceneError where it cannot be written to, or where a file would replace the scene file, or one that its
    tables name."""
    if not options.output:
        return None
    out = Path(options.output)
    if tables is not None:
        inputs = [options.scene, *(Path(options.scene).parent / text for text in _texts(tables) if "\0" not in text)]
        read = set(map(os.path.realpath, inputs))
        for name in names:
            if os.path.realpath(out / name) in read:
                raise SceneError(
                    f"-o {out}: {name} would replace the file of that name which the scene is read from: expected "
                    "another folder, or another name of that file"
                )
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as problem:
        raise SceneError(f"output folder {out}: {problem.strerror}: expected a folder that can be written to") from None
    return out


def _check_film(film, options, moving):
    """Refuse a film that cannot be made, before the computation."""
    if not moving or not options.output:
        raise SceneError("--animate: expected a motion, and -o DIR to write its film to")
    if Path(film).name != film:
        raise SceneError(f"--animate {film}: expected a name without folders; it is written to -o DIR")
    from cosserat_fenicsx.pictures.animation import check_name

    check_name(film)


def _texts(value):
    """All texts in nested tables and lists."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _texts(inner)


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
    if isinstance(problem, CosseratError | OSError):
        return in_words(problem)
    return f"{type(problem).__name__}: {problem}"
