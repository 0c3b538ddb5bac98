"""Checks of users' input; every refusal names the field, its value and what was expected."""

import math
import numbers

import numpy as np

from cosserat_fenicsx.errors import SceneError

#: Sizes beyond this, and below its inverse, are refused: their fourth powers would not be numbers.
LARGEST = 1e60
# Values with a longer text, such as that of a rod, are abbreviated in messages.
_LONGEST = 100


def refuse(owner, field, value, expected):
    """Raise a SceneError: 'owner.field = value: expected ...'."""
    where, given = owner if isinstance(owner, str) else type(owner).__name__, repr(value)
    if len(given) > _LONGEST:
        given = f"{given[:_LONGEST]}..."
    raise SceneError(f"{where}.{field} = {given}: expected {expected}")


def number(owner, field, value, expected, accept):
    """`value` as a float where it is a number that `accept` accepts; refused otherwise."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        refuse(owner, field, value, expected)
    try:
        given = float(value)
    except OverflowError:  # an integer of more than 308 digits
        refuse(owner, field, f"{str(value)[:10]}...", expected)
    if math.isnan(given) or not accept(given):
        refuse(owner, field, value, expected)
    return given


def positive(owner, field, value, unit):
    """A number above zero, neither so small nor so large that its powers are not numbers."""
    found = number(owner, field, value, f"a positive number ({unit})", lambda x: 0 < x < math.inf)
    if not 1 / LARGEST <= found <= LARGEST:
        refuse(owner, field, value, f"a positive number ({unit}) from {1 / LARGEST:g} to {LARGEST:g}")
    return found


def stiffness(owner, field, value, unit):
    """A number above zero; infinity is allowed."""
    return number(owner, field, value, f"a positive number or infinity ({unit})", lambda x: x > 0)


def finite_array(owner, field, value, expected):
    """`value` as an array of floats where it is one of finite numbers, of any shape; refused otherwise."""
    try:
        array = np.asarray(value)
    except ValueError:
        refuse(owner, field, value, expected)
    if array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        refuse(owner, field, value, expected)
    if np.abs(array).max(initial=0) > LARGEST:
        refuse(owner, field, value, f"{expected}, none beyond {LARGEST:g}")
    return array.astype(float)


def vector(owner, field, value, unit, size=3):
    """A tuple of `size` finite numbers."""
    expected = f"{size} finite numbers ({unit})"
    array = finite_array(owner, field, value, expected)
    if array.shape != (size,):
        refuse(owner, field, value, expected)
    return tuple(array.tolist())


def call(function, x, name, where):
    """function(x) of a function that the user wrote; whatever it raises becomes a SceneError.

    Args:
        name, where: begin and end of the message.
    """
    try:
        return function(x)
    except Exception as problem:  # a user's function may raise any exception
        raise SceneError(f"{name} raised {type(problem).__name__} ({problem}){where}") from problem


def direction(owner, field, value):
    """The unit vector along three finite numbers that are not all zero, a tuple."""
    given = vector(owner, field, value, "direction")
    size = math.hypot(*given)
    if size == 0.0:
        refuse(owner, field, value, "a direction, not zero")
    if abs(size - 1.0) < 1e-15:  # a unit vector stays the same to the last digit
        return given
    return tuple(x / size for x in given)


def instance(owner, field, value, kinds, expected):
    """`value`, refused where it is not one of `kinds`."""
    if not isinstance(value, kinds):
        refuse(owner, field, value, expected)
    return value


def store(obj, **fields):
    """Set checked fields on a frozen dataclass from its __post_init__."""
    for name, value in fields.items():
        object.__setattr__(obj, name, value)
