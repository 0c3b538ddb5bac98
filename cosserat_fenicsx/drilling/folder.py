"""The folder that a drill-string in motion is written to during the run.

drilling.json    the arguments of `simulate_drilling`, the model and what decided for it, the fingerprint of the scene
scene.json       the scene as data, where it has that form: no folder can run code
series.f64, profiles.f64   rows of numbers, 8 bytes each, see `history.COLUMNS`; only complete rows count
checkpoint.npz   the memory of the model and of the loop, how many rows there were then, and checksums of these

Rows after those that the checkpoint tells of are computed again, to the same digits.
"""

import json
import os
import time
import zlib
from pathlib import Path

import numpy as np

from cosserat_fenicsx import __version__
from cosserat_fenicsx.checks import instance, warn
from cosserat_fenicsx.drilling.as_data import fingerprint, from_data, to_data
from cosserat_fenicsx.drilling.history import COLUMNS, DrillingHistory
from cosserat_fenicsx.drilling.protocol import PROFILE
from cosserat_fenicsx.errors import NotStored, SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.scene.as_data import NotData
from cosserat_fenicsx.storage import checkpoints
from cosserat_fenicsx.storage.described import difference
from cosserat_fenicsx.storage.entries import (
    A_NUMBER,
    A_POSITIVE,
    A_TEXT,
    A_WHOLE,
    AN_INDEX,
    POSITIVE_OR_NONE,
    SOME_TEXTS,
    checked,
    numbers,
    or_none,
    whole,
)
from cosserat_fenicsx.storage.lock import FolderLock
from cosserat_fenicsx.storage.vacant import check_vacant

#: Least time between checkpoints: in s, and as a multiple of the time that it takes to write one.
APART, SELDOM = 2.0, 20
_FORMAT = 2
_HEAD, _SCENE, _LATEST = "drilling.json", "scene.json", "checkpoint.npz"
_SERIES, _PROFILES = "series.f64", "profiles.f64"
_FILES = (_SERIES, _PROFILES)
# What drilling.json must hold.
_ENTRIES = {
    "format": A_NUMBER,
    "scene": (lambda value: isinstance(value, dict), "the numbers of a scene"),
    "model": A_TEXT,
    "why": SOME_TEXTS,
    "dt": A_POSITIVE,
    "depths": (lambda value: numbers(value) and sorted(value) == value, "ascending numbers (m)"),
    "duration": A_POSITIVE,
    "asked.model": A_TEXT,
    "asked.dt": POSITIVE_OR_NONE,
    "asked.elements": (or_none(whole), "a whole number above zero or null"),
    "apart.save_every": A_WHOLE,
    "apart.profile_every": A_WHOLE,
}
# And what a checkpoint must, beside what the model remembers.
_OF_MEMORY = {
    "rows": AN_INDEX,
    "profiles": AN_INDEX,
    "model": (lambda value: isinstance(value, dict), "what the model remembers"),
}
_SUMS_OF_FILES = {
    "sums": (
        lambda value: isinstance(value, dict) and all(type(value.get(name)) is int for name in _FILES),
        "checksums of the rows",
    )
}
# Relative differences of times below this are rounding.
_ROUNDING = 1e-9


