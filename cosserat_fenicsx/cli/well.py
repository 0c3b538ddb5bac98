"""Strings in wells on the command line: `cosserat run` and `cosserat explain` of a scene with a [well] table."""

import sys
from dataclasses import replace
from functools import partial

from cosserat_fenicsx.cli.output import DONE, charted, deliver, given, output_of, refuse_of_rods, say, units_of
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.storage.store import discard
from cosserat_fenicsx.well.criteria import LockUp
from cosserat_fenicsx.well.scenefile import TorqueAndDragSettings
from cosserat_fenicsx.well.tables import of_operations

# Ends of the names of files of an operation, and of rates of build; names of those of a sweep.
_ENDINGS = (".csv", "_contacts.csv", ".png", "_3d.png", "_strength.csv", "_strength.png", "_overpull.csv",
            "_weight_on_bit.csv")  # fmt: skip
_OF_BUILDS = (".csv", "_holes.csv", ".png")
_OF_SWEEPS = ("depth_sweep.csv", "depth_sweep", "depth_sweep.png")


def _scene(options, scene):
    refuse_of_rods(options, "a well")
    units_of(options)  # refused before the computation
    asked = given(options, ("tol", "model"))
    return replace(scene, torque_and_drag=replace(scene.torque_and_drag or TorqueAndDragSettings(), **asked))


def run(options, scene, tables):
    """`cosserat run` of a `WellScene` and the tables of its file; returns the exit code."""
    scene, stems = _scene(options, scene), _stems(scene.operations)
    of_builds = ["build_rate"] if len(scene.drilling) == 1 else [f"build_rate_{x}" for x in _stems(scene.drilling)]
    names = [f"{stem}{ending}" for stem in stems for ending in _ENDINGS] + list(_OF_SWEEPS)
    names += [f"{stem}{ending}" for stem in of_builds for ending in _OF_BUILDS]
    out = output_of(options, names, tables)
    if scene.title:
        say(scene.title, file=sys.stdout)
    options.brief = len(scene.operations) > 1 and not getattr(options, "details", False)
    if options.brief:
        say("The answers of several operations in short; --details prints all sentences and longer tables.",
            file=sys.stdout)  # fmt: skip
    for computed, files_of in _results(options, scene, stems, of_builds, out):
        code = deliver(computed, options, names, files_of, tables, obeys=False)
        if code != DONE:
            return code
    return DONE


def _results(options, scene, stems, of_builds, out):
    """(a function that computes a result, one of the result that returns its files) of all that the file asks for."""
    units = units_of(options)

    def files_of(stem, answer):
        in_space = not options.no_picture and partial(answer.plot_3d, units=units)
        return charted(stem, options, answer, beside=["_contacts"]) | {f"{stem}_3d.png": in_space}

    answers, uses = [], []
    for operation, stem in zip(scene.operations, stems, strict=True):

        def solved(operation=operation):
            answers.append(_solved(scene, operation, Units(units)))
            return answers[-1]

        yield solved, partial(files_of, stem)
        for name, found in scene.strength.of(answers[-1]).items() if scene.strength else ():
            uses += [found] if name == "strength" else []
            yield lambda found=found: found, partial(charted, f"{stem}_{name}", options)
    if len(answers) > 1:
        say(of_operations(answers, uses, Units(units)), file=sys.stdout)
    for operation, stem in zip(scene.drilling if scene.build_rate else (), of_builds, strict=False):
        yield partial(scene.builds, operation), partial(charted, stem, options, beside=["_holes"])
    folder = None if out is None else out / "depth_sweep"

    def swept():
        sweep = scene.swept(folder)
        if folder is not None:  # complete: another run starts from the beginning
            on_first(world(), lambda: discard(folder))
        return sweep

    if scene.depth_sweep is not None:
        yield swept, partial(charted, "depth_sweep", options)


def _solved(scene, operation, shown):
    """The answer of an operation; the message of a lock-up has the units that are shown."""
    try:
        return scene.answer(operation)
    except LockUp as locked:
        raise SceneError(shown.sentence(str(locked))) from None


def _stems(operations):
    """Names of files; operations of one kind are numbered."""
    names = [operation.name.replace(" ", "_") for operation in operations]
    return [name + (f"_{names[:i].count(name) + 1}" if name in names[:i] else "") for i, name in enumerate(names)]


def explain(options, scene):
    """The text of `cosserat explain` of a `WellScene`."""
    return _scene(options, scene).details(units_of(options))
