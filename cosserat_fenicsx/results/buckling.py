"""The result of linear buckling."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.results.sensitivity import Sensitivity, Uncertainty
from cosserat_fenicsx.results.shapes import Shapes, in_words, largest_error
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
            Where nothing is found it is the largest load factor that is considered, where linear extrapolation ends: a
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
        self, standard_deviations: Mapping[str | Parameter, float], correlation: np.ndarray | None = None
    ) -> Uncertainty:
        """The first-order standard deviation of `load_factors`, with the share of each parameter; see
        `Path.uncertainty`."""
        check_once(self.scene, standard_deviations)
        named = {getattr(x, "name", x): deviation for x, deviation in standard_deviations.items()}
        return self.sensitivity(standard_deviations).uncertainty(named, correlation)

    @property
    def none(self):
        """That there is no critical load factor, in words."""
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
        """See `Shapes`."""
        return f"critical load factor {self.load_factors[k]:.5g}"

    @property
    def columns(self):
        """See `Shapes`."""
        return {"critical load factor": self.load_factors, "estimated relative error": self.error}
