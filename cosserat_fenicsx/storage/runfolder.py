"""The folder of a motion that is written as it goes: what was asked for, its states, and what it goes on from.

motion.json    what was asked for and what it is computed with, in words and numbers
scene.pickle   the scene, where it can be pickled
instants.npy   the saved states, see `instantfile`
start.npz, checkpoint.npz   what the solver remembered at the start, and seconds ago, of every rank
"""

import fcntl
import json
import os
import pickle
import time
from pathlib import Path

from cosserat_fenicsx import __version__
from cosserat_fenicsx.checks import instance
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.scene.likeness import difference, likeness, likeness_at, times_ahead
from cosserat_fenicsx.storage import checkpoints

#: s between checkpoints; and how many times longer than it takes to write one they are apart, at least.
APART, SELDOM = 2.0, 50
_FORMAT = 1
_HEAD, _SCENE, _START, _LATEST = "motion.json", "scene.pickle", "start.npz", "checkpoint.npz"


class RunFolder:
    """A folder that holds a motion.

    Args:
        place: its name; comm: MPI communicator.

    Raises:
        SceneError: no name.

    Attributes:
        place: a `pathlib.Path`.
        asked: the arguments of `simulate`; told: what a `History` says of itself.
        durations: s, that of `simulate`, and longer ones that were asked for later; ranks: their number.
    """

    def __init__(self, place, comm):
        instance("simulate", "folder", place, str | os.PathLike, "the name of a folder")
        self.place, self.comm, self._lock = Path(place), comm, None

    def make(self, scene, asked, history):
        """A new one.

        Args:
            scene: the scene; asked: the arguments of `simulate`, plain values.
            history: the empty `StoredHistory` that is to lie in it.

        Raises:
            SceneError: the folder holds a motion already, or cannot be made.
        """
        head = {
            "format": _FORMAT,
            "cosserat_fenicsx": __version__,
            "ranks": self.comm.size,
            "asked": asked,
            "durations": [asked["duration"]],
            "told": history.told(),
            "scene": likeness(scene, asked["duration"]),
            "ahead": _ahead(scene, asked["duration"]),
        }
        self._on_first(lambda: self._make(scene, _text(head)))
        history.keep_in(self.place)
        self.asked, self.told, self._last = asked, head["told"], None
        return self

    def _make(self, scene, head):
        place = self.place
        if (place / _HEAD).exists() and (place / _START).exists():  # else its process was killed before the first step
            raise SceneError(
                f"simulate.folder = {str(place)!r}: it holds a motion already: expected another name, or that it is removed "
                f"first; cosserat_fenicsx.resume({str(place)!r}), or `cosserat resume {place}`, goes on with it"
            )
        place.mkdir(parents=True, exist_ok=True)
        for name in ("instants.npy", _SCENE, _START, _LATEST):
            (place / name).unlink(missing_ok=True)
        try:
            (place / _SCENE).write_bytes(pickle.dumps(scene))
        except (pickle.PicklingError, AttributeError, TypeError):  # functions without a name to be found by
            (place / _SCENE).unlink(missing_ok=True)
        (place / _HEAD).write_text(head, encoding="utf-8")
        self._hold()

    def open(self):
        """One that is there.

        Raises:
            SceneError: there is no motion in it.
        """
        try:
            head = json.loads((self.place / _HEAD).read_text(encoding="utf-8"))
            if head["format"] != _FORMAT:
                raise SceneError(
                    f"{self.place}: its format is {head['format']}: expected {_FORMAT}, that of this release"
                )
            self.asked, self.told, self.durations = (head[name] for name in ("asked", "told", "durations"))
            self.ranks, self._likeness, self._head = head["ranks"], head["scene"], head
        except OSError as problem:
            raise SceneError(
                f"{self.place}: no motion was found there ({_HEAD}: {problem.strerror}): expected a folder that simulate(..., folder=...) wrote"
            ) from None
        except (ValueError, KeyError, TypeError) as problem:
            raise SceneError(f"{self.place / _HEAD} is damaged ({problem!r})") from None
        self._last = None
        return self

    def scene(self, given, until):
        """The scene of the motion: the one that is given, or the one in the folder.

        Args:
            given: a `Scene` or None; until: s: for how long it must be the one of the motion.

        Raises:
            SceneError: none can be had, or it is another one.
        """
        scene = given if given is not None else self._stored_scene()
        ahead = [(t, told) for t, told in self._head.get("ahead", ()) if self.durations[-1] < t <= until]
        given, expected = likeness_at(scene, [t for t, _ in ahead]), dict(self._likeness)
        for duration in self.durations:
            given |= likeness(scene, duration)
        for _, told in ahead:
            expected |= told
        differs = difference(json.loads(_text(given)), expected)
        if differs:
            raise SceneError(f"{self.place}: the scene is not the one of the motion: {differs}")
        return scene

    def _stored_scene(self):
        try:
            return pickle.loads((self.place / _SCENE).read_bytes())
        except FileNotFoundError:
            why = "the folder does not hold it, since its functions (a lambda, perhaps) have no name to be found by"
        except Exception as problem:  # whatever a module that is not there, or a damaged file, brings about
            why = f"the folder's own cannot be loaded here ({type(problem).__name__}: {problem})"
        raise SceneError(f"resume.scene = None: expected the scene of {self.place}, because {why}")

    def extend(self, duration, scene):
        """A longer duration is asked for, of the scene of the motion."""
        self.durations.append(duration)  # and with it to the head
        self._likeness |= likeness(scene, duration)
        self._head["ahead"] = _ahead(scene, duration)

        def rewrite():
            fresh = self.place / f"{_HEAD}.new"
            fresh.write_text(_text(self._head), encoding="utf-8")
            fresh.replace(self.place / _HEAD)

        self._on_first(rewrite)

    # -- what a motion goes on from ----------------------------------------------------------------------------------

    def hold(self):
        """Keep other processes from writing here.

        Raises:
            SceneError: one does.
        """
        self._on_first(self._hold)

    def _hold(self):
        self._lock = os.open(self.place, os.O_RDONLY)  # the folder itself: its files may be replaced
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            raise SceneError(
                f"{self.place}: another process is at work on this motion: expected it to end first"
            ) from None
        except OSError:
            pass  # a file system without locks

    def release(self):
        """Let other processes write here."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    @property
    def due(self):
        """Whether it is time for a checkpoint: the same on all ranks. When these are made does not change a digit."""
        now = self._last is None or time.monotonic() - self._last > self._apart
        return self.comm.bcast(now) if self.comm.size > 1 else now

    def keep(self, memory, history):
        """Write what a resumed motion goes on from; the first time also as what to start from anew.

        Args:
            memory: of this rank, see `checkpoints`.
            history: its `StoredHistory`, which is made safe first.

        Raises:
            NotStored: it cannot be written.
        """
        began = time.monotonic()
        parts = self.comm.gather(memory)
        history.settle(lambda: self._keep({str(rank): part for rank, part in enumerate(parts)}))
        self._last = time.monotonic()
        self._apart = max(APART, SELDOM * (self._last - began))

    def _keep(self, parts):
        checkpoints.write(self.place / _LATEST, parts)
        if not (self.place / _START).exists():
            checkpoints.write(self.place / _START, parts)

    def memories(self):
        """What this rank remembered, the latest first; those that cannot be read are left out."""
        for name in (_LATEST, _START):
            parts = checkpoints.read(self.place / name)
            if parts is not None and str(self.comm.rank) in parts:
                yield parts[str(self.comm.rank)]

    def _on_first(self, action):
        try:
            on_first(self.comm, action)
        except OSError as problem:
            raise SceneError(
                f"simulate.folder = {str(self.place)!r}: {problem.strerror or problem}: expected a folder that can be written to"
            ) from None


def _ahead(scene, duration):
    """[(time, likeness)] after a duration, where a scene depends on time."""
    told = ((t, likeness_at(scene, [t])) for t in times_ahead(duration))
    return [(t, values) for t, values in told if values]


def _text(head):
    return json.dumps(head, indent=1, default=lambda number: number.item())  # those of NumPy
