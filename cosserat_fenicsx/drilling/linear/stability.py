"""Growth of the modes of a string that drills steadily, over speed and weight; their shapes, and other drives."""

import math
import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from rich.table import Table

from cosserat_fenicsx.checks import File, Numbers, instance, number, positive, refuse
from cosserat_fenicsx.drilling.linear.characteristic import (
    Steady,
    box_up_to,
    or_none,
    speeds_and_weights,
    without_autodriller,
)
from cosserat_fenicsx.drilling.linear.frequencies import SoftSpeed, SoftTorque, natural_frequencies, own_rule, with_rule
from cosserat_fenicsx.drilling.linear.excitation import Hfto, oscillations
from cosserat_fenicsx.drilling.linear.impedances import Disc
from cosserat_fenicsx.drilling.linear.limits import fed_waves, limit_speed, searches
from cosserat_fenicsx.drilling.linear.roots import all_roots, follow
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.stick_slip import SPEED, WEIGHT
from cosserat_fenicsx.drilling.top_drive import Matched, Stiff, TopDrive
from cosserat_fenicsx.errors import NotConverged, SceneError, SceneWarning
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.results.result import Result, by_name
from cosserat_fenicsx.units import rpm

# What the answer leaves out.
_SMALL = "Of small motions alone: large ones, such as stick-slip from rest, may go on where no mode grows (`simulate`)."
# Growth below this share of the root is rounding: a mode without losses.
_NEUTRAL = 1e-11
# A bit whose speed changes by less than this share of it is not disturbed: the rest is rounding.
_STILL = 1e-9
#: Speeds (rad/s) where none are given: those of top drives.
SPEEDS = tuple(x * rpm for x in range(20, 201, 10))
# Gauss points in a part, beside those for its waves.
_POINTS = 8
# Motion of a bit, over the largest one of the string, that is rounding.
_AT_REST = 1e-9
# Number of the fastest modes that are listed with their places and drives.
_LISTED = 12
_DRIVES = {
    "stiff": "it turns at the speed asked for",
    "matched": "it reflects no waves",
    "SoftTorque": "PI control of the string's impedance at its first mode",
    "SoftSpeed": "the same with four times the impedance",
}


@dataclass(frozen=True)
class ModeShape:
    """One mode: real motions are Re(w exp(s t)).

    Attributes:
        root: s, 1/s. depth: (m,) below the top drive, m; the number of the disc for discs. rotation: (m,) complex, the
            amplitude of the rotation om, 1 at the bit; None where nothing turns. velocity: (m,) complex, the axial one
            in m/s per rad/s of the bit, without rotation 1 at a bit that moves; None where nothing moves axially.
        shares: {what: share} of the kinetic energy over a period, of the
            components by name, of the top drive and the bit; "axial motion of ..." for the axial part. lengths: {name:
            m} of the components; empty for discs.
    """

    root: complex
    depth: np.ndarray
    rotation: np.ndarray | None
    velocity: np.ndarray | None
    shares: dict[str, float]
    lengths: dict[str, float]

    @property
    def where(self) -> str:
        """The largest shares of the kinetic energy up to nine tenths, and the part where it is densest, in words."""
        shares, lengths = self.shares, self.lengths
        words, covered = [], 0.0
        for name, share in sorted(shares.items(), key=lambda item: -item[1]):
            words.append(f"{name} {100 * share:.0f} %")
            covered += share
            if covered > 0.9 or len(words) == 3:
                break
        text, whole = ", ".join(words), sum(lengths.values())
        parts = {name: shares.get(name, 0.0) / (length / whole) for name, length in lengths.items()}
        densest = max(parts, key=parts.get, default=None)
        if densest is None or parts[densest] < 2:
            return text
        share, length = 100 * shares[densest], 100 * lengths[densest] / whole
        return f"{text}; densest in the {densest}: {share:.0f} % on {length:.0f} % of the length"


