"""Tools that part the string, in torsion or along the axis: two nodes at one place, with a spring, a damper and a pair
of forces between them.

A `MudMotor` parts it in torsion: the torque that its flow gives it at rest acts on what is below and against the
housing, and between them a dashpot of its slope, and the friction of its rotor.
An `OscillationTool` parts axial motion, with its spring and its force.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.signals import ScalarSignal
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.well.tools import MudMotor, OscillationTool

# Speeds at which the torque of the bit is compared with the motor's.
_TRIED = 400


@dataclass(frozen=True)
class Joint:
    """A place where a string is parted.

    Attributes:
        tool: the component; the joint is at its lower end. segment: its index from the top down.
        turns: whether it parts torsion, else axial motion.
        spring, damping: N m/rad and N m s/rad, or N/m and N s/m. force: `ScalarSignal` of what drives both sides apart,
            N m or N. lost: the largest friction between them, N m.
    """

    tool: MudMotor | OscillationTool
    segment: int
    turns: bool
    spring: float
    damping: float
    force: ScalarSignal
    lost: float = 0.0

    def steady(self, rate: float) -> float:
        """Torque or force (N m or N), without the damper, that drives both sides apart at a rate (rad/s or m/s) from 0
        on."""
        curved = self.turns and self.tool.curves
        return self.tool.torque(rate) + self.damping * rate if curved else self.force(0.0) - self.lost


def joints_of(laid, bottoms) -> tuple[Joint, ...]:
    """The `Joint`s of components in their places, from the top down; bottoms: measured depths of the lower ends of the
    segments, in which fluids may cut components.

    Raises:
        SceneError: more than one motor.
    """
    found = []
    for place in reversed(laid):
        tool, k = place.component, bottoms.index(place.bottom)
        if isinstance(tool, MudMotor):
            found.append(Joint(tool, k, True, 0.0, tool.slope, _driven(tool), tool.lost_torque))
        if isinstance(tool, OscillationTool):
            if place is laid[0]:
                refuse("DrillString", "components", tool.name, f"a component below {tool.name}, which it shakes")
            found.append(Joint(tool, k, False, tool.spring, 0.0, ScalarSignal(tool, "force", tool, "N")))
    motors = [x.tool.name for x in found if x.turns]
    if len(motors) > 1:
        refuse("DrillString", "components", motors, "one MudMotor: two in a row are not computed")
    return tuple(found)


def _driven(motor):
    """The torque that its flow gives a motor at rest, over time."""
    if not callable(motor.flow):
        return ScalarSignal(motor, "flow", motor.driven(), "N m")

    return _Driven(motor, "flow", motor.flow, "m^3/s")


class _Driven(ScalarSignal):
    """The same of a motor whose flow depends on time, N m."""

    def __init__(self, motor, *flow):
        super().__init__(motor, *flow)
        #: m^3/s
        self.flow, self._motor = ScalarSignal(motor, *flow), motor

    def __call__(self, t):
        return self._motor.driven(self._motor.flow_at(t))


def fastest_rotor(scene) -> float:
    """The largest speed that its flow gives the rotor of a motor against its housing, rad/s; 0 without a motor."""
    joint = next((x for x in scene.joints if x.turns), None)
    if joint is None:
        return 0.0
    if not joint.tool.curves:
        return max(0.0, (joint.force.largest - joint.lost) / joint.damping)
    flow = ScalarSignal(joint.tool, "flow", joint.tool.flow, "m^3/s").largest  # perhaps of a time after the motion
    return joint.tool.speed(0.0, min(flow, joint.tool.curves[-1].flow))


def speed_of_bit(scene, turning, down=None, rubbed=None):
    """The speed of the bit in steady rotation of a string (rad/s): its own, or below a motor the largest one at which
    the torque on bit is the motor's.

    Args:
        scene: a `Drilling`. turning: of the string, rad/s.
        down: velocity of a bit that drills, m/s; None for that by its weight.
        rubbed: function of the speed that gives the torque of the wall on what turns with the bit, N m, or None.

    Raises:
        SceneError: the motor stalls.
    """
    motor, bit = scene.motor, scene.bit
    if motor is None:
        return turning
    drag = scene.drag_rates[1] * scene.turned_inertia

    def excess(om):
        velocity = bit.law.rate(bit.resting, om) if down is None and bit.law.drills else down or 0.0
        torque = float(bit.law.steady_forces(bit.resting or 0.0, np.array([velocity, om]))[1])
        torque += rubbed(om) if rubbed else 0.0
        return motor.torque(om - turning) - torque - drag * om

    return largest_speed(motor, excess, turning + motor.speed(0.0), turning)


def largest_speed(motor, excess, fastest, slowest, tried=_TRIED):
    """The largest speed of a bit below a motor (rad/s) at which the torque in excess of what it takes is 0.

    Raises:
        SceneError: the motor stalls.
    """
    speeds = np.linspace(fastest, slowest, tried)[:-1]
    values = np.array([excess(om) for om in speeds])
    k, stall = int(np.argmax(values >= 0)), motor.stall_torque()
    if stall <= 0 or values[k] < 0:
        raise SceneError(f"{motor.name}: it stalls: with {motor.flow_at(0.0):.4g} m^3/s it gives less than "
                         f"{max(stall, 0.0):.5g} N m, and the bit takes more at every speed: expected less weight on "
                         "bit, more flow or another motor; start='rest' computes how it stalls")  # fmt: skip
    return float(speeds[0] if k == 0 else brentq(excess, speeds[k], speeds[k - 1], xtol=1e-14, rtol=1e-14))
