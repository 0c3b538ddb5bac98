"""The choice of the model of a drill-string in motion, its reasons, and what the model leaves out."""

import warnings
from functools import partial

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.torsion import TorsionWaves
from cosserat_fenicsx.drilling.wall_friction import law_of, rotating
from cosserat_fenicsx.errors import NotConverged, SceneError, SceneWarning, nearest
from cosserat_fenicsx.well import criteria
from cosserat_fenicsx.well.operations import TripIn, TripOut
from cosserat_fenicsx.well.solve import torque_and_drag

TORSION, BOTH = "torsion", "axial and torsional"
MODELS = ("auto", TORSION, BOTH)


def chosen(scene, model="auto"):
    """(name, [sentence]): the model and its reasons; a SceneError for one that is unknown or does not fit the scene."""
    if not isinstance(model, str) or model not in MODELS:
        raise SceneError(f"simulate.model = {model!r}: {nearest(model, MODELS)}")
    if scene.discs:
        fits = TORSION if scene.discs.masses is None else BOTH
        what = "discs without masses turn alone" if fits == TORSION else "the discs have masses"
        if model not in ("auto", fits):
            raise SceneError(f"simulate.model = '{model}': expected '{fits}' or 'auto': {what}")
        return fits, [f"{fits}: {what}"]
    asks = _asks_for_axial(scene)
    if model == "auto":
        name = BOTH if asks else TORSION
        weight = "is the one given over time" if scene.bit and scene.bit.varies else "stays as it is"
        stays = f", and the weight on bit {weight}" if scene.bit and scene.bit.law.needs_weight else ""
        why = asks or [f"nothing moves along the axis{stays}"]
        return name, [f"{name}: {'; '.join(why)}", *_left_out(scene, name)]
    why = [f"{model}: as asked"]
    if model == TORSION and asks:
        if scene.bit is not None and scene.bit.law.drills:
            raise SceneError(f"simulate.model = '{TORSION}': expected '{BOTH}' or 'auto', since with "
                             f"{type(scene.bit.law).__name__} {scene.bit.law.lifts}")  # fmt: skip
        why.append(f"APPROXIMATE: torsion alone leaves out the axial motion ({'; '.join(asks)})")
    return model, [*why, *_left_out(scene, model)]


def _asks_for_axial(scene):
    """Reasons for axial motion, in words; empty where the string only turns, which leaves its equilibrium as it is."""
    hook, found = scene.hook, []
    if hook is not None and not (hook.signal().constant and hook.signal()(0.0) == 0.0):
        found.append("the hook moves")
    if hook is not None and hook.autodriller is not None:
        found.append("an autodriller moves the block")
    found += [f"{joint.tool.name} shakes the string" for joint in scene.joints if not joint.turns]
    return found + ([scene.bit.law.lifts] if scene.bit is not None and scene.bit.law.lifts else [])


def _left_out(scene, name):
    """Sentences on the approximations of a string on the axis of the hole."""
    bent = scene.string.bent
    found = [f"APPROXIMATE: the bend of {bent} is left out: the string lies on the axis"] if bent else []
    if scene.bit is not None and scene.bit.varies and scene.hole is not None:
        found.append("APPROXIMATE: friction at the wall is that under the weight on bit at the start")
    return found + _stalls(scene) + _pushed(scene) + (_buckled(scene, name) if scene.hole is not None else [])


def _stalls(scene):
    """Sentences where a bit at rest holds more than a motor gives."""
    law = scene.motor and scene.bit.law.resistance(scene.bit.most)
    return [
        f"{motor.name} gives at most {stall:.5g} N m at the start, and the bit at rest holds {law.still:.5g} N m"
        ": where it sticks the motor stalls"
        for motor in scene.motors
        if law and law.still >= (stall := max(motor.stall_torque(), 0.0))
    ]


def _heaviest(scene):
    """The largest weight on bit (N), at rest or by an autodriller; 0 without one."""
    driller = scene.hook and scene.hook.autodriller
    return max(scene.bit.most or 0.0 if scene.bit else 0.0, driller.signal().largest if driller else 0.0)


def _pushed(scene):
    """A sentence where the weight on bit exceeds the weight of the string along the hole."""
    weight = _heaviest(scene)
    depths = np.concatenate([[0.0], np.cumsum([part.length for part in scene.segments])])
    down = depths if scene.hole is None else np.array([scene.hole.path.position(md)[2] for md in depths])
    along = float(np.dot([part.weight for part in scene.segments], np.diff(down)))
    if weight <= along:
        return []
    return [
        f"APPROXIMATE: the weight on bit, {weight / 1e3:.4g} kN, is more than the string weighs along the hole, "
        f"{along / 1e3:.4g} kN: the hook would have to push by {(weight - along) / 1e3:.4g} kN"
    ]


