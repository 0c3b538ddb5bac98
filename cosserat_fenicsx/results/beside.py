"""Files that are written beside the old ones, which they replace when they are complete."""

import contextlib
import os
from pathlib import Path


@contextlib.contextmanager
def replaced(file):
    """The name of a new file, which replaces `file` at the end of the block, and is removed where the block fails.

    Raises:
        OSError: it cannot be written; the old file stays.
    """
    file = Path(file)
    file.parent.mkdir(parents=True, exist_ok=True)
    fresh = file.with_name(f"{file.name}.new")
    try:
        yield fresh
        os.replace(fresh, file)
    except BaseException:
        fresh.unlink(missing_ok=True)
        raise
