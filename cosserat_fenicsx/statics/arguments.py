"""What functions of static scenes ask of their arguments."""

from cosserat_fenicsx.checks import tolerance, whole
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.remember import per_scene
from cosserat_fenicsx.results.compared import NAMES, criteria_of
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.stages import refuse_stages
from cosserat_fenicsx.scene.statical import check_no_mechanism


def check_arguments(scene, tol, elements, bound=NAMES, *, owner="solve"):
    """Refuse (SceneError) arguments of `solve`, or of another function (`owner`) of static scenes, out of range."""
    if not isinstance(scene, Scene):
        hint = ", as in read(file).scene" if hasattr(scene, "scene") else ""
        raise SceneError(f"scene is a {type(scene).__name__}: expected a Scene{hint}")
    if not scene.stages:
        check_static(scene)
    elif owner != "solve":
        refuse_stages(owner, scene)
    tolerance(owner, tol)
    criteria_of(bound)
    if elements is not None:
        whole(owner, "elements", elements)


@per_scene
def check_static(scene):
    """Refuse a scene without loads, or with parts that act in motions alone."""
    acts = scene.loads or any(support.moves for support in scene.supports)
    if not acts and scene.whole is scene:
        raise SceneError(
            "Scene.loads is empty: expected at least one load, such as Force(rod.end, (0, 0, -1)), or a Prescribed "
            "motion"
        )
    for item in scene.moving:
        raise SceneError(
            f"Scene: the {type(item).__name__} depends on time, which a static analysis excludes: expected a vector, "
            "a function of the arc length as Along(function), or a motion: cf.simulate(scene, duration) in Python, a "
            "duration under [simulate] in a scene file, --duration on the command line"
        )
    for action in scene.actions:
        if action.touches:
            raise SceneError(
                f"Scene: the {type(action).__name__} acts in motions alone: expected a TubeWall or a TubeRing for an "
                "equilibrium, or a motion: cf.simulate(scene, duration)"
            )
    check_no_mechanism(scene)
