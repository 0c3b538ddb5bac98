"""What the model by elements tells of itself."""

import math

from cosserat_fenicsx.drilling.axial_torsional.contact import unresolved
from cosserat_fenicsx.drilling.bit_laws import Cutting
from cosserat_fenicsx.drilling.steady_start import follows_the_bit


def reasons(scene, depths, dt, *, axial, wall):
    """Sentences on nodes at so many depths (m) and steps of dt (s), with axial motion or without, with a wall or
    without."""
    told = [f"{len(depths) - 1} elements, steps of {dt:.3g} s"]
    if axial:
        if wall:
            told.append("friction at the wall against axial and rotary slip together, normal force by the soft string "
                        "from the tension of the step before")  # fmt: skip
        bit = scene.bit
        if scene.start == "steady":
            told.append("starts in steady motion, all of it at the speeds of drive and hook")
        elif bit is not None and bit.weight is not None:
            told.append(f"starts with {bit.weight:g} N on bit, without friction")
        else:
            told.append("starts hanging off bottom, without friction")
        if bit is not None and bit.weight is not None and not isinstance(bit.law, Cutting):
            told += _of_rock(scene, depths, dt)
        if follows_the_bit(scene):
            told.append("without a Hook its load stays the same: the string follows the bit that drills")
    elif wall:
        told.append("friction at the wall by the tension at rest")
    return tuple(told)


def _of_rock(scene, depths, dt):
    """Sentences on the rock that a bit stands on."""
    if math.isinf(scene.bit.rock_stiffness):
        yield ("the rock does not give way: a bit that comes down on it is stopped by an impulse, which "
               "history.impulse_on_bit tells (N s) and weight_on_bit leaves out; with BitOnRock.rock_stiffness it is "
               "a force")  # fmt: skip
        return
    yield f"the rock below the bit is a spring of {scene.bit.rock_stiffness:.4g} N/m"
    approximate = unresolved(scene, depths, dt)
    if approximate:
        yield approximate
