"""The folder of a study: what was asked for, and the outcomes as they come.

study.json          the task, and the cases
outcomes.<rank>.jsonl   one line for every case that a rank has computed, appended at once

A line that was not written to its end, as by a process that was killed, is left out.
"""

import contextlib
import json
import numbers
import os
from pathlib import Path

import numpy as np

from cosserat_fenicsx import __version__
from cosserat_fenicsx.checks import instance, refuse, warn
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.storage import rows
from cosserat_fenicsx.storage.entries import A_WHOLE, below, number
from cosserat_fenicsx.storage.lock import FolderLock
from cosserat_fenicsx.storage.vacant import check_vacant

_FORMAT = 1
# What a line must hold beside the number of the case.
_ENTRIES = {"attempt": A_WHOLE, "seconds": (lambda value: number(value) and value >= 0, "a time (s)")}
_HEAD, _OUTCOMES = "study.json", "outcomes.{}.jsonl"


class StudyFolder:
    """A folder that holds the outcomes of a study.

    Args:
        place: its name; comm: MPI communicator.

    Raises:
        SceneError: `place` is not a name.
    """

    def __init__(self, place, comm):
        instance("study", "folder", place, str | os.PathLike, "the name of a folder")
        self.place, self._comm, self._stream = Path(place), comm, None
        self._lock = FolderLock(self.place, "study")

    def open(self, task, cases):
        """Make the folder, or go on with it. Collective.

        Args:
            task, cases: their descriptions, data for JSON.

        Returns:
            the outcomes that it holds, a list of dicts.

        Raises:
            SceneError: the folder holds another study, another process writes to it, or it cannot be made.
        """
        found = []
        try:
            on_first(self._comm, lambda: found.extend(self._open(task, _as_read(cases))))
        except OSError as problem:
            raise SceneError(
                f"study.folder = {str(self.place)!r}: {problem.strerror or problem}: expected a folder that can be "
                "written to"
            ) from None
        return self._comm.bcast(found)

    def _open(self, task, cases):
        self.place.mkdir(parents=True, exist_ok=True)
        self._lock.take()
        try:
            if (self.place / _HEAD).exists():
                self._compare(_as_read(task), cases)
                return [
                    row for file in sorted(self.place.glob(_OUTCOMES.format("*"))) for row in _rows(file, len(cases))
                ]
            outcomes = [file.name for file in self.place.glob(_OUTCOMES.format("*"))]
            check_vacant(self.place, "study.folder", _HEAD, outcomes)
            head = {"format": _FORMAT, "cosserat_fenicsx": __version__, "task": task, "cases": cases}
            fresh = self.place / f"{_HEAD}.new"
            fresh.write_text(json.dumps(head), encoding="utf-8")
            fresh.replace(self.place / _HEAD)
            return []
        except BaseException:
            self._lock.release()
            raise

    def _compare(self, task, cases):
        """Raise a SceneError where the folder holds another study."""
        try:
            head = json.loads((self.place / _HEAD).read_text(encoding="utf-8"))
            version, old_task, old_cases = head["format"], head["task"], list(head["cases"])
            names = [told["function"] for told in (old_task, task)]
        except (ValueError, KeyError, TypeError, RecursionError):
            raise SceneError(f"{self.place / _HEAD} is damaged: expected the file that study wrote") from None
        if version != _FORMAT:
            raise SceneError(f"{self.place}: its format is {version}: expected {_FORMAT}, that of this release")
        if names[0] != names[1]:
            self._refuse(f"of the task {names[0]}, not of {names[1]}")
        if not _same(old_task, task):
            self._refuse(f"of the task {names[0]} as it was before its code, or something that it uses, was changed")
        if len(old_cases) != len(cases):
            self._refuse(f"of {len(old_cases)} cases, not of {len(cases)}")
        for i, (old, new) in enumerate(zip(old_cases, cases, strict=True)):
            if not _same(old, new):
                self._refuse(f"whose case {i} is {_short(old)}, not {_short(new)}")

    def _refuse(self, how):
        raise SceneError(
            f"study.folder = {str(self.place)!r}: it holds a study {how}: expected the same task and cases, or another "
            "folder"
        )

    def keep(self, row):
        """Append an outcome to the file of this rank, where it survives the end of the process.

        Raises:
            OSError: it cannot be written.
        """
        if self._stream is None:
            file = self.place / _OUTCOMES.format(self._comm.rank)
            rows.cut(file)
            self._stream = file.open("ab")
        self._stream.write(rows.line_of(row))
        self._stream.flush()

    def close(self):
        """Close the file and unlock the folder."""
        if self._stream is not None:
            with contextlib.suppress(OSError):  # `keep` has raised it
                self._stream.close()
        self._lock.release()


def _rows(file, count):
    """The outcomes in a file that are whole, of cases below `count`; with a warning where others are left out."""
    entries, lost, old = {**_ENTRIES, "case": below(count)}, [], False
    for k, line in enumerate(file.read_bytes().split(b"\n")[:-1], start=1):
        try:
            row, whole = rows.row_in(line, entries, checksum=False)
            from_data(row.get("result"))
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError, MemoryError) as problem:
            lost.append(f"line {k}: {problem}")  # such as after a power failure
            continue
        old = old or not whole
        if ("result" in row) != ("failure" in row) and isinstance(row.get("failure", ""), str):
            yield row
        else:
            lost.append(f"line {k}: expected a result or a failure")
    if lost:
        more = f", and {len(lost) - 1} more" if len(lost) > 1 else ""
        warn(f"{file}, {lost[0]}{more}: left out, and computed again")
    if old:
        warn(f"{file} has lines without a checksum, as those of earlier releases: numbers that were changed in them "
             "are not noticed")  # fmt: skip


def _as_read(data):
    return json.loads(json.dumps(data))


def _same(a, b):
    return json.dumps(a, sort_keys=True) == json.dumps(b, sort_keys=True)  # NaN is equal to itself there


def _short(told):
    text = json.dumps(told)
    return text if len(text) <= 100 else f"{text[:100]}..."


_EXPECTED = "a number, a text, an array of numbers or of texts, None, or a dict of these by name"


def to_data(result):
    """A task's result as data.

    Raises:
        SceneError: it is none of what a task may return.
    """
    if isinstance(result, dict):
        for name in result:
            if not isinstance(name, str):
                refuse("study", "task", name, "names of results that are texts")
        return {"dict": {name: _of_value(value) for name, value in result.items()}}
    return _of_value(result)


def from_data(data):
    """The result of `to_data`; lists have become arrays."""
    if not isinstance(data, dict):
        return data
    if "dict" in data:
        return {name: from_data(value) for name, value in data["dict"].items()}
    if "number" in data:
        return complex(*data["number"])
    flat = np.array(data["array"], dtype=data["dtype"])
    return (flat.view(complex) if data["complex numbers"] else flat).reshape(data["shape"])


def _of_value(value):
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, complex):
        return {"number": [value.real, value.imag]}
    if isinstance(value, numbers.Real):  # such as a fraction
        return float(value)
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    masked = isinstance(value, np.ma.MaskedArray)  # whose mask would be lost
    if masked or not isinstance(value, np.ndarray | list | tuple) or array.dtype.kind not in "biufcU":
        refuse("study.task", "result", value, _EXPECTED)
    flat, pairs = array.ravel(), array.dtype.kind == "c"
    if pairs:
        flat = flat.astype(complex).view(float)
    elif array.dtype.kind == "f" and array.itemsize > 8:
        flat = flat.astype(float)
    return {"array": flat.tolist(), "dtype": flat.dtype.str, "shape": array.shape, "complex numbers": pairs}
