"""The command line: run a scene file, explain what would be solved.

Modules beyond the standard library are imported by the commands that need them, so that --help is instant.
"""

import json
import sys
from importlib import import_module
from pathlib import Path

from cosserat_fenicsx import interrupts
from cosserat_fenicsx.cli.options import parser
from cosserat_fenicsx.cli.output import BAD_INPUT, DONE, INTERRUPTED, in_words, say, together, warnings_in_words
from cosserat_fenicsx.errors import CosseratError, SceneError


def main(arguments=None):
    """Entry point of `cosserat`.

    Returns:
        0 done, 1 not converged (the partial path is written), 2 bad input, 130 interrupted (also written).
    """
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
