"""Gains of a speed control that swallows torsional waves.

A drive of the gains Kp and Ki and the inertia I meets the string with the impedance I s + Kp + Ki/s. At the frequency
sqrt(Ki/I) it is Kp alone, and what comes up the string is reflected by (Z - Kp)/(Z + Kp). So Ki = I w1^2 makes it a
pure resistance in the first mode of the string that hangs from a drive at rest, and Kp chooses how much it swallows
there; at higher frequencies the inertia takes over, and waves are reflected as by a drive that stands still.

Both names stand for rules of choice, not for the settings of any product. A rule has one answer for a string: the mode
is that of the string alone, whether a `DrillString` or a whole `Drilling` is given.
"""

import math
from typing import Any

from cosserat_fenicsx.checks import instance, number, positive, refuse
from cosserat_fenicsx.drilling.bit_laws import BitOnRock, Stribeck
from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.linear.frequencies import natural_frequencies
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.top_drive import PI, RULES, TopDrive
from cosserat_fenicsx.well.string import DrillString


def SoftTorque(
    string: DrillString | Drilling | Any, inertia: float, depth: float | None = None, *, bit_inertia: float = 0.0
) -> PI:
    """A control that takes all of the first mode: Kp = Z, Ki = I w1^2.

    Usage: `TopDrive(speed, inertia=2900.0, control=SoftTorque(string, inertia=2900.0))`.

    Args:
        string: a `DrillString`, a single component of a known length, such as a `DrillPipe`, or a `Drilling`, of which
            string and depth are taken, not drive and bit.
        inertia: I of the drive, kg m^2.
        depth: of the lower end, m, where the uppermost component has no length; that of a `Drilling` is its own.
        bit_inertia: kg m^2 at the lower end, which lowers the first mode; it is not taken from a scene, so that the
            rule gives the same gains for a string and for a scene with it.

    Returns:
        The `PI` control with Z = J sqrt(G rho) of the uppermost component and w1 the lowest circular frequency of the
        string with the drive at rest and the lower end free; its `rule` is "SoftTorque".

    Raises:
        SceneError: a string of `Discs`, which has no impedance, an inertia of the drive that is not positive, or one
            of the bit that is negative.
    """
    return _matched("SoftTorque", string, inertia, depth, bit_inertia)


def SoftSpeed(
    string: DrillString | Drilling | Any, inertia: float, depth: float | None = None, *, bit_inertia: float = 0.0
) -> PI:
    """A stiffer control, which follows the speed asked for more closely: Kp = 4 Z, Ki = I w1^2.

    It reflects 0.6 of a wave at the frequency of the first mode. Arguments, result and errors are those of
    `SoftTorque`.
    """
    return _matched("SoftSpeed", string, inertia, depth, bit_inertia)


def _matched(name, string, inertia, depth, bit_inertia):
    inertia = positive(name, "inertia", inertia, "kg m^2")
    bit_inertia = number(
        name, "bit_inertia", bit_inertia, "a number (kg m^2), not negative", lambda x: 0 <= x < math.inf
    )
    if isinstance(string, Drilling):
        string, depth = string.string, None if isinstance(string.string, Discs) else string.bit_depth
    if isinstance(string, Discs):
        refuse(name, "string", string, "a string of components: discs have no impedance; choose PI(Kp, Ki)")
    if not isinstance(string, DrillString):
        string = DrillString((string,))
    instance(name, "string", string, DrillString, "a DrillString, a component or a Drilling")
    scene = Drilling(string, TopDrive(0.0), BitOnRock(Stribeck(0.0, 0.0), inertia=bit_inertia), depth=depth)
    first = 2 * math.pi * natural_frequencies(scene, 1)[0]
    return PI(RULES[name] * scene.segments[0].torsional_impedance, inertia * first**2, name)


def with_rule(control: PI, rule: str) -> PI:
    """The control of a rule, tuned to the same mode of the same string as one that has a rule, which may be itself."""
    return control if rule == control.rule else PI(control.Kp * RULES[rule] / RULES[control.rule], control.Ki, rule)
