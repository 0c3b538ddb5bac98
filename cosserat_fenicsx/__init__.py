"""Geometrically exact rods on FEniCSx: equilibrium paths of special Cosserat rods under large displacements.

Modules are imported when their names are first used, so that `import cosserat_fenicsx` and --help stay instant.
"""

import importlib
from os import path as _path

__version__ = "0.1.0"

_checkout = _path.dirname(_path.dirname(_path.realpath(__file__)))
if all(_path.isfile(_path.join(_checkout, *file)) for file in (("forms", "spatial.py"), ("pyproject.toml",))):
    # A plain checkout: forms/ lies beside the package; an installation has it inside.
    __path__.append(_checkout)

_HOME = {
    "analytic": None,
    "Action": "scene.action",
    "Along": "scene.along",
    "AlongPieces": "scene.along",
    "AlongTable": "scene.along",
    "Arc": "scene.curves",
    "Buckling": "results.buckling",
    "buckling": "statics.linear_buckling",
    "Circle": "scene.sections",
    "Clamp": "scene.supports",
    "CosseratError": "errors",
    "Damping": "scene.damping",
    "Dashpot": "actions.dashpot",
    "Drag": "actions.drag",
    "EccentricForce": "scene.loads",
    "FollowerForce": "scene.loads",
    "FollowerMoment": "scene.loads",
    "Event": "results.records",
    "Force": "scene.loads",
    "Foundation": "actions.foundation",
    "Hinge": "scene.supports",
    "InstallationError": "errors",
    "Helix": "scene.curves",
    "Interrupted": "errors",
    "Joint": "scene.joints",
    "Line": "scene.curves",
    "LineAction": "scene.action",
    "LineForce": "scene.loads",
    "LineMoment": "scene.loads",
    "Material": "scene.materials",
    "Modes": "results.modes",
    "modes": "dynamics.natural_modes",
    "Moment": "scene.loads",
    "NotConverged": "errors",
    "NotStored": "errors",
    "Path": "results.path",
    "Pin": "scene.supports",
    "PointAction": "scene.action",
    "PointMass": "actions.point_mass",
    "Prescribed": "scene.supports",
    "Profile": "scene.rolled",
    "Rectangle": "scene.sections",
    "Rod": "scene.rod",
    "Roller": "scene.supports",
    "Scene": "scene.scene",
    "SceneError": "errors",
    "Spline": "scene.curves",
    "Spring": "actions.spring",
    "StepControl": "statics.path.load_control",
    "Stiffness": "scene.sections",
    "Tube": "scene.sections",
    "UniformCurvature": "scene.curves",
    "units": None,
    "Wall": "actions.wall",
    "Weight": "scene.loads",
    "euler_load": "scene.rod",
    "read_motion": "scene.scenefile",
    "read_path": "statics.reading",
    "read_scene": "scene.scenefile",
    "InitialVelocity": "scene.initial",
    "Ramp": "scene.signals",
    "RunUp": "scene.signals",
    "Step": "scene.signals",
    "Triangle": "scene.signals",
    "Sine": "scene.signals",
    "Table": "scene.signals",
    "History": "results.history",
    "simulate": "dynamics.simulate",
    "read_history": "dynamics.resuming",
    "resume": "dynamics.resuming",
    "solve": "statics.solve",
}
__all__ = sorted(_HOME)


def names_in(subpackage):
    """The public names defined in a subpackage."""
    return [name for name, home in _HOME.items() if home and home.startswith(f"{subpackage}.")]


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
