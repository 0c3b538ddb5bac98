"""Whether a scene moves in a plane: its rods, sections, supports, joints and loads all keep to one.

Then small motions out of the plane decouple from those in it, and (x, z, theta) are all that equilibrium needs.
"""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.scene.curves import Line
from cosserat_fenicsx.scene.signals import at, sample_times
from cosserat_fenicsx.scene.statical import rows_of
from cosserat_fenicsx.scene.ties import PositionTie, TurnTie

# A direction lies in a plane, or along its normal, where the sine of the angle between is below this.
_SLANT = 1e-9
# Directions that differ by less do not tell the plane by themselves.
_APART = 1e-6
# Places along a rod that is not straight or not the same everywhere, in golden steps: no turn of a helix, no twist and no wave
# of a section repeats at all of them.
_SAMPLES, _GOLDEN = 401, (math.sqrt(5) - 1) / 2
#: Works of loads that keep to a plane if their vectors do.
_WORKS = {
    "force", "moment", "eccentric_force", "follower_force", "follower_moment", "line_force", "line_moment",
}  # fmt: skip


@dataclass(frozen=True)
class Plane:
    """A plane's directions: rows (e_1, e_2, e_3) of inertial components, right-handed, e_3 the normal."""

    axes: tuple

    @property
    def words(self):
        """How a person calls it."""
        normal = np.array(self.axes[2])
        for i, name in enumerate(("y-z", "x-z", "x-y")):
            if abs(abs(normal[i]) - 1) < _SLANT:
                return f"the {name} plane"
        return f"the plane with the normal ({', '.join(f'{x:.4g}' for x in normal)})"

    def parts(self, row):
        """A row over (displacement, rotation) as its parts in the plane (3,) and out of it (3,)."""
        e1, e2, e3 = np.array(self.axes)
        moved, turned = row[:3], row[3:]
        return np.array([e1 @ moved, e2 @ moved, e3 @ turned]), np.array([e3 @ moved, e1 @ turned, e2 @ turned])


def find_plane(scene):
    """The plane of a scene.

    Returns:
        (`Plane`, "") or (None, why there is none).
    """
    try:
        return _find(scene), ""
    except _Leaves as reason:
        return None, str(reason)


class _Leaves(Exception):
    """What leaves the plane."""


def independent_in(plane, ties):
    """Indices of the ties that hold a motion in the plane, none of them twice: x, y and z of a place are two there."""
    groups = {}
    for i, tie in enumerate(ties):
        groups.setdefault((tie.a, tie.b), []).append(i)
    kept = []
    for members in groups.values():
        left = np.array([plane.parts(rows_of(ties[i])[0][1])[0] for i in members])
        for _ in range(3):
            sizes = np.linalg.norm(left, axis=1)
            k = int(np.argmax(sizes))
            if sizes[k] < _APART:
                break
            kept.append(members[k])
            direction = left[k] / sizes[k]
            left = left - np.outer(left @ direction, direction)
    return tuple(sorted(kept))


def _find(scene):
    tangents = [_sample(rod) for rod in scene.rods]
    chords = [rod.curve.position(0.0) - scene.origin(rod) for rod in scene.rods]
    chords = [a for a, rod in zip(chords, scene.rods, strict=True) if np.linalg.norm(a) > 1e-9 * rod.length]
    drawn = _units([*(frame[:, 2] for _, frames in tangents for frame in frames), *chords])
    acting = [_vectors(scene, i, load) for i, load in enumerate(scene.loads)]
    normal = _normal_of(drawn)
    if normal is None:
        normal = _normal_of_a_line(
            drawn[0], [*acting, *(_motions(support, scene.horizon) for support in scene.supports)], scene
        )
    normal = normal * np.sign(normal[np.argmax(np.abs(normal))])
    if np.abs(drawn @ normal).max() > _SLANT:
        raise _Leaves("the rods do not lie in one plane")
    for i, (load, (inside, across)) in enumerate(zip(scene.loads, acting, strict=True)):
        bent = [np.linalg.norm(np.cross(v, normal)) for v in _units(across)]
        if max([*np.abs(_units(inside) @ normal), *bent], default=0.0) > _SLANT:
            what = "does not turn in" if across and not inside else "points out of"
            raise _Leaves(f"load {i + 1} ({_words(load)}) {what} the plane of the rods")
    for rod, (s, frames) in zip(scene.rods, tangents, strict=True):
        _check_section(rod, s, frames, normal)
    e1 = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    e1 /= np.linalg.norm(e1)
    plane = Plane(tuple(map(tuple, (e1, np.cross(normal, e1), normal))))
    _check_supports(scene, plane)
    return plane


