"""What acts on the rods of a scene and holds them, as plain data for drawings.

Actions are read by the units of their data, whatever their class: a vector in N is a force, one in N/m a force along
the rod, a number in N/m a spring.
"""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.scene.signals import at, sample_times, signals_of
from cosserat_fenicsx.scene.supports import Hinge, Prescribed, Roller

# Samples along a rod of a load on it.
_SAMPLES = 33
_POINT_LOADS = {"N": "force", "N m": "moment"}
_LINE_LOADS = {"N/m": "line force", "N m/m": "line moment"}
_DEVICES = {"N/m": "spring", "N m/rad": "turning spring", "N s/m": "dashpot", "N m s/rad": "dashpot"}


@dataclass(frozen=True)
class Mark:
    """A support, a joint or a load to be drawn.

    Attributes:
        kind: "clamp", "pin", "hinge", "roller", "moved"; "force", "moment", "spring", "turning spring", "dashpot",
            "mass"; "line force", "line moment"; "joint", "hinge joint", "ball joint".
        station: where, or None of a load along a rod.
        rod: of a load along a rod; None of one on all rods.
        vector: force or moment, or along a rod (n, 3) of them at even arc lengths; the axis of a hinge, the normal of a
            roller, the direction of a spring; inertial, in the reference.
        unit: of the vector.
        turns: whether the vector turns with the section. arm: from the station to where a force acts, which turns with
            the section, in the reference, m.
    """

    kind: str
    station: object = None
    rod: object = None
    vector: np.ndarray = None
    unit: str = ""
    turns: bool = False
    arm: np.ndarray = None


def supports_of(scene):
    """The `Mark`s of the supports."""
    return [_support(support) for support in scene.supports]


def _support(support):
    if support.clamps:
        return Mark("clamp", support.station)
    if isinstance(support, Prescribed):
        now = at(support, 0.0)
        return Mark("moved", support.station, vector=None if now.displacement is None else np.array(now.displacement))
    if isinstance(support, Hinge):
        return Mark("hinge", support.station, vector=np.array(support.axis))
    if isinstance(support, Roller):
        return Mark("roller", support.station, vector=np.array(support.normal))
    return Mark("pin", support.station)


def joints_of(scene):
    """The `Mark`s of the joints."""
    return [
        Mark("joint", joint.first) if joint.rigid
        else Mark("ball joint", joint.first) if joint.release == "all"
        else Mark("hinge joint", joint.first, vector=np.array(joint.release))
        for joint in scene.joints
    ]  # fmt: skip


def loads_of(load, scene, factor=1.0, time=None):
    """The `Mark`s of a load or another action; none where it is zero, or where drawings know no sign for it.

    Args:
        load: one of `scene.loads`.
        factor: the load factor, which multiplies it if it is scaled.
        time: s; None for the time at which a load that depends on time is largest.
    """
    times = sample_times(load, scene.horizon) if time is None and signals_of(load) else [time or 0.0]
    found = max((_marks(at(load, t), scene, factor if load.scaled else 1.0) for t in times), key=_size)
    return [mark for mark in found if mark.kind in _DEVICES.values() or mark.kind == "mass" or _size([mark]) > 0]


def _size(marks):
    return max((float(np.abs(mark.vector).max()) for mark in marks if mark.unit), default=0.0)


def _marks(load, scene, factor):
    if load.tube() is not None:  # drawn as what it is, and its stiffness is none of a spring
        return []
    if load.station is not None:
        return _at_station(load, load.station, factor)
    rods = [rod for rod in scene.rods if load.acts_on(rod)]
    if load.rod is None:
        return _along(load, rods[0], factor, None)[:1] if rods else []
    return _along(load, load.rod, factor, load.rod)


def _at_station(load, station, factor):
    data = [(x.unit, np.reshape(x.value, (-1, x.size))[0]) for x in load.data(station.rod, np.array([station.s]))]
    found = {unit: value for unit, value in data}
    arm, direction = found.get("m"), found.get("1")
    marks = [
        Mark(_POINT_LOADS[unit], station, vector=factor * value, unit=unit, turns=load.follows,
             arm=arm if unit == "N" and arm is not None and len(arm) == 3 else None)
        for unit, value in data if unit in _POINT_LOADS and len(value) == 3
    ]  # fmt: skip
    devices = [_DEVICES[unit] for unit, value in data if unit in _DEVICES and len(value) == 1 and value[0] > 0]
    if devices:
        marks.append(Mark(devices[0], station, vector=direction))
    if load.inertia(station.rod) is not None:
        marks.append(Mark("mass", station))
    return marks


def _along(load, rod, factor, drawn_on):
    s = np.linspace(0, rod.length, _SAMPLES)
    return [
        Mark(_LINE_LOADS[x.unit], rod=drawn_on, vector=factor * np.broadcast_to(x.value, (_SAMPLES, 3)), unit=x.unit)
        for x in load.data(rod, s)
        if x.unit in _LINE_LOADS and x.size == 3
    ]


def has_sign(load, scene):
    """Whether drawings have a sign for a load, whatever its size."""
    return bool(_marks(at(load, 0.0), scene, 1.0))
