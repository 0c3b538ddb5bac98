"""`cosserat buckling` and `cosserat modes`: a table, and files of the shapes."""

import sys
from pathlib import Path

from cosserat_fenicsx.cli.deliver import prepare
from cosserat_fenicsx.cli.files import Files, keep_inputs
from cosserat_fenicsx.cli.say import DONE, INTERRUPTED, NOT_CONVERGED, say
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import patience


def run_buckling(options):
    """`cosserat buckling`; returns the exit code."""
    from cosserat_fenicsx.results.shapes import buckling_table
    from cosserat_fenicsx.statics.linear_buckling import buckling

    return _deliver(options, buckling, buckling_table)


def run_modes(options):
    """`cosserat modes`; returns the exit code."""
    from cosserat_fenicsx.dynamics.natural_modes import modes
    from cosserat_fenicsx.results.shapes import modes_table

    return _deliver(options, modes, modes_table)


def _deliver(options, compute, table):
    """Compute, print the table and write the files; returns the exit code."""
    from cosserat_fenicsx.scene.scenefile import read_scene
    from cosserat_fenicsx.scene.toml_tables import tables_of

    scene, _ = read_scene(options.scene)
    out = Path(options.output) if options.output else None
    if out is not None:
        names = [f"{options.command}.{ending}" for ending in ("csv", "xdmf", "h5", "png")]
        keep_inputs(out, names, options.scene, tables_of(options.scene))
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
    say(table(found), file=sys.stdout)
    return DONE if out is None else _write(found, out, options.command, picture=not options.no_picture)


def _write(found, out, name, *, picture):
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
