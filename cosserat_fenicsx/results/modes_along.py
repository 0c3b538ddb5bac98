"""Modes along a path of equilibria, or over the rates of a steady rotation (Campbell diagram)."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.modes import Modes
from cosserat_fenicsx.results.result import Result, by_name


def _of_each(name):
    return lambda found: np.array([getattr(x, name) for x in found.modes])


def _in_turn(name):
    return lambda found: found.in_turn(_of_each(name)(found))


_OF_ALL = ("point", "mode")


@dataclass(frozen=True, eq=False, repr=False)
class ModesAlong(Result):
    """Result of `Path.modes` and `campbell`: the modes at several states, each followed from one to the next.

    Attributes:
        modes: the `Modes` of every state; rates: (n,) rad/s, of the steady rotations; load_factors: (n,).
        order: (n, modes) indices into each of the `modes`, so that a column is one mode: its eigenvalues continue those
            before linearly, as far as possible.
    """

    modes: tuple[Modes, ...]
    order: np.ndarray

    _on_screen = ("load_factor", "rate", "lowest_frequency", "largest_growth_rate", "stable", "largest_error")
    _quantities = by_name(
        Quantity("load_factor", axes=("point",), getter="load_factors"),
        Quantity("rate", "rate of rotation", unit="rad/s", axes=("point",), getter="rates", shown="rpm"),
        Quantity("lowest_frequency", unit="Hz", axes=("point",), digits=6,
                 getter=lambda found: np.array([x.frequencies.min() for x in found.modes])),
        Quantity("largest_growth_rate", unit="1/s", axes=("point",), digits=5, getter="largest_growth_rates"),
        Quantity("stable", axes=("point",), getter=_of_each("stable")),
        Quantity("largest_error", "largest estimated relative error", axes=("point",), digits=2, short="est. error",
                 getter=lambda found: np.array([x.error.max() for x in found.modes])),
        Quantity("frequency", unit="Hz", axes=_OF_ALL, getter=_in_turn("frequencies")),
        Quantity("inertial_frequency", "frequency seen at rest", unit="Hz", axes=_OF_ALL,
                 getter=_in_turn("inertial_frequencies")),
        Quantity("growth_rate", unit="1/s", axes=_OF_ALL, getter=_in_turn("growth_rates")),
        Quantity("damping_ratio", unit="1", axes=_OF_ALL, getter=_in_turn("damping_ratios")),
    )  # fmt: skip

    scene = property(lambda self: self.modes[0].scene)
    rotates = property(lambda self: any(x.rate is not None for x in self.modes))
    load_factors = property(lambda self: np.array([x.load_factor for x in self.modes]))

    def __len__(self):
        return len(self.modes)

    def __getitem__(self, k) -> Modes:
        return self.modes[k]

    def in_turn(self, values: np.ndarray) -> np.ndarray:
        """(n, modes) values of the modes of every state, put in the order in which a column is one mode."""
        return np.take_along_axis(values, self.order, axis=1)

    @property
    def rates(self) -> np.ndarray:
        """(n,) rad/s; NaN where nothing rotates."""
        if not self.rotates:
            return np.full(len(self), np.nan)
        return np.array([0.0 if x.rate is None else np.linalg.norm(x.rate) for x in self.modes])

    @property
    def eigenvalues(self) -> np.ndarray:
        """(n, modes) 1/s, a column for each mode."""
        return _in_turn("eigenvalues")(self)

    @property
    def largest_growth_rates(self) -> np.ndarray:
        """(n,) 1/s, the largest real part at every state."""
        return np.array([x.growth_rates.max() for x in self.modes])

    @property
    def _over(self):
        return "rate" if self.rotates and np.ptp(self.rates) else "load_factor"

    @property
    def _ranks(self):
        return self.modes[0].comm

    def _about(self):
        return {"kind": type(self).__name__, "title": self.scene.title, "over": self._over}

    def __repr__(self):
        return f"<ModesAlong: {self.order.shape[1]} modes at {len(self)} states, {self._verdict()}>"

    def _verdict(self):
        stable = np.array([x.stable for x in self.modes])
        if stable.all():
            return "stable as far as these modes show"
        first = int(np.argmin(stable))
        return f"first unstable at the {self._over.replace('_', ' ')} {self.value(self._over)[first]:.6g}"

    def _answer(self, units):
        title = f"{self.scene.title}: " if self.scene.title else ""
        yield f"{title}{self.order.shape[1]} modes at {len(self)} states: {self._verdict()}."
        if self.modes[0].caution:
            yield self.modes[0].caution

    def plot(self, file=None, *, seen="rotating", orders=(1, 2, 3), width=None, units="SI"):
        """Chart of frequencies and growth rates over the load factor, or over the rate of rotation (Campbell diagram).

        Args:
            file: its name; None returns the Figure.
            seen: of rotations: frequencies seen in the "rotating" frame, or "inertial" ones, which circular whirl
                has, forward and backward; others are not drawn then.
            orders: multiples of the rate of rotation that are drawn as straight lines.
            width: pixels. units: see `Result`.

        Raises:
            SceneError: another frame, or a file's ending that matplotlib does not know.
        """
        from cosserat_fenicsx.pictures.charts import draw_chart
        from cosserat_fenicsx.pictures.modes_chart import of_modes

        if seen not in ("rotating", "inertial"):
            raise SceneError(f'seen = {seen!r}: expected "rotating" or "inertial"')
        return draw_chart(lambda: of_modes(self, seen, orders), file, self._ranks, width=width, units=units)
