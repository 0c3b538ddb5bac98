"""Interpolation of a motion between its saved states."""

from functools import lru_cache
from types import SimpleNamespace

import numpy as np

from cosserat_fenicsx.pictures.drawing import body_of

# Cubic interpolation is used where the trapezoidal rule on the velocities at both ends of an interval gives the change
# of position to this relative error (a full turn saved six times does) or to this share of the longest rod, which is
# invisible.
_AGREEMENT, _INVISIBLE = 0.1, 2e-3


class Between:
    """A `History` at any time of its duration.

    Between two saved states, positions and quaternions are cubic Hermite polynomials by the values and velocities
    there. Where the velocities do not agree with the change of position, because states were saved too seldom,
    interpolation is linear, and where a section turns by more than half a turn the nearest state is taken.

    Args:
        history: a `History` with at least two times.
    """

    def __init__(self, history):
        self._history, self._times = history, history.times
        self._saved = lru_cache(maxsize=2)(self._read)  # few: all states of a stored motion may exceed the memory
        self._smooth = [self._fits(k) for k in range(len(history) - 1)]

    def _read(self, k):
        """r and q of the saved state k, (N, 7), and their rates, (N, 7), 1/s."""
        record = self._history._records[k]
        rates = record.rates / self._history.time_unit
        return record.rq, np.concatenate([rates[:, :3], _turning(record.rq[:, 3:], rates[:, 3:])], axis=1)

    @property
    def smooth(self):
        """The share of the duration where states were saved often enough for cubic interpolation."""
        steps = np.diff(self._times)
        return float(steps[self._smooth].sum() / steps.sum())

    def bodies(self, t, x, magnify=1.0):
        """The `Body` of every rod at t (s), at arc lengths x (n,) over its length."""
        k = int(np.clip(np.searchsorted(self._times, t, side="right") - 1, 0, len(self._times) - 2))
        h = self._times[k + 1] - self._times[k]
        z = float(np.clip((t - self._times[k]) / h, 0.0, 1.0))
        state, history = SimpleNamespace(rq=self._state(k, z, h)), self._history
        made = []
        for rod in history.scene.rods:
            line, directors = history.sample(state, rod, x)
            moments = []
            for i in (k, k + 1):
                fields = history.fields(i, rod)
                moments.append(np.interp(x, fields["s"] / rod.length, fields["bending_moment"]))
            made.append(body_of(rod, x, line, directors, (1 - z) * moments[0] + z * moments[1], magnify))
        return made

    def _fits(self, k):
        """Whether the change of position agrees with the velocities between the saved states k and k + 1."""
        h = self._times[k + 1] - self._times[k]
        (one, slope), (two, slope_there) = self._saved(k), self._saved(k + 1)
        moved, before, after = two - one, h * slope, h * slope_there
        for part in (slice(0, 3), slice(3, 7)):
            off, *sizes = (
                np.linalg.norm(v[:, part], axis=1).max() for v in ((before + after) / 2 - moved, before, after, moved)
            )
            if off > _AGREEMENT * max(sizes) + _INVISIBLE:
                return False
        return True

    def _state(self, k, z, h):
        """(N, 7) r and q at the share z in [0, 1] of the interval k, of length h (s)."""
        (one, slope), (two, slope_there) = self._saved(k), self._saved(k + 1)
        if self._smooth[k]:
            slopes = z * (1 - z) ** 2 * h * slope - z**2 * (1 - z) * h * slope_there
            return (1 + 2 * z) * (1 - z) ** 2 * one + z**2 * (3 - 2 * z) * two + slopes
        if (np.einsum("ni,ni->n", one[:, 3:], two[:, 3:]) <= 0).any():
            return two if z >= 0.5 else one
        return (1 - z) * one + z * two


def _turning(q, omega):
    """dq/dt = (0, omega) q/2 of quaternions q (..., 4) with angular velocities omega (..., 3), inertial."""
    a, v = q[..., :1], q[..., 1:]
    scalar = -np.einsum("...i,...i->...", omega, v)[..., None]
    return np.concatenate([scalar, a * omega + np.cross(omega, v)], axis=-1) / 2
