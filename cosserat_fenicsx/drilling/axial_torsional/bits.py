"""What acts on the bit beside a law of friction, by the law of the bit; and the forces on it in steady motion."""

import math

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.axial_torsional.cutting import CuttingEnd
from cosserat_fenicsx.drilling.axial_torsional.lobed import LobedEnd
from cosserat_fenicsx.drilling.bit_laws import Cutting, Lobes
from cosserat_fenicsx.drilling.single_valued import stribeck_of


def end_of(bit, place, motion, axial):
    """An `EndCondition`, or None.

    Args:
        bit: a `BitOnRock` or None. place: of the bit at the start, m and rad; motion: (2,) its velocities there.
        axial: whether the model has axial motion.

    Raises:
        SceneError: a bit that cuts, without axial motion.
    """
    law = None if bit is None else bit.law
    if isinstance(law, Cutting):
        if not axial:
            refuse("BitOnRock", "law", law, "a Stribeck, for torsion alone: the torque of Cutting follows the depth of "
                   "cut; model='axial and torsional'")  # fmt: skip
        return CuttingEnd(law, bit.weight or 0.0, place, motion)
    return LobedEnd(law, place[1], motion[1]) if isinstance(law, Lobes) and axial else None


def forces_of(bit, motion):
    """(2,) weight (N) and torque (N m) on bit in steady motion: (2,) m/s downwards and rad/s."""
    if bit is None:
        return np.zeros(2)
    if isinstance(bit.law, Cutting):
        return np.array(CuttingEnd(bit.law, 0.0, np.zeros(2), motion).steady_forces(*motion))
    weight, law = bit.weight or 0.0, stribeck_of(bit.law)
    if law is None:
        return np.array([weight, 0.0])
    still, slipping = law.torques(weight)
    falling = math.exp(-motion[1] / law.speed) if law.speed else 0.0
    return np.array([weight, slipping + (still - slipping) * falling])
