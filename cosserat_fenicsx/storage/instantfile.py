"""Saved states of a motion in a growing file: records of one size in NumPy's .npy format, read when they are used.

Only complete rows count. Whatever ends the writing (a killed process, a full disk, an incomplete copy) loses the last
row at most, and `numpy.load(file, mmap_mode="r")` opens the rest, with fields by name.
"""

import ast
import os
import struct
import zlib
from pathlib import Path

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.results.history import Instant, Ledger

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
