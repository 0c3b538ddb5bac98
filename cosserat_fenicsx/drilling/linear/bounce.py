"""Bit bounce: the weight on bit that shakes while lobes of the rock lift the bit."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import File, Numbers, refuse
from cosserat_fenicsx.drilling.bit_laws import Lobes
from cosserat_fenicsx.drilling.linear.impedances import axial
from cosserat_fenicsx.drilling.linear.steady import speeds_and_weights
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.well.tabular import Tabular


@dataclass(frozen=True, eq=False, repr=False)
class BitBounce(Tabular):
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

    def plot(self, file: File | None = None):
        """Amplitude over speed beside the static weight. With a file it is written, otherwise the Figure is returned.

        Raises:
            SceneError: matplotlib is missing, or the file's ending is unknown.
            OSError: the file cannot be written.
        """
        from cosserat_fenicsx.drilling.charts import draw_bounce

        return draw_bounce(self, file)

    def __repr__(self):
        lifted = self.speeds[self.lifts_off]
        rpm = lifted * 30 / math.pi
        told = f"the bit lifts off at {len(lifted)} of {len(self.speeds)} speeds"
        return f"<BitBounce: {told}" + (f", from {rpm.min():.4g} to {rpm.max():.4g} rpm>" if len(lifted) else ">")

    def _tables(self):
        return {"": {
            "speed (rad/s)": self.speeds, "frequency (Hz)": self.frequency, "amplitude of weight (N)": self.amplitude,
            "lifts off": self.lifts_off.astype(float),
        }}  # fmt: skip


def bit_bounce(scene: Drilling, speeds: Numbers) -> BitBounce:
    """Forced axial vibration of a string whose bit follows the lobes of the rock.

    The bit moves by amplitude sin(count theta); the weight on bit shakes by the modulus of i w Z(i w) - m w^2, times
    the amplitude, with w = count Om, the axial impedance Z of the string below its hook and the mass m of the bit. Rock
    of the stiffness k takes a part of the motion: of that dynamic stiffness D there acts D k/(D + k). It is linear: it
    holds while the weight shakes by less than the static one.

    Args:
        scene: a `Drilling` whose bit has the law `Lobes`.
        speeds: rotation, rad/s, (n,).

    Raises:
        SceneError: another law, or speeds that are not positive.
    """
    if scene.bit is None or not isinstance(scene.bit.law, Lobes):
        refuse("bit_bounce", "scene", scene.bit, "a bit with the law Lobes(count, amplitude)")
    speeds, _ = speeds_and_weights("bit_bounce", scene, speeds, None)
    frequency = scene.bit.law.count * speeds / (2 * math.pi)
    return BitBounce(scene, speeds, frequency, _amplitude(scene, speeds))


def _amplitude(scene, speeds):
    law, guide = scene.bit.law, axial(scene)
    s = 1j * law.count * speeds
    with np.errstate(divide="ignore"):
        stiffness, rock = s * (guide.impedance_at_bit(s) + guide.inertia * s), scene.bit.rock_stiffness
        return np.abs(stiffness if math.isinf(rock) else 1 / (1 / stiffness + 1 / rock)) * law.amplitude
