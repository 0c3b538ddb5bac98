"""Natural frequencies of a string without losses, none of which can be missed.

In a uniform part the angle psi of the vector (Z w theta, -M) grows by w L/c, w the circular frequency: it counts all
half waves, however short they are. Where the impedance changes, tan psi changes by their ratio and the half waves stay.
At the lower end psi less the angle that its condition asks for grows with w, as Sturm's theory says; the k-th natural
frequency is where that is k pi. Each is enclosed by itself, so that the count is exact for any number of parts: the
phase is the integer of Wittrick & Williams, Q. J. Mech. Appl. Math. 24 (1971) 263, doi:10.1093/qjmam/24.3.263.

Gains of a speed control that absorbs torsional waves. A drive with the gains Kp and Ki and the inertia I has the
impedance I s + Kp + Ki/s. At the frequency sqrt(Ki/I) it is Kp alone, and waves from below are reflected by (Z - Kp)/(Z
+ Kp). So Ki = I w1^2 makes it a pure resistance in the first mode of the string below a drive at rest, and Kp sets how
much it absorbs there; at higher frequencies the inertia dominates, and waves are reflected as by a drive at rest.

Both names stand for rules of choice, not for the settings of any product. A rule has one answer for a string: the mode
is that of the string alone, whether a `DrillString` or a whole `Drilling` is given.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq

from cosserat_fenicsx.checks import instance, number, positive, refuse
from cosserat_fenicsx.drilling.bit_laws import BitOnRock, Stribeck
from cosserat_fenicsx.drilling.linear.impedances import Guide, Parted, axial, torsional
from cosserat_fenicsx.drilling.scene import Discs, Drilling
from cosserat_fenicsx.drilling.top_drive import PI, RULES, Hook, TopDrive
from cosserat_fenicsx.well.components import DrillString


def natural_frequencies(scene: Drilling, count: int, bit: str = "free", kind: str = "torsion") -> np.ndarray:
    """Natural frequencies of a string without drag, the lowest ones.

    The top drive stands still, whatever its control (`stability` takes the control into account), but for a `Motor`,
    which turns freely with its inertia; axially the top hangs in the stiffness of the hook. A rotation of the whole
    string is not listed. A mud motor, whose torque hardly depends on the motion, lets the string above it end free.

    Args:
        scene: a `Drilling`.
        count: how many.
        bit: "free", with the inertia or mass of the scene's bit, or "fixed". The default is the same in torsion and
            axially; `campbell` holds the bit axially unless asked, as on rock.
        kind: "torsion" or "axial".

    Returns:
        (count,) Hz, ascending; fewer for `Discs` that have fewer.

    Raises:
        SceneError: a count below one, an unknown end or kind, or axial waves of discs.
    """
    count = int(number("natural_frequencies", "count", count, "a number from 1", lambda x: x >= 1 and x == int(x)))
    if bit not in ("free", "fixed"):
        refuse("natural_frequencies", "bit", bit, "'free' or 'fixed'")
    if kind not in ("torsion", "axial"):
        refuse("natural_frequencies", "kind", kind, "'torsion' or 'axial'")
    if kind == "torsion" and scene.discs:
        return _of_discs(scene, bit)[:count]
    guide, top = (axial(scene), _hook(scene)) if kind == "axial" else (torsional(scene), _drive(scene))
    if kind == "torsion" and scene.motor is not None:
        if bit == "fixed":
            refuse("natural_frequencies", "bit", bit, f"'free': {scene.motor.name} lets the string turn above its bit")
        motor = next(k for k, part in enumerate(guide.parts) if isinstance(part, Parted))
        guide = replace(guide, parts=guide.parts[:motor], inertia=0.0)
    return _circular(guide, count, bit == "fixed", top) / (2 * math.pi)


def _drive(scene):
    """tan psi at the top as (numerator, denominator) of w and the impedance."""
    inertia = scene.drive.inertia
    return (lambda w, Z: (Z, -inertia * w)) if scene.drive.speed is None else (lambda w, Z: (0.0, 1.0))


def _hook(scene):
    stiffness = (scene.hook or Hook()).stiffness
    return lambda w, Z: (0.0, 1.0) if math.isinf(stiffness) else (Z * w, stiffness)


def phase(guide: Guide, w: float, fixed: bool, top) -> float:
    """The angle at the lower end less the angle of its condition, rad; a multiple of pi in a mode."""
    first = guide.parts[0].impedance
    psi = math.atan2(*top(w, first))
    for part, following in zip(guide.parts, (*guide.parts[1:], None), strict=True):
        psi += w * part.travel
        if following is not None:
            half, rest = divmod(psi + math.pi / 2, math.pi)  # rest is psi - half pi, beyond -pi/2
            rest -= math.pi / 2
            psi = half * math.pi + math.atan2(following.impedance * math.sin(rest), part.impedance * math.cos(rest))
    return psi if fixed else psi - math.atan2(guide.parts[-1].impedance, guide.inertia * w)


def _circular(guide, count, fixed, top):
    """(count,) rad/s."""
    scale = math.pi / guide.travel

    def at(w):
        return phase(guide, w, fixed, top)

    # at the frequency 0 the phase is a multiple of pi where the whole string moves, or where nothing does: not a mode
    first = math.floor(at(1e-9 * scale) / math.pi + 1e-6) + 1
    found, low = [], 1e-9 * scale
    for k in range(first, first + count):
        high = low + scale
        while at(high) < k * math.pi:
            high += scale
        low = brentq(lambda w, k=k: at(w) - k * math.pi, low, high, xtol=1e-15 * scale, rtol=1e-15, maxiter=200)
        found.append(low)
    return np.array(found)


def _of_discs(scene, bit):
    """Hz, without the rotation of the whole string."""
    string = scene.string
    inertias = np.array(string.inertias)
    inertias[0] += scene.drive.inertia
    inertias[-1] += scene.bit.inertia if scene.bit else 0.0
    k = np.array(string.stiffnesses)
    stiffness = np.diag(np.append(k, 0.0) + np.append(0.0, k)) - np.diag(k, 1) - np.diag(k, -1)
    kept = slice(0 if scene.drive.speed is None else 1, len(inertias) - (bit == "fixed"))
    if kept.start == kept.stop:
        return np.array([])
    squares = eigh(stiffness[kept, kept], np.diag(inertias[kept]), eigvals_only=True)
    turns = kept.start == 0 and bit == "free"  # as a whole
    return np.sqrt(squares[int(turns):]) / (2 * math.pi)  # fmt: skip


def SoftTorque(
    string: DrillString | Drilling | Any, inertia: float, depth: float | None = None, *, bit_inertia: float = 0.0
) -> PI:
    """A control that absorbs the first mode completely: Kp = Z, Ki = I w1^2.

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
    expected = "a number (kg m^2), not negative"
    bit_inertia = number(name, "bit_inertia", bit_inertia, expected, lambda x: 0 <= x < math.inf)
    if isinstance(string, Drilling):
        string, depth = string.string, None if string.discs else string.bit_depth
    if isinstance(string, Discs):
        refuse(name, "string", string, "a string of components: discs have no impedance; choose PI(Kp, Ki)")
    if not isinstance(string, DrillString):
        string = DrillString((string,))
    instance(name, "string", string, DrillString, "a DrillString, a component or a Drilling")
    if depth is None and string.components[-1].length is None:
        ways = f"a length of the uppermost component, or {name}(scene, inertia) of a Drilling with a hole or a depth"
        refuse(name, "depth", None, f"depth= (m), the measured depth of the bit, {ways}")
    scene = Drilling(string, TopDrive(0.0), BitOnRock(Stribeck(0.0, 0.0), inertia=bit_inertia), depth=depth)
    first = 2 * math.pi * natural_frequencies(scene, 1)[0]
    return PI(RULES[name] * scene.segments[0].torsional_impedance, inertia * first**2, name)


def own_rule(scene):
    """The name of the rule that chose the gains of the scene's drive, or None."""
    return getattr(scene.drive.control, "rule", None)


def with_rule(control: PI, rule: str) -> PI:
    """The control of a rule for the string and the mode of another control that has a rule."""
    return control if rule == control.rule else PI(control.Kp * RULES[rule] / RULES[control.rule], control.Ki, rule)
