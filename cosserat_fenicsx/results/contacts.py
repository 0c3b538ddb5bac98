"""Contact of rods with obstacles: gaps and forces at the nodes, and what passes through between them.
Contacts of rods with each other: places and forces; and that none has passed through another.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from cosserat_fenicsx.checks import refuse, warn
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.results.compared import MOMENT, POSITION, differences
from cosserat_fenicsx.scene.action import describe
from cosserat_fenicsx.strands import AT_BOUND, CROSSING, Strands, across, closest_segments, overlap

# Least number of places in an interval between two nodes where a rod may pass through an obstacle.
_BETWEEN = 3
# Depth between two nodes over that at the deeper one of them up to which the mesh resolves the penetration.
_DEEPER = 2.0
# Depth between two nodes, over the size of the obstacle (see `Action.gaps`), that is never allowed.
_SHALLOW = 0.1
# Depth between two nodes, over the rod's length, that is rounding.
_ROUNDING = 1e-10
# Gap over the rod's length up to which a rod that does not press touches: rounding.
_GRAZES = 1e-13
# Stiffness, over that of obstacles, of the state that shows what theirs changes; least change, over the largest
# displacement, that a sentence mentions, and that a warning does where the stiffness is the default one.
_STIFFER, _SOFT, SOFT = 10, 1e-3, 1e-2
# Smallest share of an obstacle's pressure along rods that a sentence mentions.
_SLANTED = 0.02
# A friction force below this times the limit of friction is one at which the surface sticks.
_STICKS = 1 - 1e-9


class Passes(NotConverged):
    """A rod passes into an obstacle between two nodes: the mesh is too coarse."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contact of rods with one obstacle at m nodes of the mesh, in n states. `print` shows where rods touch in the
    last.

    Attributes:
        rod: (m,) names of the rods. s: (m,) arc lengths, m.
        gap: (n, m) between the rod's surface and the obstacle, m; negative where it presses.
        normal: (n, m, 3) unit normals, towards the free side, inertial.
        pressure: (n, m) along the normal, N/m.
        friction: (n, m, 3) on the rod's surface, inertial, N/m; NaN where another obstacle touches the same node.
        sticks: (n, m) whether the rod touches and friction is below its limit.
        force: (n, 3) the sum of pressure and friction on all rods, inertial, N.
    """

    rod: np.ndarray
    s: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    pressure: np.ndarray
    friction: np.ndarray
    sticks: np.ndarray
    force: np.ndarray
    _title: str = field(default="", repr=False)

    def __str__(self):
        touches, rows = self.pressure[-1] > 0, []
        edges = np.flatnonzero(np.diff(touches, prepend=False) | (self.rod != np.roll(self.rod, 1)))
        for first, end in zip(edges, [*edges[1:], len(touches)], strict=True):
            if touches[first]:
                part = slice(first, end)
                rows.append((self.rod[first], self.s[first], self.s[end - 1], self.pressure[-1, part].max(),
                             np.linalg.norm(self.friction[-1, part], axis=1).max()))  # fmt: skip
        if not rows:
            return f"{self._title}: no contact in the last state"
        given = list(zip(_COLUMNS, map(np.array, zip(*rows, strict=True)), strict=True))
        return screen.as_text(screen.table(given, Units(), screen.ROWS, self._title))


_COLUMNS = (
    Quantity("rod"),
    Quantity("touches_from", "touches from", "m"),
    Quantity("touches_to", "to", "m"),
    Quantity("pressure", "largest pressure", "N/m"),
    Quantity("friction", "largest friction", "N/m"),
)


def contacts_of(path, obstacle):
    """See `Path.contacts`."""
    if not any(obstacle is one for one in _obstacles(path.scene)):
        refuse("contacts", "obstacle", obstacle, "an obstacle of the scene, such as a Plane")
    parts = [_of_rod(path, obstacle, *where) for where in _nodes_at(path, obstacle)]
    rod, s, gap, normal, pressure, friction, sticks, weight = (
        np.concatenate(arrays, axis=min(arrays[0].ndim - 1, 1)) for arrays in zip(*parts, strict=True)
    )
    force = np.einsum("m,nmi->ni", weight, pressure[..., None] * normal + friction)
    return Contacts(rod, s, gap, normal, pressure, friction, sticks, force, describe(obstacle))


def _of_rod(path, obstacle, i, rod, x):
    acting = [one for one in _obstacles(path.scene) if one.acts_on(rod)]
    found = {id(one): _gaps(path, one, rod, x) for one in acting}
    gap, normal = found[id(obstacle)]
    pressure = obstacle.stiffness * np.maximum(-gap, 0.0) if obstacle.law is None else _at_nodes(path, i, normal)
    friction = np.zeros_like(normal)
    if obstacle.friction:
        total = _density(path, i)
        friction = np.where((gap < 0)[..., None], total - np.sum(total * normal, axis=2, keepdims=True) * normal, 0.0)
        others = [one for one in acting if one is not obstacle]
        also = sum(((found[id(one)][0] < 0) for one in others), np.zeros(gap.shape, dtype=bool))
        friction[also & (gap < 0)] = np.nan
    limit = obstacle.friction * pressure
    sticks = (gap < 0) & (np.linalg.norm(friction, axis=2) < _STICKS * limit)
    return np.full(len(x), rod.name), x * rod.length, gap, normal, pressure, friction, sticks, shares_of(path, i)


def _obstacles(scene):
    return [action for action in scene.actions if action.gaps is not None]


def _nodes_at(path, obstacle):
    """(number, rod, arc lengths (n,) of its nodes over the rod's) of the rods that an obstacle acts on."""
    nodes = zip(path.scene.rods, path.layout.node_s(path.rule.nodes), strict=True)
    return [(i, rod, x) for i, (rod, x) in enumerate(nodes) if obstacle.acts_on(rod)]


def _gaps(path, obstacle, rod, x):
    """(states, n) gaps, m, and (states, n, 3) normals at arc lengths x (n,) over the rod's length."""
    s, rest = x * rod.length, rod.curve.position(x * rod.length)
    moved = path.motion(rod, x)[..., :3] * path.scales.length
    found = [obstacle.gaps(rod, s, rest + u) for u in moved]
    return tuple(np.array(part).reshape(len(moved), len(x), *tail) for part, tail in zip(
        zip(*found, strict=True) if found else ((), ()), ((), (3,)), strict=True))  # fmt: skip


def _at_nodes(path, i, normal):
    return np.sum(_density(path, i) * normal, axis=2)


def _density(path, i):
    """(states, nodes, 3) force per length of all that acts at the nodes of a rod, N/m."""
    density = path._stacked("densities")[1][:, path._cells(i), :, :3]
    nodal = np.concatenate([density[:, :, :-1].reshape(len(path), -1, 3), density[:, -1:, -1]], axis=1)
    return nodal * path.scales.force / path.scales.length


def shares_of(path, i):
    """(nodes,) the length that belongs to each node of a rod in the quadrature with the nodes as points, m."""
    sizes = np.diff(path.layout.breaks[i]) * path.scene.rods[i].length
    p, shares = path.degree, np.zeros(len(sizes) * path.degree + 1)
    np.add.at(shares, np.arange(len(sizes))[:, None] * p + np.arange(p + 1), sizes[:, None] * path.rule.lobatto)
    return shares


def contacts_in_words(path):
    """Sentences on what a result of obstacles leaves open: how far their stiffness lets rods in, which is no part of
    estimated errors; and what touches without pressing, which may lift off."""
    if path.scene.stages:
        for stage, part in path.parts.items():
            yield from (f"{path.stage_label(stage)}: {sentence}" for sentence in contacts_in_words(part))
        return
    largest = path.largest_displacement().max(initial=0.0)
    for obstacle in _obstacles(path.scene) if len(path) else ():
        depth = 0.0
        for _, rod, x in _nodes_at(path, obstacle):
            gap, _ = _gaps(path, obstacle, rod, x)
            depth = max(depth, -gap.min())
        if depth > 0 and obstacle.law is None and largest:
            yield (
                f"{describe(obstacle)} lets rods in by up to {depth:.2g} m, {depth / largest:.1g} of the largest "
                "displacement: its stiffness makes that, and estimated errors do not contain it; a larger one lets "
                "them in less."
            )
        yield from slanted(path, obstacle)
    yield from lifting(path)


def stiffer(path):
    """The scene of a path with the smooth elastic obstacles that rods press on at last `_STIFFER` times as stiff; their
    words, "" where there are none, or where rods hardly move but into them; whether a stiffness is the default one."""
    largest, soft = path.largest_displacement()[-1], []
    for one in _obstacles(path.scene):
        depth = max((-_gaps(path, one, rod, x)[0][-1].min() for _, rod, x in _nodes_at(path, one)), default=0.0)
        if 0 < depth < largest / 2 and one.law is None and not one.friction:
            soft.append(one)
    loads = [replace(x, stiffness=_STIFFER * x.stiffness) if x in soft else x for x in path.scene.loads]
    by_default = any(one.stiffness == getattr(type(one), "stiffness", None) for one in soft)
    return replace(path.scene, loads=loads), ", ".join(dict.fromkeys(map(describe, soft))), by_default


def softness_in_words(last, stiff, obstacles):
    """(sentence, change) on what the finite stiffness k of obstacles changes, by a path's last state and that with
    `_STIFFER` times the stiffness; the change is that of positions over the largest displacement. None where it is
    little. Where rods touch along a line it is as 1/k; at a point as k^(-3/4), since an elastic support spreads a
    force over lengths as (4 EI/k)^(1/4)."""
    left = _STIFFER**-0.75
    moved, bent = (differences(stiff, last)[0] / last._reference.sizes)[[POSITION, MOMENT], 0] / (1 - left)
    if moved > _SOFT:
        yield (
            f"the finite stiffness of {obstacles} changes positions by about {100 * moved:.1g} % of the largest "
            f"displacement and moments by {100 * bent:.1g} % of the largest, which estimated errors do not contain: a "
            f"larger stiffness changes less, {_STIFFER} times as much about {100 * moved * left:.1g} %"
        ), moved


def slanted(path, obstacle):
    """A sentence where an obstacle pushes along rods: a rod touches beside its nodes, where the normal is another."""
    rods = []
    for i, rod, x in _nodes_at(path, obstacle):
        if len(path):
            s, moved = x * rod.length, path.motion(rod, x)[..., :3] * path.scales.length
            rods.append((rod, s, rod.curve.position(s) + moved, shares_of(path, i)))
    return _slanted(obstacle, rods, "more elements there, or a tol, which puts a node there")


def warn_of_contact(owner, state):
    """Give a warning where `slanted` has a sentence, of an `Equilibrium`, and where rods touch what is rough."""
    known = enumerate(state.scene.rods if state.scene.has_obstacles else ())
    rods = [(rod, state.s(rod), state.position(rod)[None], shares_of(state, i)) for i, rod in known]
    for obstacle in _obstacles(state.scene):
        on = [x for x in rods if obstacle.acts_on(x[0])]
        for words in _slanted(obstacle, on, "more elements: estimated errors do not contain it"):
            warn(f"{owner}: {words}")
    rough = [describe(obstacle) for obstacle, *_, gap, _ in gaps_at(state) if obstacle.friction and (gap < 0).any()]
    for obstacle in dict.fromkeys(rough):
        warn(
            f"{owner}: {obstacle} has friction, and where rods cease to stick to it is taken to be at a node: "
            "estimated errors do not contain it. Expected a comparison with more elements"
        )


def _slanted(obstacle, rods, expected):
    """`slanted`; rods: of each the rod, arc lengths (n,), m, points (states, n, 3), m, and `shares_of` its nodes.

    Along each part that touches, the gap g pushes by the integral of k g g', which vanishes between two edges."""
    along = total = 0.0
    for rod, s, points, shares in rods:
        gap, normal = (np.array(x) for x in zip(*(obstacle.gaps(rod, s, r) for r in points), strict=True))
        slope = np.einsum("kni,kni->kn", np.gradient(points, s, axis=1), normal)
        push = np.maximum(-gap, 0.0) * shares
        push[:, [0, -1]] = 0.0  # an end may be pushed along its rod
        begins = np.flatnonzero(push.ravel() == 0)  # each one, or the last one before a part that touches
        parts = np.abs(np.add.reduceat((push * slope).ravel(), begins))
        along = along + np.bincount(begins // len(s), parts, len(points))
        total = total + push.sum(axis=1)
    share = np.divide(along, total, out=np.zeros_like(total), where=total > 0).max(initial=0.0) if rods else 0.0
    if share > _SLANTED:
        yield (
            f"{describe(obstacle)} pushes along rods by up to {share:.2g} of its pressure, which no surface does: rods "
            f"touch it beside their nodes. Expected {expected}."
        )


def lifting(path):
    """Sentences on rods that touch an obstacle at last without pressing on it, where stability depends on that."""
    for obstacle in _obstacles(path.scene) if len(path) and path.counts_modes else ():
        if path.negative_modes[-1] >= 0 and not obstacle.friction:
            continue
        last = path[len(path) - 1]
        for _, rod, x in _nodes_at(path, obstacle):
            if where := _grazing(path.scene, rod, x * rod.length, _gaps(last, obstacle, rod, x)[0][-1]):
                yield f"{where} {describe(obstacle)} {_LIFTS}."
                break


_LIFTS = (
    "without pressing on it: stability, which counts it as held there both ways or not at all, does not see that it "
    "may lift off on one side"
)


def _grazes(scene, rod, s, gap):
    """(..., n) whether nodes touch without pressing, at gaps (..., n), m, and no support holds them."""
    held = [x.station.s for x in scene.all_supports if x.station is not None and x.station.rod is rod]
    free = ~np.isclose(s[:, None], held, rtol=0, atol=1e-9 * rod.length).any(axis=1)
    return free & (np.abs(gap) <= _GRAZES * rod.length)


def _grazing(scene, rod, s, gap):
    """The words of where a rod touches without pressing, "" where it does not, or only where a support holds it."""
    where = np.flatnonzero(_grazes(scene, rod, s, gap))
    return f"Rod '{rod.name}' touches, at s = {s[where[0]]:.6g} m," if len(where) else ""


def grazing(path):
    """(states,) whether a rod touches an obstacle without pressing on it."""
    found = np.zeros(len(path), dtype=bool)
    for obstacle in _obstacles(path.scene) if len(path) else ():
        for _, rod, x in _nodes_at(path, obstacle):
            found |= _grazes(path.scene, rod, x * rod.length, _gaps(path, obstacle, rod, x)[0]).any(axis=1)
    return found


def gaps_at(state):
    """(obstacle, rod, number of the rod, arc lengths (n,) and gaps (n,) of its nodes, m, and normals (n, 3)) of an
    `Equilibrium`, for each obstacle and each rod that it acts on."""
    known = enumerate(state.scene.rods if state.scene.has_obstacles else ())
    rods = [(rod, i, state.s(rod), state.position(rod)) for i, rod in known]
    for obstacle in _obstacles(state.scene):
        for rod, i, s, r in rods:
            if obstacle.acts_on(rod):
                yield obstacle, rod, i, s, *obstacle.gaps(rod, s, r)


def first_contacts_at(state):
    """(number of a rod, function) for each rod that a wall acts on in an `Equilibrium`; the function takes arc lengths
    (n,) over the rod's and returns gaps (n,), m, and the stiffness (n, 3, 3), N/m^2, where contact begins."""
    for action in state.scene.actions:
        for i, rod in enumerate(state.scene.rods if action.presses and not action.touches else ()):
            if action.acts_on(rod):

                def first_contact(x, action=action, rod=rod):
                    s = x * rod.length
                    points = rod.curve.position(s) + state.between(rod, x, state.displacement)
                    gap, normal, along, across = action.first_contact(rod, s, points)
                    outer = normal[:, :, None] * normal[:, None]
                    return gap, across * np.eye(3) + (along - across) * outer

                yield i, first_contact


def refuse_grazing(state, owner):
    """Refuse small motions about an `Equilibrium` of rods that touch an obstacle without pressing on it."""
    for obstacle, rod, _, s, gap, _ in gaps_at(state):
        if where := _grazing(state.scene, rod, s, gap):
            raise SceneError(
                f"{owner}: {where} {describe(obstacle)} without pressing on it, and may lift off on one side, which no "
                "linear theory has: expected a permanent load or a load factor that presses it there, or a gap"
            )


def least_gap(path):
    """The smallest gap of a node from an obstacle in all states, m."""
    at = ((obstacle, rod, x) for obstacle in _obstacles(path.scene) for _, rod, x in _nodes_at(path, obstacle))
    return min(_gaps(path, *where)[0].min() for where in at)


def check_passes(path, share=1e-2, whole=None):
    """Refuse a path or motion where a rod passes into an obstacle between two nodes far deeper than at these nodes, and
    by more than a share of the largest displacement of that state or of the obstacle's size. Raises Passes: naming rod,
    place and depth; with the path `whole`, or with this one."""
    if path.scene.stages:
        for part in path.parts.values():
            check_passes(part, share, whole=path)
        return
    obstacles = _obstacles(path.scene)
    moved = path.largest_displacement() if obstacles else None
    for obstacle in obstacles:
        allowed = np.minimum(share * moved, _SHALLOW * obstacle.largest_step)
        for _, rod, x in _nodes_at(path, obstacle):
            depth = np.maximum(-_gaps(path, obstacle, rod, x)[0], 0.0)
            places = max(_BETWEEN, math.ceil(np.diff(x).max() * rod.length / obstacle.largest_step))
            between = x[:-1, None] + np.diff(x)[:, None] * np.arange(1, places + 1) / (places + 1)
            inside = -_gaps(path, obstacle, rod, between.ravel())[0].reshape(len(depth), *between.shape)
            beside = np.maximum(depth[:, 1:], depth[:, :-1])[..., None]
            excess = inside - _DEEPER * beside - np.maximum(allowed, _ROUNDING * rod.length)[:, None, None]
            if excess.size and excess.max() > 0:
                k, *where = np.unravel_index(np.argmax(excess), excess.shape)
                raise Passes(
                    f"rod '{rod.name}' passes into {describe(obstacle)} by {inside[(k, *where)]:.3g} m between two "
                    f"nodes, at s = {between[tuple(where)] * rod.length:.6g} m, at the "
                    f"{path.place_of(k)}: expected more elements there",
                    path if whole is None else whole,
                )


# Gaps over the radius up to which rods may touch; forces over the largest that are rounding.
_TOUCHES, _NOTHING = 1e-5, 1e-9
# Depth over the radius that is allowed between the places where rods touch.
_DEEP = 0.02


@dataclass(frozen=True, eq=False)
class RodContacts:
    """Contacts of rods with each other in one state, m of them. `print` shows them.

    Attributes:
        rod, other: (m,) names of the rods; s, other_s: (m,) arc lengths of the points that touch, m.
        point: (m, 3) where their surfaces touch, inertial, m.
        gap: (m,) between the surfaces, m.
        force: (m,) along the normal, N; line: (m,) whether it is one of a line of contact, at a node of the mesh.
        pressure: (m,) force per length along a line of contact, N/m; NaN at a point.
        normal: (m, 3) unit vectors from the rod to the other one, inertial.
        friction: (m, 3) force on the other rod, N, inertial; its opposite acts on the rod. NaN in motions, where
            friction belongs to a step.
        sticks: (m,) whether friction is below its bound; False without friction.
    """

    rod: np.ndarray
    s: np.ndarray
    other: np.ndarray
    other_s: np.ndarray
    point: np.ndarray
    gap: np.ndarray
    force: np.ndarray
    line: np.ndarray
    pressure: np.ndarray
    normal: np.ndarray
    friction: np.ndarray
    sticks: np.ndarray
    _title: str = field(default="", repr=False)

    def __len__(self):
        return len(self.s)

    def __str__(self):
        if not len(self):
            return f"{self._title}: no contact"
        columns = [getattr(self, x.name) for x in _PAIR_COLUMNS]
        return screen.as_text(
            screen.table(list(zip(_PAIR_COLUMNS, columns, strict=True)), Units(), screen.ROWS, self._title)
        )


_PAIR_COLUMNS = (
    Quantity("rod"),
    Quantity("s", "s", "m"),
    Quantity("other", "touches"),
    Quantity("other_s", "at s", "m"),
    Quantity("gap", "gap", "m"),
    Quantity("force", "force", "N"),
    Quantity("pressure", "force per length", "N/m"),
)


def _strands(path):
    return Strands.of(path.scene, path.layout, path.rule, path.scales.length)


def _pressed(path, k, strands):
    """The `Touches` of state k that press, forces (m, 3) on the second rod, positions (N, 3); dimensionless."""
    record, elastic = path._records[k], path.scene.rod_contact.stiffness is not None
    counts = [n * path.degree + 1 for n in path.layout.counts]
    x = record.rq[:, :3] + np.repeat(path.scene.origins / path.scales.length, counts, axis=0)
    found, _ = strands.near(x, 0.0 if elastic else _TOUCHES * strands.radii.max())
    forces = (_by_law if elastic else _by_balance)(path, record, strands, found)
    normal = np.sum(forces * found.normal, axis=1)
    held = normal > _NOTHING * np.abs(normal).max(initial=0.0)
    return found.of(held), forces[held], x


def _by_law(history, record, strands, found):
    """The forces of elastic surfaces in a motion."""
    surface = history.scene.rod_contact.surface(strands, history.rule.lobatto, history.scales, history.time_unit)
    speeds = record.rates[strands.nodes_of(found), :3]
    approach = -np.einsum("mni,mni->m", strands.gradients(found), speeds)
    force, _ = surface.force(surface.law(found), -found.gap)
    return (force * np.maximum(1 + surface.damping * approach, 0.0))[:, None] * found.normal


def _by_balance(path, record, strands, found):
    """Those of hard surfaces, whose sum at every node is known."""
    if not len(found):
        return np.zeros((0, 3))
    ways = found.normal[:, None]
    if path.scene.rod_contact.friction:
        ways = np.concatenate([ways, across(found.normal)], axis=1)
    m, parts, _ = ways.shape
    moves = strands.moves(found.element, found.place)
    nodes, matrix, total = strands.nodes_of(found), np.zeros((len(record.rq), m)), np.zeros((len(record.rq), 3))
    np.add.at(matrix, (nodes, np.arange(m)[:, None]), moves)
    np.add.at(total, strands.cells, record.rod_forces)
    matrix = np.einsum("nm,mpi->nimp", matrix, ways).reshape(-1, m * parts)
    sizes = np.linalg.lstsq(matrix, total.ravel(), rcond=None)[0].reshape(m, parts)
    return np.einsum("mp,mpi->mi", sizes, ways)


def rod_contacts_of(path, k):
    """See `Path.contacts`."""
    length, strands = path.scales.length, _strands(path)
    found, forces, x = _pressed(path, k, strands)
    forces, action = forces * path.scales.force, path.scene.rod_contact
    total, forces = forces, np.sum(forces * found.normal, axis=1)
    friction = total - forces[:, None] * found.normal
    if action.stiffness is not None:
        friction = np.full_like(friction, np.nan)
    sticks = np.linalg.norm(friction, axis=1) < (1 - AT_BOUND) * action.friction * forces
    names = np.array([rod.name for rod in path.scene.rods])
    (rod, s, place), (other, other_s, _) = (
        (names[strands.rods[e]], strands.s(e, a) * length, strands.at(x, e, a) * length)
        for e, a in zip(found.element.T, found.place.T, strict=True)
    )
    radius = strands.radii[found.element[:, 0]] * length
    share = np.zeros(len(x))
    np.add.at(share, strands.cells, strands.sizes[:, None] * path.rule.lobatto * length)
    line = found.node >= 0
    pressure = np.where(line, forces / share[np.maximum(found.node, 0)], np.nan)
    title = f"Contacts of rods at the {path.place_of(k)}"
    return RodContacts(rod, s, other, other_s, place + radius[:, None] * found.normal, found.gap * length, forces, line,
                       pressure, found.normal, friction, sticks, title)  # fmt: skip


def nodal_forces(path, rod):
    """(states, nodes, 3) forces of other rods at the nodes of a rod, N, inertial."""
    nodes, cells = path._rows(rod)[1], path._cells(path.scene.number(rod))
    if path.scene.rod_contact.stiffness is not None:
        strands = _strands(path)
        return np.array([_pairs_at_nodes(path, k, strands)[nodes] for k in range(len(path))])
    forces = path._stacked("rod_forces")[:, cells] * path.scales.force
    found = np.zeros((len(path), nodes.stop - nodes.start, 3))
    for j in range(path.degree + 1):
        found[:, j : j + path.degree * (forces.shape[1] - 1) + 1 : path.degree] += forces[:, :, j]
    return found


#: What results of scenes with a `RodContact` have.
ROD_FORCE = Quantity("rod_force", "force of other rods at a node", "N", "xyz", "inertial", ("point", "s"), nodal_forces)


def _pairs_at_nodes(history, k, strands):
    """(N, 3) the sums of the forces of elastic surfaces at nodes, N."""
    found, forces, x = _pressed(history, k, strands)
    total = np.zeros_like(x)
    moves = strands.moves(found.element, found.place)
    np.add.at(total, strands.nodes_of(found), moves[..., None] * forces[:, None])
    return total * history.scales.force


def check_apart(path, whole=None):
    """Refuse a path in which rods overlap, by the distances of the sides of fine polygons along them. Raises
    NotConverged: naming rods, places and depth; with the path `whole`, or with this one."""
    scene, action = path.scene, path.scene.rod_contact
    apart = action.apart(scene)
    for k in range(len(path)):
        points = action.polygons(scene.rods, lambda rod, s, k=k: path.sample(k, rod, s / rod.length)[0])
        if why := overlap(scene.rods, closest_segments(*points, apart, 0.0), _DEEP * points[3].min()):
            why = f"{why}, at the {path.place_of(k)}: expected more elements there{_ANGLE}"
            raise NotConverged(why, path if whole is None else whole)


_ANGLE = (
    f"; strands that touch along a line, at an angle whose sine is below {CROSSING:g}, touch at the nodes of the mesh "
    "alone"
)
