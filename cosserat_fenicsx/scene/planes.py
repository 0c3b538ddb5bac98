"""Whether a scene is plane: its rods, sections, supports, joints and loads are symmetric about one plane.

Then small motions out of the plane decouple from those in it, and (x, z, theta) suffice as unknowns of an equilibrium.
"""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.scene.action import describe, is_axial
from cosserat_fenicsx.scene.curves import Line
from cosserat_fenicsx.scene.rod import mass_arm
from cosserat_fenicsx.scene.rolled import Profile
from cosserat_fenicsx.scene.signals import at, sample_times
from cosserat_fenicsx.scene.statical import rows_of
from cosserat_fenicsx.scene.supports import PositionTie, TurnTie

# A direction lies in a plane, or along its normal, where the sine of its angle to it is below this.
_SMALLEST_ANGLE = 1e-9
# Directions that differ by less (sine of the angle) are parallel and define no plane; also the tolerance of ranks.
_PARALLEL = 1e-6
# Samples along a rod that is curved or not uniform, at multiples of the golden ratio: no periodic curve or section
# repeats at all of them.
_SAMPLES, _GOLDEN = 401, (math.sqrt(5) - 1) / 2
_A_FEW = 64  # rods of a large frame that are looked at first


@dataclass(frozen=True)
class Plane:
    """The directions of a plane: right-handed unit vectors e_1, e_2, e_3, rows of inertial components, e_3 the
    normal."""

    axes: tuple

    @property
    def words(self):
        """Its name in messages."""
        normal = np.array(self.axes[2])
        for i, name in enumerate(("y-z", "x-z", "x-y")):
            if abs(abs(normal[i]) - 1) < _SMALLEST_ANGLE:
                return f"the {name} plane"
        return f"the plane with the normal ({', '.join(f'{x:.4g}' for x in normal)})"

    def parts(self, row):
        """Split a row (6,) over (displacement, rotation) into its parts in the plane (3,) and out of it (3,)."""
        e1, e2, e3 = np.array(self.axes)
        moved, turned = row[:3], row[3:]
        return np.array([e1 @ moved, e2 @ moved, e3 @ turned]), np.array([e3 @ moved, e1 @ turned, e2 @ turned])


def find_plane(scene):
    """(`Plane`, "") of a scene, or (None, why there is none)."""
    try:
        return _find(scene), ""
    except _Leaves as reason:
        return None, str(reason)


def bent_weakly(scene):
    """([rods], `Plane`): rods of rolled profiles that bend about their weaker axis in the plane of the scene, as `Line`
    turns a section where no `d1` is given; ([], None) where there are none, or loads along one line show no plane."""
    rods = [x for x in scene.rods if isinstance(x.curve, Line) and x.curve.d1 is None]
    rods = [rod for rod in rods if isinstance(rod.section_at(0.0), Profile)]
    plane = scene.plane if rods else None
    if plane is None:
        return [], None
    along = scene.rods[0].curve.frame(0.0)[:, 2]
    acting = [vector for load in scene.loads for part in _vectors(scene, load) for vector in _units(part)]
    shown = [*acting, *(_sample(rod)[1][0, :, 2] for rod in scene.rods)]
    if all(np.linalg.norm(np.cross(along, vector)) < _PARALLEL for vector in shown):
        return [], None
    return [rod for rod in rods if abs(rod.curve.frame(0.0)[:, 1] @ plane.axes[2]) > 1 - _SMALLEST_ANGLE], plane


class _Leaves(Exception):
    """The message names the part of a scene that leaves the plane."""


def independent_in(plane, ties):
    """Indices of independent ties among those for motions in the plane: for a point held in x, y and z two remain."""
    groups = {}
    for i, tie in enumerate(ties):
        groups.setdefault((tie.a, tie.b), []).append(i)
    kept = []
    for members in groups.values():
        left = np.array([plane.parts(rows_of(ties[i])[0][1])[0] for i in members])
        for _ in range(3):
            sizes = np.linalg.norm(left, axis=1)
            k = int(np.argmax(sizes))
            if sizes[k] < _PARALLEL:
                break
            kept.append(members[k])
            direction = left[k] / sizes[k]
            left = left - np.outer(left @ direction, direction)
    return tuple(sorted(kept))


