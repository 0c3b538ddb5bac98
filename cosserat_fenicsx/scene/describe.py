"""Parts of a scene in words, for messages, tables and pictures."""

import pickle


def describe(item):
    """A support or a load as text: its class and its station."""
    if item.station is not None:
        return f"{item.called or type(item).__name__} at {item.station}"
    return f"{type(item).__name__} on {item.rod.name}" if item.rod is not None else type(item).__name__


def some_of(texts, most=6):
    """Texts in a row: all of them, or the first ones and how many more there are."""
    texts = list(texts)
    more = f" and {len(texts) - most} more" if len(texts) > most + 1 else ""
    return ", ".join(texts[:most] if more else texts) + more


def _name_of(item):
    """A part of a scene in messages: as `describe`, or by its name or class."""
    return describe(item) if hasattr(item, "station") else getattr(item, "name", type(item).__name__)


def actions_in_words(scene):
    """Sentences that list the actions and prescribed motions of a scene, by whether the load factor multiplies them."""
    groups = (
        ("Loads, times the load factor", [x for x in scene.loads if x.scaled]),
        ("Prescribed motions, times the load factor", [x for x in scene.supports if x.moves]),
        ("Permanent loads, applied in full before", [x for x in scene.loads if x.permanent]),
        ("Not multiplied by the load factor", [x for x in scene.loads if not x.scaled and not x.permanent]),
    )
    lines = [f"{title}: {some_of(map(describe, items))}." for title, items in groups if items]
    return "\n".join(lines) or "Loads: none."


def unpicklable(scene):
    """Text that names the parts of a scene that cannot be pickled; "" if all can be."""
    if _pickles(scene):
        return ""
    for group in ("rods", "loads", "supports", "velocities"):  # all other parts only refer to rods
        items = list(enumerate(getattr(scene, group)))
        names = [f"{group}[{i}] ({_name_of(item)})" for i, item in items if not _pickles(item)]
        if names:
            return ", ".join(names)
    return "the scene"


def _pickles(thing):
    try:
        pickle.dumps(thing)
    except Exception:  # methods of user-defined parts may raise anything
        return False
    return True
