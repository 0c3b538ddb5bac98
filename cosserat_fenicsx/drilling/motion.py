"""`drilling.simulate`, its loop over time, and the motion of a drill-string read from its folder and continued."""

import math
import numbers
from functools import partial

import numpy as np

from cosserat_fenicsx.checks import File, instance, number, refuse
from cosserat_fenicsx.drilling.choose import chosen, fastest, model_of, on_same_mesh, with_step
from cosserat_fenicsx.drilling.history import COLUMNS, DrillingHistory
from cosserat_fenicsx.drilling.joints import fastest_rotor
from cosserat_fenicsx.drilling.protocol import PROFILE, columns
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.stick_slip import step_errors
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.storage.store import Kind, Nowhere, Store


#: Steps between checks for an interrupt.
CHUNK = 256
_BIT_SPEED = COLUMNS.index("bit_speed")
# Tolerance of the end, in steps.
_NOTHING = 1e-6


class TimeLoop:
    """The computation of a motion.

    Args:
        model: a `StringModel`. history: the `DrillingHistory` that it is written to.
        store: the `Store`, or `Nowhere`.
        save_every, profile_every: steps between rows and between profiles.
        turn: the largest rotation of the bit in a step, rad.
    """

    def __init__(self, model, history, store, save_every, profile_every, turn=np.inf):
        self.model, self.history, self._store = model, history, store
        self._save_every, self._profile_every, self._turn = save_every, profile_every, turn

    def until(self, duration, progress=None):
        """Advance to a time (s), and return the history, which exceptions have as `.path`."""
        model, history = self.model, self.history
        end = duration - _NOTHING * model.dt
        try:
            with self._store.ending(history), Progress([duration], progress, world(), "t (s) =") as bar:
                bar.start(f"{model.name}, {len(model.depths)} places")
                bar.reached(model.time)
                if not model.steps:
                    self._keep()
                while model.time < end:
                    obey()
                    self._chunk(end)
                    bar.reached(min(model.time, duration))
                self._keep()
        except NotConverged as failure:
            rows = getattr(failure, "rows", None)
            if rows is not None:
                self._add(np.asarray(rows)[self._saved(len(rows))])
            failure.path = history
            raise
        finally:
            history.counts = dict(model.counts)
        return history

    def _chunk(self, end):
        """Steps up to the next profile, or to the end."""
        model = self.model
        to_profile = self._profile_every - model.steps % self._profile_every
        left = max(1, int(np.ceil((end - model.time) / model.dt - _NOTHING)))
        rows = np.asarray(model.advance(min(CHUNK, to_profile, left)))
        if not len(rows):
            raise NotConverged(f"the {model.name} model does not advance from t = {model.time:g} s")
        self._watch(rows)
        self._add(rows[self._saved(len(rows))], profile=model.steps % self._profile_every == 0)
        if self._store.due:
            self._keep()

    def _watch(self, rows):
        """Stop where the bit turns too far in a step."""
        turns = np.abs(rows[:, _BIT_SPEED]) * self.model.dt
        if turns.max() > self._turn:
            first = int(np.argmax(turns > self._turn))
            self._add(rows[:first][self._saved(len(rows))[:first]])
            raise NotConverged(
                f"{self.model.name}: at t = {rows[first, 0]:.6g} s the bit turns by {turns[first]:.3g} rad in a step "
                f"of {self.model.dt:.3g} s, more than {self._turn:.3g} rad: expected a shorter dt, or a drag that "
                "limits the speed of the Motor"
            )

    def _saved(self, count):
        """Which of the last `count` steps are kept."""
        return (np.arange(self.model.steps - count, self.model.steps) + 1) % self._save_every == 0

    def _add(self, rows, profile=False):
        self.history.append(rows)
        along = []
        if profile:
            along = self.history.append_profile(self.model.time, self.model.profile())[None]
        self._store.put(self.history, "the motion", series=rows, profiles=along)

    def _keep(self):
        self._store.checkpoint(self.model.memory(), self.history)


