"""Files with checksums: JSON, lines of JSON, checkpoints, and growing tables of rows. Changes are noticed.

The seed of a checksum (CRC-32) is a number of the folder, so that a file of another folder is noticed as well.
"""

import ast
import io
import json
import os
import struct
import zlib
from pathlib import Path

import numpy as np

from cosserat_fenicsx.errors import SceneError

#: The entry with the checksum of all others.
CHECKSUM = "crc32"
_SEAL = f', "{CHECKSUM}": '
_MAGIC = b"\x93NUMPY\x01\x00"
# Bytes that are read at once for a checksum.
_MANY = 1 << 22


class Damaged(Exception):
    """A file that does not hold what was written; its text says why."""


def replace(file, data):
    """Write bytes to a file; an old one is replaced once the new one is complete, and stays where that fails."""
    fresh = file.with_name(f"{file.name}.new")
    try:
        with open(fresh, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(fresh, file)
    except OSError:
        fresh.unlink(missing_ok=True)
        raise


# -- JSON ------------------------------------------------------------------------------------------------------------


def sealed(data, seed=0, indent=None):
    """A dict that is not empty as bytes of JSON, with a checksum; without `indent` it is one line."""
    text = json.dumps(data, indent=indent, default=lambda number: number.item())[:-1].rstrip()
    return f"{text}{_SEAL}{zlib.crc32(text.encode(), seed)}}}\n".encode()


def unsealed(data, seed=0):
    """The dict in bytes that `sealed` made, or `Damaged`."""
    try:
        text, mark, told = data.decode().rpartition(_SEAL)
        if not mark:
            raise Damaged("it is not complete, or has no checksum")
        if told.rstrip() != f"{zlib.crc32(text.encode(), seed)}}}":
            raise Damaged("its checksum is that of other data")
        found = json.loads(f"{text}}}")
    except (ValueError, RecursionError) as problem:
        raise Damaged(f"it is no JSON: {problem}") from None
    if not isinstance(found, dict):
        raise Damaged("it is no JSON object")
    return found


# -- checkpoints -----------------------------------------------------------------------------------------------------


def write_checkpoint(file, memory, seed=0):
    """Write a dict of arrays, numbers, texts and such dicts as .npz, the keys of nested dicts joined by "/"."""
    flat, data = dict(_flat(memory)), io.BytesIO()
    np.savez(data, **flat, **{CHECKSUM: np.asarray(_checksum(flat, seed))})
    replace(file, data.getbuffer())


def read_checkpoint(file, seed=0):
    """The dict that was written, or `Damaged`; None where the file is missing."""
    try:
        with np.load(file, allow_pickle=False) as stored:
            flat = {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        return None
    except Exception as problem:  # a damaged file may cause any
        raise Damaged(f"{file} cannot be read ({problem})") from None
    told, memory = flat.pop(CHECKSUM, np.asarray(None)), {}
    if told.tolist() != _checksum(flat, seed):
        raise Damaged(f"{file}: its numbers are not those that were written (its checksum is that of others)")
    for name, value in flat.items():
        *folders, last = name.split("/")
        place = memory
        for folder in folders:
            place = place.setdefault(folder, {})
            if not isinstance(place, dict):
                raise Damaged(f"{file}: {name} is below a number")
        place[last] = value if value.ndim else value.item()
    return memory


def unlike(memory, like, where=""):
    """How the data of a checkpoint differ in structure from others, in words; None where they agree. Every entry of
    `like` must be there: dicts, numbers and texts as such, and arrays of the same kind of numbers and the same shape
    but for their first axis, since some grow during a computation."""
    for name, expected in like.items():
        what = f"{where}{name}"
        if name not in memory:
            if isinstance(expected, dict) and not expected:  # which leaves no trace in a file
                continue
            return f"{what} is missing"
        found = memory[name]
        if isinstance(found, dict) != isinstance(expected, dict):
            return f"{what} is of another kind"
        if isinstance(expected, dict):
            inner = unlike(found, expected, f"{what}/")
            if inner:
                return inner
            continue
        found, expected = np.asarray(found), np.asarray(expected)
        kinds = {"i": "iu", "u": "iu", "f": "iuf"}.get(expected.dtype.kind, expected.dtype.kind)
        if found.dtype.kind not in kinds or found.ndim != expected.ndim:
            if not expected.ndim or expected.size:  # an empty list has no kind
                return f"{what} is of another kind"
        elif expected.size and (found.shape[1:] != expected.shape[1:] or found.size == 1 < expected.size):
            return f"{what} has the shape {found.shape}, where {expected.shape} is expected"
    return None


def _checksum(flat, seed):
    total = seed
    for name in sorted(flat):
        array = np.ascontiguousarray(flat[name])
        total = zlib.crc32(f"{name} {array.dtype.str} {array.shape}".encode(), total)
        total = zlib.crc32(array.tobytes(), total)
    return total


def _flat(memory, before=""):
    for name, value in memory.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{name}/")
        else:
            yield before + name, np.asarray(value)


# -- tables ----------------------------------------------------------------------------------------------------------


class Table:
    """Rows of one size in a growing file in NumPy's .npy format, read when they are used.

    Only complete rows count. Whatever ends the writing (a killed process, a full disk, an incomplete copy) loses the
    last row at most, and `numpy.load(file, mmap_mode="r")` opens the rest.

    Args:
        file: its name; a missing file has no rows, another one than a table is refused.
        accept: a function at the top of a module; whether a numpy dtype and a shape are those of this table's rows.

    Attributes:
        next: the number of the row that is written next: after the last one, unless a computation continues from an
            earlier one. Later rows stay until they are overwritten, by the same digits.
    """

    def __init__(self, file, accept, seed=0):
        self.file, self._accept, self._seed = Path(file).absolute(), accept, seed
        self._dtype = self._rows = None
        self._count, self._sum = 0, (0, seed)  # a number of rows from the first on, and their checksum
        self.look()
        self.next = self._count

    def __getstate__(self):
        return self.file, self._accept, self._seed, len(self)

    def __setstate__(self, state):
        *given, count = state
        self.__init__(*given)
        if len(self) < count:
            raise SceneError(
                f"{self.file}: expected the {count} saved states of a motion that was pickled without them, but there "
                f"are {len(self)}"
            )

    def look(self):
        """Update the number of rows to those in the file now."""
        size = self.file.stat().st_size if self.file.exists() else 0
        if self._dtype is None and size:
            self._read_header()
        self._count = max(0, size - self._first) // self._size if self._dtype is not None else 0

    def _layout(self, dtype, shape):
        self._dtype, self._shape = dtype, shape
        self._size = dtype.itemsize * int(np.prod(shape, dtype=int))

    def put(self, rows):
        """Write rows, an array, from the number `next` on; where that fails, those before them stay."""
        if self._dtype is None:
            self._make(rows)
        place, data = self._first + self.next * self._size, np.ascontiguousarray(rows, self._dtype).tobytes()
        with open(self.file, "r+b", buffering=0) as stream:
            try:
                _write(stream, place, data)
            except OSError:
                if self.next >= self._count:
                    stream.truncate(place)
                raise
            after = self.next + len(rows)
            _write(stream, 0, self._header(max(self._count, after)))
        count, total = self._sum
        if self.next == count:
            self._sum = (after, zlib.crc32(data, total))
        elif count > self.next:
            self._sum = (0, self._seed)
        self.next, self._count = after, max(self._count, after)

    def _make(self, rows):
        self._layout(rows.dtype, rows.shape[1:])
        header = self._header(0)
        try:
            replace(self.file, header)
        except OSError:
            self._dtype = None
            raise
        self._first = len(header)

    def checksum(self, count):
        """The CRC-32 of the first `count` rows."""
        if self._sum[0] != count:
            total, each = self._seed, max(1, _MANY // self._size) if count else 1
            for k in range(0, count, each):
                total = zlib.crc32(self.rows[k : min(k + each, count)].tobytes(), total)
            self._sum = (count, total)
        return self._sum[1]

    def settle(self):
        """Flush the rows to the disk (fsync), so that they survive a power failure."""
        if self.file.exists():
            with open(self.file, "rb") as stream:
                os.fsync(stream.fileno())

    def cut(self, count):
        """Leave the first `count` rows alone."""
        self._rows, self._sum = None, (0, self._seed)
        if not count:
            self.file.unlink(missing_ok=True)
            self._dtype = None
        elif len(self) >= count:
            with open(self.file, "r+b", buffering=0) as stream:
                stream.truncate(self._first + count * self._size)
                _write(stream, 0, self._header(count))
        self.look()
        self.next = self._count

    def __len__(self):
        return self._count

    @property
    def dtype(self):
        """The numpy dtype and the shape of a row; (None, ()) before the first."""
        return (None, ()) if self._dtype is None else (self._dtype, self._shape)

    @property
    def rows(self):
        """(n, ...) array of the rows, memory-mapped: data are read from the file when they are used."""
        if self._rows is None or len(self._rows) != self._count:
            if not self._count:
                return np.empty((0, *self.dtype[1]), self._dtype)
            self._rows = np.memmap(self.file, self._dtype, "r", self._first, (self._count, *self._shape))
        return self._rows

    def _header(self, count):
        """The header of a .npy file of `count` rows: equal in length, so that one overwritten in part can be read."""
        descr = self._dtype.descr if self._dtype.names else self._dtype.str
        shape = "".join(f"{n}, " for n in self._shape)
        text = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': ({count:>19}, {shape})}}".encode()
        inside = -(-(len(_MAGIC) + 2 + len(text) + 1) // 64) * 64 - len(_MAGIC) - 2
        return _MAGIC + struct.pack("<H", inside) + text.ljust(inside - 1) + b"\n"

    def _read_header(self):
        try:
            with open(self.file, "rb") as stream:
                start = stream.read(len(_MAGIC) + 2)
                (inside,) = struct.unpack("<H", start[len(_MAGIC) :])
                told = ast.literal_eval(stream.read(inside).decode())
            if not start.startswith(_MAGIC):
                raise ValueError("no .npy file")
            descr = told["descr"]
            if isinstance(descr, list):
                descr = [(name, kind, *map(tuple, shape)) for name, kind, *shape in descr]
            dtype, shape = np.dtype(descr), tuple(told["shape"][1:])
            if dtype.hasobject or not all(type(n) is int and 0 <= n < 10**9 for n in shape):  # objects are pointers
                raise ValueError("other columns than those that are saved")
            if not self._accept(dtype, shape):
                raise ValueError("other columns than those that are saved")
        except (ValueError, SyntaxError, struct.error, KeyError, TypeError, RecursionError, MemoryError) as problem:
            raise SceneError(
                f"{self.file} is damaged ({problem}): expected saved states; without the file, cosserat_fenicsx.resume "
                "computes them again"
            ) from None
        self._layout(dtype, shape)
        self._first = len(start) + inside


def _write(stream, place, data):
    """Write all data, in several calls where the system writes less at once."""
    data = memoryview(data)
    while data:
        done = os.pwrite(stream.fileno(), data, place)
        data, place = data[done:], place + done
