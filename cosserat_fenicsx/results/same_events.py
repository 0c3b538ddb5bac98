"""Events of one path on two meshes: which of them correspond, and how much they differ."""

import dataclasses

import numpy as np

# Largest relative difference of the load factors of corresponding events on two meshes.
_SAME = 1e-2
_NAMES = {"limit": "a limit point", "bifurcation": "a bifurcation"}
# Differences are relative to the event's load factor, or to this times the largest one of the path if that is larger.
_LEAST = 1e-3


def find_again(fine, coarse):
    """Set the `error` of the events of a path from the events of the same kind on a coarser mesh.

    Returns:
        The events of the coarser mesh without a counterpart.
    """
    left, least = list(coarse.events), _LEAST * float(np.abs(fine.load_factors).max(initial=0.0))

    def apart(event, other):
        return abs(event.load_factor - other.load_factor) / max(abs(event.load_factor), least)

    for k, event in enumerate(fine.events):
        near = min((x for x in left if x.kind == event.kind), key=lambda other: apart(event, other), default=None)
        error = np.nan
        if near is not None and apart(event, near) < _SAME:
            left.remove(near)
            error = apart(event, near)
        fine.events[k] = dataclasses.replace(event, error=error)
    return left


def keep_confirmed(path, largest, left):
    """Remove the events whose `error` is unknown or too large from a path's list, and report them in its `why`.

    Args:
        largest: error allowed.
        left: events of a coarser mesh without a counterpart.
    """
    unsure = [event for event in path.events if not event.error <= largest]
    path.events = [event for event in path.events if event.error <= largest]
    meshes = [(event, "could not be confirmed on another mesh") for event in unsure]
    meshes += [(event, "of a coarser mesh was not found again on a finer one") for event in left]
    for event, what in meshes:
        apart = f" (load factors that differ by {event.error:.1g})" if np.isfinite(event.error) else ""
        where = f"{_NAMES[event.kind]} near the load factor {event.load_factor:.6g}"
        path.why.append(f"{where} {what}{apart}: it is not listed")
