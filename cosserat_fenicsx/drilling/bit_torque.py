"""The torque of a bit on rock, on the end of a rod in motion."""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import instance, number, store
from cosserat_fenicsx.drilling.bit_laws import Stribeck
from cosserat_fenicsx.scene.action import PointAction
from cosserat_fenicsx.scene.rod import Station, StationOrName, is_known


@dataclass(frozen=True)
class BitTorque(PointAction):
    """A torque about the rod's axis d3 that falls with the speed of rotation; at rest anything up to the static one.

    The law is set-valued: within a step the bit sticks or slips. In `simulate` alone, in the spatial model; at rest it
    exerts nothing. It is not multiplied by the load factor. What it dissipates counts as such in the energy balance.

    Args:
        station: where.
        law: a `Stribeck`.
        weight: on bit, N, constant, for a law by coefficients of friction; the force itself is a load of its own.
        inertia_of_bit: about the axis, kg m^2. `Damping.drag` of the rod would act on it, too: here that is taken off.

    Raises:
        SceneError: not a station, not such a law, or numbers that are negative.
    """

    station: StationOrName
    law: Stribeck
    weight: float = 0.0
    inertia_of_bit: float = 0.0

    work, scaled = None, False
    traits = {"dead": True, "known_force": True, "rates": False, "turns": True, "flat": False}

    def __post_init__(self):
        is_known(self, "station", Station)
        instance(self, "law", self.law, Stribeck, "a Stribeck(...)")
        for field, unit in (("weight", "N"), ("inertia_of_bit", "kg m^2")):
            value = number(
                self, field, getattr(self, field), f"a number from 0 on ({unit})", lambda x: 0 <= x < math.inf
            )
            store(self, **{field: value})

    def inertia(self, rod):
        """See `Action`."""
        return (0.0, np.array([0.0, 0.0, self.inertia_of_bit])) if self.inertia_of_bit else None

    def resists(self, speed):
        """See `Action`."""
        static, dynamic = self.law.torques(self.weight)
        if speed == 0:
            return static, 0.0
        damping = self.station.rod.damping
        drag = self.inertia_of_bit * damping.drag if damping else 0.0
        if self.law.speed is None:
            return dynamic - drag * speed, -drag
        part = (static - dynamic) * math.exp(-speed / self.law.speed)
        return dynamic + part - drag * speed, -part / self.law.speed - drag
