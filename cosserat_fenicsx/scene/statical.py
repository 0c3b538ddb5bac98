"""Whether supports and joints are redundant or leave a mechanism, by small motions of the reference: connected groups
(union-find), and motions that constraints leave free (null spaces)."""

import contextlib
import dataclasses
import functools

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import svd
from cosserat_fenicsx.scene.action import some_of
from cosserat_fenicsx.scene.curves import Line, positions_along
from cosserat_fenicsx.scene.sections import sizes_across
from cosserat_fenicsx.scene.supports import Clamp, Hinge, Joint, Pin, PositionTie, TurnTie

# Free motions that a message names; parts of a motion that are rounding.
_TOLD, _FREE = 5, 1e-6
# Places along a rod at which it lies in a plane or not.
_ALONG = 9
# Words for one and for several spinning rods, and for what holds them.
_SPIN = ("turn about its own axis", "each turn about its own axis")
_HOLD_SPIN = (
    "at one end of each rod that spins what holds it about its axis: a Clamp or a Hinge in the place of a Pin, a joint "
    "without release or with an axis across the rod in the place of a ball joint"
)


class Groups:
    """Union-find of hashable, ordered items; the smallest item of a group is its leader.

    An item that was never joined is a group of its own.
    """

    def __init__(self):
        self._above = {}

    def leader(self, x):
        """The smallest member of the group of x."""
        above, up = self._above, self._above.get(x, x)
        while up != x:
            further = above.get(up, up)
            above[x] = further  # path halving
            x, up = up, further
        return x

    def join(self, one, other):
        """Merge two groups; False where they are one already."""
        first, second = self.leader(one), self.leader(other)
        if first == second:
            return False
        first, second = sorted((first, second))
        self._above[second] = first
        return True

    def joined(self):
        """All members that are not the leaders of their groups."""
        return self._above.keys()


# Singular values below this, over the largest, are zero.
_RANK_TOLERANCE = 1e-9
# Largest number of columns of a matrix that is decomposed as a dense one.
_DENSE = 150
# Shift of the normal matrix over its largest diagonal entry: well above rounding, which is some 1e-16.
_SHIFT = 1e-12
# The block holds all small singular values once its largest one exceeds this, relative to the largest of the matrix.
_GAP = 1e-4
# Initial block size, and the factor by which it grows until it reaches the gap.
_BLOCK, _GROWTH = 8, 8
# Each iteration reduces components of singular values beyond the gap by the factor _SHIFT / _GAP**2.
_ITERATIONS = 5
#: Largest number of null vectors that are searched for in a matrix of more than `_DENSE` columns.
MOST = 64


def null_space(row, column, value, shape):
    """(n, k) an orthonormal basis of the vectors that a matrix of a shape maps to zero, and whether it is complete: a
    matrix that is not small may have more than `MOST` such vectors. row, column, value: entries; those at the same
    place are added.

    A small matrix is decomposed into singular values. For others, the right singular vectors of the smallest singular
    values are found by iterations with the inverse of A^T A + shift I on a block of vectors V. The singular values are
    taken from A V, since forming A^T A would lose half of their digits. The block grows until it holds all singular
    values below `_GAP`, which separates small values from zero as well as a dense decomposition.
    """
    size = shape[1]
    if size <= _DENSE:
        matrix = np.zeros(shape)
        np.add.at(matrix, (row, column), value)
        _, sizes, right = svd(matrix, full_matrices=shape[0] < size)
        return right[np.count_nonzero(sizes > _RANK_TOLERANCE * sizes.max(initial=0)) :].T, True
    from scipy.sparse import csc_matrix, identity  # slow to import, and few scenes need it
    from scipy.sparse.linalg import splu

    matrix = csc_matrix((value, (row, column)), shape=shape)
    normal = (matrix.T @ matrix).tocsc()
    largest = np.sqrt(normal.diagonal().max()) or 1.0  # norm of a column, at most the largest singular value
    shifted = normal + _SHIFT * largest**2 * identity(size, format="csc")
    symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    factors = splu(shifted.tocsc(), **symmetric)
    rng, count = np.random.default_rng(1), _BLOCK
    while True:
        count = min(count, size)
        vectors = rng.standard_normal((size, count))
        for _ in range(_ITERATIONS):
            vectors = np.linalg.qr(factors.solve(vectors))[0]
        triangle = np.linalg.qr(matrix @ vectors, mode="r")
        _, sizes, right = svd(triangle)
        sizes = np.append(sizes, np.zeros(count - len(sizes)))
        zero = sizes <= _RANK_TOLERANCE * largest
        if sizes[0] > _GAP * largest or count == size:
            return vectors @ right[zero].T, True
        if count >= MOST and zero.any():
            return vectors @ right[zero].T, False
        count *= _GROWTH


