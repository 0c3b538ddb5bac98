"""Modes of small vibrations about a static state or a steady rotation, damped or not; along a path, with the onset of
flutter, and over the rates of a steady rotation (Campbell diagram)."""

import contextlib
import dataclasses
import math
from collections import namedtuple
from collections.abc import Sequence
from numbers import Complex

import numpy as np
from mpi4py import MPI
from scipy.optimize import linear_sum_assignment

from cosserat_fenicsx.algebra.pencil import Pencil, QuadraticPencil, on_every_rank
from cosserat_fenicsx.checks import instance, number, refuse, tolerance, warn, whole
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.models.formulation import traits_of
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.contacts import refuse_grazing, warn_of_contact
from cosserat_fenicsx.results.modes import Modes, ModesAlong
from cosserat_fenicsx.results.records import Event
from cosserat_fenicsx.results.shapes import Equilibrium
from cosserat_fenicsx.scene.action import describe, has_permanent
from cosserat_fenicsx.scene.loads import Load
from cosserat_fenicsx.scene.rod import require_inertia
from cosserat_fenicsx.scene.scene import Scene, check_magnitudes, check_tensions
from cosserat_fenicsx.scene.signals import at
from cosserat_fenicsx.scene.stages import refuse_stages
from cosserat_fenicsx.scene.statical import without_mechanism
from cosserat_fenicsx.statics.meshes import layers_of, until_two_meshes_agree
from cosserat_fenicsx.statics.path.follower import standing
from cosserat_fenicsx.statics.problem import (
    check_arguments,
    look_beside,
    refuse_rod_contact,
    refuse_rough_threads,
    solvers_of,
)
from cosserat_fenicsx.statics.small_motions import (
    Bodies,
    beside_edges,
    circulatory_part,
    corrected,
    edges_of_contact,
    of_blocks,
    resisting,
    rows_of_rods,
    softness,
    stiffness,
)
from cosserat_fenicsx.statics.stability import shapes_of

_MOST_ELEMENTS = 128
_CORRECTIONS = 10  # Newton iterations after the added constraints of a mechanism are removed
# By how much the largest gain of a halving that is assumed, as a power of 2, is below twice the degree: of squares, and
# of complex eigenvalues, whose errors are not of one sign.
_OF_SQUARES, _OF_EIGENVALUES = 2, 4
# Sizes below this share of the largest eigenvalue, such as of free motions, count as that where others follow them.
_LEAST = 1e-9
# Relative difference of distances from a point, of complex eigenvalues, that rounding may leave.
_AS_FAR = 1e-8
# Sine of the angle between a vector and the axis of a rotation below which it has the axis's direction; arc lengths, as
# shares of a rod, where that is tried.
_ALONG, _TRIED = 1e-9, np.array([0.0, 0.31, 0.73, 1.0])


