"""The folder that a motion is written to during the run: its arguments, its saved states and its checkpoints.

motion.json    the arguments of `simulate`, versions, and the fingerprint of the scene
scene.json     the scene as data, where it has that form: no folder can run code of its own
instants.npy   the saved states, see `instantfile`; the checkpoints tell their checksum
start.npz, checkpoint.npz   the data of all ranks that the solver continues from: at the start, and the latest
"""

import json
import os
import time
from pathlib import Path

from cosserat_fenicsx import __version__
from cosserat_fenicsx.checks import instance, warn
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.scene.as_data import NotData, from_data, to_data
from cosserat_fenicsx.storage import checkpoints
from cosserat_fenicsx.storage.described import difference, fingerprint, fingerprint_at, times_ahead
from cosserat_fenicsx.storage.entries import AN_INDEX
from cosserat_fenicsx.storage.entries import checked as checked_entries
from cosserat_fenicsx.storage.head import checked
from cosserat_fenicsx.storage.lock import FolderLock
from cosserat_fenicsx.storage.vacant import check_vacant

#: Least time between checkpoints: in s, and as a multiple of the time that it takes to write one.
APART, SELDOM = 2.0, 50
_FORMAT = 2
_STATES_FILE = "instants.npy"
# The entry of a checkpoint that tells of the saved states.
_STATES = "states"
_OF_PARTS = {f"{_STATES}.rows": AN_INDEX, f"{_STATES}.crc32": (lambda value: type(value) is int, "a whole number")}
_HEAD, _SCENE, _START, _LATEST = "motion.json", "scene.json", "start.npz", "checkpoint.npz"