# Points closer than this, relative to a rod's length, or than this part of what rods measure across, lie at one point.
_TOUCHING_DISTANCE, _PART_ACROSS = 1e-6, 0.25
# Parts that a curved rod is cut into for the search of such points; how often a part is narrowed, to a quarter each.
_PARTS, _NARROWER = 32, 6
# Pairs of points that are compared one by one.
_FEW_PAIRS = 100_000
# Largest number of supports and joints listed in a message.
_NAMED = 8


def rows_of(tie):
    """The gradient of a tie at a and b: ((station, row), ...), rows (6,) over (displacement, small rotation)."""
    if isinstance(tie, PositionTie):
        row = np.r_[tie.direction, 0, 0, 0]
    elif isinstance(tie, TurnTie):
        row = np.r_[0, 0, 0, tie.axis]
    else:
        row = np.r_[0, 0, 0, np.cross(tie.t, tie.w)]
    return ((tie.a, row), (tie.b, -row)) if tie.b is not None else ((tie.a, row),)


def _holders(scene):
    """The supports and joints that add constraints: not the rigid joints that close a loop of rigid joints."""
    yield from scene.supports
    rigid = Groups()
    for joint in scene.joints:
        if not joint.rigid or rigid.join(_key(scene, joint.first), _key(scene, joint.second)):
            yield joint


def _rows(holder):
    """[(station, row (6,)), ...] of every scalar constraint of a support or a joint."""
    if isinstance(holder, Joint) and holder.rigid:
        return [[(holder.first, row), (holder.second, -row)] for row in np.eye(6)]
    if not isinstance(holder, Joint) and holder.clamps:
        return [[(holder.station, row)] for row in np.eye(6)]
    return [rows_of(tie) for tie in holder.ties()]


def _key(scene, station):
    """A key of a station, equal for stations so near that they share the end of an element."""
    return scene.number(station.rod), round(station.s / station.rod.length, 9)


def check_held_once(scene):
    """Refuse (SceneError) redundant constraints: several that hold the same motion of one station. Constraints at
    different stations of a rod are never redundant, since the rod between them is elastic. So only those may be that
    connect stations, and the ground, in a closed loop."""
    joined, grounded, closed, stations, holders = Groups(), set(), [], [], [*_holders(scene)]
    if len(holders) < len(scene.supports) + len(scene.joints):
        pairs = set()
        for joint in scene.joints:
            pair = frozenset(_key(scene, x) for x in (joint.first, joint.second))
            if pair in pairs:
                raise SceneError(f"Scene.joints: {joint.first} and {joint.second} are joined twice: expected one Joint")
            pairs.add(pair)
    for holder in holders:
        if isinstance(holder, Joint):
            one, other = (joined.leader(_key(scene, x)) for x in (holder.first, holder.second))
            if not joined.join(one, other) or (one in grounded and other in grounded):
                closed.append(one)
            if one in grounded or other in grounded:
                grounded.add(joined.leader(one))
        else:
            one = joined.leader(_key(scene, holder.station))
            if one in grounded:
                closed.append(one)
            grounded.add(one)
        stations.append((holder, one))
    loops = {joined.leader(one): [] for one in closed}
    for holder, one in stations if loops else ():
        if (leader := joined.leader(one)) in loops:
            loops[leader] += [(holder, row) for row in _rows(holder)]
    redundant = {id(holder) for loop in loops.values() for holder in _redundant(scene, loop)}
    if redundant:
        names = list(dict.fromkeys(name for name, holder in _named(scene) if id(holder) in redundant))
        names = [*names[:_NAMED], f"{len(names) - _NAMED} more"] if len(names) > _NAMED else names
        raise SceneError(
            f"Scene: {' and '.join(names)} hold the same motion twice, or contradict each other: expected each motion "
            "of a station to be held once"
        )


