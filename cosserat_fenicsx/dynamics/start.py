"""The initial state of a motion: an equilibrium, given or computed, and velocities that supports allow."""

import math
import sys
import warnings

import numpy as np

from cosserat_fenicsx.checks import instance, number, refuse
from cosserat_fenicsx.errors import SceneError, SceneWarning
from cosserat_fenicsx.models.signature import not_flat
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.scene.action import describe, has_permanent
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.signals import at
from cosserat_fenicsx.statics.solve import solve

# Largest violation of supports and joints by the initial state: positions over the unit of length, rotations in rad,
# velocities over the largest one.
_LARGEST_VIOLATION = 1e-6
_OVERLAP = 1e-9  # with an obstacle, over the rod's length
_DIFFERENCE = 1e-6  # interval of the forward difference of prescribed motions, over the unit of time
_ZERO_VELOCITY = 1e-9  # rounding of dimensionless velocities
_OUT_OF_PLANE = 1e-10  # rounding of components out of a plane, over all


def put_start(model, start):
    """Put (r, q) and the velocities of the scene at the time 0 into a loaded moving model, from None for the reference,
    a Path for its last point, or (Path, k), where friction of obstacles begins at zero; returns warnings, a list of
    sentences. A SceneError for a start of another scene's rods, or one that violates supports or joints, or overlaps an
    obstacle that its path does not have."""
    scene, layout = model.scene, model.layout
    rq = _at_rest(model) if start is None else _of_path(model, *point_of(start))
    model.set_motion(model.unknowns_of(rq), np.zeros((sum(layout.counts), model.signature.points, 3)))
    if start is not None:
        _check_overlap(scene, *point_of(start))
        _check_pressed(scene, *point_of(start))
        model.actions.begin_friction()
    held = rq[model.tied_slots]
    if model.ties:
        c, _ = model.ties_at(0.0).evaluate(held, float(model.load_factor.value))
        k = int(np.argmax(np.abs(c)))
        if abs(c[k]) > _LARGEST_VIOLATION:
            raise SceneError(
                f"{_holder(scene, k)} does not hold at the time 0: it is off by {abs(c[k]):.3g} (lengths or rad). "
                "Expected motions that start where the rods are, such as a RunUp (a Ramp starts with a speed)"
            )
    linear, angular = _velocities(model, rq)
    rates, cautions = np.concatenate([linear, angular], axis=1), []
    if np.abs(rates).max() > 0:
        _check_velocities(model, rq, rates)
    elif model.ties:
        rates = _driven(model, rq, rates)
        if np.abs(rates).max() > _ZERO_VELOCITY:
            cautions = [
                "a prescribed motion starts with a speed while the rods are at rest: contact forces then oscillate "
                "without decay, and those of the first steps grow with shorter elements; a RunUp starts without speed, "
                "and the scheme 'generalised-alpha' damps the oscillation"
            ]
    model.set_velocity(rates[:, :3], rates[:, 3:])
    return cautions


def starts_in(scene, plane, start):
    """Whether the initial velocities of a scene and the static point of a start lie in a `Plane`."""
    e1, e2, normal = np.array(plane.axes)
    for given in scene.velocities:
        s = np.linspace(0, given.rod.length, 33)
        linear, angular = given.at(s, given.rod.curve.position(s))
        off = np.abs(linear @ normal).max(), np.abs(angular @ e1).max(), np.abs(angular @ e2).max()
        if max(off) > _OUT_OF_PLANE * max(np.abs(linear).max(), np.abs(angular).max()):
            return False
    if start is None:
        return True
    path, k = point_of(start)
    rods = [rod for rod in scene.rods if rod in path.scene.rods]
    moved = np.concatenate([path.motion(rod, np.linspace(0, 1, 33), [path._records[k]])[0] for rod in rods])
    return (
        max(np.abs(moved[:, :3] @ normal).max(), np.abs(moved[:, 4:] @ e1).max(), np.abs(moved[:, 4:] @ e2).max())
        < _OUT_OF_PLANE
    )


