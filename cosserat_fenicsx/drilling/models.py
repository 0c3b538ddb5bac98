"""The models of a string in motion by their names, see `choose` and `protocol.StringModel`."""

import math

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.axial_torsional.model import AxialTorsional
from cosserat_fenicsx.drilling.choose import BOTH
from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.torsion.model import TorsionWaves


class OtherSteps:
    """Models of the same motion with other steps, for `step_errors`: of a scene, by the name and the `StringModel` that
    computed it."""

    def __init__(self, scene, name, model):
        self._given, self.dt = (scene, name, model), model.dt

    def with_step(self, factor: float):
        """A new `StringModel` at rest, with so many times the step, and elements of so many times the length.

        Raises:
            SceneError: a step that the laws of friction do not allow, or a mesh that is as coarse as it can be.
        """
        scene, name, model = self._given
        if not isinstance(model, AxialTorsional) or isinstance(scene.string, Discs):
            return model_of(scene, name, factor * model.dt)
        asked = max(2, round((len(model.depths) - 1) / factor))
        other = model_of(scene, name, factor * model.dt, asked)
        if len(other.depths) - 1 > 1.2 * asked or asked * factor > 1.2 * (len(model.depths) - 1):
            refuse("simulate_drilling", "elements", asked, f"at least {len(other.depths) - 1}, one in each component")
        return other


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
