"""A bottom-hole assembly as a beam with small offsets in the vertical plane of its hole: contacts, side force, tilt.

The hole near the bit is a circle of curvature k (> 0: it builds). With s from the bit up and u the offset from its axis
to the high side, the beam has the moment M = EI (k + theta'), which jumps in theta by the angle of a bend, the
compression F along the hole, and the load -(w sin(inclination) + F k) across it:

    M'' + (F u')' = -(w sin + F k) + forces of the wall,   u' = theta + V/GA.

The bit is on the axis without a moment. A stabiliser touches at a point, the body wherever it meets the wall; the
sides are found. Where the string lies down on the wall for good, theta' = 0 decides on the place. Elements are cubic
with shear (J. S. Przemieniecki, Theory of Matrix Structural Analysis, 1968, sec. 5.6), exact at their ends but for F.

`build_rate`: the rate at which it builds inclination, by the criteria in use; they differ, and all are reported.
"""

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_banded
from scipy.optimize import brentq

from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.result import Charted, by_name
from cosserat_fenicsx.units import deg_per_30m
from cosserat_fenicsx.well.components import DrillString, in_columns
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.pieces import bend_of, checked_depth, pieces_of, rings_of


# Length that lies on the wall up to the upper end of what is solved at least, m.
_LIES = 3.0
# Largest element, m; changes of the set of touching nodes at most; bracket of the place where the string lies down, in
# elements; accuracy of that place, m.
_ELEMENT, _CHANGES, _AROUND, _PLACE = 0.25, 400, 3.0, 1e-7
# Places closer than this, m, are one.
_APART = 1e-6
# Walls that become stiffer, each by a factor; Newton steps in each at most.
_WALLS, _STIFFER, _STEPS = 5, 10.0, 40


@dataclass(frozen=True)
class Assembly:
    """The lower end of a string. ends: (n,) upper ends of its uniform parts, m from the bit up; EI (N m^2), GA (N),
    weight (N/m in mud), clearance (of the body, m): of each; rings: [(s, clearance)] of stabilisers, m. bends: [(s,
    angle)], rad, > 0 where it points the bit to the high side. thrust: weight on bit, N. inclination: of the hole at
    the bit, rad."""

    ends: np.ndarray
    EI: np.ndarray
    GA: np.ndarray
    weight: np.ndarray
    clearance: np.ndarray
    rings: tuple
    bends: tuple
    thrust: float
    inclination: float

    @property
    def length(self):
        """m."""
        return float(self.ends[-1])

    def at(self, curvature):
        """The `Held` in a hole of a curvature, 1/m. Raises NotConverged: no contacts were found that fit, or the string
        does not lie down on the wall within it."""
        whole = _solved(self, curvature, self.length, 0)
        sides, side = whole.sides[:-1], int(whole.sides[-2])
        lies = whole.s[len(sides) - 1 - np.argmax(sides[::-1] != side)]
        if side == 0 or self.length - lies < _LIES:
            raise NotConverged(
                f"the assembly does not lie down on the wall within {self.length:.4g} m: expected a longer hole, or "
                "less weight on bit, which may buckle it"
            )
        touching = whole.s[:-1][sides == side]
        gaps = np.flatnonzero(np.diff(touching) > _AROUND * _ELEMENT)
        first = touching[gaps[-1] + 1] if len(gaps) else touching[0]  # nodes may be free from there to `lies`
        low, high = max(first - _AROUND * _ELEMENT, _ELEMENT), min(lies + _AROUND * _ELEMENT, self.length)
        known = [(s, x) for s, x in zip(whole.s, whole.sides, strict=True) if x and s < low]

        def up_to(end):
            return _solved(self, curvature, end, side, low, known)

        if up_to(low).moment_at_end * up_to(high).moment_at_end > 0:
            return whole  # it lies down where its width changes
        return up_to(brentq(lambda end: up_to(end).moment_at_end, low, high, xtol=_PLACE))

    def of_part(self, s):
        """(n,) indices of the parts at s (n,)."""
        return np.searchsorted(self.ends[:-1], s)


