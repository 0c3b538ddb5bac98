"""The loop over time of a drill-string: chunks of steps, the rows and profiles that are kept, checkpoints."""

import numpy as np

from cosserat_fenicsx.drilling.history import COLUMNS
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.ranks import world

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
        """Advance to a time (s), and return the history.

        Raises:
            NotConverged, Interrupted, NotStored: with the history so far as `.path`.
        """
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