def modes(
    scene: Scene,
    count: int = 1,
    *,
    load_factor: float = 0.0,
    damped: bool | None = None,
    near: complex | None = None,
    tol: float = 1e-6,
    elements: int | None = None,
    degree: int = 4,
    comm: MPI.Comm | None = None,
    progress: bool | None = None,
) -> Modes:
    """Eigenvalues and shapes of small vibrations about a static state, or about a steady rotation.

    Undamped: K x = omega^2 M x under the constraints of supports and joints, with K the second variation in (r, theta)
    and M the inertia of the sections. Complex: lambda^2 M x + lambda (D + G) x + K x = 0. D holds the `Damping` of rods
    and what every action loses or gains by small velocities, G the gyroscopic terms of a steady rotation, and K also
    the part of loads without a potential, which may make the state flutter.

    With a `Centrifugal` in the scene the state is its steady rotation. Eigenvalues and shapes are those seen in the
    rotating frame, where supports and springs are at rest.

    Args:
        scene: a `Scene`; every rod needs a mass and inertia. Without a load factor it may be free to move.
        count: number of modes, from the smallest square, or the smallest size of lambda, on.
        load_factor: eta of the state, a point of the path of load control from the unloaded reference. The reference
            of a mechanism, such as a rod that hangs on a hinge, must be its equilibrium position but for strains. It
            multiplies the unbalance of eccentric rods in a `Centrifugal`, too: 1 for all of it.
        damped: whether to compute complex modes: None where something resists velocities, the scene rotates, or its
            loads have no potential. With False, what depends on velocities is left out and named in
            `Modes.left_out`, and where the loads have no potential the symmetric part of K is used.
        near: 1/s, complex: the complex modes nearest that point, such as 2j pi f for those about the frequency f.
        tol: relative accuracy of the squares, or of complex eigenvalues: elements are doubled until two meshes agree to
            it, unless `elements` is given.
        elements: elements per rod; fixes the mesh.
        degree: 1 to 4, of r and q.
        comm: MPI communicator; default all ranks. Every rank calls; each solves the whole eigenproblem.
        progress: True, False, or None to show it in runs of more than two seconds.

    Returns:
        Modes. It holds fewer than `count` where the mesh has fewer degrees of freedom.

    Raises:
        SceneError: an argument outside its range, or a rod without inertia; in a steady rotation, a load or what
            resists velocities that is not the same in all its positions.
        NotConverged: the load factor or the accuracy is not reached.
    """
    instance("modes", "scene", scene, Scene, "a Scene")
    admit("modes", scene, damped)
    number("modes", "load_factor", load_factor, "a finite number", math.isfinite)
    whole("modes", "count", count)
    whole("modes", "elements", 1 if elements is None else elements)
    tolerance("modes", tol)
    rotation = _rotation(scene)
    if near is not None:
        if isinstance(near, bool) or not isinstance(near, Complex) or not np.isfinite(near):
            refuse("modes", "near", near, "a finite complex number (1/s)")
        if near.imag < 0:
            refuse("modes", "near", near, "a number of the upper half plane, whose eigenvalues stand for their pairs")
    if damped is False and near is not None:
        raise SceneError("modes: damped = False: expected None or True with `near`")
    if load_factor or has_permanent(scene):
        check_arguments(without_mechanism(scene), tol, elements, owner="modes")
        check_magnitudes(scene, load_factor)
        check_tensions(scene, [load_factor])
    comm, slowed = communicator(comm), _slowed(scene)
    eccentric = [rod.name for rod in scene.rods if rod.mass_centre]
    if rotation is not None and eccentric and not load_factor and comm.rank == 0:
        warn(f"modes: the load factor multiplies the unbalance of rod '{eccentric[0]}' in the rotation (Centrifugal), "
             "which the state at 0 does not have: expected load_factor=1 for all of it")  # fmt: skip
    if damped is None and (near is not None or rotation is not None or slowed):
        damped = True
    following, last = _Following(), []

    def on_mesh(layout):
        found = _on_mesh(scene, layout, count, load_factor, degree, comm, damped, near, rotation)
        last[:] = [found.rounding]
        return following.in_turn(found) if found.complex else found

    try:
        found, error = until_two_meshes_agree(
            "modes", scene, on_mesh, tol, most=_MOST_ELEMENTS, elements=elements, degree=degree,
            advice="a larger tol or fewer modes", progress=progress, comm=comm,
            gains=lambda found: 2 * degree - (_OF_EIGENVALUES if found.complex else _OF_SQUARES),
            least=lambda found: found.beside, places=lambda found: found.edges and found.edges.places,
        )  # fmt: skip
    except NotConverged:
        if last and (last[0] > tol).any():  # meshes scatter by rounding
            raise _rounded(tol, last[0]) from None
        raise
    error = np.maximum(error, found.rounding)  # NaN stays
    if (error > tol).any():
        raise _rounded(tol, error)
    if comm.rank == 0:
        warn_of_contact("modes", found.state)
    return _result(scene, found, error, comm, near or 0.0)


def _rounded(tol, errors):
    return NotConverged(
        f"the accuracy tol = {tol:g} is out of reach: rounding of rods as slender as these, and bounds in place of "
        f"infinite stiffnesses, may change the squares by {errors.max():.2g} of themselves. Ask for a larger tol."
    )


