"""Geometrically exact (Cosserat) rods on FEniCSx: equilibria at large displacements, buckling and motion of frames,
cables, springs; strings in wells (`well`: torque and drag, buckling) and drilling (`drilling`: stick-slip, whirl).

The public names stand in `__init__.pyi`. Modules are imported when their names are first used, so that `import
cosserat_fenicsx` and --help stay instant.
"""

from cosserat_fenicsx.names import public as _public
from cosserat_fenicsx.ranks import watch as _watch

__version__ = "0.2.0"
__getattr__, __dir__, __all__ = _public(__name__, __file__)

_watch()
