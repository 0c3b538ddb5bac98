"""`cosserat buckling` and `cosserat modes`: a table, and files of the shapes."""

import sys
from pathlib import Path

from cosserat_fenicsx.cli.deliver import prepare
from cosserat_fenicsx.cli.say import DONE, INTERRUPTED, NOT_CONVERGED, say
from cosserat_fenicsx.errors import NotConverged


def run_buckling(options):
    """`cosserat buckling`; returns the exit code."""
    from cosserat_fenicsx.results.shape_tables import buckling_table
    from cosserat_fenicsx.statics.linear_buckling import buckling

    return _deliver(options, buckling, buckling_table)


def run_modes(options):
    """`cosserat modes`; returns the exit code."""
    from cosserat_fenicsx.dynamics.natural_modes import modes
    from cosserat_fenicsx.results.shape_tables import modes_table

    return _deliver(options, modes, modes_table)


def _deliver(options, compute, table):
    """Compute, print the table and write the files; returns the exit code."""
    from cosserat_fenicsx.scene.scenefile import read_scene

    scene, _ = read_scene(options.scene)
    out = Path(options.output) if options.output else None
    if out is not None:
        prepare(out)  # fail before the computation, not after it
    for caution in scene.doubts:
        say(f"cosserat: {caution}")
    given = {name: getattr(options, name) for name in ("tol", "elements", "degree")}
    given = {name: value for name, value in given.items() if value is not None}
    try:
        found = compute(scene, options.count, load_factor=options.load_factor, **given)
    except NotConverged as failure:
        say(f"cosserat: {failure}")
        return NOT_CONVERGED
    say(table(found), file=sys.stdout)
    if out is None:
        return DONE
    try:
        _write(found, out, options.command, picture=not options.no_picture)
    except KeyboardInterrupt:
        say("cosserat: interrupted; the file that was being written is incomplete")
        return INTERRUPTED
    return DONE


def _write(found, out, name, *, picture):
    """Write the table, and the shapes where there are any."""
    written = [f"{name}.csv"]
    found.write(out / f"{name}.csv")
    if len(found):
        found.write(out / f"{name}.xdmf")
        written += [f"{name}.xdmf", f"{name}.h5"]
        if picture:
            found.plot(out / f"{name}.png")
            written.append(f"{name}.png")
    say(f"written to {out}/: {', '.join(written)}", file=sys.stdout)
