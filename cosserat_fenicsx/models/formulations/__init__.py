"""The formulations of eq. (1), by the names that `solve` takes; adding one is one file and its line here."""

from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.models.formulations.displacement import DISPLACEMENT
from cosserat_fenicsx.models.formulations.formulation import Formulation
from cosserat_fenicsx.models.formulations.mixed import MIXED
from cosserat_fenicsx.models.formulations.multiplier import MULTIPLIER

FORMULATIONS = {formulation.name: formulation for formulation in (MIXED, DISPLACEMENT, MULTIPLIER)}


def formulation_of(name=None):
    """The `Formulation` of a name, the default for None; one that is given is returned as it is.

    Raises:
        SceneError: an unknown name.
    """
    if isinstance(name, Formulation):
        return name
    name = MIXED.name if name is None else name
    if not isinstance(name, str) or name not in FORMULATIONS:
        raise SceneError(f"formulation = {name!r}: {nearest(name, FORMULATIONS)}")
    return FORMULATIONS[name]
