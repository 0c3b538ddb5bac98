"""How tension and torque of a soft string change with its weight, its friction and what acts on its lower end.

The equations of `softstring`, linearised at what was found: with V = T k + w (n cos ku + t sin ku) and
N = sqrt(V^2 + (w b)^2), for the change dP of the friction

    dP' = d k V/N dP + N dd + d (V (k dT_0 + dV_w) + w b^2 dw)/N,

dT_0 and dV_w the explicit parts. It is linear and is solved as an iteration of Newton's method is there: by its
integrating factor, with Gauss's points, on the same pieces. Where N has a kink pieces are cut, and N is continuous
there, so that the place of a cut has no part in it.
"""

from collections import namedtuple

import numpy as np

from cosserat_fenicsx.well.softstring import POINTS_TO, UP_TO, WEIGHTS, chained

#: Changes per unit of a parameter: arrays over `Pieces`, of weight (N/m) and friction, and numbers at the lower end, of
#: tension (N) and torque (N m).
Change = namedtuple("Change", "weight friction tension torque")


def rates_of(solved, pieces, change, coulomb):
    """Derivatives of tension and torque.

    Args:
        solved: the `Solved` of a soft string; pieces: its `Pieces`; change: the `Change`; coulomb: see `chain_of`.

    Returns:
        (tension, torque), (n, m) each, at the places of `solved`, per unit of the parameter.
    """
    chain, at = solved.chain, solved.at
    k, length = chain.curvature[:, None], chain.length[:, None]
    weight, dw = chain.weight[:, None], change.weight[chain.origin][:, None]
    # mu/sqrt(1 + (e mu)^2) has the derivative 1/(..)^(3/2); without the root it is 1
    of_friction = change.friction[chain.origin] / (chain.climb**3 if coulomb else 1.0)
    d_drag = (pieces.axial[chain.origin] * of_friction)[:, None]
    d_turn = ((pieces.around * pieces.radius)[chain.origin] * of_friction)[:, None]
    drag, turn = chain.drag[:, None], chain.turn[:, None]
    u = length * at
    cos, sin = np.cos(k * u), np.sin(k * u)
    across = chain.n[:, None] * cos + chain.t[:, None] * sin  # per unit of weight
    height = chain.t[:, None] * u * np.sinc(k * u / np.pi)
    height -= chain.n[:, None] * k * u**2 / 2 * np.sinc(k * u / 2 / np.pi) ** 2
    b2 = chain.b[:, None] ** 2
    V = k * solved.tension + weight * across
    N = np.sqrt(V * V + weight**2 * b2)
    known = change.tension + np.concatenate([[0.0], np.cumsum((dw * height)[:-1, -1])])[:, None] + dw * height

    def of_load(d_tension):
        """dN of a change of the tension and of the weight."""
        moved = V * (k * d_tension + dw * across) + weight * b2 * dw
        return np.divide(moved, N, out=np.zeros_like(N), where=N > 0)

    inner = slice(1, -1)
    slope = (drag * k * np.divide(V, N, out=np.zeros_like(V), where=N > 0))[:, inner]
    A, A_end = (slope @ POINTS_TO.T) * length, (slope @ WEIGHTS) * length[:, 0]
    decay = (d_drag * N + drag * of_load(known))[:, inner] * np.exp(-A)
    gain = np.exp(A_end)
    starts = chained(gain, gain * (decay @ WEIGHTS) * length[:, 0])
    inside = np.exp(A) * (starts[:-1, None] + (decay @ POINTS_TO.T) * length)
    tension = known + np.concatenate([starts[:-1, None], inside, starts[1:, None]], axis=1)
    turned = length * ((d_turn * N + turn * of_load(tension)) @ UP_TO.T)
    torque = change.torque + np.concatenate([[0.0], np.cumsum(turned[:-1, -1])])[:, None] + turned
    return tension, torque
