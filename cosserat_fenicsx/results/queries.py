"""Queries that paths and motions share: largest forces and stresses, reactions, stresses; also in sentences.

And derivatives of a result by numbers of its scene, and the first-order uncertainty that follows from them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.results.compared import cell_nodes, in_turn
from cosserat_fenicsx.results.result import OnNodes
from cosserat_fenicsx.scene.action import describe, some_of
from cosserat_fenicsx.scene.parameters import Parameter
from cosserat_fenicsx.scene.rod import Station, StationOrName
from cosserat_fenicsx.scene.scene import METAL
from cosserat_fenicsx.scene.stresses import Stress
from cosserat_fenicsx.scene.supports import Support

# Sampling intervals of an element, per degree of its polynomials.
_PLACES = 6
# Relative differences, and values relative to the largest of the same unit, below this are rounding.
_ROUNDING = 1e-6
_UNITS = {
    "bending moment": "N m",
    "twisting moment": "N m",
    "shear force": "N",
    "tension": "N",
    "compression": "N",
    "normal stress": "Pa",
    "von Mises stress": "Pa",
}
# The strain beyond which no metal is elastic.
_ELASTIC = 0.02
# Share of a motion that is its start.
_EARLY = 0.02
# States that are computed at once.
_BLOCK = 64


@dataclass(frozen=True, repr=False)
class Largest:
    """The largest value of a quantity: its size (N m, N or Pa) and its unit, its station, and the index of the point or
    time. `print` shows the size."""

    size: float
    station: Station
    point: int
    unit: str = ""

    def __str__(self):
        return f"{self.size:.4g} {self.unit}"

    def __repr__(self):
        return f"<{self} at {self.station}, point {self.point}>"


class Extremes(OnNodes):
    """The largest contact forces, moments and stresses of a path or a motion."""

    def largest(self, first: int = 0) -> dict[str, "Largest"]:
        """The largest contact forces, moments and stresses over all points of a path (or times of a motion) and all
        rods.

        Both sides of jumps are included, and places between the nodes. Values are for the mesh used: the `errors` of a
        path say how accurate n and m are; `tol` of a motion limits the error of positions only. With t = d_3:
        bending ``|m - (m.t) t|``, twisting ``|m.t|``, shear ``|n - (n.t) t|``, tension ``n.t``, compression ``-n.t``.

        Args:
            first: the state from which on, such as one of a motion after a shock at its start.

        Returns:
            {quantity: `Largest`}, the quantities "bending moment", "twisting moment" (N m), "shear force", "tension",
            "compression" (N) and, of the rods that know them, "normal stress" (its size) and "von Mises stress" (Pa,
            see `stress`), without those that are zero up to rounding.
        """
        found = {what: Largest(0.0, None, 0, unit) for what, unit in _UNITS.items()}
        inside = np.linspace(0, 1, _PLACES * self.degree + 1)
        for first in range(range(len(self))[first] if first else 0, len(self), _BLOCK):
            which = range(first, min(first + _BLOCK, len(self)))
            contact = np.array([self._contact_of(k) for k in which])
            for i, rod in enumerate(self.scene.rods):
                for what, sizes in self._sizes(i, inside, contact[:, self._cells(i)], which).items():
                    most = sizes.max()
                    k, place = np.unravel_index(np.argmax(sizes >= most - _ROUNDING * abs(most)), sizes.shape)
                    if sizes[k, place] > (1 + _ROUNDING) * found[what].size:
                        s = self._places(i, inside).ravel()[place]
                        found[what] = Largest(float(sizes[k, place]), rod.at(s), first + int(k), _UNITS[what])
        most = {unit: max(x.size for what, x in found.items() if _UNITS[what] == unit) for unit in _UNITS.values()}
        return {what: x for what, x in found.items() if x.size > _ROUNDING * most[_UNITS[what]]}

    def _places(self, i, inside):
        """(elements, places) arc lengths of places in the elements of the i-th rod, m."""
        breaks = self.layout.breaks[i]
        return (breaks[:-1, None] + np.diff(breaks)[:, None] * inside) * self.scene.rods[i].length

    def _sizes(self, i, inside, contact, which):
        """{quantity: (states, places)} in the elements of the i-th rod, of the states `which`."""
        rod, basis, s = self.scene.rods[i], self.rule.basis(inside), self._places(i, inside)
        nodes, _ = cell_nodes(self.layout, self.degree)[i]
        q = np.einsum("qj,kcji->kcqi", basis, np.array([self._records[k].rq[nodes, 3:] for k in which]))
        q /= np.linalg.norm(q, axis=-1, keepdims=True)
        d = directors(q.reshape(-1, 4)).reshape(*q.shape[:-1], 3, 3) @ rod.curve.frame(s.ravel()).reshape(
            *s.shape, 3, 3
        )
        n, m = np.split(np.einsum("qj,kcji->kcqi", basis, contact), 2, axis=-1)
        n = np.einsum("kcqij,kcqi->kcqj", d, n) * self.scales.force
        m = np.einsum("kcqij,kcqi->kcqj", d, m) * self.scales.moment
        sizes = {
            "bending moment": np.hypot(m[..., 0], m[..., 1]),
            "twisting moment": np.abs(m[..., 2]),
            "shear force": np.hypot(n[..., 0], n[..., 1]),
            "tension": n[..., 2],
            "compression": -n[..., 2],
        }
        if rod.profile.shaped:
            normal, mises = np.zeros((2, *n.shape[:-1]))
            for places, side in ((slice(0, 1), "right"), (slice(1, None), "left")):  # within the element at jumps
                flat = (len(which), -1, 3)
                told = rod.profile.stresses(
                    s[:, places].ravel(), side, n[:, :, places].reshape(flat), m[:, :, places].reshape(flat)
                )
                shape = normal[:, :, places].shape
                normal[:, :, places] = np.nan_to_num(np.maximum(told.axial_max, -told.axial_min)).reshape(shape)
                mises[:, :, places] = np.nan_to_num(told.von_mises).reshape(shape)
            sizes |= {"normal stress": normal, "von Mises stress": mises}
        return {what: values.reshape(len(which), -1) for what, values in sizes.items()}


def largest_in_words(path):
    """`Extremes.largest` as a line of text, and which rods' stresses it cannot know."""
    largest = path.largest()
    told = [f"{what} {x} ({x.station}, {path.when(x.point, '.4g')})" for what, x in largest.items()]
    limits = " (tol limits errors of positions only)" if path.axis == "time" else ""
    line = f"Largest on this mesh{limits}: {'; '.join(told) or 'no force or moment'}."
    return "\n".join([line, *_beyond_metals(largest), *_early_in_words(path, largest), *_unknown_in_words(path)])


