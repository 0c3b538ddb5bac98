"""Eq. (1) with an independent contact force: at the Gauss points, or as unknowns."""

from cosserat_fenicsx.models.formulations.contact_force import CARRIED, UNKNOWN
from cosserat_fenicsx.models.formulations.formulation import Formulation

MIXED = Formulation(
    "mixed",
    default_degree=4,
    force=CARRIED,
    rigid_force=UNKNOWN,
    models=("determinate", "planar", "spatial"),
    advice="a larger tol",
)
