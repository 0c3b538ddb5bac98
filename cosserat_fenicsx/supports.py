"""What holds a rod."""

from dataclasses import dataclass

from cosserat_fenicsx.checks import instance
from cosserat_fenicsx.rod import Station


@dataclass(frozen=True)
class Clamp:
    """Position and rotation of a station are held as they are in the reference.

    Raises:
        SceneError: not a station.
    """

    station: Station

    def __post_init__(self):
        instance(self, "station", self.station, Station, "a station such as rod.start")


#: Supports by the words of the scene file.
SUPPORTS = (Clamp,)
