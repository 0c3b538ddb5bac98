"""Ties: the scalar constraints of supports and joints, as plain data for all models.

`a` and `b` are stations; b = None is the ground. All vectors are inertial, in the reference.
"""

from collections import namedtuple

#: direction . (r_a - r_b) = its value in the reference + rate times the load factor (m).
PositionTie = namedtuple("PositionTie", "a b direction rate")
#: The direction t, fixed to the section at a, stays normal to w, fixed to the section at b.
AngleTie = namedtuple("AngleTie", "a b t w")
#: The rotation of the section at a is the load factor times `rotation` (rad, a rotation vector), about one `axis`.
TurnTie = namedtuple("TurnTie", "a b axis rotation")

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def same_place(a, b=None, displacement=(0.0, 0.0, 0.0)):
    """Three ties that hold a at b, or at its reference position plus the load factor times a displacement."""
    return tuple(PositionTie(a, b, axis, rate) for axis, rate in zip(AXES, displacement, strict=True))


def same_axis(a, b, axis):
    """Two ties that let a rotate relative to b about `axis` (a unit vector) alone."""
    across = AXES[min(range(3), key=lambda i: abs(axis[i]))]
    t1 = _unit(_cross(axis, across))
    return AngleTie(a, b, t1, tuple(axis)), AngleTie(a, b, _unit(_cross(axis, t1)), tuple(axis))


def turned(a, rotation):
    """Three ties that hold the rotation of the section at a to the load factor times `rotation`."""
    return tuple(TurnTie(a, None, axis, tuple(rotation)) for axis in AXES)


def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _unit(a):
    size = sum(x * x for x in a) ** 0.5
    return tuple(x / size for x in a)
