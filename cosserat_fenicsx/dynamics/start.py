"""Where a motion starts: at rest as drawn, or from a point of a static path, with the velocities of the scene."""

import numpy as np

from cosserat_fenicsx.checks import instance, refuse
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.models.connections import ties_of
from cosserat_fenicsx.results.path import Path

# Positions (lengths) and turns (rad) of a start that supports do not hold are refused above this; velocities relative
# to the largest.
_APART = 1e-6
# Prescribed velocities at the time 0 are differences over this share of the unit of time.
_AHEAD = 1e-6
# Slower than this nothing is a shock, dimensionless.
_SLOW = 1e-9
# What leaves a plane by less keeps to it.
_FLAT = 1e-10


def put_start(model, start):
    """Put (r, q) and the velocities of the scene at the time 0 into a loaded moving model.

    Args:
        model: see `models.moving.Moving`.
        start: None for the reference, a Path for its last point, or (Path, k).

    Returns:
        what to be told of it, sentences.

    Raises:
        SceneError: a start of another scene's rods, or one that supports contradict.
    """
    scene, layout = model.scene, model.layout
    rq = _at_rest(model) if start is None else _of_path(model, *_point(start))
    model.set_motion(model.unknowns_of(rq), np.zeros((sum(layout.counts), model.shape.points, 3)))
    held = rq[model.tied_slots]
    if model.ties:
        c, _, _ = model.ties_at(0.0).evaluate(held, float(model.load_factor.value), np.zeros(len(ties_of(scene))))
        k = int(np.argmax(np.abs(c)))
        if abs(c[k]) > _APART:
            raise SceneError(
                f"{_holder(scene, k)} does not hold at the time 0: it is off by {abs(c[k]):.3g} (lengths or rad). Expected motions "
                "that start where the rods are, such as a RunUp (a Ramp starts with a speed)"
            )
    linear, angular = _velocities(model, rq)
    rates, cautions = np.concatenate([linear, angular], axis=1), []
    if np.abs(rates).max() > 0:
        _check_velocities(model, rq, rates)
    elif model.ties:
        rates = _driven(model, rq, rates)
        if np.abs(rates).max() > _SLOW:
            cautions = [
                "a prescribed motion starts with a speed, and the rods at rest: the shock rings on in contact forces; RunUp starts "
                "without one, and the scheme 'generalised-alpha' lets it die out"
            ]
    model.set_velocity(rates[:, :3], rates[:, 3:])
    return cautions


def starts_in(scene, plane, start):
    """Whether velocities and the static point of a start keep to a plane."""
    e1, e2, normal = np.array(plane.axes)
    for given in scene.velocities:
        s = np.linspace(0, given.rod.length, 33)
        linear, angular = given.at(s, given.rod.curve.position(s))
        off = np.abs(linear @ normal).max(), np.abs(angular @ e1).max(), np.abs(angular @ e2).max()
        if max(off) > _FLAT * max(np.abs(linear).max(), np.abs(angular).max()):
            return False
    if start is None:
        return True
    path, k = _point(start)
    rods = [rod for rod in scene.rods if rod in path.scene.rods]
    moved = np.concatenate([path.motion(rod, np.linspace(0, 1, 33), [path[k]])[0] for rod in rods])
    return (
        max(np.abs(moved[:, :3] @ normal).max(), np.abs(moved[:, 4:] @ e1).max(), np.abs(moved[:, 4:] @ e2).max())
        < _FLAT
    )


def _point(start):
    path, k = start if isinstance(start, tuple) and len(start) == 2 else (start, -1)
    instance("simulate", "start", path, Path, "a load factor, a Path, or (Path, index of its point)")
    if not len(path) or not -len(path) <= k < len(path):
        refuse("simulate", "start", start, f"a point that the path has; it has {len(path)}")
    return path, k


def _at_rest(model):
    return np.column_stack([model.reference, np.tile([1.0, 0, 0, 0], (len(model.reference), 1))])


