"""Exceptions, with messages that say what to do."""

import difflib

# Names that people try, and those that the package uses for them.
_USUAL = {"radius": ("diameter", "a"), "r": ("diameter", "a"), "d": ("diameter",), "young": ("E",), "poisson": ("nu",),
          "youngs_modulus": ("E",), "rho": ("density",), "energy": ("epsilon",), "specific_energy": ("epsilon",),
          "n": ("blades",), "mu": ("friction",), "L": ("length",), "timestep": ("dt",), "time_step": ("dt",),
          "tolerance": ("tol",), "Jar": ("Collar",), "HWDP": ("HeavyWeight",), "DP": ("DrillPipe",),
          "SlackOff": ("TripIn",), "PickUp": ("TripOut",)}  # fmt: skip


class CosseratError(Exception):
    """Base of the errors that this package raises."""


class InstallationError(CosseratError, ImportError):
    """dolfinx is missing, too old, built for complex numbers, or cannot compile."""


class SceneError(CosseratError, ValueError):
    """A scene that cannot be solved as described: the message names the field, its value and the expected one.

    Attributes:
        path: the `History` so far where the error arose during a motion, else None.
        where: the place in a scene file, a tuple of keys and numbers; None outside of files.
    """

    path = where = None


class LibraryMissing(SceneError):
    """An optional library, for pictures, is missing; the message says how to install it."""


class SceneWarning(UserWarning):
    """A probable mistake in a scene, such as a unit that is not SI; `warnings.simplefilter` silences it."""


class CacheWarning(RuntimeWarning):
    """The folder of compiled code is not used, and another one is."""


class NotConverged(CosseratError, RuntimeError):
    """A solver did not converge.

    Attributes:
        path: the result up to the last converged point (a `Path` or a `History`, possibly empty), or None where
            nothing was solved.
    """

    def __init__(self, message, path=None):
        super().__init__(message)
        self.path = path


class NotStored(CosseratError, OSError):
    """The folder of a motion or of a study can no longer be written to, such as on a full disk.

    Attributes:
        path: the `History` of the states that are stored in the folder, or the `Study` so far.
    """

    def __init__(self, message, path=None):
        super().__init__(message)
        self.path = path


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a solve.

    Attributes:
        path: the result up to the last converged point.
        words: how much was done and where it is kept, for the command line.
    """

    def __init__(self, path, kept=""):
        counted = getattr(path, "counted", path.axis)
        done = f"interrupted after {len(path)} {counted}{'' if len(path) == 1 else 's'}"
        super().__init__(f"{done}, which the exception's `path` holds{kept}")
        self.path, self.words = path, done + kept


def nearest(word, known):
    """', did you mean ...?' for the known word nearest to `word`, or the list of known words."""
    word = str(word)
    match = [name for name in _USUAL.get(word, ()) if name in known]
    match = match or [name for name in known if word and (word.startswith(name) or name.startswith(word))]
    match = match or difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    if match:
        return f"did you mean '{match[0]}'?"
    return "known: " + ", ".join(sorted(known))
