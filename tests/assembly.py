"""A bottom-hole assembly in a straight inclined hole by its strong form, without any mesh: collocation."""

import numpy as np
from scipy.integrate import solve_bvp

import cosserat_fenicsx as cf
from cosserat_fenicsx.well.components import weight_in_mud


def assembly(scene):
    """Frictionless equilibrium of the first operation of a `WellScene` in the vertical plane of its hole, by a rod with
    shear, rigid along its axis; blades in the middle of stabilisers and the bit are on the low side of the wall, whose
    elasticity is left out.

    Returns:
        forces of the wall on bit and stabilisers towards the high side, N, and on the collars where they come to lie on
        the low side; tilt of the bit towards the high side, rad; how far above the bit the resultant of their
        force is, m.
    """
    inc, hole = scene.hole.path.inclination[0], scene.hole.sections[0].diameter / 2
    thrust, pieces, held = scene.operations[0].weight, [], {}
    for part in scene.string.components:
        stiffness, weight = part.stiffness, weight_in_mud(part, scene.mud, 0.0)
        halves = 2 if isinstance(part, cf.well.Stabiliser) else 1
        for k in range(halves):
            if k or isinstance(part, cf.well.Bit):
                held[len(pieces)] = part.contact_radius - hole
            pieces.append((part.length and part.length / halves, stiffness.bending[0], stiffness.shear[0], weight))
    length, EI, GA, w = (np.array(x, dtype=float)[:, None] for x in zip(*pieces, strict=True))
    lying = scene.string.components[-1].contact_radius - hole

    def rates(x, state, free):
        L = np.where(np.isnan(length), free, length)
        above = np.append(0.0, np.cumsum(w * L)[:-1])[:, None]
        y, turn, m, ny = state.reshape(4, len(pieces), -1) * scales[:, None, None]
        nx = -thrust + np.cos(inc) * (above + w * L * x)
        shear = (ny * np.cos(turn) - nx * np.sin(turn)) / GA
        dx, dy = np.cos(turn) - shear * np.sin(turn), np.sin(turn) + shear * np.cos(turn)
        changes = np.array([L * dy, L * m / EI, L * (dy * nx - dx * ny), L * w * np.sin(inc) + 0 * y])
        return (changes / scales[:, None, None]).reshape(len(state), -1)

    def ends(start, end, free):
        start, end = start.reshape(4, -1), end.reshape(4, -1)
        # where they lie turns and moments fade within a length sqrt(EI/GA), and the wall's excess force with them
        turn, m, ny = end[1:, -1] * scales[1:]
        rest = [start[0, 0] - held[0] / scales[0], start[2, 0], end[0, -1] - lying / scales[0]]
        rest += [(turn + (ny + thrust * turn) / GA[-1, 0]) / scales[1], (m + EI[-1, 0] / fading * turn) / scales[2]]
        rest += (start[:3, 1:] - end[:3, :-1]).ravel().tolist()
        for k in range(1, len(pieces)):
            rest.append(start[0, k] - held[k] / scales[0] if k in held else start[3, k] - end[3, k - 1])
        return np.array(rest)

    scales, fading = np.array([1e-2, 1e-3, 1e4, 1e3]), float(np.sqrt(EI[-1, 0] / GA[-1, 0]))
    x = np.linspace(0, 1, 21)
    found = solve_bvp(rates, ends, x, np.zeros((4 * len(pieces), len(x))), [15.0], tol=1e-10, max_nodes=5000)
    assert found.success, found.message
    start, end = (found.y[:, k].reshape(4, -1) * scales[:, None] for k in (0, -1))
    forces = [-start[3, 0], *(end[3, k - 1] - start[3, k] for k in held if k)]
    free = found.p[0]
    return np.array([*forces, end[3, -1]]), -start[1, 0], free + np.nansum(length) + fading
