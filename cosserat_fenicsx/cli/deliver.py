"""Printing and writing of the results of a command, also of partial ones."""

import tempfile
from pathlib import Path

from cosserat_fenicsx.cli.ended import ended
from cosserat_fenicsx.cli.files import Files, keep_inputs
from cosserat_fenicsx.cli.say import BAD_INPUT, INTERRUPTED, first_rank, in_words, say
from cosserat_fenicsx.cli.together import together
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.interrupts import patience


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
        station = options.station or _default_station(path)
        _report(path, station)
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


def _default_station(path):
    """The station of table and CSV file where none is requested."""
    from cosserat_fenicsx.results.tables import most_displaced

    return most_displaced(path)


def _report(path, station):
    if path.axis == "time":
        from cosserat_fenicsx.results.tables import motion_table as table
    else:
        from cosserat_fenicsx.results.tables import path_table as table

    text = table(path, station)
    if first_rank():
        print(text, flush=True)  # before the messages on stderr that follow


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
