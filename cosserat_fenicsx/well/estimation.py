"""Unknowns from readings by least squares, with what outliers do to them.

A reading far from what all others say moves a fit by least squares as far as it likes. Cauchy's loss, whose weights
fall with the square of the distance, finds it: readings more than five deviations from that fit are left out, and the
least squares of the others are the answer. The deviation is 1, as the readings' standard deviations say, or, where all
scatter more, 1.48 times the median distance, which for a normal distribution is the same.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

# Deviations beyond which a reading is an outlier; the largest share of the readings that may be; the scales of Cauchy's
# loss, one after the other, in deviations; the median distance of a normal distribution, over its deviation, inverted.
_FAR, _MOST, _SCALES, _MEDIAN = 5.0, 0.3, (4.0, 2.0, 1.0), 1.4826
_TOLERANCES = {"xtol": 1e-10, "ftol": 1e-12, "gtol": 1e-12}


@dataclass(frozen=True)
class Estimate:
    """Unknowns that fit readings best.

    Attributes:
        values: (m,). jacobian: (k, m) of the residuals of the readings that are kept.
        residuals: (n,) of all readings, in standard deviations. kept: (n,) False for outliers.
        misfit: root of the sum of squares of the k residuals over their excess k - m.
        covariance: (m, m) of the linearised problem, scaled by the misfit; infinite where it is singular.
    """

    values: np.ndarray
    jacobian: np.ndarray
    residuals: np.ndarray
    kept: np.ndarray
    misfit: float
    covariance: np.ndarray

    @property
    def excess(self):
        """Readings that are kept, less unknowns."""
        return len(self.jacobian) - len(self.values)

    @property
    def spread(self):
        """(m,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    def half_widths(self, confidence):
        """(m,) halves of Student's confidence intervals."""
        return student.ppf((1 + confidence) / 2, self.excess) * self.spread

    @property
    def correlation(self):
        """(m, m)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.covariance / np.outer(self.spread, self.spread)


def estimated(residuals, jacobian, start, bounds, leave_out=True, settings=_TOLERANCES):
    """The `Estimate` of unknowns.

    Args:
        residuals: function of the unknowns (m,) that gives (n,) measured less computed values, in standard deviations.
        jacobian: function that gives their derivatives (n, m), or "2-point".
        start: (m,) first values. bounds: two of (m,).
        leave_out: whether outliers are left out. settings: tolerances of `scipy.optimize.least_squares`.
    """

    def fit(kept, first, loss="linear", scale=1.0):
        of_kept = jacobian if isinstance(jacobian, str) else lambda x: jacobian(x)[kept]
        return least_squares(lambda x: residuals(x)[kept], first, of_kept, bounds, loss=loss, f_scale=scale, **settings)

    def outliers(found):
        size = np.abs(residuals(found.x))
        return size > _FAR * max(1.0, _MEDIAN * np.median(size))

    everything = np.full(len(residuals(np.asarray(start, dtype=float))), True)
    found, kept = fit(everything, start), everything
    if leave_out and np.abs(found.fun).max() > _FAR:
        robust = found
        for factor in _SCALES:
            deviation = max(1.0, _MEDIAN * np.median(np.abs(robust.fun)))
            robust = fit(everything, robust.x, "cauchy", factor * deviation)
        far = outliers(robust)
        if 0 < far.sum() <= _MOST * len(far) and (~far).sum() > len(start):
            again = fit(~far, robust.x)
            if np.array_equal(outliers(again), far):  # and not a matter of which ones are left out first
                found, kept = again, ~far
    excess = len(found.fun) - len(found.x)
    misfit = float(np.sqrt(2 * found.cost / excess))
    information = found.jac.T @ found.jac
    try:
        covariance = np.linalg.inv(information) * misfit**2
    except np.linalg.LinAlgError:
        covariance = np.full_like(information, np.inf)
    return Estimate(found.x, found.jac, residuals(found.x), kept, misfit, covariance)
