"""Folders of running computations: written during the run, read at any time, resumed whatever ended the run.

stored.json      what the folder holds, the arguments, the mark of all inputs, and the scene as data where it has that
                 form: no folder can run code of its own
NAME.npy         tables of rows, see `files.Table`; only complete rows count
start.npz, checkpoint.npz   the first and the latest checkpoint, with the numbers of rows and their checksums
rows.RANK.jsonl  independent rows, one JSON object a line, appended as they come

Every file has a checksum. Folders of other formats than `FORMAT` are refused.
"""

import contextlib
import fcntl
import importlib
import json
import os
import shlex
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cosserat_fenicsx import __version__
from cosserat_fenicsx.checks import File, instance, warn
from cosserat_fenicsx.errors import Interrupted, NotStored, SceneError
from cosserat_fenicsx.parts import NotData, from_data, to_data
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.storage import files, mark

if TYPE_CHECKING:
    from mpi4py import MPI

FORMAT = 6
#: What says what a folder holds; and the files that did so in earlier releases.
HEAD, EARLIER = "stored.json", ("motion.json", "drilling.json", "study.json")
_START, _LATEST, _LINES = "start.npz", "checkpoint.npz", "rows.{}.jsonl"
# Entry of a checkpoint with the number of rows of each table, and their checksum.
_ROWS = "rows"
# Exceptions that damaged data of a file can cause.
_UNFIT = (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError, MemoryError)
_TOLD = {"count": 0, files.CHECKSUM: 0}


@dataclass(frozen=True)
class Kind:
    """Description of the files of one kind of computation; all kinds share `Store`.

    Attributes:
        what: its name, such as "motion", also in stored.json.
        home: the module, below the package, whose functions `go_on(store, scene, duration, progress)` and
            `read(store, scene)` continue and read it, and whose `KIND` this is.
        call: the function whose argument `folder` names the folder.
        again: how to resume it, a text with {place}, and {quoted} for a shell. differs: the beginning of messages on
            another computation.
        tables: the names of its tables.
        each_rank: whether every rank has rows and a memory of its own.
        starts: whether there is a checkpoint of the start, before which nothing is stored.
        rounding: relative difference of arguments that counts as equal.
        scene: the class of the scene that is stored as data, or None.
    """

    what: str
    home: str
    call: str
    again: str
    differs: str
    tables: tuple[str, ...] = ()
    each_rank: bool = False
    starts: bool = False
    rounding: float = 0.0
    scene: type | None = None


class Nowhere:
    """In place of a `Store`: nothing is stored."""

    due, kept = False, ""

    def put(self, *given, **rows):
        """See `Store`, and so for all others."""

    keep = checkpoint = release = put

    def lines(self, read):
        return []

    @contextlib.contextmanager
    def ending(self, result):
        """Context manager of a computation: Ctrl-C becomes `Interrupted`, and the folder is released at the end."""
        try:
            yield
        except Interrupted:
            raise
        except KeyboardInterrupt:
            raise Interrupted(result, self.kept) from None
        finally:
            self.release()


