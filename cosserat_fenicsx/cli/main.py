"""The command line: run a scene file, explain what would be solved.

Modules beyond the standard library are imported by the commands that need them, so that --help is instant.
"""

import json
import sys
import warnings
from pathlib import Path

from cosserat_fenicsx import interrupts
from cosserat_fenicsx.cli.options import parser
from cosserat_fenicsx.cli.rods import deliver, run_buckling, run_modes
from cosserat_fenicsx.cli.say import BAD_INPUT, DONE, INTERRUPTED, in_words, say, together, warnings_in_words
from cosserat_fenicsx.errors import CosseratError, SceneError, SceneWarning


def main(arguments=None):
    """Entry point of `cosserat`.

    Returns:
        0 done, 1 not converged (the partial path is written), 2 bad input, 130 interrupted (likewise written).
    """
    whole = parser({"run": _run, "resume": _resume, "buckling": _rods_alone(run_buckling),
                    "modes": _rods_alone(run_modes), "explain": _explain, "schema": _schema})  # fmt: skip
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
            return together(lambda: options.do(options))
    except KeyboardInterrupt:  # of commands without partial results; `deliver` handles paths and motions
        say("cosserat: interrupted")
        return INTERRUPTED
    except Exception as problem:
        if interrupts.asked():  # Ctrl-C also ends a compiler at work, and imports in C raise other exceptions then
            say("cosserat: interrupted")
            return INTERRUPTED
        if isinstance(problem, MemoryError):
            say(f"cosserat: not enough memory ({in_words(problem)}): expected a smaller problem, or more memory")
            return BAD_INPUT
        if not isinstance(problem, CosseratError | OSError):
            raise
        say(f"cosserat: {in_words(problem)}")
        return BAD_INPUT


def _rods_alone(do):
    """A command that refuses scenes of strings."""

    def command(options):
        from cosserat_fenicsx.files.read import kind_of, read_with_tables

        found, tables = read_with_tables(options.scene)
        if kind_of(tables) == "drilling":
            raise SceneError(f"cosserat {options.command} is for rods, and {options.scene} is a drill-string in "
                             "motion: `cosserat run` with a table [stability] computes its modes")  # fmt: skip
        if kind_of(tables) == "well":
            raise SceneError(f"cosserat {options.command} is for rods, and {options.scene} is a string in a well")
        return do(options, found.scene, tables)

    return command


def _settings(options, found):
    """The scene and the arguments of `solve`: options of the command line replace those of the file."""
    from cosserat_fenicsx.files.rods import load_factors_in

    settings = found.settings
    for name in ("tol", "bound", "elements", "degree", "formulation", "model", "control", "branch"):
        if getattr(options, name) is not None:
            settings[name] = getattr(options, name)
    if options.load_factors is not None:
        settings["load_factors"] = load_factors_in(options.load_factors)
    return found.scene, settings.pop("load_factors", (0.0, 1.0)), settings


def _run(options):
    from cosserat_fenicsx.cli.rods import motion_of
    from cosserat_fenicsx.files.read import kind_of, read_with_tables

    found, tables = read_with_tables(options.scene)
    if kind_of(tables) == "drilling":
        from cosserat_fenicsx.cli.drilling import run_drilling

        return run_drilling(options, found, tables)
    if kind_of(tables) == "well":
        from cosserat_fenicsx.cli.well import run_well

        return run_well(options, found, tables)
    moving = motion_of(options, found)
    scene, load_factors, settings = (found.scene, None, None) if moving else _settings(options, found)
    if options.station:
        scene.station(options.station)  # refused before the computation
    for caution in scene.doubts if moving else scene.cautions:
        say(f"cosserat: warning: {caution}")

    def computed():
        if moving:
            from cosserat_fenicsx.dynamics.simulate import simulate

            return simulate(moving[0], **moving[1])
        from cosserat_fenicsx.statics.solve import solve

        return solve(scene, load_factors, **settings)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # said above, in the words of the command line
        return deliver(computed, options, bool(moving), tables)


def _resume(options):
    folder = Path(options.folder)
    if not folder.is_dir():
        raise SceneError(
            f"{folder}: no motion was found there, there is no such folder: expected the DIR of "
            "`cosserat run ... --folder DIR`"
        )
    from cosserat_fenicsx.storage.store import Store, resume

    store = Store(folder, None).open()
    if store.home.__name__.startswith("cosserat_fenicsx.drilling"):
        from cosserat_fenicsx.cli.drilling import resume_run

        return resume_run(options)
    if options.station:
        store.home.read(store, None).station(options.station)  # refused before the computation

    return deliver(lambda: resume(options.folder, duration=options.duration), options, True)


def _explain(options):
    from cosserat_fenicsx.cli.rods import motion_of
    from cosserat_fenicsx.files.read import kind_of, read_with_tables

    found, tables = read_with_tables(options.scene)
    if kind_of(tables) == "drilling":
        from cosserat_fenicsx.cli.drilling import explain_drilling

        say(explain_drilling(options, found), file=sys.stdout)
        return DONE
    if kind_of(tables) == "well":
        from cosserat_fenicsx.cli.well import explain_well

        say(explain_well(options, found), file=sys.stdout)
        return DONE
    moving = motion_of(options, found)
    if moving:
        from cosserat_fenicsx.cli.explain import explain_motion

        scene, text = moving[0], explain_motion(*moving)
    else:
        from cosserat_fenicsx.cli.explain import explain

        scene, *asked = _settings(options, found)
        text = explain(scene, *asked)
    for doubt in scene.doubts:
        say(f"cosserat: warning: {doubt}")
    say(text, file=sys.stdout)
    return DONE


def _schema(options):
    from cosserat_fenicsx.files.read import schema_of_files
    from cosserat_fenicsx.parts import use

    use(options.modules)
    say(json.dumps(schema_of_files(), indent=1), file=sys.stdout)
    return DONE


if __name__ == "__main__":
    sys.exit(main())