class RunFolder:
    """A folder that holds a motion.

    Args:
        place: its name; comm: MPI communicator.

    Raises:
        SceneError: `place` is not a name.

    Attributes:
        place: a `pathlib.Path`.
        asked: the arguments of `simulate`; told: the description of the `History`, see `StoredHistory.told`.
        durations: s, that of `simulate` and those of later continuations, ascending; ranks: number of MPI ranks.
    """

    def __init__(self, place, comm):
        instance("simulate", "folder", place, str | os.PathLike, "the name of a folder")
        self.place, self.comm = Path(place), comm
        self._lock = FolderLock(self.place, "motion")

    def make(self, scene, asked, history):
        """Make the folder for a new motion.

        Args:
            scene: the scene; asked: the arguments of `simulate`, plain values.
            history: the empty `StoredHistory` whose states will be written there.

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
            "scene": fingerprint(scene, asked["duration"]),
            "ahead": _ahead(scene, asked["duration"]),
        }
        self._on_first(lambda: self._make(scene, _text(head)))
        history.keep_in(self.place)
        self.asked, self.told, self._last = asked, head["told"], None
        return self

    def _make(self, scene, head):
        place = self.place
        if (place / _HEAD).exists() and (place / _START).exists():  # without both, it was killed before the first step
            raise SceneError(
                f"simulate.folder = {str(place)!r}: it holds a motion already: expected another name, or that it is "
                f"removed first; cosserat_fenicsx.resume({str(place)!r}), or `cosserat resume {place}`, continues it"
            )
        check_vacant(place, "simulate.folder", _HEAD, (_HEAD, _SCENE))
        if not (place / _HEAD).exists():
            check_vacant(place, "simulate.folder", _HEAD, (_STATES_FILE, _START, _LATEST))
        place.mkdir(parents=True, exist_ok=True)
        for name in (_STATES_FILE, _SCENE, _START, _LATEST):
            (place / name).unlink(missing_ok=True)
        try:
            data = to_data(scene)
        except NotData as problem:
            data = {"missing": str(problem)}
        for name, text in ((_SCENE, _text(data)), (_HEAD, head)):
            with replaced(place / name) as fresh:
                fresh.write_text(text, encoding="utf-8")
        self._lock.take()

    def open(self):
        """Read an existing folder.

        Raises:
            SceneError: it holds no motion.
        """
        try:
            head = json.loads((self.place / _HEAD).read_text(encoding="utf-8"))
            if head["format"] != _FORMAT:
                raise SceneError(
                    f"{self.place}: its format is {head['format']}: expected {_FORMAT}, that of this release"
                )
            head.setdefault("ahead", [])
            checked(head)
            self.asked, self.told, self.durations = (head[name] for name in ("asked", "told", "durations"))
            self.ranks, self._fingerprint, self._head = head["ranks"], head["scene"], head
        except OSError as problem:
            raise SceneError(
                f"{self.place}: no motion was found there ({_HEAD}: {problem.strerror}): expected a folder that "
                "simulate(..., folder=...) wrote"
            ) from None
        except SceneError:
            raise
        except (ValueError, KeyError, TypeError, RecursionError) as problem:
            raise SceneError(
                f"{self.place / _HEAD} is damaged ({problem}): expected the file that simulate wrote"
            ) from None
        self._last = None
        return self

    def scene(self, given, until):
        """The scene of the motion: the given one, or the one stored in the folder.

        Args:
            given: a `Scene` or None; until: time (s) up to which it must agree with the fingerprint.

        Raises:
            SceneError: no scene is given or stored, or it disagrees with the fingerprint.
        """
        scene = given if given is not None else self._stored_scene()
        ahead = [(t, told) for t, told in self._head["ahead"] if self.durations[-1] < t <= until]
        given, expected = fingerprint_at(scene, [t for t, _ in ahead]), dict(self._fingerprint)
        for duration in self.durations:
            given |= fingerprint(scene, duration)
        for _, told in ahead:
            expected |= told
        differs = difference(json.loads(_text(given)), expected)
        if differs:
            raise SceneError(f"{self.place}: the scene is not the one of the motion: {differs}")
        return scene

    def _stored_scene(self):
        try:
            data = json.loads((self.place / _SCENE).read_text(encoding="utf-8"))
            if "missing" not in data:
                return from_data(data)
            why = f"the folder does not hold it, since in {data['missing']}"
        except FileNotFoundError:
            why = "the folder does not hold it"
        except (OSError, ValueError, TypeError, RecursionError, SceneError) as problem:  # a damaged file
            why = f"the folder's own cannot be loaded here ({type(problem).__name__}: {problem})"
        raise SceneError(f"resume.scene = None: expected the scene of {self.place}, because {why}")

    def extend(self, duration, scene):
        """Record a longer duration (s) of the motion, with the scene's fingerprint up to there."""
        self.durations.append(duration)  # this list is also in self._head
        self._fingerprint |= fingerprint(scene, duration)
        self._head["ahead"] = _ahead(scene, duration)

        def rewrite():
            with replaced(self.place / _HEAD) as fresh:
                fresh.write_text(_text(self._head), encoding="utf-8")

        self._on_first(rewrite)

    # -- locks and checkpoints ---------------------------------------------------------------------------------------

    def hold(self):
        """Lock the folder, so that no other process writes to it.

        Raises:
            SceneError: another process has locked it.
        """
        self._on_first(self._lock.take)

    def release(self):
        """Unlock the folder."""
        self._lock.release()

    @property
    def due(self):
        """Whether it is time for a checkpoint, the same on all ranks. Checkpoints do not influence the motion."""
        now = self._last is None or time.monotonic() - self._last > self._apart
        return self.comm.bcast(now) if self.comm.size > 1 else now

    def keep(self, memory, history):
        """Write a checkpoint; the first one is also kept as that of the start.

        Args:
            memory: the data of this rank, see `checkpoints`.
            history: the `StoredHistory`, whose states are flushed to the disk first.

        Raises:
            NotStored: it cannot be written.
        """
        began = time.monotonic()
        parts = self.comm.gather(memory)
        history.settle(
            lambda: self._keep({_STATES: history.states(), **{str(rank): part for rank, part in enumerate(parts)}})
        )
        self._last = time.monotonic()
        self._apart = max(APART, SELDOM * (self._last - began))

    def _keep(self, parts):
        checkpoints.write(self.place / _LATEST, parts)
        if not (self.place / _START).exists():
            checkpoints.write(self.place / _START, parts)

    def memories(self):
        """The readable checkpoints of this rank, the latest first: the data, what they say of the saved states (see
        `StoredHistory.sound`), and why they cannot be used, "" where they can."""
        for name in (_LATEST, _START):
            memory, states, why = None, None, ""
            try:
                parts = checkpoints.read(self.place / name)
                if parts is not None:
                    memory = parts.get(str(self.comm.rank))
                    if parts[checkpoints.CHECKSUM] is not None:
                        states = checked_entries(parts, _OF_PARTS)[_STATES]
                    elif self.comm.rank == 0:
                        warn(f"{self.place / name} has no checksum, as those of earlier releases: numbers that were "
                             "changed in it, or in the saved states, are not noticed")  # fmt: skip
                    why = (
                        "" if isinstance(memory, dict) else f"{self.place / name} has no data of rank {self.comm.rank}"
                    )
            except (checkpoints.Damaged, ValueError) as problem:
                why = str(problem)
            yield memory if not why else None, states, why

    def _on_first(self, action):
        try:
            on_first(self.comm, action)
        except OSError as problem:
            raise SceneError(
                f"simulate.folder = {str(self.place)!r}: {problem.strerror or problem}: expected a folder that can be "
                "written to"
            ) from None


def _ahead(scene, duration):
    """[(time, fingerprint at that time)] after a duration, s; empty where the scene does not depend on time."""
    told = ((t, fingerprint_at(scene, [t])) for t in times_ahead(duration))
    return [(t, values) for t, values in told if values]


def _text(head):
    return json.dumps(head, indent=1, default=lambda number: number.item())  # NumPy's numbers
