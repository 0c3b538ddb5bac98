"""Strings in wells on the command line: `cosserat run` and `cosserat explain` of a scene with a [well] table."""

import math
import sys
from dataclasses import replace
from functools import partial

import numpy as np

from cosserat_fenicsx import units
from cosserat_fenicsx.cli.output import deliver, given, output_of, refuse_of_rods
from cosserat_fenicsx.cli.say import DONE, say
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.storage.store import discard
from cosserat_fenicsx.well.components import weight_in_mud
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
    asked = given(options, ("tol", "model"))
    return replace(scene, torque_and_drag=replace(scene.torque_and_drag or TorqueAndDragSettings(), **asked))


def run(options, scene, tables):
    """`cosserat run` of a `WellScene` and the tables of its file; returns the exit code."""
    scene, stems, picture = _scene(options, scene), _stems(scene.operations), not options.no_picture
    names = [f"{stem}{ending}" for stem in stems for ending in _ENDINGS] + list(_OF_SWEEPS)
    out = output_of(options, names, tables)
    if scene.title:
        say(scene.title, file=sys.stdout)

    def files_of(stem, answer):
        csv, contacts, chart, in_space = (f"{stem}{ending}" for ending in _ENDINGS)
        return {csv: answer.write, contacts: True, chart: picture and answer.plot, in_space: picture and answer.plot_3d}

    for operation, stem in zip(scene.operations, stems, strict=True):
        solved = partial(scene.answer, operation)
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
        return {"depth_sweep.csv": sweep.write, "depth_sweep.png": picture and len(sweep) and sweep.plot}

    return deliver(swept, options, names, files_of_sweep, tables, obeys=False)


def _stems(operations):
    """Names of files; operations of one kind are told apart by numbers."""
    names = [operation.name.replace(" ", "_") for operation in operations]
    return [name + (f"_{names[:i].count(name) + 1}" if name in names[:i] else "") for i, name in enumerate(names)]


def hole_in_words(hole):
    """Sentences on the sections of a `Borehole`."""
    for i, section in enumerate(hole.sections, start=1):
        name = section.name or f"section {i}"
        yield f"Hole, {name}: to {section.to:g} m, {section.diameter:g} m wide, friction {section.friction:g}."


def explain(options, scene):
    """The text of `cosserat explain` of a `WellScene`."""
    scene = _scene(options, scene)
    hole, path = scene.hole, scene.hole.path
    end, worst = path.position(path.length), int(np.argmax(path.dogleg_severity))
    lines = [scene.title] if scene.title else []
    lines.append(
        f"Well: {len(path.md)} stations to md = {path.length:g} m, which is north {end[0]:.2f}, east {end[1]:.2f} and "
        f"down {end[2]:.2f} m; largest inclination {math.degrees(path.inclination.max()):.2f} degrees, largest dogleg "
        f"{path.dogleg_severity[worst] / units.deg_per_30m:.2f} degrees per 30 m below {path.md[worst]:g} m."
    )
    lines += hole_in_words(hole)
    depth = scene.settings.get("depth", hole.length)
    for place in scene.string.laid(depth):
        part, S = place.component, place.component.stiffness
        stiff = "stiffness not known" if S is None or S.matrix is not None else f"EI = {min(S.bending):.4g} N m^2"
        lines.append(
            f"String, {part.name}: md {place.top:g} to {place.bottom:g} m, {weight_in_mud(part, scene.mud):.2f} N/m in "
            f"mud, touches the wall at a radius of {part.contact_radius:g} m, {stiff}."
        )
    for operation in scene.operations:
        lines.append(f"Operation: {operation.name}, on bit {operation.weight:g} N and {operation.torque:g} N m.")
    if scene.sweep:
        lines.append(f"Sweep over {len(scene.sweep['depths'])} depths of the bit.")
    model, tol = scene.settings.get("model", "auto"), scene.settings.get("tol", 1e-4)
    lines.append(f"Model: {model}, tol = {tol:g}: {_MODELS[model]}")
    return "\n".join(lines)
