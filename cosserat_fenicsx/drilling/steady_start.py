"""The steady motion that a scene may start with: its conditions and velocities, the twist and the compression.

All of the string turns at the drive's speed and moves at the hook's. The forces of wall, mud and bit at these
velocities twist and compress the string. The normal force at the wall depends on the tension, so it is iterated.
"""

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.joints import speed_of_bit
from cosserat_fenicsx.errors import NotConverged


def check_steady(scene) -> None:
    """Refuse a scene whose drive has no steady speed of its own.

    Raises:
        SceneError: a motor, a control without an integral part, or a drive at rest.
    """
    drive = scene.drive
    gains = None if drive.speed is None or drive.control.sampled else drive.control.gains(1.0)
    sampled = drive.speed is not None and drive.control.sampled
    if not sampled and (gains is None or not (gains.rigid or gains.Ki > 0 or gains.linear)):
        refuse("Drilling", "start", "steady", "'rest' with this drive: only Stiff(), PI(Kp, Ki) with Ki above 0, and "
               "linear controls have the speed asked for in steady rotation")  # fmt: skip
    speed = drive.signal()(0.0)
    if not speed > 0:
        refuse("Drilling", "start", "steady", "'rest' where the drive does not turn at the start, or a speed above 0")


def check_rock(scene) -> None:
    """Refuse a hook that moves a string with axial motion whose bit stands on rock without drilling.

    Raises:
        SceneError: the hook moves, and the bit stands on such rock; or an autodriller is to put a weight on a bit that
            drills and has one already.
    """
    bit, (down, _) = scene.bit, steady_velocities(scene)
    driller = scene.hook is not None and scene.hook.autodriller is not None
    if driller and bit is not None and bit.law.drills and bit.weight is not None:
        refuse("Drilling", "start", "steady", "a bit without a weight, BitOnRock(weight=None), which the autodriller "
               "puts on it; or 'rest': the block of an autodriller stands still at the start, and the bit drills by "
               "its weight")  # fmt: skip
    if down and bit is not None and bit.weight is not None and not bit.law.drills:
        refuse("Drilling", "start", "steady", f"'rest' with a hook that moves at {-down:g} m/s: the rock below a bit "
               "with a weight is not drilled and does not give way, unless its law is Cutting(...)")  # fmt: skip


def follows_the_bit(scene) -> bool:
    """Whether the load of the hook stays the same, so that the string follows the bit, which drills by its weight."""
    bit = scene.bit
    return scene.hook is None and bit is not None and bit.weight is not None and bit.law.drills


def steady_velocities(scene) -> np.ndarray:
    """(2,) of steady motion: m/s downwards, rad/s.

    Raises:
        SceneError: a bit that drills by its weight, which its wear flats bear.
    """
    turning = scene.drive.signal()(0.0)
    if follows_the_bit(scene):
        return np.array([scene.bit.law.rate(scene.bit.weight, steady_speed_of_bit(scene)), turning])
    return np.array([_of_hook(scene), turning])


def steady_speed_of_bit(scene, down: float | None = None) -> float:
    """rad/s, of steady motion: that of the drive, and of a motor.

    Args:
        down: velocity (m/s) of a bit that drills; None for that by its weight, or by the hook.

    Raises:
        SceneError: the motor stalls.
    """
    down = _of_hook(scene) if down is None and not follows_the_bit(scene) else down
    return speed_of_bit(scene, scene.drive.signal()(0.0), down)


def _of_hook(scene):
    """m/s downwards."""
    return 0.0 if scene.hook is None else -scene.hook.signal()(0.0)


# Most iterations; relative change at which they end.
_ROUNDS, _SAME = 200, 1e-13


def steady_state(velocities, chain, limits, friction, bit, pairs=()):
    """Places of the nodes and forces on the top in steady motion.

    Args:
        velocities: (nodes, dofs). chain: the `Chain`.
        limits: (nodes, 3) of the places (nodes, dofs): largest friction at rest, in motion, contact radius.
        friction: the `Resistance` of the wall, and whether it is one over the rotation.
        bit: (dofs,) weight on bit less that at rest (N), torque on bit (N m).
        pairs: (element, unknown, force) of forces that drive its nodes apart, N or N m.

    Returns:
        x (nodes, dofs); (nodes, dofs) force along the string above each node: compression (N), torque (N m).

    Raises:
        NotConverged: friction and the tension that it causes increase each other without end.
    """
    n = velocities.shape[1]
    x = np.zeros_like(velocities)
    dragged = chain.drag * velocities
    dragged[:-1] += chain.drag_off * velocities[1:]
    dragged[1:] += chain.drag_off * velocities[:-1]
    for i, d, force in pairs:
        dragged[i, d] += force
        dragged[i + 1, d] -= force
    spring = np.where(chain.spring > 0, chain.spring, np.inf)
    down, turning = velocities[:, 0] if n == 2 else 0.0, velocities[:, -1]
    for _ in range(_ROUNDS):
        still, _, radius = limits(x).T
        around = radius * turning
        slip = np.hypot(down, around)
        braked = still > 0
        speed = np.abs(turning) if friction[1] else slip
        size = np.zeros_like(slip)
        size[braked] = still[braked] / friction[0].still * friction[0](speed[braked]) / slip[braked]
        resisting = dragged.copy()
        resisting[:, -1] += size * around * radius
        if n == 2:
            resisting[:, 0] += size * down
        resisting[-1] += bit
        below = np.cumsum(resisting[::-1], axis=0)[::-1]
        new = np.concatenate([np.zeros((1, n)), np.cumsum(-below[1:] / spring, axis=0)])
        change, x = np.abs(new - x).max(), new
        if change <= _SAME * np.abs(x).max():
            return x, below
    raise NotConverged("Drilling.start = 'steady': the friction grows by the tension that it makes: expected 'rest'")
