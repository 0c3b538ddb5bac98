"""Choose a torque-and-drag model, solve it, and report the reason."""

from dataclasses import replace

import numpy as np

from cosserat_fenicsx.checks import instance, number, refuse
from cosserat_fenicsx.errors import InstallationError, NotConverged, SceneError
from cosserat_fenicsx.progress import Plan
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.units import rpm
from cosserat_fenicsx.well.answer import TorqueAndDrag, scales_of, share
from cosserat_fenicsx.well.buckled import LockUp, buckled_string
from cosserat_fenicsx.well.components import DrillString
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.model_error import model_errors
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.pieces import pieces_of, rings_of, sections_of
from cosserat_fenicsx.well.rod.rod_answer import longest, rod_in_contact
from cosserat_fenicsx.well.softstring import chain_of, soft_string
from cosserat_fenicsx.well.tools import MudMotor

AUTO, SOFT, BUCKLED, ROD = "auto", "soft", "buckled", "rod"
MODELS = (AUTO, SOFT, BUCKLED, ROD)
CONVENTIONS = ("coulomb", "johancsik")
_QUANTITIES = {"hook load": "N", "surface torque": "N m"}
_LOCKS_UP = "WITH THE WALL FORCE OF A HELIX IT LOCKS UP"
_HOW_LONG = "solving the rod in contact mostly takes a second, and ends after about"
_NO_ROD = (
    "the exact rod in contact is not tried: beyond helical buckling there are many equilibria, and it may return "
    "another one than the string's; use model='rod' to force it"
)


def torque_and_drag(
    hole: Borehole,
    string: DrillString,
    operation: Operation,
    *,
    mud: Mud | None = None,
    depth: float | None = None,
    model: str = AUTO,
    tol: float = 1e-4,
    torque_convention: str = "coulomb",
    progress: bool | None = None,
) -> TorqueAndDrag:
    """Hook load, surface torque and the state along a string in its hole, at rest or in steady slow motion.

    Args:
        hole: a `Borehole`. string: a `DrillString`.
        operation: such as `TripOut()`, `TripIn()`, `RotateOffBottom()`, `RotaryDrilling(weight, torque)`,
            `Sliding(weight)`, `Ream(speed, rpm)`, `BackReam(speed, rpm)` or `Static()`.
        mud: a `Mud`; None where all components have their weight in mud.
        depth: measured depth of the string's lower end, m; None for the bottom of the hole.
        model: "soft": a perfectly flexible string on the axis; "buckled": with the wall force of a helix where
            the compression exceeds its load; "rod": the exact rod in contact, which is stiff and has a clearance;
            "auto": the first of these that suffices for `tol`, but not the rod where there is a helix, since it has
            many equilibria there.
        tol: relative accuracy that is asked for, of hook load and surface torque.
        torque_convention: wall force of a pipe that rotates, from its load across the hole q: "coulomb",
            q/sqrt(1 + e^2 mu^2) with e the share of the slip that is around it: part of the load is carried by
            friction, as on the rod in contact; "johancsik", q itself, the convention of most programs, which gives a
            torque 2 to 4 % higher at a friction of 0.2 to 0.3.
        progress: of the rod; True or False; None shows it in runs of more than two seconds, and says after the first
            one which model is solved, and for how long at most.

    Returns:
        a `TorqueAndDrag`. Its `enough` is False where the accuracy asked for is beyond the model, or where `model` is
        "auto" and the rod could not be solved as accurately, or not at all: its answer, or the soft string's, is then
        returned, and `why` says so.

    Raises:
        SceneError: a string that does not fit the hole, missing mud, an unknown model, a string that locks up (with the
            place), or one that is no rod in contact where `model` is "rod".
        NotConverged: the tolerance was not reached.
    """
    instance("torque_and_drag", "hole", hole, Borehole, "a Borehole")
    instance("torque_and_drag", "string", string, DrillString, "a DrillString")
    instance("torque_and_drag", "operation", operation, Operation, "an operation, such as TripOut()")
    instance("torque_and_drag", "mud", mud, (Mud, type(None)), "Mud(density), or None where weights are in mud")
    tol = check_settings(model, tol, torque_convention)
    if depth is None:
        depth = hole.length
    depth = number("torque_and_drag", "depth", depth, "a measured depth (m), positive", lambda x: x > 0)
    pieces, laid = pieces_of(hole, string, operation, mud, depth)
    given = hole, string, operation, mud, depth
    flexible, why = _flexible(given, model, tol, torque_convention, pieces, laid)
    if model in (SOFT, BUCKLED) or (model == AUTO and flexible.enough):
        return flexible
    if model == AUTO and flexible.model == BUCKLED:
        return replace(flexible, why=(*flexible.why, _NO_ROD))
    told = "" if model == ROD else f"{why[-1].rpartition(': ')[0] or why[-1]}: "
    try:
        with Plan(f"torque_and_drag, {operation.name}: {told}{_HOW_LONG} {longest(tol):.0f}", progress, world()):
            return rod_in_contact(flexible, why, progress, exact=model == ROD)
    except (SceneError, NotConverged, InstallationError) as problem:
        if model == ROD:
            if isinstance(problem, NotConverged):
                problem.args = ("; ".join([str(problem), *_instead(flexible, why)]),)
            raise
        failed = f"the exact rod in contact was tried, and not solved: {problem}"
        return replace(flexible, why=(*flexible.why, failed))


def _instead(flexible, why):
    """Sentences on what the flexible string says where the rod was not solved."""
    locked = [line for line in why if line.startswith(_LOCKS_UP)]
    yield from locked
    if not locked:
        helix = ", with the wall force of a helix" if flexible.model == BUCKLED else ""
        off = f"may be off by {flexible.left_out[0]:.2g} N" if np.isfinite(flexible.left_out[0]) else "may lock up"
        yield (
            f"model='{flexible.model}', the flexible string{helix}, has a hook load of {flexible.hook_load:.5g} N and "
            f"{off}"
        )


