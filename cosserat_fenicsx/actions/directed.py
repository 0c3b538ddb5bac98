"""Shared by springs, dashpots, drag and foundations: checked coefficients, and an optional direction."""

import numpy as np

from cosserat_fenicsx.checks import direction, number, refuse, store
from cosserat_fenicsx.scene.action import vector


def store_coefficients(action, units, expected):
    """Check and store the coefficients of an action: numbers from 0 on, at least one of them not 0.

    Args:
        action: the action, a frozen dataclass.
        units: {field: unit}.
        expected: end of the message if all are 0.

    Raises:
        SceneError: a negative or infinite coefficient, or all are 0.
    """
    for field, unit in units.items():
        value = number(action, field, getattr(action, field), f"a number from 0 on ({unit})", lambda x: 0 <= x < np.inf)
        store(action, **{field: value})
    if not any(getattr(action, field) for field in units):
        refuse(action, next(iter(units)), 0.0, expected)


class Directed:
    """An action with a field `direction`: None where it resists motions in every direction, or the only one, inertial.

    Attributes:
        works: the virtual works without a direction and with one, the latter with the direction as its last datum.
    """

    def _store_direction(self):
        if self.direction is not None:
            store(self, direction=direction(self, "direction", self.direction))

    @property
    def work(self):
        """See `Action`."""
        everywhere, directed = self.works
        return everywhere if self.direction is None else directed

    def _with_direction(self, *data):
        return data if self.direction is None else (*data, vector(self.direction, "1"))

    def _held(self):
        """The displacements that it resists: rows (6,) over (displacement, small rotation), inertial."""
        return np.eye(6)[:3] if self.direction is None else [np.r_[self.direction, 0, 0, 0]]
