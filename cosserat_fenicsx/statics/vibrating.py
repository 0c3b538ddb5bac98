"""Modes along a path, with the onset of flutter, and over the rates of a steady rotation (Campbell diagram)."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import instance, number, refuse, whole
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.results.modes import ModesAlong
from cosserat_fenicsx.results.records import Event
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.statics.natural_modes import admit, assigned, at_state, modes

# Relative width of the bracket of a load factor of flutter; and of the bracket around it on a coarser mesh.
_LOCATED, _NEAR = 1e-9, 1e-3


def modes_along(path, count, damped):
    """See `Path.modes`."""
    whole("Path.modes", "count", count)
    if not len(path):
        raise SceneError("Path.modes: the path is empty: expected at least one point")
    records, scene = path._records, path.scene
    admit("Path.modes", scene, damped)
    if records[0].gauss_fields is not None and records[0].gauss_fields.shape[1] != path.degree:
        raise SceneError("Path.modes: expected a path with as many Gauss points as the degree (gauss_points=None)")

    def at(layout, load_factor, start):
        obey()
        return at_state(scene, layout, path.degree, count, load_factor, damped, start)

    starts = [(record.rq, record.gauss_fields) for record in records]
    found = [at(path.layout, record.load_factor, start)[0] for record, start in zip(records, starts, strict=True)]
    path.events = [event for event in path.events if event.kind != "flutter"]
    for k in range(len(found) - 1):
        if _flutters(found[k]) != _flutters(found[k + 1]):
            event = _onset(path, at, k, [found[k + i].load_factor for i in range(2)], starts[k : k + 2])
            place = sum(other.after <= k for other in path.events)
            path.events.insert(place, event)
    return _followed(found, path.load_factors)


def campbell(
    scene: Scene,
    rates: Sequence[float],
    count: int = 6,
    *,
    load_factor: float = 0.0,
    tol: float = 1e-6,
    elements: int | None = None,
    degree: int = 4,
    comm: MPI.Comm | None = None,
    progress: bool | None = None,
) -> ModesAlong:
    """Modes of rotating rods over the rate of rotation; its `plot` is a Campbell diagram.

    Args:
        scene: with one `Centrifugal`, which says the axis and the sense of the rotation.
        rates: rad/s, from 0 on, in place of that rate's size; in the order in which modes are followed.
        count: number of modes at each rate, see `modes`. load_factor, tol, elements, degree, comm, progress: see there.

    Returns:
        ModesAlong.

    Raises:
        SceneError: no rotation, no rates or negative ones; as of `modes`. NotConverged: as of `modes`.
    """
    instance("campbell", "scene", scene, Scene, "a Scene")
    turning = [load for load in scene.loads if load.of_inertia]
    if len(turning) != 1:
        raise SceneError(f"campbell: the scene has {len(turning)} steady rotations (Centrifugal): expected one")
    rates = np.atleast_1d(rates).tolist()
    if not rates:
        refuse("campbell", "rates", rates, "at least one rate (rad/s)")
    for rate in rates:
        number("campbell", "rates", rate, "rates from 0 on (rad/s)", lambda x: 0 <= x < math.inf)
    others = [load for load in scene.loads if load is not turning[0]]
    axis, found = np.array(turning[0].rate) / np.linalg.norm(turning[0].rate), []
    for rate in rates:
        here = [dataclasses.replace(turning[0], rate=tuple((rate * axis).tolist()))] if rate else []
        found.append(
            modes(
                dataclasses.replace(scene, loads=[*others, *here]), count, load_factor=load_factor, damped=True,
                tol=tol, elements=elements, degree=degree, comm=comm, progress=progress,
            )
        )  # fmt: skip
    return _followed(found, rates)


def _followed(found, along):
    """The `ModesAlong` of `Modes` in turn: eigenvalues are followed by linear extrapolation over `along` (n,)."""
    fewest = min(map(len, found))
    order, values = [np.arange(fewest)], [found[0].eigenvalues[:fewest]]
    for k, here in enumerate(found[1:], 1):
        before = values[-1]
        if k > 1 and along[k - 1] != along[k - 2]:
            before = before + (before - values[-2]) * (along[k] - along[k - 1]) / (along[k - 1] - along[k - 2])
        order.append(assigned(before, here.eigenvalues[:fewest]))
        values.append(here.eigenvalues[order[-1]])
    return ModesAlong(tuple(found), np.array(order))


def _flutters(found):
    return bool((found.kind == "flutter").any())


def _grows(calm):
    """A function of `Modes` that says whether a vibration grows: by more than rounding; but by anything, where at a
    load factor without flutter, whose `Modes` are given, all of them decay."""
    turns = calm.eigenvalues.imag > 0
    decays = bool((calm.growth_rates < -calm.unsure)[turns].all())

    def grows(found):
        turns = found.eigenvalues.imag > 0
        return bool((found.eigenvalues.real > (0.0 if decays else found.unsure))[turns].any())

    return grows


def _onset(path, at, k, ends, starts):
    """The `Event` where a vibration begins to grow, or ceases to, between the points k and k + 1 of a path; at: see
    `at_state`; ends, starts: load factors and states of both points."""

    def between(load_factor):
        share = (load_factor - ends[0]) / (ends[1] - ends[0])
        return tuple(None if a is None else (1 - share) * a + share * b for a, b in zip(*starts, strict=True))

    if ends[0] == ends[1]:
        raise NotConverged("the onset of flutter lies between two points with one load factor: ask for more points")
    modes_there = [at(path.layout, end, start)[0] for end, start in zip(ends, starts, strict=True)]
    last = _flutters(modes_there[1])
    grows = _grows(modes_there[0 if last else 1])
    here, found = _bisected(lambda x: at(path.layout, x, between(x))[0], grows, *(ends if last else ends[::-1]))
    mode = np.argmax(np.where(found.eigenvalues.imag > 0, found.growth_rates, -np.inf))
    value, shape = found.eigenvalues[mode], found.at_phase()[mode, :, :3]
    return Event("flutter", here, shape, k, abs(value.real / value), _difference(path, at, grows, here))


def _bisected(modes_at, grows, calm, growing):
    """(load factor, its `Modes`) of the onset of flutter between a load factor where nothing grows and one where a
    vibration does; grows: see `_grows`."""
    found = modes_at(growing)
    while abs(growing - calm) > _LOCATED * max(abs(growing), abs(calm)):
        middle = (calm + growing) / 2
        here = modes_at(middle)
        if grows(here):
            growing, found = middle, here
        else:
            calm = middle
    return growing, found


def _difference(path, at, grows, load_factor):
    """Relative difference of the onset of flutter from that on elements twice as long; NaN where that is not known."""
    if path.control != "load":
        return math.nan
    coarse = path.layout.finer(path.scene, 0.5)
    if coarse.counts == path.layout.counts:
        return math.nan
    try:
        _, start = at(coarse, load_factor, None)
        ends = load_factor * (1 - _NEAR), load_factor * (1 + _NEAR)
        growing = [grows(at(coarse, end, start)[0]) for end in ends]
        if growing[0] == growing[1]:
            return math.nan
        there, _ = _bisected(lambda x: at(coarse, x, start)[0], grows, *(ends if growing[1] else ends[::-1]))
    except NotConverged:
        return math.nan
    return abs(there / load_factor - 1)
