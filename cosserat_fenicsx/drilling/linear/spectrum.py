"""The result of `stability`: every mode of every case."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import File, refuse
from cosserat_fenicsx.drilling.bit_laws import Cutting
from cosserat_fenicsx.drilling.linear.drives import growth_with
from cosserat_fenicsx.drilling.linear.shapes import ModeShape, shape_of
from cosserat_fenicsx.drilling.linear.spectrum_table import stability_table
from cosserat_fenicsx.drilling.linear.steady import Steady, or_none
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.well.tabular import Tabular


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Tabular):
    """Growth and frequency of every mode at every speed and weight.

    Attributes:
        scene: the `Drilling`. speeds: (n,) rad/s. weights: (m,) N; NaN where the bit has none.
        roots: (n, m, k) complex, 1/s: of each mode; NaN where it is not within the limits of the list. Pairs are listed
            by the one with positive frequency; real roots have the frequency 0.
        up_to: highest frequency that was looked for, Hz. Modes that decay more than a factor exp(-4) within the time
            that a wave takes down the string are not listed.
    """

    scene: Drilling
    speeds: np.ndarray
    weights: np.ndarray
    roots: np.ndarray
    up_to: float

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
        """What the result leaves out, in sentences."""
        friction, hole, left_out = self.scene.friction, self.scene.hole, []
        if friction is not None and friction.decays:
            left_out.append(
                "friction at the wall falls with the slip, which drives torsional modes, too: left out here"
            )
        if isinstance(getattr(self.scene.bit, "law", None), Cutting) and hole is not None:
            left_out.append("friction at the wall damps axial motion of a string that rotates: left out here")
        return left_out

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
        return shape_of(self._equation(i, j), root)

    def with_drives(self, i: int, j: int = 0, drives: dict | None = None) -> dict[str, np.ndarray]:
        """Growth of each mode at one speed and weight with other drives.

        Args:
            i, j: of the speed and the weight.
            drives: {name: TopDrive}; None for a stiff and a matched one, and `SoftTorque` and `SoftSpeed` where the
                drive has an inertia: tuned as the scene's own is where one of these rules chose its gains, which then
                is among them.

        Returns:
            {name: (k,)}: 1/s, the largest growth of those modes whose frequency is nearest to that of mode k; NaN where
            the drive leaves none within the limits of the list.
        """
        return growth_with(self, i, j, drives)

    def plot(self, file: File | None = None, mode: int | None = None):
        """Maps of the growth over speed and weight, of each mode that grows somewhere, or of one; over the speed alone
        where there is a single weight. With a file it is written, otherwise the Figure is returned.

        Raises:
            SceneError: matplotlib is missing, there is no such mode, or the file's ending is unknown.
            OSError: the file cannot be written.
        """
        from cosserat_fenicsx.drilling.charts import draw_stability

        if mode is not None:
            self._known(mode)
        return draw_stability(self, file, mode)

    def __repr__(self):
        grow = self.unstable_modes
        cases = f"{len(self.speeds)} speeds and {len(self.weights)} weights, up to {self.up_to:.4g} Hz"
        return f"<Stability: {cases}; modes grow in {(grow > 0).sum()} of {grow.size} cases, {grow.max()} at most>"

    def __str__(self):
        return stability_table(self)

    def _known(self, k):
        if not 0 <= k < self.roots.shape[2]:
            refuse("Stability", "mode", k, f"a number from 0 to {self.roots.shape[2] - 1}")

    def _equation(self, i, j):
        steady = Steady(self.scene)
        return steady.equation(steady.parameters(self.speeds[i], or_none(self.weights[j])))

    def _tables(self):
        i, j, k = np.nonzero(np.isfinite(self.growth))
        return {"": {
            "speed (rad/s)": self.speeds[i], "weight on bit (N)": self.weights[j], "mode": k.astype(float),
            "growth (1/s)": self.growth[i, j, k], "frequency (Hz)": self.frequency[i, j, k],
        }}  # fmt: skip
