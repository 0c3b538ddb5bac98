"""Supports and loads in few words."""


def describe(item):
    """A support or a load in few words: its kind and its station."""
    if item.station is not None:
        return f"{type(item).__name__} at {item.station}"
    return f"{type(item).__name__} on {item.rod.name}" if hasattr(item, "rod") else type(item).__name__
