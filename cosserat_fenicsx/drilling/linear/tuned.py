"""Gains of a speed control that swallows torsional waves.

A drive of the gains Kp and Ki and the inertia I meets the string with the impedance I s + Kp + Ki/s. At the frequency
sqrt(Ki/I) it is Kp alone, and what comes up the string is reflected by (Z - Kp)/(Z + Kp). So Ki = I w1^2 makes it a
pure resistance in the first mode of the string that hangs from a drive at rest, and Kp chooses how much it swallows
there; at higher frequencies the inertia takes over, and waves are reflected as by a drive that stands still.

Both names stand for rules of choice, not for the settings of any product.
"""

import math
from dataclasses import replace
from typing import Any

from cosserat_fenicsx.checks import instance, positive, refuse
from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.linear.frequencies import natural_frequencies
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.top_drive import PI, TopDrive
from cosserat_fenicsx.well.string import DrillString


def SoftTorque(string: DrillString | Drilling | Any, inertia: float, depth: float | None = None) -> PI:
    """A control that takes all of the first mode: Kp = Z, Ki = I w1^2.

    Usage: `TopDrive(speed, inertia=2900.0, control=SoftTorque(string, inertia=2900.0))`.

    Args:
        string: a `DrillString`, a single component of a known length, such as a `DrillPipe`, or a `Drilling`, whose
            drive is left aside.
        inertia: I of the drive, kg m^2.
        depth: of the lower end, m, where the uppermost component has no length.

    Returns:
        The `PI` control with Z = J sqrt(G rho) of the uppermost component and w1 the lowest circular frequency of the
        string with the drive at rest and the lower end free.

    Raises:
        SceneError: a string of `Discs`, which has no impedance, or an inertia that is not positive.
    """
    return _matched("SoftTorque", 1.0, string, inertia, depth)


def SoftSpeed(string: DrillString | Drilling | Any, inertia: float, depth: float | None = None) -> PI:
    """A stiffer control, which follows the speed asked for more closely: Kp = 4 Z, Ki = I w1^2.

    It reflects 0.6 of a wave at the frequency of the first mode. Arguments, result and errors are those of
    `SoftTorque`.
    """
    return _matched("SoftSpeed", 4.0, string, inertia, depth)


def _matched(name, factor, string, inertia, depth):
    inertia = positive(name, "inertia", inertia, "kg m^2")
    scene = _at_rest(name, string, depth)
    if isinstance(scene.string, Discs):
        refuse(name, "string", scene.string, "a string of components: discs have no impedance; choose PI(Kp, Ki)")
    first = 2 * math.pi * natural_frequencies(scene, 1)[0]
    return PI(factor * scene.segments[0].torsional_impedance, inertia * first**2)


def _at_rest(name, string, depth):
    """A scene whose drive stands still and whose lower end is free."""
    if isinstance(string, Drilling):
        return replace(string, drive=TopDrive(0.0))
    if not isinstance(string, DrillString):
        string = DrillString((string,))
    instance(name, "string", string, DrillString, "a DrillString, a component or a Drilling")
    return Drilling(string, TopDrive(0.0), depth=depth)
