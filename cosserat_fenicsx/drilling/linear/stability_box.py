"""Which part of the complex plane is searched for the modes of a string."""

from cosserat_fenicsx.drilling.linear.roots import Box

#: How fast the modes that are listed may decay at most: by exp(-this) while a wave goes down the string once.
_DECAY = 4.0


def box_up_to(steady, top):
    """The box of a characteristic function of a `Steady`, up to a frequency (rad/s)."""
    left = -_DECAY / steady.torsion.travel
    return lambda f: Box(left, f.fastest, 0.0, top)