def _beyond_metals(largest):
    """A sentence where a normal stress strains a metal more than it stays elastic."""
    stress = largest.get("normal stress")
    material = stress and stress.station.rod.material
    if material and METAL[0] <= material.E <= METAL[1] and stress.size > _ELASTIC * material.E:
        share = f"{stress.size / material.E:.2g} of Young's modulus"
        yield f"Caution: the largest normal stress is {share}: metals have yielded by then, and these rods are elastic."


def _early_in_words(path, largest):
    """A sentence on what of the largest belongs to the start of a motion."""
    times, start = path.along_axis, _EARLY * path.along_axis[-1]
    early = [what for what, x in largest.items() if path.axis == "time" and 0 < times[x.point] <= start]
    if early:
        later = int(np.searchsorted(times, start, side="right"))
        yield (
            f"{some_of(early)}: at the start of the motion, where a load or a motion that begins at once is a shock; "
            f"largest({later}) has those from t = {times[later]:.4g} s on, and a Ramp begins without a shock."
        )


def _unknown_in_words(path):
    """Sentences on rods whose stresses are unknown, where some are known."""
    if not path.knows_stresses:
        return
    fields = {rod.name: path.fields(0, rod) for rod in path.scene.rods}
    for field, what in (("axial_max", "Stresses"), ("von_mises", "Von Mises stresses")):
        names = [name for name, values in fields.items() if np.isnan(values[field]).any()]
        if names:
            why = "a rolled Profile has normal ones alone, and a section without a shape none"
            yield f"{what} of {some_of(names)} are not computed, or not everywhere: {why}."
            fields = {name: values for name, values in fields.items() if name not in names}  # each is named once


# Components below this times the largest force or moment are rounding.
_NO_REACTION = 1e-6


