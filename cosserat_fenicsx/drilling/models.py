"""The models of a string in motion by their names, see `choose` and `protocol.StringModel`."""

import math

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.axial_torsional.model import AxialTorsional
from cosserat_fenicsx.drilling.choose import BOTH
from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.torsion.model import TorsionWaves


def model_of(scene, name, dt=None, elements=None):
    """A new `StringModel` at rest.

    Args:
        name: "torsion" or "axial and torsional". dt: step, s. elements: how many along the string. Both None for those
            of the model; waves of torsion have cells of one step, so that one of the two decides.

    Raises:
        SceneError: a scene that the model has no equations for; steps that its laws do not allow.
    """
    discs = isinstance(scene.string, Discs)
    if discs and elements is not None:
        refuse("simulate_drilling", "elements", elements, "None for Discs, which are not divided")
    if discs or name == BOTH:
        return AxialTorsional(scene, dt, elements)
    if dt is not None and elements is not None:
        refuse("simulate_drilling", "elements", elements, "None beside dt: waves of torsion have cells of one step")
    if elements is not None:
        dt = math.fsum(part.length / part.torsional_speed for part in scene.segments) / elements
    return TorsionWaves(scene, dt)
