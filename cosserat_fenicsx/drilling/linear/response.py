"""Frequency response of a string that rotates steadily: its impedance at the surface, and what the bit does there.

All varies like exp(i w t), w = 2 pi f, about the steady state. The string is the exact waveguide of `stability`, the
lower end has the inertia of the bit and the slope of its law; a bit that cuts couples torsion and axial motion.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from rich.table import Table

from cosserat_fenicsx.checks import Numbers, instance, refuse
from cosserat_fenicsx.drilling.linear.characteristic import (
    Characteristic,
    box_up_to,
    numbers,
    speed_of,
    without_autodriller,
)
from cosserat_fenicsx.drilling.linear.impedances import Parted, State
from cosserat_fenicsx.drilling.linear.roots import all_roots
from cosserat_fenicsx.drilling.linear.stability import ModeShape, shape_of, steady_of
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.stick_slip import SPEED, WEIGHT
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.parts import Number, positive
from cosserat_fenicsx.quantities import Quantities, Quantity
from cosserat_fenicsx.results.result import Charted

# Names of speed and load at the surface and at the bit, by kind; units of a speed and a load.
_ENDS = {
    "torsion": ("drive speed", "surface torque", "bit speed", "torque on bit"),
    "axial": ("top velocity", "hook load", "bit velocity", "weight on bit"),
}
_UNITS = {"torsion": ("rad/s", "N m"), "axial": ("m/s", "N")}
# Quantities of a speed and a load on screens and in charts, by kind.
_SHOWN = {
    "torsion": (SPEED, Quantity("torque", unit="N m", shown="kN m")),
    "axial": (Quantity("velocity", unit="m/s"), WEIGHT),
}
# The source in the middle of a string.
_TOOL = "tool force"
# Frequencies without given ones: how many, and up to which one, Hz. Peaks that are listed. Growth over the spacing of
# modes that is rounding.
_MANY, _HIGHEST, _PEAKS, _NEUTRAL = 2000, 10.0, 12, 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse(Charted):
    """Result of `frequency_response`; `plot` draws a Bode chart of what surface and bit feel of a load on bit, with the
    impedances of string and drive, which absorb each other's waves where both are equal.

    Attributes:
        scene: the `Drilling`. kind: "torsion" or "axial". speed: of the steady rotation, rad/s.
        frequency: (n,) Hz. impedance: (n,) complex, N m s/rad or N s/m: of the string at the surface, bit and rock
            included, below the drive or hook: torque handed down over the drive's speed; axially minus the change of
            the hook load over the velocity downwards. drive_impedance: (n,) complex, of the drive or hook above; NaN
            where it is rigid.
        roots: (k,) complex, 1/s, of the modes up to the highest frequency. equation: the characteristic function.
    """

    scene: Drilling
    kind: str
    speed: float
    frequency: np.ndarray
    impedance: np.ndarray
    drive_impedance: np.ndarray
    roots: np.ndarray
    equation: Characteristic
    _ratios: dict[str, dict[str, np.ndarray]]

    _chart = "drilling.charts.response_figure"
    axis = _rows_axis = "frequency"

    @property
    def ends(self) -> tuple[str, str, str, str]:
        """Names for `transfer`: speed and load at the surface, speed and load at the bit."""
        return _ENDS[self.kind]

    @property
    def shown(self) -> tuple[Quantity, Quantity]:
        """Quantities of a speed and a load, for tables and charts."""
        return _SHOWN[self.kind]

    def transfer(self, source: str, answer: str) -> np.ndarray:
        """(n,) complex ratio of what answers over what moves the string, at each frequency.

        In torsion the names are "drive speed", "surface torque", "bit speed" and "torque on bit"; axially "top
        velocity" (downwards), "hook load", "bit velocity" (downwards) and "weight on bit"; and, as a source, "tool
        force", which drives both sides of an `OscillationTool` apart.

        Args:
            source: a torque or weight on bit is one beside that of the bit's law, with the drive in its place. Speed or
                load at the surface are given, whatever the drive.
            answer: as an answer to the surface, torque or weight on bit are those of the law.

        Raises:
            SceneError: an unknown name, a speed of the bit as the source, or source and answer of the same name.
        """
        for name, field, known in (("source", source, self._ratios), ("answer", answer, self.ends)):
            if field not in known:
                raise SceneError(f"transfer.{name} = {field!r}: {nearest(str(field), known)}")
        if answer not in self._ratios[source]:
            refuse("transfer", "answer", answer, f"one of {', '.join(self._ratios[source])} to {source}")
        return self._ratios[source][answer]

    def mode_of(self, frequency: float) -> ModeShape:
        """The `ModeShape` of the mode whose frequency (Hz) is nearest.

        Raises:
            SceneError: there is no mode up to the highest frequency, or a frequency that is not positive, or above the
                highest one, up to which modes were looked for.
        """
        frequency = Number("frequency", positive()).check("mode_of", "frequency", frequency)
        if frequency > self.frequency.max():
            refuse("mode_of", "frequency", frequency, f"at most {self._highest} Hz, the highest of the response: modes "
                   "were looked for up to it. Ask frequency_response for higher frequencies")  # fmt: skip
        if not len(self.roots):
            raise SceneError(f"mode_of: expected a response that has modes, this one has none up to {self._highest} Hz")
        return shape_of(self.equation, self.roots[np.abs(self.roots.imag - 2 * math.pi * frequency).argmin()])

    @property
    def _highest(self):
        return f"{self.frequency.max():.4g}"

    @property
    def quantities(self):
        """See `Result`: sizes, and phases from -180 to 180 degrees, of the impedance and of the answers to the bit."""
        speed, load = _UNITS[self.kind]
        per = {"N m": "N m s/rad", "N": "N s/m"}[load]
        values = {"impedance": ("impedance at the surface", per, self.impedance)}
        source = self.ends[3]
        for name, ratio in self._ratios[source].items():
            unit = "1" if name in self.ends[1] else f"{speed}/({load})"
            values[name.replace(" ", "_")] = f"{name} per {source}", unit, ratio
        found = [Quantity("frequency", unit="Hz", axes=("frequency",))]
        for name, (label, unit, ratio) in values.items():
            found.append(
                Quantity(f"{name}_size", label, unit, axes=("frequency",), getter=lambda _, r=ratio: np.abs(r))
            )
            found.append(
                Quantity(f"{name}_phase", f"{label}, phase", "deg", axes=("frequency",),
                         getter=lambda _, r=ratio: np.degrees(np.angle(r)))
            )  # fmt: skip
        known = Quantities(super().quantities)
        known.update({x.name: x for x in found})
        return known

    def __len__(self) -> int:
        return len(self.frequency)

    def _about(self):
        about = {"kind": "FrequencyResponse", "motion": self.kind, "speed": self.speed, "cautions": self.cautions}
        return about | {"growth": self.roots.real.tolist(), "mode_frequency": (self.roots.imag / 2 / np.pi).tolist()}

    @property
    def cautions(self) -> list[str]:
        """Sentences: modes that grow, and what is left out."""
        growing = _growing(self.roots, self.equation)
        told = [f"The steady state is unstable: {growing}; the motion leaves it"] if growing else []
        return told + without_autodriller(self.scene)

    def _answer(self, units):
        rpm, size = units.on_screen(SPEED)
        low, high = f"{self.frequency.min():.4g}", self._highest
        at = f", at {self.speed / size:.4g} {rpm}" if self.speed else ""
        yield f"Response in {self.kind} to the bit at {len(self)} frequencies from {low} to {high} Hz{at}."
        yield from (f"{caution}." for caution in self.cautions)
        surface, peaks = self.ends[1], self._peaks
        if len(peaks):
            size = np.abs(self.transfer(self.ends[3], surface))
            k = peaks[size[peaks].argmax()]
            yield f"Most of the bit is seen in the {surface} at {self.frequency[k]:.4g} Hz: {size[k]:.3g} times."
            yield f"Below: peaks of the {self.ends[2]}, the strongest {_PEAKS} at most; phases in degrees."

    @property
    def _peaks(self):
        """Indices of the strongest peaks of the bit's speed, by frequency."""
        size = np.abs(self._ratios[self.ends[3]][self.ends[2]])
        inside = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
        return np.sort(inside[np.argsort(-size[inside])][:_PEAKS])

    def _table(self, units, rows):
        _, surface, moved, source = self.ends
        torque, speed = self.transfer(source, surface), self.transfer(source, moved)
        (turn, turning), (push, pushing) = map(units.on_screen, self.shown)
        table = Table()
        for heading in ("frequency (Hz)", f"{surface} per {source}", "phase", f"{moved} ({turn} per {push})", "phase"):
            table.add_column(heading, justify="right")
        for k in self._peaks[:rows]:
            moves = f"{abs(speed[k]) / turning * pushing:.4g}"
            phases = (f"{math.degrees(np.angle(x[k])):.0f}" for x in (torque, speed))
            table.add_row(f"{self.frequency[k]:.4f}", f"{abs(torque[k]):.4g}", next(phases), moves, next(phases))
        return table if table.row_count else None

    def __repr__(self):
        return f"<FrequencyResponse: {self.kind}, {len(self)} frequencies up to {self._highest} Hz>"


