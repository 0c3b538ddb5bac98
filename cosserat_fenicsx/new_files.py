"""New files, which replace old ones when they are complete; HDF5 on a disk that may be full."""

import contextlib
import os
from pathlib import Path

import numpy as np

from cosserat_fenicsx.errors import SceneError


class NotWritten(OSError):
    """A file cannot be written; the message says what to do."""


@contextlib.contextmanager
def replaced(file, each_process=False):
    """Context manager: the name of a new file of the same ending, in the same folder, which is made; it replaces `file`
    at the end, or is removed where the block fails. A special file, such as a pipe, is written to directly.
    `NotWritten` where it cannot be written. each_process: whether several may write the same at once, each its own new
    file."""
    file = Path(os.path.realpath(file))
    fresh = file.with_name(f"{file.stem}.new{os.getpid() if each_process else ''}{file.suffix}")
    if file.exists() and not file.is_file():
        fresh = file
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        yield fresh
        if fresh != file:
            os.replace(fresh, file)
    except BaseException as problem:
        if fresh != file:
            with contextlib.suppress(OSError):
                fresh.unlink(missing_ok=True)
        if isinstance(problem, OSError) and not isinstance(problem, NotWritten):
            told = f"it cannot be written ({problem.strerror or problem}): make room there, or choose another folder"
            raise NotWritten(problem.errno, told, str(file)) from problem
        raise


@contextlib.contextmanager
def new_hdf5(file):
    """Context manager: a new `h5py.File`."""
    h5py = h5py_for(file)
    with open(file, "w+b", buffering=0) as stream:
        patient = _Patient(stream)
        with h5py.File(patient, "w") as store:
            yield store
    if patient.trouble is not None:
        raise patient.trouble


@contextlib.contextmanager
def arrays_in(file):
    """Context manager: a function `put(name, array)` that writes an array to a `new_hdf5`."""
    with new_hdf5(file) as store:
        from h5py import h5d, h5s, h5t

        def put(name, array):  # a third of the time of `store[name] = array`, which matters for thousands of states
            array = np.ascontiguousarray(array)
            space, kind = h5s.create_simple(array.shape), h5t.py_create(array.dtype)
            h5d.create(store.id, name.encode(), kind, space).write(h5s.ALL, h5s.ALL, array)

        yield put


def h5py_for(file):
    """The module h5py, needed for a file; SceneError where it is missing."""
    try:
        import h5py
    except ImportError:
        raise SceneError(f"{file}: this needs h5py: install the system's, 'apt install python3-h5py'") from None
    return h5py


class _Patient:
    """A file that HDF5 writes to through Python: the first error is kept, what comes after it is discarded."""

    def __init__(self, stream):
        self._stream, self._place, self.trouble = stream, 0, None

    def write(self, data):
        rest = memoryview(data)
        size = len(rest)
        try:
            while len(rest) and self.trouble is None:
                done = os.pwrite(self._stream.fileno(), rest, self._place)
                rest, self._place = rest[done:], self._place + done
        except OSError as problem:
            self.trouble = problem
        return size

    def readinto(self, room):
        done = os.preadv(self._stream.fileno(), [room], self._place)
        self._place += done
        return done

    def read(self, size=-1):
        """Not used: h5py recognises files by it."""
        raise NotImplementedError

    def seek(self, place, whence=os.SEEK_SET):
        self._place = place if whence == os.SEEK_SET else self._stream.seek(place, whence)
        return self._place

    def tell(self):
        return self._place

    def truncate(self, size=None):
        try:
            if self.trouble is None:
                self._stream.truncate(self._place if size is None else size)
        except OSError as problem:
            self.trouble = problem
        return size

    def flush(self):
        """All writing is direct."""
