"""A string discretised: elements with mass, drag and stiffness, and pieces along the wall.

Elements are linear. Their mass matrices are m [[1/2 - s, s], [s, 1/2 - s]] with the share s = 1/12 + (c dt/l)^2/6,
which makes waves of the speed c exact to fourth order in space and time together under the implicit midpoint rule:
1/12, for short steps, is the mean of the lumped and the consistent matrix; with 1/4, where a wave passes an element in
a step, the rule is exact, but the mass of the highest mode vanishes, so that the share stays a little below.
"""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.wall_friction import law_of, scene_pieces, static_weight
from cosserat_fenicsx.well.pieces import down_along


@dataclass(frozen=True)
class _Settings:
    """Settings of elements and steps of a string."""

    coupling: tuple[float, float] = (
        1 / 12,
        0.235,
    )  # least and largest share of an element's mass that couples its nodes
    longest: float = 0.01  # default step, s
    elements: int = 250  # default number without a step
    fewest: int = 40  # elements for a given step
    most: int = 400
    most_that_cut: int = 4000  # of a bit that cuts
    period: tuple[float, float] = (80.0, 10.0)  # default and fewest steps in a period of a tool
    disc: float = 0.1  # longest step over 1/omega of the stiffest disc
    impact: float = 0.2  # default step over the time in which rock stops a bit, or a bit that cuts answers
    # Longest step, and passing time of a wave along the lowest element, over that time, for a largest weight on bit to
    # 1 %.
    resolved: float = 0.4
    # The same of elements above a bit that cuts: in longer ones what it left a revolution ago feeds waves as short as
    # an element, which do not leave the bit.
    fed: float = 0.25


_SET = _Settings()


@dataclass(frozen=True)
class Chain:
    """The elements of a string, from the top down, for the unknowns of a node: the angle, or displacement and angle.

    Attributes:
        depths: (nodes,) measured depth, m; for discs their numbers.
        mass, mass_off: (nodes, dofs), (nodes - 1, dofs), kg and kg m^2: tridiagonal mass matrix. drag, drag_off: drag
            matrix. spring: (nodes - 1, dofs), N/m and N m/rad.
        hanging: (nodes - 1,) tension of elements at rest, N; hanging_top: at the top.
        wall: the `Wall`.
        joints: (element, unknown, `Joint`) of what parts the string.
    """

    depths: np.ndarray
    mass: np.ndarray
    mass_off: np.ndarray
    drag: np.ndarray
    drag_off: np.ndarray
    spring: np.ndarray
    hanging: np.ndarray
    hanging_top: float
    wall: "Wall"
    joints: tuple = ()


@dataclass(frozen=True)
class Wall:
    """Arrays over the pieces of a string along the wall.

    Attributes:
        element: number. first, second: the nodes that take the friction of its ends. share: of the second.
        length: m. curvature: 1/m. across, aside: weight along normal and binormal, N/m. tension: at rest, N.
        factor: on the coefficients of friction. radius: of contact, m.
    """

    element: np.ndarray
    first: np.ndarray
    second: np.ndarray
    share: np.ndarray
    length: np.ndarray
    curvature: np.ndarray
    across: np.ndarray
    aside: np.ndarray
    tension: np.ndarray
    factor: np.ndarray
    radius: np.ndarray


_NO_WALL = Wall(*[np.zeros(0, dtype=np.int32)] * 3, *[np.zeros(0)] * 8)


def usual_step(scene, elements: int | None, axial: bool) -> float:
    """The default time step (s) of a `Drilling` for a number of elements."""
    longest = min(_SET.longest, _SET.impact * time_of_impact(scene), period_of_tools(scene) / _SET.period[0])
    longest = longest if axial else _SET.longest
    if scene.discs:
        discs, shortest = scene.discs, math.inf
        for inertias, springs in ((discs.inertias, discs.stiffnesses), (discs.masses, discs.axial_stiffnesses)):
            if inertias is not None:
                around = np.append(springs, 0.0) + np.append(0.0, springs)
                shortest = min(shortest, float(np.sqrt(np.array(inertias) / around).min()))
        return min(longest, _SET.disc * shortest)
    return min(longest, _travel_time(scene) / (elements or _SET.elements))


def _travel_time(scene):
    return math.fsum(s.length / s.torsional_speed for s in scene.segments)


def chain_of(scene, dt: float, elements: int | None, axial: bool) -> Chain:
    """The `Chain` of a `Drilling` for steps of `dt` (s), of about `elements` elements; None for the usual number."""
    if scene.discs:
        return _chain_of_discs(scene.discs, axial, static_weight(scene) if axial else 0.0)
    if elements is None:
        most = _SET.most_that_cut if _cuts(scene) else _SET.most
        elements = min(max(_travel_time(scene) / dt, _SET.fewest), most)
    return _chain_of_string(scene, dt, elements, axial)