def shape_of(equation, s, points=200):
    """The `ModeShape` of a root of a characteristic function, sampled at about `points` points."""
    motions, energies = {}, {}
    for guide, amplitude in zip(equation.guides, equation.motion(s), strict=True):
        depth, w, energy = _along(guide, s, points)
        motions[guide.kind] = amplitude * w
        for name, value in energy.items():
            name = name if guide.kind == "torsion" else f"axial motion of {name}"
            energies[name] = energies.get(name, 0.0) + abs(amplitude) ** 2 * value
    total = sum(energies.values())
    shares = {name: float(value / total) for name, value in energies.items() if value}
    lengths = {}
    for part in equation.guides[0].parts:
        if part.length:
            lengths[part.name] = lengths.get(part.name, 0.0) + part.length
    return ModeShape(complex(s), depth, motions.get("torsion"), motions.get("axial"), shares, lengths)


def _along(guide, s, points):
    """(depth, w, {name: twice the kinetic energy}) of one guide, w = 1 at the bit, or at most where it stands."""
    at = np.array([s], dtype=complex)
    state, found, depth, energies, top = guide.start(at), [], [], [], 0.0
    if guide.top_inertia:
        energies.append(("top drive", guide.top_inertia * abs(state.w[0]) ** 2, state.size))
    for k, part in enumerate(guide.parts):
        share = max(2, round(points * part.travel / guide.travel))
        x, here, twice = part.along(at, state, _POINTS + 2 * int(abs(s) * part.travel), share)
        energies.append((part.name, twice, state.size))
        depth.append(np.array([k + 1.0]) if isinstance(part, Disc) else top + x)
        found.append((here, state.size))
        top += part.length
        state = part.down(at, state)
    energies.append(("bit", guide.inertia * abs(state.w[0]) ** 2, state.size))
    w = np.concatenate([here * np.exp(size - state.size) for here, size in found])
    largest = np.abs(w).max()
    unit, energy = w[-1] if abs(w[-1]) > _AT_REST * largest else largest, {}
    for name, twice, size in energies:
        energy[name] = energy.get(name, 0.0) + twice * np.exp(2 * (size - state.size))[0] / abs(unit) ** 2
    return np.concatenate(depth), w / unit, energy


