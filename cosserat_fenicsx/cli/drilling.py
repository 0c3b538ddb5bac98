"""Drill-strings in motion on the command line: `cosserat run`, `cosserat explain` and `cosserat resume`."""

import math
import sys
from argparse import Namespace
from dataclasses import replace
from functools import partial

from cosserat_fenicsx import units
from cosserat_fenicsx.cli.output import deliver, given, refuse_of_rods, units_of
from cosserat_fenicsx.cli.say import DONE, say
from cosserat_fenicsx.drilling.bit_laws import Stribeck
from cosserat_fenicsx.drilling.choose import chosen, model_of
from cosserat_fenicsx.drilling.motion import KIND, check_arguments
from cosserat_fenicsx.drilling.scenefile import SimulateDrilling
from cosserat_fenicsx.drilling.segments import Discs
from cosserat_fenicsx.drilling.stick_slip import turns
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.storage.store import Store, holds

_TAKEN = ("duration", "dt", "elements", "model", "save_every")
# Files that may be written.
_NAMES = ("drilling.csv", "drilling.png", "energy.png", "phase.png", "map.png", "stability.csv", "stability.png")


def _scene(options, found):
    refuse_of_rods(options, "a drill-string in motion")
    units_of(options)  # refused before the computation
    if options.static:
        raise SceneError("--static is for rods, and this scene is a drill-string in motion: strings in equilibrium are "
                         "scenes with [well] and [[operations]]")  # fmt: skip
    return replace(found, simulate=replace(found.simulate or SimulateDrilling(), **given(options, _TAKEN)))


def run(options, found, tables):
    """`cosserat run` of a `DrillingScene` and the tables of its file; returns the exit code."""
    found = _scene(options, found)
    if found.title:
        say(found.title, file=sys.stdout)
    _check_folder(options.folder, found.scene)
    code = DONE
    if "duration" in found.settings or not found.speeds:
        code = deliver_motion(lambda: found.run(folder=options.folder), options, tables)
    if code != DONE or not found.speeds:
        return code

    def files_of(answer):
        chart = not options.no_picture and partial(answer.plot, units=options.units or "SI")
        return {"stability.csv": partial(answer.write, units=options.units or "SI"), "stability.png": chart}

    of_output = Namespace(output=options.output, scene=options.scene, units=options.units)
    return deliver(found.map, of_output, ("stability.csv", "stability.png"), files_of, tables)


def _check_folder(folder, scene):
    """Refuse the folder of another motion, or of this one."""
    if folder and holds(folder) == KIND.what:
        store = Store(folder, KIND).open()
        store.scene(scene, store.head["duration"])  # refused with what differs
        raise SceneError(f"--folder {folder}: it holds this motion already: `cosserat resume {folder}` continues it; "
                         "or expected another name")  # fmt: skip


def deliver_motion(computed, options, tables=None):
    """Deliver a `DrillingHistory`, see `deliver`."""
    picture, film, asked = not options.no_picture, options.animate, {"units": units_of(options)}

    def files(history):
        picture_in_time, in_depth = picture and len(history) > 1, len(history.profile_times) > 1
        return {
            "drilling.csv": partial(history.write, **asked),
            "drilling.png": picture_in_time and partial(history.plot, **asked),
            "energy.png": picture_in_time and partial(history.plot_energy, **asked),
            "phase.png": picture_in_time and turns(history) and partial(history.plot_phase, **asked),
            "map.png": picture_in_time and in_depth and partial(history.plot_map, **asked),
            film: film and in_depth and partial(history.animate, speed=options.speed),
        }

    return deliver(computed, options, _NAMES, files, tables, moving=True)


