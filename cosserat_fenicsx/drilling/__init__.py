"""The drill-string in motion: torsional and axial waves, friction, bit laws, drives, and where they are stable.

Beside the public names of this package (`dir(cosserat_fenicsx.drilling)`), which `cosserat_fenicsx` has too, it has the
base classes of laws and drives of your own.
"""

import importlib
from typing import TYPE_CHECKING

import cosserat_fenicsx

if TYPE_CHECKING:
    from cosserat_fenicsx.drilling.bit_laws import BitLaw as BitLaw
    from cosserat_fenicsx.drilling.top_drive import DriveControl as DriveControl
    from cosserat_fenicsx.drilling.top_drive import Gains as Gains
    from cosserat_fenicsx.drilling.top_drive import Sample as Sample
    from cosserat_fenicsx.drilling.top_drive import SampledControl as SampledControl
    from cosserat_fenicsx.drilling.wall_friction import FrictionLaw as FrictionLaw

_BASES = {"bit_laws": ("BitLaw",), "top_drive": ("DriveControl", "Gains", "Sample", "SampledControl"),
          "wall_friction": ("FrictionLaw",)}  # fmt: skip
_HOMES = {name: module for module, names in _BASES.items() for name in names}


def __getattr__(name):
    if name in _HOMES:
        return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    if name in cosserat_fenicsx.names_in("drilling"):
        return getattr(cosserat_fenicsx, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__():
    return sorted({*_HOMES, *cosserat_fenicsx.names_in("drilling"), "__doc__", "__file__", "__name__", "__path__"})
