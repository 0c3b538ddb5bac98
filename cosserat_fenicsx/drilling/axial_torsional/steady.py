"""The steady motion of a string as a start: all of it turns at the drive's speed and moves at the hook's.

The forces of wall, mud and bit at these velocities twist and compress the string. The normal force at the wall depends
on the tension, so it is found again a few times.
"""

import numpy as np

from cosserat_fenicsx.errors import NotConverged

_ROUNDS, _SAME = 200, 1e-13


def steady_state(velocities, chain, limits, decay, bit):
    """Places of the nodes and forces on the top in steady motion.

    Args:
        velocities: (dofs,) of all nodes. chain: the `Chain`.
        limits: (nodes, 3) of the places (nodes, dofs): largest friction at rest, in motion, contact radius.
        decay: (speed, of rotation) of the law of friction.
        bit: (dofs,) weight on bit less that at rest (N), torque on bit (N m).

    Returns:
        x (nodes, dofs); (dofs,) force along the string above the first node: compression (N), torque (N m).

    Raises:
        NotConverged: friction grows by the tension that it makes, without end.
    """
    n = len(velocities)
    x = np.zeros((len(chain.depths), n))
    drag = chain.drag.copy()
    drag[:-1] += chain.drag_off
    drag[1:] += chain.drag_off
    down, turning = velocities[0] if n == 2 else 0.0, velocities[-1]
    for _ in range(_ROUNDS):
        still, slipping, radius = limits(x).T
        around = radius * turning
        slip = np.hypot(down, around)
        speed = np.abs(turning) if decay[1] else slip
        falling = np.exp(-speed / decay[0]) if decay[0] > 0 else 0.0
        size = np.divide(slipping + (still - slipping) * falling, slip, out=np.zeros_like(slip), where=slip > 0)
        resisting = drag * velocities
        resisting[:, -1] += size * around * radius
        if n == 2:
            resisting[:, 0] += size * down
        resisting[-1] += bit
        below = np.cumsum(resisting[::-1], axis=0)[::-1]
        new = np.concatenate([np.zeros((1, n)), np.cumsum(-below[1:] / chain.spring, axis=0)])
        change, x = np.abs(new - x).max(), new
        if change <= _SAME * np.abs(x).max():
            return x, below[0]
    raise NotConverged("Drilling.start = 'steady': the friction grows by the tension that it makes: expected 'rest'")
