"""Files of rows, a JSON object a line, which are appended as they come; every line ends with a checksum of itself.

A line that was not written to its end, as by a process that was killed, and one that was changed since, are no rows.
"""

import contextlib
import json
import os
import zlib

from cosserat_fenicsx.storage.entries import checked

#: The last entry of a line: the CRC-32 of the text before it.
CHECKSUM = "crc32"
_MARK = f', "{CHECKSUM}": '


def line_of(row):
    """The line (bytes) of a row, a dict that is not empty."""
    text = json.dumps(row)[:-1]
    return f"{text}{_MARK}{zlib.crc32(text.encode())}}}\n".encode()


def row_in(line, entries, *, checksum=True):
    """The row in a line (bytes), and whether it has a checksum.

    Args:
        entries: what it must hold, see `entries.checked`.
        checksum: whether a line without one is refused. A wrong one always is.

    Raises:
        ValueError: saying what is wrong with it.
    """
    text, mark, told = line.decode().rpartition(_MARK)
    if mark and told != f"{zlib.crc32(text.encode())}}}":
        raise ValueError("its checksum is that of other data")
    if checksum and not mark:
        raise ValueError("it is not complete, or no row")
    try:
        row = json.loads(line)
    except RecursionError:
        raise ValueError("no row") from None
    if isinstance(row, dict):
        row.pop(CHECKSUM, None)
    return checked(row, entries), bool(mark)


def cut(file):
    """Remove a last line of a file that was not written to its end."""
    with contextlib.suppress(FileNotFoundError):
        os.truncate(file, file.read_bytes().rfind(b"\n") + 1)
