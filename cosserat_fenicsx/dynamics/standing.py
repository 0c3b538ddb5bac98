"""The equilibrium that a motion starts from, where a load factor asks for one."""

import math
import sys

from cosserat_fenicsx.checks import number
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.signals import at
from cosserat_fenicsx.statics.solve import solve

# s: the latest time before 0
_BEFORE = -sys.float_info.min


def before(scene):
    """A scene as it stands before its motion: what depends on time as it is just before t = 0, no velocities.

    `Step`s, `Ramp`s and `Sine`s that start at 0 are not there yet; one that ends there is: it lets go at t = 0.
    """
    supports, loads = ([at(item, _BEFORE) for item in items] for items in (scene.supports, scene.loads))
    return Scene(scene.rods, supports, loads, scene.joints, scene.title)


def equilibrium(scene, load_factor, *, model, elements, degree, comm):
    """The `Path` to the equilibrium of a scene before its motion, on the mesh of the motion.

    Args:
        scene: the scene of the motion.
        load_factor: of all its loads and prescribed motions; not zero.
        model, elements, degree, comm: of the motion.

    Raises:
        SceneError: no such load factor, or a scene that has no equilibrium.
        NotConverged: it is not reached.
    """
    number("simulate", "start", load_factor, "a load factor that is finite and not 0", lambda x: math.isfinite(x) and x)
    standing = before(scene)
    model = "planar" if model != "spatial" and standing.plane is not None else "spatial"
    return solve(standing, [load_factor], model=model, elements=elements, degree=degree, comm=comm, progress=False)