class Store(Nowhere):
    """A folder of one `Kind`, of all ranks of a communicator. All ranks call; rank 0 writes, but for rows of each rank.
    place: a `pathlib.Path`; head: the content of stored.json; tables: {name: `files.Table`}."""

    #: Least time between checkpoints: in s, and as a multiple of the time of writing one.
    APART, SELDOM = 2.0, 50

    def __init__(self, place, kind, comm=None):
        instance(kind.call if kind else "resume", "folder", place, str | os.PathLike, "the name of a folder")
        self.place, self.kind, self.comm, self.head = Path(place), kind, comm or world(), None
        self.tables, self._lock, self._lines, self._last, self._apart = {}, None, None, None, self.APART

    # -- what the folder holds ---------------------------------------------------------------------------------------

    def make(self, asked, scene, duration):
        """Make the folder for a new motion of a scene up to a duration (s), and lock it; asked: {name: plain value},
        entries of `head`. A SceneError where it holds a computation, or files of the user's own that have the names of
        this one's, where another process writes to it, or it cannot be made."""
        data = _data(lambda: to_data(scene))
        return self._made({**asked, "scene": data, **_marked(scene, mark.sample_times(duration))})

    def _made(self, told):
        told = {"holds": self.kind.what, "home": self.kind.home, **told}
        seed = json.loads(files.sealed(told))[files.CHECKSUM]
        self.head = {"format": FORMAT, "cosserat_fenicsx": __version__, "ranks": self.comm.size, "seed": seed, **told}
        self._on_first(self._make)
        return self

    def _make(self):
        self.place.mkdir(parents=True, exist_ok=True)
        self._take()
        with self._released_on_failure():
            self._check_vacant()
            for file in self._own():
                file.unlink()
            self._put_head()

    @contextlib.contextmanager
    def _released_on_failure(self):
        try:
            yield
        except BaseException:
            self.release()
            raise

    def _put_head(self):
        files.replace(self.place / HEAD, files.sealed(self.head, indent=1))

    def _own(self):
        """The files in the folder that have names of this kind's, but for stored.json."""
        names = [f"{name}.npy" for name in self.kind.tables] + ([_START, _LATEST] if self.kind.starts else [])
        return [file for name in (*names, _LINES.format("*")) for file in self.place.glob(name)]

    def _check_vacant(self):
        """Refuse a folder that holds something, but for what was ended before its start."""
        where, what = f"{self.kind.call}.folder = {str(self.place)!r}", self.kind.what
        held = _head(self.place)["holds"] if (self.place / HEAD).exists() else None
        if held == what and self.kind.starts and not (self.place / _START).exists():
            return
        if held == what:
            raise SceneError(
                f"{where}: it holds a {what} already: expected another name, or that it is removed first; {self.again}"
            )
        for name in (HEAD, *EARLIER):
            if (self.place / name).exists():
                raise SceneError(f"{where}: it holds {name}, and so another computation: expected a new name")
        if own := self._own():
            raise SceneError(
                f"{where}: it holds {own[0].name}, which no {what} wrote: expected a new name, or a folder without "
                "files of that name"
            )

    def open(self):
        """Read stored.json; SceneError where this release reads nothing there."""
        self.head = self._from_first(lambda: _head(self.place))
        if self.kind is None:
            self.kind = self.home.KIND
        if self.head["holds"] != self.kind.what:
            raise SceneError(f"{self.place}: it holds a {self.head['holds']}: expected a {self.kind.what}")
        return self

    def extend(self, scene, until, **changes):
        """Store other entries of `head`, and the mark of the scene up to a later end, s."""
        self.head |= {**changes, **_marked(scene, sorted({*self.head["times"], *mark.sample_times(until)}))}
        self._on_first(self._put_head)

    def compare(self, marked, until=float("inf")):
        """Refuse another computation than that in the folder, by the mark of its inputs on rank 0 up to a time, s."""

        def compared():
            given, expected = (mark.until(x, until) for x in (json.loads(json.dumps(marked)), self.head["mark"]))
            what = self.kind.what.partition(" of ")[0]
            differs = mark.difference(given, expected, what, self.kind.rounding)
            if differs:
                raise SceneError(f"{self.place}: {self.kind.differs}: {differs}")

        on_first(self.comm, compared)

    def scene(self, given, until):
        """The scene: the given one, compared with that of the folder up to a time (s), or the stored one."""
        scene = self._stored_scene() if given is None else given
        times = [t for t in self.head["times"] if t <= until * (1 + 1e-12)]
        self.compare(_marked(scene, times)["mark"], until)
        return scene

    def _stored_scene(self):
        data = self.head["scene"]
        try:
            if "missing" not in data:
                return from_data(self.kind.scene, data)
            why = f"the folder does not hold it: {data['missing']}"
        except (SceneError, *_UNFIT) as problem:
            why = f"the folder's own cannot be loaded here ({type(problem).__name__}: {problem})"
        raise SceneError(f"resume.scene = None: expected the scene of {self.place}, since {why}")

    @property
    def home(self):
        """The module that continues and reads what the folder holds, see `Kind`."""
        return importlib.import_module(f"cosserat_fenicsx.{self.head['home']}")

    @property
    def again(self):
        """How to resume the computation, in words."""
        return self.kind.again.format(place=str(self.place), quoted=shlex.quote(str(self.place)))

    @property
    def kept(self):
        """Where the result so far is kept, and how to resume, for `Interrupted`."""
        return f"; they are kept in {self.place}, and {self.again}"

    # -- one process at a time ---------------------------------------------------------------------------------------

    def hold(self):
        """Lock the folder against other processes; SceneError where one of them has locked it."""
        self._on_first(self._take)

    def _take(self):
        """Lock the folder itself, since its files may be replaced; the system releases it where the process ends."""
        lock = os.open(self.place, os.O_RDONLY)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            raise SceneError(
                f"{self.place}: another process is at work on this {self.kind.what}: expected it to end first"
            ) from None
        except OSError:
            pass  # a file system without locks
        self._lock = lock

    def release(self):
        """Unlock the folder, and close its files."""
        if self._lines is not None:
            with contextlib.suppress(OSError):  # `keep` has raised it
                self._lines.close()
        if self._lock is not None:
            os.close(self._lock)
        self._lines = self._lock = None

    # -- rows that stand for themselves ------------------------------------------------------------------------------

    def begin(self, marked, as_data=None):
        """Make the folder, or resume it where it holds the same computation; errors: see `make` and `compare`; marked:
        the mark of all inputs; as_data: function that gives the arguments as data."""
        if self._from_first(lambda: holds(self.place)) != self.kind.what:
            return self._made({"scene": _data(as_data) if as_data else None, "mark": marked})
        self.open().hold()
        with self._released_on_failure():
            self.compare(marked)
        return self

    def lines(self, read):
        """[read(row)] of the stored rows. A row that is damaged, or that `read` refuses by an exception, is left out
        with a warning, and removed from its file where the folder is locked."""
        return self._from_first(
            lambda: [row for file in sorted(self.place.glob(_LINES.format("*"))) for row in self._lines_of(file, read)]
        )

    def _lines_of(self, file, read):
        found, sound, lost = [], [], []
        *lines, rest = file.read_bytes().split(b"\n")
        for k, line in enumerate(lines, start=1):
            try:
                found.append(read(files.unsealed(line, self.head["seed"])))
                sound.append(line + b"\n")
            except (files.Damaged, *_UNFIT) as problem:
                lost.append(f"line {k}: {problem}")
        if self._lock is not None and (lost or rest):  # the rest: of a line that was not written to its end
            files.replace(file, b"".join(sound))
        if lost:
            more = f", and {len(lost) - 1} more" if len(lost) > 1 else ""
            warn(f"{file}, {lost[0]}{more}: left out, and computed again")
        return found

    def keep(self, row, result=()):
        """Append a row, a dict, so that it survives the end of the process; result: so far. NotStored where it cannot
        be written; an OSError where every rank has rows of its own."""
        if self.kind.each_rank:
            self._append(row)
        else:
            self._or_not_stored(lambda: self._append(row), result, f"a row of the {self.kind.what}")

    def _append(self, row):
        if self._lines is None:
            self._lines = (self.place / _LINES.format(self.comm.rank)).open("ab", buffering=0)
        rest = memoryview(files.sealed(row, self.head["seed"]))
        while rest:  # a nearly full disk takes a part
            rest = rest[self._lines.write(rest) :]

    # -- tables and checkpoints --------------------------------------------------------------------------------------

    def table(self, name, accept):
        """The `files.Table` of one of the kind's names, after `make` or `open`; `accept`: see there."""
        self.tables[name] = files.Table(self.place / f"{name}.npy", accept, self.head["seed"])
        return self.tables[name]

    def put(self, result, what, **rows):
        """Append rows to tables, by their names; NotStored, with the result so far, where they cannot be written."""

        def written():
            for name, added in rows.items():
                if len(added):
                    self.tables[name].put(added)

        self._or_not_stored(written, result, what)
        if self.comm.rank:
            for name in rows:
                self.tables[name].look()

    @property
    def due(self):
        """Whether it is time for a checkpoint, the same on all ranks. Checkpoints do not influence the computation."""
        return self.comm.bcast(self._last is None or time.monotonic() - self._last > self._apart)

    def checkpoint(self, memory, result):
        """Write a checkpoint of the data of this rank after the rows so far; the first is kept as that of the start."""
        began = time.monotonic()
        parts = self.comm.gather(memory) if self.kind.each_rank else [memory]

        def written():
            told = {}
            for name, table in self.tables.items():
                table.settle()
                told[name] = {"count": table.next, files.CHECKSUM: table.checksum(table.next)}
            whole = {_ROWS: told, **{str(rank): part for rank, part in enumerate(parts)}}
            for name in (_START, _LATEST):
                if name == _LATEST or not (self.place / name).exists():
                    files.write_checkpoint(self.place / name, whole, self.head["seed"])

        self._or_not_stored(written, result, f"what the {self.kind.what} resumes from")
        self._last = time.monotonic()
        self._apart = max(self.APART, self.SELDOM * (self._last - began))

    def memory(self, like=None, recall=None):
        """The latest checkpoint of this rank whose rows are stored, of the structure of `like`; with `recall`, which
        restores the data, and raises where they do not fit, the computation continues from it."""
        lost = []
        for name in (_LATEST, _START):
            whole, memory, why = self._read(name, like or {})
            why = next(filter(None, self.comm.allgather(why)), "")
            why = why or self._from_first(lambda whole=whole: self._rows_differ(whole))
            if not why and recall is None:
                return memory
            why = why or self._not_recalled(name, recall, memory)
            if not why:
                self._go_on_from(whole[_ROWS], lost)
                return memory
            lost.append(why)
        raise SceneError(
            f"{self.place}: no checkpoint can be read ({_LATEST} and {_START} are missing or damaged; {lost[0]}): "
            f"expected a new run by {self.kind.call}"
        )

    def _read(self, name, like):
        """(a whole checkpoint, the part of this rank, why it cannot be used or ""). Not collective."""
        file, rank = self.place / name, str(self.comm.rank if self.kind.each_rank else 0)
        try:
            whole = files.read_checkpoint(file, self.head["seed"])
            if whole is None:
                return None, None, f"{file} is missing"
            found = files.unlike(whole, {rank: like, _ROWS: {name: _TOLD for name in self.tables}})
            return whole, whole.get(rank), f"{file}: {found}" if found else ""
        except files.Damaged as problem:
            return None, None, str(problem)

    def _rows_differ(self, whole):
        """How the rows in the tables differ from those of a checkpoint, in words; "" where they agree."""
        for name, table in self.tables.items():
            table.look()
            told = whole[_ROWS][name]
            if not 0 <= told["count"] <= len(table):
                return f"{table.file} has fewer rows than its checkpoint says"
            if table.checksum(told["count"]) != told[files.CHECKSUM]:
                return f"{table.file}: its numbers are not those that were written"
        return ""

    def _not_recalled(self, name, recall, memory):
        """Call `recall`; why it fails, in words, or "". Where ranks compute together its exceptions are raised."""
        try:
            recall(memory)
        except _UNFIT as problem:
            if self.kind.each_rank and self.comm.size > 1:
                raise
            return f"{self.place / name}: its data do not fit the {self.kind.what} ({problem})"
        return ""

    def _go_on_from(self, told, lost):
        """Continue after the rows of a checkpoint; `lost`: why a later one cannot be used, if there was one."""

        def cut():
            for name, table in self.tables.items():
                table.cut(told[name]["count"])
            files.replace(self.place / _LATEST, (self.place / _START).read_bytes())
            warn(f"{lost[0]}: the {self.kind.what} is computed from its start again")

        if lost:
            self._on_first(cut)
        for name, table in self.tables.items():
            table.look()
            table.next = told[name]["count"]

    def check_rows(self, times):
        """Refuse damaged rows, while another process may append some; `times(rows)`: their times, which ascend."""
        whole, _, damaged = self._read(_LATEST, {})  # before the rows

        def compared():
            why = "" if damaged else self._rows_differ(whole)
            for table in self.tables.values():
                if not why and len(table) > 1 and not (np.diff(times(table.rows)) > 0).all():
                    why = f"{table.file}: the times of its rows do not ascend"
            if why:
                raise SceneError(
                    f"{why}: expected the files as they were; cosserat_fenicsx.resume({str(self.place)!r}) computes "
                    "them again"
                )

        on_first(self.comm, compared)

    # -- work of rank 0 ----------------------------------------------------------------------------------------------

    def _from_first(self, action):
        """The value of `action()` on rank 0, on all ranks."""
        found = []
        self._on_first(lambda: found.append(action()))
        return self.comm.bcast(found[0] if found else None)

    def _on_first(self, action):
        try:
            on_first(self.comm, action)
        except OSError as problem:
            raise SceneError(
                f"{self.kind.call if self.kind else 'resume'}.folder = {str(self.place)!r}: "
                f"{problem.strerror or problem}: expected a folder that can be written to"
            ) from None

    def _or_not_stored(self, action, result, what):
        try:
            on_first(self.comm, action)
        except OSError as problem:
            raise self.not_stored(problem, result, what) from None

    def not_stored(self, problem, result, what):
        """The `NotStored` of an OSError; see `put`."""
        done = f"{len(result)} {result.axis}{'' if len(result) == 1 else 's'}"
        return NotStored(
            f"{self.place}: {what} cannot be written: {problem.strerror or problem}. Make room; {done} of the "
            f"{self.kind.what} are kept there, and {self.again}",
            result,
        )


