"""Functions of time, and of the arc length along a rod, for loads, supports, drives and profiles."""

from cosserat_fenicsx.names import public as _public

__getattr__, __dir__, __all__ = _public(__name__, __file__)
