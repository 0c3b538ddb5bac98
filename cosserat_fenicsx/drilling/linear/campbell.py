"""The Campbell diagram of a string: natural frequencies against what rotation excites."""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import File, number, positive, refuse
from cosserat_fenicsx.drilling.bit_laws import Cutting, Lobes
from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.linear.frequencies import natural_frequencies
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.well.tabular import Tabular


@dataclass(frozen=True, eq=False, repr=False)
class Campbell(Tabular):
    """Result of `campbell`.

    Attributes:
        fastest: highest speed of rotation, rad/s. frequencies: {"torsion": (n,), "axial": (m,)} Hz, without what
            lies above `up_to`; they do not depend on the speed. excitations: {name: times a revolution}. up_to: Hz.
    """

    fastest: float
    frequencies: dict[str, np.ndarray]
    excitations: dict[str, float]
    up_to: float

    def critical_speeds(self) -> dict[tuple[str, str], np.ndarray]:
        """{(kind, excitation): speeds in rad/s up to the highest one where it meets a natural frequency}."""
        found = {}
        for kind, frequencies in self.frequencies.items():
            for name, times in self.excitations.items():
                speeds = 2 * math.pi * frequencies / times
                found[kind, name] = speeds[speeds <= self.fastest]
        return found

    def plot(self, file: File | None = None):
        """Frequencies as lines, excitations as rays. With a file it is written, otherwise the Figure is returned.

        Raises:
            SceneError: matplotlib is missing, or the file's ending is unknown.
            OSError: the file cannot be written.
        """
        from cosserat_fenicsx.drilling.charts import draw_campbell

        return draw_campbell(self, file)

    def __repr__(self):
        found = ", ".join(f"{len(x)} {kind}" for kind, x in self.frequencies.items())
        return f"<Campbell: {found} frequencies up to {self.up_to:.4g} Hz; {', '.join(self.excitations)}>"

    def _tables(self):
        rows = [
            (kind, name, float(speed), times * speed / (2 * math.pi))
            for (kind, name), speeds in self.critical_speeds().items()
            for times in (self.excitations[name],)
            for speed in speeds
        ]
        headings = ("kind", "excitation", "critical speed (rad/s)", "frequency (Hz)")
        columns = list(zip(*rows, strict=True)) or [()] * 4
        return {"": {heading: list(column) for heading, column in zip(headings, columns, strict=True)}}


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
        torsion, axial: the lower end: "free" or "fixed". A bit on the rock turns freely and hardly moves axially.
        excitations: {name: times a revolution}; None for once a revolution, and the blades or lobes of the bit.

    Raises:
        SceneError: numbers that are not positive, or an unknown end.
    """
    fastest = positive("campbell", "fastest", fastest, "rad/s")
    up_to = positive("campbell", "up_to", up_to, "Hz")
    if excitations is None:
        excitations = {"1 x": 1.0} | _of_the_bit(scene)
    for name, times in excitations.items():
        number("campbell", f"excitations[{name!r}]", times, "a positive number", lambda x: 0 < x < math.inf)
    kinds = {"torsion": torsion} | ({} if isinstance(scene.string, Discs) else {"axial": axial})
    for kind, end in kinds.items():
        if end not in ("free", "fixed"):
            refuse("campbell", kind, end, "'free' or 'fixed'")
    frequencies = {kind: _up_to(scene, kind, end, up_to) for kind, end in kinds.items()}
    return Campbell(fastest, frequencies, dict(excitations), up_to)


def _of_the_bit(scene):
    law = scene.bit.law if scene.bit else None
    if isinstance(law, Cutting):
        return {f"{law.blades} x (blades)": float(law.blades)}
    if isinstance(law, Lobes):
        return {f"{law.count} x (lobes)": float(law.count)}
    return {}


def _up_to(scene, kind, end, up_to):
    count = 8
    while True:
        found = natural_frequencies(scene, count, end, kind)
        if len(found) < count or found[-1] > up_to:
            return found[found <= up_to]
        count *= 2
