"""Whether supports and joints are redundant or leave a mechanism, by small motions of the reference."""

import contextlib
import dataclasses
import functools

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.joints import Joint
from cosserat_fenicsx.scene.supports import Clamp
from cosserat_fenicsx.scene.ties import PositionTie, TurnTie

# Relative singular values below this are zero.
_RANK_TOLERANCE = 1e-9
# Ends nearer than this, over a rod's length, lie at one point.
_TOUCHING_DISTANCE = 1e-6


def rows_of(tie):
    """The gradient of a tie at a and b: ((station, row), ...), rows (6,) over (displacement, small rotation)."""
    if isinstance(tie, PositionTie):
        row = np.r_[tie.direction, 0, 0, 0]
    elif isinstance(tie, TurnTie):
        row = np.r_[0, 0, 0, tie.axis]
    else:
        row = np.r_[0, 0, 0, np.cross(tie.t, tie.w)]
    return ((tie.a, row), (tie.b, -row)) if tie.b is not None else ((tie.a, row),)


def _all_rows(scene):
    """(support or joint, [(station, row (6,)), ...]) for every scalar constraint of the scene."""
    for support in scene.supports:
        if support.clamps:
            yield from ((support, [(support.station, row)]) for row in np.eye(6))
        yield from ((support, rows_of(tie)) for tie in support.ties())
    groups = _RigidGroups()
    for joint in scene.joints:
        if joint.rigid and not groups.join(joint.first, joint.second):
            continue  # a rigid joint that closes a loop of rigid joints adds no constraint
        if joint.rigid:
            yield from ((joint, [(joint.first, row), (joint.second, -row)]) for row in np.eye(6))
        else:
            yield from ((joint, rows_of(tie)) for tie in joint.ties())


class _RigidGroups:
    """Groups of stations that rigid joints connect."""

    def __init__(self):
        self._groups = []

    def join(self, *stations):
        """Connect two stations; False where they are in one group already."""
        keys = {_key(station) for station in stations}
        if any(keys <= group for group in self._groups):
            return False
        met = [group for group in self._groups if group & keys]
        self._groups = [group for group in self._groups if not group & keys] + [keys.union(*met)]
        return True


def _key(station):
    """A hashable key of a station, equal for stations so near that they share the end of an element."""
    return station.rod, round(station.s / station.rod.length, 9)


def check_held_once(scene):
    """Refuse redundant constraints: several that hold the same motion of one station.

    Constraints at different stations of a rod are never redundant, since the rod between them is elastic.

    Raises:
        SceneError: naming the redundant supports and joints.
    """
    stations, holders, rows = [], [], []
    for holder, parts in _all_rows(scene):
        row = {}
        for station, values in parts:
            key = _key(station)
            if key not in stations:
                stations.append(key)
            row[stations.index(key)] = values
        holders.append(holder)
        rows.append(row)
    if not rows:
        return
    matrix = np.zeros((len(rows), 6 * len(stations)))
    for i, row in enumerate(rows):
        for k, values in row.items():
            matrix[i, 6 * k : 6 * k + 6] = values
    left, sizes, _ = np.linalg.svd(matrix)
    dependencies = left[:, np.count_nonzero(sizes > _RANK_TOLERANCE * sizes[0]) :]
    redundant = [
        holder for holder, part in zip(holders, dependencies, strict=True) if np.abs(part).max(initial=0) > 1e-6
    ]
    if redundant:
        names = list(dict.fromkeys(_name(scene, holder) for holder in redundant))
        raise SceneError(
            f"Scene: {' and '.join(names)} hold the same motion twice, or contradict each other: expected each motion "
            "of a station to be held once"
        )


def _name(scene, holder):
    for i, support in enumerate(scene.supports):
        if support is holder:  # by identity, since equal supports may occur twice
            return f"supports[{i}] ({type(holder).__name__} at {holder.station})"
    (i,) = (i for i, joint in enumerate(scene.joints) if joint is holder)
    return f"joints[{i}] ({holder.first} with {holder.second})"


