"""Files that are written beside the old ones, which they replace when they are complete."""

import contextlib
import os
from pathlib import Path


class NotWritten(OSError):
    """A file cannot be written; its text says what to do."""


@contextlib.contextmanager
def replaced(file):
    """The name of a new file, which replaces `file` at the end of the block, and is removed where the block fails.

    It has the same ending and lies in the same folder, which is made. What is no plain file, such as a pipe, is written
    to as it is.

    Raises:
        NotWritten: it cannot be written; the old file stays, or none.
    """
    file = Path(os.path.realpath(file))
    fresh = file.with_name(f"{file.stem}.new{file.suffix}")
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