def _data(as_data):
    """The data that a function returns, or why it cannot."""
    try:
        return as_data()
    except NotData as problem:
        return {"missing": str(problem)}


def _marked(scene, times):
    return {"times": times, "mark": mark.mark_of(scene, type(scene).__name__, times)}


def holds(place):
    """The kind of a folder, its `Kind.what`; None where it is no folder that this release reads."""
    with contextlib.suppress(SceneError):
        return _head(Path(place))["holds"]


def _head(place):
    try:
        data = (place / HEAD).read_bytes()
    except OSError as problem:
        if any((place / name).exists() for name in EARLIER):
            raise SceneError(
                f"{place}: it was written by an earlier release, in another format: expected a folder of this release, "
                "by a new run"
            ) from None
        raise SceneError(
            f"{place}: no motion was found there ({HEAD}: {problem.strerror}), nor another computation: expected a "
            "folder that simulate(..., folder=...) or another function of the package wrote"
        ) from None
    try:
        head = files.unsealed(data)
    except files.Damaged as problem:
        raise SceneError(f"{place / HEAD} is damaged ({problem}): expected the file as it was written") from None
    if head.get("format") != FORMAT:
        raise SceneError(f"{place}: its format is {head.get('format')}: expected {FORMAT}, that of this release")
    return head