def usual_drives(scene):
    """{name: TopDrive} for comparison: drives other than the scene's, with an inertia where the scene's has one; and
    the scene's own drive where `SoftTorque` or `SoftSpeed` chose its gains, by the name of that rule."""
    inertia, own = scene.drive.inertia, scene.drive.control
    drives = {} if own == Stiff() else {"stiff": TopDrive(0.0)}
    if scene.discs:
        return drives
    if inertia:
        for name, choose in (("SoftTorque", SoftTorque), ("SoftSpeed", SoftSpeed)):
            # the tuning of the scene, where it has one
            control = with_rule(own, name) if own_rule(scene) else choose(scene, inertia)
            drives[name] = TopDrive(0.0, inertia, control)
    if own != Matched():
        drives["matched"] = TopDrive(0.0, control=Matched())
    return drives


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Result):
    """Growth and frequency of every mode at every speed and weight.

    Attributes:
        scene: the `Drilling`. speeds: (n,) rad/s. weights: (m,) N; NaN where the bit has none.
        roots: (n, m, k) complex, 1/s: of each mode; NaN where it is not within the limits of the list. Pairs are listed
            by the one with positive frequency; real roots have the frequency 0.
        up_to: highest frequency that was looked for, Hz. Modes that decay more than a factor exp(-4) within the time
            that a wave takes down the string, or exp(-1/2) within its largest damping time, are not listed.
        kind: "torsion" or "axial"; a bit that cuts couples both.
    """

    scene: Drilling
    speeds: np.ndarray
    weights: np.ndarray
    roots: np.ndarray
    up_to: float
    kind: str = "torsion"

    axis = _rows_axis = "root"
    _quantities = by_name(
        Quantity("speed", unit="rad/s", axes=("root",), getter=lambda x: x.speeds[x._found[0]], shown="rpm"),
        Quantity("weight_on_bit", unit="N", axes=("root",), getter=lambda x: x.weights[x._found[1]]),
        Quantity("mode", axes=("root",), getter=lambda x: x._found[2]),
        Quantity("growth", unit="1/s", axes=("root",), getter=lambda x: x.growth[x._found]),
        Quantity("frequency", unit="Hz", axes=("root",), getter=lambda x: x.frequency[x._found]),
    )

    def __len__(self) -> int:
        return len(self._found[0])

    @property
    def _found(self):
        """Indices (speeds, weights, modes) of all known roots."""
        return np.nonzero(np.isfinite(self.growth))

    def _about(self):
        return {"kind": "Stability", "up_to": self.up_to, "motion": self.kind, "cautions": self.cautions}

    @cached_property
    def _growing(self):
        """(mode, i, j, {drive: growth}) of the fastest modes that grow, in the case of median growth; their number. No
        drives for a bit that cuts, with which they may take minutes."""
        grows = [k for k in range(self.roots.shape[2]) if (self.growth[:, :, k] > 0).any()]
        grows.sort(key=lambda k: -np.nanmax(self.growth[:, :, k]))
        rows, known = [], {}
        for k in grows[:_LISTED]:
            i, j = np.nonzero(self.growth[:, :, k] > 0)
            middle = np.argsort(self.growth[i, j, k])[len(i) // 2]
            case = int(i[middle]), int(j[middle])
            if case not in known:
                known[case] = {} if self._cuts else self.with_drives(*case)
            rows.append((k, *case, {name: growth[k] for name, growth in known[case].items()}))
        return rows, len(grows)

    @property
    def _cuts(self):
        return self.scene.bit is not None and self.scene.bit.law.drills

    def _answer(self, units):
        yield f"{_range(self, units)}, all modes up to {self.up_to:.4g} Hz."
        yield from (f"{caution}." for caution in self.cautions)
        rows, count = self._growing
        if not rows:
            k = int(np.nanargmax(np.nanmax(self.growth, axis=(0, 1))))
            i, j = self.worst(k)
            growth = self.growth[i, j, k]
            decays = f"decays by {-growth:.3g} 1/s" if growth else "neither grows nor decays"
            least = f"{self.frequency[i, j, k]:.4g} Hz, which {decays}"
            (rpm, kN), (speed, weight) = (x[0] for x in _case_units(units)), _case(self, units, i, j)
            what = "No mode grows" if self._fed is None else f"No mode up to {self.up_to:.4g} Hz grows, FASTER ONES DO"
            yield f"{what}. Least damped: {least} at {speed} {rpm}{weight and f', {weight} {kN}'}."
            yield from self._limits(units)
            yield _SMALL
            return
        yield f"{count} modes grow. {_SMALL}"
        yield from self._limits(units)
        if self._cuts:
            yield "with_drives(i, j) has the growth with other drives, at speeds[i] and weights[j]."
        yield from (
            f"{text}." for text in _advice(self, rows, [name for name in rows[0][3] if name != own_rule(self.scene)])
        )

    @cached_property
    def limit_speeds(self) -> dict[str, tuple[float, float]]:
        """{drive: (rad/s of the first mode alone, of all up to `up_to`)}: the lowest speeds from which on they decay at
        the largest weight, see `limit_speed`, with the drive of the scene and those of `with_drives`; empty for axial
        motion, and where that function searches for them."""
        if self.kind == "axial" or self.scene.bit is None or searches(self.scene):
            return {}
        scene, found = self.scene, {}
        weight, first = or_none(self.weights.max()), min(highest(scene, 1, self.up_to), self.up_to)
        own = own_rule(scene) or type(scene.drive.control).__name__
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)  # the cautions have them
            for name, drive in {f"{own} (own)": scene.drive, **usual_drives(scene)}.items():
                other = replace(scene, drive=drive)
                if name != own:
                    found[name] = tuple(limit_speed(other, weight, up_to=top) for top in (first, self.up_to))
        return found

    def _limits(self, units):
        """A sentence on the lowest speeds of steady drilling by drive."""
        (rpm, turning), (kN, pressing) = _case_units(units)

        def told(speed):
            return "none" if math.isinf(speed) else f"{speed / turning:.4g} {rpm}" if speed else "any"

        weight = or_none(self.weights.max())
        at = "" if weight is None else f" with {weight / pressing:.4g} {kN} on bit"
        each = [f"{name} {told(first)} ({told(every)})" for name, (first, every) in self.limit_speeds.items()]
        if each:
            yield (f"Speeds from which on the first mode{at} no longer grows, and in brackets none up to "
                   f"{self.up_to:.4g} Hz: {', '.join(each)}.")  # fmt: skip
        elif self.kind == "torsion" and self.scene.bit is not None:
            yield "limit_speed(scene) searches the speed from which on no mode grows."

    def _more(self, units):
        rows, count = self._growing
        if not rows:
            return
        own = own_rule(self.scene)
        drive = own or type(self.scene.drive.control).__name__
        yield (
            "growth: in 1/s. largest growth: of all cases. middle case: of those in which the mode grows; frequency "
            f"and growth there are those of the middle case, with the drive of the scene, {drive}. mode: counted from "
            "0 by frequency there."
        )
        if rows[0][3]:
            yield (
                f"To the right the growth with {'each drive' if own else 'other drives'}: {_words(rows[0][3])}. gone: "
                "with that drive no mode is near."
            )
        for k, i, j, _ in rows:
            yield f"{self.frequency[i, j, k]:.4g} Hz moves: {self.shape(k, i, j).where}"
        if count > _LISTED:
            yield f"{count - _LISTED} more modes grow: to_dataframe() has all."

    def _table(self, units, rows):
        growing, _ = self._growing
        if not growing:
            return None
        own, cases, table = own_rule(self.scene), self.growth[:, :, 0].size, Table()
        headings = [f"{name} (own)" if name == own else name for name in growing[0][3]]
        case = [f"middle case ({unit})" for unit, _ in _case_units(units)]
        own_growth = ("frequency there (Hz)", "growth there")
        for heading in ("mode", "grows in", "largest growth", *case, *own_growth, *headings):
            table.add_column(heading, justify="right", no_wrap=True)
        for k, i, j, drives in growing[:rows]:
            growth = self.growth[:, :, k]
            table.add_row(
                str(k), f"{int((growth > 0).sum())} of {cases}", f"{np.nanmax(growth):.3g}", *_case(self, units, i, j),
                f"{self.frequency[i, j, k]:.4f}", f"{growth[i, j]:.3g}",
                *("gone" if math.isnan(x) else f"{x:.3g}" for x in drives.values()),
            )  # fmt: skip
        return table

    @property
    def growth(self) -> np.ndarray:
        """(n, m, k) rates, 1/s: above 0 the steady rotation is unstable."""
        return self.roots.real

    @property
    def frequency(self) -> np.ndarray:
        """(n, m, k) Hz."""
        return np.where(np.isfinite(self.growth), self.roots.imag / (2 * np.pi), np.nan)

    @property
    def cautions(self) -> list[str]:
        """Sentences on approximations."""
        steady, left_out = Steady(self.scene, self.kind), without_autodriller(self.scene)
        walls = steady.walls(or_none(self.weights[0]))
        if walls is not None and (sliding := walls.caution(float(self.speeds.min()), steady.sliding)):
            left_out.append(sliding)
        law = self.scene.bit.law if self.scene.bit is not None and not self._cuts else None
        if law is not None and len(self.weights) > 1:
            at = [law.resistance(float(weight)) for weight in (self.weights.min(), self.weights.max())]
            if None not in at and all(at[0](s) == at[1](s) for s in self.speeds):
                left_out.append("the law's torque does not depend on the weight on bit: give radius=")
        return left_out + ([str(self._fed)] if self._fed else [])

    @cached_property
    def _fed(self):
        """The waves above `up_to` that the drive feeds, or None."""
        return fed_waves(self.scene, self.up_to) if self.kind == "torsion" else None

    @property
    def unstable_modes(self) -> np.ndarray:
        """(n, m) number of modes that grow."""
        return (self.growth > 0).sum(axis=2)

    def unstable(self, i: int, j: int = 0) -> list[int]:
        """The modes that grow at `speeds[i]` and `weights[j]`, the fastest one first."""
        growth = np.nan_to_num(self.growth[i, j], nan=-np.inf)
        return [int(k) for k in np.argsort(-growth) if growth[k] > 0]

    def worst(self, k: int) -> tuple[int, int]:
        """(i, j) of the case in which mode k grows fastest."""
        self._known(k)
        i, j = np.unravel_index(np.nanargmax(self.growth[:, :, k]), self.growth.shape[:2])
        return int(i), int(j)

    def shape(self, k: int, i: int | None = None, j: int = 0) -> ModeShape:
        """The `ModeShape` of mode k at `speeds[i]` and `weights[j]`, or where it grows fastest.

        Raises:
            SceneError: there is no such mode, or it is not listed in that case.
        """
        if i is None:
            i, j = self.worst(k)
        self._known(k)
        root = self.roots[i, j, k]
        if not np.isfinite(root):
            refuse("Stability", "shape", (k, i, j), "a case in which the mode is listed: its root is not NaN")
        return shape_of(self._steady(i, j, self.scene)[1], root)

    def with_drives(self, i: int, j: int = 0, drives: dict | None = None) -> dict[str, np.ndarray]:
        """Growth of each mode at one speed and weight with other drives.

        Args:
            i, j: of the speed and the weight.
            drives: {name: TopDrive}; None for a stiff and a matched one, and `SoftTorque` and `SoftSpeed` where the
                drive has an inertia: tuned as the scene's own is where one of these rules chose its gains, which then
                is among them.

        Returns:
            {name: (k,)}: 1/s, the largest growth of those modes whose frequency is nearest to that of mode k; NaN where
            the drive leaves none within the limits of the list. Empty for axial motion.
        """
        own, scene, found = self.roots[i, j], self.scene, {}
        if self.kind == "axial":
            return found
        for name, drive in (usual_drives(scene) if drives is None else drives).items():
            if (drive.control, drive.inertia) == (scene.drive.control, scene.drive.inertia):  # the modes as they are
                found[name] = own.real.copy()
                continue
            steady, f = self._steady(i, j, replace(scene, drive=drive))
            roots, _ = all_roots(f, box_up_to(steady, 2 * np.pi * self.up_to)(f), f.spacing, own[np.isfinite(own)])
            nearest = np.abs(roots.imag[:, None] - np.where(np.isfinite(own), own.imag, np.inf)).argmin(axis=1)
            growth = [roots.real[nearest == k].max(initial=-np.inf) for k in range(len(own))]
            found[name] = np.where(np.isneginf(growth), np.nan, growth)
        return found

    def hfto(self, i: int = 0, j: int = 0) -> Hfto:
        """How far the modes grow at `speeds[i]` and `weights[j]`, by the balance of power between bit and string.

        Raises:
            SceneError: the torque of the bit does not follow from its speed; axial motion.
        """
        if self.kind != "torsion":
            refuse("Stability", "hfto", self.kind, "a stability of torsion")
        known = np.isfinite(self.growth[i, j])
        drive = TopDrive(float(self.speeds[i]), self.scene.drive.inertia, self.scene.drive.control)
        scene = replace(self.scene, drive=drive).with_case(weight=or_none(self.weights[j]))
        return oscillations(scene, self.up_to, self.frequency[i, j][known], self.growth[i, j][known])

    def plot(self, file: File | None = None, mode: int | None = None, *, units: Any = "SI", width: int | None = None):
        """Maps of the growth over speed and weight, of each mode that grows somewhere, or of one; over the speed alone
        where there is a single weight. With a file it is written, otherwise the Figure is returned.

        Args:
            file: .png, .pdf or another format of matplotlib (rank 0 writes). mode: its number.
            units: "SI", "field" or a dict of units by dimensions. width: of the picture, pixels, or None.

        Raises:
            SceneError: matplotlib is missing, there is no such mode, or the file's ending is unknown.
            OSError: the file cannot be written.
        """
        if mode is not None:
            self._known(mode)
        return self._drawn("drilling.charts.stability_figure", file, units, width, mode)

    def __repr__(self):
        grow = self.unstable_modes
        cases = f"{len(self.speeds)} speeds and {len(self.weights)} weights, up to {self.up_to:.4g} Hz"
        return f"<Stability: {cases}; modes grow in {(grow > 0).sum()} of {grow.size} cases, {grow.max()} at most>"

    def _known(self, k):
        if not 0 <= k < self.roots.shape[2]:
            refuse("Stability", "mode", k, f"a number from 0 to {self.roots.shape[2] - 1}")

    def _steady(self, i, j, scene):
        """The `Steady` of a scene, and its equation in a case."""
        steady = Steady(scene, self.kind)
        return steady, steady.equation(steady.parameters(self.speeds[i], or_none(self.weights[j])))