@functools.lru_cache(maxsize=32)  # scenes are immutable, and often solved repeatedly
def check_no_mechanism(scene):
    """Refuse a scene with rigid motions of the rods that no support, joint or elastic action resists.

    Raises:
        SceneError: naming the motion that is free.
    """
    size = max(rod.length for rod in scene.rods)
    starts = [rod.curve.position(0.0) for rod in scene.rods]
    rows = []
    elastic = ((action, [held]) for action in scene.loads for held in action.holds(scene))
    for _, parts in (*_all_rows(scene), *elastic):
        row = np.zeros(6 * len(scene.rods))
        for station, values in parts:
            k = scene.rods.index(station.rod)
            arm = (station.rod.curve.position(station.s) - starts[k]) / size
            row[6 * k : 6 * k + 3] += values[:3]
            row[6 * k + 3 : 6 * k + 6] += values[3:] + np.cross(arm, values[:3])
        rows.append(row)
    matrix = np.array(rows).reshape(-1, 6 * len(scene.rods))
    _, sizes, right = np.linalg.svd(matrix)
    held = np.count_nonzero(sizes > _RANK_TOLERANCE * sizes.max(initial=0))
    free = right[held:].reshape(-1, len(scene.rods), 6)
    if len(free) == 0:
        return
    for k, rod in enumerate(scene.rods):
        if np.linalg.matrix_rank(free[:, k], tol=1e-6) == 6:
            raise SceneError(
                f"Scene.supports: nothing holds rod '{rod.name}', it is free to move: expected a support such as "
                f"Clamp({rod.name}.start){_or_a_joint(scene, rod)}"
            )
    k = int(np.argmax(np.abs(free).max(axis=(0, 2))))
    motion = free[np.argmax(np.abs(free[:, k]).max(axis=1)), k]
    others = f", and {len(free) - 1} more motion(s) are free" if len(free) > 1 else ""
    raise SceneError(
        f"Scene is a mechanism: rod '{scene.rods[k].name}' can {_words(motion, starts[k], size)}{others}: "
        "expected supports and joints that hold it, such as a Clamp or a Hinge"
    )


def _or_a_joint(scene, rod):
    """A hint at a missing joint, where an end of a free rod lies on an end of another; else empty."""
    for end, there in sorted(touching(scene), key=lambda pair: pair[0].s):
        if end.rod is rod:
            return f", or a Joint({end}, {there}), which lie at one point"
    return ""


def touching(scene):
    """Pairs of ends of different structures that lie at one point, each in both orders, in the order of the rods."""
    ends = [end for rod in scene.rods for end in (rod.start, rod.end)]
    places = np.array([end.rod.curve.position(end.s) for end in ends])
    for end, place in zip(ends, places, strict=True):
        for j in np.flatnonzero(np.linalg.norm(places - place, axis=1) <= _TOUCHING_DISTANCE * end.rod.length):
            if scene.leader(end.rod) is not scene.leader(ends[j].rod):
                yield end, ends[j]


def without_mechanism(scene):
    """The scene itself; or, for a mechanism, a copy with joints, then supports, made rigid until it is none.

    If the mechanism is in equilibrium in its reference, except for strains, the copy has the same equilibrium: the
    added constraints carry no reaction.

    Raises:
        SceneError: it remains a mechanism.
    """
    loose = [("joints", i, Joint(x.first, x.second)) for i, x in enumerate(scene.joints) if not x.rigid]
    loose += [("supports", i, Clamp(x.station)) for i, x in enumerate(scene.supports) if not x.clamps]
    held = scene
    for kind, i, fast in loose:
        try:
            check_no_mechanism(held)
            return held
        except SceneError:
            items = list(getattr(held, kind))
            items[i] = fast
            with contextlib.suppress(SceneError):  # the constraint would be redundant
                held = dataclasses.replace(held, **{kind: items})
    try:
        check_no_mechanism(held)
    except SceneError:
        check_no_mechanism(scene)  # raises with the motion of the given scene
        raise
    return held


def _words(motion, start, size):
    """A rigid motion (velocity of the start over size, rotation) as text."""
    moved, turn = motion[:3], motion[3:]
    if np.linalg.norm(turn) <= 1e-6:
        return f"move along ({_numbers(moved / np.abs(moved).max())})"
    point = start + size * np.cross(turn, moved) / (turn @ turn)
    return f"turn about the axis ({_numbers(turn / np.abs(turn).max())}) through ({_numbers(point, size)}) m"


def _numbers(x, size=1.0):
    return ", ".join(f"{value:.4g}" for value in np.where(np.abs(x) < 1e-9 * size, 0.0, x))
