"""Names of rods and stations in the parts of a scene: looked up when the scene is put together."""

import dataclasses

from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.scene.rod import Rod, RodOrName, Station, StationOrName, station_named
from cosserat_fenicsx.scene.signals import Signal

# The fields of actions, whatever the annotations of a class of the user's own are.
_OF_ACTIONS = {"station": Station, "rod": Rod}
_KINDS = {Station: Station, StationOrName: Station, Rod: Rod, RodOrName: Rod}


def kind_of(annotation):
    """`Station` or `Rod` where a field with this annotation takes one, or its name; else None."""
    return _KINDS.get(annotation)


def look_up(where, name, kind, rods):
    """The `Station` or `Rod` (`kind`) of a name among rods {name: rod}.

    Raises:
        SceneError: there is none of that name.
    """
    if kind is Station:
        return station_named(where, name, rods)
    if not isinstance(name, str) or name not in rods:
        raise SceneError(f"{where} = {name!r}: no rod has this name, {nearest(name, rods)}")
    return rods[name]


def with_names(where, item, rods):
    """A part of a scene with the stations and rods that its names stand for; the part itself where it has no names.

    Args:
        where: for error messages; rods: {name: rod}.

    Raises:
        SceneError: there is none of that name, or the part refuses what it stands for.
    """
    found = {
        field.name: look_up(f"{where}.{field.name}", getattr(item, field.name), kind, rods)
        for field in _fields(item)
        if (kind := kind_of(field.type) or _OF_ACTIONS.get(field.name)) and isinstance(getattr(item, field.name), str)
    }
    if not found:
        return item
    # functions of time are checked again by the constructor, with the place in their messages
    given = {f.name: getattr(item, f.name).function for f in _fields(item) if isinstance(getattr(item, f.name), Signal)}
    return dataclasses.replace(item, **given, **found)


def _fields(item):
    if isinstance(item, type) or not dataclasses.is_dataclass(item):  # no part of a scene, which says so
        return []
    return [field for field in dataclasses.fields(item) if field.init]