def admit(owner, scene, damped):
    """Raise a SceneError of `owner` for scenes and `damped` that modes do not admit."""
    for rod in scene.rods:
        require_inertia(rod, "a motion")
    for action in scene.actions:
        if action.delayed is not None and not action.resists:
            raise SceneError(
                f"{owner}: {describe(action)}: expected no actions whose forces come from earlier motion: rods in "
                "its place, or the spectrum of a simulated motion, show the modes"
            )
    refuse_stages(owner, scene)
    refuse_rod_contact(owner, scene)
    refuse_rough_threads(owner, scene, False)
    for load in scene.actions:
        if load.rough and load.axial is None:
            raise SceneError(
                f"{owner}: {describe(load)} has friction, and sticks in small motions: expected its stiffness EA, "
                "axial= (N)"
            )
    if damped is not None and not isinstance(damped, bool):
        refuse(owner, "damped", damped, "True, False, or None")
    if damped is False and _rotation(scene) is not None:
        raise SceneError(f"{owner}: damped = False: expected None or True with a `Centrifugal`")


def at_state(scene, layout, degree, count, load_factor, damped, start):
    """The `Modes` at one state on one mesh, on this rank alone, and the state for another start (see `_loaded`)."""
    rotation = _rotation(scene)
    if damped is None and (rotation is not None or _slowed(scene)):
        damped = True
    comm = MPI.COMM_SELF
    found = _on_mesh(scene, layout, count, load_factor, degree, comm, damped, None, rotation, start)
    return _result(scene, found, np.full(len(found.numbers), np.nan), comm), found.start


def _result(scene, found, error, comm, point=0.0):
    """The `Modes` of an `_OnMesh`, complex ones by the distance from a point."""
    values, shapes, rounding, rotation = found.numbers, found.shapes, found.rounding, _rotation(scene)
    if found.complex:
        away = np.abs(values - point)
        order = np.argsort(away, kind="stable")
        # of those as far from the point, as pairs that grow and decay at one frequency, the one that grows is first
        apart = np.cumsum(np.diff(away[order], prepend=0.0) > _AS_FAR * away[order])
        order = order[np.lexsort((-np.round(values.real / np.abs(values).clip(1e-300), 6)[order], apart))]
        values, shapes, error, rounding = values[order], shapes[order], error[order], rounding[order]
    else:
        values = np.sqrt(np.maximum(-values, 0.0)) + 1j * np.sqrt(np.maximum(values, 0.0))
    rate = None if rotation is None else np.array(rotation.rate)
    left_out = (*_at_kinks(scene), *(() if found.complex else _slowed(scene)))
    return Modes(found.state, shapes, error, found.conservative, comm, values, found.negative, left_out, rate, rounding)


def _slowed(scene):
    """Descriptions of what depends smoothly on velocities."""
    damped = [rod for rod in scene.rods if rod.damping is not None and np.any(rod.damping.sizes)]
    acting = [x for x in scene.actions if not (x.touches or x.resists) and traits_of(x, scene.rods).rates]
    return (*(f"Damping of {rod.name}" for rod in damped), *map(describe, acting))


def _at_kinks(scene):
    """Descriptions of resistances with a kink at rest, which no linear theory covers."""
    sticks = (f"the slip of {describe(x)}" for x in scene.actions if x.rough)
    return (*(describe(x) for x in scene.actions if x.touches or x.resists), *sticks)


def _rotation(scene):
    """The `Centrifugal` of a scene, or None; a SceneError for several, or for a vector across the axis in what acts."""
    found = [x for x in scene.loads if x.of_inertia]
    if not found:
        return None
    if len(found) > 1:
        raise SceneError(f"modes: the scene has {len(found)} steady rotations (Centrifugal): expected one")
    axis = np.array(found[0].rate) / np.linalg.norm(found[0].rate)
    for action in scene.loads:
        if action.in_law or not (
            (isinstance(action, Load) and not action.follows) or traits_of(action, scene.rods).rates
        ):
            continue
        for rod in [action.station.rod] if action.station is not None else scene.rods_of(action):
            for datum in at(action, 0.0).data(rod, _TRIED * rod.length):
                if datum.size == 3 and datum.unit != "m from origin":
                    across = np.linalg.norm(np.cross(datum.value, axis), axis=-1)
                    if (across > _ALONG * np.linalg.norm(datum.value, axis=-1)).any():
                        raise SceneError(
                            f"modes: {describe(action)} is not the same in all positions of the rotation about "
                            f"{tuple(axis.tolist())}: expected vectors along that axis, or a load that turns with the "
                            "rod (FollowerForce)"
                        )
    return found[0]


