"""A `History` whose states are stored in a file, written as they are saved and read on demand."""

import ast
import os
import struct
import zlib
from pathlib import Path

import numpy as np

from cosserat_fenicsx.errors import NotStored, SceneError
from cosserat_fenicsx.numerics import ElementRule
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.results.history import History
from cosserat_fenicsx.results.records import Instant, Ledger


class StoredHistory(History):
    """A `History` that keeps no states in memory. Rank 0 writes them, all ranks read them.

    Attributes:
        folder: the `pathlib.Path` of the folder with the file.
    """

    _computed = ()

    def told(self):
        """Its attributes other than scene and states, as a dict that `json` can store."""
        rule = {name: getattr(self.rule, name).tolist() for name in ("nodes", "gauss", "weights")}
        names = ("model", "degree", "unknowns", "why", "scheme")
        return {name: getattr(self, name) for name in names} | {"time_unit": self._time_unit, "rule": rule}

    @classmethod
    def as_told(cls, told, scene, layout, scales, comm, connections, expand=None):
        """A `StoredHistory` from the dict of `told`; `expand`: the model's expansion, if states will be appended."""
        rule = ElementRule(**{name: np.array(values) for name, values in told["rule"].items()})
        history = cls(scene, layout, scales, rule, comm=comm, model=told["model"], formulation="displacement",
                      degree=told["degree"], unknowns=told["unknowns"], why=told["why"], connections=connections,
                      expand=expand)  # fmt: skip
        history.scheme, history._time_unit = told["scheme"], told["time_unit"]
        return history

    def keep_in(self, folder):
        """Set the folder of the states, and return the history.

        Args:
            folder: a `pathlib.Path`; states that are already in it belong to the history.

        Raises:
            SceneError: these are the states of other rods, or on another mesh.
        """
        self.folder, self._file, self._done = folder, InstantFile(folder / "instants.npy"), 0
        cells, rule = sum(self.elements), self.rule
        nodes = cells * self.degree + len(self.elements)
        self._file.expect(rq=(nodes, 7), rates=(nodes, 6), gauss_fields=(cells, len(rule.gauss), 9))
        return self

    def go_on_after(self, count):
        """Continue after the first `count` states; later ones in the file remain until they are overwritten.

        A resumed motion reproduces them digit by digit.
        """
        self._done = count

    def append(self, record):
        """Add a saved state.

        Raises:
            NotStored: it cannot be written.
        """
        rq, gauss = self._expand(np.array([record.load_factor]), record.rq[None], record.gauss_fields[None])
        whole = Instant(**{**vars(record), "rq": rq[0], "gauss_fields": gauss[0]})
        self._try(lambda: self._file.put(self._done, whole), f"the state at t = {record.time:.6g} s")
        self._done += 1
        self._file.look()

    def settle(self, write):
        """Flush the states so far to the disk, then call `write()`, so that both survive a crash.

        Raises:
            NotStored: it cannot be written.
        """
        self._try(lambda: (self._file.settle(), write()), "the state from which a motion resumes")

    def sound(self, states):
        """Whether the first states are those that a checkpoint tells of: a dict of their number and their checksum, or
        None in checkpoints of releases before there was one. The same on all ranks.
        """
        sound = states is None or (
            states["rows"] <= len(self)
            and (self.comm.rank > 0 or self._file.checksum(states["rows"]) == states["crc32"])
        )
        return self.comm.bcast(sound)

    def states(self):
        """The number of the states so far and their checksum, for a checkpoint. On rank 0."""
        return {"rows": self._done, "crc32": self._file.checksum(self._done)}

    def _try(self, action, what):
        try:
            on_first(self.comm, action)
        except OSError as problem:
            until = f"the states up to t = {self.times[-1]:.6g} s are" if len(self) else "nothing is"
            raise NotStored(
                f"{self.folder}: {what} cannot be written: {problem.strerror or problem}. Make room; {until} kept "
                f"there, and cosserat_fenicsx.resume({str(self.folder)!r}), or `cosserat resume {self.folder}`, "
                "continues the motion",
                self,
            ) from None

    def at_points(self, which):
        """A `History` in memory of the states at the indices `which`."""
        part = History.__new__(History)
        mine = {name: value for name, value in vars(self).items() if name not in ("folder", "_file", "_done")}
        vars(part).update(
            mine, _expanded=[self._records[self._index(k, f"at_points([{k!r}])")] for k in which], _appended=[]
        )
        return part

    def __copy__(self):
        return self._with([])

    def __getstate__(self):
        """Pickle the folder instead of the states, which are read from there again."""
        return {**super().__getstate__(), "folder": self.folder.resolve()}

    @property
    def _records(self):
        return self._file

    def __len__(self):
        return len(self._file)

    def _array(self, name):
        return np.array(self._file.rows[name]) if len(self) else np.empty(0)

    _booked = _array
    _stacked = property(lambda self: self._file.rows.__getitem__)
    _all_rq = property(lambda self: self._column("rq", 7))
    _all_rates = property(lambda self: self._column("rates", 6))
    _all_gauss = property(lambda self: self._file.rows["gauss_fields"])

    def _column(self, name, size):
        return self._file.rows[name] if len(self) else np.empty((0, len(self._rest), size))


