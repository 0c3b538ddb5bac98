"""What can go wrong, in words a user can act on."""

import difflib


class CosseratError(Exception):
    """Anything this package refuses to do."""


class InstallationError(CosseratError, ImportError):
    """dolfinx is missing, too old, or built for complex numbers."""


class SceneError(CosseratError, ValueError):
    """A scene that cannot be solved as it is described: says what, where, and what was expected.

    Attributes:
        path: the `History` up to there, where it was found while a motion was computed, else None.
    """

    path = None


class NotConverged(CosseratError, RuntimeError):
    """A solver could not go on.

    Attributes:
        path: everything up to the last converged point (a `Path` or a `History`, possibly empty), or None where
            nothing was solved.
    """

    def __init__(self, message, path=None):
        super().__init__(message)
        self.path = path


class NotStored(CosseratError, OSError):
    """A motion that is written as it goes cannot be written any more, such as on a full disk.

    Attributes:
        path: the `History` up to there, which lies in its folder.
    """

    def __init__(self, message, path=None):
        super().__init__(message)
        self.path = path


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a solve.

    Attributes:
        path: everything up to the last converged point.
    """

    def __init__(self, path):
        super().__init__(f"interrupted after {len(path)} {path.axis}{'' if len(path) == 1 else 's'}")
        self.path = path


def nearest(word, known):
    """', did you mean ...?' for the known word nearest to `word`, or the list of known words."""
    word = str(word)
    match = [name for name in known if word and (word.startswith(name) or name.startswith(word))]
    match = match or difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    if match:
        return f"did you mean '{match[0]}'?"
    return "known: " + ", ".join(sorted(known))
