"""The file that a sweep over depths is kept in: a line that says of what, then an answer a line, see `storage.rows`."""

import json
import os
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import instance, warn
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.storage import rows
from cosserat_fenicsx.storage.described import NotDescribed, described
from cosserat_fenicsx.storage.entries import A_TEXT, below, number, or_none

_FORMAT = 4
_PLACE = ("operation", "friction", "depth")
_OR_NULL = or_none(number), "a number or null"
# These numbers of an answer are not negative; errors may be infinite.
_NOT_NEGATIVE = ("error", "model_error", "locked")
_SIZE = or_none(lambda value: type(value) in (int, float) and value >= 0), "null or a number, not negative"


class SweepFile:
    """A file of answers. Rank 0 writes; all ranks call.

    Args:
        file: its name, or None for no file.
        about: {name: value} of everything that the answers follow from, whole objects.
        shape: numbers of operations, of coefficients of friction, and of depths.
        names: of the numbers of an answer. kinds: {name: kind of its values, see `entries`} where these are few.

    Raises:
        SceneError: the file holds another sweep, or something else, or what the answers follow from has no form as
            data.
        OSError: it cannot be read or written.

    Attributes:
        kept: [(indices, numbers, note)] of the answers that it holds.
    """

    def __init__(self, file, about, shape, names, kinds):
        self.kept, self._stream, self._names = [], None, names
        if file is None:
            return
        instance("depth_sweep", "file", file, str | os.PathLike, "the name of a file")
        self._file, comm, found = Path(file), world(), []
        head = {"format": _FORMAT, "sweep": {name: _told(name, value) for name, value in about.items()}}
        entries = {name: below(count) for name, count in zip(_PLACE, shape, strict=True)}
        entries |= {name: kinds.get(name, _SIZE if name in _NOT_NEGATIVE else _OR_NULL) for name in names}
        entries["note"] = A_TEXT
        on_first(comm, lambda: found.extend(self._open(json.loads(json.dumps(head)), entries)))
        self.kept = comm.bcast(found)

    def _open(self, head, entries):
        """Open the file for more answers, and return those that are there."""
        if self._file.exists() and not self._file.is_file():
            raise SceneError(f"depth_sweep.file = {str(self._file)!r}: expected a plain file, or a new name")
        data = self._file.read_bytes() if self._file.exists() else b""
        first, end, rest = data.partition(b"\n")
        if end or not rows.line_of(head).startswith(first):  # else the run was ended while it wrote this line
            self._compare(head, first)
        rows.cut(self._file)
        found = self._read(head, rest.split(b"\n")[:-1], entries)
        self._stream = self._file.open("ab", buffering=0)
        if not end:
            self._write(head)
        return found

    def _read(self, head, lines, entries):
        found, lost, sound = [], [], [rows.line_of(head)]
        for k, line in enumerate(lines, start=2):
            try:
                row, _ = rows.row_in(line, entries)
            except ValueError as problem:
                lost.append(f"line {k}: {problem}")
                continue
            sound.append(line + b"\n")
            numbers = [np.nan if row[name] is None else row[name] for name in self._names]
            found.append((tuple(row[name] for name in _PLACE), numbers, row["note"]))
        if lost:
            with replaced(self._file) as fresh:
                fresh.write_bytes(b"".join(sound))
            more = f", and {len(lost) - 1} more" if len(lost) > 1 else ""
            warn(f"depth_sweep.file = {str(self._file)!r}, {lost[0]}{more}: left out, and computed again")  # fmt: skip
        return found

    def _compare(self, head, line):
        """Refuse a file that does not hold this sweep."""
        try:
            old, _ = rows.row_in(
                line, {"format": (lambda _: True, ""), "sweep": (lambda x: isinstance(x, dict), "a dict")}
            )
            release = "" if old["format"] == _FORMAT else "it is of another release"
        except ValueError as problem:
            release = f"its first line is none of a sweep of this release, {problem}"
        why = release or next((f"{name} differs" for name, value in head["sweep"].items()
                               if not _same(value, old["sweep"].get(name))), "")  # fmt: skip
        if why:
            raise SceneError(
                f"depth_sweep.file = {str(self._file)!r}: it holds another sweep ({why}): expected the same call, or "
                "another file"
            )

    def keep(self, place, numbers, note):
        """Append an answer: its indices, its numbers and its note."""
        if self._stream is not None:
            told = {name: None if np.isnan(x) else float(x) for name, x in zip(self._names, numbers, strict=True)}
            self._write({**{name: int(i) for name, i in zip(_PLACE, place, strict=True)}, **told, "note": note})

    def _write(self, row):
        rest = memoryview(rows.line_of(row))
        while rest:  # a nearly full disk takes a part
            rest = rest[self._stream.write(rest) :]

    def close(self):
        if self._stream is not None:
            self._stream.close()


def _told(name, value):
    try:
        return described(value)
    except NotDescribed as problem:
        raise SceneError(
            f"depth_sweep.file: a {problem} in {name} cannot be compared with what the file holds: expected objects of "
            "the package, or dataclasses of numbers and texts, or no file"
        ) from None


def _same(a, b):
    return json.dumps(a, sort_keys=True) == json.dumps(b, sort_keys=True)  # NaN is equal to itself there