class Reactions(OnNodes):
    """Reactions of a result, from the residual of the equations that it solves.

    Subclasses have `_at_clamp(point, joined)`: (n, 6) force and moment, dimensionless, that hold a clamped point, by
    its index, against internal forces and loads; joined: (rod index, element end) of all rods that share it.
    """

    def reaction(self, support: Support | StationOrName) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment that a support exerts on its rod in every state.

        They are the multipliers of the support's constraint equations. A clamp has none: its reaction balances the
        internal forces of the rods joined there, the loads on that point, and other supports and joints there.

        In a motion they balance loads and momenta over the step that led to a saved state: they belong to the middle of
        this step with "momentum" and "energy", to the middle of the last of its three substeps with "triple-jump", and
        to its end with "generalised-alpha". They are NaN where no step led to the state: at the start, and where a
        motion was lost.

        Args:
            support: one of `result.scene.supports`; or a station with supports, or its name: the sum of their
                reactions.

        Returns:
            force (n, 3), N, and moment (n, 3) about the station, N m, both inertial.

        Raises:
            SceneError: not a support of the scene; or a clamp at whose point an action with memory acts, since its
                force is not stored.
        """
        parts = []
        for i in self.scene.supports_of(support):
            held = self.scene.supports[i]
            parts.append(self._of_clamp(held) if held.clamps else self._of_equations(i))
        exerted = sum(parts)
        force, moment = np.split(exerted, 2, axis=1)
        return force * self.scales.force, moment * self.scales.moment

    def _of_equations(self, which):
        """(n, 6) force and moment, dimensionless, of a support with constraint equations."""
        own = in_turn(len(support.ties()) for support in self.scene.supports)[which]
        return self._stacked("tie_forces")[:, own, 0].sum(axis=1)

    def _of_clamp(self, clamp):
        """(n, 6) force and moment, dimensionless."""
        links = self._connections
        leaders = dict(links.leaders)
        vertex = self.layout.vertex(self.scene, clamp.station)
        point = leaders.get(vertex, vertex)
        joined = [point, *(vertex for vertex, leader in links.leaders if leader == point)]
        for action in self.scene.actions:
            if action.memory and action.station and self.layout.vertex(self.scene, action.station) in joined:
                raise SceneError(
                    f"{describe(clamp)}: its reaction is unknown, since {describe(action)} at the same point has "
                    "memory, and its force is not stored"
                )
        exerted = self._at_clamp(links.clamped.index(point), joined)
        tie_forces = self._stacked("tie_forces")
        for i, (_, *stations) in enumerate(links.ties):
            for k, station in enumerate(stations):
                if station == point:
                    exerted = exerted - tie_forces[:, i, k]
        return exerted


def reactions_in_words(result):
    """The reaction of every support in the last state, one sentence each."""
    contact = result._contact_of(len(result) - 1)
    n = np.linalg.norm(contact[..., :3], axis=-1).max() * result.scales.force
    m = np.linalg.norm(contact[..., 3:], axis=-1).max() * result.scales.moment
    when = f"{'in the step that ends at the' if result.axis == 'time' else 'at the'} {result.when(-1)}"
    for support in result.scene.all_supports:
        try:
            force, moment = (values[-1] for values in result.reaction(support))
        except SceneError as unknown:
            yield f"{unknown}."
            continue
        if np.isfinite(force).all():
            yield f"{describe(support)} exerts {_vector(force, n)} N and {_vector(moment, m)} N m {when}."


def _vector(a, beside):
    """Components as text, with 0 for those that are rounding relative to the largest of them or to `beside`."""
    least = _NO_REACTION * max(np.abs(a).max(), beside)
    return f"({', '.join(f'{x:.6g}' if abs(x) > least else '0' for x in a)})"


_SIDES = ("left", "right")


class Stresses(OnNodes):
    """Stresses from the contact forces and moments, where sections know their shape."""

    def stress(self, station: StationOrName, side: str | None = None) -> Stress:
        """Stresses of the section at a station, Pa; see `scene.stresses` for the theory.

        They include tension, bending, torsion and shear by Saint-Venant, per area of the reference. Where the
        section changes or a point load acts, the two sides of the station differ: by default each stress is the worse
        of both, and a side whose section has no shape is left out. In motions they include the stresses of damping.

        Args:
            station: a `Station` or its name.
            side: "left" towards smaller s, "right" towards larger s; default the worse of both.

        Returns:
            `Stress` of arrays (n,): von_mises, the largest of the section, NaN for a `Profile`; axial_max and
            axial_min, the largest and the smallest normal stress of the section, tension positive.

        Raises:
            SceneError: no such station or side, or the section there is a `Stiffness`, whose shape is not known.
        """
        station = self.station(station)
        if side not in (None, *_SIDES):
            refuse(f"stress at {station}", "side", side, "'left', 'right', or None for the worse of both")
        profile, zero = station.rod.profile, np.zeros(3)
        sections = {where: profile.section(station.s, where) for where in ([side] if side else _SIDES)}
        shaped = [at for at, section in sections.items() if section.stresses(profile.material, zero, zero) is not None]
        if not shaped:
            kinds = " and ".join(sorted({type(section).__name__ for section in sections.values()}))
            raise SceneError(
                f"stress at {station}: the section there is a {kinds}, whose shape is not known: expected a Circle, "
                "a Tube, a Rectangle, a Profile or another section with a shape"
            )
        von_mises, most, least = zip(*(self._stress_on(station, where) for where in shaped), strict=True)
        return Stress(np.fmax.reduce(von_mises), np.fmax.reduce(most), np.fmin.reduce(least))

    def _stress_on(self, station, side):
        d = directors(self.rotation(station)) @ station.rod.curve.frame(station.s)
        contact = self._contact_at(station, side)
        n, m = contact[:, :3] * self.scales.force, contact[:, 3:] * self.scales.moment
        n, m = (np.einsum("kij,ki->kj", d, x)[:, None] for x in (n, m))
        return Stress(*(x[:, 0] for x in station.rod.profile.stresses(np.array([station.s]), side, n, m)))

    @property
    def knows_stresses(self) -> bool:
        """Whether the shape of a section of any rod is known; else `fields` and files have no stresses."""
        return any(rod.profile.shaped for rod in self.scene.rods)


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
