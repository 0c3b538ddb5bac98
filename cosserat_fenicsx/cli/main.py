"""The command line: run a scene file, explain what would be solved.

Only the standard library is imported until a command has to work, so that --help is instant.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from cosserat_fenicsx import __version__, interrupts
from cosserat_fenicsx.errors import CosseratError, Interrupted, NotConverged, SceneError

#: Exit codes.
DONE, NOT_CONVERGED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def main(arguments=None):
    """Entry point of `cosserat`.

    Returns:
        0 done, 1 not converged (the partial path is written), 2 bad input, 130 interrupted (likewise written).
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.command is None:
        parser.print_help()
        return BAD_INPUT
    interrupts.listen()
    try:
        return options.do(options)
    except CosseratError as problem:
        _say(f"cosserat: {problem}")
        return BAD_INPUT
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        _say(f"cosserat: {where}{problem.strerror or problem}")
        return BAD_INPUT


def _parser():
    parser = argparse.ArgumentParser(
        prog="cosserat",
        description="Geometrically exact rods on FEniCSx: equilibrium path or motion of a scene described in a TOML file; a "
        "motion where the file has a [simulate] table, or --duration is given.",
        epilog="Exit codes: 0 done, 1 not converged, 2 bad input, 130 interrupted; after 1 and 130 what was reached is "
        "printed and written. "
        "In parallel: mpirun -n 2 cosserat run scene.toml",
    )
    parser.add_argument("--version", action="version", version=f"cosserat_fenicsx {__version__}")
    commands = parser.add_subparsers(dest="command", title="commands")

    run = commands.add_parser("run", help="solve or simulate a scene; print a table, write files")
    _common(run)
    run.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        help="write path.xdmf, path.h5, path.csv and rods.png there, of a motion motion.xdmf, .h5, .csv, rods.png and "
        "energy.png; without it only the table is shown",
    )
    run.add_argument("--no-picture", action="store_true", help="write no pictures")
    run.add_argument(
        "--magnify", type=float, default=1.0, help="pictures: draw displacements this many times their size [1]"
    )
    run.add_argument(
        "--at", metavar="A,B,...", help="pictures: the load factors or times (s) to draw; the nearest that there are"
    )
    run.add_argument(
        "--animate",
        metavar="NAME",
        nargs="?",
        const="motion.gif",
        help="motions: write a film too, .gif or .mp4 [motion.gif]",
    )
    run.add_argument("--speed", type=float, help="films: seconds of the motion in one second [1 where that suits]")
    run.set_defaults(do=_run)

    buckling = commands.add_parser("buckling", help="critical load factors by linear buckling")
    buckling.add_argument("scene", help="scene file (TOML)")
    buckling.add_argument("--count", type=int, default=3, help="how many [3]")
    buckling.set_defaults(do=_buckling)

    explain = commands.add_parser("explain", help="say which model would be solved and how large it is")
    _common(explain)
    explain.set_defaults(do=_explain)
    return parser


def _common(parser):
    parser.add_argument("scene", help="scene file (TOML)")
    parser.add_argument("--load-factors", metavar="A:B | A,B,...",
                        help="0:1.5 lets the solver choose its steps, 0.5,0.9,1 lands on each")  # fmt: skip
    parser.add_argument("--tol", type=float, help="estimated error of positions over the largest displacement [1e-6]")
    parser.add_argument("--elements", type=int, help="elements per rod; fixes the mesh, no error estimate")
    parser.add_argument("--degree", type=int, help="polynomial degree of r and q, 1 to 4 [4]")
    parser.add_argument("--formulation", help="mixed, displacement or multiplier [mixed]")
    parser.add_argument("--model", help="auto, determinate, planar or spatial [auto]")
    parser.add_argument(
        "--control", help="auto, load (stop at a limit point) or arc (along the path, never back) [auto]"
    )
    parser.add_argument("--branch", type=int, help="1 or -1: leave the path at its first bifurcation")
    parser.add_argument("--static", action="store_true", help="the equilibrium path, whatever [simulate] says")
    motion = parser.add_argument_group("motions (--tol, --elements [8], --degree [3] and --model are theirs too)")
    motion.add_argument("--duration", type=float, help="s; makes a motion of any scene")
    motion.add_argument("--dt", type=float, help="fixed step, s, instead of --tol [1e-3]")
    motion.add_argument("--scheme", help="momentum, energy, ... [momentum]")
    motion.add_argument("--save-every", type=float, help="s between saved states [every step]")
    motion.add_argument(
        "--start", type=float, help="begin at the equilibrium of this load factor, as things are just before t = 0"
    )


def _settings(options):
    """The scene and the arguments of `solve`: those of the file, those of the command line over them."""
    from cosserat_fenicsx.scene.scenefile import read_scene

    scene, settings = read_scene(options.scene)
    for name in ("tol", "elements", "degree", "formulation", "model", "control", "branch"):
        if getattr(options, name) is not None:
            settings[name] = getattr(options, name)
    if options.load_factors is not None:
        settings["load_factors"] = options.load_factors
    load_factors = settings.pop("load_factors", "0:1")
    if isinstance(load_factors, str):
        load_factors = _load_factors(load_factors)
    return scene, load_factors, settings


