"""Strings in wells on the command line: `cosserat run` and `cosserat explain` of a scene with a [well] table."""

import sys
from dataclasses import replace
from functools import partial

from cosserat_fenicsx.cli.output import deliver, given, output_of, refuse_of_rods, units_of
from cosserat_fenicsx.cli.say import DONE, say
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.storage.store import discard
from cosserat_fenicsx.well.buckled import LockUp
from cosserat_fenicsx.well.scenefile import TorqueAndDragSettings

# Ends of the names of files of an operation, and names of those of a sweep.
_ENDINGS = (".csv", "_contacts.csv", ".png", "_3d.png")
_OF_SWEEPS = ("depth_sweep.csv", "depth_sweep", "depth_sweep.png")
_SOFT = (
    "the soft string by a differential equation along the axis, and what that leaves out is estimated with each answer."
)
_ROD = "the exact rod in contact with the wall, stiff and with its clearance, on meshes that are refined until tol."
#: What the models of `torque_and_drag` solve.
_MODELS = {
    "soft": _SOFT,
    "buckled": f"{_SOFT[:-1]}; with the wall force of a helix where it is one.",
    "rod": _ROD,
    "auto": f"first {_SOFT} Where that is above tol: {_ROD}",
}


def _scene(options, scene):
    refuse_of_rods(options, "a well")
    units_of(options)  # refused before the computation
    asked = given(options, ("tol", "model"))
    return replace(scene, torque_and_drag=replace(scene.torque_and_drag or TorqueAndDragSettings(), **asked))


def run(options, scene, tables):
    """`cosserat run` of a `WellScene` and the tables of its file; returns the exit code."""
    scene, stems, picture = _scene(options, scene), _stems(scene.operations), not options.no_picture
    units = units_of(options)
    names = [f"{stem}{ending}" for stem in stems for ending in _ENDINGS] + list(_OF_SWEEPS)
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

    for operation, stem in zip(scene.operations, stems, strict=True):
        solved = partial(_solved, scene, operation, Units(units))
        code = deliver(solved, options, names, partial(files_of, stem), tables, obeys=False)
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
    scene = _scene(options, scene)
    shown = Units(units_of(options))
    lines = [scene.title] if scene.title else []
    lines += [scene.hole.path_in_words(shown), *scene.hole.sections_in_words(shown)]
    lines += [] if scene.mud is None else [scene.mud.in_words()]
    lines += scene.string.in_words(scene.settings.get("depth", scene.hole.length), scene.mud, shown)
    for operation in scene.operations:
        on_bit = f"{shown.told(operation.weight, 'N')} and {shown.told(operation.torque, 'N m')}"
        lines.append(f"Operation: {operation.name}, on bit {on_bit}.")
    if scene.sweep:
        lines.append(f"Sweep over {len(scene.sweep['depths'])} depths of the bit.")
    model, tol = scene.settings.get("model", "auto"), scene.settings.get("tol", 1e-4)
    lines.append(f"Model: {model}, tol = {tol:g}: {_MODELS[model]}")
    return "\n".join(lines)