def stability(
    scene: Drilling,
    speeds: Numbers | None = None,
    weights: Numbers | None = None,
    *,
    modes: int | None = None,
    up_to: float = 10.0,
    kind: str = "torsion",
) -> Stability:
    """Growth rates and frequencies of all modes of steady rotations.

    The string rotates at the speed asked for, and drills; small motions about this state grow or decay like exp(s t).
    Where the law of the bit is a torque against speed, they are torsional, with the slope of the torque at the speed
    and weight of the case, and with the string's distributed drag. Where the bit cuts (`Cutting`), torsion and axial
    motion are coupled by the depth of cut with its delay, and the weight sets the rate of penetration; without a weight
    the speed of the hook does. All roots of the transcendental equation up to a frequency are found;
    their number is that of the argument principle.

    Friction at the wall acts by its slope at the slip of the case. Of a string that rotates it brakes axial motion, and
    drives torsion where it falls with the slip; the wall force is that of the soft string, in pieces. Components damp
    by their `damping_time`, Kelvin and Voigt. Mud motors are dashpots, and what is below turns by their
    speeds under the torque on bit faster; speeds are those of the string above.

    Args:
        scene: a `Drilling`; the speed of its drive and its weight on bit are replaced by those of the cases.
        speeds: rotation, rad/s, (n,); 0 for a string without a bit that its hook moves along a hole. None for 20 to 200
            rev/min, every 10.
        weights: on bit, N, (m,); None for that of the scene.
        modes: how many of the lowest modes of the string, counted with the lower end free; None for `up_to`.
        up_to: highest frequency, Hz; where a drive that acts late feeds faster waves, `Stability.cautions` says so, and
            up to which frequency they go; some hundred for high-frequency torsional oscillations, see `Stability.hfto`.
        kind: "torsion", or "axial" for the axial motion of a string whose bit does not cut: with a weight it stands on
            its rock, without one it is free.

    Returns:
        A `Stability`, which has every mode of every case.

    Raises:
        SceneError: numbers out of range; a torque on bit that falls faster than the string can follow without inertia;
            a string at rest in its hole, or one that rotates and slides at once; axial motion of a bit that cuts.
        NotConverged: the roots that were found are fewer than those counted.
    """
    instance("stability", "scene", scene, Drilling, "a Drilling(...)")
    speeds, weights = speeds_and_weights("stability", scene, SPEEDS if speeds is None else speeds, weights)
    steady = steady_of("stability", scene, kind)
    top = 2 * math.pi * highest(scene, modes, up_to, kind)
    order = [(i, j) for j in range(len(weights)) for i in np.argsort(-speeds, kind="stable")]
    points = np.array([steady.parameters(speeds[i], or_none(weights[j])) for i, j in order])
    n = len(speeds)
    if steady.cuts:  # from the next higher speed, and from the same speed at the weight before
        parents = [[k - 1] * (k % n > 0) + [k - n] * (k >= n) for k in range(len(order))]
    else:  # the slope alone decides; modes are counted with a constant torque
        by_slope = np.argsort(-points[:, 0], kind="stable")
        order, points = [order[k] for k in by_slope], points[by_slope]
        points = np.concatenate([points[:1] * [0.0, 1.0, 1.0], points])
        parents = [[k - 1] * (k > 0) for k in range(len(points))]
    spacing = steady.equation(points[0]).spacing
    found = follow(steady.equation, points, parents, box_up_to(steady, top), spacing)
    found = np.where(np.abs(found.real) < _NEUTRAL * np.maximum(np.abs(found), spacing), 1j * found.imag, found)
    if kind == "axial":  # a string held at both ends is at rest for s = 0, which is no mode
        found = np.where(np.abs(found) < _NEUTRAL * spacing, np.nan, found)
    columns = np.argsort(_heights(found, steady.cuts), kind="stable")
    roots = np.full((len(speeds), len(weights), len(columns)), np.nan + 0j)
    for (i, j), row in zip(order, found[-len(order) :], strict=True):
        roots[i, j] = row[columns]
    return Stability(
        scene, speeds, weights, roots[:, :, np.isfinite(roots).any(axis=(0, 1))], top / (2 * math.pi), kind
    )


