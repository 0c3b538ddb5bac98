"""Load factors in C, as long as every step is accepted at once: algebra/sweep.c."""

from collections import namedtuple

import numpy as np

from cosserat_fenicsx.algebra.building import undisturbed
from cosserat_fenicsx.algebra.newton import petsc
from cosserat_fenicsx.algebra.pointers import Pointers
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.statics.path import load_control
from cosserat_fenicsx.statics.path.track import EASY, FAR, HARD, INTENDED, PathPoint
from cosserat_fenicsx.statics.problem import CHANGE

# Seconds after which C returns, so that Ctrl-C is obeyed; load factors recorded between two returns.
_PATIENCE, _ROOM = 0.05, 64
_DONE, _LEFT, _LATER, _FULL = range(4)

#: Recorded points: load factors, unknowns (k, unknowns), values of the fields (k, elements, n) or None, iterations
#: since the point before, and steps so far.
Swept = namedtuple("Swept", "load_factors x fields iterations steps")


class Sweep(Pointers):
    """The continuation in C of one problem.

    Args:
        track: a `Track`; its problem must be serial.
        fields: the `PackedExpression` of what is recorded, or None.
    """

    def __init__(self, track, fields):
        super().__init__()
        self._track, self._fields = track, fields
        problem, model, ffi = track.problem, track.model, self._ffi
        self.c = sweep = ffi.new("sweep *")
        sweep.newton, sweep.stability = track.newton.c, track.stability.c
        setattr(sweep, "with", petsc())
        sweep.snes, sweep.x = (ffi.cast("void *", each.handle) for each in (track.newton.snes, problem.x))
        sweep.eta = self.doubles(problem.eta_array)
        unknowns, numbers = problem.numbering.size, problem.numbering.size + problem.c.carries
        sweep.numbers, sweep.moves, sweep.turn = numbers, model.moves, model.turn
        sweep.slight, sweep.far, sweep.intended = load_control.SLIGHT, FAR, INTENDED
        sweep.leap, sweep.easy, sweep.hard, sweep.patience = load_control.LEAP, EASY, HARD, _PATIENCE
        sweep.change = CHANGE
        sweep.fields, sweep.room = fields.c if fields else ffi.NULL, _ROOM
        shape = (fields.elements, fields.size) if fields else (0,)
        self._points, work = np.zeros((3, numbers)), np.zeros((6, numbers))
        self._recorded = Swept(
            np.zeros(_ROOM), np.zeros((_ROOM, unknowns)), np.zeros((_ROOM, *shape)), *np.zeros((2, _ROOM), np.int32)
        )
        for name, array in (
            ("points", self._points), ("work", work), ("recorded_eta", self._recorded.load_factors),
            ("recorded", self._recorded.x), ("recorded_fields", self._recorded.fields),
        ):  # fmt: skip
            setattr(sweep, name, self.doubles(array))
        for name in ("iterations", "steps"):
            setattr(sweep, f"recorded_{name}", self.integers(getattr(self._recorded, name)))

    def along(self, targets, control, patience, *, every, counted):
        """Advance to load factors in turn until a step needs another decision than to be accepted or halved.

        Args:
            targets: load factors.
            control: the `Continuation`, whose step is taken and set.
            patience: number of rejected steps, without two successive accepted ones between, after which to stop.
            every: whether every step is recorded, or the targets alone.
            counted: Newton iterations since the last record.

        Yields:
            `Swept`, with a progress that Ctrl-C keeps; after the last one the track is at the last accepted point.

        Returns:
            (number of targets reached, iterations since the last record).
        """
        track, sweep = self._track, self.c
        targets = np.array(targets, dtype=float)
        known = track.history
        for at, point in zip(self._points, known, strict=False):
            at[:] = np.concatenate(point.numbers)
        for k, point in enumerate(known):
            sweep.etas[k] = point.load_factor
        sweep.known, sweep.negative, sweep.step = len(known), track.here.negative_modes, control.step
        sweep.smallest, sweep.rejections, sweep.accepted = control.smallest, 0, False
        sweep.allowed = min(patience, load_control.FIRST_REJECTIONS if len(known) == 1 else patience) - 1
        sweep.largest, sweep.loads = control.control.largest or np.inf, track.problem.load_norm
        sweep.targets, sweep.count, sweep.next = self.doubles(targets), len(targets), 0
        sweep.every, sweep.iterations, sweep.steps, sweep.records = every, counted, track.steps, 0
        track.newton.allow(track.max_iterations)
        track.newton.c.rounding = track.model.round_off
        while True:
            before = sweep.iterations
            why = undisturbed("run", sweep)
            k = sweep.records
            track.iterations += int(self._recorded.iterations[:k].sum()) + sweep.iterations - before
            sweep.records = 0
            self._follow()
            control.step, control.rejections = sweep.step, sweep.rejections
            if k:
                yield Swept(*(array[:k] if array.size else None for array in self._recorded))
            track.problem.raise_failure()
            track.stability.raise_failure()
            obey()
            if why in (_DONE, _LEFT):
                return sweep.next, sweep.iterations

    def _follow(self):
        """Let the track follow: its last points, number of steps and load factor."""
        track, sweep = self._track, self.c
        size, live = track.problem.numbering.size, [len(x) for x in track.here.numbers[1:]]
        if sweep.steps == track.steps:
            track.problem.set_load_factor(track.here.load_factor)
            return
        track.history = [
            PathPoint(sweep.etas[k], [part.copy() for part in np.split(self._points[k], np.cumsum([size, *live])[:-1])],
                      sweep.negative, 0)
            for k in range(sweep.known)
        ]  # fmt: skip
        track.steps = sweep.steps
        track.problem.set_load_factor(track.here.load_factor)
