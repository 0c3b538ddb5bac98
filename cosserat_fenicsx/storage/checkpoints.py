"""Checkpoints: the data that a computation is continued from, in a file that is replaced as a whole.

The data are a dict of arrays, numbers and such dicts; the keys of nested dicts are joined by "/".
"""

import io
import os
import zipfile
import zlib
from pathlib import Path

import numpy as np


def write(file, memory):
    """Write a dict of arrays, numbers and dicts as .npz; an old file is replaced once the new one is complete.

    Raises:
        OSError: it cannot be written; the old file stays.
    """
    file = Path(file)
    fresh = file.with_name(file.name + ".new")
    data = io.BytesIO()  # complete in memory first, so that a full disk does not interrupt the writing of the archive
    np.savez(data, **dict(_flat(memory)))
    try:
        with open(fresh, "wb") as stream:
            stream.write(data.getbuffer())
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(fresh, file)
    except OSError:
        fresh.unlink(missing_ok=True)
        raise


def read(file):
    """The dict that was written; None where the file is missing or damaged."""
    try:
        with np.load(file, allow_pickle=False) as stored:
            flat = {name: stored[name] for name in stored.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error):
        return None
    memory = {}
    for name, value in flat.items():
        *folders, last = name.split("/")
        place = memory
        for folder in folders:
            place = place.setdefault(folder, {})
        place[last] = value if value.ndim else value.item()
    return memory


def _flat(memory, before=""):
    for name, value in memory.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{name}/")
        else:
            yield before + name, np.asarray(value)
