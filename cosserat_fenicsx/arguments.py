"""Words for arguments that a class or a function of the package does not have, with the nearest one that it has."""

import dataclasses
import functools
import inspect
import types

from cosserat_fenicsx.errors import nearest

#: The attribute of what says so.
NAMED = "_names_its_arguments"
# Names that people try, and those that the package uses.
_USUAL = {"radius": "diameter", "r": "diameter", "d": "diameter", "young": "E", "youngs_modulus": "E", "rho": "density",
          "poisson": "nu", "L": "length", "timestep": "dt", "time_step": "dt", "tolerance": "tol"}  # fmt: skip


def in_words(found):
    """A public class or function, which says what is wrong with its arguments; anything else as it is.

    Classes stay the same objects: the method `__init__` of those that are dataclasses is replaced.
    """
    if isinstance(found, types.FunctionType):
        return _checked(found, found)
    if dataclasses.is_dataclass(found) and isinstance(vars(found).get("__init__"), types.FunctionType):
        found.__init__ = _checked(found.__init__, found)
    return found


def _checked(call, named):
    if hasattr(call, NAMED):
        return call

    @functools.wraps(call)
    def checked(*given, **named_ones):
        try:
            return call(*given, **named_ones)
        except TypeError:
            told = _told(call, named.__name__, given, named_ones)
            if told is None:  # of something that was called inside
                raise
        raise TypeError(told)

    setattr(checked, NAMED, True)
    return checked


def _told(call, name, given, named):
    """What is wrong with the arguments of a call; None where nothing is."""
    signature = inspect.signature(call)
    try:
        signature.bind(*given, **named)
        return None
    except TypeError as problem:
        usual = str(problem)
    known = [x for x in signature.parameters if x != "self"]
    for unknown in named:
        if unknown not in known:
            other = _USUAL.get(unknown)
            hint = f"did you mean '{other}'?" if other in known else nearest(unknown, known)
            return f"{name} has no argument '{unknown}': {hint}"
    return f"{name}: {usual}: expected {name}({', '.join(_without_self(signature))})"


def _without_self(signature):
    return [_short(x) for x in signature.parameters.values() if x.name != "self"]


def _short(parameter):
    return parameter.name if parameter.default is inspect.Parameter.empty else f"{parameter.name}=..."