#: Largest numbers of steps, and of rows of a history; default number of profiles.
MOST_STEPS, MOST_ROWS, PROFILES = 1e8, 2e7, 400
# Relative differences below this are rounding, as on another machine.
_ROUNDING = 1e-9
# Largest rotation in a step, rad, at three times the speed of the drive, as a bit that slips may have; largest share of
# the angle between two blades or lobes.
_TURN, _FASTER, _OF_BLADES = 1.0, 3.0, 0.25
KIND = Kind(
    what="motion of a drill-string", home="drilling.motion", call="drilling.simulate",
    again="cosserat_fenicsx.resume({place!r}), or `cosserat resume {quoted}`, continues it",
    differs="the scene is not the one of the motion", tables=("series", "profiles"), starts=True, rounding=1e-9,
    scene=Drilling,
)  # fmt: skip


def simulate(
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
        dt: step, s; None for the model's own.
        elements: along the string; None for the model's own number.
        save_every: s between the rows of the history, rounded to steps; None for every step.
        profile_every: s between profiles along the string; None for 400 of them.
        folder: to write the motion and checkpoints to during the run: whatever ends it, `resume(folder)` continues
            it to the same digits. It must not hold a motion yet.
        check: whether the motion is computed again at twice and at half the step, on meshes half and twice as fine,
            for the history's `errors`: five times the work; seven times where friction at the wall falls with the
            slip, by half the step on the same mesh, too.
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
    instance("simulate", "scene", scene, Drilling, "a Drilling")
    duration, dt, save_every, profile_every = check_arguments(scene, duration, dt, elements, save_every, profile_every)
    from cosserat_fenicsx.drilling.linear.limits import fed_by_bit, fed_waves

    name, why = chosen(scene, model)
    running = model_of(scene, name, dt, elements)
    check_step(scene, running.dt, duration, save_every)
    why += [f"CAUTION: {fed}" for fed in (fed_waves(scene), fed_by_bit(scene, running.dt)) if fed]
    history = DrillingHistory(scene, running.name, [*why, *running.why], running.dt, running.depths)
    apart = {
        "save_every": max(1, round((save_every or 0.0) / running.dt)),
        "profile_every": max(1, round((profile_every or duration / PROFILES) / running.dt)),
    }
    store = Nowhere()
    if folder is not None:
        head = {"duration": float(duration), "asked": {"model": name, "dt": dt, "elements": elements}, "apart": apart}
        head |= {"model": history.model, "why": history.why, "dt": history.dt, "depths": history.depths.tolist()}
        store = Store(folder, KIND).make(head, scene, float(duration))
        _tables(store, scene)
        history.folder = store.place
    TimeLoop(running, history, store, **apart, turn=_turn_to_watch(scene)).until(duration, progress)
    if check:
        history.errors = step_errors(running.dt, partial(with_step, scene, name, running), history.rows, duration / 2,
                                     on_same_mesh(scene, name, running))  # fmt: skip
    return history


def go_on(store, scene, duration, progress):
    """`resume` of a drill-string in motion; see there."""
    last, asked, apart = (store.head[name] for name in ("duration", "asked", "apart"))
    duration = last if duration is None else _seconds("resume", "duration", duration)
    if duration < last:
        refuse("resume", "duration", duration, f"at least {last:g} s, the last one asked for")
    scene = _scene(store, scene, duration)
    check_arguments(scene, duration, asked["dt"], asked["elements"])
    store.hold()
    try:
        running, tables = _running(store, scene), _tables(store, scene)
        if duration > last:
            check_step(scene, running.dt, duration, apart["save_every"] * running.dt)
            store.extend(scene, duration, duration=duration)
        store.memory(running.memory(), running.recall)
        history = _history(store, scene, [np.array(table.rows[: table.next]) for table in tables])
        return TimeLoop(running, history, store, **apart, turn=_turn_to_watch(scene)).until(duration, progress)
    finally:
        store.release()


def _running(store, scene):
    """The model of a motion that is continued; a SceneError where it differs from that of the stored rows."""
    asked, head = store.head["asked"], store.head
    running = model_of(scene, asked["model"], asked["dt"], asked["elements"])
    alike = {
        "model": running.name == head["model"],
        "dt": _alike(running.dt, head["dt"]),
        "depths": _alike(running.depths, head["depths"]),
    }
    for name, same in alike.items():
        if not same:
            raise SceneError(
                f"{store.place}: the {name} of its motion differs from this release: expected a new motion by "
                "drilling.simulate"
            )
    return running


def _alike(numbers, others):
    return np.shape(numbers) == np.shape(others) and np.allclose(numbers, others, rtol=_ROUNDING, atol=0)


def read(store, scene):
    """The motion of a drill-string that is stored so far."""
    scene = _scene(store, scene, store.head["duration"])
    tables = _tables(store, scene)
    store.check_rows(lambda rows: rows[:, 0])
    return _history(store, scene, [np.array(table.rows) for table in tables])


def _scene(store, scene, until):
    if scene is not None:
        instance("resume", "scene", scene, Drilling, "a Drilling, or None for the folder's own")
    return store.scene(scene, until)


def _tables(store, scene):
    def table(name, width):
        return store.table(name, lambda dtype, shape: dtype.str == "<f8" and shape == (width,))

    widths = columns(scene), 1 + len(PROFILE) * len(store.head["depths"])
    return list(map(table, KIND.tables, widths))


def _history(store, scene, rows):
    head = store.head
    series, along = (found if len(found) else None for found in rows)
    return DrillingHistory(scene, head["model"], head["why"], head["dt"], head["depths"], series, along,
                           folder=store.place)  # fmt: skip


def check_arguments(scene, duration, dt=None, elements=None, save_every=None, profile_every=None):
    """Refuse numbers out of their range, and jumps in speed. Returns duration, dt, save_every, profile_every, s, of
    which any may be given as text with a unit. Raises SceneError: naming the argument."""
    where = "simulate"
    duration = _seconds(where, "duration", duration)
    times = {"dt": dt, "save_every": save_every, "profile_every": profile_every}
    for name, value in times.items():
        times[name] = None if value is None else _seconds(where, name, value)
        if value is not None and times[name] > duration:
            refuse(where, name, value, f"at most the duration, {duration:g} s")
    dt = times["dt"]
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
    return duration, *times.values()


def check_step(scene, dt, duration, save_every=None):
    """Refuse a step that is too long for the rotation in it, and too many steps or rows."""
    where, speed = "simulate", fastest(scene, duration)
    if duration / dt > MOST_STEPS:
        refuse(where, "duration", duration, f"at most {MOST_STEPS:g} steps of {dt:g} s, {MOST_STEPS * dt:g} s")
    if duration / max(dt, save_every or 0.0) > MOST_ROWS:
        refuse(where, "save_every", save_every, f"at least {duration / MOST_ROWS:.3g} s: {MOST_ROWS:g} rows in "
               f"{duration:g} s")  # fmt: skip
    own = fastest_rotor(scene)
    most, words = _largest_turn(scene)
    if words:
        what, speed = f"{words} at that speed", speed + own
    else:
        what, speed = f"{most:g} rad in a step at {_FASTER:g} times the speed of the drive", _FASTER * speed + own
    if speed * dt > most:
        refuse(where, "dt", dt, f"a step of at most {most / speed:.3g} s, too short for more than {what}")


def _largest_turn(scene):
    """The largest rotation of the bit in a step, rad, and words where blades or lobes limit it."""
    repeats = scene.bit.law.repeats if scene.bit is not None else None
    if repeats is None:
        return _TURN, ""
    parts, named = repeats
    return _OF_BLADES * 2 * math.pi / parts, f"{_OF_BLADES:g} of the angle between {named}"


def _turn_to_watch(scene):
    """The largest rotation in a step (rad) of a bit below a motor, checked during the motion; else infinity."""
    watched = scene.bit is not None and scene.drive.speed is None
    return _largest_turn(scene)[0] if watched else math.inf


def _seconds(where, field, value):
    return number(where, field, value, "a positive number (s), from 1e-9 to 1e9", lambda x: 1e-9 <= x <= 1e9)