def frequency_response(
    scene: Drilling,
    frequencies: Numbers | None = None,
    *,
    kind: str = "torsion",
    speed: float | None = None,
    unstable: bool = False,
) -> FrequencyResponse:
    """Small forced vibrations about steady drilling, by exact waves: what of the bit is seen at the surface, and which
    impedance the drive sees.

    Slope of the bit's law, friction at the wall, drag, and the `damping_time` of components are those of `stability`.
    Axially a bit that does not cut stands on its rock if it has a weight, and is free without one.

    Args:
        scene: a `Drilling`. frequencies: Hz, (n,); None for 2000, even up to 10 Hz.
        kind: "torsion", or "axial". speed: of the steady rotation, rad/s; None for that of the drive.
        unstable: compute the response of a state that is not stable, too: then it is what a bit would do that is held
            to small motions.

    Raises:
        SceneError: a mode grows up to the highest frequency; frequencies that are not positive; a speed that is needed
            and missing; see `stability`.
        NotConverged: the roots that were found are fewer than those counted.
    """
    instance("frequency_response", "scene", scene, Drilling, "a Drilling(...)")
    if frequencies is None:
        frequencies = np.linspace(0.0, _HIGHEST, _MANY + 1)[1:]
    frequency = numbers("frequency_response", "frequencies", frequencies, "frequency", positive())
    steady = steady_of("frequency_response", scene, kind)
    speed = speed_of("frequency_response", scene, speed)
    f = steady.equation(steady.parameters(speed, scene.bit and scene.bit.weight))
    top = 2 * math.pi * float(frequency.max())
    roots, _ = all_roots(f, box_up_to(steady, top)(f), f.spacing)
    growing = _growing(roots, f)
    if growing and not unstable:
        raise SceneError(f"frequency_response: the steady state is unstable, {growing}: expected a drive, speed or "
                         "weight at which `stability` finds no such mode, or unstable=True")  # fmt: skip
    guide = next(guide for guide in f.guides if guide.kind == kind)
    s = 2j * math.pi * frequency
    below = f.below(s)[f.guides.index(guide)]
    impedance, drive, ratios = _ratios(guide, s, below, _ENDS[kind])
    for k, tool in enumerate(x for x in guide.parts if isinstance(x, Parted) and x.spring):
        ratios[_TOOL if not k else f"{_TOOL} {k + 1}"] = _from_tool(
            guide, s, below, guide.parts.index(tool), _ENDS[kind]
        )
    return FrequencyResponse(scene, kind, speed, frequency, impedance, drive, roots, f, ratios)