def _redundant(scene, constraints):
    """The holders of linearly dependent constraints (holder, [(station, row), ...])."""
    columns, entries = {}, []
    for i, (_, parts) in enumerate(constraints):
        for station, values in parts:
            k = columns.setdefault(_key(scene, station), len(columns))
            entries += [(6 * k + j, i, value) for j, value in enumerate(values) if value]
    dependent, _ = null_space(*map(np.array, zip(*entries, strict=True)), (6 * len(columns), len(constraints)))
    return [
        holder for (holder, _), part in zip(constraints, dependent, strict=True) if np.abs(part).max(initial=0) > 1e-6
    ]


def _named(scene):
    """(name, support or joint) for all of them."""
    for i, support in enumerate(scene.supports):
        yield f"supports[{i}] ({type(support).__name__} at {support.station})", support
    for i, joint in enumerate(scene.joints):
        yield f"joints[{i}] ({joint.first} with {joint.second})", joint


@functools.lru_cache(maxsize=32)  # scenes are immutable, and often solved repeatedly
def check_no_mechanism(scene):
    """Refuse (SceneError) a scene with rigid motions of the rods that no support, joint or elastic action resists."""
    free, complete = free_motions(scene)
    if len(free) == 0:
        return
    loose = np.flatnonzero(np.linalg.matrix_rank(free.swapaxes(0, 1), tol=1e-6) == 6)
    if len(loose):
        rod = scene.rods[loose[0]]
        raise SceneError(
            f"Scene.supports: nothing holds rod '{rod.name}', it is free to move: expected a support such as "
            f"Clamp({rod.name}.start){_or_a_joint(scene, rod)}"
        )
    spins = _spins(scene, free)
    rest = _plain_motions(free, [_spin(scene, k) for k in spins])
    told, remedies = [], []
    if len(rest):
        remedies.append("supports and joints that hold it, such as a Clamp or a Hinge")
    if spins:
        names = some_of(f"'{scene.rods[k].name}'" for k in spins)
        told.append(f"rod{'s' if len(spins) > 1 else ''} {names} can {_SPIN[len(spins) > 1]}")
        remedies.append(_HOLD_SPIN)
    most = _TOLD if complete else 1
    for motion in rest[:most]:
        k = int(np.argmax(np.abs(motion).max(axis=1)))
        told.append(
            f"rod '{scene.rods[k].name}' can {_words(motion[k], scene.rods[k].curve.position(0.0), _size(scene))}"
        )
    if len(rest) > most:
        told.append(f"{'' if complete else 'at least '}{len(rest) - most} more motion(s) are free")
    expected = _hinges_for_balls(scene) or "; and ".join(remedies)
    raise SceneError(f"Scene is a mechanism: {', and '.join(told)}: expected {expected}")


