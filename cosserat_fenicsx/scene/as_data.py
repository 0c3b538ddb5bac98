"""Scenes as plain data, which JSON can hold, and back.

An object of the package is {"type": its class, field: value, ...}, a rod of the scene {"rod": its number}, and a
station {"rod": number, "s": m}. Reading data calls the constructors of the package's classes and nothing else.
Functions written in Python and classes of the user's own have no such form.
"""

import dataclasses
import functools

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.curves import CURVES
from cosserat_fenicsx.scene.describe import name_of
from cosserat_fenicsx.scene.profiles import SECTIONS
from cosserat_fenicsx.scene.rod import Damping, Rod, Station
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.scenefile import action_classes
from cosserat_fenicsx.scene.sections import Material
from cosserat_fenicsx.scene.signals import ALONG, SIGNALS, Signal
from cosserat_fenicsx.scene.supports import SUPPORTS, InitialVelocity, Joint

_PARTS = ("supports", "loads", "joints", "velocities")
# Fields whose constructor's argument has another name.
_ARGUMENTS = {"quaternion": "frame"}


def argument_of(field):
    """The name of the constructor's argument that a field of one of the package's classes is given by."""
    return _ARGUMENTS.get(field, field)


class NotData(Exception):
    """A part of a scene has no form as data; its text names the part and says why."""


def to_data(scene):
    """A dict of lists, numbers, strings and None.

    Raises:
        NotData: a function written in Python, or a class that is not the package's.
    """
    numbers = {rod: i for i, rod in enumerate(scene.rods)}
    data = {"title": scene.title}
    for part in ("rods", *_PARTS):
        items = getattr(scene, part)
        data[part] = [_named(f"{part}[{i}] ({name_of(item)})", item, numbers) for i, item in enumerate(items)]
    return data


def from_data(data):
    """The `Scene` of `to_data`.

    Raises:
        SceneError: no data of a scene.
    """
    try:
        rods = [_object(entry, []) for entry in data["rods"]]
        parts = {part: [_object(entry, rods) for entry in data[part]] for part in _PARTS}
        return Scene(rods, title=data["title"], **parts)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as problem:
        raise SceneError(f"these are no data of a scene ({type(problem).__name__}: {problem})") from None


@functools.cache
def _classes():
    """The classes of the package by their names; on the first call, since the names of actions load their modules."""
    known = (
        Rod, *CURVES, *SECTIONS, Material, Damping, *SIGNALS, *ALONG, *SUPPORTS, Joint, InitialVelocity,
        *action_classes(),
    )  # fmt: skip
    return {kind.__name__: kind for kind in known}


def _named(where, item, rods):
    try:
        return _value(item, rods, top=True)
    except NotData as problem:
        raise NotData(f"{where}: {problem}") from None


def _value(value, rods, top=False):
    """A value as data; `top`: whether it is an item of the scene, so that a rod is written in full."""
    if isinstance(value, Rod) and not top:
        return {"rod": rods[value]}
    if isinstance(value, Station):
        return {"rod": rods[value.rod], "s": value.s}
    if isinstance(value, Signal):
        return _value(value.function, rods)
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_value(x, rods) for x in value]
    kind = type(value)
    if _classes().get(kind.__name__) is not kind:
        what = "a function written in Python" if callable(value) else f"a part of the class {kind.__name__}"
        raise NotData(f"{what} cannot be stored as data")
    fields = [field.name for field in dataclasses.fields(kind) if field.init]
    return {"type": kind.__name__, **{argument_of(x): _value(getattr(value, x), rods) for x in fields}}


def _object(data, rods):
    if isinstance(data, list):
        return [_object(x, rods) for x in data]
    if not isinstance(data, dict):
        return data
    if "type" in data:
        arguments = {name: _object(value, rods) for name, value in data.items() if name != "type"}
        return _classes()[data["type"]](**arguments)
    rod = rods[data["rod"]]
    return rod.at(data["s"]) if "s" in data else rod