_MAGIC = b"\x93NUMPY\x01\x00"
#: Scalar columns of a row by their types in the file (the scalars of an `Instant`), and its arrays; the fields of its
#: `Ledger` follow.
_OF_INSTANT = {"time": "<f8", "load_factor": "<f8", "steps": "<i8", "iterations": "<i8"}
_ARRAYS = ("rq", "rates", "gauss_fields", "reactions", "tie_forces", "clamp_forces", "wall_forces")
# Rows that are read at once for a checksum.
_MANY = 64
# Arrays that files of earlier releases lack.
_NEW = ("wall_forces",)


class InstantFile:
    """The rows of one file as a sequence of `Instant`s; their number is that at the last `look`.

    Args:
        file: its name; a missing file has no rows.

    Raises:
        SceneError: a file that does not hold saved states.
    """

    def __init__(self, file):
        self.file, self._dtype, self._rows = Path(file).absolute(), None, None
        self._sum = (0, 0)  # a number of rows from the first on, and their checksum
        self.look()

    def __getstate__(self):
        return {"file": self.file, "rows": len(self)}

    def __setstate__(self, state):
        self.__init__(state["file"])
        if len(self) < state["rows"]:
            raise SceneError(
                f"{self.file}: expected the {state['rows']} saved states of a motion that was pickled without them, "
                f"but there are {len(self)}"
            )

    def look(self):
        """Update the number of rows to those in the file now."""
        size = self.file.stat().st_size if self.file.exists() else 0
        if self._dtype is None and size:
            self._dtype, self._first = _read_header(self.file)
        self._count = max(0, size - self._first) // self._dtype.itemsize if self._dtype else 0

    def expect(self, **shapes):
        """Refuse rows whose arrays have other shapes.

        Raises:
            SceneError: naming the first of them.
        """
        for name, shape in shapes.items() if self._dtype is not None else ():
            if self._dtype[name].shape != shape:
                raise SceneError(f"{self.file}: {name} has the shape {self._dtype[name].shape}: expected {shape}")

    def put(self, k, instant):
        """Write row k, an existing one or the next after the last; the first row makes the file. `look` makes it
        visible.

        Raises:
            OSError: it cannot be written; the rows before it stay.
        """
        if self._dtype is None:
            self._make(_dtype_of(instant))
        row = np.zeros((), self._dtype)
        for name in (*_OF_INSTANT, *self._arrays):
            row[name] = getattr(instant, name)
        for name, value in instant.ledger._asdict().items():
            row[name] = value
        place = self._first + k * self._dtype.itemsize
        with open(self.file, "r+b", buffering=0) as stream:
            try:
                _write(stream, place, row.tobytes())
            except OSError:
                if k == self._count:
                    stream.truncate(place)
                raise
            _write(stream, 0, _header(self._dtype, max(self._count, k + 1)))
        count, total = self._sum
        self._sum = (k + 1, zlib.crc32(row.tobytes(), total)) if k == count else (0, 0)

    def checksum(self, count):
        """The CRC-32 of the first `count` rows."""
        if self._sum[0] != count:
            total, rows = 0, self.rows
            for k in range(0, count, _MANY):
                total = zlib.crc32(rows[k : min(k + _MANY, count)].tobytes(), total)
            self._sum = (count, total)
        return self._sum[1]

    def settle(self):
        """Flush the rows to the disk (fsync), so that they survive a power failure."""
        if self.file.exists():
            with open(self.file, "rb") as stream:
                os.fsync(stream.fileno())

    def _make(self, dtype):
        with open(self.file, "wb", buffering=0) as stream:
            try:
                _write(stream, 0, _header(dtype, 0))
            except OSError:
                stream.truncate(0)
                raise
        self.look()

    def __len__(self):
        return self._count

    @property
    def rows(self):
        """(n,) structured array of the rows, memory-mapped: data are read from the file when they are used."""
        if self._rows is None or len(self._rows) != self._count:
            shape = (self._count,)
            self._rows = (
                np.memmap(self.file, self._dtype, "r", self._first, shape) if self._count else np.empty(0, self._dtype)
            )
        return self._rows

    def __getitem__(self, k):
        row = self.rows[k]
        more = {name: row[name].item() for name in _OF_INSTANT}
        more |= {name: np.array(row[name]) for name in self._arrays}
        ledger = Ledger(*(np.array(row[name]) if row[name].ndim else row[name].item() for name in Ledger._fields))
        return Instant(rq=more.pop("rq"), negative_modes=0, ledger=ledger, **more)

    @property
    def _arrays(self):
        return [name for name in _ARRAYS if name in self._dtype.names]

    def __iter__(self):
        return (self[k] for k in range(len(self)))