class DrillingFolder:
    """A folder that holds a drill-string in motion. Rank 0 writes.

    Args:
        place: its name.

    Raises:
        SceneError: `place` is no name.

    Attributes:
        place: a `pathlib.Path`. head: what is in drilling.json.
    """

    def __init__(self, place):
        instance("simulate_drilling", "folder", place, str | os.PathLike, "the name of a folder")
        self.place, self.head, self._last, self._apart = Path(place), None, None, APART
        self._sums = dict.fromkeys(_FILES, 0)  # checksums of the files so far
        self._lock = FolderLock(self.place, "motion")

    def make(self, scene, history, asked):
        """Make the folder for a new motion.

        Args:
            history: the empty `DrillingHistory`. asked: arguments of `simulate_drilling`, plain values.

        Raises:
            SceneError: it holds a motion already, or cannot be made.
        """
        try:
            data = to_data(scene)
        except NotData as problem:
            data = {"missing": str(problem)}
        self.head = {
            "format": _FORMAT, "cosserat_fenicsx": __version__, **asked, "model": history.model,
            "why": list(history.why), "dt": history.dt, "depths": history.depths.tolist(),
            "scene": fingerprint(scene, asked["duration"]),
        }  # fmt: skip
        history.folder = self.place

        def made():
            if (self.place / _HEAD).exists():
                raise SceneError(
                    f"simulate_drilling.folder = {str(self.place)!r}: it holds a motion already: expected another "
                    "name, or that it is removed first; "
                    f"cosserat_fenicsx.resume_drilling({str(self.place)!r}) continues it"
                )
            check_vacant(self.place, "simulate_drilling.folder", _HEAD, (_SCENE, _SERIES, _PROFILES, _LATEST))
            self.place.mkdir(parents=True, exist_ok=True)
            for name in (_SERIES, _PROFILES):
                (self.place / name).write_bytes(b"")
            (self.place / _LATEST).unlink(missing_ok=True)
            self._put(_SCENE, data)
            self._put(_HEAD, self.head)  # the last one: without it there is no motion
            self._lock.take()

        self._try(made)
        return self

    def _put(self, name, data):
        with replaced(self.place / name) as fresh:
            fresh.write_text(json.dumps(data, indent=1), encoding="utf-8")

    def _try(self, action):
        try:
            on_first(world(), action)
        except OSError as problem:
            raise SceneError(
                f"simulate_drilling.folder = {str(self.place)!r}: {problem.strerror or problem}: expected a folder "
                "that can be written to"
            ) from None

    def open(self):
        """Read what drilling.json says.

        Raises:
            SceneError: there is no motion, or the file is damaged.
        """
        try:
            head = json.loads((self.place / _HEAD).read_text(encoding="utf-8"))
        except OSError as problem:
            raise SceneError(
                f"{self.place}: no motion of a drill-string was found there ({_HEAD}: {problem.strerror}): expected a "
                "folder that simulate_drilling(..., folder=...) wrote"
            ) from None
        except (ValueError, RecursionError) as problem:
            raise SceneError(
                f"{self.place / _HEAD} is damaged ({problem}): expected what simulate_drilling wrote"
            ) from None
        try:
            checked(head, {"format": _ENTRIES["format"]})
            if head["format"] != _FORMAT:
                raise SceneError(
                    f"{self.place}: its format is {head['format']}: expected {_FORMAT}, that of this release"
                )
            checked(head, _ENTRIES)
        except SceneError:
            raise
        except ValueError as problem:
            raise SceneError(
                f"{self.place / _HEAD} is damaged ({str(problem).split()[0]}): {problem}; expected what "
                "simulate_drilling wrote"
            ) from None
        self.head = head
        return self

    def scene(self, given=None):
        """The scene of the motion: the given one, compared with the fingerprint, or the one that is stored.

        Raises:
            SceneError: it is another one, or there is none.
        """
        if given is None:
            given = self._stored_scene()
        differs = difference(json.loads(json.dumps(fingerprint(given, self.head["duration"]))), self.head["scene"])
        if differs:
            raise SceneError(f"{self.place}: the scene is not the one of the motion: {differs}")
        return given

    def _stored_scene(self):
        try:
            data = json.loads((self.place / _SCENE).read_text(encoding="utf-8"))
            if "missing" not in data:
                return from_data(data)
            why = f"the folder does not hold it: {data['missing']}"
        except (OSError, ValueError, TypeError, RecursionError) as problem:
            why = f"the folder's own cannot be read ({problem})"
        raise SceneError(f"resume_drilling.scene = None: expected the scene of {self.place}, since {why}")

    def history(self, scene, rows=None, profiles=None):
        """The `DrillingHistory` of the complete rows, or of the first ones where numbers of them are given."""
        told = self.head
        series = self._read(_SERIES, len(COLUMNS), rows)
        along = self._read(_PROFILES, 1 + len(PROFILE) * len(told["depths"]), profiles)
        return DrillingHistory(scene, told["model"], told["why"], told["dt"], told["depths"], series, along,
                               folder=self.place)  # fmt: skip

    def _read(self, name, columns, rows):
        try:
            numbers = np.fromfile(self.place / name)
        except OSError as problem:
            raise SceneError(
                f"{self.place / name}: cannot be read ({problem.strerror}): expected the rows of a motion"
            ) from None
        whole = numbers[: len(numbers) // columns * columns].reshape(-1, columns)
        return whole if rows is None else whole[:rows].copy()

    def extend(self, duration, scene):
        """Note a longer duration (s) than the last one, with the scene's fingerprint up to there."""
        self.head |= {"duration": duration, "scene": fingerprint(scene, duration)}
        self._try(lambda: self._put(_HEAD, self.head))

    @property
    def asked(self):
        """The last duration that was asked for, s."""
        return self.head["duration"]

    def hold(self):
        """Lock the folder, so that no other process writes to it.

        Raises:
            SceneError: another one does.
        """
        self._try(self._lock.take)

    def release(self):
        """Unlock the folder."""
        self._lock.release()

    # -- rows and checkpoints ----------------------------------------------------------------------------------------

    def _sizes(self, rows, profiles):
        """{name: bytes} of so many rows in the files."""
        return {
            _SERIES: 8 * rows * len(COLUMNS),
            _PROFILES: 8 * profiles * (1 + len(PROFILE) * len(self.head["depths"])),
        }

    def cut(self, rows, profiles):
        """Leave the first rows alone, before a motion is continued; without rows no checkpoint, which tells of some."""
        sizes = self._sizes(rows, profiles)

        def done():
            if not rows:
                (self.place / _LATEST).unlink(missing_ok=True)
            for name, size in sizes.items():
                os.truncate(self.place / name, size)
                self._sums[name] = _checksum(self.place / name, size)

        self._try(done)

    def wrong(self, memory):
        """Why a checkpoint does not belong to the rows in the files, in words; None where it does. The same on all
        ranks; in checkpoints of releases before there were checksums, the numbers of rows alone are compared.
        """

        def compared():
            told = memory.get("sums")
            for name, size in self._sizes(memory["rows"], memory["profiles"]).items():
                try:
                    if (self.place / name).stat().st_size < size:
                        return f"{self.place / name} has fewer rows than its checkpoint tells of"
                    if told and told.get(name) != _checksum(self.place / name, size):
                        return f"{self.place / name}: its numbers are not those that were written"
                except OSError as problem:
                    return f"{self.place / name} cannot be read ({problem.strerror})"
            return None

        comm = world()
        return comm.bcast(compared() if comm.rank == 0 else None)

    def not_in_order(self, history):
        """Why rows after those of the checkpoint are none of this motion, in words: their times; or None."""
        apart = self.head["apart"]
        for name, times, steps in (
            (_SERIES, history.times, apart["save_every"]), (_PROFILES, history.profile_times, apart["profile_every"])
        ):  # fmt: skip
            expected = self.head["dt"] * steps * np.arange(1, len(times) + 1)
            if not np.allclose(times, expected, rtol=_ROUNDING, atol=0):
                return f"{self.place / name}: the times of its rows are not those of the motion"
        return None

    def add(self, history, rows, profiles):
        """Append rows to the files.

        Raises:
            NotStored: they cannot be written.
        """

        def written():
            for name, added in ((_SERIES, rows), (_PROFILES, profiles)):
                if len(added):
                    data = np.ascontiguousarray(added, dtype=float).tobytes()
                    rest = memoryview(data)
                    with open(self.place / name, "ab", buffering=0) as stream:
                        while rest:  # a nearly full disk takes a part
                            rest = rest[stream.write(rest) :]
                    self._sums[name] = zlib.crc32(data, self._sums[name])

        self._or_not_stored(history, written)

    @property
    def due(self):
        """Whether it is time for a checkpoint, the same on all ranks; checkpoints do not influence the motion."""
        return world().bcast(self._last is None or time.monotonic() - self._last > self._apart)

    def keep(self, history, memory):
        """Write a checkpoint, after the rows so far.

        Raises:
            NotStored: it cannot be written.
        """
        began = time.monotonic()

        def written():
            for name in (_SERIES, _PROFILES):
                with open(self.place / name, "rb") as stream:
                    os.fsync(stream.fileno())
            checkpoints.write(self.place / _LATEST, {**memory, "sums": dict(self._sums)})

        self._or_not_stored(history, written)
        self._last = time.monotonic()
        self._apart = max(APART, SELDOM * (self._last - began))

    def memory(self, tell=True):
        """What the last checkpoint holds, the same on all ranks; None where there is none that can be gone on from.

        Args:
            tell: whether to warn where it is damaged.
        """
        comm = world()
        return comm.bcast(self._read_checkpoint(tell) if comm.rank == 0 else None)

    def _read_checkpoint(self, tell):
        try:
            memory = checkpoints.read(self.place / _LATEST)
            if memory is None:
                return None
            checked(memory, _OF_MEMORY if memory[checkpoints.CHECKSUM] is None else {**_OF_MEMORY, **_SUMS_OF_FILES})
        except (checkpoints.Damaged, ValueError) as problem:
            if tell:
                place = "" if isinstance(problem, checkpoints.Damaged) else f"{self.place / _LATEST}: "
                self.tell_lost(f"{place}{problem}")
            return None
        if memory[checkpoints.CHECKSUM] is None:
            warn(f"{self.place / _LATEST} has no checksum, as those of earlier releases: numbers that were changed in "
                 "it, or in the rows, are not noticed")  # fmt: skip
            memory.pop("sums", None)
        return memory

    def not_recalled(self, memory, running):
        """Let a `StringModel` go on from what a checkpoint remembers. Why it cannot, in words, or None."""
        found = checkpoints.unlike(memory["model"], running.memory())
        found = found or checkpoints.not_recalled(running.recall, memory["model"])
        return found and f"{self.place / _LATEST}: {found}"

    def tell_lost(self, why):
        """Warn that a motion is computed from its start again."""
        if world().rank == 0:
            warn(f"{why}: the motion is computed from its start again")

    def _or_not_stored(self, history, action):
        try:
            on_first(world(), action)
        except OSError as problem:
            raise NotStored(
                f"{self.place}: the motion cannot be written: {problem.strerror or problem}. Make room; "
                f"cosserat_fenicsx.resume_drilling({str(self.place)!r}) continues it",
                history,
            ) from None


def _checksum(file, size):
    """The CRC-32 of the first bytes of a file."""
    total = 0
    with open(file, "rb") as stream:
        while size > 0 and (data := stream.read(min(size, 1 << 20))):
            total, size = zlib.crc32(data, total), size - len(data)
    return total
