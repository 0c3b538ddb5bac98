"""Wells, the strings in them, and their equilibrium while they are moved, turned or held: torque and drag."""

from cosserat_fenicsx.names import public as _public

__getattr__, __dir__, __all__ = _public(__name__, __file__)