def _dtype_of(instant):
    columns = list(_OF_INSTANT.items())
    columns += [(name, "<f8", np.shape(value)) for name, value in instant.ledger._asdict().items()]
    columns += [(name, "<f8", np.shape(getattr(instant, name))) for name in _ARRAYS]
    return np.dtype(columns)


def _write(stream, place, data):
    """Write all data, in several calls where the system writes less at once."""
    data = memoryview(data)
    while data:
        done = os.pwrite(stream.fileno(), data, place)
        data, place = data[done:], place + done


def _header(dtype, count):
    """The header of a .npy file of `count` rows, of the same length for every count, so that it can be overwritten."""

    def text(n):
        return repr({"descr": dtype.descr, "fortran_order": False, "shape": (n,)}).encode()

    size = -(-(len(_MAGIC) + 2 + len(text(10**18)) + 1) // 64) * 64
    inside = size - len(_MAGIC) - 2
    return _MAGIC + struct.pack("<H", inside) + text(count).ljust(inside - 1) + b"\n"


def _read_header(file):
    try:
        with open(file, "rb") as stream:
            start = stream.read(len(_MAGIC) + 2)
            (inside,) = struct.unpack("<H", start[len(_MAGIC) :])
            told = ast.literal_eval(stream.read(inside).decode())
        if not start.startswith(_MAGIC):
            raise ValueError("no .npy file")
        columns = [(name, kind, *map(tuple, shape)) for name, kind, *shape in told["descr"]]
        expected = {**_OF_INSTANT, **dict.fromkeys((*Ledger._fields, *_ARRAYS), "<f8")}
        found = dict.fromkeys(_NEW, "<f8") | {name: kind for name, kind, *_ in columns}
        if found != expected:  # an object in a file would be a pointer
            raise ValueError("other columns than those of saved states")
        return np.dtype(columns), len(start) + inside
    except (ValueError, SyntaxError, struct.error, KeyError, TypeError, RecursionError, MemoryError) as problem:
        raise SceneError(
            f"{file} is damaged ({problem}): expected saved states; without the file, cosserat_fenicsx.resume computes "
            "them again"
        ) from None