def explain(options, found):
    """The text of `cosserat explain` of a `DrillingScene`."""
    found = _scene(options, found)
    scene, settings, shown = found.scene, found.settings, Units(units_of(options))
    told = shown.told
    lines = [found.title] if found.title else []
    if isinstance(scene.string, Discs):
        inertias = ", ".join(f"{x:g}" for x in scene.string.inertias)
        lines.append(f"String: {len(scene.string.inertias)} discs from the drive down, of {inertias} kg m^2.")
    else:
        for part in scene.segments:
            lines.append(
                f"String, {part.name}: {told(part.length, 'm')}, impedance {part.torsional_impedance:.5g} N m s/rad in "
                f"torsion and {part.axial_impedance:.5g} N s/m along the axis, waves at {part.torsional_speed:.5g} and "
                f"{part.axial_speed:.5g} m/s, {told(part.weight, 'N/m', 'force per length', '.5g')}{_fluid(scene)}."
            )
        lines += _in_hole(scene, shown)
    lines.append(f"Drive: {_drive(scene.drive, settings.get('duration'))}.")
    lines.append(
        f"Bit: {scene.bit.law}{_at_bit(scene.bit, shown)}." if scene.bit else "Bit: none, the lower end is free."
    )
    if scene.hook is not None:
        stiff = f"{scene.hook.stiffness:g} N/m" if math.isfinite(scene.hook.stiffness) else "rigid"
        upwards = _over_time(scene.hook.signal(), 1.0, settings.get("duration"))
        lines.append(f"Hook: {stiff}, the block moves upwards at {upwards} m/s.")
    for name in ("friction", "drag"):
        if getattr(scene, name) is not None:
            lines.append(f"{name.capitalize()}: {getattr(scene, name)}.")
    name, why = chosen(scene, settings.get("model", "auto"))
    lines += [f"Model: {shown.sentence(line)}." for line in why]
    if "duration" in settings:
        check_arguments(scene, **{key: value for key, value in settings.items() if key != "model"})
        model = model_of(scene, name, settings.get("dt"), settings.get("elements"))
        steps = math.ceil(settings["duration"] / model.dt - 1e-6)
        lines.append(
            f"Motion: {settings['duration']:g} s in {steps} steps of {model.dt:.4g} s, {len(model.depths)} places "
            "along the string."
        )
        lines += [f"{line[0].upper()}{shown.sentence(line[1:])}." for line in model.why]
    if found.speeds:
        weights = f" and {len(found.weights)} weights on bit" if found.weights else ""
        lines.append(f"Stability at {len(found.speeds)} speeds{weights}.")
    return "\n".join(lines)


def _fluid(scene):
    """Where the weight per length is, in words."""
    if scene.mud is not None and scene.mud.density > 0:
        return " in mud"
    return " in air" if scene.mud is not None or scene.hole is None else ""


def _in_hole(scene, shown):
    """Lines on mud and hole, in some units."""
    mud = scene.mud
    if mud is not None:
        yield mud.in_words()
    if scene.hole is None:
        yield f"Hole: none, no walls; bit at md = {shown.told(scene.bit_depth, 'm')}, the string hangs vertically."
        return
    yield from scene.hole.sections_in_words(shown)
    inclination = math.degrees(scene.hole.path.inclination.max())
    yield f"Bit at md = {shown.told(scene.bit_depth, 'm')}; largest inclination of the hole {inclination:.4g} degrees."


def _over_time(signal, unit, duration):
    """A number, or from which to which it goes up to a time (s), in multiples of a unit."""
    if signal.constant:
        return f"{signal(0.0) / unit:.5g}"
    until = duration or max(signal.jumps, default=1.0)
    times = [*(until * k / 200 for k in range(201)), *(t for t in signal.jumps if 0 <= t <= until)]
    values = [signal(t) / unit for t in times]
    return f"{min(values):.5g} to {max(values):.5g}"


def _drive(drive, duration):
    signal = drive.signal()
    asked = f"{_over_time(signal, units.rpm, duration)} rpm" + ("" if signal.constant else ", which depends on time")
    asked = asked if drive.speed is not None else "no speed asked for"
    inertia = f", inertia {drive.inertia:g} kg m^2" if drive.inertia else ""
    return f"{asked}, {drive.control}{inertia}"


def _at_bit(bit, shown):
    told = []
    if bit.weight:
        told.append(f"{bit.weight / 1e3:g} kN on bit" if shown.si else f"{shown.told(bit.weight, 'N')} on bit")
    told += [f"inertia {bit.inertia:g} kg m^2"] if bit.inertia else []
    if bit.weight and isinstance(bit.law, Stribeck) and bit.law.radius is None:
        told.append("its torque does not follow the weight: that takes coefficients and a radius")
    return "".join(f", {x}" for x in told)
