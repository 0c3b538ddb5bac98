"""The rate at which an assembly builds inclination, by criteria that are in use; they differ, and all are told."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import File, instance, number, refuse
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.result import Result, by_name
from cosserat_fenicsx.well.assembly import Assembly, assembly_of
from cosserat_fenicsx.well.components import DrillString
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.pieces import pieces_of

#: The criteria in the order of the rows.
CRITERIA = ("side force", "tilt", "law", "three-point")
#: Length of the string from the bit up (m), and curvatures (rad/m) between which rates are looked for: 21 deg/30 m.
LENGTH, _LOOKED_FOR = 60.0, np.linspace(-0.012, 0.012, 25)


@dataclass(frozen=True, eq=False)
class BuildRate(Result):
    """Rates of build of an assembly, from `build_rate`. Rows are criteria: curvatures of a hole, > 0 where it builds,
    in which

    - "side force": the bit presses to no side;
    - "tilt": the bit's axis is that of the hole;
    - "law": tilt + anisotropy (side force)/(weight on bit) = 0, what a bit drills that cuts so much less sideways;
    - "three-point": the circle through the bit and two contacts of a rigid assembly with its bend.

    Attributes:
        criterion: (4,) their names. rate: (4,) rad/m; NaN where there is none, and `why` says so.
        why: sentences. anisotropy: of the law.
        bit_side_force: N, bit_tilt: rad, in a straight hole, > 0 to the high side.
        contacts: [(distance from the bit (m), force on the wall (N), > 0 on the high side)] there, up to where the
            string lies down.
        curvature: (n,) rad/m of holes; side_force: (n,) N and tilt: (n,) rad of the bit in them, NaN where no
            equilibrium was found.
        assembly: the `Assembly`.
    """

    rate: np.ndarray
    why: tuple[str, ...]
    anisotropy: float
    bit_side_force: float
    bit_tilt: float
    contacts: tuple[tuple[float, float], ...]
    curvature: np.ndarray
    side_force: np.ndarray
    tilt: np.ndarray
    assembly: Assembly

    _rows_axis, _beside = "criterion", {"_holes": "hole"}
    _quantities = by_name(
        Quantity("criterion", axes=("criterion",)),
        Quantity("rate", "rate of build", "rad/m", axes=("criterion",), shown="deg/30m", dimension="angle per length",
                 digits=5),
        Quantity("anisotropy", axes=()),
        Quantity("bit_side_force", unit="N", axes=()),
        Quantity("bit_tilt", unit="rad", axes=()),
        Quantity("curvature", "curvature of the hole", "rad/m", axes=("hole",), shown="deg/30m",
                 dimension="angle per length"),
        Quantity("side_force", "side force of the bit", "N", axes=("hole",)),
        Quantity("tilt", "tilt of the bit", "rad", axes=("hole",), shown="deg", dimension="angle"),
    )  # fmt: skip
    _on_screen = ("criterion", "rate")

    criterion = property(lambda self: np.array(CRITERIA), doc="(4,) names.")

    def __len__(self):
        return len(CRITERIA)

    def of(self, criterion: str) -> float:
        """The rate by a criterion, rad/m.

        Raises:
            SceneError: an unknown name.
        """
        if criterion not in CRITERIA:
            refuse("BuildRate", "of", criterion, " or ".join(f"'{name}'" for name in CRITERIA))
        return float(self.rate[CRITERIA.index(criterion)])

    def _answer(self, units):
        force, tilt = self._told("bit_side_force", units, form=".5g"), math.degrees(self.bit_tilt)
        yield (
            f"In a straight hole the bit presses with {force} to the high side, and its axis is {tilt:.4g} deg off the "
            f"hole's, > 0 to the high side. Rates of build by criteria, which differ; law: anisotropy "
            f"{self.anisotropy:g}."
        )
        yield from self.why

    def _more(self, units):
        for s, force in self.contacts:
            told = self._told("bit_side_force", units, abs(force), ".5g")
            yield f"{told} on the {'high' if force > 0 else 'low'} side {units.told(s, 'm', form='.5g')} above the bit"

    def __repr__(self):
        rates = ", ".join(f"{name} {rate:.4g}" for name, rate in zip(CRITERIA, self.rate, strict=True))
        return f"BuildRate({rates} rad/m)"

    def plot(self, file: File | None = None, *, units: Any = "SI", width: int | None = None):
        """Draw side force and tilt of the bit over the curvature of the hole, with the rates of build.

        Args:
            file: .png, .pdf or another format of matplotlib (rank 0 writes); None returns the Figure.
            units: "SI", "field", or a dict of units by dimensions, such as {"force": "klbf"}.
            width: of the picture, pixels, which its fonts and legends are arranged for; None for 150 to the inch.

        Raises:
            SceneError: matplotlib is missing, or the ending is unknown.
        """
        from cosserat_fenicsx.well import charts

        return charts.drawn(self, charts.build_figure, file, units=units, width=width)


def build_rate(
    hole: Borehole,
    string: DrillString,
    operation: Operation,
    *,
    mud: Mud | None = None,
    depth: float | None = None,
    anisotropy: float = 0.1,
) -> BuildRate:
    """Rates at which an assembly builds inclination, by four criteria: no single one is "the" rate.

    The lowest 60 m of the string, or as much as there is, lie in a hole that is a circle in the vertical plane, with
    the inclination and the diameters of the hole at the bit, without friction: a beam with small offsets in contact
    with the wall (`Assembly`), with stabilisers and bends. In a straight hole its side force is that of
    `torque_and_drag` with model="rod" as far as offsets are small.

    Args:
        hole: its curvature does not count. string: with a `Bit`; a bend to the high or the low side.
        operation: with weight on bit, such as `Sliding(80e3)`.
        mud, depth: see `torque_and_drag`.
        anisotropy: rate of drilling sideways over that ahead, for equal forces, of bit and rock; 0 for a bit that
            drills along its axis.

    Raises:
        SceneError: no bit, no weight on bit, a bend to the right or the left, a component without stiffness, a string
            that does not fit the hole.
        NotConverged: the string does not lie down on the wall near the bit of a straight hole.
    """
    instance("build_rate", "hole", hole, Borehole, "a Borehole")
    instance("build_rate", "string", string, DrillString, "a DrillString")
    instance("build_rate", "operation", operation, Operation, "an operation, such as Sliding(80e3)")
    instance("build_rate", "mud", mud, (Mud, type(None)), "Mud(density), or None where weights are in mud")
    anisotropy = number("build_rate", "anisotropy", anisotropy, "a number from 0 to 10", lambda x: 0 <= x <= 10)
    depth = hole.length if depth is None else depth
    depth = number("build_rate", "depth", depth, "a measured depth (m), positive", lambda x: x > 0)
    if not operation.weight > 0:
        refuse("build_rate", "operation", operation, "an operation with weight on bit (N), such as Sliding(80e3)")
    _, laid = pieces_of(hole, string, operation, mud, depth)
    beam = assembly_of(hole, laid, mud, operation, depth, min(LENGTH, depth))
    straight = beam.at(0.0)

    def at(curvature):
        try:
            held = straight if curvature == 0 else beam.at(curvature)
        except NotConverged:
            return math.nan, math.nan
        return held.side_force, held.tilt

    side_force, tilt = np.array([at(float(k)) for k in _LOOKED_FOR]).T
    measures = {
        "side force": lambda force, tilt: force,
        "tilt": lambda force, tilt: tilt,
        "law": lambda force, tilt: tilt + anisotropy * force / operation.weight,
    }
    rates, why = [], []
    for name, measure in measures.items():
        values = measure(side_force, tilt)
        changes = np.flatnonzero(values[:-1] * values[1:] <= 0)
        found = [brentq(lambda k, measure=measure: measure(*at(k)), *_LOOKED_FOR[[i, i + 1]], xtol=1e-9)
                 for i in changes]  # fmt: skip
        rates.append(min(found, key=abs, default=math.nan))
        if not found:
            why.append(f"{name}: it does not vanish in any hole between {_told(_LOOKED_FOR[0])} and "
                       f"{_told(_LOOKED_FOR[-1])}")  # fmt: skip
        elif len(found) > 1:
            why.append(f"{name}: it vanishes in several holes: {', '.join(map(_told, found))}")
    unknown = _LOOKED_FOR[np.isnan(side_force)]
    if len(unknown):
        why.append(f"no equilibrium was found in {len(unknown)} of {len(_LOOKED_FOR)} holes that were tried, between "
                   f"{_told(unknown[0])} and {_told(unknown[-1])}")  # fmt: skip
    three, reason = _three_points(beam, laid, depth)
    why += [f"three-point: {reason}"] if reason else []
    turning = [place.component.name for place in laid if place.component.bend] if operation.direction(1.0)[1] else []
    if turning:
        why.append(
            f"ONE MOMENT of a turn: {' and '.join(turning)} rotates, and its bend with it: the rates are those of a "
            "string that slides"
        )
    return BuildRate(np.array([*rates, three]), tuple(why), anisotropy, straight.side_force, straight.tilt,
                     tuple(straight.contacts), _LOOKED_FOR, side_force, tilt, beam)  # fmt: skip


def _told(curvature):
    return f"{math.degrees(curvature) * 30:.4g} deg/30 m"


def _three_points(beam, laid, depth):
    """The curvature of the circle through the bit and two contacts on the side that the bend leans on, of a rigid
    string with a kink b at sb: with y = a s + b <s - sb> - k s^2/2 its offset from the axis is the clearance there; and
    why there is none. The contacts are the next stabiliser below the bend, or else the bend itself, and the next one
    above it, or else the upper end of the component with the bend."""
    if len(beam.bends) != 1:
        return math.nan, "it is about an assembly with one bend"
    (bend, angle), side = beam.bends[0], -math.copysign(1.0, beam.bends[0][1])
    (top,) = (depth - place.top for place in laid if place.component.bend and depth - place.bottom < bend)
    of_body = [(s, float(beam.clearance[beam.of_part(np.array([s]))[0]])) for s in (bend, top)]
    below = max((ring for ring in beam.rings if ring[0] < bend), default=of_body[0])
    above = min((ring for ring in beam.rings if ring[0] > bend), default=of_body[1])
    s, clearance = np.array([below, above]).T
    right = side * clearance - angle * np.maximum(s - bend, 0.0)
    return float(np.linalg.solve(np.column_stack([s, -(s**2) / 2]), right)[1]), ""
