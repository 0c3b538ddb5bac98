"""All that a result holds, named, with units and dimensions, for files and other libraries."""

from collections import namedtuple
from operator import attrgetter

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.results.export.quantities import FIELDS, OF_HISTORY, OF_PATH, Quantity
from cosserat_fenicsx.scene.describe import describe

#: dims: names of the dimensions of `values`, the components included; attributes: texts by names, such as units.
Variable = namedtuple("Variable", "dims values attributes")

# Dimensions of components by their names.
_COMPONENTS = {
    "xyz": "component",
    "abcd": "quaternion_component",
    FIELDS["strain"].parts: "strain_component",
    FIELDS["curvature"].parts: "curvature_component",
}
_OF_EVENT = {
    "kind": Quantity("kind"),
    "load_factor": Quantity("load factor"),
    "after": Quantity("index of the point before it"),
    "residual": Quantity("residual"),
    "error": Quantity("relative difference from a coarser mesh"),
}


def about(result):
    """What a result is, as texts, numbers and lists of these."""
    told = {"kind": "History" if result.axis == "time" else "Path", "title": result.scene.title}
    for name in ("model", "formulation", "degree", "unknowns", *(["scheme"] if result.axis == "time" else ["control"])):
        told[name] = getattr(result, name)
    return told | {"elements": list(result.elements), "why": list(result.why)}


def of_states(result):
    """{name: `Variable`} of what belongs to every state; the first is the load factor or the time."""
    table = OF_HISTORY if result.axis == "time" else OF_PATH
    return {
        name: _variable(("point",), attrgetter(attribute)(result), quantity)
        for name, (attribute, quantity) in table.items()
    }


def of_supports(result):
    """{name: `Variable`} reactions, NaN where they are unknown; empty without supports."""
    supports = result.scene.supports
    if not supports:
        return {}
    exerted = np.array([_reaction(result, support) for support in supports])
    of = ("support", "point")
    return {
        "support": Variable(("support",), np.array([describe(support) for support in supports]), {}),
        "reaction_force": _variable(of, exerted[:, 0], Quantity("force", "N", "xyz", "inertial")),
        "reaction_moment": _variable(
            of, exerted[:, 1], Quantity("moment", "N m", "xyz", "inertial, about the station")
        ),
    }


def _reaction(result, support):
    """(2, n, 3) force and moment of a support."""
    try:
        return np.array(result.reaction(support))
    except SceneError:  # of an action with memory at the same point
        return np.full((2, len(result), 3), np.nan)


def of_events(result, *, empty=False):
    """{name: `Variable`} of the events of a path; without events nothing, or with `empty` empty arrays."""
    events = [] if result.axis == "time" else result.events
    return {
        f"event_{name}": _variable(("event",), np.array([getattr(event, name) for event in events]), quantity)
        for name, quantity in _OF_EVENT.items()
        if events or (empty and result.axis != "time")
    }


def of_rod(result, rod):
    """{name: `Variable`} of the fields along a rod in all states, and of the modes of events."""
    found = {
        name: _variable(("s",) if name == "s" else ("point", "s"), values, FIELDS[name])
        for name, values in result.fields_at(range(len(result)), rod).items()
    }
    if of_events(result):
        modes = np.array([result.mode(event, rod) for event in result.events])
        found["event_mode"] = _variable(("event", "s"), modes, Quantity("mode", "1", "xyz", "inertial"))
    return found


def component_names(variables):
    """{name: `Variable`} that name the components of those of `variables` that have any."""
    dims = {dim for variable in variables.values() for dim in variable.dims}
    return {name: Variable((name,), np.array(list(parts)), {}) for parts, name in _COMPONENTS.items() if name in dims}


def group_names(scene):
    """Names of groups, one a rod: its own name where files can have it, else a similar one."""
    names = []
    for rod in scene.rods:
        name = plain = rod.name.replace("/", "|").replace("\0", "").strip(". ") or "rod"
        while name in names:
            name = f"{plain} ({len(names)})"
        names.append(name)
    return names


def _variable(dims, values, quantity):
    more = (_COMPONENTS[quantity.parts],) if quantity.parts else ()
    attributes = {"units": quantity.unit, "long_name": quantity.label}
    return Variable((*dims, *more), values, attributes | ({"frame": quantity.frame} if quantity.frame else {}))
