"""Properties of an action's virtual work found from its UFL: what it depends on, and whether it preserves a plane."""

from collections import namedtuple
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import loads as virtual_work
from cosserat_fenicsx.forms.point import Point, resultants
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.scene.action import is_axial
from cosserat_fenicsx.scene.signals import at

# Relative differences below this are rounding; number of random states that are tested.
_NOTHING, _TRIED = 1e-9, 3


@dataclass(frozen=True)
class Traits:
    """Properties of a virtual work: dead: depends on no position, rotation or velocity; known_force: its force does not
    depend on them; its moment may; rates: depends on velocities; turns: is invariant under a common rotation of data
    and state, so that a model may use components along other axes; flat: where its vectors lie in a plane (axial ones
    along the normal), so does its force (and its moment along the normal)."""

    dead: bool
    known_force: bool
    rates: bool
    turns: bool
    flat: bool


def work_of(action):
    """The virtual work of an action, a function (point, virtual motion, *data, *memory) -> UFL; or None."""
    return getattr(virtual_work, action.work) if isinstance(action.work, str) else action.work


def traits_of(action, rods):
    """The `Traits` of an action in a scene with these rods: its own, or those found from its virtual work."""
    return Traits(**action.traits) if action.traits else found_traits(action, rods)


def found_traits(action, rods):
    """The `Traits` of an action, found from its virtual work."""
    work = work_of(action)
    if work is None:
        return Traits(True, True, False, True, True)
    named = action.station.rod if action.station is not None else action.rod
    rod = named or next(rod for rod in rods if action.acts_on(rod))
    data = (*at(action, 0.0).data(rod, np.zeros(1)), *action.memory)
    return _traits(work, tuple((datum.size, is_axial(datum.unit)) for datum in data))


@lru_cache(maxsize=256)
def _resultant(work, sizes):
    """The `_Resultant` of a virtual work."""
    domain = compat.interval_domain()
    vectors = {name: ufl.Constant(domain, shape=(3,)) for name in ("r", "r_s", "theta", "rest", "r_t", "omega")}
    R, frame = (ufl.Constant(domain, shape=(3, 3)) for _ in range(2))
    rest = vectors.pop("rest")
    point = Point(R=R, rest=lambda: rest, frame=lambda: frame, **vectors)
    data = [ufl.Constant(domain, shape=(3,) if size == 3 else ()) for size in sizes]
    force, moment = resultants(lambda point, test: work(point, test, *data), point)
    return _Resultant(force, moment, {**vectors, "rest": rest, "R": R, "frame": frame}, data)


class _Resultant(namedtuple("_Resultant", "force moment symbols data")):
    """Force and moment of a virtual work, UFL (3,); {name: its Constant} of the state; Constants of the data."""

    def at(self, state, data):
        """(6,) force and moment at values of the symbols and of the data."""
        mapping = {self.symbols[name]: _nested(value) for name, value in state.items()}
        mapping |= {symbol: _nested(value) for symbol, value in zip(self.data, data, strict=True)}
        return np.array([float(a[i]((0.0,), mapping)) for a in (self.force, self.moment) for i in range(3)])


def resultant_at_rest(action, scene, t):
    """(6,) force (N) and moment (N m), inertial, of a point action with its station at rest in the reference, at the
    time t (s) and with its initial memory."""
    work, rod = work_of(action), action.station.rod
    if work is None:
        return np.zeros(6)
    s, frame = np.array([action.station.s]), rod.curve.frame(action.station.s)
    place, origin = rod.curve.position(action.station.s), scene.origin(rod)
    now = at(action, t)
    data = (*(now.refreshed(rod, s, place[None]) if now.refreshed else now.data(rod, s)), *action.memory)
    values = [datum.value - origin if datum.unit == "m from origin" else datum.value for datum in data]
    none = np.zeros(3)
    state = {"r": place - origin, "rest": place - origin, "r_s": frame[:, 2], "theta": none, "r_t": none, "omega": none,
             "R": np.eye(3), "frame": frame}  # fmt: skip
    numbers = [np.reshape(value, (-1, datum.size))[0] for value, datum in zip(values, data, strict=True)]
    found = _resultant(work, tuple(datum.size for datum in data))
    return action.amplitude * found.at(state, [a if len(a) == 3 else a[0] for a in numbers])


@lru_cache(maxsize=256)
def _traits(work, kinds):
    resultant = _resultant(work, tuple(size for size, _ in kinds))
    force, moment, symbols, _ = resultant
    state = {symbol for name, symbol in symbols.items() if name not in ("rest", "frame")}

    def found(*expressions):
        return {c for a in expressions for c in ufl.algorithms.analysis.extract_type(a, ufl.Constant)}

    rates = {symbols["r_t"], symbols["omega"]}
    turns = all(_turns(resultant, kinds, seed) for seed in range(_TRIED))
    return Traits(
        dead=state.isdisjoint(found(force, moment)),
        known_force=state.isdisjoint(found(force)),
        rates=not rates.isdisjoint(found(force, moment)),
        turns=turns,
        flat=turns and all(_stays_flat(resultant, kinds, seed) for seed in range(_TRIED)),
    )


def _stays_flat(resultant, kinds, seed):
    """Whether force and moment preserve the plane of the first two axes where a random state and data do."""
    f, m = np.split(resultant.at(*_random_values(kinds, seed, flat=True)), 2)
    return max(abs(f[2]), abs(m[0]), abs(m[1])) <= _NOTHING * max(np.abs(f).max(), np.abs(m).max(), 1.0)


def _turns(resultant, kinds, seed):
    """Whether force and moment rotate with a random state and random data."""
    state, data = _random_values(kinds, seed)
    Q = _turned_by(np.random.default_rng(seed + 7).normal(size=3))
    turned = {name: Q @ value @ Q.T if name == "R" else Q @ value for name, value in state.items()}
    found = resultant.at(turned, [Q @ value if np.ndim(value) else value for value in data])
    expected = (resultant.at(state, data).reshape(2, 3) @ Q.T).ravel()
    return np.abs(found - expected).max() <= _NOTHING * max(np.abs(expected).max(), 1.0)


def _turned_by(theta):
    """(3, 3) matrix of a rotation vector, rad."""
    angle = np.linalg.norm(theta)
    return directors(np.array([[np.cos(angle / 2), *np.sin(angle / 2) / angle * theta]]))[0]


def _random_values(kinds, seed, *, flat=False):
    """A random state {name: value} and data for a `_Resultant`; kinds: (size, whether an axial vector) of the data."""
    random = np.random.default_rng(seed)

    def vector(axial=False):
        a = random.normal(size=3)
        return a * ([0, 0, 1] if axial else [1, 1, 0]) if flat else a

    theta, t = vector(axial=True), vector()
    t, e3 = t / np.linalg.norm(t), np.array([0.0, 0.0, 1.0])
    across = np.cross(t, e3) / np.linalg.norm(np.cross(t, e3))
    state = {name: vector(axial=name == "omega") for name in ("r", "r_s", "rest", "r_t", "omega")}
    state |= {"theta": theta, "R": _turned_by(theta)}
    state["frame"] = np.column_stack([across, np.cross(t, across), t])
    return state, [vector(axial) if size == 3 else abs(random.normal()) + 0.1 for size, axial in kinds]


def _nested(value):
    return tuple(map(_nested, value)) if np.ndim(value) else float(value)
