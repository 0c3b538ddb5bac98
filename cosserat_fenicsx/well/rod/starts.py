"""States of a string in its hole from which an equilibrium is looked for: (r, q) (n, 7) at arc lengths s (n,), m; q is
the rotation from the rod's straight reference, without a jump of sign."""

import numpy as np

from cosserat_fenicsx.numerics import directors, product_conjugate
from cosserat_fenicsx.well.criteria import snake_load


def on_axis(rod, path, s):
    """Of a rod that lies on the axis without twist, from the path's start."""
    near = path.nearest(None, s)
    return _untwisted(rod, near.position, near.tangent)


def turns_of_helix(EI, compression, torque, hand):
    """(n,) rate h b, rad per m, of a long helix along a wall with small slopes. For a hand h, b makes its energy least:

        U/length = r^2 (EI b^4 - F b^2 + h Q b^3)/2,   b = (-1.5 h Q + (2.25 Q^2 + 8 EI F)^(1/2))/(4 EI),

    and the hand with h Q < 0 has less of it. Without torque b = (F/(2 EI))^(1/2) (Lubinski, Althouse & Logan,
    J. Petr. Technol. 14 (1962) 655, doi:10.2118/178-PA).

    Args:
        EI: N m^2, (n,). compression: F, N, (n,). torque: Q, N m, as in `InHole.torque`; hand: 1 where the angle
            grows down the hole, clockwise looking down it, -1 where it falls.
    """
    Q = -hand * torque
    return hand * (1.5 * Q + np.sqrt(2.25 * Q**2 + 8 * EI * compression)) / (4 * EI)


def energy_of_helix(EI, compression, torque, clearance, rate):
    """(n,) J/m of a long helix over that of the straight string, see `turns_of_helix`."""
    return clearance**2 * (EI * rate**4 - compression * rate**2 + torque * rate**3) / 2


def in_helix(string, s):
    """Of a `StringScene` that winds along the wall, without twist, where its compression F without friction is beyond
    the load of a snake: with the rate of `turns_of_helix` and the hand that the torque favours. It fades to the
    axis where F is less, within half a turn of both ends and at the rings."""
    near, part = string.path.nearest(None, s), string.section_at(s)
    EI, weight = string.bending[part], string.weight[part]
    compression = np.maximum(-string.tension(s), 0.0)
    clearance = string.wall.sizes(s, near.md)[0]
    side = weight * np.hypot(near.tangent[:, 0], near.tangent[:, 1])
    rate = np.abs(turns_of_helix(EI, compression, string.torque, string.hand)) * (compression > 0)
    angle = np.append(0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(s)))
    held = np.array([0.0, string.ends[-1], *(ring.station.s for ring in string.rings)])
    turned = rate * np.abs(s[:, None] - held).min(axis=1)
    share = np.clip(compression / snake_load(EI, clearance, weight, side) - 1, 0, 1) * np.clip(turned / np.pi, 0, 1)
    d = directors(on_axis(string.rod, string.path, s)[:, 3:]) @ string.rod.curve.frame(np.zeros(1))[0]
    away = np.cos(angle)[:, None] * d[:, :, 0] + string.hand * np.sin(angle)[:, None] * d[:, :, 1]
    r = near.position + (share * clearance)[:, None] * away
    along = np.gradient(r, s, axis=0)
    return _untwisted(string.rod, r, along / np.linalg.norm(along, axis=1, keepdims=True))


def _untwisted(rod, position, tangent):
    """Along a line (n, 3), m, with unit tangents (n, 3), without twist."""
    before = np.concatenate([rod.curve.frame(np.zeros(1))[:, :, 2], tangent[:-1]])
    cos = np.einsum("ni,ni->n", before, tangent)
    q = np.column_stack([1 + cos, np.cross(before, tangent)])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    done = 1  # products of the small rotations of 1, 2, 4, .. nodes
    while done < len(q):
        q[done:] = product_conjugate(q[done:], q[:-done] * (1.0, -1.0, -1.0, -1.0))
        done *= 2
    return np.column_stack([position, q / np.linalg.norm(q, axis=1, keepdims=True)])