def assembly_of(hole, laid, mud, operation, depth, length):
    """The `Assembly` of the lowest `length` (m) of a string with its bit at a measured depth (m). Raises SceneError: a
    component without stiffness, or that bends differently about its two axes; a lower end that is no bit; a bend to
    another side than the high or the low one."""
    if laid[0].component.touches != "bottom":
        raise SceneError(
            f"build_rate: the lowest component is {laid[0].component.name}: expected a Bit, at which the hole is made"
        )
    rows, bends = [], []
    for place in laid:
        if depth - place.bottom >= length:
            break
        part, S = place.component, place.component.stiffness
        if S is None or S.matrix is not None or not math.isclose(*S.bending, rel_tol=1e-9):
            raise SceneError(f"{part.name}: stiffness = {S!r}: expected that of a round section for build_rate")
        loose = max(0.0, float(hole.at(place.bottom, "diameter")) / 2 - part.body_radius)
        for x in in_columns([place], mud):
            rows.append((min(depth - x.top, length), S.bending[0], min(S.shear), x.weight_in(mud), loose))
        if part.bend:
            md, angle, side = bend_of(place)
            if abs(math.sin(side)) > 1e-6:
                raise SceneError(
                    f"{part.name}: tool_face = {part.tool_face:g}: expected 0 or 180 for build_rate, whose beam lies "
                    "in the vertical plane; torque_and_drag with model='rod' takes any"
                )
            bends.append((depth - md, angle * math.cos(side)))
    _, *above = rings_of(laid, hole)  # the first one is the bit
    rings = [(depth - ring.s, ring.clearance) for ring in above if depth - ring.s < length]
    inclination = float(hole.path.inclination_at(np.array([depth]))[0])
    ends, *numbers = np.array(rows).T
    return Assembly(ends, *numbers, tuple(rings), tuple(bends), operation.weight, inclination)


@dataclass(frozen=True, eq=False)
class Held:
    """An `Assembly` in its hole; arrays are over the nodes from the bit up. s: from the bit up, m. offset: to the high
    side, m; angle: rad. sides: where it touches, 1 the high side, -1 the low one, 0 not. force: of the wall, N, to the
    high side. moment_at_end: N m, of the support of the upper end, beyond that of the hole's curvature."""

    s: np.ndarray
    offset: np.ndarray
    angle: np.ndarray
    sides: np.ndarray
    force: np.ndarray
    moment_at_end: float

    @property
    def side_force(self):
        """Of the bit on the wall, N, > 0 to the high side."""
        return -float(self.force[0])

    @property
    def tilt(self):
        """Of the bit, rad, > 0 to the high side."""
        return -float(self.angle[0])

    @cached_property
    def contacts(self):
        """[(s, force on the wall (N), > 0 on the high side)] below where it lies down, and there."""
        up_to = len(self.s) - int(np.argmin(self.sides[::-1] != 0)) + 1
        return [(float(s), -float(x)) for s, x in zip(self.s[1:up_to], self.force[1:up_to], strict=True) if x]


