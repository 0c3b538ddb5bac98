"""The exact rod in contact as a model of torque and drag: its answer, and a string and its hole handed to
`solve_in_hole`.

A stabiliser touches with its blades in the middle of its length, a bit at the lower end of the string: both are rings.
Their bodies, and all other components, touch with their contact radius along their whole length.
"""

import contextlib
import math
from dataclasses import dataclass, fields
from functools import cached_property, partial
from operator import attrgetter
from typing import ClassVar

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.well import criteria
from cosserat_fenicsx.well.answer import Judged, TorqueAndDrag, scales_of, share
from cosserat_fenicsx.well.components import in_columns
from cosserat_fenicsx.well.contacts import VERTICAL, WallContact, name_of_side
from cosserat_fenicsx.well.pieces import bend_of, rings_of
from cosserat_fenicsx.well.rod.resultants import MOSTLY
from cosserat_fenicsx.well.rod.string_scene import energy_of_helix, turns_of_helix

# Longest search for an equilibrium, s of processor time, at the usual tolerance and looser ones.
_LONGEST, _USUAL = 10.0, 1e-4


def _of_rod(name, doc=""):
    """The attribute of the `InHole` with the same name; its description is that in `TorqueAndDrag` unless given."""
    return property(attrgetter(f"solved.{name}"), doc=doc or getattr(TorqueAndDrag, name).__doc__)


@dataclass(frozen=True, eq=False, repr=False)
class RodInContact(TorqueAndDrag):
    """Loads of a string in its hole as an exact rod in contact; the places of the arrays are the rod's nodes.

    `error` is relative to hook load and surface torque themselves, the latter only where the string turns;
    `model_error` is not estimated (NaN), except the effect of buckling on a string that would buckle. `solved` is the
    `InHole`, whose `path` has all quantities of a rod. `md` is the measured depth of the closest point of the hole's
    axis. A stabiliser touches in the middle of its length, and the bit at its lower end: there `clearance`, `standoff`
    and `contact_side` refer to blades and bit, elsewhere to the body. Forces of the wall at points are in `contacts`.
    `side_force` leaves out stabilisers and bit; forces where the string leaves the wall are narrow peaks in it, as wide
    as the wall's stiffness makes them.
    """

    words: ClassVar[str] = "exact rod in contact"
    _moment_words: ClassVar[str] = "of the rod"
    _leaves_out: ClassVar[str] = (
        "how the string is held at the surface, tool joints that carry the pipe between them, moving and warm mud"
    )

    @classmethod
    def _of(cls, flexible, solved, decided):
        """From the answer of the soft string, the `InHole`, and the reasons for the rod."""
        given = {field.name: getattr(flexible, field.name) for field in fields(TorqueAndDrag)}
        here = solved.hook_load, solved.surface_torque
        there = {flexible.model: (flexible.hook_load, flexible.surface_torque)}
        there |= {name: (flexible.hook_load - hook, flexible.surface_torque - torque)
                  for name, (hook, torque) in flexible.differences.items()}  # fmt: skip
        differences = {name: (here[0] - hook, here[1] - torque) for name, (hook, torque) in there.items()}
        given |= {"model": "rod", "error": solved.error, "differences": differences, "solved": solved}
        why = (*decided, *_found(flexible, solved, differences))
        return cls(**{**given, "judge": partial(Judged, why, *_of_buckling(flexible, solved, differences))})

    @property
    def enough(self):
        """Whether the rod is stable, and its errors of hook load and surface torque are within `tol`."""
        return super().enough and self.solved.negative_modes == 0

    hook_load = _of_rod("hook_load", "Force along the hole on the held end, N, without block and sheaves.")
    surface_torque = _of_rod("surface_torque")
    tension = _of_rod("tension")
    torque = _of_rod("torque")
    side_force = _of_rod("side_force")
    distributed_force = _of_rod(
        "distributed_force",
        "See `TorqueAndDrag`: its integral and the forces at points are the `wall_force` of `solved`.",
    )
    clearance = _of_rod(
        "clearance",
        "Radius of the hole less the string's where it is solved: of the blades in the middle of a stabiliser, "
        "of the bit at its lower end, else of the body or the tool joints, m.",
    )
    bending_moment = _of_rod("bending_moment", "N m: of the rod itself.")
    errors_along = _of_rod(
        "errors_along",
        '{"side_force": N/m, "bending_moment": N m}: their estimated errors on 95 % of the string\'s length; beside '
        "forces at points they may be larger. `error` and `enough` are about hook load and surface torque alone.",
    )
    standoff = _of_rod("standoff", "Distance from the wall over the clearance: 0 in contact, 1 on the axis.")
    offset = _of_rod("offset", "(n, 3) from the hole's axis to the string, m.")
    position = _of_rod("position")

    @property
    def bit_side_force(self):
        """See `TorqueAndDrag`."""
        return self.solved.on_bit[0]

    @property
    def bit_tilt(self):
        """See `TorqueAndDrag`."""
        return self.solved.on_bit[1]

    @cached_property
    def _gravity(self):
        places = in_columns(self.laid, self.mud)[::-1]
        z = np.interp([0.0, *(place.bottom for place in places)], self.solved.s, self.position[:, 2])
        return float(np.diff(z) @ [place.weight_in(self.mud) for place in places])

    @cached_property
    def _piece(self):
        return np.minimum(np.searchsorted(self.pieces.bottom, self.solved.s), len(self.pieces.bottom) - 1)

    @cached_property
    def md(self):
        """Measured depths, m."""
        return np.maximum.accumulate(self.solved.md)  # rounding

    @cached_property
    def contact_side(self):
        """The side of the hole that the string touches, rad clockwise from its high side; NaN where it touches none."""
        known = self.solved.touches & (self.inclination > VERTICAL)
        return np.where(known, self.solved.side % (2 * np.pi), np.nan)

    @cached_property
    def contacts(self):
        """See `TorqueAndDrag`: forces at points, and the contact between them."""
        depths = [np.interp([x.start, x.end], self.solved.s, self.md) for x in self.solved.contacts]
        leans = [self.hole.path.inclination_at(ends.mean()) > VERTICAL for ends in depths]
        return [WallContact(float(a), float(b), x.force, name_of_side(x.side if leaning else np.nan), x.error)
                for (a, b), x, leaning in zip(depths, self.solved.contacts, leans, strict=True)]  # fmt: skip

    @cached_property
    def helical(self):
        """True at `md` where the criteria predict a helix; the rod's wall force follows from its actual shape."""
        return self.buckling == criteria.HELIX

    def _integral(self, values):
        return float(values @ self.solved.node_length)