#: What is computed on one mesh: squares, or complex eigenvalues (1/s), (n,); the lengths of boundary layers or None;
#: their relative errors (n,) by rounding and by bounds in place of infinite stiffnesses; shapes (n, N, 6); the number
#: of negative modes; the `Equilibrium`; whether the loads have a potential; whether the numbers are complex
#: eigenvalues; (r, q) and the contact force there; relative errors (n,) by edges of contact; and the `Edges` or None.
_OnMesh = namedtuple("_OnMesh", "numbers layers rounding shapes negative state conservative complex start beside edges")


class _Following:
    """Puts eigenvalues in the order of those that they come from on another mesh."""

    def __init__(self):
        self._before = None

    def in_turn(self, found):
        """An `_OnMesh` in the order of the one before, by the assignment with the least relative distances."""
        if self._before is not None and len(self._before) == len(found.numbers):
            order = assigned(self._before, found.numbers)
            found = found._replace(
                numbers=found.numbers[order], rounding=found.rounding[order], shapes=found.shapes[order],
                beside=found.beside[order],
            )  # fmt: skip
        self._before = found.numbers
        return found


def assigned(before, values):
    """Indices of complex `values` (n,) that continue `before` (n,): the least sum of relative distances."""
    sizes = np.maximum(np.abs(before), _LEAST * np.abs([before, values]).max() or 1.0)
    return linear_sum_assignment(np.abs(values[None, :] - before[:, None]) / sizes[:, None])[1]


def _on_mesh(scene, layout, count, load_factor, degree, comm, damped, near, rotation, start=None):
    """The `_OnMesh` on one mesh; start: see `_loaded`."""
    loaded = load_factor or has_permanent(scene) or rotation is not None
    with _loaded(scene, layout, load_factor, degree, comm, loaded, start) as (problem, stability):
        model, scales = problem.model, problem.model.scales
        negative = stability.count() if loaded else 0
        K, rows, held = stiffness(problem)
        soft, state = softness(problem, K), Equilibrium.of(model, load_factor)
        look_beside(problem, load_factor)
        refuse_grazing(state, "modes")
        edges = edges_of_contact(model, state)
        if edges:
            K = K + edges.lacking
        if problem.tensions:
            between = problem.tensions.keep()
            if between.any():
                expected = "a load factor at which it has a tension, or is longer than its way along the rod"
                problem.tensions.refuse("modes", between, expected)
            K, held = problem.tensions.border(K, held)
        if problem.sliding:
            for thread, *blocks in problem.sliding.stuck(rows_of_rods(model, state)):
                if not blocks[0].any():
                    raise SceneError(
                        f"modes: {describe(thread)} has friction and no tension: it neither sticks nor slides, and no "
                        "linear theory has it: expected a load factor at which it has a tension"
                    )
                K = K + of_blocks(*blocks, K.shape[0])
        unit = max(float(rod.profile.range[1].mass) for rod in scene.rods)
        bodies, time = Bodies(model, unit), math.sqrt(unit * scales.length**2 / scales.force)
        if problem.sliding and negative:  # counted without the stiffness of what sticks
            squares, *_ = Pencil(K, bodies.mass(), held).lowest(negative)
            negative = np.count_nonzero(squares < 0)
        layers = layers_of(model) if loaded else None
        rq, n = model.snapshot()
    with circulatory_part(scene, layout, degree, comm) as circulatory:
        conservative = circulatory.vanishes(rq, load_factor)
        if damped is None:
            damped = not conservative
        if damped and not conservative:
            K = K + on_every_rank(circulatory.skew(rq, load_factor))
    if not damped:
        mass = bodies.mass()
        squares, vectors, rounding = Pencil(K, mass, held).lowest(count)
        negative = _below_free(squares, negative)
        shapes = shapes_of(vectors.T, squares, rows, scales.length)
        rounding = np.where(squares == 0, 0.0, rounding / np.abs(np.where(squares == 0, 1.0, squares)))
        squares, rounding = corrected(soft, mass, None, squares, vectors, rounding, True)
        beside = beside_edges(edges, mass, None, squares, vectors)
        squares = squares / time**2
        return _OnMesh(squares, layers, rounding, shapes, negative, state, conservative, False, (rq, n), beside, edges)
    turning = None
    if rotation is not None:
        w = np.array(rotation.rate) * time
        places = np.concatenate([state.position(rod) for rod in scene.rods])
        turning = w, (places - np.array(rotation.through)) / scales.length
    C, more = resisting(scene, layout, degree, comm, rq, load_factor, time, bodies, turning)
    if rotation is not None:
        C = C + bodies.gyroscopic(w)
    mass = bodies.mass()
    pencil = QuadraticPencil(K + more, C, mass, held)
    found = pencil.nearest(near * time, count) if near else pencil.lowest(count)
    values = found.values
    if (values == 0).any():
        negative = _below_free(Pencil((K + K.T) / 2, mass, held).lowest(count)[0], negative)
    shapes = shapes_of(found.vectors.T, values, rows, scales.length)
    rounding = np.where(values == 0, 0.0, found.rounding / np.abs(np.where(values == 0, 1.0, values)))
    values, rounding = corrected(soft, mass, C, values, found.vectors, rounding, conservative)
    beside = beside_edges(edges, mass, C, values, found.vectors)
    return _OnMesh(values / time, layers, rounding, shapes, negative, state, conservative, True, (rq, n), beside, edges)