def _growing(roots, f):
    """The modes that grow, in words, or ""."""
    growing = roots[roots.real > _NEUTRAL * f.spacing]
    if not len(growing):
        return ""
    worst = growing[growing.real.argmax()]
    text = f"a mode of {worst.imag / 2 / math.pi:.4g} Hz grows by {worst.real:.3g} 1/s"
    return text + (f", and {len(growing) - 1} more grow" if len(growing) > 1 else "")


def _from_tool(guide, s, below, place, names):
    """{answer: ratio} to the force of a tool between both sides of a place in a guide, in the order of its parts."""
    stands, parts = np.isinf(below), guide.parts
    finite = np.where(stands, 1.0, below)
    above = replace(guide, parts=parts[:place]).bottom(s)
    spring, start, nothing = parts[place].spring, guide.start(s), np.zeros_like(s)

    def at_bit(w, P):
        end = State(w, P, nothing, nothing).scaled(parts[place - 1].impedance)
        for part in parts[place + 1 :]:
            end = part.down(s, end)
        return np.array([end.w, end.P, np.where(stands, end.w, finite * end.w - end.P)]) * np.exp(end.size)

    # both sides move by the wave from above, below also by the force: w below = w above - s/k (P - 1)
    moved, driven = at_bit(above.w - s / spring * above.P, above.P), at_bit(s / spring, nothing)
    share = -driven[2] / moved[2]
    w, P, _ = share * moved + driven
    per = share * np.exp(start.size - above.size)
    load = np.where(stands, P, (finite - guide.inertia * s) * w)
    return dict(zip(names, (per * start.w, -per * start.P, w, load), strict=True))


def _ratios(guide, s, below, names):
    """Impedance at the surface, that of the drive, and {source: {answer: ratio}} of a guide that ends in `below`."""
    speed_above, load_above, speed, load = names
    sign = 1.0 if guide.kind == "torsion" else -1.0  # a hook load is minus the force handed down
    stands = np.isinf(below)
    lower, own = np.where(stands, 1.0, below), guide.factor(s)

    def misfit(state):  # of the condition at the lower end
        return np.where(stands, state.w, lower * state.w - state.P)

    # moved from the bit, with the drive in its place
    start, end = guide.start(s), guide.bottom(s)
    per = np.where(stands, 0.0, -1 / misfit(end))
    grown = own * np.exp(start.size - end.size)
    from_bit = {speed_above: per * grown * start.w, load_above: sign * per * grown * start.P, speed: per * end.w}
    drive = np.where(start.w == 0, np.nan, -start.P / np.where(start.w == 0, 1.0, start.w))
    # moved from the top: with the states below a unit speed and below a unit load there, the determinant of which is 1
    one, zero = np.ones_like(s), np.zeros_like(s)
    by_speed, by_load = guide.below_top(s, one, zero), guide.below_top(s, zero, one)
    impedance = -misfit(by_speed) / misfit(by_load) * np.exp(by_speed.size - by_load.size)
    reached = -own / misfit(by_load) * np.exp(-by_load.size)
    from_speed = {
        load_above: sign * impedance,
        speed: np.where(stands, 0.0, reached),
        load: np.where(stands, reached, (lower - guide.inertia * s) * reached),
    }
    by_load = {speed_above: sign / impedance} | {x: from_speed[x] * sign / impedance for x in (speed, load)}
    return impedance, drive, {load: from_bit, speed_above: from_speed, load_above: by_load}