def _of_buckling(flexible, solved, differences):
    """Of an equilibrium that would buckle: how far it is from the buckled soft string where that has a helix, else what
    a snake and all that a soft string leaves out may change: `model_error` and `left_out`. NaN of a stable one."""
    if solved.negative_modes == 0:
        return np.nan, (np.nan, np.nan)
    if not flexible.helical.any():
        return flexible.model_error, flexible.left_out
    sizes, scales = tuple(map(abs, differences[flexible.model])), scales_of(flexible.solved, flexible.pieces)
    return max(map(share, sizes, scales)), sizes


def _found(flexible, solved, differences):
    """Sentences on the rod, and how it differs from the soft string."""
    yield (
        f"the exact rod in contact, {solved.path.elements[0]} elements, {solved.steps} Newton steps: hook load to "
        f"{solved.errors['hook_load']:.2g} N, surface torque to {solved.errors['surface_torque']:.2g} N m"
    )
    yield (
        f"side force to {solved.errors_along['side_force']:.2g} N/m and bending moment to "
        f"{solved.errors_along['bending_moment']:.2g} N m on {100 * MOSTLY:g} % of the string, which do not count in "
        "what is enough"
    )
    if flexible.hole.wall_stiffness is not None:
        yield "forces at points are those of a rigid wall; side force is that of the wall with wall_stiffness"
    bent = [place.component for place in flexible.laid[::-1] if place.component.bend]
    for part, side in zip(bent, solved.tool_faces, strict=True):
        yield f"the bend of {part.name} points its lower end {math.degrees(side):.2f} deg clockwise from the high side"
        if flexible.operation.direction(part.contact_radius)[1]:
            yield f"ONE MOMENT of a turn: {part.name} rotates, and its bend with it"
    scales = scales_of(flexible.solved, flexible.pieces)
    for name, apart in differences.items():
        shares = ", ".join(f"{value:+.4g} {unit}, {share(abs(value), scale):.1e}, in the {what}"
                           for what, unit, value, scale in
                           zip(("hook load", "surface torque"), ("N", "N m"), apart, scales, strict=True)
                           if share(abs(value), scale) > 1e-9)  # fmt: skip
        yield f"it differs from the {name} string by {shares or 'nothing'}"
        counted = 2 if solved.string.turns else 1  # the estimates are about the torque only where the string turns
        most = max(share(abs(value), scale) for value, scale in list(zip(apart, scales, strict=True))[:counted])
        if name == flexible.model and most > flexible.model_error + flexible.error + solved.error:
            yield f"this is MORE than was estimated for the {name} string, {flexible.model_error:.1e}: look at both"
    if solved.negative_modes:
        count = solved.negative_modes
        modes = {-1: "singular", 1: "one negative eigenvalue"}.get(count, f"{count} negative eigenvalues")
        yield (
            f"NOT STABLE without friction (second variation: {modes}): it would buckle, or buckle otherwise, and what "
            f"it bears then may differ as much as was estimated for the {flexible.model} string"
        )