def discard(place):
    """Remove the rows of a computation that has ended, and the folder unless it holds other files."""
    with contextlib.suppress(OSError):
        for file in (place / HEAD, *place.glob(_LINES.format("*"))):
            file.unlink(missing_ok=True)
        place.rmdir()


def resume(
    folder: File,
    scene: Any = None,
    *,
    duration: float | None = None,
    progress: bool | None = None,
    comm: "MPI.Comm | None" = None,
) -> Any:
    """Continue what a folder holds, to the same digits: a motion of rods or of a drill-string, or a sweep over depths.

    It does not matter what ended the run: a killed process, Ctrl-C, a full disk. All saved states are kept. The run
    continues from the last checkpoint of the solver and computes what came after it again. Checkpoints are two seconds
    of computing time apart, or fifty times as long as it takes to write one, whichever is longer. In serial, with the
    same libraries, every number is bit by bit that of an uninterrupted run; in parallel it agrees to rounding.
    A motion that fails again in the same way, such as where steps fail however short they are, needs another
    `simulate`, with `start=` if need be.

    A study is continued by the same call that began it: its folder does not hold the task.

    Args:
        folder: its name, the `folder` of `simulate` or `depth_sweep`.
        scene: the `Scene` or `Drilling` of the motion; it is compared with the mark in the folder. None for the scene
            stored in the folder, which is missing where a part of it is a function written in Python or of a class of
            your own. It is stored as data, so that a folder cannot run code.
        duration: s; None for the last one requested. With a longer one a step still ends at every earlier end, and the
            error may grow at the rate that `tol` set before; a motion computed in a plane must stay in it.
        progress, comm: as of `simulate`; with the same number of ranks.

    Returns:
        `History` or `DrillingHistory` with all states from the start, or `DepthSweep`; at once where it is complete.

    Raises:
        SceneError: no such folder, another scene, a shorter duration, another number of ranks, another process that
            computes this motion, or no readable checkpoint.
        NotConverged, Interrupted, NotStored: as of `simulate`.
    """
    store = Store(folder, None, comm).open()
    return store.home.go_on(store, scene, duration, progress)


def read(folder: File, scene: Any = None, *, comm: "MPI.Comm | None" = None) -> Any:
    """The results in a folder so far; another process may still be computing it. Arguments and errors: see `resume`."""
    store = Store(folder, None, comm).open()
    return store.home.read(store, scene)
