"""Which modes of a string that drills steadily grow, at which speeds and weights."""

import math

import numpy as np

from cosserat_fenicsx.checks import Numbers, number, positive, refuse
from cosserat_fenicsx.drilling.linear.frequencies import natural_frequencies
from cosserat_fenicsx.drilling.linear.spectrum import Stability
from cosserat_fenicsx.drilling.linear.stability_box import box_up_to
from cosserat_fenicsx.drilling.linear.steady import Steady, or_none, speeds_and_weights
from cosserat_fenicsx.drilling.linear.tracking import follow
from cosserat_fenicsx.drilling.scene import Drilling

#: A growth below this share of the root is rounding: a mode without losses.
_NEUTRAL = 1e-11


def stability(
    scene: Drilling,
    speeds: Numbers,
    weights: Numbers | None = None,
    *,
    modes: int | None = None,
    up_to: float = 10.0,
) -> Stability:
    """Growth rates and frequencies of all modes of steady rotations.

    The string rotates at the speed that is asked for, and drills; its small motions about that grow or decay like
    exp(s t). Where the law of the bit is a torque against speed, they are torsional, with the slope of the torque at
    the speed and weight of the case, and with the string's distributed drag. Where the bit cuts (`Cutting`), torsion
    and axial motion are coupled by the depth of cut with its delay, and the weight sets the rate of penetration;
    without a weight the speed of the hook does. All roots of the transcendental equation up to a frequency are found;
    their number is that of the argument principle. Friction at the wall is left out, see `Stability.cautions`.

    Args:
        scene: a `Drilling`; the speed of its drive and its weight on bit are replaced by those of the cases.
        speeds: rotation, rad/s, (n,). weights: on bit, N, (m,); None for that of the scene.
        modes: how many of the lowest modes of the string, counted with the lower end free; None for `up_to`.
        up_to: highest frequency, Hz.

    Returns:
        A `Stability`, which has every mode of every case.

    Raises:
        SceneError: numbers out of range; a torque on bit that falls faster than the string can follow without inertia.
        NotConverged: the roots that were found are fewer than those counted.
    """
    if not isinstance(scene, Drilling):
        refuse("stability", "scene", scene, "a Drilling(...)")
    speeds, weights = speeds_and_weights("stability", scene, speeds, weights)
    top = 2 * math.pi * highest(scene, modes, up_to)
    steady = Steady(scene)
    order = [(i, j) for j in range(len(weights)) for i in np.argsort(-speeds, kind="stable")]
    points = np.array([steady.parameters(speeds[i], or_none(weights[j])) for i, j in order])
    n = len(speeds)
    if steady.cuts:  # from the next higher speed, and from the same speed at the weight before
        parents = [[k - 1] * (k % n > 0) + [k - n] * (k >= n) for k in range(len(order))]
    else:  # the slope alone decides; modes are counted from that of a torque that does not fall
        by_slope = np.argsort(-points[:, 0], kind="stable")
        order, points = [order[k] for k in by_slope], np.concatenate([np.zeros((1, 1)), points[by_slope]])
        parents = [[k - 1] * (k > 0) for k in range(len(points))]
    spacing = steady.equation(points[0]).spacing
    found = follow(steady.equation, points, parents, box_up_to(steady, top), spacing)
    found = np.where(np.abs(found.real) < _NEUTRAL * np.maximum(np.abs(found), spacing), 1j * found.imag, found)
    columns = np.argsort(_heights(found, steady.cuts), kind="stable")
    roots = np.full((len(speeds), len(weights), len(columns)), np.nan + 0j)
    for (i, j), row in zip(order, found[-len(order) :], strict=True):
        roots[i, j] = row[columns]
    return Stability(scene, speeds, weights, roots[:, :, np.isfinite(roots).any(axis=(0, 1))], top / (2 * math.pi))


def _heights(found, cuts):
    """What modes are numbered by: frequency without the bit's slope, later ones last; or that of the middle case."""
    if cuts:
        return [float(np.median(column[np.isfinite(column)].imag)) for column in found.T]
    return np.where(np.isfinite(found[0]), found[0].imag, np.inf)


def highest(scene, modes, up_to):
    """Hz: `up_to`, or half way from the last of so many modes to the next one."""
    if modes is None:
        return positive("stability", "up_to", up_to, "Hz")
    count = int(number("stability", "modes", modes, "a number from 1", lambda x: x >= 1 and x == int(x)))
    lowest = natural_frequencies(scene, count + 1)
    return float(lowest[count - 1 :].mean()) if len(lowest) > count else 1.5 * float(lowest[-1])