def steady_of(owner, scene, kind):
    """The `Steady` of a scene for a kind of motion that a user gave. Raises SceneError: an unknown kind, or axial
    motion alone of a bit that cuts; see `Steady`."""
    if kind not in ("torsion", "axial"):
        refuse(owner, "kind", kind, "'torsion' or 'axial'")
    if kind == "axial" and scene.bit is not None and scene.bit.law.drills and owner == "stability":
        refuse(owner, "kind", kind, f"'torsion': with {type(scene.bit.law).__name__} its modes move axially, too")
    return Steady(scene, kind)


def highest(scene, modes, up_to, kind="torsion"):
    """Highest frequency, Hz: `up_to`, or half way from the last of the first `modes` modes to the next one."""
    if modes is None:
        return positive("stability", "up_to", up_to, "Hz")
    count = int(number("stability", "modes", modes, "a number from 1", lambda x: x >= 1 and x == int(x)))
    lowest = natural_frequencies(scene, count + 1, kind=kind)
    return float(lowest[count - 1 :].mean()) if len(lowest) > count else 1.5 * float(lowest[-1])


def _heights(found, cuts):
    """Sort keys of modes: frequency without the bit's slope, later modes last; or the median frequency of all cases."""
    if cuts:
        return [float(np.median(column[np.isfinite(column)].imag)) for column in found.T]
    return np.where(np.isfinite(found[0]), found[0].imag, np.inf)


