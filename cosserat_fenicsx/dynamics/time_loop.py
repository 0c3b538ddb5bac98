"""The loop over time: steps that end at marks (jumps and kinks of loads, saved states, the end), halving of steps that
fail, saved states and checkpoints."""

import itertools
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.results.contacts import Passes, check_passes, least_gap
from cosserat_fenicsx.results.history import History
from cosserat_fenicsx.results.records import Instant, Ledger
from cosserat_fenicsx.scene.signals import signals_of

_HALVINGS = 12  # times that a failing step is halved before the motion is given up
_REMEMBERED = "t", "first", "h", "count", "steps", "iterations", "saved"  # numbers of a `TimeLoop` for its continuation


# Largest movement between two looks at the parts of rods between nodes, over the obstacle's size.
_LOOK = 0.25


class _Obstacles:
    """Whether rods pass unseen through obstacles of a size, such as a thin post: between two states, or two nodes."""

    def __init__(self, problem):
        self._problem, self._model = problem, problem.model
        sizes = [action.largest_step for action in self._model.scene.actions if action.gaps is not None]
        self._size = min(sizes, default=math.inf) / self._model.scales.length
        self._unseen = 0.0

    def _here(self, t):
        here, model = History.of(self._model, ""), self._model
        here.append(Instant(self._problem.load_factor, *model.snapshot(), 0, 0, np.empty(0), time=t))
        return here

    def leapt(self, stepper, t):
        """Whether the last step, to the time t (s), was so long that a rod may have leapt over an obstacle."""
        if self._size == math.inf or (moved := stepper.moved()) <= self._size:
            return False
        return least_gap(self._here(t)) < moved * self._model.scales.length

    def look(self, stepper, t):
        """Look between the nodes after an accepted step; raises `Passes`."""
        if self._size == math.inf:
            return
        self._unseen += stepper.moved()
        if self._unseen > _LOOK * self._size:
            self._unseen = 0.0
            check_passes(self._here(t))


class TimeLoop:
    """The computation of a motion, with its saved states (`History`) and checkpoints (in a `Store`, or `Nowhere`)."""

    def __init__(self, problem, stepper, pace, history, store):
        self.problem, self.model, self._stepper, self._pace = problem, problem.model, stepper, pace
        self.history, self._store, self._obstacles = history, store, _Obstacles(problem)
        self._t = self._first = self._h = 0.0
        self._count = self._steps = self._iterations = self._saved = 0

    def memory(self):
        """The data that continue a motion between two steps, see `Stepper.memory`."""
        counts = {name: getattr(self, f"_{name}") for name in _REMEMBERED}
        return {**counts, "pace": self._pace.memory(), "stepper": self._stepper.memory(), "nodes": self.model.slots}

    def recall(self, memory):
        for name in _REMEMBERED:
            setattr(self, f"_{name}", memory[name])
        self._pace.recall(memory.get("pace", {}))
        self._stepper.recall(memory["stepper"])

    def over(self, marks, save_all, progress):
        """The history up to the last of the `Mark`s, the first at the start; save_all: whether of every step."""
        comm, model = self.model.comm, self.model
        try:
            with self._store.ending(self.history), Progress([marks[-1].time], progress, comm, "t (s) =") as bar:
                bar.start(f"{model.name}, {model.unknowns} unknowns")
                bar.reached(self._t)
                self._store.checkpoint(self.memory(), self.history)
                if not self._saved:
                    self._save(self._t, stepped=False)
                for mark, after in itertools.pairwise(marks):
                    self._between(mark, after, save_all, bar)
                self._store.checkpoint(self.memory(), self.history)
        except SceneError as problem:  # a function of time that raises, or gives no finite numbers, after the start
            problem.path = self.history
            raise
        return self.history

    def _between(self, mark, after, save_all, bar):
        begin, end = mark.time, after.time
        if end <= self._t:  # a continued motion is past this interval
            return
        if self._t <= begin:
            if mark.jump:
                if begin > 0 and self._stepper.kinks_persist:
                    self._stepper.drive(begin)
                self._stepper.jump()
                self._pace.jump()
            elif mark.kink:
                self._stepper.kink()
            self._t = self._first = begin
            self._count, self._h = 0, 0.0
        nothing = 1e-9 * (end - begin)
        while self._t < end:
            obey()
            if self._pace.stuck:
                self._lose(
                    self._t,
                    f"steps stay as short as {self._h:.3g} s: something oscillates or jumps too fast for the "
                    "tolerance. Try a fixed dt, a larger tol, damping, scheme='generalised-alpha', or `jumps` where a "
                    "load is not smooth.",
                )
            wanted = self._pace.length(self._t, end - self._t)
            if abs(wanted - self._h) > 1e-9 * wanted:  # times are count * h, so that rounding does not accumulate
                self._first, self._count, self._h = self._t, 0, wanted
            if not self._advance(self._t, self._h):
                continue
            self._count += 1
            t = self._first + self._count * self._h
            self._t = end if end - t <= nothing else t
            bar.reached(self._t)
            if save_all or (after.saved and self._t == end):
                self._save(self._t)
            if self._store.due:
                self._store.checkpoint(self.memory(), self.history)

    def _advance(self, t, h, halvings=0):
        """Step from t by h (s), in halves where that fails; False to try a shorter step instead."""
        solved = self._stepper.step(t, h)
        self._iterations += solved.iterations
        if solved.converged and self._obstacles.leapt(self._stepper, t + h):
            self._stepper.undo()
            solved = replace(solved, converged=False, reason="a rod moved farther at once than an obstacle is wide")
        if solved.converged:
            if not halvings and not self._pace.accepts(self._stepper, h):
                self._stepper.undo()
                return False
            self._steps += 1
            try:
                self._obstacles.look(self._stepper, t + h)
            except Passes as found:
                self._lose(t + h, str(found))
            return True
        if not halvings and self._pace.failed(h):
            return False
        if halvings == _HALVINGS:
            self._lose(
                t,
                f"a step of {h:.3g} s still fails: {solved.reason}. Try a smaller dt or tol, more elements, or "
                "damping.",
            )
        self._advance(t, h / 2, halvings + 1)
        self._advance(t + h / 2, h / 2, halvings + 1)
        return True

    def _lose(self, t, why):
        if self.history._records[-1].time < t:
            self._save(t, stepped=False)
        raise NotConverged(f"the motion was lost at t = {t:.6g} s, where {why}", self.history)

    def _save(self, t, stepped=True):
        """Save the state at the time t; `stepped`: after an accepted step."""
        model, problem, stepper = self.model, self.problem, self._stepper
        scales = model.scales
        momentum, energy = scales.force * model.time, scales.force * scales.length
        nodal, gauss = model.snapshot()
        linear, angular = problem.momenta()
        ledger = Ledger(
            *(energy * x for x in (*problem.energies(), stepper.work, stepper.dissipated)),
            momentum * linear,
            momentum * scales.length * angular,
        )
        rates = model.rates()(nodal, model.snapshot_of_rates())
        iterations, self._iterations = self._iterations, 0
        self._saved += 1
        if stepped:
            ties, clamps = problem.tie_forces(), problem.clamp_forces()
        else:
            ties = np.full((len(model.signature.connections.ties), 2, 6), np.nan)
            clamps = np.full((model.clamps.count, 6), np.nan)
        held = {"tie_forces": ties, "clamp_forces": clamps, "far_ends": model.delays.far_ends(stepped)}
        if problem.contact:
            held["wall_forces"] = problem.contact.of_step() if stepped else np.full((problem.contact.count, 3), np.nan)
        self.history.append(Instant(problem.load_factor, nodal, gauss, 0, iterations, problem.multipliers_at(t), time=t,
                                    rates=rates, steps=self._steps, ledger=ledger, **held))  # fmt: skip


