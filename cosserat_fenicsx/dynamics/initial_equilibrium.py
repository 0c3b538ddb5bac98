"""The static equilibrium that a motion starts from, where `simulate(start=)` is a load factor."""

import math
import sys

from cosserat_fenicsx.checks import number
from cosserat_fenicsx.models.choose import not_flat
from cosserat_fenicsx.scene.action import has_permanent
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.signals import at
from cosserat_fenicsx.statics.solve import solve

# The largest time below 0 (s) that keeps full precision.
_BEFORE = -sys.float_info.min


def before(scene):
    """The scene just before its motion: functions of time evaluated just before t = 0, without initial velocities.

    A `Step`, `Ramp` or `Sine` that starts at 0 does not act yet; one that ends at 0 still acts, and is released at 0.
    """
    supports, loads = ([at(item, _BEFORE) for item in items] for items in (scene.supports, scene.loads))
    return Scene(scene.rods, supports, loads, scene.joints, scene.title)


def equilibrium(scene, load_factor, *, model, elements, degree, comm):
    """The `Path` to the equilibrium of a scene before its motion, on the mesh of the motion.

    Args:
        scene: the scene of the motion.
        load_factor: multiplies its loads and prescribed motions; zero only with permanent loads.
        model, elements, degree, comm: those of the motion.

    Raises:
        SceneError: a load factor that is zero or not finite, or a scene that has no equilibrium.
        NotConverged: the solver does not reach the equilibrium.
    """
    standing = before(scene)
    if has_permanent(standing):
        number("simulate", "start", load_factor, "a finite load factor", math.isfinite)
    else:
        expected = "a load factor that is finite and not 0"
        number("simulate", "start", load_factor, expected, lambda x: math.isfinite(x) and x)
    model = "planar" if model != "spatial" and not not_flat(standing) else "spatial"
    return solve(standing, [load_factor], model=model, elements=elements, degree=degree, comm=comm, progress=False)
