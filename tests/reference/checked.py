"""A comparison that is printed, and kept in the file that it vouches for."""

import numpy as np


def check(what, found, expected, within):
    """Prints the comparison and stops where it fails; returns it as a line of the file."""
    off = float(np.abs(np.asarray(found) - np.asarray(expected)).max())
    print(f"  {what}: off by {off:.1e}, allowed {within:.0e}")
    if not off <= within:
        raise SystemExit(f"{what}: {found} against {expected}")
    return f"{what}: {off:.1e}"
