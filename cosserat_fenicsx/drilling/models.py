"""The models of a string in motion by their names, see `choose` and `protocol.StringModel`."""

import math

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.axial_torsional.model import AxialTorsional
from cosserat_fenicsx.drilling.choose import BOTH
from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.torsion.model import TorsionWaves


class Coarser:
    """What `step_errors` asks for a coarser model: a scene, and the name and `StringModel` that computed its motion."""

    def __init__(self, scene, name, model):
        self._given = scene, name, model

    def coarser(self):
        """A new `StringModel` at rest, with twice the step and half the elements."""
        scene, name, model = self._given
        if isinstance(model, AxialTorsional) and not isinstance(scene.string, Discs):
            return model_of(scene, name, 2 * model.dt, max(2, (len(model.depths) - 1) // 2))
        return model_of(scene, name, 2 * model.dt)


def model_of(scene, name, dt=None, elements=None):
    """A new `StringModel` at rest.

    Args:
        name: "torsion" or "axial and torsional". dt: step, s. elements: how many along the string. Both None for those
            of the model; waves of torsion have cells of one step, so that one of the two decides.

    Raises:
        SceneError: a scene that the model has no equations for; steps that its laws do not allow.
    """
    given = {key: value for key, value in (("dt", dt), ("elements", elements)) if value is not None}
    if isinstance(scene.string, Discs):
        if elements is not None:
            refuse("simulate_drilling", "elements", elements, "None for Discs, which are not divided")
        return AxialTorsional(scene, **given)
    if name == BOTH:
        return AxialTorsional(scene, **given)
    if len(given) > 1:
        refuse("simulate_drilling", "elements", elements, "None beside dt: waves of torsion have cells of one step")
    if elements is not None:
        dt = math.fsum(part.length / part.torsional_speed for part in scene.segments) / elements
    return TorsionWaves(scene, dt)