def point_of(start):
    """(Path, index of its point) of the argument `start`."""
    path, k = start if isinstance(start, tuple) and len(start) == 2 else (start, -1)
    instance("simulate", "start", path, Path, "a load factor, a Path, or (Path, index of its point)")
    if not len(path) or not -len(path) <= k < len(path):
        refuse("simulate", "start", start, f"a point that the path has; it has {len(path)}")
    return path, k


def _check_overlap(scene, path, k):
    """Refuse a start inside of an obstacle whose forces are not part of that equilibrium: it would be shot out."""
    known = [obstacle.smooth for obstacle in path.scene.actions if obstacle.gaps is not None]
    for obstacle in scene.actions:
        if obstacle.gaps is None or obstacle.smooth in known:
            continue
        for rod in scene.rods_of(obstacle):
            x = path.layout.node_s(path.rule.nodes)[path.scene.rods.index(rod)]
            moved = path.motion(rod, x, [path._records[k]])[0][:, :3] * path.scales.length
            gap, _ = obstacle.gaps(rod, x * rod.length, rod.curve.position(x * rod.length) + moved)
            worst = int(np.argmin(gap))
            if gap[worst] < -_OVERLAP * rod.length:
                raise SceneError(
                    f"simulate.start: rod '{rod.name}' overlaps {describe(obstacle)} by {-gap[worst]:.3g} m at s = "
                    f"{x[worst] * rod.length:.6g} m: expected a path of a scene with this obstacle, or a start outside"
                )


def _check_pressed(scene, path, k):
    """Refuse a start in which rods press each other: hard surfaces do not overlap, so that elastic ones have no force
    there, and neither has friction."""
    both = scene.rod_contact and path.scene.rod_contact
    pressed = path[k].contacts(both).force if both else ()
    if len(pressed):
        raise SceneError(
            f"simulate.start: rods press each other there by {sum(pressed):.3g} N on hard surfaces, and a motion on "
            "elastic ones would begin without these forces: expected a point of the path before they touch, and a "
            "motion that presses them together slowly"
        )


def _at_rest(model):
    """(N, 7) (r, q) at the nodes of a model in the reference configuration."""
    return np.column_stack([model.reference, np.tile([1.0, 0, 0, 0], (len(model.reference), 1))])


def _of_path(model, path, k):
    """(N, 7) (r, q) at the nodes of a model from a point of a path on another mesh."""
    scene, length = model.scene, model.scales.length
    parts = []
    for rod, x in zip(scene.rods, model.layout.node_s(model.nodes), strict=True):
        if rod not in path.scene.rods:
            raise SceneError(
                f"simulate.start: the path has no rod '{rod.name}': expected one with the rods of the scene"
            )
        moved = path.motion(rod, x, [path._records[k]])[0]
        r = rod.curve.position(x * rod.length) - scene.origin(rod) + moved[:, :3] * path.scales.length
        parts.append(np.column_stack([r / length, moved[:, 3:]]))
    return np.concatenate(parts)


def _velocities(model, rq):
    """The initial velocities and angular velocities of all nodes, (N, 3) each, dimensionless, inertial."""
    scene, scales = model.scene, model.scales
    linear, angular, first = np.zeros((len(rq), 3)), np.zeros((len(rq), 3)), 0
    for rod, x in zip(scene.rods, model.layout.node_s(model.nodes), strict=True):
        rows = slice(first, first + len(x))
        first += len(x)
        for given in scene.velocities:
            if given.rod is rod:
                place = rq[rows, :3] * scales.length + scene.origin(rod)
                v, omega = given.at(x * rod.length, place)
                linear[rows], angular[rows] = v * model.time / scales.length, omega * model.time
    return linear, angular


def drive(model, t):
    """At a kink of a prescribed motion at the time t (s), give the nodes that it moves its velocity after t."""
    if not model.ties:
        return
    nodal, _ = model.snapshot()
    rates = model.rates()(nodal, model.snapshot_of_rates())
    rq = np.empty((len(nodal), 7))
    rq[model.tied_slots] = model.tied_motion(nodal[model.tied_slots])
    driven = _driven(model, rq, rates, t)
    if np.abs(driven - rates).max() > _ZERO_VELOCITY * np.abs(rates).max(initial=1.0):
        model.set_velocity(driven[:, :3], driven[:, 3:])


