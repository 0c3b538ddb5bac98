"""What can go wrong where C is compiled, in words: the cache of compiled forms, or the C compiler."""

import contextlib

from cosserat_fenicsx import compat
from cosserat_fenicsx.code_cache import folder
from cosserat_fenicsx.errors import CosseratError, InstallationError


@contextlib.contextmanager
def compiling():
    """Context manager in which C is compiled or loaded from the cache of compiled forms.

    Raises:
        InstallationError: the cache cannot be written or read, or there is no C compiler that works.
    """
    try:
        with compat.quiet_compiler():
            yield
    except CosseratError:
        raise
    except Exception as problem:
        said = str(problem).strip().partition("\n")[0] or type(problem).__name__
        if type(problem).__name__ == "VerificationError" or "VerificationError" in said or "CompileError" in said:
            raise InstallationError(
                f"the C compiler has failed ({said}): expected one that works, such as by 'apt "
                f"install gcc python3-dev', room for its files in {folder()}, and no CC set to another"
            ) from problem
        if isinstance(problem, OSError | ImportError) or "just-in-time" in said:
            raise InstallationError(
                f"the cache of compiled forms in {folder()} cannot be used ({said}): make room there, remove what is "
                "damaged, or set XDG_CACHE_HOME to a folder that can be written to"
            ) from problem
        raise
