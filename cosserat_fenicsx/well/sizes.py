"""Standard sizes of drill pipe, heavy-weight pipe and drill collars by name, from standard_sizes.csv.

Drill pipe: bodies of API Spec 5DP (ISO 11961); tool joints and weights with them of API RP 7G, for new grade E75 pipe
with the connection named, which other grades and connections exceed by up to a tenth. Drill collars: number, outer
diameter and bore of API Spec 7-1 (ISO 10424-1); of those with two bores the larger one. Heavy-weight pipe: Drilco's
Hevi-Wate; other makes differ by about 1 %. A weight of None: that of the plain section.
"""

import csv
import functools
from pathlib import Path

from cosserat_fenicsx import units
from cosserat_fenicsx.errors import SceneError, nearest

_TABLE = Path(__file__).with_name("standard_sizes.csv")


@functools.cache
def standard_sizes():
    """{kind: {name: what `standard_size` returns}}."""
    with _TABLE.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    sizes = {}
    for row in rows:
        inches = (row["outer_diameter_in"], row["inner_diameter_in"], row["tool_joint_in"])
        outer, inner, joint = (float(x) * units.inch if x else None for x in inches)
        mass = float(row["weight_lb_per_ft"]) * units.lb_per_ft if row["weight_lb_per_ft"] else None
        found = {
            "size": row["name"],
            "outer_diameter": outer,
            "inner_diameter": inner,
            "tool_joint": joint,
            "mass": mass,
        }
        sizes.setdefault(row["kind"], {})[row["name"]] = found
    return sizes


def standard_size(kind, name):
    """Its full name as `size`, outer_diameter, inner_diameter, tool_joint (m, or None), mass (kg/m in air, or None).

    Args:
        kind: "DrillPipe", "HeavyWeight" or "Collar"; name: such as "5 in 19.50 lb/ft"; the units may be left out.

    Raises:
        SceneError: an unknown name, with the nearest known one.
    """
    known = standard_sizes()[kind]
    plain = {_plain(size): size for size in known}
    if not isinstance(name, str) or _plain(name) not in plain:
        raise SceneError(f"{kind}.size = {name!r}: {nearest(name, known)}")
    return known[plain[_plain(name)]]


def _plain(name):
    """A name without units and blanks, with weights to the last digit that is not zero."""
    words = name.lower().replace('"', " ").replace("lb/ft", " ").replace("in", " ").split()
    return " ".join(f"{float(word):g}" if word.replace(".", "", 1).isdigit() else word for word in words)
