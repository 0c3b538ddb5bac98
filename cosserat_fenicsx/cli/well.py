"""Strings in wells on the command line: `cosserat run` and `cosserat explain` of a scene with a [well] table."""

import sys
from dataclasses import replace
from functools import partial

from cosserat_fenicsx.cli.output import DONE, deliver, given, output_of, refuse_of_rods, say, units_of
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.storage.store import discard
from cosserat_fenicsx.well.buckled import LockUp
from cosserat_fenicsx.well.scenefile import TorqueAndDragSettings

# Ends of the names of files of an operation, and names of those of a sweep.
_ENDINGS = (".csv", "_contacts.csv", ".png", "_3d.png")
_OF_STRENGTH = ("_strength.csv", "_strength.png", "_overpull.csv", "_weight_on_bit.csv")
_OF_SWEEPS = ("depth_sweep.csv", "depth_sweep", "depth_sweep.png")
# Ends of the names of files of rates of build.
_OF_BUILDS = (".csv", "_holes.csv", ".png")


def _scene(options, scene):
    refuse_of_rods(options, "a well")
    units_of(options)  # refused before the computation
    asked = given(options, ("tol", "model"))
    return replace(scene, torque_and_drag=replace(scene.torque_and_drag or TorqueAndDragSettings(), **asked))


def run(options, scene, tables):
    """`cosserat run` of a `WellScene` and the tables of its file; returns the exit code."""
    scene, stems, picture = _scene(options, scene), _stems(scene.operations), not options.no_picture
    units = units_of(options)
    names = [f"{stem}{ending}" for stem in stems for ending in _ENDINGS + _OF_STRENGTH] + list(_OF_SWEEPS)
    of_builds = ["build_rate"] if len(scene.drilling) == 1 else [f"build_rate_{x}" for x in _stems(scene.drilling)]
    names += [f"{stem}{ending}" for stem in of_builds for ending in _OF_BUILDS]
    out = output_of(options, names, tables)
    if scene.title:
        say(scene.title, file=sys.stdout)

    def files_of(stem, answer):
        csv, contacts, chart, in_space = (f"{stem}{ending}" for ending in _ENDINGS)
        return {
            csv: partial(answer.write, units=units),
            contacts: True,
            chart: picture and partial(answer.plot, units=units),
            in_space: picture and partial(answer.plot_3d, units=units),
        }

    def files_of_strength(stem, found):
        files = {f"{stem}.csv": partial(found.write, units=units)}
        return files | ({f"{stem}.png": partial(found.plot, units=units)} if picture and hasattr(found, "plot") else {})

    for operation, stem in zip(scene.operations, stems, strict=True):
        answers = []

        def solved(operation=operation, answers=answers):
            answers.append(_solved(scene, operation, Units(units)))
            return answers[0]

        code = deliver(solved, options, names, partial(files_of, stem), tables, obeys=False)
        if code != DONE:
            return code
        for name, found in scene.strength.of(answers[0]).items() if scene.strength else ():
            files = partial(files_of_strength, f"{stem}_{name}")
            code = deliver(lambda found=found: found, options, names, files, tables, obeys=False)
            if code != DONE:
                return code
    for operation, stem in zip(scene.drilling if scene.build_rate else (), of_builds, strict=False):

        def files_of_builds(found, stem=stem):
            csv, holes, chart = (f"{stem}{ending}" for ending in _OF_BUILDS)
            drawn = picture and partial(found.plot, units=units)
            return {csv: partial(found.write, units=units), holes: True, chart: drawn}

        code = deliver(partial(scene.builds, operation), options, names, files_of_builds, tables, obeys=False)
        if code != DONE:
            return code
    if scene.depth_sweep is None:
        return DONE
    folder = None if out is None else out / "depth_sweep"

    def swept():
        sweep = scene.swept(folder)
        if folder is not None:  # complete: another run starts from the beginning
            on_first(world(), lambda: discard(folder))
        return sweep

    def files_of_sweep(sweep):
        chart = picture and len(sweep) and partial(sweep.plot, units=units)
        return {"depth_sweep.csv": partial(sweep.write, units=units), "depth_sweep.png": chart}

    return deliver(swept, options, names, files_of_sweep, tables, obeys=False)


def _solved(scene, operation, shown):
    """The answer of an operation; a lock-up is told in the units that are shown."""
    try:
        return scene.answer(operation)
    except LockUp as locked:
        raise SceneError(shown.sentence(str(locked))) from None


def _stems(operations):
    """Names of files; operations of one kind are told apart by numbers."""
    names = [operation.name.replace(" ", "_") for operation in operations]
    return [name + (f"_{names[:i].count(name) + 1}" if name in names[:i] else "") for i, name in enumerate(names)]


def explain(options, scene):
    """The text of `cosserat explain` of a `WellScene`."""
    return _scene(options, scene).details(units_of(options))