def _words(names):
    """Descriptions of other drives, and why some are missing."""
    found = [f"{name}, {_DRIVES[name]}" for name in names if name in _DRIVES]
    if "SoftTorque" not in names and "SoftSpeed" not in names:
        found.append("SoftTorque and SoftSpeed are compared where the drive has an inertia")
    return "; ".join(found)


def _advice(answer, rows, names):
    """Sentences on the modes that each drive damps, and those that still grow."""
    for name in names:
        parts = {
            "calms": [row for row in rows if row[3][name] <= 0],
            "has no mode near": [row for row in rows if math.isnan(row[3][name])],
        }
        left = [row for row in rows if row[3][name] > 0]
        text = " and ".join(f"{verb} {_frequencies(answer, found)}" for verb, found in parts.items() if found)
        if text:
            yield f"{name} {text}" + (f" and leaves {_frequencies(answer, left)} growing" if left else "")
        else:
            yield f"{name} calms none of them"


def _frequencies(answer, rows):
    return ", ".join(f"{answer.frequency[i, j, k]:.3g}" for k, i, j, _ in sorted(rows)) + " Hz"


def _case_units(units):
    """(unit, size) of speeds and of weights on bit."""
    return units.on_screen(SPEED), units.on_screen(WEIGHT)


def _case(answer, units, i, j):
    """Speed and weight of a case, "" without one."""
    (_, turning), (_, pressing) = _case_units(units)
    weight = answer.weights[j]
    return f"{answer.speeds[i] / turning:.4g}", "" if math.isnan(weight) else f"{weight / pressing:.4g}"