def _of_path(model, path, k):
    """(N, 7) (r, q) at the nodes of a model from a point of a path on another mesh."""
    scene, length = model.scene, model.scales.length
    parts = []
    for rod, x in zip(scene.rods, model.layout.node_s(model.nodes), strict=True):
        if rod not in path.scene.rods:
            raise SceneError(
                f"simulate.start: the path knows no rod '{rod.name}': expected one with the rods of the scene"
            )
        moved = path.motion(rod, x, [path[k]])[0]
        r = rod.curve.position(x * rod.length) - scene.origin(rod) + moved[:, :3] * path.scales.length
        parts.append(np.column_stack([r / length, moved[:, 3:]]))
    return np.concatenate(parts)


def _velocities(model, rq):
    """(N, 3) velocities and angular velocities of all nodes, dimensionless."""
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
    """Give the nodes that prescribed motions drive the velocities that these have from the time t (s) on, where they have a kink
    there; see `_driven`. All others stay what they are, up to rounding."""
    if not model.ties:
        return
    nodal, _ = model.snapshot()
    rates = model.rates()(nodal, model.snapshot_of_rates())
    rq = np.empty((len(nodal), 7))
    rq[model.tied_slots] = model.tied_motion(nodal[model.tied_slots])
    driven = _driven(model, rq, rates, t)
    if np.abs(driven - rates).max() > _SLOW * np.abs(rates).max(initial=1.0):
        model.set_velocity(driven[:, :3], driven[:, 3:])


def _driven(model, rq, rates, t=0.0):
    """Velocities, but for the nodes that prescribed motions drive: these take the speed of the motion from the time t (s) on at once.
    Without that the trapezoidal rule would make velocities and reactions there alternate from step to step for good."""
    off, gradient, _ = _off(model, rq, rates, t)
    at = model.tied_slots
    change = np.linalg.lstsq(gradient.reshape(len(off), -1), -off, rcond=None)[0]
    driven = rates.copy()
    driven[at] += change.reshape(len(at), 6)
    return driven


def _off(model, rq, rates, t=0.0):
    """How fast the equations of supports and joints change from the time t (s) on with these velocities, their gradient, and how fast
    by prescribed motions alone."""
    eta, now, count = float(model.load_factor.value), rates[model.tied_slots], len(ties_of(model.scene))
    c, gradient, _ = model.ties_at(t).evaluate(rq[model.tied_slots], eta, np.zeros(count))
    later, _, _ = model.ties_at(t + _AHEAD * model.time).evaluate(rq[model.tied_slots], eta, np.zeros(count))
    driven = (later - c) / _AHEAD
    return np.einsum("ikb,kb->i", gradient, now) + driven, gradient, driven


def _check_velocities(model, rq, rates):
    scene, layout = model.scene, model.layout
    size = np.abs(rates).max()

    def of(station):
        rod, vertex = layout.vertex(scene, station)
        nodes = np.array(layout.counts[:rod], dtype=int) * model.shape.degree + 1
        return rates[int(nodes.sum()) + vertex * model.shape.degree]

    for i, support in enumerate(scene.supports):
        if support.clamps and np.abs(of(support.station)).max() > _APART * size:
            _against(f"supports[{i}] ({type(support).__name__} at {support.station})")
    for i, joint in enumerate(scene.joints):
        if joint.rigid and np.abs(of(joint.first) - of(joint.second)).max() > _APART * size:
            _against(f"joints[{i}] ({joint.first} with {joint.second})")
    if model.ties:
        off, _, driven = _off(model, rq, rates)
        k = int(np.argmax(np.abs(off)))
        if abs(off[k]) > 10 * _APART * max(size, np.abs(driven).max()):
            _against(_holder(scene, k))


def _against(holder):
    raise SceneError(f"Scene.velocities: the initial velocity goes against {holder}: expected one that it allows")


def _holder(scene, k):
    """The support or joint whose equation is the k-th."""
    held = [(f"supports[{i}] ({type(s).__name__} at {s.station})", s) for i, s in enumerate(scene.supports)]
    held += [(f"joints[{i}] ({j.first} with {j.second})", j) for i, j in enumerate(scene.joints) if not j.rigid]
    names = [name for name, item in held for _ in item.ties()]
    return names[k]
