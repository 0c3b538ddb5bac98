"""What the model by elements tells of itself."""

from cosserat_fenicsx.drilling.bit_laws import Cutting
from cosserat_fenicsx.drilling.steady_start import follows_the_bit


def reasons(scene, elements, dt, *, axial, wall):
    """Sentences on so many elements and steps of dt (s), with axial motion or without, with a wall or without."""
    told = [f"{elements} elements, steps of {dt:.3g} s"]
    if axial:
        if wall:
            told.append("friction at the wall against axial and rotary slip together, normal force by the soft string "
                        "from the tension of the step before")  # fmt: skip
        bit = scene.bit
        if scene.start == "steady":
            told.append("starts in steady motion, all of it at the speeds of drive and hook")
        elif bit is not None and bit.weight is not None:
            told.append(f"starts with {bit.weight:g} N on bit, without friction")
            if not isinstance(bit.law, Cutting):
                told.append("the rock does not give way")
        else:
            told.append("starts hanging off bottom, without friction")
        if follows_the_bit(scene):
            told.append("without a Hook its load stays the same: the string follows the bit that drills")
    elif wall:
        told.append("friction at the wall by the tension at rest")
    return tuple(told)
