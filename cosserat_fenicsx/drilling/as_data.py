"""A `Drilling` as plain data, which JSON can hold, and back.

An object of the package is {"type": its class, field: value, ...}. Reading data calls the constructors of the package's
classes and nothing else. Functions written in Python and components of the user's own have no such form.
"""

import dataclasses
import functools

import numpy as np

from cosserat_fenicsx.drilling.bit_laws import BitLaw, BitOnRock, Wear
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.segments import Discs
from cosserat_fenicsx.drilling.top_drive import DriveControl, Hook, TopDrive
from cosserat_fenicsx.drilling.wall_friction import FrictionLaw, ViscousDrag
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.parts import members
from cosserat_fenicsx.scene.as_data import NotData
from cosserat_fenicsx.scene.sections import Material, Stiffness
from cosserat_fenicsx.scene.signals import SIGNALS
from cosserat_fenicsx.well.components import DrillString, StringPart
from cosserat_fenicsx.well.hole import Borehole, HoleSection, Mud
from cosserat_fenicsx.well.path import WellPath

_OF_DRILLING = (Drilling, Discs, TopDrive, Hook, BitOnRock, Wear, ViscousDrag)
_OF_WELLS = (DrillString, Borehole, HoleSection, WellPath, Mud, Material, Stiffness)


@functools.cache
def _classes():
    kinds = {kind.__name__: kind for kind in (*_OF_DRILLING, *_OF_WELLS, *SIGNALS)}
    families = (StringPart, BitLaw, DriveControl, FrictionLaw)
    return functools.reduce(lambda found, family: found | members(family), families, kinds)


def to_data(scene):
    """A dict of lists, numbers, strings and None.

    Raises:
        NotData: a function written in Python, or a class that is not the package's; its text names the place.
    """
    return _value(scene, "Drilling")


def from_data(data):
    """The `Drilling` of `to_data`.

    Raises:
        SceneError: no data of a drill-string in motion.
    """
    try:
        found = _object(data)
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as problem:
        raise SceneError(f"these are no data of a Drilling ({type(problem).__name__}: {problem})") from None
    if not isinstance(found, Drilling):
        raise SceneError(f"these are the data of a {type(found).__name__}: expected those of a Drilling")
    return found


def _value(value, where):
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_value(x, f"{where}[{i}]") for i, x in enumerate(value)]
    kind = type(value)
    if _classes().get(kind.__name__) is not kind:
        what = "a function written in Python" if callable(value) else f"a part of the class {kind.__name__}"
        raise NotData(f"{where}: {what} cannot be stored as data")
    fields = [field.name for field in dataclasses.fields(kind) if field.init]
    return {"type": kind.__name__, **{name: _value(getattr(value, name), f"{where}.{name}") for name in fields}}


def _object(data):
    if isinstance(data, list):
        return [_object(x) for x in data]
    if not isinstance(data, dict):
        return data
    kind = _classes()[data["type"]]
    arguments = {name: _object(value) for name, value in data.items() if name != "type"}
    if kind is WellPath:
        arguments = {name: np.array(values, dtype=float) for name, values in arguments.items()}
    return kind(**arguments)