def _hinges_for_balls(scene):
    """What to do where rods in a coordinate plane are held once pins and ball joints are hinges about its normal; else
    ""."""
    pinned = [x.station for x in scene.supports if isinstance(x, Pin)]
    balls = [x.first for x in scene.joints if x.release == "all"]
    tangents = [rod.curve.frame(np.linspace(0.0, rod.length, _ALONG))[:, :, 2] for rod in scene.rods if pinned or balls]
    for i, plane in ((1, "x-z"), (0, "y-z"), (2, "x-y")):
        if not tangents or np.abs(np.concatenate(tangents)[:, i]).max() > _FREE:
            continue
        axis = np.eye(3)[i]
        supports = [Hinge(x.station, axis) if isinstance(x, Pin) else x for x in scene.supports]
        joints = [Joint(x.first, x.second, axis) if x.release == "all" else x for x in scene.joints]
        with contextlib.suppress(SceneError):  # some of them may hold a motion twice
            if not len(free_motions(dataclasses.replace(scene, supports=supports, joints=joints))[0]):
                along = f"({_numbers(axis)})"
                remedies = [(pinned, f"a Hinge with axis = {along} in the place of the Pin"),
                            (balls, f"release = {along} of the Joint")]  # fmt: skip
                told = [f"{remedy} at {some_of(map(str, places))}" for places, remedy in remedies if places]
                return (
                    f"{' and '.join(told)} (hinge_axis of a frame), if all acts in the {plane} plane: in space a Pin "
                    "or a ball joint lets a rod turn about every axis"
                )
    return ""


def _spin(scene, k):
    """(rods, 6) the rotation of a straight rod about its own axis, as in `free_motions`, of length 1."""
    motion = np.zeros((len(scene.rods), 6))
    motion[k, 3:] = scene.rods[k].curve.frame(0.0)[:, 2]
    return motion


def _spins(scene, free):
    """Indices of the straight rods that may turn about their own axes while all others rest."""
    straight = (
        k for k, rod in enumerate(scene.rods) if isinstance(rod.curve, Line) and np.abs(free[:, k]).max() > _FREE
    )
    along = {k: np.einsum("mi,i->m", free[:, k, 3:], scene.rods[k].curve.frame(0.0)[:, 2]) for k in straight}
    return [k for k, parts in along.items() if np.linalg.norm(parts) > 1 - _FREE]


def _plain_motions(free, spins):
    """(m, rods, 6) a basis of the free motions, along x, y and z where possible, without those of rods that spin."""
    if spins:
        inside = np.linalg.qr(np.array([np.tensordot(free, spin, 2) for spin in spins]).T, mode="complete")[0]
        free = np.tensordot(inside[:, len(spins) :].T, free, 1)
    if not len(free):
        return free
    most = np.abs(free).max(axis=(0, 2)).argmax()
    row = 0
    for column in (3, 4, 5, 0, 1, 2):  # to reduced echelon form
        pivot = row + int(np.abs(free[row:, most, column]).argmax())
        if np.abs(free[pivot, most, column]) <= _FREE:
            continue
        free[[row, pivot]] = free[[pivot, row]]
        free[row] /= free[row, most, column]
        others = np.arange(len(free)) != row
        free[others] -= free[others, most, column, None, None] * free[row]
        row += 1
        if row == len(free):
            break
    return free


