"""Motions on the command line: `cosserat run` and `cosserat explain` of a scene with a duration."""

from cosserat_fenicsx.errors import SceneError

#: Options of a motion, and those of an equilibrium path, by the names of the arguments of `simulate` and `solve`.
MOTION, PATH = (
    ("duration", "dt", "scheme", "save_every", "start", "folder"),
    ("load_factors", "bound", "formulation", "control", "branch"),
)
_BOTH = ("tol", "elements", "degree", "model")


def motion_of(options):
    """The scene and the arguments of `simulate`, or None where an equilibrium path is requested.

    Args:
        options: of the command line; they replace the arguments in the file.

    Raises:
        SceneError: a file that cannot be read, or an option of a path for a motion or vice versa.
    """
    from cosserat_fenicsx.scene.scenefile import read_motion

    given = {name: getattr(options, name, None) for name in (*MOTION, *PATH, *_BOTH)}
    given = {name: value for name, value in given.items() if value is not None}
    scene, settings = read_motion(options.scene)
    moves = not options.static and (settings or "duration" in given)
    for name in PATH if moves else MOTION:
        if name in given:
            refuse_other(name, moves)
    if not moves:
        return None
    if "dt" in given:
        settings.pop("tol", None)
    if "tol" in given:
        settings.pop("dt", None)
    return scene, {**settings, **given}


def refuse_other(name, moves):
    """Refuse an option of a path for a motion, or of a motion for a path.

    Raises:
        SceneError: always.
    """
    option = f"--{name.replace('_', '-')}"
    if moves:
        raise SceneError(f"{option} is for an equilibrium path, and this scene is a motion: expected --static as well")
    raise SceneError(
        f"{option} is for a motion, and this scene is an equilibrium path: expected a duration too, under [simulate] "
        "in the file or by --duration, and no --static"
    )
