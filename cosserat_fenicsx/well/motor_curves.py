"""The power curve of a mud motor: speed, pressure and power against the torque on bit, down to where it stalls."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import File, instance, refuse
from cosserat_fenicsx.pictures.charts import COLOURS, draw_chart, legend, scale, stacked, unit_of
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.results.result import Result, by_name
from cosserat_fenicsx.well.tools import MudMotor

_AXES = ("point",)
_SPEED = Quantity("speed", "speed of the rotor", "rad/s", axes=_AXES, shown="rpm")
_TORQUE = Quantity("torque", "torque on bit", "N m", axes=_AXES, shown="kN m")
_PRESSURE = Quantity("pressure", "pressure over motor", "Pa", axes=_AXES, shown="bar")
_POWER = Quantity("power", "power at the bit", "W", axes=_AXES, shown="kW")
_FLOW = Quantity("flow", unit="m^3/s", axes=_AXES, shown="l/min")


@dataclass(frozen=True, eq=False, repr=False)
class PowerCurve(Result):
    """Result of `power_curve`.

    Attributes:
        motor: the `MudMotor`. flow: (n,) m^3/s, of curves one after another. torque: (n,) on bit, N m, in each from 0
            to the stall torque. speed: (n,) of the rotor against the housing, rad/s. pressure: (n,) over the motor, Pa.
            power: (n,) torque times speed, W. efficiency: (n,) of flow times pressure.
    """

    motor: MudMotor
    flow: np.ndarray
    torque: np.ndarray

    axis = _rows_axis = "point"
    _over = "torque"
    _quantities = by_name(_FLOW, _TORQUE, _SPEED, _PRESSURE, _POWER, Quantity("efficiency", axes=_AXES))

    @property
    def speed(self) -> np.ndarray:
        """(n,) rad/s."""
        return self.motor.speed(self.torque, self.flow)

    @property
    def pressure(self) -> np.ndarray:
        """(n,) Pa."""
        return self.motor.pressure(self.torque, self.flow)

    @property
    def power(self) -> np.ndarray:
        """(n,) W."""
        return self.torque * self.speed

    @property
    def efficiency(self) -> np.ndarray:
        """(n,) of flow times pressure."""
        return self.power / (self.flow * self.pressure)

    def __len__(self) -> int:
        return len(self.torque)

    def _about(self):
        return {"kind": "PowerCurve", "slope": self.motor.slope}

    def _answer(self, units):
        for flow in np.unique(self.flow):
            at = np.flatnonzero(self.flow == flow)
            best = at[self.power[at].argmax()]
            said = {name: f"{getattr(self, name)[k] / size:.4g} {unit}" for name, k in (
                ("flow", best), ("speed", at[0]), ("torque", at[-1]), ("power", best))
                for unit, size in [units.on_screen(self._quantities[name])]}  # fmt: skip
            yield (
                f"{said['flow']}: {said['speed']} without load, stalls at {said['torque']}; most power {said['power']}."
            )

    def plot(self, file: File | None = None, *, units: Any = "SI", width: int | None = None):
        """Draw speed, pressure and power over the torque on bit, a line for each flow, and where the motor stalls. With
        a file it is written, otherwise the Figure is returned.

        Args:
            file: .png, .pdf or another format of matplotlib (rank 0 writes).
            units: "SI", "field" or a dict of units by dimensions. width: of the picture, pixels, or None.

        Raises:
            SceneError: matplotlib is missing, or the file's ending is unknown.
        """
        return draw_chart(self._figure, file, world(), units=units, width=width)

    def _figure(self):
        figure, axes = stacked(8, [2.2] * 3)
        heading, across = scale(_TORQUE, self.torque)
        unit, size = unit_of(_FLOW)
        for panel, quantity in zip(axes, (_SPEED, _PRESSURE, _POWER), strict=True):
            values = getattr(self, quantity.name)
            label, high = scale(quantity, values)
            for k, flow in enumerate(np.unique(self.flow)):
                at, look = self.flow == flow, {"color": COLOURS[k % len(COLOURS)]}
                panel.plot(self.torque[at] / across, values[at] / high, label=f"{flow / size:.4g} {unit}", **look)
                panel.plot(
                    self.torque[at][-1] / across, values[at][-1] / high, "x", markersize=7, markeredgewidth=2, **look
                )
            panel.plot([], [], "x", color="black", label="stalls")
            panel.set(ylabel=label, ylim=(0, None), xlim=(0, 1.03 * self.torque.max() / across))
        legend(*axes)
        axes[-1].set_xlabel(heading)
        figure.suptitle(f"{self.motor.name}: the bit's torque slows it down, and stalls it")
        return figure

    def __repr__(self):
        return f"<PowerCurve: {self.motor.name}, {len(np.unique(self.flow))} flows>"


def power_curve(motor: MudMotor, flows: Any = None, points: int = 41) -> PowerCurve:
    """Speed, pressure, power and efficiency of a motor over the torque on bit, from none to where it stalls.

    Args:
        motor: a `MudMotor`. flows: m^3/s or text, such as "2400 l/min", one or several; None for the motor's own, at
            the start. points: torques of each.

    Raises:
        SceneError: no flow, or one at which the motor stalls without load.
    """
    instance("power_curve", "motor", motor, MudMotor, "a MudMotor")
    several = [motor.flow_at(0.0)] if flows is None else flows if isinstance(flows, list | tuple) else [flows]
    if not several:
        refuse("power_curve", "flows", flows, "a flow (m^3/s) or several, or None for the motor's own")
    flows = [replace(motor, flow=flow).flow_at(0.0) for flow in several]
    for flow in flows:
        if motor.stall_torque(flow) <= 0:
            refuse("power_curve", "flows", flow, "a flow (m^3/s) that turns the motor without load, above "
                   f"{motor.lost_torque * motor.leakage / motor.per_radian:.3g}")  # fmt: skip
    torque = np.concatenate([np.linspace(0.0, motor.stall_torque(flow), points) for flow in flows])
    return PowerCurve(motor, np.repeat(flows, points), torque)
