"""Files that a command writes: which there are, what is left out, and that none of them replaces what it has read."""

import os
import sys
from pathlib import Path

from cosserat_fenicsx.cli.say import say
from cosserat_fenicsx.errors import LibraryMissing, SceneError
from cosserat_fenicsx.interrupts import obey


class Files:
    """Files in a folder, one after another.

    Args:
        out: the folder, a Path. stops: whether a signal ends the writing between two files.
    """

    def __init__(self, out, stops=True):
        self._out, self._stops = out, stops
        self.names, self._left_out = [], {}

    def put(self, name, write, *more):
        """Call `write` with a file of this name; `more`: names of files that it writes too. A picture whose library is
        missing is left out.

        Raises:
            KeyboardInterrupt: a signal asked for a stop.
            OSError, SceneError: as `write` does.
        """
        if self._stops:
            obey()
        try:
            write(self._out / name)
        except LibraryMissing as problem:
            self._left_out.setdefault(str(problem), []).append(name)
        else:
            self.names += [name, *more]

    def tell(self):
        """Say what was written, and what was left out."""
        if self.names:
            say(f"written to {self._out}/: {', '.join(self.names)}", file=sys.stdout)
        for why, names in self._left_out.items():
            say(f"cosserat: left out: {', '.join(names)}: {why}")


def keep_inputs(out, names, scene, tables):
    """Refuse an output that would replace the scene file, or a file that it names.

    Args:
        out: the output folder, a Path. names: of all files that may be written there.
        scene: the name of the scene file. tables: what is in it.

    Raises:
        SceneError: naming the file.
    """
    folder = Path(scene).parent
    read = {os.path.realpath(scene)} | {os.path.realpath(folder / text) for text in _texts(tables) if "\0" not in text}
    for name in names:
        if os.path.realpath(out / name) in read:
            raise SceneError(
                f"-o {out}: {name} would replace the file of that name which the scene is read from: expected another "
                "folder, or another name of that file"
            )


def _texts(value):
    """All texts in nested tables and lists."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _texts(inner)
