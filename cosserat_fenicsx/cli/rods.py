"""Rods on the command line: equilibrium paths, motions, buckling loads and natural modes, and their files."""

import warnings
from functools import partial

from cosserat_fenicsx.cli.output import deliver, given, say, units_of
from cosserat_fenicsx.errors import SceneError, SceneWarning

# Options of a motion, of an equilibrium path and of both: names of arguments of `simulate` and `solve`.
_MOTION, _PATH = (
    ("duration", "dt", "scheme", "save_every", "start", "estimate", "folder"),
    ("load_factors", "bound", "formulation", "control", "branch"),
)
_BOTH = ("tol", "elements", "degree", "model")


def _asked(options, found):
    """Whether a motion is requested, and the arguments of `simulate` or `solve`: options replace those of the file."""
    asked, motion = given(options, (*_MOTION, *_PATH, *_BOTH)), found.motion
    moves = not options.static and bool(motion or "duration" in asked)
    for name in (name for name in (_PATH if moves else _MOTION) if name in asked):
        option, kinds = f"--{name.replace('_', '-')}", ["an equilibrium path", "a motion"]
        expected = "a duration too, under [simulate] in the file or by --duration, and no --static"
        expected = "--static as well" if moves else expected
        raise SceneError(f"{option} is for {kinds[not moves]}, and this scene is {kinds[moves]}: expected {expected}")
    if moves:
        replaced = {"dt": "tol", "tol": "dt"}
        return True, {**{name: x for name, x in motion.items() if replaced.get(name) not in asked}, **asked}
    if "load_factors" in asked:
        from cosserat_fenicsx.scene.stages import load_factors_in

        asked["load_factors"] = load_factors_in(asked["load_factors"])
    return False, {"load_factors": (0.0, 1.0), **found.settings, **asked}


def run(options, found, tables):
    """`cosserat run` of a `RodScene` and the tables of its file; returns the exit code."""
    (moving, settings), scene = _asked(options, found), found.scene
    if options.station:
        scene.station(options.station)  # refused before the computation
    for caution in scene.doubts if moving else scene.cautions:
        say(f"cosserat: warning: {caution}")

    def computed():
        if moving:
            from cosserat_fenicsx.dynamics.simulate import simulate as compute
        else:
            from cosserat_fenicsx.statics.solve import solve as compute
        return compute(scene, **settings)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # said above, in the words of the command line
        return deliver_rods(computed, options, moving, tables)


def explain(options, found):
    """The text of `cosserat explain` of a `RodScene`."""
    from cosserat_fenicsx.cli import explain as sentences

    (moving, settings), scene = _asked(options, found), found.scene
    if units_of(options) != "SI":
        raise SceneError("--units: `cosserat explain` tells rods in SI, `cosserat run` in any units")
    if moving:
        text = sentences.explain_motion(scene, settings)
    else:
        text = sentences.explain(scene, settings.pop("load_factors"), settings)
    for doubt in scene.doubts:
        say(f"cosserat: warning: {doubt}")
    return text


def eigenvalues(options, found, tables):
    """`cosserat buckling` and `cosserat modes` of a `RodScene`; returns the exit code."""
    if options.command == "buckling":
        from cosserat_fenicsx.statics.linear_buckling import buckling as compute
    else:
        from cosserat_fenicsx.statics.natural_modes import modes as compute
    name, more = options.command, ("damped", "near") if options.command == "modes" else ()
    settings = given(options, ("tol", "elements", "degree", *more))

    units = units_of(options)

    def files(result):
        return {
            f"{name}.csv": partial(result.write, units=units),
            f"{name}.xdmf": len(result) and result.write,
            f"{name}.h5": bool(len(result)),
            f"{name}.png": len(result) and not options.no_picture and partial(result.plot, units=units),
        }

    names = [f"{name}.{ending}" for ending in ("csv", "xdmf", "h5", "png")]
    computed = partial(compute, found.scene, options.count, load_factor=options.load_factor, **settings)
    return deliver(computed, options, names, files, tables)


def deliver_rods(computed, options, moving, tables=None):
    """Deliver a `Path`, or a `History` of a motion, see `deliver`."""
    from cosserat_fenicsx.checks import positive
    from cosserat_fenicsx.pictures.drawing import colour_of

    units = units_of(options)
    at, color, picture = _numbers(options.at), options.color, not options.no_picture
    magnify = 1.0 if options.magnify is None else positive("plot", "magnify", options.magnify, "-")
    if color is not None:
        colour_of(color)
    if at is not None and not options.output:
        say("cosserat: --at has no effect without -o DIR, which pictures are written to")
    name, film = "motion" if moving else "path", options.animate

    def files(path):
        shown, several = _shown(path, at), moving and len(path) > 1
        return {
            f"{name}.csv": partial(path.write, station=options.station, units=units),
            f"{name}.xdmf": path.write,
            f"{name}.h5": True,
            "result.h5": path.save,
            "rods.png": picture and (lambda file: path.plot(file, shown, magnify=magnify, color=color, units=units)),
            "rods.html": picture and partial(path.write, magnify=magnify, units=units),
            "energy.png": picture and several and partial(path.plot_energy, units=units),
            film: film and several
            and partial(path.animate, speed=options.speed, magnify=magnify, color=color, units=units),
        }

    names = [f"{name}.csv", f"{name}.xdmf", f"{name}.h5", "result.h5", "rods.png", "rods.html"]
    return deliver(computed, options, [*names, *(["energy.png"] if moving else [])], files, tables, moving=moving)


def _shown(path, at):
    """Indices of the points or times nearest to the numbers of --at; None without --at."""
    if at is None:
        return None
    along = path.along_axis
    for x in at:
        if not along.min() <= x <= along.max():
            say(f"cosserat: --at {x:g} lies beyond {along.min():g} .. {along.max():g}; the nearest is drawn")
    return sorted({int(abs(along - x).argmin()) for x in at})


def _numbers(text):
    """The numbers of --at."""
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise SceneError(f"--at {text}: expected A,B,...: load factors or times (s)") from None
