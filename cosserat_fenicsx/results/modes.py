"""The result of natural vibrations."""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.results.shapes import Shapes, in_words, largest_error

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
        """(n,) rates 1/s: unstable modes grow as exp(growth t); 0 for stable ones. Without what is `left_out`."""
        return np.sqrt(np.maximum(-self.squares, 0.0))

    def label(self, k):
        """See `Shapes`."""
        if self.squares[k] < 0:
            return f"unstable, growth {self.growth[k]:.4g} 1/s"
        return f"{self.frequencies[k]:.4g} Hz" if self.squares[k] else "0 Hz, free motion"

    @property
    def columns(self):
        """See `Shapes`."""
        return {
            "frequency (Hz)": self.frequencies,
            "period (s)": self.periods,
            "growth (1/s)": self.growth,
            "estimated relative error of the squared frequency": self.error,
        }