def _driven(model, rq, rates, t=0.0):
    """(N, 6) velocities with those of prescribed motions after t (s), without which reactions alternate."""
    off, gradient, _ = _off(model, rq, rates, t)
    at = model.tied_slots
    change = np.linalg.lstsq(gradient.reshape(len(off), -1), -off, rcond=None)[0]
    driven = rates.copy()
    driven[at] += change.reshape(len(at), 6)
    return driven


def _off(model, rq, rates, t=0.0):
    """Rates of the constraints of ties after t (s), by velocities `rates` (N, 6); their gradient; by motions alone."""
    load_factor, now, held = float(model.load_factor.value), rates[model.tied_slots], rq[model.tied_slots]
    c, gradients = model.ties_at(t).evaluate(held, load_factor)
    later, _ = model.ties_at(t + _DIFFERENCE * model.time).evaluate(held, load_factor)
    driven, gradient = (later - c) / _DIFFERENCE, model.ties.pattern.on_nodes(gradients)
    return np.einsum("ikb,kb->i", gradient, now) + driven, gradient, driven


def _check_velocities(model, rq, rates):
    """Refuse initial velocities `rates` (N, 6) that supports or joints do not allow."""
    scene, size = model.scene, np.abs(rates).max()

    def of(station):
        return rates[model.slot_of(station)]

    for i, support in enumerate(scene.supports):
        if support.clamps and np.abs(of(support.station)).max() > _LARGEST_VIOLATION * size:
            _against(f"supports[{i}] ({type(support).__name__} at {support.station})")
    for i, joint in enumerate(scene.joints):
        if joint.rigid and np.abs(of(joint.first) - of(joint.second)).max() > _LARGEST_VIOLATION * size:
            _against(f"joints[{i}] ({joint.first} with {joint.second})")
    if model.ties:
        off, _, driven = _off(model, rq, rates)
        k = int(np.argmax(np.abs(off)))
        if abs(off[k]) > 10 * _LARGEST_VIOLATION * max(size, np.abs(driven).max()):
            _against(_holder(scene, k))


def _against(holder):
    raise SceneError(f"Scene.velocities: the initial velocity goes against {holder}: expected one that it allows")


def _holder(scene, k):
    """The name of the support or joint that the k-th constraint belongs to."""
    held = [(f"supports[{i}] ({type(s).__name__} at {s.station})", s) for i, s in enumerate(scene.supports)]
    held += [(f"joints[{i}] ({j.first} with {j.second})", j) for i, j in enumerate(scene.joints) if not j.rigid]
    names = [name for name, item in held for _ in item.ties()]
    return names[k]


# The largest time below 0 (s) that keeps full precision.
_BEFORE = -sys.float_info.min


def before(scene):
    """The scene just before its motion: functions of time evaluated just before t = 0, without initial velocities.

    A `Step`, `Ramp` or `Sine` that starts at 0 does not act yet; one that ends at 0 still acts, and is released at 0.
    """
    supports, loads = ([at(item, _BEFORE) for item in items] for items in (scene.supports, scene.loads))
    return Scene(scene.rods, supports, loads, scene.joints, scene.title)


def equilibrium(scene, load_factor, *, model, elements, degree, comm):
    """The `Path` to the equilibrium of a scene before its motion, on the mesh of the motion.

    Args:
        scene: the scene of the motion.
        load_factor: multiplies its loads and prescribed motions; zero only with permanent loads.
        model, elements, degree, comm: those of the motion.

    Raises:
        SceneError: a load factor that is zero or not finite, or a scene that has no equilibrium.
        NotConverged: the solver does not reach the equilibrium.
    """
    standing = before(scene)
    if has_permanent(standing):
        number("simulate", "start", load_factor, "a finite load factor", math.isfinite)
    else:
        expected = "a load factor that is finite and not 0"
        number("simulate", "start", load_factor, expected, lambda x: math.isfinite(x) and x)
    model = "planar" if model != "spatial" and not not_flat(standing) else "spatial"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # the motion itself tells of an unstable start, and of doubts
        return solve(standing, [load_factor], model=model, elements=elements, degree=degree, comm=comm, progress=False)
