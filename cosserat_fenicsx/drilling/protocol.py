"""What a model of a string in motion offers to the time loop, and the names of what it tells.

x runs along the string from the top drive down. Angles and rotation are positive in the sense of drilling, the torque M
(N m) is positive where it drives what is below. Displacements u and velocities v are positive downwards, from the
hanging equilibrium; tension is positive. Models of torsion alone give NaN for what is axial.
"""

from typing import Any, Protocol

import numpy as np

#: What is recorded at the end of every step. drive_speed, bit_speed: rad/s; drive_angle, bit_angle: rad;
#: surface_torque: M at the top, torque_on_bit: against the rotation of the bit, N m; hook_load, weight_on_bit: N;
#: bit_velocity: m/s, bit_advance: m, downwards; impulse_on_bit: of all impacts on rigid rock since the start, N s,
#: which weight_on_bit leaves out.
SERIES = (
    "drive_speed", "drive_angle", "surface_torque", "bit_speed", "bit_angle", "torque_on_bit", "hook_load",
    "bit_velocity", "bit_advance", "weight_on_bit", "impulse_on_bit",
)  # fmt: skip
#: Energies and, since the start, works and losses, J. Those of the string above the rock, with drive and bit: kinetic +
#: strain = work_of_drive + work_of_hook + work_of_weight - lost_at_bit - lost_at_wall - lost_in_mud, but for what the
#: scheme itself loses. work_of_drive is that of the torque asked for by the control.
LEDGER = (
    "kinetic", "strain", "work_of_drive", "work_of_hook", "work_of_weight", "lost_at_bit", "lost_at_wall",
    "lost_in_mud",
)  # fmt: skip
#: Along the string, at `StringModel.depths`. angle: rad; speed: rad/s; torque: N m; displacement: m; velocity: m/s;
#: tension: N; sticking: 1 where the wall holds the string, 0 where it slips or is free.
PROFILE = ("angle", "speed", "torque", "displacement", "velocity", "tension", "sticking")


class StringModel(Protocol):
    """A string in motion. It is at rest at the time 0 and advances by steps of `dt`.

    Attributes:
        name: of the model, such as "torsion". why: sentences on the choice and on what is approximate.
        dt: s. time: s. steps: done. depths: (m,) measured depths of the places of profiles, m.
        counts: dict of counters: steps that were halved, iterations of Newton's method.
    """

    name: str
    why: tuple[str, ...]
    dt: float
    time: float
    steps: int
    depths: np.ndarray
    counts: dict[str, int]

    def advance(self, steps: int) -> np.ndarray:
        """Do up to so many steps.

        Returns:
            (n, 1 + len(SERIES) + len(LEDGER)): the time and the values of SERIES and LEDGER at the end of each.

        Raises:
            NotConverged: a step fails however short it is; `rows` of the exception holds those up to there.
        """

    def profile(self) -> np.ndarray:
        """(len(PROFILE), m) along the string, now."""

    def memory(self) -> dict[str, Any]:
        """All that later steps depend on, arrays and numbers, such that `recall` leads to the same digits."""

    def recall(self, memory: dict[str, Any]) -> None:
        """Restore what `memory` returned."""
