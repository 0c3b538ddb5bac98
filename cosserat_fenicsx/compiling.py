"""What can go wrong where C is compiled, in words: the cache of compiled forms, or the C compiler."""

import contextlib
import os
from pathlib import Path

from cosserat_fenicsx import compat
from cosserat_fenicsx.errors import CosseratError, InstallationError
from cosserat_fenicsx.ranks import are_apart

# Time (s) that a rank within a study waits for another one that compiles the same form.
_PATIENCE = 60


@contextlib.contextmanager
def compiling():
    """Context manager in which C is compiled or loaded from the cache of compiled forms.

    Raises:
        InstallationError: the cache cannot be written or read, or there is no C compiler that works.
    """
    try:
        with compat.quiet_compiler(), compat.waiting_for_compilers(_PATIENCE if are_apart() else None):
            yield
    except CosseratError:
        raise
    except Exception as problem:
        said = str(problem).strip().partition("\n")[0] or type(problem).__name__
        if type(problem).__name__ == "VerificationError" or "VerificationError" in said or "CompileError" in said:
            raise InstallationError(
                f"the C compiler has failed ({said}): expected one that works, such as by 'apt "
                f"install gcc python3-dev', room for its files in {cache()}, and no CC set to another"
            ) from problem
        if isinstance(problem, OSError | ImportError) or "just-in-time" in said:
            raise InstallationError(
                f"the cache of compiled forms in {cache()} cannot be used ({said}): make room there, remove what is "
                "damaged, or set XDG_CACHE_HOME to a folder that can be written to"
            ) from problem
        raise


def cache():
    """The folder of dolfinx's compiled forms, and of our own C."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fenics"
