"""The results of linear buckling and of natural vibrations."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.result import by_name
from cosserat_fenicsx.results.sensitivity import Sensitivity, Uncertainty
from cosserat_fenicsx.results.shapes import Shapes, in_words, largest_error
from cosserat_fenicsx.scene.describe import actions_in_words
from cosserat_fenicsx.scene.parameters import Parameter, check_once


@dataclass(frozen=True, eq=False, repr=False)
class Buckling(Shapes):
    """Result of `buckling`.

    Attributes:
        see `Shapes`;
        load_factors: (n,) critical load factors, ascending from that of the state.
        modes: (n, N, 3) displacements, inertial, of all nodes of all rods in the scene's order; the largest has
            length 1.
        error: (n,) estimated relative error of the load factors; NaN where the mesh was given.
        elements: number of elements of each rod; degree: of the elements.
        conservative: whether the loads have a potential near the state, for all motions that the supports allow. A dead
            moment has none where its section is free to rotate about two axes, nor has a follower load. Without a
            potential a structure may flutter below its first static bifurcation, or without one, which linear
            buckling does not detect.
        bound: no static bifurcation lies below this load factor, whether conservative or not. Where the loads have a
            potential it is the first of `load_factors`. Where they have none it is the load factor at which the
            symmetric part of the second variation becomes singular, which is neither an instability nor a bifurcation.
            Infinite where the supports take the loads and no rod bears any. Where nothing is found it is else the
            largest load factor that is considered, where linear extrapolation ends: a
            rod's tangent has changed by 1.5 there, the contact force of a rod has reached the smallest of its axial
            and shear stiffnesses, or it or the contact moment 1e8 times EI/L^2 or EI/L of that rod.
        extent: that largest load factor; missing: how many load factors were asked for and not found up to it.
    """

    load_factors: np.ndarray
    bound: float
    extent: float
    missing: int
    _differentiated: Callable | None = None

    title = "Linear buckling"
    _on_screen = ("k", "critical_load_factor", "error", "place", "direction")
    _quantities = by_name(
        Quantity("critical_load_factor", axes=("mode",), getter="load_factors", digits=7),
        Quantity("error", "estimated relative error", axes=("mode",), digits=2, short="est. error"),
    )

    @property
    def modes(self):
        """(n, N, 3) see the class."""
        return self.shapes[:, :, :3]

    def sensitivity(self, parameters: Iterable[str | Parameter]) -> Sensitivity:
        """Derivatives of `load_factors` by numbers of the scene, by Rayleigh's quotient at fixed modes.

        Equal load factors must change together, as those of a round column do by its diameter; their modes are checked
        where they are among `shapes`.

        Args:
            parameters: see `Path.sensitivity`.

        Returns:
            Sensitivity: {name: (n,)}, SI units.

        Raises:
            SceneError: as of `Path.sensitivity`; no load factor, or loads without a potential; equal load factors that
                a parameter separates.
        """
        return self._differentiated(self, parameters)

    def uncertainty(
        self, standard_deviations: Mapping[str | Parameter, float | str], correlation: np.ndarray | None = None
    ) -> Uncertainty:
        """The first-order standard deviation of `load_factors`, with the share of each parameter; see
        `Path.uncertainty`."""
        check_once(self.scene, standard_deviations)
        return self.sensitivity(standard_deviations).uncertainty(standard_deviations, correlation)

    @property
    def none(self):
        """That there is no critical load factor, in words."""
        if math.isinf(self.bound):
            return "no critical load factor: no rod bears the loads, which the supports take where they act"
        return f"no critical load factor up to {self.bound:.4g}, where linear extrapolation of the state ends"

    @property
    def caution(self):
        """The limits of the result, in sentences; "" where all that was asked for is found and the loads have a
        potential."""
        fewer = ""
        if self.missing and len(self):
            fewer = (
                f"{len(self)} of the {len(self) + self.missing} load factors asked for: no others are found up to "
                f"{self.extent:.4g}, where linear extrapolation of the state ends."
            )
        if self.conservative:
            return fewer
        found = (
            "the load factors are those of its static bifurcations (divergence) alone"
            if len(self.load_factors)
            else "no static bifurcation (divergence) was found"
        )
        return (
            f"{fewer} The loads have no potential: {found}, and there is none below {self.bound:.7g}. The structure "
            "may flutter at a lower load, which a motion shows (`simulate`), and linear buckling does not."
        ).lstrip()

    def __repr__(self):
        if len(self):
            text = f"critical load factors {in_words(self.load_factors)}, {largest_error(self.error)}"
        else:
            text = self.none
        text += f", from the load factor {self.load_factor:g}" if self.load_factor else ""
        return f"<Buckling: {text}. {self.caution}>" if self.caution else f"<Buckling: {text}>"

    def label(self, k):
        return f"critical load factor {self.load_factors[k]:.5g}"

    def _answer(self, units):
        title = f"{self.scene.title}: " if self.scene.title else ""
        told = f"Critical load factors {in_words(self.load_factors)}, {largest_error(self.error)}"
        yield f"{title}{told if len(self) else self.none[0].upper() + self.none[1:]}."
        if self.conservative and math.isfinite(self.bound):
            yield f"The loads have a potential: there is no static bifurcation below {self.bound:.7g} (bound)."
        if self.caution:
            yield self.caution

    def _more(self, units):
        yield actions_in_words(self.scene)

    @property
    def _caption(self):
        return (
            f"The equilibrium at the load factor {self.load_factor:g}, extrapolated linearly, becomes critical there.\n"
            "est. error: relative, of the load factor.\n"
            "A structure that bends much before it buckles needs `cosserat run`."
        )


# Largest number of things that are left out to name in a sentence.
_NAMED = 6


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Shapes):
    """Result of `modes`.

    Attributes:
        see `Shapes`;
        squares: (n,) omega^2, rad^2/s^2, ascending; below zero the state is unstable; zero for free rigid motions.
        error: (n,) estimated relative error of the squares; NaN where the mesh was given.
        negative_modes: number of negative eigenvalues of the second variation at that state, as `Path.negative_modes`.
        elements: number of elements of each rod; degree: of the elements.
        conservative: whether the loads have a potential near that state, for all motions that the supports allow. Where
            they have none, `squares` are those of the symmetric part of K: the smallest is a lower bound of the real
            parts of omega^2, but the vibrations differ, and flutter is not detected.
        left_out: what resists or follows velocities, in words: the vibrations are those without it. () where the scene
            has nothing of the kind.
    """

    squares: np.ndarray
    negative_modes: int
    left_out: tuple[str, ...] = ()

    title = "Natural vibrations"
    _on_screen = ("k", "frequency", "period", "growth", "error", "place", "direction")
    _quantities = by_name(
        Quantity("frequency", unit="Hz", axes=("mode",), getter="frequencies", digits=7),
        Quantity("period", unit="s", axes=("mode",), getter="periods", digits=5),
        Quantity("growth", unit="1/s", axes=("mode",), digits=4),
        Quantity(
            "error", "estimated relative error of the squared frequency", axes=("mode",), digits=2, short="est. error"
        ),
        Quantity("squares", "squared angular frequency", "rad^2/s^2", axes=("mode",)),
    )
    _caption = (
        "est. error: relative, of the square of the frequency.\n"
        "0 Hz: a free motion, or one that grows as exp(growth t)."
    )

    @property
    def caution(self):
        """The limits of the result, in sentences; "" where the loads have a potential and nothing is left out."""
        told = []
        if self.left_out:
            more = len(self.left_out) - _NAMED
            names = ", ".join(self.left_out[:_NAMED]) + (f" and {more} more" if more > 0 else "")
            told.append(
                f"Left out: {names}. These are the vibrations without what depends on velocities; how they decay or "
                "grow with it, a motion shows (`simulate`)."
            )
        if not self.conservative:
            told.append(
                "The loads have no potential: these are the vibrations of the symmetric part of the stiffness alone, "
                "and the structure may flutter, which a motion shows (`simulate`)."
            )
        return " ".join(told)

    def __repr__(self):
        text = f"{in_words(self.frequencies, 'Hz')}, squares with {largest_error(self.error)}"
        text += f", {self.negative_modes} negative" if self.negative_modes else ""
        text += f", at the load factor {self.load_factor:g}" if self.load_factor else ""
        return f"<Modes: {text}. {self.caution}>" if self.caution else f"<Modes: {text}>"

    @property
    def frequencies(self):
        """(n,) Hz; 0 for unstable modes and free rigid motions."""
        return np.sqrt(np.maximum(self.squares, 0.0)) / (2 * math.pi)

    @property
    def periods(self):
        """(n,) s; infinite where the frequency is 0."""
        return np.divide(1.0, self.frequencies, out=np.full(len(self), math.inf), where=self.frequencies > 0)

    @property
    def growth(self):
        """(n,) rates 1/s: unstable modes grow as exp(growth t); 0 for stable ones. Damping that is `left_out` would
        change them."""
        return np.sqrt(np.maximum(-self.squares, 0.0))

    def label(self, k):
        if self.squares[k] < 0:
            return f"unstable, growth {self.growth[k]:.4g} 1/s"
        return f"{self.frequencies[k]:.4g} Hz" if self.squares[k] else "0 Hz, free motion"

    def _answer(self, units):
        title = f"{self.scene.title}: " if self.scene.title else ""
        told = f"{in_words(self.frequencies, 'Hz')}, squares with {largest_error(self.error)}"
        yield f"{title}Natural frequencies {told}."
        verdict = {0: f"no negative mode{' (stable)' if self.conservative else ''}", -1: "a singular stiffness"}
        counted = verdict.get(self.negative_modes, f"{self.negative_modes} negative mode(s) (unstable)")
        yield f"The equilibrium at the load factor {self.load_factor:g} has {counted}."
        if self.caution:
            yield self.caution
