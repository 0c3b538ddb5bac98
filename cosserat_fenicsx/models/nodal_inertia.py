"""Mass and inertia of a scene at the nodes of every element, in the scene's order; at a jump each element has the value
of its side."""

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.element import lobatto_weights
from cosserat_fenicsx.errors import SceneError


def check_inertia(scene):
    """Raise an error for a rod without inertia, or for an action that stands for inertia.

    Raises:
        SceneError: a rod without mass or inertia, or such an action.
    """
    for i, load in enumerate(scene.loads):
        if load.of_inertia:
            raise SceneError(
                f"Scene.loads[{i}] ({type(load).__name__}) stands for the inertia of a motion: expected a scene "
                "without it, which may start from an equilibrium with it (simulate(start=path), Scene.velocities)"
            )
    for rod in scene.rods:
        low = rod.profile.range[0]
        for field, value in (("mass", low.mass), ("inertia", low.inertia)):
            if value is None:
                owner, name = ("Stiffness", field) if rod.material is None else ("Material", "density")
                refuse(f"Rod '{rod.name}': {owner}", name, None, "a value, which a motion needs")


def nodal_inertia(scene, layout, nodes):
    """Mass (elements, p + 1), kg/m, Jrho about d_1, d_2, d_3 (elements, p + 1, 3), kg m, and frames at rest (elements,
    p + 1, 3, 3). Masses that move with the axis count; point masses are added to one of the adjacent elements."""
    parts, weights = [], lobatto_weights(nodes)
    for i, (rod, s) in enumerate(_nodes_of(scene, layout, nodes)):
        along, frames = _by_side(rod.stiffness_at, s), rod.curve.frame(s.ravel()).reshape(*s.shape, 3, 3)
        mass, J = (_own(along, name) for name in ("mass", "inertia"))
        mass = mass + sum(across for across, _ in _added(scene, rod, s))
        for action in scene.loads:
            body = action.inertia(rod) if action.station is not None and action.station.rod is rod else None
            if body is not None:  # divided by the node's quadrature weight, which multiplies it again
                vertex = layout.vertex(scene, action.station)[1]
                cell = min(vertex, layout.counts[i] - 1)
                at = cell, -1 if vertex > cell else 0
                length = weights[at[1]] * (layout.breaks[i][cell + 1] - layout.breaks[i][cell]) * rod.length
                mass[at] += body[0] / length
                J[at] += body[1] / length
        parts.append((mass, J, frames))
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


def nodal_offsets(scene, layout, nodes, mass):
    """What eccentricity adds to `nodal_inertia`, inertial at rest.

    The mass of a rod lies at the offset a, masses that are added to it on its axis. Together they are a mass m at the
    offset a m_rod/m, and a moment of inertia m_rod (m - m_rod)/m (a.a - a a) besides that of the section.

    Args:
        mass: of `nodal_inertia`.

    Returns:
        Offsets (elements, p + 1, 3), m, and moments of inertia (elements, p + 1, 3, 3), kg m.
    """
    arms, own = [], []
    for rod, s in _nodes_of(scene, layout, nodes):
        own.append(_own(_by_side(rod.stiffness_at, s), "mass"))
        offsets = _pick(*_by_side(rod.mass_centre.at, s)) if rod.mass_centre else np.zeros((*s.shape, 3))
        frames = rod.curve.frame(s.ravel()).reshape(*s.shape, 3, 3)
        arms.append(np.einsum("...ij,...j->...i", frames, offsets))
    arm, own = np.concatenate(arms), np.concatenate(own)
    apart = own * (mass - own) / mass
    squares = np.einsum("...i,...i->...", arm, arm)[..., None, None] * np.eye(3)
    return arm * (own / mass)[..., None], apart[..., None, None] * (squares - arm[..., :, None] * arm[..., None, :])


def nodal_lateral(scene, layout, nodes):
    """(elements, p + 1, 3) tangents at rest times the square root of the mass, kg/m, that does not move along them."""
    parts = []
    for rod, s in _nodes_of(scene, layout, nodes):
        left_out = sum((across - along for across, along in _added(scene, rod, s)), np.zeros(s.shape))
        tangents = rod.curve.frame(s.ravel())[..., 2].reshape(*s.shape, 3)
        parts.append(np.sqrt(left_out)[..., None] * tangents)
    return np.concatenate(parts)


def _nodes_of(scene, layout, nodes):
    """(rod, arc lengths (elements, p + 1) of the nodes, m) of every rod."""
    for rod, x in zip(scene.rods, layout.inside(nodes), strict=True):
        yield rod, x * rod.length


def _added(scene, rod, s):
    """(across, along) masses that move with the axis, each (elements, p + 1), of every action along a rod."""
    for action in scene.loads:
        if action.station is None and action.acts_on(rod):
            after, before = _by_side(lambda s, side, action=action: action.added_mass(rod, s, side), s)
            if after is not None:
                yield tuple(_pick(a, b) for a, b in zip(after, before, strict=True))


def _by_side(function, s):
    """Values at the nodes of elements as limits from above, and from below."""
    return tuple(function(s, side) for side in ("right", "left"))


def _own(along, name):
    """A field of `Stiffnesses` at the nodes of every element."""
    return _pick(*(getattr(side, name) for side in along))


def _pick(after, before):
    """At the first node of every element the limit from above, at all others that from below."""
    first = np.arange(after.shape[1]) == 0
    return np.where(first.reshape(-1, *(1,) * (after.ndim - 2)), after, before)
