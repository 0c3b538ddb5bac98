"""The drill-string in motion: torsional and axial waves, friction, bit laws, drives, and where they are stable."""

from cosserat_fenicsx.names import public as _public

__getattr__, __dir__, __all__ = _public(__name__, __file__)
