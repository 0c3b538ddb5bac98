"""The command line, its commands and options: run a scene file, explain what would be solved.

Modules beyond the standard library are imported by the commands that need them, so that --help is instant.
"""

import argparse
import json
import sys
from importlib import import_module
from pathlib import Path

from cosserat_fenicsx import __version__, interrupts
from cosserat_fenicsx.cli.output import BAD_INPUT, DONE, INTERRUPTED, in_words, say, together, warnings_in_words
from cosserat_fenicsx.errors import CosseratError, SceneError, nearest

# What to use in place of commands that do not exist.
_RELATED = dict.fromkeys(("plot", "draw", "view", "show", "picture"), "`cosserat run SCENE -o DIR` draws pictures")
_RELATED |= dict.fromkeys(("solve", "simulate"), "`cosserat run SCENE` does that")


class _Parser(argparse.ArgumentParser):
    """Prints by one rank, and says nothing where its reader, such as `head`, has gone."""

    def _check_value(self, action, value):
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError:
            hint = _RELATED.get(value) or nearest(value, action.choices)
            raise argparse.ArgumentError(action, f"invalid choice: {value!r}: {hint}") from None

    def _print_message(self, message, file=None):
        say(message.rstrip("\n"), file)


def parser():
    """The argument parser; `command` of its options is the name of the command, None without one."""
    whole = _Parser(
        prog="cosserat",
        description="Geometrically exact rods on FEniCSx: equilibrium path or motion of a scene described in a TOML "
        "file; a motion where the file has a [simulate] table, or --duration is given. A file with a [well] is a "
        "string in its well, one with a [drive] a drill-string in motion.",
        epilog="Exit codes: 0 done, 1 not converged, 2 bad input, 130 interrupted; after 1 and 130 the partial result "
        "is printed and written. "
        "In parallel: mpirun -n 2 cosserat run scene.toml",
    )
    whole.add_argument("--version", action="version", version=f"cosserat_fenicsx {__version__}")
    commands = whole.add_subparsers(dest="command", title="commands")

    run = commands.add_parser("run", help="solve or simulate a scene; print a table, write files")
    _common(run).add_argument("--folder", metavar="DIR",
                              help="write the motion there during the run; whatever ends it, `cosserat resume DIR` "
                              "continues it")  # fmt: skip
    _outputs(run)

    resume = commands.add_parser("resume", help="continue a motion that was run with --folder, to the same digits")
    resume.add_argument("folder", help="the DIR of --folder")
    resume.add_argument("--duration", type=float, help="s; longer than before")
    _units(resume)
    _outputs(resume)

    buckling = commands.add_parser("buckling", help="critical load factors by linear buckling")
    _eigenvalues(buckling, "buckling", 3, "1e-5")

    modes = commands.add_parser("modes", help="modes about any equilibrium or steady rotation, damped or not")
    _eigenvalues(modes, "modes", 5, "1e-6")
    modes.add_argument("--damped", action=argparse.BooleanOptionalAction,
                       help="complex modes [where something damps, rotates or follows]")  # fmt: skip
    modes.add_argument("--near", type=complex, metavar="Z",
                       help="complex modes nearest this eigenvalue, 1/s, such as --near=-1+50j")  # fmt: skip

    explain = commands.add_parser("explain", help="say which model would be solved and how large it is")
    _common(explain)

    schema = commands.add_parser("schema", help="print the JSON Schema of scene files, for editors")
    schema.add_argument("modules", nargs="*", metavar="MODULE", help="modules of your own classes, as in `use`")
    return whole


def _of_scene(parser, tol):
    """Add the scene and the options that all computations of rods share; `tol`: the help of --tol."""
    parser.add_argument("scene", help="scene file (TOML)")
    parser.add_argument("--tol", type=float, help=tol)
    parser.add_argument("--elements", type=int, help="elements per rod; fixes the mesh, no error estimate")
    parser.add_argument("--degree", type=int, help="polynomial degree of r and q, 1 to 4 [4]")


