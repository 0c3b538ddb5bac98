"""`cosserat explain` of a motion: the scene, the model, scheme and steps in sentences, without simulating."""

from cosserat_fenicsx.cli.explain import of_the_scene
from cosserat_fenicsx.dynamics.schemes import SCHEMES
from cosserat_fenicsx.dynamics.simulate import DEGREE, ELEMENTS, TOL, chosen_model, pace_of
from cosserat_fenicsx.dynamics.start import before
from cosserat_fenicsx.models.rod_data import check_inertia
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.scene.describe import describe
from cosserat_fenicsx.scene.magnitudes import check_magnitudes
from cosserat_fenicsx.scene.signals import signals_of

_UNKNOWNS = {"planar": "centreline and angle theta in a plane", "spatial": "centreline r and quaternion q in space"}


def explain_motion(scene, settings):
    """Sentences on a scene and the motion that would be simulated.

    Args:
        scene: a `Scene`.
        settings: arguments of `simulate`, `duration` among them.

    Raises:
        SceneError: arguments that `simulate` would refuse, or a rod without inertia.
    """
    checked = ("duration", "tol", "dt", "scheme", "save_every", "elements")
    pace_of(**{name: settings[name] for name in checked if name in settings})
    duration = settings["duration"]
    scene = scene.over(duration)
    check_inertia(scene)
    check_magnitudes(scene, settings.get("load_factor") or 1.0)
    scheme, start = settings.get("scheme", "momentum"), settings.get("start")
    elements, degree = settings.get("elements", ELEMENTS), settings.get("degree", DEGREE)
    model, why = chosen_model(scene, settings.get("model", "auto"), scheme)
    signature = Signature.of(scene, Layout.of(scene, elements), formulation="displacement", degree=degree, model=model)
    return "\n".join([
        *of_the_scene(scene),
        *(_inertia(rod) for rod in scene.rods),
        *(_in_time(item) for item in scene.moving),
        _start(scene, start, settings.get("load_factor")),
        f"Motion: {duration:g} s. {_steps(settings)} {_saved(settings)}",
        f"Scheme: {scheme}, of order {SCHEMES[scheme].order} in time.",
        f"Model: {model} ({_UNKNOWNS[model]}): {why}.",
        f"Mesh: {elements} element(s) of degree {degree} per rod, {signature.unknowns} unknowns; compare with more "
        "elements.",
    ])  # fmt: skip


def _inertia(rod):
    low, high = rod.profile.range
    mass = f"{low.mass:.4g}" + (f" to {high.mass:.4g}" if high.mass > low.mass else "")
    return f"Rod '{rod.name}': mass {mass} kg/m; {_damping(rod.damping)}."


def _damping(damping):
    parts = []
    if damping is not None:
        if damping.time:
            parts.append(f"Kelvin-Voigt damping, {damping.time:g} s times the stiffnesses")
        if damping.Kt is not None or damping.Jt is not None:
            parts.append("Kelvin-Voigt damping by its own numbers")
        if damping.drag:
            parts.append(f"a drag of {damping.drag:g} 1/s times the momentum")
    return " and ".join(parts) or "no damping"


def _in_time(item):
    """The functions of time of a load or support, and the times that steps end at."""
    parts = []
    for field, signal in signals_of(item).items():
        given = signal.function
        name = type(given).__name__ if type(given).__module__.endswith("signals") else "a function of time"
        marks = ", ".join(f"{t:g}" for t in signal.jumps if t >= 0)
        parts.append(f"{field} by {name}" + (f", steps end at t = {marks} s" if marks else ""))
    return f"{describe(item)} depends on time: {'; '.join(parts)}."


def _start(scene, start, load_factor):
    moving = ", ".join(velocity.rod.name for velocity in scene.velocities)
    velocities = f" with the initial velocity given for {moving}" if moving else ", at rest"
    if start is None:
        factor = "" if load_factor in (None, 1) else f" Loads and prescribed motions are multiplied by {load_factor:g}."
        return f"Start: the reference, free of stress{velocities}.{factor}"
    loads = ", ".join(describe(x) for x in before(scene).loads) or "prescribed motions"
    as_they_are = "as they are just before t = 0" if scene.moving else "constant"
    then = start if load_factor is None else load_factor
    after = "then the loads are removed" if then == 0 else f"then the load factor is {then:g}"
    return f"Start: the static equilibrium at load factor {start:g} ({loads}, {as_they_are}){velocities}; {after}."


def _steps(settings):
    if "dt" in settings:
        return f"Steps of {settings['dt']:g} s, halved where one fails."
    return (
        "Steps adapt: the local errors of all steps may add up to "
        f"tol = {settings.get('tol', TOL):g} times the longest rod's length."
    )


def _saved(settings):
    every = settings.get("save_every")
    return "Every step is saved." if every is None else f"States are saved every {every:g} s exactly."
