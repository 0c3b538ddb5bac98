"""Refusal of absurdly large loads and prescribed motions, such as by mistakes in units, before the computation."""

import contextlib
from collections import namedtuple

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.action import powers
from cosserat_fenicsx.scene.describe import describe
from cosserat_fenicsx.scene.signals import at, sample_times

# Largest load over the largest EA; and over EI/L^2 where a rod's EA is infinite. For larger loads rounding errors
# dominate.
_MOST_STRAIN, _MOST_BENDING = 1e6, 1e15
# Largest prescribed displacement over the longest rod, and largest prescribed rotation, rad.
_MOST_MOTION = 1e6
# Samples of a distributed load along a rod.
_SAMPLES = 9

#: share: the size over the largest one allowed; scaled: whether the load factor multiplies it; words: text that gives
#: the load or support and its size; most: the largest size allowed, as text.
Magnitude = namedtuple("Magnitude", "share scaled words most")


def magnitudes(scene):
    """The `Magnitude`s of the loads and prescribed motions of a scene."""
    length = max(rod.length for rod in scene.rods)
    K, J = (max(float(getattr(rod.profile.range[1], name).max()) for rod in scene.rods) for name in "KJ")
    most, limit = _MOST_STRAIN * K, f"{_MOST_STRAIN:g} EA = {_MOST_STRAIN * K:.3g} N"
    if np.isinf(K):
        most = _MOST_BENDING * J / length**2
        limit = f"{_MOST_BENDING:g} EI/L^2 = {most:.3g} N"
    found = []
    for load in scene.loads:
        if load.scaled or load.permanent:
            size = max((_force(now, scene, length) for now in _sampled(load, scene.horizon)), default=0.0)
            found.append(Magnitude(size / most, load.scaled, f"{describe(load)}: {size:.3g} N", limit))
    for support in scene.supports:
        for name, most, unit in (("displacement", _MOST_MOTION * length, "m"), ("rotation", _MOST_MOTION, "rad")):
            moves = [getattr(now, name, None) for now in _sampled(support, scene.horizon)]
            size = max((float(np.linalg.norm(move)) for move in moves if move is not None), default=0.0)
            words = f"{describe(support)}: a {name} of {size:.3g} {unit}"
            found.append(Magnitude(size / most, True, words, f"{most:.3g} {unit}"))
    return tuple(found)


def _sampled(item, until):
    """A load or a support at sample times up to `until`, s. Times at which a function of time fails are left out: a
    motion that reaches them raises the error."""
    for t in sample_times(item, until):
        with contextlib.suppress(SceneError):
            yield at(item, t)


def _force(load, scene, length):
    """The size of a load, N: moments are divided by the longest length, loads per length multiplied by it."""
    size = 0.0
    for rod in scene.rods_of(load):
        s = np.zeros(1) if load.station is not None else np.linspace(0.0, rod.length, _SAMPLES)
        for datum in load.data(rod, s):
            force, lengths, _ = powers(datum.unit)
            if force:
                values = np.linalg.norm(np.atleast_2d(datum.value), axis=-1)
                size = max(size, float(values.max()) / length**lengths)
    return size


def check_magnitudes(scene, load_factor):
    """Refuse loads and prescribed motions that are so large that rounding errors would dominate.

    Args:
        scene: a `Scene`; load_factor: the largest one requested.

    Raises:
        SceneError: naming the load or support, its size and the largest one allowed.
    """
    for share, scaled, words, most in scene.magnitudes:
        factor = abs(load_factor) if scaled else 1.0
        if share * factor > 1:
            times = f" times the load factor {factor:g}" if factor != 1 else ""
            raise SceneError(
                f"{words}{times}: expected at most {most}, beyond which rounding errors dominate. Are the units SI "
                "(N, m, Pa)?"
            )