def _sample(rod):
    """Arc lengths and frames that stand for a rod."""
    if isinstance(rod.curve, Line) and rod.profile.constant:
        s = np.zeros(1)
    else:
        inside = rod.length * (np.arange(1, _SAMPLES) * _GOLDEN % 1.0)
        s = np.unique(np.concatenate([[0.0, rod.length], inside, rod.breaks]))
    return s, rod.curve.frame(s).reshape(-1, 3, 3)


def _units(vectors):
    """(k, 3) directions of vectors that are not zero."""
    sizes = [np.linalg.norm(v) for v in vectors]
    return np.array([v / size for v, size in zip(vectors, sizes, strict=True) if size > 0]).reshape(-1, 3)


def _vectors(scene, i, load):
    """Vectors that a load asks to be in the plane, and across it."""
    if load.work not in _WORKS:
        raise _Leaves(f"load {i + 1} ({_words(load)}) is of a kind that only the spatial model knows")
    given = []
    for now in (at(load, t) for t in sample_times(load, scene.horizon)):
        if now.station is not None:
            given += [(np.asarray(v), unit) for v, unit in now.vectors(now.station.rod)]
            continue
        for rod in scene.rods:
            if now.acts_on(rod):
                s = np.linspace(0, rod.length, _SAMPLES)
                given += [(v, "moment" if now.unit == "force" else "force") for v in now.density(rod, s)]
    return [v for v, unit in given if unit != "moment"], [v for v, unit in given if unit == "moment"]


def _motions(holder, until):
    """Displacements and rotation vectors that a support or a joint prescribes, at times that stand for all."""
    moved, turned = [], []
    for ties in (at(holder, t).ties() for t in sample_times(holder, until)):
        moved.append(sum((np.multiply(t.rate, t.direction) for t in ties if isinstance(t, PositionTie)), np.zeros(3)))
        turned += [np.array(t.rotation) for t in ties if isinstance(t, TurnTie)]
    return moved, turned


def _normal_of(directions):
    """The normal of directions that span a plane; None where they are all but along one line."""
    _, sizes, right = np.linalg.svd(directions)
    return right[2] if len(sizes) > 1 and sizes[1] > _APART else None


def _normal_of_a_line(tangent, acting, scene):
    """Where all rods are along one line the first load or prescribed motion that leaves it tells the normal, or else
    the section, which bends where it is weakest."""
    for inside, across in acting:
        for force in _units(inside):
            normal = np.cross(tangent, force)
            if np.linalg.norm(normal) > _APART:
                return normal / np.linalg.norm(normal)
        for moment in _units(across):
            if abs(moment @ tangent) < _SLANT:
                return moment
    rod = scene.rods[0]
    low = rod.profile.range[0]
    return rod.curve.frame(0.0)[:, 0 if low.J[0] < low.J[1] else 1]


def _check_section(rod, s, frames, normal):
    """One principal axis of every section must be the normal; those of a round one may be taken anywhere."""
    across = np.abs(frames.transpose(0, 2, 1) @ normal)[:, :2]
    skew = across.min(axis=1) > _SLANT
    if not skew.any():
        return
    for side in ("left", "right"):
        along = rod.stiffness_at(s[skew], side)
        for name, pair in (("EI", along.J[..., :2]), ("GA", along.K[..., :2])):
            if not np.isclose(pair[..., 0], pair[..., 1], rtol=1e-12, atol=0).all():
                raise _Leaves(f"a section of rod '{rod.name}' has its principal axes ({name}) askew to the plane")


def _check_supports(scene, plane):
    """What supports and joints hold must split into motions in the plane and out of it."""
    for what, holders in (("support", scene.supports), ("joint", [j for j in scene.joints if not j.rigid])):
        for i, holder in enumerate(holders):
            ties = holder.ties()
            if not ties:
                continue
            rows = [rows_of(tie)[0][1] for tie in ties]
            parts = [np.array(x) for x in zip(*(plane.parts(row) for row in rows), strict=True)]
            apart = sum(np.linalg.matrix_rank(x, tol=_APART) for x in parts)
            moved, turned = _motions(holder, scene.horizon)
            normal = np.array(plane.axes[2])
            out = [*np.abs(_units(moved) @ normal), *(np.linalg.norm(np.cross(v, normal)) for v in _units(turned))]
            if apart > np.linalg.matrix_rank(np.array(rows), tol=_APART) or max(out, default=0.0) > _SLANT:
                where = getattr(holder, "station", None) or f"{holder.first} with {holder.second}"
                name = type(holder).__name__
                raise _Leaves(
                    f"{what} {i + 1} ({name} at {where}) holds or moves what is askew to the plane of the rods"
                )


def _words(load):
    where = load.station or getattr(load, "rod", None)
    where = getattr(where, "name", where)
    return type(load).__name__ + (f" at {where}" if where else "")
