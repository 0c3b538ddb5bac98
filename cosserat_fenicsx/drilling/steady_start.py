"""The steady motion that a scene may start with: which scenes have one, and its velocities."""

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
    """Refuse a hook that moves a string with axial motion whose bit stands on rock that does not give way.

    Raises:
        SceneError: so it is.
    """
    bit, (down, _) = scene.bit, steady_velocities(scene)
    if down and bit is not None and bit.weight is not None and not isinstance(bit.law, Cutting):
        refuse("Drilling", "start", "steady", f"'rest' with a hook that moves at {-down:g} m/s: the rock below a bit "
               "with a weight does not give way, unless its law is Cutting(...)")  # fmt: skip


def steady_velocities(scene) -> np.ndarray:
    """(2,) of steady motion: m/s downwards, rad/s."""
    down = 0.0 if scene.hook is None else -scene.hook.signal()(0.0)
    return np.array([down, scene.drive.signal()(0.0)])
