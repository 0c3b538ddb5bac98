"""Rods on the command line: equilibrium paths, motions, buckling loads and natural modes, and their files."""

import sys
import tempfile
from pathlib import Path

from cosserat_fenicsx.cli.say import (
    BAD_INPUT,
    DONE,
    INTERRUPTED,
    NOT_CONVERGED,
    Files,
    ended,
    in_words,
    keep_inputs,
    say,
    together,
)
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.interrupts import patience

#: Options of a motion, and those of an equilibrium path, by the names of the arguments of `simulate` and `solve`.
MOTION, PATH = (
    ("duration", "dt", "scheme", "save_every", "start", "folder"),
    ("load_factors", "bound", "formulation", "control", "branch"),
)
_BOTH = ("tol", "elements", "degree", "model")


def motion_of(options, found):
    """The scene and the arguments of `simulate`, or None where an equilibrium path is requested.

    Args:
        options: of the command line; they replace the arguments in the file. found: the `RodScene` of the file.

    Raises:
        SceneError: an option of a path for a motion or vice versa.
    """
    given = {name: getattr(options, name, None) for name in (*MOTION, *PATH, *_BOTH)}
    given = {name: value for name, value in given.items() if value is not None}
    settings = found.motion
    moves = not options.static and (settings or "duration" in given)
    for name in PATH if moves else MOTION:
        if name in given:
            refuse_other(name, moves)
    if not moves:
        return None
    if "dt" in given:
        settings.pop("tol", None)
    if "tol" in given:
        settings.pop("dt", None)
    return found.scene, {**settings, **given}


def refuse_other(name, moves):
    """Refuse an option of a path for a motion, or of a motion for a path.

    Raises:
        SceneError: always.
    """
    option = f"--{name.replace('_', '-')}"
    if moves:
        raise SceneError(f"{option} is for an equilibrium path, and this scene is a motion: expected --static as well")
    raise SceneError(
        f"{option} is for a motion, and this scene is an equilibrium path: expected a duration too, under [simulate] "
        "in the file or by --duration, and no --static"
    )


def run_buckling(options, scene, tables):
    """`cosserat buckling`; returns the exit code."""
    from cosserat_fenicsx.statics.linear_buckling import buckling

    return _deliver(options, scene, tables, buckling)


def run_modes(options, scene, tables):
    """`cosserat modes`; returns the exit code."""
    from cosserat_fenicsx.dynamics.natural_modes import modes

    return _deliver(options, scene, tables, modes)


def _deliver(options, scene, tables, compute):
    """Compute, print the table and write the files; returns the exit code."""
    out = Path(options.output) if options.output else None
    if out is not None:
        names = [f"{options.command}.{ending}" for ending in ("csv", "xdmf", "h5", "png")]
        keep_inputs(out, names, options.scene, tables)
        prepare(out)  # fail before the computation, not after it
    for caution in scene.doubts:
        say(f"cosserat: warning: {caution}")
    given = {name: getattr(options, name) for name in ("tol", "elements", "degree")}
    given = {name: value for name, value in given.items() if value is not None}
    try:
        with patience():
            found = compute(scene, options.count, load_factor=options.load_factor, **given)
    except NotConverged as failure:
        say(f"cosserat: {failure}")
        return NOT_CONVERGED
    say(found.details(), file=sys.stdout)
    return DONE if out is None else _write_shapes(found, out, options.command, picture=not options.no_picture)


def _write_shapes(found, out, name, *, picture):
    """Write the table, and the shapes where there are any; returns the exit code."""
    files = {f"{name}.csv": found.write}
    if len(found):
        files |= {f"{name}.xdmf": found.write} | ({f"{name}.png": found.plot} if picture else {})
    written = Files(out)
    try:
        for file, write in files.items():
            written.put(file, write, *([f"{name}.h5"] if file.endswith(".xdmf") else []))
    except KeyboardInterrupt:
        say(f"cosserat: interrupted; completely written to {out}/: {', '.join(written.names) or 'nothing'}")
        return INTERRUPTED
    written.tell()
    return DONE


def _names(name, *more):
    """Names of the files of a path or of a motion."""
    return f"{name}.csv", f"{name}.xdmf", f"{name}.h5", "result.h5", "rods.png", "rods.html", *more


# By whether it is a motion.
_NAMES = {False: _names("path"), True: _names("motion", "energy.png")}


