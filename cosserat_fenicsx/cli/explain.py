"""`cosserat explain` of rods: sentences on the scene, the model, its size and its steps, without solving."""

import numpy as np

from cosserat_fenicsx.dynamics.schemes import SCHEMES
from cosserat_fenicsx.dynamics.simulate import DEGREE, ELEMENTS, TOL, chosen_model, pace_of
from cosserat_fenicsx.dynamics.start import before
from cosserat_fenicsx.models.signature import Signature, choose, fitting
from cosserat_fenicsx.models.formulation import formulation_of
from cosserat_fenicsx.models.rod_data import check_inertia
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.results.accuracy import FEW
from cosserat_fenicsx.results.compared import NAMES, words_of
from cosserat_fenicsx.scene.curves import Line, Spline
from cosserat_fenicsx.scene.action import actions_in_words, describe, some_of
from cosserat_fenicsx.scene.rolled import Profile
from cosserat_fenicsx.scene.scene import check_magnitudes
from cosserat_fenicsx.scene.sections import Rectangle, Stiffness
from cosserat_fenicsx.scene.signals import signals_of
from cosserat_fenicsx.statics.meshes import first_layout, meshes_for, resolving_turns, turning_in_law
from cosserat_fenicsx.statics.problem import check_arguments

#: The unknowns of a model, in a plane (True) or in space.
_UNKNOWNS = {
    ("determinate", True): "the angle theta along the rods alone",
    ("determinate", False): "the quaternion q along the rods alone",
    ("planar", True): "centreline and angle theta in a plane",
    ("spatial", False): "centreline r and quaternion q in space",
}

_MANY = 12  # rods from which on those alike are described together
_FREE = 8  # largest number of free ends that are named


def explain(scene, load_factors, settings):
    """Sentences on a scene, the model that would be solved, and its size; the arguments are those of `solve`."""
    formulation = formulation_of(settings.get("formulation"))
    elements, tol = settings.get("elements"), settings.get("tol", 1e-6)
    degree = settings.get("degree", formulation.default_degree)
    bound = settings.get("bound", NAMES)
    check_arguments(scene, tol, elements, bound)
    check_magnitudes(scene, np.abs(load_factors).max())
    follows = settings.get("branch") is not None or settings.get("control") == "arc"
    wanted = {"model": settings.get("model", "auto"), "formulation": formulation, "degree": degree, "follows": follows}
    choice = choose(scene, **wanted)
    many = isinstance(load_factors, tuple) or np.size(load_factors) > FEW
    if elements or follows:
        layout = Layout.of(scene, elements) if elements else first_layout(scene, degree)
    else:
        layout, _ = meshes_for(scene, degree, tol, many)
        largest = float(np.abs(load_factors).max())
        layout = turning_in_law(scene, resolving_turns(scene, layout, largest) or layout, load_factors)
    first = elements or max(layout.counts)

    def signature_of(model):
        return Signature.of(scene, layout, formulation=formulation, degree=degree, model=model)

    signature = signature_of(choice.model)
    lines = of_the_scene(scene)
    what = _UNKNOWNS[choice.model, signature.flat]
    lines.append(f"Model: {choice.model} ({what}): {'; '.join(choice.why)}.")
    if choice.promoted:
        lines.append("Where it loses its stability, in its plane or out of it, the spatial model takes over.")
    costs = (f"{signature_of(name).unknowns} {name}" for name in fitting(scene, formulation=formulation, degree=degree))
    lines.append(f"Unknowns on the first mesh by model: {', '.join(costs)}.")
    words = signature.formulation.words
    lines.append(f"{words[0].upper()}{words[1:]}.")
    unknowns = signature.unknowns
    if elements:
        lines.append(
            f"Mesh: {elements} element(s) of degree {degree} per rod, as asked: {unknowns} unknowns, no error estimate."
        )
    else:
        lines.append(
            f"Mesh: elements of degree {degree}, from {first} per rod ({unknowns} unknowns) refined until two meshes "
            f"agree to tol = {tol:g} in {', '.join(map(words_of, bound))}."
        )
    lines.append(f"Path: {_path(load_factors)}.")
    for leg in scene.legs if scene.stages else []:
        if leg.stage >= 0:
            part = choose(scene.of_leg(leg), **wanted)
            lines.append(f"Then {leg.words}: {_path(leg.load_factors)}; model: {part.model}: {'; '.join(part.why)}.")
    return "\n".join(lines)


def _path(load_factors):
    if isinstance(load_factors, tuple):
        return f"load factor {load_factors[0]:g} to {load_factors[1]:g} in steps the solver chooses"
    listed = ", ".join(f"{x:g}" for x in np.atleast_1d(load_factors))
    return f"load factors {listed}, reached exactly, with steps between where needed"


def of_the_scene(scene):
    """Sentences on rods, supports, loads and joints."""
    lines = [scene.title] if scene.title else []
    for named, rods in _alike(scene.rods, lambda x: (_curve(x.curve), _sections(x), _stiffnesses(x), _off(x))):
        rod, lengths = rods[0], [rod.length for rod in rods]
        slender = np.sqrt(rod.profile.range[1].K[2] / max(rod.profile.range[0].J[:2]))
        least, largest = min(lengths), max(lengths)
        lines.append(
            f"{named}: {_curve(rod.curve)}, length {_from_to(least, largest, 'g')} m, {_sections(rod)}; "
            f"{_stiffnesses(rod)}; slenderness L sqrt(EA/EI) = {_from_to(least * slender, largest * slender)}. "
            f"{'' if len(rods) == 1 else f'Of {rod.name}: '}{_directions(rod)}{_off(rod)}"
        )
    joints = [f"{joint.first} is joined to {joint.second}{_release(joint)}" for joint in scene.joints]
    lines.append(
        f"{len(scene.supports)} support(s): {some_of(map(describe, scene.supports)) or 'none'}. "
        f"{_free_ends(scene)}{actions_in_words(scene)}{f' {some_of(joints)}.' if joints else ''}"
    )
    return lines


