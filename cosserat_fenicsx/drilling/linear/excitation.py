"""Excitation by rotation: the Campbell diagram, and the bounce of a bit on lobes of the rock."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import File, Numbers, number, positive, refuse
from cosserat_fenicsx.drilling.bit_laws import Lobes
from cosserat_fenicsx.drilling.linear.characteristic import Steady, speeds_and_weights
from cosserat_fenicsx.drilling.linear.frequencies import natural_frequencies
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.stick_slip import SPEED, WEIGHT
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.results.result import Result, by_name


class Drawn(Result):
    """A result with one chart, drawn by the function of `drilling.charts` of the name `_chart`."""

    _chart = ""

    def plot(self, file: File | None = None, *, units: Any = "SI", width: int | None = None):
        """Draw the chart: of `Campbell` natural frequencies as lines and excitations as rays, of `BitBounce` the
        amplitude over speed beside the static weight, of `FrequencyResponse` a Bode chart of what surface and bit
        feel of a load on bit, with the impedances of string and drive, which absorb each other's waves where both are
        equal; of `Hfto` amplitudes over the frequency. With a file it is written, otherwise the Figure is returned.

        Args:
            file: .png, .pdf or another format of matplotlib (rank 0 writes).
            units: "SI", "field" or a dict of units by dimensions. width: of the picture, pixels, or None.

        Raises:
            SceneError: matplotlib is missing, or the file's ending is unknown.
            OSError: the file cannot be written.
        """
        from cosserat_fenicsx.drilling import charts

        return getattr(charts, self._chart)(self, file, units=units, width=width)


@dataclass(frozen=True, eq=False, repr=False)
class Campbell(Drawn):
    """Result of `campbell`.

    Attributes:
        fastest: highest speed of rotation, rad/s. frequencies: {"torsion": (n,), "axial": (m,)} Hz, without what
            lies above `up_to`; they do not depend on the speed. excitations: {name: times a revolution}. up_to: Hz.
        ends: {"torsion": "free", "axial": "fixed"}, how the lower end was held.
    """

    fastest: float
    frequencies: dict[str, np.ndarray]
    excitations: dict[str, float]
    up_to: float
    ends: dict[str, str]

    def critical_speeds(self) -> dict[tuple[str, str], np.ndarray]:
        """{(kind, excitation): speeds in rad/s up to the highest one where it meets a natural frequency}."""
        found = {}
        for kind, frequencies in self.frequencies.items():
            for name, times in self.excitations.items():
                speeds = 2 * math.pi * frequencies / times
                found[kind, name] = speeds[speeds <= self.fastest]
        return found

    def __repr__(self):
        found = ", ".join(f"{len(x)} {kind}" for kind, x in self.frequencies.items())
        return f"<Campbell: {found} frequencies up to {self.up_to:.4g} Hz; {', '.join(self.excitations)}>"

    _chart = "draw_campbell"
    axis = _rows_axis = "critical speed"
    _quantities = by_name(
        Quantity("motion", "kind", axes=("critical speed",), getter=lambda x: x._column(0)),
        Quantity("excitation", axes=("critical speed",), getter=lambda x: x._column(1)),
        Quantity("critical_speed", unit="rad/s", axes=("critical speed",), getter=lambda x: x._column(2), shown="rpm"),
        Quantity("frequency", unit="Hz", axes=("critical speed",), getter=lambda x: x._column(3)),
    )

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def _rows(self):
        """(kind, excitation, speed, frequency) of every critical speed."""
        return [
            (kind, name, float(speed), self.excitations[name] * speed / (2 * math.pi))
            for (kind, name), speeds in self.critical_speeds().items()
            for speed in speeds
        ]

    def _column(self, k):
        return np.array([row[k] for row in self._rows])

    def _answer(self, units):
        rpm, turning = units.on_screen(SPEED)
        kinds = self.frequencies.items()
        found = " and ".join(f"{len(x)} of {kind} (bit {self.ends[kind]})" for kind, x in kinds)
        yield f"{len(self)} critical speeds up to {self.fastest / turning:.4g} {rpm}."
        yield f"Natural frequencies up to {self.up_to:.4g} Hz: {found}; excitations: {', '.join(self.excitations)}."


def campbell(
    scene: Drilling,
    fastest: float,
    *,
    up_to: float = 10.0,
    torsion: str = "free",
    axial: str = "fixed",
    excitations: dict[str, float] | None = None,
) -> Campbell:
    """Natural frequencies of torsion and axial motion, and the speeds at which rotation excites them.

    Args:
        scene: a `Drilling`. fastest: highest speed of rotation, rad/s. up_to: highest frequency, Hz.
        torsion, axial: the lower end: "free" or "fixed". A bit on the rock turns freely and hardly moves axially, so
            the defaults differ; `natural_frequencies` takes the end as free in both unless asked.
        excitations: {name: times a revolution}; None for once a revolution, and the blades or lobes of a bit
            that turns with the string: a motor turns it faster.

    Raises:
        SceneError: numbers that are not positive, or an unknown end.
    """
    fastest = positive("campbell", "fastest", fastest, "rad/s")
    up_to = positive("campbell", "up_to", up_to, "Hz")
    if excitations is None:
        repeats = scene.bit.law.repeats if scene.bit and scene.motor is None else None
        excitations = {"1 x": 1.0} | ({f"{repeats[0]} x ({repeats[1]})": float(repeats[0])} if repeats else {})
    for name, times in excitations.items():
        number("campbell", f"excitations[{name!r}]", times, "a positive number", lambda x: 0 < x < math.inf)
    kinds = {"torsion": torsion} | ({} if scene.discs else {"axial": axial})
    for kind, end in kinds.items():
        if end not in ("free", "fixed"):
            refuse("campbell", kind, end, "'free' or 'fixed'")
    frequencies = {kind: _up_to(scene, kind, end, up_to) for kind, end in kinds.items()}
    return Campbell(fastest, frequencies, dict(excitations), up_to, kinds)


def _up_to(scene, kind, end, up_to):
    count = 8
    while True:
        found = natural_frequencies(scene, count, end, kind)
        if len(found) < count or found[-1] > up_to:
            return found[found <= up_to]
        count *= 2


@dataclass(frozen=True, eq=False, repr=False)
class BitBounce(Drawn):
    """Result of `bit_bounce`.

    Attributes:
        scene: the `Drilling`. speeds: (n,) rad/s. frequency: (n,) Hz, lobes times rotation. amplitude: (n,) N, of the
            weight on bit about the static one, while bit and rock stay in touch.
    """

    scene: Drilling
    speeds: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray

    @property
    def lifts_off(self) -> np.ndarray:
        """(n,) bool: the amplitude is more than the static weight; the motion is then another one."""
        return self.amplitude > self.scene.bit.weight

    def limits(self) -> np.ndarray:
        """Speeds between the first and the last one where the bit begins or ceases to lift off, rad/s, ascending.

        They are found between neighbours of `speeds`: two limits between the same ones are missed.
        """
        weight = self.scene.bit.weight

        def excess(speed):
            return float(_amplitude(self.scene, np.array([speed]))[0] - weight)

        order = np.argsort(self.speeds)
        speeds, above = self.speeds[order], self.lifts_off[order]
        changes = np.flatnonzero(above[1:] != above[:-1])
        return np.array([brentq(excess, speeds[k], speeds[k + 1], xtol=1e-12) for k in changes])

    def __repr__(self):
        return f"<BitBounce: {self._lifted(Units())}>"

    def _lifted(self, units):
        """Where the bit lifts off, in words."""
        rpm, turning = units.on_screen(SPEED)
        lifted = self.speeds[self.lifts_off] / turning
        text = f"the bit lifts off at {len(lifted)} of {len(self.speeds)} speeds"
        return text + (f", from {lifted.min():.4g} to {lifted.max():.4g} {rpm}" if len(lifted) else "")

    _chart = "draw_bounce"
    axis = _rows_axis = "speed"
    _quantities = by_name(
        Quantity("speed", unit="rad/s", axes=("speed",), getter="speeds", shown="rpm"),
        Quantity("frequency", unit="Hz", axes=("speed",)),
        Quantity("amplitude", "amplitude of weight", "N", axes=("speed",)),
        Quantity("lifts_off", axes=("speed",)),
    )

    def __len__(self) -> int:
        return len(self.speeds)

    def _answer(self, units):
        unit, size = units.on_screen(WEIGHT)
        yield f"{self._lifted(units)}; the static weight on bit is {self.scene.bit.weight / size:.4g} {unit}."


def bit_bounce(scene: Drilling, speeds: Numbers) -> BitBounce:
    """Forced axial vibration of a string whose bit follows the lobes of the rock.

    The bit moves by amplitude sin(count theta); the weight on bit shakes by the modulus of i w Z(i w) - m w^2, times
    the amplitude, with w = count Om, the axial impedance Z of the string below its hook (braked by drag,
    damping and friction at the wall) and the mass m of the bit. Rock of the stiffness k takes a part of the motion: of
    that dynamic stiffness D there acts D k/(D + k). It is linear: it holds while the weight shakes by less than the
    static one.

    Args:
        scene: a `Drilling` whose bit has the law `Lobes`.
        speeds: rotation, rad/s, (n,).

    Raises:
        SceneError: another law, or speeds that are not positive.
    """
    if scene.bit is None or not isinstance(scene.bit.law, Lobes):
        refuse("bit_bounce", "scene", scene.bit, "a bit with the law Lobes(count, amplitude)")
    speeds, _ = speeds_and_weights("bit_bounce", scene, speeds, None)
    frequency = scene.bit.law.count * _of_bit(scene, speeds) / (2 * math.pi)
    return BitBounce(scene, speeds, frequency, _amplitude(scene, speeds))


def _of_bit(scene, speeds):
    steady = Steady(scene, "axial")
    return np.array([steady.speed_of_bit(float(speed), None) for speed in speeds])


def _amplitude(scene, speeds):
    bit, steady = scene.bit, Steady(scene, "axial")
    s = 1j * bit.law.count * _of_bit(scene, speeds)
    guides = [steady.guides(float(speed), bit.weight)[0] for speed in speeds]
    with np.errstate(divide="ignore"):
        impedance = np.array([guide.impedance_at_bit(x) for guide, x in zip(guides, s, strict=True)])
        stiffness, rock = s * (impedance + bit.mass * s), bit.rock_stiffness
        return np.abs(stiffness if math.isinf(rock) else 1 / (1 / stiffness + 1 / rock)) * bit.law.amplitude
