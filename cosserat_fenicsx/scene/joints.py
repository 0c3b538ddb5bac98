"""Joints between stations of rods that touch."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import Numbers, direction, refuse, store
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene import ties
from cosserat_fenicsx.scene.rod import Station, StationOrName, is_known


@dataclass(frozen=True)
class Joint:
    """Two stations share their position and, unless released, their rotation.

    Args:
        first, second: stations at one point, of two rods, or the two ends of a closed one.
        release: None for a rigid joint; the axis of a hinge (inertial, in the reference), which moves with the rods;
            "all" for a ball joint.

    Raises:
        SceneError: not two stations, stations apart from each other, or a release that is none of these.
    """

    first: StationOrName
    second: StationOrName
    release: Numbers | str | None = None

    def __post_init__(self):
        if all([is_known(self, field, Station) for field in ("first", "second")]):
            self._check_place()
        if isinstance(self.release, str):
            if self.release != "all":
                refuse(self, "release", self.release, "None, the direction of an axis, or 'all'")
        elif self.release is not None:
            store(self, release=direction(self, "release", self.release))

    def _check_place(self):
        if (self.first.rod, self.first.s) == (self.second.rod, self.second.s):
            refuse(self, "second", self.second, f"another station than first = {self.first}")
        a, b = (end.rod.curve.position(end.s) for end in (self.first, self.second))
        apart = float(np.linalg.norm(a - b))
        if apart > 1e-9 * max(self.first.rod.length, self.second.rod.length, np.abs(a).max()):
            raise SceneError(
                f"Joint of {self.first} at ({_point(a)}) with {self.second} at ({_point(b)}): they are {apart:.3g} m "
                "apart: expected stations that touch"
            )

    @property
    def rigid(self):
        """Whether nothing is released."""
        return self.release is None

    def ties(self):
        """The scalar constraints of a joint that is not rigid."""
        held = ties.same_place(self.first, self.second)
        return held if self.release == "all" else (*held, *ties.same_axis(self.first, self.second, self.release))


def _point(x):
    return ", ".join(f"{value:.6g}" for value in x)
