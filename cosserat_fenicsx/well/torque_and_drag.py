"""Torque and drag of a string in its hole: the model is chosen, solved, and said why."""

from cosserat_fenicsx.checks import instance, number, refuse
from cosserat_fenicsx.well.answer import TorqueAndDrag
from cosserat_fenicsx.well.buckled import buckled_string
from cosserat_fenicsx.well.hole import Borehole
from cosserat_fenicsx.well.ladder import model_errors, reasons
from cosserat_fenicsx.well.loaded import sections_of
from cosserat_fenicsx.well.mud import Mud
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.pieces import pieces_of
from cosserat_fenicsx.well.softstring import chain_of, soft_string
from cosserat_fenicsx.well.string import DrillString

SOFT, BUCKLED = "soft", "soft, buckled"
MODELS = ("auto", SOFT, BUCKLED)
CONVENTIONS = ("coulomb", "johancsik")
# A torque below this share of the largest tension times the contact radius is nothing that errors are compared with.
_LITTLE = 1e-2


def torque_and_drag(
    hole: Borehole,
    string: DrillString,
    operation: Operation,
    *,
    mud: Mud | None = None,
    depth: float | None = None,
    model: str = "auto",
    tol: float = 1e-4,
    torque_convention: str = "coulomb",
) -> TorqueAndDrag:
    """Hook load, surface torque and the state along a string in its hole, at rest or in steady slow motion.

    Args:
        hole: a `Borehole`. string: a `DrillString`.
        operation: what is done: `TripOut()`, `TripIn()`, `RotateOffBottom()`, `RotaryDrilling(weight, torque)`,
            `Sliding(weight)`, `Ream(speed, rpm)`, `BackReam(speed, rpm)` or `Static()`.
        mud: a `Mud`; None where all components have their weight in mud.
        depth: measured depth of the string's lower end, m; None for the bottom of the hole.
        model: "soft": a perfectly flexible string on the axis; "soft, buckled": with the wall force of a helix where
            the compression exceeds its load; "auto": the first that suffices for `tol`, as far as there is one.
        tol: relative accuracy that is asked for, of hook load and surface torque.
        torque_convention: wall force of a pipe that rotates, from its load across the hole |q|: "coulomb", |q|/sqrt(1 +
            (e mu)^2) with e the share of the slip that is around it: part of the load is carried by friction, as on the
            rod in contact; "johancsik", |q|, the convention of most programs, which gives a torque 3 to 4 % higher.

    Returns:
        a `TorqueAndDrag`; its `enough` is False where the accuracy asked for is beyond the model, and `why` says so.

    Raises:
        SceneError: a string that does not fit the hole, missing mud, an unknown model, or a string that locks up (with
            the place).
        NotConverged: the tolerance was not reached.
    """
    instance("torque_and_drag", "hole", hole, Borehole, "a Borehole")
    instance("torque_and_drag", "string", string, DrillString, "a DrillString")
    instance("torque_and_drag", "operation", operation, Operation, "an operation, such as TripOut()")
    instance("torque_and_drag", "mud", mud, (Mud, type(None)), "Mud(density), or None where weights are in mud")
    tol = number("torque_and_drag", "tol", tol, "a number from 1e-12 to 0.1", lambda x: 1e-12 <= x <= 0.1)
    if model not in MODELS:
        refuse("torque_and_drag", "model", model, " or ".join(f"'{name}'" for name in MODELS))
    if torque_convention not in CONVENTIONS:
        refuse("torque_and_drag", "torque_convention", torque_convention, "'coulomb' or 'johancsik'")
    depth = (
        hole.length
        if depth is None
        else number("torque_and_drag", "depth", depth, "a measured depth (m), positive", lambda x: x > 0)
    )

    pieces, laid = pieces_of(hole, string, operation, mud, depth)
    sections = sections_of([place.component for place in laid])
    chain = chain_of(pieces, torque_convention == "coulomb")
    soft = soft_string(chain, -operation.weight, operation.torque, tol)
    solved, used = soft, SOFT
    if model != SOFT:
        buckled = buckled_string(soft, pieces, sections, operation, tol)
        if model == BUCKLED or buckled is not None:
            solved, used = buckled or soft, BUCKLED
    left_out = model_errors(hole.path, pieces, solved, sections)
    scale = abs(solved.tension).max()
    largest = max(abs(solved.torque).max(), _LITTLE * scale * pieces.radius.max())
    error = max(_share(solved.error, scale), _share(solved.torque_error, largest))
    model_error = max(_share(left_out[0].total, scale), _share(left_out[1].total, largest))
    why = reasons(used, model, soft, solved, sections, left_out, (scale, largest), tol)
    return TorqueAndDrag(hole, string, operation, mud, depth, used, tol, torque_convention, why, error, model_error,
                         laid, pieces, solved)  # fmt: skip


def _share(part, whole):
    return float(part / whole) if whole > 0 else 0.0