def deliver(computed, options, moving, tables=None):
    """Compute, then print and write the result, or the partial result where the computation fails or is interrupted.

    Args:
        computed: function without arguments that returns a Path or a History.
        options: of the command line.
        moving: whether it is a motion.
        tables: of the scene file, where there is one.

    Returns:
        the exit code.
    """
    from cosserat_fenicsx.checks import positive
    from cosserat_fenicsx.pictures.colours import colour_of

    out, at = None, _numbers(options.at)
    _check_film(options, moving)
    if options.output:
        out = Path(options.output)
        if tables is not None:
            keep_inputs(out, [*_NAMES[moving], *([options.animate] if options.animate else [])], options.scene, tables)
        prepare(out)  # fail before the computation, not after it
    magnify = 1.0 if options.magnify is None else positive("plot", "magnify", options.magnify, "-")
    color = options.color or "bending_moment"
    colour_of(color)
    if at is not None and out is None:
        say("cosserat: --at has no effect without -o DIR, which pictures are written to")

    path, trouble, code = ended(lambda: together(computed))
    if path is not None and len(path):
        station = options.station
        say(path.details(station=station), file=sys.stdout)
        if out is not None:
            film = options.animate if code != INTERRUPTED else None  # a film would take long after an interruption
            if code == INTERRUPTED:
                say("cosserat: interrupted; writing the partial result, Ctrl-C again skips what is not written yet")
            try:
                look = {"magnify": magnify, "color": color, "shown": _shown(path, at)}
                look |= {"film": film, "speed": options.speed}
                with patience():
                    _write(path, out, station, picture=not options.no_picture, stops=code != INTERRUPTED, **look)
            except KeyboardInterrupt:
                trouble, code = "interrupted; what is not written yet is left out", INTERRUPTED
            except (OSError, SceneError) as problem:
                say(f"cosserat: {in_words(problem)}")
                code = code or BAD_INPUT
    if trouble is not None:
        say(f"cosserat: {getattr(trouble, 'words', trouble)}")
        if options.folder and not isinstance(trouble, NotConverged | SceneError):
            say(f"cosserat: `cosserat resume {options.folder}` continues from there")
        elif moving and code == INTERRUPTED:
            say("cosserat: a motion that is run with --folder DIR can be continued by `cosserat resume DIR`")
    return code


def _shown(path, at):
    """Indices of the points or times nearest to the numbers of --at; None without --at."""
    if at is None:
        return None
    along = path.along_axis
    for x in at:
        if not along.min() <= x <= along.max():
            say(f"cosserat: --at {x:g} lies beyond {along.min():g} .. {along.max():g}; the nearest is drawn")
    return sorted({int(abs(along - x).argmin()) for x in at})


def prepare(out):
    """Make the output folder, and check that it can be written to.

    Raises:
        SceneError: it cannot.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as problem:
        raise SceneError(f"output folder {out}: {problem.strerror}: expected a folder that can be written to") from None


def _check_film(options, moving):
    """Refuse options of a film that cannot be made, before the computation."""
    if options.animate is None:
        return
    if not moving or not options.output:
        raise SceneError("--animate: expected a motion, and -o DIR to write its film to")
    from cosserat_fenicsx.pictures.animation import check_name

    if Path(options.animate).name != options.animate:
        raise SceneError(f"--animate {options.animate}: expected a name without folders; it is written to -o DIR")
    check_name(options.animate)


def _write(path, out, station, *, picture, stops, magnify, shown, film, speed, color):
    moving = path.axis == "time"
    name = "motion" if moving else "path"
    files = {
        f"{name}.csv": lambda file: path.write(file, station=station),
        f"{name}.xdmf": path.write,
        "result.h5": path.save,
        "rods.png": picture and (lambda file: path.plot(file, shown, magnify=magnify, color=color)),
        "rods.html": picture and path.write,
        "energy.png": picture and moving and len(path) > 1 and path.plot_energy,
        film: film and len(path) > 1 and (lambda file: path.animate(file, speed=speed, magnify=magnify)),
    }
    written = Files(out, stops)
    try:
        for file, write in files.items():
            if write:
                written.put(file, write, *([f"{name}.h5"] if file.endswith(".xdmf") else []))
    finally:
        written.tell()


def _numbers(text):
    """The numbers of --at."""
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise SceneError(f"--at {text}: expected A,B,...: load factors or times (s)") from None
