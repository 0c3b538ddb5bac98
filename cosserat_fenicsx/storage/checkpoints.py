"""Checkpoints: the data that a computation is continued from, in a file that is replaced as a whole.

The data are a dict of arrays, numbers and such dicts; the keys of nested dicts are joined by "/".
"""

import io
import os
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np

#: The entry with the CRC-32 of all others.
CHECKSUM = "crc32"


def write(file, memory):
    """Write a dict of arrays, numbers and dicts as .npz; an old file is replaced once the new one is complete.

    Raises:
        OSError: it cannot be written; the old file stays.
    """
    file = Path(file)
    fresh = file.with_name(file.name + ".new")
    flat = dict(_flat(memory))
    data = io.BytesIO()  # complete in memory first, so that a full disk does not interrupt the writing of the archive
    np.savez(data, **flat, **{CHECKSUM: np.asarray(_checksum(flat))})
    try:
        with open(fresh, "wb") as stream:
            stream.write(data.getbuffer())
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(fresh, file)
    except OSError:
        fresh.unlink(missing_ok=True)
        raise


class Damaged(Exception):
    """A file that does not hold what was written; its text says why."""


def read(file):
    """The dict that was written, with `CHECKSUM`, None in files of releases before there was one; None where the file
    is missing.

    Raises:
        Damaged: it cannot be read, or its numbers are not those that were written.
    """
    try:
        with np.load(file, allow_pickle=False) as stored:
            flat = {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, EOFError, KeyError, TypeError, MemoryError, NotImplementedError, RuntimeError,
            SyntaxError, struct.error, zipfile.BadZipFile, zlib.error) as problem:  # fmt: skip
        raise Damaged(f"{file} cannot be read ({problem})") from None
    told = flat.pop(CHECKSUM, None)
    if told is not None and told.tolist() != _checksum(flat):
        raise Damaged(f"{file}: its numbers are not those that were written (its checksum is that of others)")
    memory = {CHECKSUM: None if told is None else told.item()}
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
    """Where the data of a checkpoint are not of the kind of others, in words; None where they are.

    Every entry of `like` must be there: dicts, numbers and texts as such, and arrays of the same kind of numbers and
    the same shape but for their first axis, since some grow during a computation.
    """
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


def not_recalled(recall, memory):
    """Call `recall` with the data of a checkpoint that is like those of a model, see `unlike`; why it fails, in words,
    such as by arrays of another length, or None."""
    try:
        recall(memory)
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError) as problem:
        return f"its data do not fit the motion ({problem})"
    return None


def _checksum(flat):
    total = 0
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