def _chain_of_discs(discs, axial, weight):
    """A static weight on bit (N) compresses all springs."""
    turning = discs.inertias, discs.stiffnesses, discs.dampings, discs.drags
    moving = discs.masses, discs.axial_stiffnesses, discs.axial_dampings, discs.axial_drags
    n, columns = len(discs.inertias), []
    for inertia, spring, between, drag in ([moving] if axial else []) + [turning]:
        diagonal = np.array(drag)
        diagonal[:-1] += between
        diagonal[1:] += between
        columns.append((np.array(inertia), np.zeros(n - 1), diagonal, -np.array(between), np.array(spring)))
    return Chain(np.arange(n, dtype=float), *_stacked(columns), np.full(n - 1, -weight), -weight, _NO_WALL)


def _stacked(columns):
    """Arrays (n, dofs) from a column of each for every unknown of a node."""
    return [np.ascontiguousarray(np.stack(parts, axis=1)) for parts in zip(*columns, strict=True)]


def _chain_of_string(drilling, dt, elements, axial):
    segments = drilling.segments
    times = np.array([s.length / s.torsional_speed for s in segments])
    counts = np.maximum(np.rint(elements * times / times.sum()), 1).astype(int)
    which = np.repeat(np.arange(len(segments)), counts)
    lengths = np.array([s.length for s in segments])[which] / counts[which]
    joints = [x for x in drilling.joints if axial or x.turns]
    last = [int(np.flatnonzero(which == x.segment)[-1]) for x in joints]
    which, lengths = _parted(last, which), _parted(last, lengths, 0.5)
    joints = [(end + 1 + k, int(x.turns and axial), x) for k, (end, x) in enumerate(zip(last, joints, strict=True))]
    depths = np.concatenate([[0.0], np.cumsum(lengths)])
    depths *= drilling.bit_depth / depths[-1]

    def of(name):
        return np.array([getattr(s, name) for s in segments])[which]

    damping_time, rates = of("damping_time"), drilling.drag_rates
    kinds = [("rhoA", "EA", rates[0])] * axial + [("rhoJ", "GJ", rates[1])]
    columns = []
    for d, (inertia, stiffness, rate) in enumerate(kinds):
        own, at = lengths.copy(), [(end, x) for end, of_dof, x in joints if of_dof == d]
        for end, _ in at:  # the element before reaches to the joint, which has no length
            own[end - 1 : end + 1] = own[end - 1] + own[end], 1.0
        mass, spring = of(inertia) * own, of(stiffness) / own
        courant = dt * np.sqrt(spring / mass)
        share = np.minimum(_SET.coupling[0] + courant**2 / 6, _SET.coupling[1])
        diagonal, damped, damper = np.zeros(len(depths)), np.zeros(len(depths)), damping_time * spring
        for end, x in at:
            mass[end], spring[end], damper[end] = 0.0, x.spring, x.damping
        for at_ends, ends in ((diagonal, (0.5 - share) * mass), (damped, damper)):
            at_ends[:-1] += ends
            at_ends[1:] += ends
        columns.append((diagonal, share * mass, rate * diagonal + damped, rate * share * mass - damper, spring))
    hanging, hanging_top, wall = _against_the_wall(drilling, depths)
    for end, d, _ in joints:
        wall.share[wall.element == end] = 0.0  # what lies along a joint is above it
        if axial and d == 0:  # the tension beside the joint, not that of its spring
            wall.element[wall.element == end] -= 1
    return Chain(depths, *_stacked(columns), hanging, hanging_top, wall, tuple(joints))


def _parted(last, values, share=1):
    """Values of elements, with those before joints, which are halved, twice, times a share."""
    values = np.array(values)
    values[last] = values[last] * share
    return np.insert(values, [end + 1 for end in last], values[last])


def _against_the_wall(drilling, depths):
    """Tension of elements and of the top at rest, N, and the `Wall`."""
    weight = static_weight(drilling)
    if drilling.hole is None:
        segments = drilling.segments
        ends = np.concatenate([[0.0], np.cumsum([s.length for s in segments])])
        total = np.concatenate([[0.0], np.cumsum([s.length * s.weight for s in segments])])
        below = total[-1] - np.interp(depths, ends, total) - weight
        return (below[:-1] + below[1:]) / 2, below[0], _NO_WALL
    pieces = scene_pieces(drilling)
    cuts = np.union1d(np.concatenate([[0.0], pieces.bottom]), depths)
    cuts = np.concatenate([[0.0], cuts[1:-1][np.diff(cuts[:-1]) > 1e-9 * cuts[-1]], [drilling.bit_depth]])
    middle, length = (cuts[:-1] + cuts[1:]) / 2, np.diff(cuts)
    of = np.searchsorted(pieces.bottom, middle)
    t, n, b, k, w = (getattr(pieces, name)[of] for name in ("t", "n", "b", "curvature", "weight"))
    # the piece's own height above and below its middle: the chord of an arc
    slope, normal = down_along(t, n, k * (pieces.bottom[of] - middle))
    pull = w * slope * length * np.sinc(k * length / 2 / np.pi)
    below = np.cumsum(pull[::-1])[::-1] - weight
    tension = below - pull / 2
    element = np.clip(np.searchsorted(depths, middle) - 1, 0, len(depths) - 2)
    share = (middle - depths[element]) / np.diff(depths)[element]
    hanging = np.bincount(element, tension * length, len(depths) - 1) / np.bincount(element, length)
    # a node with a drive, hook or bit has no friction beside: its neighbour takes it
    lowest = len(depths) - (1 if drilling.bit is None else 2)
    first, second = (np.clip(element + i, 1, lowest).astype(np.int32) for i in (0, 1))
    factor = pieces.friction[of] if law_of(drilling.friction)[2] else np.ones_like(length)
    wall = Wall(element.astype(np.int32), first, second, share, length, k, w * normal, w * b, tension, factor,
                pieces.radius[of])  # fmt: skip
    return hanging, float(below[0]), wall


