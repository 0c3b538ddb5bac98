"""The slope of a bit's law, and whether a string without inertia at the bit can follow it.

A wave that arrives at the lower end, where there is no inertia, meets the condition T(om) + Z om = 2 M_in, with the
impedance Z of the lowest section, J sqrt(G rho), and the torque M_in of the wave. Where the torque T of the bit falls
faster than Z om grows, several speeds satisfy it, and the linear theory has unstable roots at all frequencies.
"""

import math

from cosserat_fenicsx.drilling.bit_laws import Stribeck
from cosserat_fenicsx.errors import SceneError


def stribeck_of(law):
    """The law of torque against speed: a `Stribeck`, or None where the torque does not depend on the speed alone."""
    return law if isinstance(law, Stribeck) else getattr(law, "law", None)


def slope(law: Stribeck, speed: float, weight: float | None = None) -> float:
    """dT/dom of a `Stribeck` at a speed (rad/s) above zero under a weight (N), N m s/rad; zero or negative."""
    if law.speed is None:
        return 0.0
    static, dynamic = law.torques(weight)
    return -(static - dynamic) / law.speed * math.exp(-speed / law.speed)


def refuse_several_speeds(slope: float, impedance: float, inertia: float, where: str = "") -> None:
    """Refuse a bit whose torque falls faster than the string can follow.

    Args:
        slope: dT/dom, N m s/rad; only a falling one, negative, can be refused.
        impedance: of the string at the bit, N m s/rad: J sqrt(G rho) of its lowest section, or that of one time step.
        inertia: at the bit, kg m^2; with any, the speed is single-valued.
        where: at which speed and weight, such as " at 3 rad/s".

    Raises:
        SceneError: -slope is not below the impedance, and there is no inertia.
    """
    if inertia == 0 and -slope >= impedance:
        raise SceneError(
            f"BitOnRock.law: its torque falls by {-slope:.6g} N m per rad/s{where}, and the impedance of the string at "
            f"the bit is {impedance:.6g} N m s/rad: expected a law less steep than that, or BitOnRock.inertia (kg m^2) "
            "above 0; without inertia several speeds of the bit are possible at the same time"
        )


def check_bit(scene) -> None:
    """Refuse the bit of a `Drilling` scene whose law is at its steepest, at slow rotation, too steep for the string.

    A torque that drops at once from the static to the dynamic one (`speed=None`) passes: there the bit sticks until
    the static torque is reached, and slips with the dynamic one.

    Raises:
        SceneError: see `refuse_several_speeds`.
    """
    law = None if scene.bit is None else stribeck_of(scene.bit.law)
    if law is not None and hasattr(scene.string, "components"):  # the last one of Discs has inertia
        impedance = scene.segments[-1].torsional_impedance
        refuse_several_speeds(slope(law, 0.0, scene.bit.weight), impedance, scene.bit.inertia, " at slow rotation")
