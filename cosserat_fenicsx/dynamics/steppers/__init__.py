"""Time integration schemes: one step from t to t + h. A new scheme is one file here, and its forms."""

from cosserat_fenicsx.dynamics.steppers.energy import Energy
from cosserat_fenicsx.dynamics.steppers.generalised_alpha import GeneralisedAlpha
from cosserat_fenicsx.dynamics.steppers.momentum import Momentum
from cosserat_fenicsx.dynamics.steppers.triple_jump import TripleJump

#: Steppers by the names of `simulate`; each follows `protocol.Stepper`.
SCHEMES = {"momentum": Momentum, "energy": Energy, "generalised-alpha": GeneralisedAlpha, "triple-jump": TripleJump}
