"""How long it takes that rock with a stiffness stops a bit that comes down on it, and what resolves that."""

import math

from cosserat_fenicsx.drilling.discs import Discs

#: Steps where none is asked for, and the longest ones, with waves along the lowest element, that resolve an impact:
#: parts of its time. The largest weight on bit is then right to 1 %.
USUAL, ENOUGH = 0.2, 0.4


def time_of_impact(scene) -> float:
    """Time (s) in which the rock of a `Drilling` stops the bit: Z/k by the impedance Z (N s/m) of the lowest section,
    or sqrt(m/k) by the mass m (kg) of the bit, the longer one; infinite without rock of a stiffness k (N/m)."""
    bit = scene.bit
    if bit is None or math.isinf(bit.rock_stiffness):
        return math.inf
    if isinstance(scene.string, Discs):
        mass, impedance = bit.mass + (scene.string.masses or (math.inf,))[-1], 0.0
    else:
        mass, impedance = bit.mass, scene.segments[-1].axial_impedance
    return max(math.sqrt(mass / bit.rock_stiffness), impedance / bit.rock_stiffness)


def passing_time(scene, depths) -> float:
    """Time (s) that an axial wave takes along the lowest element of a string whose nodes have these depths (m)."""
    return 0.0 if isinstance(scene.string, Discs) else float(depths[-1] - depths[-2]) / scene.segments[-1].axial_speed


def unresolved(scene, depths, dt) -> str:
    """A sentence where the steps (s) or the elements are too long for impacts, or ""."""
    impact, passing = time_of_impact(scene), passing_time(scene, depths)
    if max(dt, passing) <= ENOUGH * impact:
        return ""
    few = (
        ""
        if passing <= ENOUGH * impact
        else (f", and elements of at most {ENOUGH * impact * scene.segments[-1].axial_speed:.2g} m at the bit")
    )
    return (
        f"APPROXIMATE: the rock stops the bit within {impact:.2g} s, which steps of {dt:.2g} s and elements that a "
        f"wave passes in {passing:.2g} s do not resolve: peaks of the weight on bit depend on them; expected a dt of "
        f"at most {ENOUGH * impact:.2g} s{few}, or rock without a stiffness, whose impacts are told as impulses"
    )