def _buckled(scene, name):
    """A sentence where the compression exceeds the buckling load in the hole."""
    try:
        states = [torque_and_drag(_with_friction(scene), scene.string, operation, mud=scene.mud, depth=scene.bit_depth,
                                  model="soft") for operation in _operations(scene)]  # fmt: skip
    except NotConverged as problem:
        return [f"whether the string buckles in the hole is unknown: {problem}"]
    worst = max(states, key=lambda answer: (answer.buckling > criteria.STRAIGHT).sum())
    bent = worst.buckling > criteria.STRAIGHT
    if not bent.any():
        return []
    top, bottom = worst.md[bent].min(), worst.md[bent].max()
    what = criteria.STATES[int(worst.buckling.max())]
    where = f"between md = {top:.5g} and {bottom:.5g} m"
    load = f"{worst.operation.name}, {-worst.tension[bent].min() / 1e3:.4g} kN"
    return [
        f"APPROXIMATE: the compression {where} is above the load of {what} buckling in the hole ({load}): the {name} "
        "model stays on the axis and leaves out what buckling adds; that takes a rod model"
    ]


def _operations(scene):
    """Steady operations, of which the one that compresses the string most is not known in advance."""
    bit, weight = scene.bit, _heaviest(scene)
    law = None if bit is None else bit.law.resistance(bit.most)
    torque = law.kinetic if law else 0.0
    if any(torque >= motor.stall_torque() for motor in scene.motors):
        torque = 0.0  # no steady state; `_stalls` tells it, and buckling hardly depends on the torque
    yield rotating(weight, torque)
    if scene.hook is not None:
        signal = scene.hook.signal()
        speeds = [signal(t) for t in (0.0, *signal.jumps)]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)  # the block moves up while the bit still presses
            moves = (TripIn, min(speeds) < 0), (TripOut, max(speeds) > 0)
            moves = [kind(weight) for kind, there in moves if there]
        yield from moves


def _with_friction(scene):
    """The hole with the kinetic friction of the motion."""
    if scene.friction is None:
        return scene.hole
    law, _, of_hole = law_of(scene.friction)
    return scene.hole.with_friction([law.kinetic * (x.friction if of_hole else 1.0) for x in scene.hole.sections])


def fastest(scene, until):
    """The largest size of the drive's speed up to a time (s), rad/s; 0 for a motor."""
    signal = scene.drive.signal()
    times = np.unique([*np.linspace(0.0, until, 201), *(t for t in signal.jumps if 0 <= t <= until)])
    return max(abs(signal(t)) for t in ([0.0] if signal.constant else times))


def with_step(scene, name, model, factor: float):
    """A new `StringModel` at rest with the step of another one, and the length of its elements, times a factor. Raises
    SceneError: a step that the laws of friction do not allow, or a mesh that is as coarse as it can be."""
    if isinstance(model, TorsionWaves) or scene.discs:
        return model_of(scene, name, factor * model.dt)
    asked = max(2, round((len(model.depths) - 1) / factor))
    other = model_of(scene, name, factor * model.dt, asked)
    if len(other.depths) - 1 > 1.2 * asked or asked * factor > 1.2 * (len(model.depths) - 1):
        refuse("simulate", "elements", asked, f"at least {len(other.depths) - 1}, one in each component")
    return other


def on_same_mesh(scene, name, model):
    """Functions that return models with half the step of another one, on its mesh, where the friction at the wall of a
    string by elements falls with the slip. Such friction amplifies waves of all lengths, the short ones too, whose
    speed on a mesh depends on the ratio of step and element, which `with_step` keeps."""
    if isinstance(model, TorsionWaves) or scene.friction is None or not scene.friction.decays:
        return ()
    return (partial(model_of, scene, name, model.dt / 2, len(model.depths) - 1 - len(scene.joints)),)


def model_of(scene, name, dt=None, elements=None):
    """A new `StringModel` at rest. name: "torsion" or "axial and torsional". dt: step, s. elements: how many along the
    string. Both None for those of the model; waves of torsion have cells of one step, so that one of the two decides.
    Raises SceneError: a scene that the model has no equations for; steps that its laws do not allow."""
    if scene.discs and elements is not None:
        refuse("simulate", "elements", elements, "None for Discs, which are not divided")
    if scene.by_elements or name == BOTH:
        return AxialTorsional(scene, dt, elements, axial=name == BOTH)
    if dt is not None and elements is not None:
        refuse("simulate", "elements", elements, "None beside dt: waves of torsion have cells of one step")
    return TorsionWaves(scene, dt, elements)
