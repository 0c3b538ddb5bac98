"""Eq. (1) with n by the law, the motion being the only unknown."""

from cosserat_fenicsx.models.formulations.contact_force import OF_MOTION
from cosserat_fenicsx.models.formulations.formulation import Formulation

DISPLACEMENT = Formulation("displacement", default_degree=2, force=OF_MOTION)
