"""Drill-strings in motion on the command line: `cosserat run`, `cosserat explain` and `cosserat resume`."""

import math
import shlex
import sys
from argparse import Namespace
from dataclasses import replace
from functools import partial

from cosserat_fenicsx.cli.output import DONE, charted, deliver, given, refuse_of_rods, say, units_of
from cosserat_fenicsx.drilling.choose import chosen, model_of
from cosserat_fenicsx.drilling.motion import KIND, check_arguments
from cosserat_fenicsx.drilling.scenefile import NOTHING_ASKED, SimulateDrilling
from cosserat_fenicsx.drilling.stick_slip import turns
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.storage.store import Store, holds

_TAKEN = ("duration", "dt", "elements", "model", "save_every")
# Files that may be written.
_NAMES = ("drilling.csv", "drilling.png", "energy.png", "phase.png", "map.png", "stability.csv", "stability.png",
          "response.csv", "response.png", "fit.csv", "fit.png")  # fmt: skip


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
    code, others = DONE, {"stability": found.speeds and found.map, "response": found.response and found.respond,
                          "fit": found.fit and found.fitted}  # fmt: skip
    if "duration" in found.settings or not any(others.values()):
        code = deliver_motion(lambda: found.run(folder=options.folder), options, tables)
    of_output = Namespace(**{**vars(options), "animate": None, "folder": None, "station": None})
    for name, computed in others.items():
        if code == DONE and computed:
            files = (f"{name}.csv", f"{name}.png")
            code = deliver(computed, of_output, files, partial(charted, name, options), tables)
    return code


def _check_folder(folder, scene):
    """Refuse the folder of another motion, or of this one."""
    if folder and holds(folder) == KIND.what:
        store = Store(folder, KIND).open()
        store.scene(scene, store.head["duration"])  # refused with what differs
        raise SceneError(f"--folder {folder}: it holds this motion already: `cosserat resume {shlex.quote(folder)}` "
                         "continues it; or expected another name")  # fmt: skip


def deliver_motion(computed, options, tables=None):
    """Deliver a `DrillingHistory`, see `deliver`."""
    picture, film, asked = not options.no_picture, options.animate, {"units": units_of(options)}

    def files(history):
        picture_in_time, in_depth = picture and len(history) > 1, len(history.profile_times) > 1
        return {
            "drilling.csv": partial(history.write, **asked),
            "drilling.png": picture_in_time and partial(history.plot, **asked),
            "energy.png": picture_in_time
            and math.isfinite(history.balance[0])
            and partial(history.plot_energy, **asked),
            "phase.png": picture_in_time and turns(history) and partial(history.plot_phase, **asked),
            "map.png": picture_in_time and in_depth and partial(history.plot_map, **asked),
            film: film and in_depth and partial(history.animate, speed=options.speed, **asked),
        }

    return deliver(computed, options, _NAMES, files, tables, moving=True)


def explain(options, found):
    """The text of `cosserat explain` of a `DrillingScene`."""
    found = _scene(options, found)
    scene, settings, shown = found.scene, found.settings, Units(units_of(options))
    lines = list(found.sentences(shown))
    if found.mixed is not None:
        return "\n".join(lines)
    name, why = chosen(scene, settings.get("model", "auto"))
    if not any(("duration" in settings, found.speeds, found.response, found.fit)):
        lines.append(f"{NOTHING_ASKED[0].upper()}{NOTHING_ASKED[1:]}.")
    lines += [f"Model: {shown.sentence(line)}." for line in why]
    if "duration" in settings:
        check_arguments(scene, **{key: value for key, value in settings.items() if key != "model"})
        model = model_of(scene, name, settings.get("dt"), settings.get("elements"))
        steps = math.ceil(settings["duration"] / model.dt - 1e-6)
        lines.append(f"Motion: {steps} steps of {model.dt:.4g} s, {len(model.depths)} places along the string.")
        lines += [f"{line[0].upper()}{shown.sentence(line[1:])}." for line in model.why]
    return "\n".join(lines)
