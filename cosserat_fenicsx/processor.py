"""What this computer's processor can do, as flags of the C compiler."""

import contextlib
import functools

# The instructions of the level x86-64-v3 (most processors since 2013), as Linux names them.
_LEVEL_3 = {"avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe", "xsave"}


@functools.cache
def instructions():
    """Flags that let the compiler use the instructions of this processor; none where it is not known.

    They belong to the key of whatever is kept on disk: computers of different age may share a home directory.
    """
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="ascii", errors="replace") as lines:
        for line in lines:
            if line.startswith("flags"):
                return ("-march=x86-64-v3",) if _LEVEL_3 <= set(line.split()) else ()
    return ()
