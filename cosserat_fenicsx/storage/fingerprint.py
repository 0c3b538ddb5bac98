"""Fingerprints of scenes, to check whether a scene is the one that a motion was computed for."""

import contextlib
import reprlib

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.along import FUNCTIONS_ALONG
from cosserat_fenicsx.scene.rod import Rod, Station
from cosserat_fenicsx.scene.signals import Signal, sample_times, signals_of

_SAMPLES = 9
#: Relative differences below this are rounding, such as by another release of a library.
_ROUNDING = 1e-9
#: Times after the duration, as multiples of it, where functions of time are sampled for a later, longer duration.
_AHEAD = np.geomspace(1.001, 1009.0, 40)


def fingerprint(scene, duration):
    """The data of a scene, without initial velocities, with functions sampled.

    Args:
        scene: a `Scene`.
        duration: s; functions of time are sampled up to this time.

    Returns:
        {description: number, string or list of these}, which can be written as JSON.
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


def fingerprint_at(scene, times):
    """The part of a scene's fingerprint that depends on time, at `times` (s), without functions that raise there."""
    found = {}
    for kind in ("supports", "loads"):
        for i, item in enumerate(getattr(scene, kind)):
            for name, signal in signals_of(item).items():
                for t in times:
                    with contextlib.suppress(SceneError):  # a function need not be defined beyond the duration
                        found[_time_words(f"{kind}[{i}] ({type(item).__name__}).{name}", t)] = list(signal(t))
    return found


def times_ahead(duration):
    """Times (s) after a duration, see `fingerprint_at`."""
    return (duration * _AHEAD).tolist()


def difference(given, expected):
    """Text that says where two fingerprints differ; None where they agree to rounding.

    It gives the first quantity that differs, and the sample where this differs most.
    """
    groups = {}
    for what in expected:
        groups.setdefault(what.partition(" at ")[0], []).append(what)
    for group in groups.values():
        missing = next((what for what in group if what not in given), None)
        if missing:
            return f"it has no {missing}"
        size = max(_size(expected[what]) for what in group)
        apart = [_apart(given[what], expected[what]) for what in group]
        if max(apart) > _ROUNDING * size:
            what = group[int(np.argmax(apart))]
            return f"{what} is {reprlib.repr(given[what])}, where the motion has {reprlib.repr(expected[what])}"
    return next((f"the motion has no {what}" for what in given if what not in expected), None)


def _of_rod(where, rod):
    found = {f"{where}.name": rod.name, f"{where}.length (m)": rod.length, f"{where}.damping": repr(rod.damping)}
    s = np.linspace(0, rod.length, _SAMPLES)
    along, places, frames = rod.stiffness_at(s), rod.curve.position(s), rod.curve.frame(s)
    for k, x in enumerate(s):
        at = f"at s = {x:.6g} m"
        found[f"{where}.curve {at}"] = [*places[k].tolist(), *frames[k].ravel().tolist()]
        for name, values in along._asdict().items():
            if name == "matrix" and values is None:
                continue  # motions stored before sections had matrices lack this entry
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
            found |= {_time_words(what, t): list(value(t)) for t in sample_times(item, duration)}
        elif value is None or isinstance(value, str | bool | int | float):
            found[what] = value
        elif isinstance(value, FUNCTIONS_ALONG):
            found[f"{what}: breaks"] = list(value.breaks)
            along = np.linspace(0, item.rod.length, _SAMPLES)
            found |= {f"{what} at s = {s:.6g} m": value([s])[0].tolist() for s in along}
        elif _is_numbers(value):
            found[what] = np.asarray(value, dtype=float).tolist()
        else:  # other data of a user's own load are compared by type alone
            found[what] = type(value).__name__
    return found


def _time_words(what, t):
    return f"{what} at t = {t!r} s"


def _is_numbers(value):
    try:
        return np.asarray(value).dtype.kind in "iuf"
    except ValueError:
        return False


def _apart(a, b):
    """The largest difference of two values; infinity where they differ and are not arrays of numbers of one shape."""
    a, b = _array(a), _array(b)
    if a.dtype.kind == "f" and b.dtype.kind == "f" and a.shape == b.shape:
        # equal infinities differ by 0
        return float(np.abs(np.subtract(a, b, out=np.zeros(a.shape), where=a != b)).max(initial=0.0))
    return 0.0 if a.shape == b.shape and bool((a == b).all()) else np.inf


def _size(value):
    array = _array(value)
    return float(np.abs(array[np.isfinite(array)]).max(initial=0.0)) if array.dtype.kind == "f" else 0.0


def _array(value):
    """Numbers as floats, anything else as it is."""
    if _is_numbers(value):
        return np.asarray(value, dtype=float)
    return np.array(value, dtype=object)
