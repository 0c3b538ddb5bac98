"""Where rods touch each other and the forces there; and that none has passed through another."""

from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.strands import AT_BOUND, CROSSING, Strands, across, closest_segments, overlap

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
        columns = [getattr(self, x.name) for x in _COLUMNS]
        return screen.as_text(
            screen.table(list(zip(_COLUMNS, columns, strict=True)), Units(), screen.ROWS, self._title)
        )


_COLUMNS = (
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
    """The `Touches` of state k that press, with their forces (m, 3) on the second rod, and the positions (N, 3) there;
    dimensionless. In motions forces are normal."""
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
        return np.array([_at_nodes(path, k, strands)[nodes] for k in range(len(path))])
    forces = path._stacked("rod_forces")[:, cells] * path.scales.force
    found = np.zeros((len(path), nodes.stop - nodes.start, 3))
    for j in range(path.degree + 1):
        found[:, j : j + path.degree * (forces.shape[1] - 1) + 1 : path.degree] += forces[:, :, j]
    return found


#: What results of scenes with a `RodContact` have.
ROD_FORCE = Quantity("rod_force", "force of other rods at a node", "N", "xyz", "inertial", ("point", "s"), nodal_forces)


def _at_nodes(history, k, strands):
    """(N, 3) the sums of the forces of elastic surfaces at nodes, N."""
    found, forces, x = _pressed(history, k, strands)
    total = np.zeros_like(x)
    moves = strands.moves(found.element, found.place)
    np.add.at(total, strands.nodes_of(found), moves[..., None] * forces[:, None])
    return total * history.scales.force


def check_apart(path, whole=None):
    """Refuse a path in which rods overlap, by the distances of the sides of fine polygons along them.

    Raises:
        NotConverged: naming rods, places and depth; with the path `whole`, or with this one.
    """
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