def period_of_tools(scene) -> float:
    """The shortest period (s) of tools that shake the string; infinite without any."""
    return min((1 / joint.tool.frequency for joint in scene.joints if not joint.turns), default=math.inf)


def fewest_in_period(scene, dt) -> None:
    """Refuse a step (s) that is too long for a tool that shakes the string."""
    most = period_of_tools(scene) / _SET.period[1]
    if dt > most * (1 + 1e-9):
        refuse("AxialTorsional", "dt", dt, f"at most {most:.3g} s: {_SET.period[1]:g} steps in a period of the tool")


def _cuts(scene):
    """Whether the bit of a string cuts: its weight follows a depth of cut."""
    return scene.bit is not None and not scene.discs and scene.bit.law.axial_stiffness < math.inf


def _from_the_bit(scene, depths):
    """Of the parts of a string between depths (m), from the bit up: the `Segment` of each, the time (s) in which an
    axial wave passes it, and that which it takes from the bit to its lower end."""
    ends = np.cumsum([x.length for x in scene.segments])
    of = np.minimum(np.searchsorted(ends, (depths[:-1] + depths[1:]) / 2), len(ends) - 1)[::-1]
    parts = [scene.segments[i] for i in of]
    passing = np.diff(depths)[::-1] / [x.axial_speed for x in parts]
    return list(zip(parts, passing.tolist(), (np.cumsum(passing) - passing).tolist(), strict=True))


def _resolution(scene):
    """The longest time (s) in which a wave may pass an element beside the bit, over `time_of_impact`."""
    return _SET.fed if _cuts(scene) else _SET.resolved


def time_of_impact(scene) -> float:
    """Time (s) in which the rock of a `Drilling` stops the bit, or a bit that cuts answers: Z/k by the impedance Z
    (N s/m) beside the bit, or sqrt(m/k) by the mass m (kg) that moves with it, the longer one; infinite without rock of
    a stiffness k (N/m), or weight on bit per depth of cut. Sections that a wave passes soon within that time count with
    their mass, and Z is that of the last one before the first which is reached later; above a bit that cuts, with waves
    as short as elements, the smallest one up to there."""
    bit = scene.bit
    k = math.inf if bit is None else bit.law.axial_stiffness if _cuts(scene) else bit.rock_stiffness
    if math.isinf(k):
        return math.inf
    if scene.discs:
        return math.sqrt((bit.mass + (scene.discs.masses or (math.inf,))[-1]) / k)
    mass, impedance, time = bit.mass, math.inf, math.inf
    for part, _, reached in _from_the_bit(scene, np.cumsum([0.0, *(x.length for x in scene.segments)])):
        if reached > _resolution(scene) * time:
            break
        impedance = min(impedance, part.axial_impedance) if _cuts(scene) else part.axial_impedance
        time = max(math.sqrt(mass / k), impedance / k)
        mass += part.rhoA * part.length
    return time


def passing_time(scene, depths, within: float) -> float:
    """Longest time (s) that an axial wave takes along an element of a string whose nodes have these depths (m), of
    those that it meets within a time (s) from the bit."""
    if scene.discs:
        return 0.0
    return max(passing for _, passing, reached in _from_the_bit(scene, depths) if reached <= within)


def unresolved(scene, depths, dt) -> str:
    """A sentence where the steps (s) or the elements are too long for impacts, or for a bit that cuts, or ""."""
    impact, cuts = time_of_impact(scene), _cuts(scene)
    longest, slowest = _SET.resolved * impact, _resolution(scene) * impact
    passing = passing_time(scene, depths, slowest)
    if dt <= longest and passing <= slowest:
        return ""
    most = slowest * scene.segments[-1].axial_speed if passing > slowest else 0.0
    few = f", and elements of at most {most:.2g} m at the bit" if most else ""
    if cuts:
        return (
            f"APPROXIMATE: steps of {dt:.2g} s, or elements that a wave passes in {passing:.2g} s, are too long for "
            f"the bit, which answers within {impact:.2g} s: it may bounce where it does not in shorter ones; expected "
            f"a dt of at most {longest:.2g} s{few}"
        )
    return (
        f"APPROXIMATE: the rock stops the bit within {impact:.2g} s, which steps of {dt:.2g} s and elements that a "
        f"wave passes in {passing:.2g} s do not resolve: peaks of the weight on bit depend on them; expected a dt of "
        f"at most {longest:.2g} s{few}, or rock without a stiffness, whose impacts are recorded as impulses"
    )
