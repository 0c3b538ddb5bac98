"""The exact rod in contact as the third rung of the ladder: a string, its hole and an operation, handed to
`solve_in_hole`.

A stabiliser touches with its blades in the middle of its length, a bit at the lower end of the string: both are rings.
Their bodies, and all other components, touch with their contact radius along their whole length.
"""

import contextlib

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.well.components import weight_in_mud
from cosserat_fenicsx.well.rings import is_ring, ring_of
from cosserat_fenicsx.well.rod.rod_answer import RodInContact
from cosserat_fenicsx.well.rod.starts import energy_of_helix, turns_of_helix


def rod_in_contact(flexible, decided, progress=None, exact=True):
    """The `RodInContact` of the same string in the same hole as a soft one.

    Args:
        flexible: the `TorqueAndDrag` by the soft string; decided: sentences on why it is not enough; progress: see
            `solve`. exact: False for an answer that may be less accurate than asked, and says so.

    Raises:
        SceneError: a component without stiffness, or as wide as the hole; a weight in mud that is not positive;
            Johancsik's convention of a torque.
        NotConverged: no equilibrium was found, or not as accurately as asked.
    """
    # imported here, since it needs dolfinx, which the soft string does not
    from cosserat_fenicsx.well.rod.rod_in_hole import NotAccurate, solve_in_hole

    laid = flexible.laid[::-1]  # from the top down
    hole, operation = flexible.hole, flexible.operation
    check_rod(hole, laid, operation, flexible.mud, flexible.torque_convention)

    def solve(helix):
        """The `InHole`, and what it is short of accuracy in words, or None."""
        try:
            return solve_in_hole(
                hole.path,
                [place.bottom - place.top for place in laid],
                [place.component.stiffness for place in laid],
                [weight_in_mud(place.component, flexible.mud) for place in laid],
                [_body_radius(place.component) for place in laid],
                radius=_along(hole, flexible.depth, lambda section: section.diameter / 2),
                friction=_along(hole, flexible.depth, lambda section: section.friction),
                slip=[operation.direction(place.component.contact_radius) for place in laid],
                bottom_tension=-operation.weight,
                bottom_torque=operation.torque,
                rings=[ring_of(place, hole)[:3] for place in laid if is_ring(place.component)],
                wall_stiffness=hole.wall_stiffness,
                helix=helix,
                tol=flexible.tol,
                progress=progress,
            ), None
        except NotAccurate as short:
            if exact:
                raise
            return short.answer, short

    solved, short = solve(helix=False)
    if solved.negative_modes:
        with contextlib.suppress(NotConverged):
            helix, shorter = solve(helix=True)
            if helix.negative_modes == 0:
                decided = (
                    *decided,
                    "begun as a helix: from the axis an equilibrium was found that would buckle, "
                    f"{solved.negative_modes} negative eigenvalues of the second variation",
                    *_of_hand(helix),
                )
                solved, short = helix, shorter
    if short is not None:
        decided = (*decided, f"NOT ENOUGH for tol = {flexible.tol:g}: {short}")
    return RodInContact._of(flexible, solved, decided)


def _of_hand(solved):
    """A sentence on the hand of a helix, and its energy beside that of the other one, where it is most compressed."""
    at = int(np.argmin(solved.tension))
    EI = solved.string.bending[solved.string.section_at(solved.s[at])]
    compression, torque, hand = max(-solved.tension[at], 0.0), solved.torque[at], solved.string.hand
    energies = [energy_of_helix(EI, compression, torque, solved.string.clearance,
                                turns_of_helix(EI, compression, torque, h)) for h in (hand, -hand)]  # fmt: skip
    yield (
        f"the helix was begun {'clockwise' if hand > 0 else 'counterclockwise'} looking down the hole, "
        f"{'the hand that the torque favours' if abs(torque) > 0 else 'as the other hand is equal'}: with the largest "
        f"compression, {compression:.4g} N, and {torque:.4g} N m a long helix has {energies[0]:.5g} J/m more than the "
        f"straight string, of the other hand {energies[1]:.5g} J/m"
    )


def check_rod(hole, laid, operation, mud, torque_convention):
    """Refuse what is no rod in contact.

    Args:
        laid: the components in their places; the others: see `torque_and_drag`.

    Raises:
        SceneError: see `rod_in_contact`.
    """
    turns = any(operation.direction(place.component.contact_radius)[1] for place in laid)
    if torque_convention != "coulomb" and turns:
        refuse("torque_and_drag", "torque_convention", torque_convention,
               "'coulomb', the law that the rod in contact follows")  # fmt: skip
    for place in laid:
        _check(place, hole, mud)


def _check(place, hole, mud):
    component = place.component
    if component.stiffness is None:
        raise SceneError(
            f"{component.name}: stiffness = None: expected a Stiffness for model = 'rod', the rod in contact"
        )
    weight = weight_in_mud(component, mud)
    if not weight > 0:
        raise SceneError(
            f"{component.name}: it weighs {weight:g} N/m in mud: expected a positive weight for model = 'rod'"
        )
    inside = [x.to for x in hole.sections if place.top < x.to < place.bottom]
    narrowest, wide = float(hole.at([*inside, place.bottom], "diameter").min()), 2 * _body_radius(component)
    if not wide < narrowest:
        raise SceneError(
            f"{component.name}: its body is {wide:g} m wide in a hole of {narrowest:g} m: expected a clearance for "
            "model = 'rod'"
        )


def _along(hole, depth, value):
    """[(md_end, value)] of the sections that the string reaches."""
    above, found = 0.0, []
    for section in hole.sections:
        if above < depth:
            found.append((section.to, value(section)))
        above = section.to
    return found


def _body_radius(component):
    """m; of what touches along its whole length."""
    return component.outer_diameter / 2 if is_ring(component) else component.contact_radius
