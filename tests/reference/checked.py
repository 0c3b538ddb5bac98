"""A comparison that is printed, and recorded in the file of the values that it checks."""

import numpy as np


def check(what, found, expected, within):
    """Print a comparison, and stop if it fails; returns it as a line of the file."""
    off = float(np.abs(np.asarray(found) - np.asarray(expected)).max())
    print(f"  {what}: off by {off:.1e}, allowed {within:.0e}")
    if not off <= within:
        raise SystemExit(f"{what}: {found} against {expected}")
    return f"{what}: {off:.1e}"