def longest(tol):
    """About how long the search for an equilibrium may take, s of processor time."""
    return _LONGEST * max(1.0, (_USUAL / tol) ** 0.25)


def rod_in_contact(flexible, decided, progress=None, exact=True, helix=True, start=None):
    """The `RodInContact` of the same string in the same hole as a soft one.

    Args:
        decided: sentences on why the soft string is not enough. exact: False for an answer that may be less accurate
            than asked, and says so. helix: whether to begin again as a helix where the equilibrium would buckle.
        start: the `InHole` of the same string under other loads, near it.

    Raises:
        SceneError: a component without stiffness, or as wide as the hole; a weight in mud that is not positive;
            Johancsik's convention of a torque.
        NotConverged: no equilibrium was found, or not as accurately as asked.
    """
    # imported here, since it needs dolfinx, which the soft string does not
    from cosserat_fenicsx.well.rod.rod_in_hole import NotAccurate, Work, solve_in_hole

    laid = in_columns(flexible.laid, flexible.mud)[::-1]  # from the top down
    hole, operation = flexible.hole, flexible.operation
    check_rod(hole, laid, operation, flexible.mud, flexible.torque_convention)
    above = [0.0, *(section.to for section in hole.sections)]
    reached = [section for section, top in zip(hole.sections, above, strict=False) if top < flexible.depth]

    work = Work(longest(flexible.tol))  # of both starts

    def solve(helix):
        """The `InHole`, and the `NotAccurate` if it is less accurate than asked, else None."""
        try:
            return solve_in_hole(
                hole.path,
                [place.bottom - place.top for place in laid],
                [place.component.stiffness for place in laid],
                [place.weight_in(flexible.mud) for place in laid],
                [place.component.body_radius for place in laid],
                radius=[(section.to, section.diameter / 2) for section in reached],
                friction=[(section.to, section.friction) for section in reached],
                slip=[operation.direction(place.component.contact_radius) for place in laid],
                bottom_tension=-operation.weight,
                bottom_torque=operation.torque,
                rings=[ring[:3] for ring in rings_of(flexible.laid, hole)[::-1]],
                bends=[bend_of(place) for place in flexible.laid[::-1] if place.component.bend],
                wall_stiffness=hole.wall_stiffness,
                helix=helix,
                tol=flexible.tol,
                progress=progress,
                work=work,
                start=None if helix else start,
            ), None
        except NotAccurate as short:
            if exact:
                raise
            return short.answer, short

    solved, short = solve(helix=False)
    if solved.negative_modes and helix:
        with contextlib.suppress(NotConverged):
            turned, shorter = solve(helix=True)
            if turned.negative_modes == 0:
                decided = (
                    *decided,
                    "begun as a helix: from the axis an equilibrium was found that would buckle, "
                    f"{solved.negative_modes} negative eigenvalues of the second variation",
                    *_of_hand(turned),
                )
                solved, short = turned, shorter
    if short is not None:
        decided = (*decided, f"NOT ENOUGH for tol = {flexible.tol:g}: {short}")
    return RodInContact._of(flexible, solved, decided)


def _of_hand(solved):
    """A sentence on the hand of a helix, and the energies of both hands where it is most compressed."""
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
    """Refuse components in their places, see `in_columns`, that cannot be a rod in contact, see `rod_in_contact`."""
    turns = any(operation.direction(place.component.contact_radius)[1] for place in laid)
    if torque_convention != "coulomb" and turns:
        refuse("torque_and_drag", "torque_convention", torque_convention,
               "'coulomb', the law that the rod in contact follows")  # fmt: skip
    for place in laid:
        component = place.component
        if component.stiffness is None:
            raise SceneError(f"{component.name}: stiffness = None: expected a Stiffness for model = 'rod'")
        weight = place.weight_in(mud)
        if not weight > 0:
            raise SceneError(
                f"{component.name}: it weighs {weight:g} N/m in mud: expected a positive weight for model = 'rod'"
            )
        inside = [x.to for x in hole.sections if place.top < x.to < place.bottom]
        narrowest, wide = float(hole.at([*inside, place.bottom], "diameter").min()), 2 * component.body_radius
        if not wide < narrowest:
            raise SceneError(
                f"{component.name}: its body is {wide:g} m wide in a hole of {narrowest:g} m: expected a clearance for "
                "model = 'rod'"
            )
