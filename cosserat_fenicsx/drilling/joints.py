"""Tools that part the string, in torsion or along the axis: two nodes at one place, with a spring, a damper and a pair
of forces between them.

A `MudMotor` parts it in torsion: the torque that its flow gives it at rest acts on what is below and against the
housing, and between them a dashpot of its slope, and the friction of its rotor.
An `OscillationTool` parts axial motion, with its spring and its force.
"""

import math
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


@dataclass(frozen=True)
class Parting:
    """A motor between two parts of a waveguide, in steps of the implicit midpoint rule.

    Attributes:
        motor: the `MudMotor`. driven: `ScalarSignal` of the torque that its flow gives it at rest, N m.
    """

    motor: MudMotor
    driven: ScalarSignal

    def meet(self, turning, start, end, above, below):
        """(speed of the upper side, speed of its rotor against that, mean over a step from start to end (s); speed of
        the lower side at its end), rad/s.

        Args:
            turning: the lower side's speed at the start, rad/s. above, below: (wave M + Z om, or M - Z om, that arrives
                there (N m), impedance Z with its drag).
        """
        (arriving, Z), (back, lower), lost = above, below, self.motor.lost_torque
        inert = 2 * self.motor.rotor_inertia / (end - start)
        free = (inert * turning - back) / (lower + inert) - arriving / Z  # without torque
        give = 1 / Z + 1 / (lower + inert)
        law, rate = self._law(start, end), 0.0
        driven = float(law(0.0)) if law else self.driven.mean(start, end)
        pushed = free + give * driven
        if abs(pushed) > give * lost:
            rubbed = math.copysign(give * lost, pushed)
            rate = (pushed - rubbed) / (1 + give * self.motor.slope)
            if law:  # its torque falls, so that the rate is between 0 and that under the torque at rest
                rate = brentq(lambda x: x - free + rubbed - give * float(law(x)), 0.0, pushed - rubbed, xtol=1e-14)
        first = (arriving + (free - rate) / give) / Z
        return first, rate, 2 * (first + rate) - turning

    def _law(self, start, end):
        """`MudMotor.law_at` the mean flow of a step; None of a motor without curves."""
        flow = self.motor.flow
        if not self.motor.curves:
            return None
        return self.motor.law_at(self.driven.flow.mean(start, end) if callable(flow) else flow)


def joints_of(laid, bottoms) -> tuple[Joint, ...]:
    """The `Joint`s of components in their places, from the top down; bottoms: measured depths of the lower ends of the
    segments, in which fluids may cut components."""
    found = []
    for place in reversed(laid):
        tool, k = place.component, bottoms.index(place.bottom)
        if isinstance(tool, MudMotor):
            found.append(Joint(tool, k, True, 0.0, tool.slope, _driven(tool), tool.lost_torque))
        if isinstance(tool, OscillationTool):
            if place is laid[0]:
                refuse("DrillString", "components", tool.name, f"a component below {tool.name}, which it shakes")
            found.append(Joint(tool, k, False, tool.spring, 0.0, ScalarSignal(tool, "force", tool, "N")))
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
    """The largest speed that their flow gives the rotors of all motors against their housings, rad/s; 0 without any."""
    return math.fsum(_fastest(joint) for joint in scene.joints if joint.turns)


def _fastest(joint):
    if not joint.tool.curves:
        return max(0.0, (joint.force.largest - joint.lost) / joint.damping)
    flow = ScalarSignal(joint.tool, "flow", joint.tool.flow, "m^3/s").largest  # perhaps of a time after the motion
    return joint.tool.speed(0.0, min(flow, joint.tool.curves[-1].flow))


def steady_speeds(scene, turning, down=None, rubbed=None) -> np.ndarray:
    """(motors + 1,) rad/s: the speeds of the drive, and of what is below each motor, in steady rotation of a string,
    down to the bit's, see `speeds_of_parts`.

    Args:
        scene: a `Drilling`. turning: of the drive, rad/s.
        down: velocity of a bit that drills, m/s; None for that by its weight.
        rubbed: function of how many motors are above, and of a speed, that gives the torque of the wall on what turns
            with it, N m, or None.

    Raises:
        SceneError: a motor stalls.
    """
    bit, drag = scene.bit, scene.drag_rates[1] * scene.inertias if scene.motors else None

    def taken(motor, speeds):
        om = speeds[-1]
        velocity = bit.law.rate(bit.resting, om) if down is None and bit.law.drills else down or 0.0
        torque = float(bit.law.steady_forces(bit.resting or 0.0, np.array([velocity, om]))[1])
        for part in range(motor + 1, len(speeds)):
            torque += drag[part] * speeds[part] + (rubbed(part, speeds[part]) if rubbed else 0.0)
        return torque

    return speeds_of_parts(scene.motors, taken, turning)


def speeds_of_parts(motors, taken, turning, fastest=None, tried=_TRIED) -> np.ndarray:
    """(motors + 1,) rad/s: the speeds of the drive, and of what is below each motor, in steady rotation: the largest
    ones at which each gives the torque that it is asked for. From a speed of the bit on, what a motor is asked for
    follows from the speeds below, and with its speed that of the part above.

    Args:
        motors: from the top down. turning: speed of the drive, rad/s.
        taken: function of the number of a motor and of speeds (motors + 1,) that gives the torque asked from it, N m;
            it depends on those below it alone.
        fastest: an upper bound of the speed of the bit, rad/s; None for that without load.
        tried: speeds between those of bit and drive at which torques are compared.

    Raises:
        SceneError: a motor stalls.
    """
    if not motors:
        return np.array([turning])

    def speeds(of_bit):
        found = np.full(len(motors) + 1, of_bit)
        for k in range(len(motors) - 1, 0, -1):
            found[: k + 1] = found[k + 1] - motors[k].speed(taken(k, found))
        found[0] = turning
        return found

    def excess(of_bit):
        found = speeds(of_bit)
        return motors[0].torque(found[1] - turning) - taken(0, found)

    if fastest is None:
        fastest = turning + math.fsum(x.speed(0.0) for x in motors)
    trials = np.linspace(fastest, turning, tried)[:-1]
    values = np.array([excess(om) for om in trials])
    k = int(np.argmax(values >= 0))
    weakest = min(motors, key=lambda x: x.stall_torque())
    if weakest.stall_torque() > 0 and values[k] >= 0:
        found = speeds(trials[0] if k == 0 else brentq(excess, trials[k], trials[k - 1], xtol=1e-14, rtol=1e-14))
        if (np.diff(found) > 0).all():
            return found
    raise SceneError(f"{weakest.name}: it stalls: with {weakest.flow_at(0.0):.4g} m^3/s it gives less than "
                     f"{max(weakest.stall_torque(), 0.0):.5g} N m, and more is taken from it at every speed of the "
                     "bit: expected less weight on bit, more flow or another motor; start='rest' computes how it "
                     "stalls")  # fmt: skip
