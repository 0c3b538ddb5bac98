"""The paper's column as the demo builds it, for the measurements in this folder."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))

from eccentric_cantilever import ECCENTRICITY, L, column, exact  # noqa: E402

__all__ = ["ECCENTRICITY", "L", "column", "exact"]