def _eigenvalues(parser, name, count, tol):
    """Add the options of `buckling` or `modes`, with their defaults."""
    _of_scene(parser, f"estimated relative error of the eigenvalues [{tol}]")
    parser.add_argument("--count", type=int, default=count, help=f"how many [{count}]")
    parser.add_argument("--load-factor", type=float, default=0.0, help="of the equilibrium [0: the unloaded rods]")
    _units(parser)
    _output(parser, f"{name}.csv, {name}.xdmf, {name}.h5 and {name}.png")


def _output(parser, files):
    """Add the options of the output folder; `files`: what is written there."""
    parser.add_argument("-o", "--output", metavar="DIR",
                        help=f"write {files} there; without it only the table is shown")  # fmt: skip
    parser.add_argument("--no-picture", action="store_true", help="write no pictures")


def _outputs(parser):
    """Add the options on output files and pictures of a path or a motion."""
    _output(parser, "path.xdmf, path.h5, path.csv, rods.png and rods.html, or of a motion motion.xdmf, .h5, .csv, "
            "rods.png, rods.html and energy.png, and result.h5, which read_result of Python reads; of a "
            "string in a well a .csv and pictures for each operation and for the depth_sweep; of a drill-string in "
            "motion drilling.csv, charts, stability.csv and response.csv")  # fmt: skip
    parser.add_argument("--color", metavar="FIELD",
                        help="rods.png and films: field that colours the rods, such as shear_force or m.x "
                        "[tension of cables, else what stores most energy and varies]")  # fmt: skip
    parser.add_argument("--magnify", type=float, help="pictures: factor on displacements [1]")
    parser.add_argument("--station", metavar="ROD@S",
                        help="station of the table: rod.end, rod@1.5 (m) [of the ends, loads and supports the one that "
                        "moves most]")  # fmt: skip
    parser.add_argument("--at", metavar="A,B,...",
                        help="pictures: the load factors or times (s) to draw; the nearest computed ones")  # fmt: skip
    parser.add_argument("--animate", metavar="NAME", type=_film, nargs="?", const="motion.gif",
                        help="motions: write a film too, .gif or .mp4 [motion.gif]")  # fmt: skip
    parser.add_argument("--speed", type=float,
                        help="films: seconds of the motion per second [1 for motions of 2 to 10 s]")  # fmt: skip


def _units(parser):
    parser.add_argument("--units", metavar="SI | field | kN,mm,...",
                        help="of tables, pictures and .csv files; field: ft, in, klbf, ft-lbf, ppg, rpm, psi; or some, "
                        "with SI for all others [SI]")  # fmt: skip


def _film(name):
    """The name of a film; --animate without a name would take the argument after it, such as the scene file."""
    if Path(name).suffix == ".toml":
        raise argparse.ArgumentTypeError(f"{name} is no film: put the scene before --animate")
    return name


def _common(parser):
    """Add the scene and the options of `solve` and `simulate`; returns the group of a motion's options."""
    _of_scene(parser, "largest estimated error of positions, rotations, contact forces and moments, each over its "
              "largest value [1e-6]; of a motion that of its steps, over the longest rod's length [1e-3]; of a string "
              "in a well that of hook load and torque [1e-4]")  # fmt: skip
    parser.add_argument("--load-factors", metavar="A:B | A,B,...",
                        help="0:1.5 lets the solver choose its steps, 0.5,0.9,1 reaches each exactly; negative ones "
                        "with =, --load-factors=-1:1")  # fmt: skip
    parser.add_argument("--bound", metavar="A,B,...", type=lambda text: text.split(","),
                        help="what --tol bounds of a path: position, rotation, force, moment [all]")  # fmt: skip
    parser.add_argument("--formulation", help="mixed, displacement or multiplier [mixed]")
    parser.add_argument("--model", help="auto, determinate, planar or spatial; of a string in a well auto, "
                        "soft, 'buckled' or rod [auto]; of a drill-string in motion auto, torsion or 'axial and "
                        "torsional' [auto]")  # fmt: skip
    parser.add_argument("--control", help="auto, load (stop at a limit point) or arc (arc length along the path, never "
                        "back) [auto]")  # fmt: skip
    parser.add_argument("--branch", type=int, help="1 or -1: leave the path at its first bifurcation")
    _units(parser)
    parser.add_argument("--details", action="store_true", help="of a string in a well with several operations: longer "
                        "tables and all sentences of each")  # fmt: skip
    parser.add_argument("--static", action="store_true", help="the equilibrium path, whatever [simulate] says")
    motion = parser.add_argument_group("motions (--tol, --elements [8], --degree [3] and --model are theirs too)")
    motion.add_argument("--duration", type=float, help="s; makes a motion of any scene")
    motion.add_argument("--dt", type=float, help="fixed step, s, instead of --tol [1e-3]")
    motion.add_argument("--scheme", help="momentum, energy, triple-jump or generalised-alpha [momentum]")
    motion.add_argument("--save-every", type=float, help="s between saved states [every step]")
    motion.add_argument("--estimate", action="store_true", default=None, help="estimate the error of positions, by "
                        "another motion with half as many elements and steps")  # fmt: skip
    motion.add_argument("--start", type=float, help="begin at the equilibrium for this load factor of the scene just "
                        "before t = 0")  # fmt: skip
    return motion


