"""A control of a drive: proportional and integral, called once a sample, with a limited torque."""

from dataclasses import dataclass

from cosserat_fenicsx.drilling import Gains, SampledControl
from cosserat_fenicsx.parts import Time, Torque, TorsionalDamping, TorsionalStiffness


@dataclass(frozen=True)
class LimitedSpeed(SampledControl):
    """Kp (Om - om) + Ki int (Om - om) dt, at most the largest torque, at which the integral stops.

    Args:
        Kp: N m s/rad. Ki: N m/rad. most: N m. sample: s.
    """

    Kp: TorsionalDamping
    Ki: TorsionalStiffness
    most: Torque
    sample: Time = 0.01

    def begin(self):
        return (0.0,)

    def torque(self, state, now):
        error = now.asked - now.speed
        asked = self.Kp * error + self.Ki * state[0]
        limited = max(-self.most, min(self.most, asked))
        return limited, state + (error * self.sample if limited == asked else 0.0)

    def gains(self, impedance):
        return Gains(Kp=self.Kp, Ki=self.Ki)
