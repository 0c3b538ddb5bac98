"""Initial velocities of a motion."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import Numbers, refuse, store, vector
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.rod import Rod, RodOrName, is_known


@dataclass(frozen=True, eq=False)
class InitialVelocity:
    """Velocity of a rod at the time 0.

    Two vectors define a rigid motion: the point `about` has the velocity `linear`, and the rod rotates about it with
    `angular`. Where one of them is a function of the arc length, both are the velocities of each section itself.

    Args:
        rod: the rod.
        linear: m/s, inertial; or a function of arc length (m) that returns it.
        angular: rad/s, inertial; or a function of arc length (m) that returns it.
        about: m, the reference point of the rigid motion; None for the position of the rod's start at the time 0.

    Raises:
        SceneError: not a rod, not three finite numbers, or `about` without a rigid motion.
    """

    rod: RodOrName
    linear: Numbers | Callable[[float], Numbers] = (0.0, 0.0, 0.0)
    angular: Numbers | Callable[[float], Numbers] = (0.0, 0.0, 0.0)
    about: Numbers | None = None

    def __post_init__(self):
        is_known(self, "rod", Rod)
        for field, unit in (("linear", "m/s"), ("angular", "rad/s")):
            if not callable(getattr(self, field)):
                store(self, **{field: vector(self, field, getattr(self, field), unit)})
        if self.about is not None:
            if not self._rigid:
                refuse(self, "about", self.about, "None, since the velocity is a function of arc length")
            store(self, about=vector(self, "about", self.about, "m"))

    @property
    def _rigid(self):
        return not callable(self.linear) and not callable(self.angular)

    def at(self, s, position):
        """Velocities (n, 3), m/s, and angular velocities (n, 3), rad/s, inertial.

        Args:
            s: arc lengths (n,), m; position: of the rod there, (n, 3), m.

        Raises:
            SceneError: a function that does not return three finite numbers; says at which arc length.
        """
        linear, angular = self._along("linear", "m/s", s), self._along("angular", "rad/s", s)
        if self._rigid:
            about = position[0] if self.about is None else np.array(self.about)
            linear = linear + np.cross(angular, position - about)
        return linear, angular

    def _along(self, field, unit, s):
        value = getattr(self, field)
        if not callable(value):
            return np.tile(value, (len(s), 1))
        rows = []
        for x in s:
            try:
                rows.append(vector(self, field, value(float(x)), unit))
            except SceneError as problem:
                raise SceneError(f"{problem}, at s = {x:g} m") from None
        return np.array(rows)