def main(arguments=None):
    """Entry point of `cosserat`: 0 done, 1 not converged (a partial path is written), 2 bad input, 130 interrupted."""
    whole = parser()
    options = whole.parse_args(arguments)
    if options.command is None:
        whole.print_help()
        return BAD_INPUT
    interrupts.listen()
    for stream in (sys.stdout, sys.stderr):  # a terminal may not know all letters of a title
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    try:
        with warnings_in_words():
            return together(lambda: _DO.get(options.command, _of_a_scene)(options))
    except KeyboardInterrupt:  # of commands without partial results; `deliver` handles paths and motions
        if not interrupts.asked():  # else it was said at the signal
            say("cosserat: interrupted")
        return INTERRUPTED
    except Exception as problem:
        if interrupts.asked():  # Ctrl-C also ends a compiler at work, and imports in C raise other exceptions then
            return INTERRUPTED
        if isinstance(problem, MemoryError):
            say(f"cosserat: not enough memory ({in_words(problem)}): expected a smaller problem, or more memory")
            return BAD_INPUT
        if not isinstance(problem, CosseratError | OSError):
            raise
        say(f"cosserat: {in_words(problem)}")
        return BAD_INPUT


def _of_a_scene(options):
    """`run`, `explain`, `buckling` and `modes` of a scene file, in the module of its kind."""
    from cosserat_fenicsx.files.read import kind_of, read_with_tables

    found, tables = read_with_tables(options.scene)
    kind = kind_of(tables)
    module = import_module(f"cosserat_fenicsx.cli.{kind}")
    if options.command == "run":
        return module.run(options, found, tables)
    if options.command == "explain":
        say(module.explain(options, found), file=sys.stdout)
        return DONE
    if kind == "rods":
        return module.eigenvalues(options, found, tables)
    words = {"well": "a string in a well", "drilling": "a drill-string in motion: `cosserat run` with a table "
             "[stability] computes its modes"}  # fmt: skip
    raise SceneError(f"cosserat {options.command} is for rods, and {options.scene} is {words[kind]}")


def _resume(options):
    folder = Path(options.folder)
    if not folder.is_dir():
        raise SceneError(
            f"{folder}: no motion was found there, there is no such folder: expected the DIR of "
            "`cosserat run ... --folder DIR`"
        )
    from cosserat_fenicsx.storage.store import Store, resume

    store, computed = Store(folder, None).open(), lambda: resume(options.folder, duration=options.duration)
    if store.home.__name__.startswith("cosserat_fenicsx.drilling"):
        from cosserat_fenicsx.cli.drilling import deliver_motion

        return deliver_motion(computed, options)
    if options.station:
        store.home.read(store, None).station(options.station)  # refused before the computation
    from cosserat_fenicsx.cli.rods import deliver_rods

    return deliver_rods(computed, options, True)


def _schema(options):
    from cosserat_fenicsx.files.read import schema_of_files
    from cosserat_fenicsx.parts import use

    use(options.modules)
    say(json.dumps(schema_of_files(), indent=1), file=sys.stdout)
    return DONE


_DO = {"resume": _resume, "schema": _schema}

if __name__ == "__main__":
    sys.exit(main())