def _solved(beam, curvature, end, lies, free_from=math.inf, known=None):
    """The `Held` of the lowest `end` metres, whose upper end has an angle of 0. Where `lies` is not 0, it lies there on
    the wall of that side (1 high, -1 low), and does not touch elsewhere from `free_from` (m) on. known: [(s, side)] of
    an equilibrium close by."""
    fixed = np.array([0.0, *beam.ends, *(s for s, _ in (*beam.rings, *beam.bends))])
    fixed = np.append(np.unique(np.round(fixed[fixed < end - _APART], 9)), end)
    fixed = fixed[np.diff(fixed, prepend=-1.0) > _APART]
    counts = np.ceil(np.diff(fixed) / _ELEMENT).astype(int)
    s = np.append(np.concatenate([np.linspace(a, b, n, endpoint=False)
                                  for a, b, n in zip(fixed, fixed[1:], counts, strict=False)]), fixed[-1])  # fmt: skip
    bands, load = _equations(beam, curvature, s)
    clearance = beam.clearance[beam.of_part(s)]
    np.minimum(clearance[:-1], beam.clearance[beam.of_part((s[1:] + s[:-1]) / 2)], out=clearance[:-1])
    for at, loose in beam.rings:
        if at < end:
            clearance[np.argmin(np.abs(s - at))] = loose
    clearance[0] = 0.0
    reached = np.where((s < free_from) | (s == end), clearance, np.inf)
    ends = np.array([-1, lies or (1 if load[-2] > 0 else -1)])
    for sides in _begun(bands, load, s, ends, reached, known, beam.weight.max() * _ELEMENT):
        known_sides, repeats = set(), False
        for _ in range(_CHANGES):
            repeats = repeats or sides.tobytes() in known_sides
            known_sides.add(sides.tobytes())
            x, force = _with_contacts(bands, load, sides, clearance)
            offset, across = x[::2], force[::2]
            pulled = sides * across > 0  # a wall does not pull
            beyond = np.where(sides == 0, np.sign(offset) * (np.abs(offset) > reached * (1 + 1e-9) + 1e-12), 0.0)
            pulled[[0, -1]] = beyond[[0, -1]] = False
            if not pulled.any() and not beyond.any():
                moment = float(force[-1] - beam.EI[beam.of_part(s[-1:])[0]] * curvature)
                return Held(s, offset, x[1::2], sides, np.where(sides, across, 0.0), moment)
            if repeats:  # one node at a time, the first one: no set of nodes then comes again (Murty 1974)
                wrong = np.flatnonzero(pulled | (beyond != 0))[1:]
                pulled[wrong], beyond[wrong] = False, 0.0
            sides = np.where(pulled, 0, np.where(sides, sides, beyond)).astype(int)
    raise NotConverged(
        f"no contacts of the assembly were found that fit in a hole of curvature {curvature:.3g} rad/m: expected less "
        "weight on bit, or less of a bend"
    )


def _begun(bands, load, s, ends, clearance, known, typical):
    """(n,) sides on which nodes may touch: those that are known, then those in soft walls."""
    if known is not None:
        sides = np.zeros(len(s), dtype=int)
        for at, side in known:
            sides[np.argmin(np.abs(s - at))] = side
        sides[[0, -1]] = ends
        yield sides
    yield _sides_in_soft_walls(bands, load, ends, clearance, typical)


def _sides_in_soft_walls(bands, load, ends, clearance, typical):
    """(n,) sides on which nodes touch, in walls that become stiffer, by Newton's method with a line search."""
    inner, x, c = slice(2, -2, 2), np.zeros(len(load)), clearance[1:-1]
    held = np.array([0, len(load) - 2, len(load) - 1])
    finite = np.where(np.isfinite(clearance), clearance, clearance[-1])
    x[::2] = -finite
    x[0], x[-2] = 0.0, ends[1] * finite[-1]

    def energy(x, stiffness):
        depth = np.maximum(np.abs(x[inner]) - c, 0.0)
        return x @ (_product(bands, x) / 2 - load) + stiffness * (depth @ depth) / 2

    for stiffness in typical / finite.max() * _STIFFER ** np.arange(_WALLS):
        for _ in range(_STEPS):
            depth = np.abs(x[inner]) - c
            touches = depth >= 0
            residual, matrix = _product(bands, x) - load, bands.copy()
            residual[inner] += stiffness * np.where(touches, depth, 0.0) * np.sign(x[inner])
            matrix[3, inner] += stiffness * touches
            dx = _with_held(matrix, -residual, held, np.zeros(3))
            before, falls, step = energy(x, stiffness), residual @ dx, 1.0
            while step > 1e-3 and energy(x + step * dx, stiffness) > before + 1e-4 * step * min(falls, 0.0):
                step /= 2
            x = x + step * dx
            if np.abs(dx[::2]).max() < 1e-7 * finite.max():
                break
    sides = np.zeros(len(clearance), dtype=int)
    sides[1:-1] = np.where(np.abs(x[inner]) >= c, np.sign(x[inner]), 0)
    sides[[0, -1]] = ends
    return sides


