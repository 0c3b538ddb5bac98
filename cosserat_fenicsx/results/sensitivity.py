"""Derivatives of a result by numbers of its scene, and the first-order uncertainty that follows from them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import number
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.scene.parameters import Parameter

_NEGATIVE = 1e-6  # eigenvalues of correlations that were rounded, as in a table


@dataclass(frozen=True, eq=False)
class Sensitivity(Mapping):
    """Derivatives of one quantity: a mapping {name of a parameter: derivative}, arrays of the shape of `value`.

    Attributes:
        value: the quantity, an array; of a path its first axis are the points.
        derivatives: {name: d value/d parameter}, SI units.
        error: {name: estimated absolute error} of the derivatives of the discrete equations: an upper bound of the
            error of the central differences of data and query.
        parameters: {name: value of the parameter, NaN where the name stands for several}. units: {name: its unit}.
        quantity, unit: name and unit of the differentiated quantity, for `print`; empty where unknown.
    """

    value: np.ndarray
    derivatives: dict[str, np.ndarray]
    error: dict[str, np.ndarray]
    parameters: dict[str, float]
    units: dict[str, str]
    quantity: str = "value"
    unit: str = ""

    @classmethod
    def by(cls, parameters, value, derivatives, error, quantity="value"):
        """The derivatives by several `Parameter` objects of a scene, with their values and units."""
        values, units = ({x.name: getattr(x, what) for x in parameters} for what in ("value", "unit"))
        return cls(value, derivatives, error, values, units, quantity)

    def __getitem__(self, name):
        if name not in self.derivatives:
            raise SceneError(f"no derivative by '{name}': {nearest(name, self.derivatives)}")
        return self.derivatives[name]

    def __iter__(self):
        return iter(self.derivatives)

    def __len__(self):
        return len(self.derivatives)

    def relative(self, name: str) -> np.ndarray:
        """The ratio of relative changes of value and parameter, p/q dq/dp; NaN where the value is 0, and where
        the name stands for several numbers."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.value != 0, self[name] * self.parameters[name] / self.value, np.nan)

    def uncertainty(
        self, standard_deviations: Mapping[str | Parameter, float | str], correlation: np.ndarray | None = None
    ) -> "Uncertainty":
        """First-order (linear) propagation: variance = sum_ij q_i s_i rho_ij s_j q_j, with the derivatives q_i.

        Args:
            standard_deviations: {name of a parameter, or the `Parameter`: s_i}, in its unit, or text such as "2 klbf";
                one of each derivative.
            correlation: (m, m) rho of the parameters in the order of `standard_deviations`; None: independent.

        Raises:
            SceneError: a name without a derivative, a standard deviation below 0, or no matrix of correlations.
        """
        standard_deviations = {getattr(x, "name", x): deviation for x, deviation in standard_deviations.items()}
        names = list(standard_deviations)
        for name, given in standard_deviations.items():
            unit = self.units.get(name, "1")
            words = (
                "a standard deviation, 0 or more" if unit in ("", "1") else f"a standard deviation ({unit}), 0 or more"
            )
            standard_deviations[name] = number(
                "uncertainty", f"standard_deviations['{name}']", given, words, lambda x: 0 <= x < np.inf
            )
        rho = np.eye(len(names)) if correlation is None else _correlation(correlation, len(names))
        parts = np.array([self[name] * standard_deviations[name] for name in names])
        products = parts * np.tensordot(rho, parts, 1)
        variance = products.sum(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.where(variance > 0, products / variance, 0.0)
        return Uncertainty(
            self.value, np.sqrt(np.maximum(variance, 0.0)), dict(zip(names, parts, strict=True)),
            dict(zip(names, shares, strict=True)), standard_deviations, self.units, self.quantity, self.unit,
        )  # fmt: skip

    def __str__(self):
        unit = f" {self.unit}" if self.unit else ""
        lines = [f"{self.quantity} = {_text(self.value)}{unit}{_which(self.value)}"]
        for name in self:
            per = f" per {self.units[name]}" if self.units[name] not in ("", "1") else ""
            here = f", at {self.parameters[name]:.6g}" if np.isfinite(self.parameters[name]) else ""
            lines.append(f"d/d({name}) = {_text(self[name])}{unit}{per}{here}")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The first-order uncertainty of a quantity: exact for linear dependence and normal distributions.

    Attributes:
        value: the quantity, an array. standard_deviation: of it, likewise.
        parts: {name: derivative times standard deviation of the parameter}, with its sign.
        shares: {name: share of the variance}, which add up to 1; 0 where nothing varies. With correlations a share may
            be negative.
        given: {name: standard deviation of the parameter}; units: {name: its unit}.
        quantity, unit: see `Sensitivity`.
    """

    value: np.ndarray
    standard_deviation: np.ndarray
    parts: dict[str, np.ndarray]
    shares: dict[str, np.ndarray]
    given: dict[str, float]
    units: dict[str, str]
    quantity: str = "value"
    unit: str = ""

    def __str__(self):
        unit = f" {self.unit}" if self.unit else ""
        size = f"{_text(self.value)} +- {_text(self.standard_deviation)}{unit}{_which(self.value)}"
        lines = [f"{self.quantity} = {size} (one standard deviation, first order)"]
        for name, given in self.given.items():
            unit = f" {self.units[name]}" if self.units[name] != "1" else ""
            lines.append(f"  {_text(100 * self.shares[name], 3)} % from {name} +- {given:.6g}{unit}".rstrip())
        return "\n".join(lines)


def _correlation(given, count):
    try:
        rho = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        rho = np.empty(0)
    if rho.shape != (count, count) or not np.allclose(rho, rho.T) or not np.allclose(np.diag(rho), 1):
        raise SceneError(
            f"uncertainty: correlation = {given!r}: expected a symmetric matrix ({count}, {count}) with ones on its "
            "diagonal, or None"
        )
    least = np.linalg.eigvalsh(rho).min(initial=1.0)
    if least < -_NEGATIVE:
        raise SceneError(
            f"uncertainty: correlation = {given!r}: its least eigenvalue is {least:.3g}, with which variances are "
            "negative: expected a matrix whose eigenvalues are 0 or more"
        )
    return rho


def _text(values, digits=6):
    """A number, or the last of several points."""
    last = np.asarray(values)
    if last.ndim:
        last = last[-1]
    return np.array2string(last, precision=digits, formatter={"float_kind": lambda x: f"{x:.{digits}g}"})


def called(query):
    """The name of a function, for the `quantity` that it computes."""
    name = getattr(query, "__name__", "")
    return name if name.isidentifier() else "value"


def _which(values):
    """Which of several values `_text` shows."""
    return f", the last of {len(values)}" if np.ndim(values) and len(values) > 1 else ""
