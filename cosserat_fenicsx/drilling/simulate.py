"""`simulate_drilling`: a drill-string in motion; `resume_drilling` and `read_drilling`: from the folder of one."""

import math
import numbers

import numpy as np

from cosserat_fenicsx.checks import File, instance, number, refuse
from cosserat_fenicsx.drilling.choose import OtherSteps, chosen, fastest, model_of
from cosserat_fenicsx.drilling.folder import DrillingFolder
from cosserat_fenicsx.drilling.history import DrillingHistory
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.stick_slip import step_errors
from cosserat_fenicsx.drilling.time_loop import TimeLoop
from cosserat_fenicsx.errors import SceneError

#: More steps, and rows of a history, are refused as a mistake; so many profiles where nothing else is asked for.
MOST_STEPS, MOST_ROWS, PROFILES = 1e8, 2e7, 400
# Relative differences below this are rounding, as by another machine.
_ROUNDING = 1e-9
# Largest rotation in a step, rad, at three times the speed of the drive, as a bit that slips may have; and the largest
# part of the angle between two blades or lobes.
_TURN, _FASTER, _OF_BLADES = 1.0, 3.0, 0.25


def simulate_drilling(
    scene: Drilling,
    duration: float,
    *,
    model: str = "auto",
    dt: float | None = None,
    elements: int | None = None,
    save_every: float | None = None,
    profile_every: float | None = None,
    folder: File | None = None,
    check: bool = False,
    progress: bool | None = None,
) -> DrillingHistory:
    """Compute the motion of a drill-string from rest: stick-slip, axial and torsional waves, friction along the hole.

    Args:
        scene: a `Drilling`.
        duration: s; the motion ends with the first step that reaches it.
        model: "torsion", "axial and torsional", or "auto": axial motion only where something asks for it. The
            history's `why` says what decided, and warns where a string on the axis of the hole leaves something out.
        dt: step, s; None for that of the model.
        elements: along the string; None for those of the model.
        save_every: s between the rows of the history, rounded to steps; None for every step.
        profile_every: s between profiles along the string; None for 400 of them.
        folder: to write the motion and checkpoints to during the run: whatever ends it, `resume_drilling(folder)`
            continues it to the same digits. It must not hold a motion yet.
        check: whether the motion is computed once more at twice the step, on a mesh half as fine, for the history's
            `errors`.
        progress: True, False, or None for a bar in runs of more than two seconds.

    Returns:
        a `DrillingHistory`.

    Raises:
        SceneError: an argument outside its range, an unknown model, a step that is too long for the rotation in it, or
            a jump in speed that no drive follows.
        NotConverged: a step fails however short it is, or a bit below a `Motor` turns too far in it; `.path` holds
            the history up to there.
        Interrupted: Ctrl-C; `.path` holds the history up to there.
        NotStored: the folder can no longer be written to.
    """
    instance("simulate_drilling", "scene", scene, Drilling, "a Drilling")
    check_arguments(scene, duration, dt, elements, save_every, profile_every)
    name, why = chosen(scene, model)
    running = model_of(scene, name, dt, elements)
    check_step(scene, running.dt, duration, save_every)
    history = DrillingHistory(scene, running.name, [*why, *running.why], running.dt, running.depths)
    apart = {
        "save_every": max(1, round((save_every or 0.0) / running.dt)),
        "profile_every": max(1, round((profile_every or duration / PROFILES) / running.dt)),
    }
    kept = None
    if folder is not None:
        asked = {"duration": float(duration), "asked": {"model": name, "dt": dt, "elements": elements}, "apart": apart}
        kept = DrillingFolder(folder).make(scene, history, asked)
    TimeLoop(running, history, kept, **apart, turn=_turn_to_watch(scene)).until(duration, progress)
    if check:
        history.errors = step_errors(OtherSteps(scene, name, running), history.rows, duration / 2)
    return history


def resume_drilling(
    folder: File, scene: Drilling | None = None, *, duration: float | None = None, progress: bool | None = None
) -> DrillingHistory:
    """Continue a motion from the folder that `simulate_drilling` wrote, to the same digits, whatever ended it.

    Args:
        folder: its name.
        scene: the `Drilling`, which is compared with that of the folder; None for the one stored there, which is
            missing where a speed is a function written in Python.
        duration: s; None for the last one asked for. A longer one goes on from there.
        progress: see `simulate_drilling`.

    Returns:
        the `DrillingHistory` from the start; at once where it is complete.

    Raises:
        SceneError: no such folder, another scene, or a shorter duration.
        NotConverged, Interrupted, NotStored: see `simulate_drilling`.
    """
    kept = DrillingFolder(folder).open()
    scene = kept.scene(scene)
    if duration is None:
        duration = kept.asked
    elif _seconds("resume_drilling", "duration", duration) < kept.asked:
        refuse("resume_drilling", "duration", duration, f"at least {kept.asked:g} s, the last one asked for")
    check_arguments(scene, duration, kept.head["asked"]["dt"], kept.head["asked"]["elements"])
    kept.hold()
    try:
        return _go_on(kept, scene, float(duration), progress)
    finally:
        kept.release()


