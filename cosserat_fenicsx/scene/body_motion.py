"""The motion of a rigid body from a table of its six degrees of freedom: what it imposes on a rod that ends on it.

A vessel, a shaking table or a robot's flange is recorded as three displacements and three angles over time. A support
on it moves by the displacement of its own point, which the angles change where it is off the body's reference point.
"""

from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import Rows, refuse, store
from cosserat_fenicsx.kinds import Several
from cosserat_fenicsx.parts import FileName, FunctionOfTime, Limits, Number
from cosserat_fenicsx.scene.signals import read_table

_COLUMNS = "seven columns: time (s), three displacements (m), roll, pitch and yaw"


class _TableOrFile(FileName):
    """Rows of numbers, which its owner checks, or the name of a file."""

    words, class_ = "rows of numbers, or the name of a file", object


_Table = Annotated[Rows | str | PathLike[str], _TableOrFile()]
_Point = Annotated[tuple, Several("length")]
_FadeIn = Annotated[float, Number("time", Limits(0, what="a time"))]


@dataclass(frozen=True)
class _OfBody(FunctionOfTime):
    """Cubic splines through the rows of a table, which is held before the first and after the last row."""

    def validate(self):
        table = self.table
        if isinstance(table, str | PathLike):
            table = read_table(self, "table", table, 7, _COLUMNS)
        try:
            table = np.array(table, dtype=float)
        except (TypeError, ValueError):
            refuse(self, "table", self.table, f"numbers in {_COLUMNS}")
        if table.ndim != 2 or table.shape[1] != 7 or len(table) < 4 or not np.isfinite(table).all():
            refuse(self, "table", self.table, f"at least four rows of finite numbers in {_COLUMNS}")
        if not (np.diff(table[:, 0]) > 0).all():
            refuse(self, "table", self.table, "ascending times (s) in its first column")
        turn = 360.0 if self.degrees else 2 * np.pi
        table[:, 4:] = np.unwrap(table[:, 4:], axis=0, period=turn)  # headings that are kept within a turn
        if np.abs(np.diff(table[:, 4:], axis=0)).max() > turn / 4:
            refuse(self, "table", self.table, "angles that change by at most a quarter of a turn from row to row; "
                   "degrees = True where they are degrees")  # fmt: skip
        store(self, table=tuple(map(tuple, table.tolist())))

    @cached_property
    def _spline(self):
        from scipy.interpolate import CubicSpline

        table = np.array(self.table)
        if self.degrees:
            table[:, 4:] = np.radians(table[:, 4:])
        return CubicSpline(table[:, 0], table[:, 1:])

    @cached_property
    def _vectors(self):
        """(n, 3) rotation vectors of the rows, which change by less than half a turn from row to row."""
        found = [np.zeros(3)]
        for t in self._spline.x:
            found.append(_nearest(self._at(t)[1].as_rotvec(), found[-1]))
        return np.array(found[1:])

    def _at(self, t):
        """The displacement (3,) of the reference point, m, and the rotation, faded in."""
        from scipy.spatial.transform import Rotation

        times = self._spline.x
        x = min(max((t - times[0]) / self.fade_in, 0.0), 1.0) if self.fade_in else 1.0
        share = x**3 * (10 - 15 * x + 6 * x**2)  # smooth up to the acceleration
        values = share * self._spline(min(max(t, times[0]), times[-1]))
        return values[:3], Rotation.from_euler("ZYX", values[:2:-1])

    @property
    def jumps(self):
        """Where it is not smooth, s: at the ends of the table."""
        return self.table[0][0], self.table[-1][0]


@dataclass(frozen=True)
class BodyDisplacement(_OfBody):
    """The displacement, m, inertial, of a point of a rigid body whose six degrees of freedom a table holds over time.

    The body is turned by Rz(yaw) Ry(pitch) Rx(roll). Between the rows are cubic splines; before the first and after the
    last row it stays as it is there. For a `Prescribed` support, with `BodyRotation` of the same table.

    Args:
        table: (n, 7) rows of time (s), three displacements of the reference point (m, inertial), roll, pitch and yaw;
            or the name of a .csv file of these columns.
        degrees: whether the angles are degrees, not radians.
        point: the point in the reference position, m, as a rod's end that is held by the body.
        about: the reference point of the table, m, in the reference position.
        fade_in: over this time, s, from the first row on, the motion grows smoothly from none, so that it may begin
            from rest.

    Raises:
        SceneError: a file that cannot be read, other columns, fewer than four rows, times that do not ascend, or angles
            that change by more than a quarter of a turn from row to row.
    """

    table: _Table
    degrees: bool
    point: _Point
    about: _Point = (0.0, 0.0, 0.0)
    fade_in: _FadeIn = 0.0

    def __call__(self, t: float) -> tuple:
        """The displacement at t."""
        moved, turn = self._at(t)
        arm = np.subtract(self.point, self.about)
        return tuple((moved + turn.apply(arm) - arm).tolist())


@dataclass(frozen=True)
class BodyRotation(_OfBody):
    """The rotation vector, rad, inertial, of a rigid body whose six degrees of freedom a table holds over time.

    Args:
        table, degrees, fade_in: see `BodyDisplacement`.

    Raises:
        SceneError: as `BodyDisplacement`.
    """

    table: _Table
    degrees: bool
    fade_in: _FadeIn = 0.0

    def __call__(self, t: float) -> tuple:
        """The rotation vector at t, which is continuous: of more than half a turn where the body turns on."""
        near = [np.interp(t, self._spline.x, column) for column in self._vectors.T]
        return tuple(_nearest(self._at(t)[1].as_rotvec(), np.array(near)).tolist())


def _nearest(vector, other):
    """Of the rotation vectors of one rotation that which is nearest to another vector."""
    along = vector if np.linalg.norm(vector) > 1e-9 else other  # that of a whole turn has no axis of its own
    axis = along / max(np.linalg.norm(along), 1e-300)
    turns = np.round((other - vector) @ axis / (2 * np.pi))
    return vector + 2 * np.pi * turns * axis