def _equations(beam, curvature, s):
    """The banded matrix (7, 2 n) and the load (2 n,) for offsets and angles of nodes at s (n,)."""
    h, middle = np.diff(s), (s[1:] + s[:-1]) / 2
    part = beam.of_part(middle)
    EI, weight, lean = beam.EI[part], beam.weight[part], beam.inclination - curvature * middle
    below = np.append(0.0, np.cumsum(weight * np.cos(lean) * h))
    F = beam.thrust - (below[1:] + below[:-1]) / 2
    shear = 12 * EI / (beam.GA[part] * h**2)
    one, zero = np.ones_like(h), np.zeros_like(h)
    near, far = (4 + shear) * h**2, (2 - shear) * h**2
    bending = np.array([[12 * one, 6 * h, -12 * one, 6 * h], [6 * h, near, -6 * h, far],
                        [-12 * one, -6 * h, 12 * one, -6 * h], [6 * h, far, -6 * h, near]])  # fmt: skip
    pressing = np.array([[36 * one, 3 * h, -36 * one, 3 * h], [3 * h, 4 * h**2, -3 * h, -(h**2)],
                         [-36 * one, -3 * h, 36 * one, -3 * h], [3 * h, -(h**2), -3 * h, 4 * h**2]])  # fmt: skip
    K = bending * (EI / (h**3 * (1 + shear))) - pressing * (F / (30 * h))
    across = -(weight * np.sin(lean) + F * curvature)
    loads = across * np.array([h / 2, h**2 / 12, h / 2, -(h**2) / 12]) + EI * curvature * np.array(
        [zero, one, zero, -one]
    )
    for at, angle in beam.bends:
        if at < s[-1]:  # the element above begins with a greater angle
            e = int(np.argmin(np.abs(s - at)))
            loads[:, e] -= K[:, 1, e] * angle
    bands, load, first = np.zeros((7, 2 * len(s))), np.zeros(2 * len(s)), 2 * np.arange(len(h))
    for i in range(4):
        load[first + i] += loads[i]
        for j in range(4):
            bands[3 + i - j, first + j] += K[i, j]
    return bands, load


def _with_contacts(bands, load, sides, clearance):
    """Offsets and angles (2 n,), and forces and moments that hold nodes on `sides` and the upper end's angle at 0."""
    at = np.flatnonzero(sides)
    x = _with_held(bands, load, np.append(2 * at, len(load) - 1), np.append(sides[at] * clearance[at], 0.0))
    return x, _product(bands, x) - load


def _with_held(bands, load, held, values):
    """The solution with some unknowns given."""
    n, matrix, right = len(load), bands.copy(), load.copy()
    for off in range(-3, 4):
        column = held + off
        inside = (column >= 0) & (column < n)
        matrix[3 - off, column[inside]] = 0.0
    matrix[3, held] = 1.0
    right[held] = values
    return solve_banded((3, 3), matrix, right, overwrite_ab=True, overwrite_b=True, check_finite=False)


def _product(bands, x):
    """The banded matrix times x."""
    n, found = len(x), np.zeros(len(x))
    for off in range(-3, 4):
        first, last = max(0, off), min(n, n + off)
        found[first - off : last - off] += bands[3 - off, first:last] * x[first:last]
    return found


#: The criteria in the order of the rows.
CRITERIA = ("side force", "tilt", "law", "three-point")
#: Length of the string from the bit up (m), and curvatures (rad/m) between which rates are looked for: 21 deg/30 m.
LENGTH, _LOOKED_FOR = 60.0, np.linspace(-0.012, 0.012, 25)


