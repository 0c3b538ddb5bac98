"""Parts of a scene in few words."""

import pickle


def describe(item):
    """A support or a load in few words: its kind and its station."""
    if item.station is not None:
        return f"{type(item).__name__} at {item.station}"
    return f"{type(item).__name__} on {item.rod.name}" if item.rod is not None else type(item).__name__


def actions_in_words(scene):
    """What acts on a scene's rods, and what of it the load factor multiplies, as sentences."""
    groups = (
        ("Loads, times the load factor", [x for x in scene.loads if x.scaled]),
        ("Loads that are there first, in full", [x for x in scene.loads if x.permanent]),
        ("Always there", [x for x in scene.loads if not x.scaled and not x.permanent]),
    )
    told = [f"{what}: {', '.join(map(describe, items))}." for what, items in groups if items]
    return "\n".join(told) or "Loads: none."


def unpicklable(scene):
    """The parts of a scene that cannot be pickled, in words; "" where all can be."""
    if _pickles(scene):
        return ""
    for group in ("rods", "loads", "supports", "velocities"):  # all others name rods
        items = list(enumerate(getattr(scene, group)))
        names = [f"{group}[{i}] ({_name(item)})" for i, item in items if not _pickles(item)]
        if names:
            return ", ".join(names)
    return "the scene"


def _pickles(thing):
    try:
        pickle.dumps(thing)
    except Exception:  # pickle raises whatever the parts of it do
        return False
    return True


def _name(item):
    return describe(item) if hasattr(item, "station") else getattr(item, "name", type(item).__name__)
