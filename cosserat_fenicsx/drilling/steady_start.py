"""The steady motion that a scene may start with: which scenes have one, and its velocities."""

import math

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.bit_laws import Cutting
from cosserat_fenicsx.drilling.top_drive import PI, Motor, Stiff


def check_steady(scene) -> None:
    """Refuse a scene whose drive has no steady speed of its own.

    Raises:
        SceneError: a motor, a control without an integral part, or a drive at rest.
    """
    control = scene.drive.control
    speed = None if isinstance(control, Motor) else scene.drive.signal()(0.0)
    if not (isinstance(control, Stiff) or (isinstance(control, PI) and control.Ki > 0)):
        refuse("Drilling", "start", "steady", "'rest' with this drive: only Stiff(), and PI(Kp, Ki) with Ki above 0, "
               "have the speed asked for in steady rotation")  # fmt: skip
    if not speed > 0:
        refuse("Drilling", "start", "steady", "'rest' where the drive does not turn at the start, or a speed above 0")


def check_rock(scene) -> None:
    """Refuse a hook that moves a string with axial motion whose bit stands on rock that is not drilled.

    Raises:
        SceneError: so it is.
    """
    bit, (down, _) = scene.bit, steady_velocities(scene)
    if down and bit is not None and bit.weight is not None and not isinstance(bit.law, Cutting):
        refuse("Drilling", "start", "steady", f"'rest' with a hook that moves at {-down:g} m/s: the rock below a bit "
               "with a weight is not drilled and does not give way, unless its law is Cutting(...)")  # fmt: skip


def follows_the_bit(scene) -> bool:
    """Whether the load of the hook stays the same, so that the string follows the bit, which drills by its weight."""
    bit = scene.bit
    return scene.hook is None and bit is not None and bit.weight is not None and isinstance(bit.law, Cutting)


def steady_velocities(scene) -> np.ndarray:
    """(2,) of steady motion: m/s downwards, rad/s.

    Raises:
        SceneError: a bit that drills by its weight, which its wear flats bear.
    """
    turning = scene.drive.signal()(0.0)
    if follows_the_bit(scene):
        return np.array([penetration(scene.bit, turning), turning])
    return np.array([0.0 if scene.hook is None else -scene.hook.signal()(0.0), turning])


def penetration(bit, turning) -> float:
    """Rate (m/s) at which a bit with a `Cutting` law drills by its weight at a speed of rotation (rad/s).

    Raises:
        SceneError: a weight that its wear flats bear.
    """
    law, wear = bit.law, bit.law.wear
    idle = law.a * wear.length * wear.stress if wear else 0.0
    if bit.weight <= idle:
        refuse(bit, "weight", bit.weight, f"more than the wear flats carry, {idle:.6g} N")
    return (bit.weight - idle) / law.axial_stiffness * law.blades * turning / (2 * math.pi)