def _numbers(text):
    """The numbers of --at."""
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise SceneError(f"--at {text}: expected A,B,...: load factors or times (s)") from None


def _load_factors(text):
    separator = ":" if ":" in text else ","
    try:
        values = [float(part) for part in text.split(separator)]
    except ValueError:
        values = []
    if not values or (separator == ":" and len(values) != 2):
        raise SceneError(f"load factors '{text}': expected A:B (the solver chooses its steps) or A,B,... (landed on)")
    return tuple(values) if separator == ":" else values


def _run(options):
    from cosserat_fenicsx.cli.motion import motion_of

    moving = motion_of(options)
    scene, load_factors, settings = (None, None, None) if moving else _settings(options)
    out, at = None, _numbers(options.at)
    if options.output:
        out = Path(options.output)
        _prepare(out)  # before the work, not after it
    _check_film(options, moving)

    code, trouble = DONE, None
    try:
        if moving:
            from cosserat_fenicsx.dynamics.simulate import simulate

            path = simulate(moving[0], **moving[1])
        else:
            from cosserat_fenicsx.statics.solve import solve

            path = solve(scene, load_factors, **settings)
    except NotConverged as failure:
        path, trouble, code = failure.path, failure, NOT_CONVERGED
    except Interrupted as stop:
        path, trouble, code = stop.path, stop, INTERRUPTED
    if path is not None and len(path):
        _report(path)
        if out is not None:
            shown = None if at is None else sorted({int(abs(path.along_axis - x).argmin()) for x in at})
            film = options.animate if code != INTERRUPTED else None  # who stops a run does not wait for its film
            try:
                look = {"magnify": options.magnify, "shown": shown, "film": film, "speed": options.speed}
                _write(path, out, picture=not options.no_picture, **look)
            except KeyboardInterrupt:
                trouble, code = "interrupted; the film ends where it was drawn", INTERRUPTED
    if trouble is not None:
        _say(f"cosserat: {trouble}")
    return code


def _prepare(out):
    """Make the output folder, and see that it can be written to."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as problem:
        raise SceneError(f"output folder {out}: {problem.strerror}: expected a folder that can be written to") from None


def _check_film(options, moving):
    """Refuse a film that could not be made, before the work."""
    if options.animate is None:
        return
    if not moving or not options.output:
        raise SceneError("--animate: expected a motion, and -o DIR to write its film to")
    from cosserat_fenicsx.pictures.animation import check_name

    if Path(options.animate).name != options.animate:
        raise SceneError(f"--animate {options.animate}: expected a name without folders; it is written to -o DIR")
    check_name(options.animate)


def _report(path):
    if path.axis == "time":
        from cosserat_fenicsx.results.motion_tables import motion_table as table
    else:
        from cosserat_fenicsx.results.tables import path_table as table

    text = table(path)
    if _first_rank():
        print(text)


def _write(path, out, *, picture, magnify, shown, film, speed):
    if path.axis == "time":
        from cosserat_fenicsx.cli.motion import write_motion

        written = write_motion(path, out, picture=picture, magnify=magnify, shown=shown, film=film, speed=speed)
    else:
        from cosserat_fenicsx.results.tables import write_csv

        write_csv(path, out / "path.csv")
        path.write(out / "path.xdmf")
        written = ["path.xdmf", "path.h5", "path.csv"]
        if picture:
            path.plot(out / "rods.png", shown, magnify=magnify)
            written.append("rods.png")
    _say(f"written to {out}/: {', '.join(written)}", file=sys.stdout)


def _buckling(options):
    from cosserat_fenicsx.results.tables import buckling_table
    from cosserat_fenicsx.scene.scenefile import read_scene
    from cosserat_fenicsx.statics.linear_buckling import buckling

    scene, _ = read_scene(options.scene)
    try:
        found = buckling(scene, options.count)
    except NotConverged as failure:
        _say(f"cosserat: {failure}")
        return NOT_CONVERGED
    _say(buckling_table(found), file=sys.stdout)
    return DONE


def _explain(options):
    from cosserat_fenicsx.cli.motion import motion_of

    moving = motion_of(options)
    if moving:
        from cosserat_fenicsx.cli.explain_motion import explain_motion

        text = explain_motion(*moving)
    else:
        from cosserat_fenicsx.cli.explain import explain

        text = explain(*_settings(options))
    _say(text, file=sys.stdout)
    return DONE


def _first_rank():
    """True on rank 0, and where MPI was never loaded."""
    if "mpi4py" not in sys.modules:
        return True
    from mpi4py import MPI

    return MPI.COMM_WORLD.rank == 0


def _say(text, file=None):
    if _first_rank():
        print(text, file=file or sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