def _below_free(squares, negative):
    """The number of negative modes. Free ones were counted by the sign of their rounding; all below them are known."""
    return np.count_nonzero(squares < 0) if (squares == 0).any() else negative


@contextlib.contextmanager
def _loaded(scene, layout, load_factor, degree, comm, loaded, start=None):
    """Context manager that gives the problem, in equilibrium at a load factor, and its `NegativeModes`; loaded: whether
    the reference is no equilibrium; start: (r, q) and contact force next to the equilibrium, on that mesh; None to
    follow the path of load control.

    A mechanism that its loads stabilise has no path from the unloaded state: its equilibrium is computed with added
    constraints (`without_mechanism`), then corrected without them.
    """
    where = "next to a point of the path"
    if start is None:
        where = "next to the reference, where the scene is a mechanism"
        held = without_mechanism(scene) if loaded else scene
        with solvers_of(held, layout, degree=degree, comm=comm) as (problem, newton, stability):
            if loaded:
                standing(problem, newton, stability, load_factor)
            if held is scene:
                yield problem, stability
                return
            # the initial guess of the problem without added constraints, on the same mesh
            start = problem.model.snapshot()
    rq, n = start
    with solvers_of(scene, layout, degree=degree, comm=comm) as (problem, newton, stability):
        problem.end_beginning()
        problem.set_load_factor(load_factor)
        problem.begin_at(problem.model.unknowns_of(rq), n[..., :3], np.zeros(len(problem.multipliers())))
        newton.allow(_CORRECTIONS)
        solved = newton.solve()
        if not solved.converged:
            raise NotConverged(f"no equilibrium was found at the load factor {load_factor:g}: {solved.reason} {where}")
        yield problem, stability


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
    """A function of `Modes`: does a vibration grow, by more than rounding; by anything, where `calm` ones decay?"""
    turns = calm.eigenvalues.imag > 0
    decays = bool((calm.growth_rates < -calm.unsure)[turns].all())

    def grows(found):
        turns = found.eigenvalues.imag > 0
        return bool((found.eigenvalues.real > (0.0 if decays else found.unsure))[turns].any())

    return grows


def _onset(path, at, k, ends, starts):
    """The `Event` between points k and k + 1 of a path where a vibration begins to grow, or ceases to."""

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
    """(load factor, `Modes`) of the onset of flutter between one where nothing grows and one where it does."""
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