@dataclass(frozen=True, eq=False)
class BuildRate(Charted):
    """Rates of build of an assembly, from `build_rate`. Rows are criteria: curvatures of a hole, > 0 where it builds,
    in which (`plot` draws side force and tilt of the bit over the curvature, with the rates)

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

    _rows_axis, _beside, _chart = "criterion", {"_holes": "hole"}, "well.charts.build_figure"
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
        force = self._told("bit_side_force", units, abs(self.bit_side_force), form=".5g")
        pressed, tilted = ("low" if x < 0 else "high" for x in (self.bit_side_force, self.bit_tilt))
        yield (
            f"In a straight hole the bit presses with {force} to the {pressed} side, and its axis is "
            f"{math.degrees(abs(self.bit_tilt)):.4g} deg off the hole's to the {tilted} side. "
            "Rates of build by criteria, which differ; law: anisotropy "
            f"{self.anisotropy:g}."
        )
        yield from map(units.sentence, self.why)

    def _more(self, units):
        for s, force in self.contacts:
            told = self._told("bit_side_force", units, abs(force), ".5g")
            yield f"{told} on the {'high' if force > 0 else 'low'} side {units.told(s, 'm', form='.5g')} above the bit"

    def __repr__(self):
        rates = ", ".join(f"{name} {rate:.4g}" for name, rate in zip(CRITERIA, self.rate, strict=True))
        return f"BuildRate({rates} rad/m)"


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
    depth = checked_depth("build_rate", hole, string, operation, mud, depth, "Sliding(80e3)")
    anisotropy = number("build_rate", "anisotropy", anisotropy, "a number from 0 to 10", lambda x: 0 <= x <= 10)
    if not operation.weight > 0:
        refuse("build_rate", "operation", operation, "an operation with weight on bit (N), such as Sliding(80e3)")
    _, laid = pieces_of(hole, string, operation, mud, depth)
    beam = assembly_of(hole, laid, mud, operation, depth, min(LENGTH, depth))
    straight = beam.at(0.0)

    def at(curvature):
        held = straight if curvature == 0 else beam.at(curvature)
        return held.side_force, held.tilt

    def tried(curvature):
        try:
            return at(curvature)
        except NotConverged:
            return math.nan, math.nan

    side_force, tilt = np.array([tried(float(k)) for k in _LOOKED_FOR]).T
    measures = {
        "side force": lambda force, tilt: force,
        "tilt": lambda force, tilt: tilt,
        "law": lambda force, tilt: tilt + anisotropy * force / operation.weight,
    }
    rates, why = [], []
    for name, measure in measures.items():
        values, found, hidden = measure(side_force, tilt), [], []
        for i, j in itertools.pairwise(np.flatnonzero(~np.isnan(values))):
            if values[i] * values[j] <= 0:
                try:
                    found.append(brentq(lambda k, measure=measure: measure(*at(k)), *_LOOKED_FOR[[i, j]], xtol=1e-9))
                except NotConverged:
                    hidden.append(_between(*_LOOKED_FOR[[i, j]]))
        rates.append(min(found, key=abs, default=math.nan))
        if hidden:
            why.append(f"{name}: it changes its sign {' and '.join(hidden)}, where no equilibrium was found")
        elif not found:
            why.append(f"{name}: it does not vanish in any hole {_between(*_LOOKED_FOR[[0, -1]])}")
        if len(found) > 1:
            why.append(f"{name}: it vanishes in several holes: {', '.join(map(_told, found))}")
    unknown = _LOOKED_FOR[np.isnan(side_force)]
    if len(unknown):
        tried = f"{len(unknown)} of {len(_LOOKED_FOR)} holes that were tried, {_between(*unknown[[0, -1]])}"
        why.append(f"no equilibrium was found in {tried}")
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
    return f"{curvature / deg_per_30m:.4g} deg/30m"


def _between(*curvatures):
    return f"between {' and '.join(map(_told, curvatures))}"


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
