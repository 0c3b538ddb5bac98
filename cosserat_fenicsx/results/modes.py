"""The results of linear buckling and of natural vibrations, also along a path or over rates of a steady rotation."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.result import Result, by_name
from cosserat_fenicsx.results.queries import Sensitivity, Uncertainty
from cosserat_fenicsx.results.shapes import Shapes, in_words, largest_error
from cosserat_fenicsx.scene.action import actions_in_words
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
        return (
            f"no critical load factor up to {self.bound:.4g}, where linear extrapolation of the state ends: loads that "
            "only pull or bend have none, and limit loads are found by `solve` (`cosserat run`), which follows the "
            "structure as it bends"
        )

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
            yield (
                f"The loads have a potential: there is no static bifurcation below {self.bound:.7g} (bound) of the "
                "state extrapolated linearly. A structure that bends much may reach a limit load below it, which "
                "`solve` finds."
            )
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
# Growth rates below this many estimated errors, or below this over the size of the eigenvalue, are none; and areas of
# ellipses over those of circles.
_UNSURE, _NO_GROWTH, _NO_WHIRL = 3.0, 1e-9, 1e-3
# Share of the area of a circle above which a motion is one.
_ROUND = 0.99


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Shapes):
    """Result of `modes`.

    Attributes:
        see `Shapes`;
        eigenvalues: (n,) lambda of motions exp(lambda t), 1/s, of the upper half plane, ascending by size (or by the
            distance from `near`); undamped ones by the square omega^2 = -lambda^2. In a steady rotation they are those
            seen in the rotating frame. Zero for free rigid motions.
        error: (n,) estimated relative error: of the squares of undamped modes, of the complex eigenvalues over their
            sizes; NaN where the mesh was given.
        shapes: see `Shapes`; complex where the modes are: the motion is Re(shape exp(lambda t)).
        negative_modes: number of negative eigenvalues of the second variation at that state, as `Path.negative_modes`.
        elements: number of elements of each rod; degree: of the elements.
        conservative: whether the loads have a potential near that state, for all motions that the supports allow. Where
            they have none, undamped modes are those of the symmetric part of K: the smallest square is a lower bound of
            the real parts of omega^2, but the vibrations differ, and flutter is not detected.
        left_out: what resists or follows velocities and is not in the modes, in words; () where nothing is left out.
        rate: (3,) the steady rotation, rad/s, inertial, or None.
        rounding: (n,) estimated relative errors by rounding, and by bounds in place of infinite stiffnesses, alone, as
            of `error`.
    """

    eigenvalues: np.ndarray
    negative_modes: int
    left_out: tuple[str, ...] = ()
    rate: np.ndarray | None = None
    rounding: np.ndarray | float = 0.0

    title = "Natural vibrations"
    _quantities = by_name(
        Quantity("frequency", unit="Hz", axes=("mode",), getter="frequencies", digits=7),
        Quantity("period", unit="s", axes=("mode",), getter="periods", digits=5),
        Quantity("growth_rate", unit="1/s", axes=("mode",), getter="growth_rates", digits=5, noise=1e-300),
        Quantity("damping_ratio", unit="1", axes=("mode",), getter="damping_ratios", digits=4),
        Quantity("motion", axes=("mode",), getter="kind"),
        Quantity("error", "estimated relative error", axes=("mode",), digits=2, short="est. error"),
        Quantity("squares", "squared angular frequency", "rad^2/s^2", axes=("mode",)),
    )

    @property
    def _on_screen(self):
        """Damping and growth only where there are such: the directions of modes need the room."""
        growth = ("damping_ratio", "growth_rate") if self._grows else ()
        motion = ("motion",) if set(self.kind) - {"oscillates"} else ()
        return ("k", "frequency", *growth, *motion, "error", "place", "direction")

    @property
    def _grows(self):
        return self.complex or bool(self.growth_rates.any())

    @property
    def complex(self) -> bool:
        """Whether they are complex modes, of what resists velocities, follows the rods or rotates."""
        return np.iscomplexobj(self.shapes)

    @property
    def caution(self):
        """The limits of the result, in sentences; "" where all of the scene is in the modes."""
        told = []
        if self.left_out:
            more = len(self.left_out) - _NAMED
            names = ", ".join(self.left_out[:_NAMED]) + (f" and {more} more" if more > 0 else "")
            told.append(
                f"Left out: {names}. How the vibrations decay or grow with it, a motion shows (`simulate`)"
                f"{'' if self.complex else ', or `damped=True` where it is smooth'}."
            )
        if not self.conservative and not self.complex:
            told.append(
                "The loads have no potential: these are the vibrations of the symmetric part of the stiffness alone, "
                "and the structure may flutter, which `damped=True` shows."
            )
        return " ".join(told)

    def __repr__(self):
        text = f"{self._in_words()}"
        text += f", {self.negative_modes} negative" if self.negative_modes else ""
        text += f", at the load factor {self.load_factor:g}" if self.load_factor else ""
        return f"<Modes: {text}. {self.caution}>" if self.caution else f"<Modes: {text}>"

    def _in_words(self):
        what = "eigenvalues" if self.complex else "squares"
        return f"{in_words(self.frequencies, 'Hz')}, {what} with {largest_error(self.error)}"

    @property
    def squares(self):
        """(n,) rad^2/s^2: omega^2, below zero where the state is unstable; of complex modes the square of the
        size of lambda."""
        return np.abs(self.eigenvalues) ** 2 if self.complex else -np.square(self.eigenvalues).real

    @property
    def frequencies(self):
        """(n,) Hz; 0 where the motion does not oscillate."""
        return self.eigenvalues.imag / (2 * math.pi)

    @property
    def periods(self):
        """(n,) s; infinite where the frequency is 0."""
        return np.divide(1.0, self.frequencies, out=np.full(len(self), math.inf), where=self.frequencies > 0)

    @property
    def growth_rates(self):
        """(n,) 1/s: modes grow as exp(growth_rate t), and decay where it is negative; 0 where it is within rounding."""
        rates = self.eigenvalues.real
        return np.where(np.abs(rates) > np.abs(self.eigenvalues) * self.rounding, rates, 0.0)

    @property
    def damping_ratios(self):
        """(n,) -Re lambda over the size of lambda: 1 and more for critical damping, negative where the motion grows; 0
        for free ones.

        A real eigenvalue has the ratio 1 (or -1)."""
        sizes = np.abs(self.eigenvalues)
        return np.divide(-self.growth_rates, sizes, out=np.zeros(len(self)), where=sizes > 0) + 0.0

    @property
    def unsure(self):
        """(n,) 1/s: growth rates below this are none: three estimated errors, at least 1e-9 of the eigenvalue."""
        share = np.maximum(_UNSURE * np.fmax(self.error, self.rounding), _NO_GROWTH)
        return np.abs(self.eigenvalues) * share / (1 if self.complex else 2)

    @property
    def kind(self):
        """(n,) "oscillates" (and decays, or neither), "flutter" (oscillates and grows, by more than the estimated
        error), "divergence" (grows without an oscillation), "overdamped" (decays without one), "free"."""
        turns, grows = self.eigenvalues.imag > 0, self.growth_rates > self.unsure
        still = np.where(self.eigenvalues == 0, "free", np.where(grows, "divergence", "overdamped"))
        return np.where(turns, np.where(grows, "flutter", "oscillates"), still)

    @property
    def stable(self) -> bool:
        """Whether no mode grows among those found; without complex modes, whether no mode is negative."""
        grows = bool(np.isin(self.kind, ("flutter", "divergence")).any())
        return not grows and (self.complex or self.negative_modes == 0)

    def whirl(self, k: int, rod=None) -> int:
        """The sense in which mode k turns the axis of a rod (default the first), as seen by an inertial observer.

        The sections move along ellipses across the axis of the steady rotation, or, without one, across the rod at its
        middle. The mean of the enclosed areas decides.

        Returns:
            1 forward (right-handed about that axis, so with the rotation), -1 backward, 0 where no section moves along
            more than a line.
        """
        share = self._roundness(k, self._rows(rod)[1], self.rod(rod))
        return int(np.sign(self._seen_at_rest(k, share))) if abs(share) > _NO_WHIRL else 0

    def _roundness(self, k, rows, rod):
        """The areas of the ellipses of nodes over those of circles: from -1, backward, to 1, in the rotating frame."""
        if self.twists(k):
            return 0.0
        moved = self.shapes[self.number(k), rows, :3]
        axis = rod.curve.frame(rod.length / 2)[:, 2] if self.rate is None else self.rate / np.linalg.norm(self.rate)
        areas = np.imag(np.cross(moved, np.conj(moved)) @ axis).sum()
        across = moved - np.multiply.outer(moved @ axis, axis)
        size = np.sum(np.abs(across) ** 2)
        return areas / size if size > _NO_WHIRL**2 * np.sum(np.abs(moved) ** 2) else 0.0

    def _seen_at_rest(self, k, share):
        """rad/s, forward positive: of a motion along circles in the rotating frame."""
        spin = 0.0 if self.rate is None else np.linalg.norm(self.rate)
        return np.sign(share) * self.eigenvalues[self.number(k)].imag + spin

    @property
    def inertial_frequencies(self):
        """(n,) Hz, as seen by an inertial observer: of whirl along circles in a steady rotation its rate in space; NaN
        of other motions in a rotation, which have several frequencies there."""
        if self.rate is None:
            return self.frequencies
        shares = [self._roundness(k, slice(None), self.rod()) for k in range(len(self))]
        rates = [self._seen_at_rest(k, share) if abs(share) > _ROUND else np.nan for k, share in enumerate(shares)]
        return np.abs(rates) / (2 * math.pi)

    def label(self, k):
        value, kind = self.eigenvalues[k], self.kind[k]
        if kind == "divergence":
            return f"unstable, growth {value.real:.4g} 1/s"
        if kind == "overdamped":
            return f"overdamped, decay {-value.real:.4g} 1/s"
        if kind == "free":
            return "0 Hz, free motion"
        grows = f", flutter: growth {value.real:.4g} 1/s" if kind == "flutter" else ""
        damped = not grows and abs(self.damping_ratios[k]) > _NO_GROWTH
        damping = f", damping ratio {self.damping_ratios[k]:.3g}" if damped else ""
        return f"{self.frequencies[k]:.4g} Hz{grows}{damping}"

    def _answer(self, units):
        title = f"{self.scene.title}: " if self.scene.title else ""
        yield f"{title}Natural frequencies {self._in_words()}."
        state = f"The equilibrium at the load factor {self.load_factor:g}"
        if self.rate is not None:
            state = (
                f"The steady rotation by {np.linalg.norm(self.rate):g} rad/s at the load factor {self.load_factor:g}"
            )
        if self.complex:
            growing = [self.label(k) for k in range(len(self)) if self.kind[k] in ("flutter", "divergence")]
            verdict = f"grows ({'; '.join(growing)})" if growing else "is stable as far as these modes show"
            yield f"{state} {verdict}."
        else:
            verdict = {0: f"no negative mode{' (stable)' if self.conservative else ''}", -1: "a singular stiffness"}
            counted = verdict.get(self.negative_modes, f"{self.negative_modes} negative mode(s) (unstable)")
            yield f"{state} has {counted}."
        if len(self) == 1:
            yield "More modes: modes(scene, 5), or --count 5."
        if self.caution:
            yield self.caution

    @property
    def _caption(self):
        of = "the eigenvalue" if self.complex else "the square of the frequency"
        frame = " Frequencies are those seen in the rotating frame." if self.rate is not None else ""
        grows = " Modes grow as exp(growth_rate t)." if self._grows else ""
        return f"est. error: relative, of {of}.{grows}{frame}"


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
        if seen not in ("rotating", "inertial"):
            raise SceneError(f'seen = {seen!r}: expected "rotating" or "inertial"')
        return self._drawn("pictures.motion_charts.modes_figure", file, units, width, seen, orders)