def free_motions(scene):
    """The rigid motions of the rods that no support, joint or elastic action resists: (k, rods, 6) an orthonormal
    basis, of every rod the velocity of its start over the length of the longest rod and its rotation; and whether it is
    complete. Rods that rigid joints connect move as one body, and not at all where it is clamped; the constraints of
    the other bodies, six unknowns each, are the rows of a matrix, and the motions its null space."""
    bodies, size = Groups(), _size(scene)
    for joint in scene.joints:
        if joint.rigid:
            bodies.join(scene.number(joint.first.rod), scene.number(joint.second.rod))
    of_rod = [bodies.leader(k) for k in range(len(scene.rods))]
    clamped = {of_rod[scene.number(x.station.rod)] for x in scene.supports if x.clamps}
    columns = {body: 6 * i for i, body in enumerate(b for b in dict.fromkeys(of_rod) if b not in clamped)}
    if not columns:
        return np.zeros((0, len(scene.rods), 6)), True
    held = [*scene.supports, *(joint for joint in scene.joints if not joint.rigid)]
    rows = [rows_of(tie) for item in held for tie in item.ties()]
    rows += [[part] for action in scene.loads for part in action.holds(scene)]
    i, body, place, row = [], [], [], []
    for number, parts in enumerate(rows):
        for station, values in parts:
            if (leader := of_rod[scene.number(station.rod)]) in columns:
                i.append(number), body.append(leader), row.append(values)
                place.append(station.rod.curve.position(station.s))
    starts = np.array([rod.curve.position(0.0) for rod in scene.rods])
    body, row = np.array(body, dtype=int), np.array(row).reshape(-1, 6)
    arm = (np.array(place).reshape(-1, 3) - starts[body]) / size
    # of a body that is larger than the longest rod, rotations are measured by the motion of its farthest point
    reach = np.ones(len(scene.rods))
    np.maximum.at(reach, body, np.linalg.norm(arm, axis=1))
    row[:, 3:] = (row[:, 3:] + np.cross(arm, row[:, :3])) / reach[body, None]
    first = np.array([columns[k] for k in body.tolist()], dtype=int)
    places = np.repeat(i, 6).astype(int), (first[:, None] + np.arange(6)).ravel()
    motions, complete = null_space(*places, row.ravel(), (len(rows), 6 * len(columns)))
    if not motions.size:
        return np.zeros((0, len(scene.rods), 6)), True
    of_bodies = motions.T.reshape(-1, len(columns), 6)
    free = np.zeros((len(of_bodies), len(scene.rods), 6))
    for k, leader in enumerate(of_rod):
        if leader in columns:
            moved, turn = np.split(of_bodies[:, columns[leader] // 6], 2, axis=1)
            turn = turn / reach[leader]
            free[:, k] = np.hstack([moved + np.cross(turn, (starts[k] - starts[leader]) / size), turn])
    if len(columns) < len(scene.rods):  # rods of one body repeat its motion
        free = np.linalg.qr(free.reshape(len(free), -1).T)[0].T.reshape(free.shape)
    return free, complete


def _size(scene):
    """The length of the longest rod, m."""
    return max(rod.length for rod in scene.rods)


def _or_a_joint(scene, rod):
    """A hint at a missing joint, where an end of a free rod lies on another; else empty."""
    for end, there, distance in sorted(touching(scene), key=lambda pair: pair[0].s):
        if end.rod is rod and distance <= _TOUCHING_DISTANCE * rod.length:
            return f", or a Joint({end}, {there}), which lie at one point"
    return ""


def touching(scene):
    """Ends of rods that lie on other rods, and neither joined to them there nor held both: [(end, station, distance in
    m)], in the order of the rods; one end of those that are joined to each other, and two that lie at one point in both
    orders.

    An end lies on a rod where its distance is rounding, or a quarter of what the thinner one measures across.
    """
    rods, lengths, count = scene.rods, scene.lengths, len(scene.rods)
    if count == 1:
        return []
    points = _Points(scene)
    held, first = {points.least(support.station) for support in scene.all_supports}, np.unique(points.of_ends)
    curves, parts = [rod.curve for rod in rods], np.minimum(np.ceil(lengths / lengths.mean()), _PARTS).astype(int)
    parts[[not isinstance(curve, Line) for curve in curves]] = _PARTS
    along = np.concatenate([np.arange(2 * n + 1) / (2 * n) for n in parts.tolist()])
    places = positions_along(curves, along, 2 * parts + 1)
    last = np.cumsum(2 * parts + 1) - 1
    ends = places[np.stack([last - 2 * parts, last], axis=1).ravel()]
    rod = np.repeat(np.arange(count), parts)
    begin = 2 * np.arange(len(rod)) + rod  # of each part, among the places
    across = {id(x.section): x for x in rods}  # many rods share a section
    across = {name: min(sizes_across(x.section_at(0.0)), default=0.0) for name, x in across.items()}
    thick = _PART_ACROSS * np.array([across[id(x.section)] for x in rods])
    sizes, rounding = lengths[rod] / parts[rod], _TOUCHING_DISTANCE * lengths
    end, part = _near(ends[first], places[begin + 1], 0.5 * sizes + max(rounding.max(), thick.max()))
    end, own, k = first[end], first[end] // 2, rod[part]
    most, begin = np.maximum(rounding[own], np.minimum(thick[own], thick[k])), begin[part]
    # an arc leaves its chord by at most half of what its length has more, as legs of a triangle
    chord = places[begin + 2] - places[begin]
    away = 0.5 * np.sqrt(np.maximum(sizes[part] ** 2 - np.sum(chord**2, axis=1), 0.0))
    _, distance = _on_chord(ends[end], places[begin], chord)
    apart = np.all(end[:, None] != points.of_ends[k], axis=1) & (own != k) & (distance <= most + away)
    found = {}
    for i in np.flatnonzero(apart).tolist():
        key, limit = (int(end[i]), int(k[i])), most[i]
        if key not in points.between:
            x, distance = _nearest(curves[k[i]], ends[end[i]], *along[begin[i] + [0, 2]])
            if distance <= limit and distance < found.get(key, (0.0, np.inf))[1]:
                found[key] = x, distance
    pairs, known = [], set()
    for (end, k), (x, distance) in sorted(found.items()):
        if min(x, 1 - x) * lengths[k] <= max(distance, rounding[k]):
            other = rods[k].end if x > 0.5 else rods[k].start
        else:
            other = rods[k].at(float(f"{x * lengths[k]:.12g}"))
        pair = end, points.least(other)  # one of those that are joined to each other
        if pair not in known and not (end in held and pair[1] in held):
            known.add(pair)
            pairs.append((rods[end // 2].end if end % 2 else rods[end // 2].start, other, distance))
    return pairs


class _Points:
    """Numbers of stations, 2 i and 2 i + 1 at the ends of rod i; and which of them are joined: to the least of them."""

    def __init__(self, scene):
        self._scene, self._between, self._joined = scene, {}, Groups()
        for joint in scene.joints:
            self._joined.join(self._number(joint.first), self._number(joint.second))
        #: (least number, rod) of what is joined between the ends of rods
        self.between = {(self._joined.leader(number), key[0]) for key, number in self._between.items()}
        #: (rods, 2) least numbers of the ends
        self.of_ends = np.array([self._joined.leader(i) for i in range(2 * len(scene.rods))]).reshape(-1, 2)

    def least(self, station):
        """The least number of those that a station is joined to."""
        return self._joined.leader(self._number(station))

    def _number(self, station):
        i, x = _key(self._scene, station)
        if x in (0, 1):
            return 2 * i + int(x)
        return self._between.setdefault((i, x), 2 * len(self._scene.rods) + len(self._between))


def _near(points, middles, reach):
    """Numbers of the pairs of points (n, 3) and middles (m, 3) no further apart than reach (m,)."""
    if len(points) * len(middles) <= _FEW_PAIRS:
        apart = np.sum((points[:, None] - middles) ** 2, axis=2)
        return np.nonzero(apart <= reach**2)
    from scipy.spatial import cKDTree  # here, since few scenes have so many rods

    near = cKDTree(points).query_ball_point(middles, reach)
    return np.concatenate(near).astype(int), np.repeat(np.arange(len(middles)), [len(each) for each in near])


def _on_chord(points, start, chord):
    """Places in [0, 1] on chords (n, 3) nearest to points (n, 3), and the distances to them."""
    place = np.clip(np.sum((points - start) * chord, axis=1) / np.maximum(np.sum(chord**2, axis=1), 1e-300), 0, 1)
    return place, np.linalg.norm(start + place[:, None] * chord - points, axis=1)


def _nearest(curve, point, first, last):
    """The place in [0, 1] of a curve between two places that is nearest to a point (3,), and the distance, m."""
    low, high = first, last
    for _ in range(_NARROWER):
        start, end = curve.position(np.array([low, high]) * curve.length)
        place, distance = _on_chord(point[None], start[None], (end - start)[None])
        x, half = low + place[0] * (high - low), (high - low) / 8
        low, high = max(first, x - half), min(last, x + half)
    return x, distance[0]


def without_mechanism(scene):
    """The scene itself; or, for a mechanism, a copy with joints, then supports, made rigid until it is none; a
    SceneError if it remains one. If it is in equilibrium in its reference, except for strains, the copy has the same
    equilibrium: the added constraints carry no reaction."""
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