def _find(scene):
    if len(scene.rods) > 2 * _A_FEW:  # of most frames in space a few rods show that there is no plane
        _, drawn = _drawn(scene, scene.rods[:: len(scene.rods) // _A_FEW])
        _lie_in(_normal_of(drawn), drawn)
    tangents, drawn = _drawn(scene, scene.rods)
    acting = [_vectors(scene, load) for load in scene.actions]
    normal = _normal_of(drawn)
    if normal is None:
        normal = _normal_of_a_line(
            drawn[0], [*acting, *(_motions(support, scene.horizon) for support in scene.supports)], scene
        )
    normal = normal * np.sign(normal[np.argmax(np.abs(normal))])
    _lie_in(normal, drawn)
    for rod, (s, frames) in zip(scene.rods, tangents, strict=True):
        _check_section(rod, s, frames, normal)
        if rod.mass_centre:
            offsets = np.concatenate([mass_arm(rod, s, side) for side in ("left", "right")])
            if np.abs(offsets @ normal).max() > _SMALLEST_ANGLE * rod.mass_centre.largest:
                raise _Leaves(f"the mass centre of rod '{rod.name}' lies off the plane (Rod.eccentricity)")
    for i, (load, (inside, across)) in enumerate(zip(scene.actions, acting, strict=True)):
        bent = [np.linalg.norm(np.cross(v, normal)) for v in _units(across)]
        if max([*np.abs(_units(inside) @ normal), *bent], default=0.0) > _SMALLEST_ANGLE:
            what = "does not turn in" if across and not inside else "points out of"
            which = f"loads[{i}] ({describe(load)})" if i < len(scene.loads) else describe(load)
            raise _Leaves(f"{which} {what} the plane of the rods")
    e1 = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    e1 /= np.linalg.norm(e1)
    plane = Plane(tuple(map(tuple, (e1, np.cross(normal, e1), normal))))
    _check_supports(scene, plane)
    return plane


def _drawn(scene, rods):
    """[`_sample`] of rods, and unit vectors (n, 3) along them and to their starts from that of their structure."""
    samples = [_sample(rod) for rod in rods]
    chords = np.array([rod.curve.position(0.0) - scene.origin(rod) for rod in rods])
    chords = chords[np.linalg.norm(chords, axis=1) > 1e-9 * np.array([rod.length for rod in rods])]
    return samples, _units(np.concatenate([*(frames[:, :, 2] for _, frames in samples), chords]))


def _lie_in(normal, drawn):
    """Raise `_Leaves` where directions (n, 3) do not lie in the plane with a normal; None where they are parallel."""
    if normal is not None and np.abs(drawn @ normal).max() > _SMALLEST_ANGLE:
        raise _Leaves("the rods do not lie in one plane")


def _sample(rod):
    """Arc lengths (n,), m, and frames (n, 3, 3) at samples of a rod."""
    if isinstance(rod.curve, Line) and rod.profile.constant and not rod.mass_centre:
        s = np.zeros(1)
    else:
        inside = rod.length * (np.arange(1, _SAMPLES) * _GOLDEN % 1.0)
        s = np.unique(np.concatenate([[0.0, rod.length], inside, rod.breaks]))
    return s, rod.curve.frame(s).reshape(-1, 3, 3)


def _units(vectors):
    """(k, 3) unit vectors along those vectors that are not zero."""
    vectors = np.reshape(vectors, (-1, 3))
    sizes = np.linalg.norm(vectors, axis=1)
    return vectors[sizes > 0] / sizes[sizes > 0, None]


def _vectors(scene, load):
    """The vectors of a load that must lie in the plane, and those that must be normal to it."""
    given = []
    for now in (at(load, t) for t in sample_times(load, scene.horizon)):
        if now.station is not None:
            given += now.data(now.station.rod, np.array([now.station.s]))
            continue
        for rod in scene.rods_of(now):
            origin = scene.origin(rod)
            given += [_from(origin, datum) for datum in now.data(rod, np.linspace(0, rod.length, _SAMPLES))]
    vectors = [datum for datum in given if datum.size == 3]
    inside, across = (
        [v for x in vectors if is_axial(x.unit) == axial for v in x.value.reshape(-1, 3)] for axial in (False, True)
    )
    return inside, across


def _from(origin, datum):
    """Make positions relative to the origin of their structure, a point of the plane."""
    return datum._replace(value=datum.value - origin) if datum.unit == "m from origin" else datum


def _motions(holder, until):
    """Displacements and rotation vectors that a support or a joint prescribes, at sample times."""
    moved, turned = [], []
    for ties in (at(holder, t).ties() for t in sample_times(holder, until)):
        moved.append(sum((np.multiply(t.rate, t.direction) for t in ties if isinstance(t, PositionTie)), np.zeros(3)))
        turned += [np.array(t.rotation) for t in ties if isinstance(t, TurnTie)]
    return moved, turned


def _normal_of(directions):
    """The normal of directions that span a plane; None where all are parallel."""
    _, sizes, right = np.linalg.svd(directions, full_matrices=len(directions) < 3)
    return right[2] if len(sizes) > 1 and sizes[1] > _PARALLEL else None


def _normal_of_a_line(tangent, acting, scene):
    """The normal where all rods lie on one line: of the first load or motion off it, else of the smaller stiffness."""
    for inside, across in acting:
        for force in _units(inside):
            normal = np.cross(tangent, force)
            if np.linalg.norm(normal) > _PARALLEL:
                return normal / np.linalg.norm(normal)
        for moment in _units(across):
            if abs(moment @ tangent) < _SMALLEST_ANGLE:
                return moment
    rod = scene.rods[0]
    low = rod.profile.range[0]
    return rod.curve.frame(0.0)[:, 0 if low.J[0] < low.J[1] else 1]


def _check_section(rod, s, frames, normal):
    """Refuse sections that couple motions in the plane with others: the normal must be a principal axis."""
    if rod.profile.coupled:
        t = frames[:, :, 2]
        axes = np.stack([np.cross(normal, t), np.broadcast_to(normal, t.shape), t], axis=1) @ frames
        for side in ("left", "right"):
            turn = np.kron(np.eye(2), axes)
            matrix = turn @ rod.stiffness_at(s, side).matrix @ turn.swapaxes(1, 2)
            size = np.sqrt(np.einsum("kii->ki", matrix))
            if (np.abs(matrix) > _SMALLEST_ANGLE * size[:, :, None] * size[:, None, :])[:, 0::2, 1::2].any():
                raise _Leaves(f"a section of rod '{rod.name}' couples strains in the plane with those out of it")
        return
    across = np.abs(frames.transpose(0, 2, 1) @ normal)[:, :2]
    skew = across.min(axis=1) > _SMALLEST_ANGLE
    if not skew.any():
        return
    for side in ("left", "right"):
        along = rod.stiffness_at(s[skew], side)
        for name, pair in (("EI", along.J[..., :2]), ("GA", along.K[..., :2])):
            if not np.isclose(pair[..., 0], pair[..., 1], rtol=1e-12, atol=0).all():
                raise _Leaves(f"a section of rod '{rod.name}' has its principal axes ({name}) oblique to the plane")


def _check_supports(scene, plane):
    """Refuse supports and joints whose constraints do not split into those in the plane and those out of it."""
    for what, holders in (("supports", scene.supports), ("joints", scene.joints)):
        for i, holder in enumerate(holders):
            ties = () if what == "joints" and holder.rigid else holder.ties()
            if not ties:
                continue
            rows = [rows_of(tie)[0][1] for tie in ties]
            parts = [np.array(x) for x in zip(*(plane.parts(row) for row in rows), strict=True)]
            apart = sum(np.linalg.matrix_rank(x, tol=_PARALLEL) for x in parts)
            moved, turned = _motions(holder, scene.horizon)
            normal = np.array(plane.axes[2])
            out = [*np.abs(_units(moved) @ normal), *(np.linalg.norm(np.cross(v, normal)) for v in _units(turned))]
            if apart > np.linalg.matrix_rank(np.array(rows), tol=_PARALLEL) or max(out, default=0.0) > _SMALLEST_ANGLE:
                where = getattr(holder, "station", None) or f"{holder.first} with {holder.second}"
                name = type(holder).__name__
                raise _Leaves(f"{what}[{i}] ({name} at {where}) constrains motions oblique to the plane of the rods")