def _alike(rods, told):
    """(names, [rods]) of every rod; of a large frame, of rods with the same description."""
    groups = {}
    for rod in rods:
        groups.setdefault(told(rod) if len(rods) > _MANY else rod.name, []).append(rod)
    for same in groups.values():
        names = some_of(f"'{rod.name}'" for rod in same)
        yield f"Rod {names}" if len(same) == 1 else f"{len(same)} rods {names}", same


def _off(rod):
    return f" Its mass centre is up to {rod.mass_centre.largest:.4g} m off the axis." if rod.mass_centre else ""


def _free_ends(scene):
    """A sentence that names the ends of rods without a support or a joint, among which a forgotten support is seen."""
    held = [*(x.station for x in scene.supports), *(end for x in scene.joints for end in (x.first, x.second))]
    held = {(station.rod.name, station.s) for station in held}
    free = [end for rod in scene.rods if not getattr(rod.curve, "closed", False) for end in (rod.start, rod.end)]
    free = [str(end) for end in free if (end.rod.name, end.s) not in held]
    more = f" and {len(free) - _FREE} more" if len(free) > _FREE else ""
    return f"Free ends: {', '.join(free[:_FREE]) or 'none'}{more}. "


def _curve(curve):
    """The type of a curve and the parameter that describes its shape."""
    if isinstance(curve, Spline):
        return f"{'closed ' if curve.closed else ''}Spline through {len(curve.points)} points"
    shape = {"Arc": ("angle", "rad"), "Helix": ("turns", "turns"), "UniformCurvature": ("curvature", "1/m")}
    if type(curve).__name__ not in shape:
        return type(curve).__name__
    name, unit = shape[type(curve).__name__]
    values = np.atleast_1d(getattr(curve, name))
    return f"{type(curve).__name__} ({', '.join(f'{x:g}' for x in values)} {unit})"


def _sections(rod):
    """The sections of a rod, one after the other."""
    parts, before = [], 0.0
    for end, section in rod.profile.pieces:
        if callable(section):
            part = " to ".join(_section(rod.section_at(s, side)) for s, side in ((before, "right"), (end, "left")))
            part = f"changing from {part}"
        else:
            part = _section(section)
        parts.append(part if len(rod.profile.pieces) == 1 else f"{part} up to s = {end:g} m")
        before = end
    return ", then ".join(parts)


def _release(joint):
    if joint.rigid:
        return " rigidly"
    ball = joint.release == "all"
    return " by a ball joint" if ball else f" by a hinge about ({', '.join(f'{x:.3g}' for x in joint.release)})"


def _section(section):
    """The type of a section and its dimensions."""
    if isinstance(section, Profile):
        return f"Profile {section.name}"
    given = {} if isinstance(section, Stiffness) else section.arguments()
    given = {name: x for name, x in given.items() if isinstance(x, float) and "factor" not in name}
    return type(section).__name__ + (f" ({', '.join(f'{name} {x:g} m' for name, x in given.items())})" if given else "")


def _stiffnesses(rod):
    """The stiffnesses of a rod, from least to largest where they change along it, and its slenderness."""
    low, high = rod.profile.range

    def spread(name, i):
        return _from_to(getattr(low, name)[i], getattr(high, name)[i])

    coupled = "; sections couple strains: EI about the principal axes" if rod.profile.coupled else ""
    return (
        f"EI = {spread('J', 0)}, {spread('J', 1)} N m^2, GJ = {spread('J', 2)} N m^2, EA = {spread('K', 2)} N, "
        f"GA = {spread('K', 0)}, {spread('K', 1)} N{coupled}"
    )


def _directions(rod):
    """The directions of d_1 and d_2 at the start, which orient sections that are not circular."""
    d1, d2 = (", ".join(f"{x:.3g}" for x in np.round(rod.curve.frame(0.0)[:, i], 12) + 0.0) for i in (0, 1))
    at = "" if isinstance(rod.curve, Line) else " at the start"
    for kind, across, up in ((Rectangle, "width runs", "height"), (Profile, "flanges run", "web")):
        if isinstance(rod.section_at(0.0), kind):
            return f"Its {across} along d1 = ({d1}), its {up} along d2 = ({d2}){at}."
    return f"d1 = ({d1}), d2 = ({d2}){at}."


def explain_motion(scene, settings):
    """Sentences on a scene and the motion that would be simulated; `settings`: arguments of `simulate`."""
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
        *(f"{named}: {_inertia(rods[0])}." for named, rods in _alike(scene.rods, _inertia)),
        *(_in_time(item) for item in scene.moving),
        _start(scene, start, settings.get("load_factor")),
        f"Motion: {duration:g} s. {_steps(settings)} {_saved(settings)}",
        f"Scheme: {scheme}, of order {SCHEMES[scheme].order} in time.",
        f"Model: {model} ({_UNKNOWNS[model, signature.flat]}): {why}.",
        f"Mesh: {elements} element(s) of degree {degree} per rod, {signature.unknowns} unknowns; compare with more "
        "elements.",
    ])  # fmt: skip


def _inertia(rod):
    low, high = rod.profile.range
    return f"mass {_from_to(low.mass, high.mass)} kg/m; {_damping(rod.damping)}"


def _from_to(low, high, digits=".4g"):
    return f"{low:{digits}}" + (f" to {high:{digits}}" if high > low else "")


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
        if getattr(item, "carried", None) is signal:
            parts.append(f"its surface moves, {signal.field} = {getattr(item, signal.field)} {signal.unit}/s")
            continue
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