def _range(answer, units):
    (rpm, turning), (kN, pressing) = _case_units(units)
    speeds, weights = answer.speeds / turning, answer.weights / pressing
    text = f"{len(speeds)} speeds from {speeds.min():.4g} to {speeds.max():.4g} {rpm}"
    if np.isnan(weights).all():
        return text
    if len(weights) == 1:
        return f"{text}, {weights[0]:.4g} {kN} on bit"
    return f"{text}, {len(weights)} weights on bit from {weights.min():.4g} to {weights.max():.4g} {kN}"


def undisturbed(scene, least, peak):
    """A caution where the bit of a `Drilling` keeps the speed of a steady start, though its linear theory has modes
    that grow; else "", also where that theory does not apply. least, peak: smallest and largest speed of the bit,
    rad/s."""
    speed = max(abs(least), abs(peak))
    if scene is None or scene.start != "steady" or not speed or peak - least >= _STILL * speed:
        return ""
    if scene.motor is not None:
        speed = abs(scene.drive.signal()(0.0))
    return _grows_undisturbed(scene, float(f"{speed:.9g}"))


@per_scene
def _grows_undisturbed(scene, speed):
    """The caution at a speed of the bit (rad/s), or ""; remembered, as every summary of a motion asks for it."""
    try:
        found = stability(scene, [speed])
    except (SceneError, NotConverged):
        return ""
    growing = found.unstable(0)
    if not growing:
        return ""
    frequency, growth = (values[0, 0, growing[0]] for values in (found.frequency, found.growth))
    return (f"The steady state is unstable (a mode of {frequency:.3g} Hz grows by {growth:.3g} 1/s) and nothing "
            "disturbed it: disturb it, as by a step of 1 % in the drive's speed.")  # fmt: skip
