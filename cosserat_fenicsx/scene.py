"""A scene: rods, what holds them and what acts on them. Knows no solver and no mesh."""

from dataclasses import dataclass

from cosserat_fenicsx.checks import instance
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.loads import LOADS
from cosserat_fenicsx.rod import Rod
from cosserat_fenicsx.supports import SUPPORTS


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything a solver needs to know.

    Args:
        rods: the rods; for now each stands by itself (no joints).
        supports: `Clamp`.
        loads: `Force`, `Moment`, `EccentricForce`, `Weight`; all are multiplied by the load factor.
        title: for tables and pictures.

    Raises:
        SceneError: an empty or inconsistent scene.
    """

    rods: tuple
    supports: tuple
    loads: tuple = ()
    title: str = ""

    def __post_init__(self):
        for field in ("rods", "supports", "loads"):
            value = getattr(self, field)
            if not isinstance(value, list | tuple):
                raise SceneError(f"Scene.{field} = {value!r}: expected a list")
            object.__setattr__(self, field, tuple(value))
        if not self.rods:
            raise SceneError("Scene.rods is empty: expected at least one Rod")
        for i, rod in enumerate(self.rods):
            instance("Scene", f"rods[{i}]", rod, Rod, "a Rod")
        names = [rod.name for rod in self.rods]
        for name in names:
            if names.count(name) > 1:
                raise SceneError(f"Scene.rods: {names.count(name)} rods are named '{name}': expected one each")
        for i, support in enumerate(self.supports):
            instance("Scene", f"supports[{i}]", support, SUPPORTS, "a support such as Clamp(rod.start)")
            self._check_station(f"supports[{i}]", support.station)
        for i, load in enumerate(self.loads):
            if not hasattr(load, "work") or isinstance(load, type):
                instance("Scene", f"loads[{i}]", load, LOADS, "a load such as Force(rod.end, (0, 0, -1))")
            if load.station is not None:
                self._check_station(f"loads[{i}]", load.station)
            else:
                for rod in self.rods:
                    load.check_rod(rod)
        held = {support.station.rod for support in self.supports}
        for rod in self.rods:
            if rod not in held:
                raise SceneError(
                    f"Scene.supports: nothing holds rod '{rod.name}', it is free to move: "
                    f"expected a support such as Clamp({rod.name}.start)"
                )

    def _check_station(self, field, station):
        if station.rod not in self.rods:
            raise SceneError(
                f"Scene.{field} acts at {station}, a station of a rod that is not in the scene: "
                f"expected one of {', '.join(rod.name for rod in self.rods)}"
            )

    def rod(self, name):
        """The rod of that name."""
        return next(rod for rod in self.rods if rod.name == name)