# Interval over which a jump is detected, over the duration; relative rounding of a signal.
_JUMP_INTERVAL, _ROUNDING = 1e-9, 1e-13


class Mark(NamedTuple):
    """A time (s) that a step ends at; kink: whether a load or a prescribed motion is not smooth there; jump: whether a
    load jumps there or a prescribed motion has a kink: accelerations and velocities jump."""

    time: float
    kink: bool = False
    jump: bool = False
    saved: bool = True


def marks_of(scene, duration, save_every, ends=()):
    """The `Mark`s of a motion, ascending: the first at 0, the last at its duration (s); save_every: s between saved
    states, or None; ends: ends (s) of shorter durations that the motion was computed for before, see `resume`. A
    SceneError for a prescribed motion that is discontinuous."""
    _check_driven(scene, duration)
    signals = [(item, signal) for item in scene.moving for signal in signals_of(item).values()]
    kinks = {t for _, signal in signals for t in signal.jumps if 0 < t < duration}
    jumps = {
        t
        for item, signal in signals
        for t in signal.jumps
        if t in kinks and (item not in scene.loads or _jumps_at(signal, t, duration))
    }
    saved = set(ends)
    if save_every is not None:
        count = math.ceil(duration / save_every - 1e-9)
        saved |= {k * save_every for k in range(1, count)}
    marks = [Mark(0.0)]
    for t in sorted(kinks | saved):
        mark, before = Mark(t, t in kinks, t in jumps, t in saved), marks[-1]
        if t - before.time > 1e-9 * duration:
            marks.append(mark)
        else:  # times that differ by rounding alone are merged
            either = (one or other for one, other in zip(before[1:], mark[1:], strict=True))
            marks[-1] = Mark(t if mark.kink else before.time, *either)
    return [*marks, Mark(duration)]


def _check_driven(scene, duration):
    """Refuse discontinuous prescribed motions: the work of such a support grows without bound as steps get shorter."""
    for i, support in enumerate(scene.supports):
        for field, signal in signals_of(support).items():
            for t in signal.jumps:
                if 0 < t <= duration and _jumps_at(signal, t, duration):
                    rise = _rise(signal, t, _JUMP_INTERVAL * duration, duration)
                    raise SceneError(
                        f"supports[{i}] ({type(support).__name__} at {support.station}): its {field} jumps at t = "
                        f"{t:g} s, by {rise:.4g} {signal.unit}: expected a continuous one, such as a Ramp or a RunUp"
                    )


def _jumps_at(signal, t, until):
    """Whether the value of a signal, not only its slope, jumps at t (s): over half an interval it changes as much."""
    rise = _rise(signal, t, _JUMP_INTERVAL * until, until)
    if rise <= 0.75 * _rise(signal, t, 2 * _JUMP_INTERVAL * until, until):
        return False
    return rise > _ROUNDING * max(np.abs(signal(u)).max() for u in np.linspace(0, until, 33))


def _rise(signal, t, apart, until):
    """Largest change of a component of a signal from t - apart to t + apart, or to `until` where that is earlier; s."""
    return float(np.abs(np.subtract(signal(min(t + apart, until)), signal(t - apart))).max())