def _go_on(kept, scene, duration, progress):
    running, memory = _running(kept, scene), kept.memory()
    if duration > kept.asked:
        check_step(scene, running.dt, duration, kept.head["apart"]["save_every"] * running.dt)
        kept.extend(duration, scene)
    why = memory and (kept.wrong(memory) or kept.not_recalled(memory, running))
    if why:
        kept.tell_lost(why)
        running, memory = _running(kept, scene), None
    rows, profiles = (memory["rows"], memory["profiles"]) if memory else (0, 0)
    history = kept.history(scene, rows, profiles)
    kept.cut(rows, profiles)
    loop = TimeLoop(running, history, kept, **kept.head["apart"], turn=_turn_to_watch(scene))
    return loop.until(duration, progress)


def _running(kept, scene):
    """The model of a motion that is gone on with.

    Raises:
        SceneError: it is not the one that the rows are of.
    """
    asked, told = kept.head["asked"], kept.head
    running = model_of(scene, asked["model"], asked["dt"], asked["elements"])
    alike = {
        "model": running.name == told["model"],
        "dt": math.isclose(running.dt, told["dt"], rel_tol=_ROUNDING),
        "depths": len(running.depths) == len(told["depths"])
        and np.allclose(running.depths, told["depths"], rtol=_ROUNDING, atol=0),
    }
    for name, same in alike.items():
        if not same:
            raise SceneError(
                f"{kept.place}: the {name} of its motion is another one than that of this release, or drilling.json is "
                "damaged: expected a new motion by simulate_drilling"
            )
    return running


def read_drilling(folder: File, scene: Drilling | None = None) -> DrillingHistory:
    """The motion that a folder holds so far; another process may still be computing it.

    Args: see `resume_drilling`.

    Raises:
        SceneError: no such folder, or another scene.
    """
    kept = DrillingFolder(folder).open()
    scene, memory = kept.scene(scene), kept.memory(tell=False)  # before the rows, which another process may be writing
    why, history = memory and kept.wrong(memory), None
    if not why:
        history = kept.history(scene)
        why = kept.not_in_order(history)
    if why:
        raise SceneError(
            f"{why}: expected the files as they were; cosserat_fenicsx.resume_drilling computes them again"
        )
    return history


def check_arguments(scene, duration, dt=None, elements=None, save_every=None, profile_every=None):
    """Refuse numbers out of their range, and jumps in speed.

    Raises:
        SceneError: naming the argument.
    """
    where = "simulate_drilling"
    _seconds(where, "duration", duration)
    for name, value in (("dt", dt), ("save_every", save_every), ("profile_every", profile_every)):
        if value is not None and _seconds(where, name, value) > duration:
            refuse(where, name, value, f"at most the duration, {duration:g} s")
    whole = isinstance(elements, numbers.Integral) and not isinstance(elements, bool)
    if elements is not None and not (whole and 1 <= elements <= 1_000_000):
        refuse(where, "elements", elements, "how many along the string, 1 to 1000000")
    if dt is not None and duration / dt > MOST_STEPS:
        refuse(where, "dt", dt, f"at least {duration / MOST_STEPS:g} s: {MOST_STEPS:g} steps in {duration:g} s")
    signal = scene.drive.signal()
    if scene.drive.imposes_speed and not signal.constant:
        for t in signal.jumps:
            if 0 < t < duration and abs(signal.jump(t)) > 1e-6 * max(1.0, abs(signal(t))):
                refuse("TopDrive", "speed", scene.drive.speed, f"no jump, such as that of {signal.jump(t):.4g} rad/s "
                       f"at t = {t:g} s: no drive follows it; a Ramp, or a control with an inertia")  # fmt: skip


def check_step(scene, dt, duration, save_every=None):
    """Refuse a step that is too long for the rotation in it, and too many steps or rows.

    Raises:
        SceneError: naming the step and what it may be.
    """
    where, speed = "simulate_drilling", fastest(scene, duration)
    if duration / dt > MOST_STEPS:
        refuse(where, "duration", duration, f"at most {MOST_STEPS:g} steps of {dt:g} s, {MOST_STEPS * dt:g} s")
    if duration / max(dt, save_every or 0.0) > MOST_ROWS:
        refuse(where, "save_every", save_every, f"at least {duration / MOST_ROWS:.3g} s: {MOST_ROWS:g} rows in "
               f"{duration:g} s")  # fmt: skip
    most, words = _largest_turn(scene)
    if words:
        what = f"{words} at that speed"
    else:
        what, speed = f"{most:g} rad in a step at {_FASTER:g} times the speed of the drive", _FASTER * speed
    if speed * dt > most:
        refuse(where, "dt", dt, f"a step of at most {most / speed:.3g} s, too short for more than {what}")


def _largest_turn(scene):
    """The largest rotation of the bit in a step, rad, and words on it where blades or lobes decide for it."""
    repeats = scene.bit.law.repeats if scene.bit is not None else None
    if repeats is None:
        return _TURN, ""
    parts, named = repeats
    return _OF_BLADES * 2 * math.pi / parts, f"{_OF_BLADES:g} of the angle between {named}"


def _turn_to_watch(scene):
    """The largest rotation in a step where it is not known before the motion, below a motor; else infinite."""
    watched = scene.bit is not None and scene.drive.speed is None
    return _largest_turn(scene)[0] if watched else math.inf


def _seconds(where, field, value):
    return number(where, field, value, "a positive number (s), from 1e-9 to 1e9", lambda x: 1e-9 <= x <= 1e9)
