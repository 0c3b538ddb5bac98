"""What a scene amounts to, in numbers and words: to see whether it is the one that a motion was computed for."""

import reprlib

import numpy as np

from cosserat_fenicsx.scene.rod import Rod, Station
from cosserat_fenicsx.scene.signals import Signal, sample_times

_SAMPLES = 9
#: Numbers that differ by less, relatively, are those of another release of a library.
_ROUNDING = 1e-9


def likeness(scene, duration):
    """What tells a scene from others, velocities at the start left out.

    Args:
        scene: a `Scene`.
        duration: s: functions of time are looked at for so long.

    Returns:
        dict of numbers, words and lists of them by what they are of, in words; `json` keeps it.
    """
    found = {"number of rods": len(scene.rods)}
    for i, rod in enumerate(scene.rods):
        found |= _of_rod(f"rods[{i}]", rod)
    for kind in ("supports", "joints", "loads"):
        items = getattr(scene, kind)
        found[f"number of {kind}"] = len(items)
        for i, item in enumerate(items):
            found |= _of_item(f"{kind}[{i}] ({type(item).__name__})", item, duration)
    return found


def difference(given, expected):
    """Where two likenesses differ first, in words; None where they are alike."""
    for what, value in expected.items():
        if what not in given:
            return f"it has no {what}"
        if not _alike(given[what], value):
            return f"{what} is {reprlib.repr(given[what])}, where the motion has {reprlib.repr(value)}"
    return next((f"the motion has no {what}" for what in given if what not in expected), None)


def _of_rod(where, rod):
    found = {f"{where}.name": rod.name, f"{where}.length (m)": rod.length, f"{where}.damping": repr(rod.damping)}
    s = np.linspace(0, rod.length, _SAMPLES)
    along, places, frames = rod.stiffness_at(s), rod.curve.position(s), rod.curve.frame(s)
    for k, x in enumerate(s):
        at = f"at s = {x:.6g} m"
        found[f"{where}.curve {at}"] = [*places[k].tolist(), *frames[k].ravel().tolist()]
        for name, values in along._asdict().items():
            found[f"{where}: {name} {at}"] = None if values is None else np.asarray(values)[k].tolist()
    return found


def _of_item(where, item, duration):
    found = {}
    for name, value in vars(item).items():
        what = f"{where}.{name}"
        if isinstance(value, Station):
            found[what] = [value.rod.name, value.s]
        elif isinstance(value, Rod):
            found[what] = value.name
        elif isinstance(value, Signal):
            found[f"{what}: jumps"] = list(value.jumps)
            found |= {f"{what} at t = {t!r} s": list(value(t)) for t in sample_times(item, duration)}
        elif value is None or isinstance(value, str | bool | int | float):
            found[what] = value
        elif _is_numbers(value):
            found[what] = np.asarray(value, dtype=float).tolist()
        else:  # of a user's own load: what it holds is for the user to know
            found[what] = type(value).__name__
    return found


def _is_numbers(value):
    try:
        return np.asarray(value).dtype.kind in "iuf"
    except ValueError:
        return False


def _alike(a, b):
    numbers = [x for x in (a, b) if isinstance(x, list | int | float) and not isinstance(x, bool)]
    if len(numbers) < 2 or any(isinstance(y, str) for x in numbers if isinstance(x, list) for y in x):
        return a == b
    a, b = (np.asarray(x, dtype=float) for x in (a, b))
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=_ROUNDING, atol=_ROUNDING * np.abs(b).max(initial=0.0)))
