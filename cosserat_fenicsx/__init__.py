"""Geometrically exact rods on FEniCSx: equilibrium paths of special Cosserat rods under large displacements.

Names load when they are first used, so that `import cosserat_fenicsx` and the command line's --help stay instant.
"""

import importlib
from pathlib import Path as _FilePath

__version__ = "0.1.0"

_checkout = _FilePath(__file__).resolve().parent.parent
if (_checkout / "forms" / "spatial.py").is_file() and (_checkout / "pyproject.toml").is_file():
    # A plain checkout: forms/ lies beside the package, where an installation has it inside.
    __path__.append(str(_checkout))

_HOME = {
    "analytic": None,
    "Arc": "curves",
    "Buckling": "linear_buckling",
    "buckling": "linear_buckling",
    "Circle": "sections",
    "Clamp": "supports",
    "CosseratError": "errors",
    "Damping": "damping",
    "EccentricForce": "loads",
    "FollowerForce": "loads",
    "FollowerMoment": "loads",
    "Event": "records",
    "Force": "loads",
    "Hinge": "supports",
    "InstallationError": "errors",
    "Helix": "curves",
    "Interrupted": "errors",
    "Joint": "joints",
    "Line": "curves",
    "LineForce": "loads",
    "LineMoment": "loads",
    "Material": "materials",
    "Modes": "natural_modes",
    "modes": "natural_modes",
    "Moment": "loads",
    "NotConverged": "errors",
    "NotStored": "errors",
    "Path": "results",
    "Pin": "supports",
    "Prescribed": "supports",
    "Rectangle": "sections",
    "Rod": "rod",
    "Roller": "supports",
    "Scene": "scene",
    "SceneError": "errors",
    "Spline": "curves",
    "StepControl": "continuation",
    "Stiffness": "sections",
    "Tube": "sections",
    "UniformCurvature": "curves",
    "Weight": "loads",
    "euler_load": "rod",
    "read_motion": "scenefile",
    "read_scene": "scenefile",
    "InitialVelocity": "initial",
    "Ramp": "signals",
    "RunUp": "signals",
    "Step": "signals",
    "Triangle": "signals",
    "Sine": "signals",
    "Table": "signals",
    "History": "history",
    "simulate": "dynamics",
    "read_history": "resuming",
    "resume": "resuming",
    "solve": "statics",
}
__all__ = sorted(_HOME)


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module 'cosserat_fenicsx' has no attribute '{name}'")
    if _HOME[name] is None:
        return importlib.import_module(f"cosserat_fenicsx.{name}")
    value = getattr(importlib.import_module(f"cosserat_fenicsx.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