def check_settings(model=AUTO, tol=1e-4, torque_convention=CONVENTIONS[0]):
    """`tol`, where `torque_and_drag` takes it and the others.

    Raises:
        SceneError: it does not.
    """
    if model not in MODELS:
        refuse("torque_and_drag", "model", model, " or ".join(f"'{name}'" for name in MODELS))
    if torque_convention not in CONVENTIONS:
        refuse("torque_and_drag", "torque_convention", torque_convention, "'coulomb' or 'johancsik'")
    return number("torque_and_drag", "tol", tol, "a number from 1e-12 to 0.1", lambda x: 1e-12 <= x <= 0.1)


def _flexible(given, model, tol, torque_convention, pieces, laid):
    """The `TorqueAndDrag` of the soft string, buckled where it is a helix and `model` is not "soft"; and sentences on
    why it is not the answer where it is not."""
    path, operation = given[0].path, given[2]
    sections = sections_of([place.component for place in laid])
    rings = rings_of(laid, given[0])
    soft = soft_string(chain_of(pieces, torque_convention == "coulomb"), -operation.weight, operation.torque, tol)
    buckled, locked = None, []
    if model != SOFT:
        try:
            buckled = buckled_string(soft, pieces, sections, tol)
        except LockUp as stuck:
            if model != ROD:
                raise
            locked.append(f"{_LOCKS_UP}: {stuck}")
    solved, used = buckled or soft, BUCKLED if buckled or model == BUCKLED else SOFT
    left_out, scales = model_errors(path, pieces, soft, solved, sections, rings), scales_of(solved, pieces)
    error = max(map(share, (solved.error, solved.torque_error), scales))
    shares = {what: share(parts.total, scale) for what, parts, scale in zip(_QUANTITIES, left_out, scales, strict=True)}
    why = [f"model = '{model}' as asked"] if model != AUTO else []
    why += [*_on_buckling(model, soft, solved, sections), *_on_what_is_left_out(used, left_out, shares), *locked]
    EA = sections.EA[pieces.component[solved.chain.origin]][:, None]
    strain = float(np.nan_to_num(np.abs(solved.tension) / EA).max())
    if strain > 0.01:
        why.append(f"BEYOND WHAT ANY PIPE CARRIES: the tension strains it by {100 * strain:.3g} %")
    beyond = [what for what, part in shares.items() if part > tol - error]
    why += _on_motor(given[1], operation)
    whole = [*why, *(f"NOT ENOUGH for tol = {tol:g} in the {what}" for what in beyond)]
    if model == AUTO and beyond:
        exceeding = " and the ".join(beyond)
        why.append(f"the {used} string's error in the {exceeding} exceeds tol = {tol:g}: solving the rod in contact")
    ends = [(x.tension[-1, -1], x.torque[-1, -1]) for x in (solved, soft)]
    differences = {SOFT: tuple(float(a - b) for a, b in zip(*ends, strict=True))} if buckled else {}
    answer = TorqueAndDrag(*given, used, tol, torque_convention, tuple(whole), error, max(shares.values()),
                           tuple(parts.total for parts in left_out), differences, laid, pieces, solved,
                           rod_in_contact)  # fmt: skip
    if bent := given[1].bent:
        unknown = (
            f"THE BEND of {bent} IS NOT IN IT: a string on the axis of the hole has none, and what it "
            "adds to the wall's forces is not estimated; model='rod' has it"
        )
        answer = replace(answer, why=(*answer.why, unknown), model_error=np.inf, left_out=(np.inf, np.inf))
        why.append(f"{bent} is bent: solving the rod in contact, which has the bend")
    return answer, why


def _on_motor(string, operation):
    """A sentence on a motor under the torque on bit.

    Raises:
        SceneError: it stalls.
    """
    for motor in (part for part in string.components if isinstance(part, MudMotor)):
        speed = motor.running(type(operation).__name__, operation.torque)
        yield (
            f"{motor.name}: turns the bit by {speed / rpm:.4g} rpm beside the string's rotation, with "
            f"{motor.pressure(operation.torque) / 1e5:.4g} bar over it"
        )


def _on_buckling(asked, soft, solved, sections):
    """Sentences on whether the soft string is buckled, from the `Solved` without and with buckling."""
    if np.isnan(sections.EI).any():
        yield "bending stiffness is not known for all components: these are taken as not buckled"
    if solved.helical.any():
        change = float(solved.tension[-1, -1] - soft.tension[-1, -1])
        length = solved.chain.length[solved.helical].sum()
        yield (
            f"helically buckled over {length:.4g} m: the wall force of the helix changes the hook load of the soft "
            f"string by {change:+.4g} N"
        )
    elif asked == AUTO:
        yield "no helical buckling"


def _on_what_is_left_out(used, left_out, shares):
    """Sentences on the `ModelError` of each quantity, and its share of the quantity."""
    for (what, unit), parts, part in zip(_QUANTITIES.items(), left_out, shares.values(), strict=True):
        if np.isinf(part):
            yield f"{what} of the {used} string: it may lock up: with a helix from the load of a snake on, it does"
        elif part > 1e-9:
            sizes = parts._asdict().items()
            of = [f"{name.replace('_', ' ')} {value:.3g} {unit}" for name, value in sizes if value > 1e-3 * parts.total]
            yield (
                f"{what} of the {used} string: the rod in contact may differ by {parts.total:.3g} {unit}, {part:.1e} "
                f"({', '.join(of)})"
            )
