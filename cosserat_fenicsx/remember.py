"""Per-scene cache of derived data (scenes are immutable)."""

import functools
import weakref

# Results of one function that are kept for a scene.
_MOST = 64


def per_scene(function):
    """Decorator of a function (scene, ...) whose results depend on its arguments alone and are never changed. Arguments
    that cannot be hashed are passed on; so are exceptions, which are not remembered."""
    known = weakref.WeakKeyDictionary()

    @functools.wraps(function)
    def remembered(scene, *args, **named):
        key = (*args, *named.items())
        key += (*map(type, args), *map(type, named.values()))  # True is not 1 where a number is expected
        try:
            results = known.setdefault(scene, {})
            if key in results:
                return results[key]
        except TypeError:
            return function(scene, *args, **named)
        if len(results) >= _MOST:
            results.clear()
        results[key] = function(scene, *args, **named)
        return results[key]

    return remembered
