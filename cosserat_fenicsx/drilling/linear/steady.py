"""The steady rotation of a scene, and its linear equation for small motions."""

import math
from dataclasses import replace

import numpy as np

from cosserat_fenicsx.checks import finite_array, positive, refuse
from cosserat_fenicsx.drilling.bit_laws import Cutting
from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.linear.characteristic import FallingTorque, Regenerative
from cosserat_fenicsx.drilling.linear.impedances import axial, torsional
from cosserat_fenicsx.drilling.signals import doubt_speed
from cosserat_fenicsx.drilling.single_valued import refuse_several_speeds, slope, stribeck_of
from cosserat_fenicsx.drilling.steady_start import penetration


class Steady:
    """Steady rotations of a scene at any speed and weight.

    Attributes:
        torsion, axial: `Guide`s; axial is None where nothing moves axially.

    Raises:
        SceneError: discs with a bit that cuts.
    """

    def __init__(self, scene, drive=None):
        self.scene = scene
        self.law = scene.bit.law if scene.bit else None
        self.torsion = torsional(scene, drive)
        self.cuts = isinstance(self.law, Cutting)
        self.axial = axial(scene) if self.cuts else None

    def parameters(self, speed, weight):
        """What the equation depends on: (kappa,) or (rotation, rate of penetration), for a weight (N) or None.

        Raises:
            SceneError: a weight that the bit lacks or does not reach; or a torque that falls too fast.
        """
        if self.cuts:
            return np.array([speed, self._penetration(speed, weight)])
        law = stribeck_of(self.law)
        if law is None:
            return np.zeros(1)
        if law.radius is not None and weight is None:
            refuse(self.scene.bit, "weight", None, "the weight on bit (N), which the law needs")
        kappa = slope(law, speed, weight)
        if not isinstance(self.scene.string, Discs):
            at = f" at {speed:.4g} rad/s" + (f" under {weight / 1e3:.4g} kN" if weight is not None else "")
            refuse_several_speeds(kappa, self.torsion.impedance, self.torsion.inertia, at)
        return np.array([kappa])

    def _penetration(self, speed, weight):
        """V from the weight on bit, less that on wear flats; or from the speed of the hook."""
        if weight is None:
            hook = self.scene.hook
            rate = -hook.signal()(0.0) if hook is not None and hook.signal().constant else 0.0
            if not rate > 0:
                refuse(self.scene.bit, "weight", None, "the weight on bit (N), or a Hook whose speed (m/s) is a "
                       "negative number: that of the block downwards")  # fmt: skip
            return rate
        return penetration(replace(self.scene.bit, weight=weight), speed)

    def equation(self, parameters):
        """The characteristic function of `parameters`."""
        if self.cuts:
            stiffnesses = self.law.axial_stiffness, self.law.torsional_stiffness
            return Regenerative(self.torsion, self.axial, *stiffnesses, self.law.blades, *map(float, parameters))
        return FallingTorque(self.torsion, float(parameters[0]))


def speeds_and_weights(owner, scene, speeds, weights):
    """Both as checked arrays; weights (1,) of NaN where there is none.

    Raises:
        SceneError: speeds or weights that are not positive, or weights without a bit.
    """
    speeds = np.atleast_1d(finite_array(owner, "speeds", speeds, "positive numbers (rad/s)"))
    if speeds.ndim != 1 or not speeds.size or (speeds <= 0).any():
        refuse(owner, "speeds", speeds.tolist(), "positive numbers (rad/s)")
    doubt_speed(owner, "speeds", float(speeds.max()))
    if weights is None:
        own = scene.bit.weight if scene.bit else None
        return speeds, np.array([np.nan if own is None else own])
    if scene.bit is None:
        refuse(scene, "bit", None, "a BitOnRock, whose weight is to change")
    weights = np.atleast_1d(finite_array(owner, "weights", weights, "positive numbers (N)"))
    for weight in weights.ravel():
        positive(owner, "weights", float(weight), "N")
    if weights.ndim != 1 or not weights.size:
        refuse(owner, "weights", weights.tolist(), "positive numbers (N)")
    return speeds, weights


def or_none(weight):
    """A weight, None for NaN."""
    return None if math.isnan(weight) else float(weight)
