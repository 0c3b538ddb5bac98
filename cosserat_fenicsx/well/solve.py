"""Choose a torque-and-drag model, solve it, and report the reason: by how much the rod in contact may differ.

The soft string lies on the axis. With a clearance, a string changes sides where its load turns round, and spans the
hole between without touching it; the friction that is missed there is mu times

- T sqrt(2 d dk) where the hole's curvature jumps by dk: a string that leaves a wall tangentially reaches the other
  side, at a distance d, after that angle. On a build section of radius R it is T sqrt(4 r/R) for a clearance r.
- (2 d q T)^(1/2) below the surface, where the rod hangs on the axis, and comes to the wall farther down; and as much as
  it spans there by its bending stiffness.
- the load on the span with which it bridges a wider part of the hole, times the difference of friction there.
- (6 d T)^(2/3) q'^(1/3) where the load changes its sign within a bend, with the rate q': the span on which it moves
  the string by d.

A string on the low side also hangs lower by r sin(inclination), and is moved along the hole by r times the angle of its
bends, since its way there is longer or shorter than the axis; its weight feels both. Where the hole bends at an end at
which the string is held on the axis, it leaves the axis at the angle a = k (x + sqrt(x^2 + 2 d/k)), x = sqrt(EI/T),
which takes T a^2/2 from its tension. Bending stiffness changes the friction by mu EI dk^2, and more where
the moment EI k jumps by more than the load beside it can take. Bits and stabilisers bear
the load of their spans on a larger radius, and pry, see `prying`. A snake adds at most half the wall force of a helix;
its friction makes the string a helix farther down, and the helix multiplies it on the way up: the string is solved
again with a helix wherever there may be one. A helix is pressed on the wall by its own force alone, on average, and not
by its load as well, as is usually reckoned. These are sums of sizes: differences of opposite signs do not cancel.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.errors import InstallationError, NotConverged, SceneError
from cosserat_fenicsx.progress import Plan
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.units import rpm
from cosserat_fenicsx.well import criteria
from cosserat_fenicsx.well.answer import Judged, TorqueAndDrag, scales_of, share
from cosserat_fenicsx.well.criteria import LockUp, buckled_string, earliest_helix, growth
from cosserat_fenicsx.well.components import DrillString
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.pieces import checked_depth, free_span, pieces_of, prying, rings_of, sections_of
from cosserat_fenicsx.well.rod.rod_answer import longest, rod_in_contact
from cosserat_fenicsx.well.softstring import Chain, chain_of, soft_string
from cosserat_fenicsx.well.tools import MudMotor, check_flows


@dataclass(frozen=True)
class _Estimate:
    """Settings of the estimate."""

    # Safety factor of the effects of the clearance: on 240 random strings the difference from the rod was up to 1.2
    # times their sum of sizes.
    caution: float = 1.25
    fine: int = 512  # sample points on a piece in the search for snakes
    short: float = 3.0  # length of components whose own bending stiffness does not count, m
    nearest: float = 0.3  # least distance of a pair of forces, m


_SET = _Estimate()


class ModelError(NamedTuple):
    """Effects that the soft string neglects, on the hook load (N), or on the torque (N m) of a rotating string."""

    clearance: float
    bending: float
    blades_and_bit: float
    snake: float

    @property
    def total(self):
        return sum(self)


def model_errors(path, pieces, soft, solved, sections, rings=()):
    """`ModelError` of the hook load and of the surface torque. soft, solved: the `Solved` without and with buckling.
    rings: [`Ring`] from the bit up. Returns infinite parts for snakes with which the string may lock up."""
    chain = solved.chain
    groups = np.flatnonzero(np.diff(chain.origin, prepend=-1))  # the first part of each piece, from below
    load, turn, EI = np.abs(chain.drag), chain.turn, np.nan_to_num(sections.EI[pieces.component[chain.origin]])
    clearance = (pieces.hole - pieces.radius)[chain.origin]
    missed, stiff = (np.zeros(len(load)) for _ in range(2))
    missed[groups] = _turns(chain, solved, groups, clearance[groups])
    beside = path.curvature(np.concatenate([np.maximum(pieces.bottom - 1e-6, 0.0), pieces.bottom])).reshape(2, -1, 3)
    jumps, stiffer = _jumps(path, pieces, beside, solved.tension[groups[1:], 0], EI[groups])
    missed[groups[1:]] += jumps
    missed[groups] += _edges(pieces, solved, groups, EI[groups])
    missed[groups[-1]] += _hung(chain, solved, clearance[-1], EI[-1])
    missed *= _SET.caution
    stiff[groups[1:]] = stiffer
    stiff[groups] += _levers(pieces, beside, solved, groups, EI[groups], clearance[groups])
    extra = _snakes(chain, solved, EI, clearance)
    grown = growth(solved, pieces, sections)
    pried, arms = _at_rings(chain, solved, pieces.bottom[-1], clearance, EI, rings)
    parts = (missed, stiff, pried, extra)
    hook, torque = ([float(share @ (part * grown)) for part in parts] for share in (load, turn))
    hook[0] += _lower(pieces) + _at_ends(pieces, solved, sections)
    torque[2] += float(turn @ arms)
    if extra.any() or solved.helical.any():
        hook[3], torque[3] = map(max, _earlier(soft, solved, pieces, sections), (hook[3], torque[3]))
    return ModelError(*hook), ModelError(*torque)


def _earlier(soft, solved, pieces, sections):
    """Changes of hook load and surface torque where snakes are helices, which the friction of both brings about."""
    try:
        early = earliest_helix(soft, pieces, sections)
    except LockUp:
        return np.inf, np.inf if solved.chain.turn.any() else 0.0
    return [abs(float(getattr(early, x)[-1, -1] - getattr(solved, x)[-1, -1])) for x in ("tension", "torque")]


def _snakes(chain, solved, EI, clearance):
    """Half the wall force (N) of a helix, of the snakes in pieces (a snake may be a small part of a long piece); and
    the load across of the helices, since the mean wall force of a helix with gravity is r F^2/(4 EI) alone."""
    extra = np.zeros(len(EI))
    fine = (np.arange(_SET.fine) + 0.5) / _SET.fine
    compressed = (solved.tension.min(axis=1) < 0) & (clearance > 1e-9) & (EI > 0)
    for i in np.flatnonzero(compressed | solved.helical):
        F = np.maximum(-np.interp(fine, solved.at, solved.tension[i]), 0.0)
        side = np.interp(fine, solved.at, solved.side[i]) * chain.climb[i]
        helix = criteria.helix_side(EI[i], clearance[i], F)
        if solved.helical[i]:
            more = side - helix
        else:
            more = np.where(F > criteria.snake_load(EI[i], clearance[i], chain.weight[i], side), helix / 2, 0.0)
        extra[i] = np.mean(more) * chain.length[i]
    return extra


def _at_rings(chain, solved, depth, clearance, EI, rings):
    """Wall force (N) of bits and stabilisers that pry; and the part of their spans' load (N) on their radius."""
    ends = depth - np.append(0.0, np.cumsum(chain.length))  # measured depths, from the lower end up
    largest = np.array([solved.side.max(axis=1) * chain.climb, np.maximum(-solved.tension.min(axis=1), 0.0),
                        chain.curvature, clearance, EI])  # fmt: skip

    def along(a, b):
        return largest[:, (ends[:-1] > a + 1e-9) & (ends[1:] < b - 1e-9)].max(axis=1, initial=0.0)

    pried, arms = np.zeros(len(chain.length)), np.zeros(len(chain.length))
    for ring, pries, carries in zip(rings, *prying(rings, depth, along), strict=True):
        i = int(np.clip(np.searchsorted(-ends, -ring.s) - 1, 0, len(chain.length) - 1))
        pried[i] += pries
        arms[i] += carries * max(1 - ring.body / ring.radius, 0.0)
    return pried, arms


def _lower(pieces):
    """Weight (N) that hangs lower or higher where the string leans on the wall: where it changes, and at the end."""
    clearance = pieces.hole - pieces.radius
    lean = clearance * np.sqrt(np.maximum(1 - pieces.t**2, 0.0))
    moved = np.cumsum(clearance * pieces.curvature * (pieces.bottom - pieces.top)) * np.abs(pieces.t)
    return float(np.abs(np.diff(pieces.weight, append=0.0)) @ (lean + moved))


def _at_ends(pieces, solved, sections):
    """Tension (N) that is lost where the string leaves the axis, at both ends."""
    lost = 0.0
    for at, tension in ((0, abs(solved.tension[-1, -1])), (-1, abs(solved.tension[0, 0]))):
        k, EI = pieces.curvature[at], np.nan_to_num(sections.EI[pieces.component[at]])
        clearance = (pieces.hole - pieces.radius)[at]
        # T a^2/2 without the divisions by k and by T
        lost += k * (np.sqrt(EI * k) + np.sqrt(EI * k + 2 * clearance * tension)) ** 2 / 2
    return float(lost)


def _turns(chain, solved, groups, clearance):
    """Wall force (N) that is missed within pieces whose load turns to the other side."""
    last = np.append(groups[1:], len(chain.length)) - 1
    length = np.add.reduceat(chain.length, groups)
    part = Chain(*(array[groups] for array in chain))
    q = [
        np.stack([part.curvature * T + part.weight * n, part.weight * part.b])
        for n, T in ((part.n, solved.tension[groups, 0]), (part.down(length)[1], solved.tension[last, -1]))
    ]
    way = np.linalg.norm(_unit(q[1], 0) - _unit(q[0], 0), axis=0)
    rate = np.linalg.norm(q[1] - q[0], axis=0) / length
    T = np.maximum(np.abs(solved.tension[groups, 0]), np.abs(solved.tension[last, -1]))
    return np.where(way > 1, (6 * way * clearance * T) ** (2 / 3) * rate ** (1 / 3), 0.0)  # others slide along the wall


def _spanned(q, T, d, EI, length):
    """The load (N) on the span by which a string under a load q (N/m) comes to a wall at a distance d (m), by its
    tension T (N) and its bending stiffness; at most that on the length (m) there is."""
    return min(np.sqrt(2 * d * q * T) + q * free_span(EI, d, q), q * length)


def _hung(chain, solved, clearance, EI):
    """Wall force (N) missed below the surface, where the rod hangs on the axis and comes to the wall farther down."""
    q, T = solved.side[-1, -1] * chain.climb[-1], max(solved.tension[-1, -1], 0.0)
    return _spanned(q, T, clearance, EI, chain.length.sum())


def _edges(pieces, solved, groups, EI):
    """Wall force (N) missed in pieces: the string spans a part of what is wider, and loads the edge."""
    found, up = np.zeros(len(groups)), slice(None, None, -1)
    mu, hole = pieces.friction[up], pieces.hole[up]
    length, q = (pieces.bottom - pieces.top)[up], solved.side[groups].max(axis=1) * solved.chain.climb[groups]
    T = np.abs(solved.tension[groups, 0])
    for j in np.flatnonzero((mu[1:] != mu[:-1]) & (hole[1:] != hole[:-1])):
        wide, more = (max(j, j + 1, key=of.__getitem__) for of in (hole, mu))
        less = min(mu[j], mu[j + 1])
        load = _spanned(q[wide], T[wide], abs(hole[j] - hole[j + 1]), EI[wide], length[wide])
        found[more] += load * (1 - less / mu[more])
    return found


def _levers(pieces, beside, solved, groups, EI, clearance):
    """Wall force (N) missed at lower ends of pieces where EI k jumps: by a pair of forces sqrt(8 d/k) apart."""
    n = len(groups)
    wide = np.maximum(np.append(EI[1:], 0.0), np.append(0.0, EI[:-1]))  # of neighbours
    EI = np.where(pieces.bottom[::-1] - pieces.top[::-1] < _SET.short, np.minimum(EI, wide), EI) if n > 1 else EI
    above, below = beside[:, ::-1]
    moment = np.linalg.norm(EI[:, None] * above - np.append(0.0, EI[:-1])[:, None] * below, axis=1)
    known = (moment > 0) & (EI > 0)
    moment, stiff = np.where(known, moment, 0.0), np.where(known, EI, 1.0)
    apart = np.maximum(np.sqrt(8 * clearance * stiff / np.where(known, moment, 1.0)), _SET.nearest)
    return np.maximum(2 * moment / apart - solved.side[groups, 0] * solved.chain.climb[groups] * apart, 0.0)


def _jumps(path, pieces, beside, tension, EI):
    """Wall force (N) missed where pieces meet, and EI dk^2 (N m); beside: (2, n, 3) curvatures above and below."""
    md, up = pieces.bottom[:-1], slice(None, None, -1)
    t, down = path.tangent(md), np.array([0.0, 0.0, 1.0])
    k = beside[:, :-1]
    offsets = []
    for i, curvature in ((slice(None, -1), k[0]), (slice(1, None), k[1])):
        q = tension[up, None] * curvature + pieces.weight[i, None] * (down - t * t[:, 2:])
        offsets.append((pieces.hole - pieces.radius)[i, None] * _unit(q, 1))
    jump, away = np.linalg.norm(k[1] - k[0], axis=1), np.linalg.norm(offsets[1] - offsets[0], axis=1)
    return np.abs(tension) * np.sqrt(2 * away * jump)[up], np.minimum(EI[1:], EI[:-1]) * jump[up] ** 2


def _unit(vectors, axis):
    """Vectors over their lengths; zero stays zero."""
    size = np.linalg.norm(vectors, axis=axis, keepdims=True)
    return vectors / np.where(size > 0, size, 1.0)


AUTO, SOFT, BUCKLED, ROD = "auto", "soft", "buckled", "rod"
MODELS = (AUTO, SOFT, BUCKLED, ROD)
CONVENTIONS = ("coulomb", "johancsik")
_QUANTITIES = {"hook load": "N", "surface torque": "N m"}
_LOCKS_UP = "WITH THE WALL FORCE OF A HELIX IT LOCKS UP"
_HOW_LONG = (
    "solving the rod in contact mostly takes a second, the first time half a minute more for compiling, and ends after "
    "about {:.0f} s of processor time"
)
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
    depth = checked_depth("torque_and_drag", hole, string, operation, mud, depth)
    tol = check_settings(model, tol, torque_convention)
    pieces, laid = pieces_of(hole, string, operation, mud, depth)
    given = hole, string, operation, mud, depth
    try:
        flexible = _flexible(given, model, tol, torque_convention, pieces, laid)
    except LockUp as locked:
        locked.args = (hole.path.told(str(locked)),)
        raise
    if model in (SOFT, BUCKLED) or (model == AUTO and flexible.enough):
        return flexible
    if model == AUTO and flexible.model == BUCKLED:
        return flexible.adding(_NO_ROD)
    why = flexible.judged.decided
    told = "" if model == ROD else f"{why[-1].rpartition(': ')[0] or why[-1]}: "
    try:
        how_long = _HOW_LONG.format(longest(tol))
        with Plan(f"torque_and_drag, {operation.name}: {told}{how_long}", progress, world()):
            return rod_in_contact(flexible, why, progress, exact=model == ROD)
    except (SceneError, NotConverged, InstallationError) as problem:
        if model == ROD:
            if isinstance(problem, NotConverged):
                problem.args = ("; ".join([str(problem), *_instead(flexible, why)]),)
            raise
        failed = f"the exact rod in contact was tried, and not solved: {problem}"
        return flexible.adding(failed)


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
    """`tol`, where `torque_and_drag` takes it and the others. Raises SceneError: it does not."""
    if model not in MODELS:
        refuse("torque_and_drag", "model", model, " or ".join(f"'{name}'" for name in MODELS))
    if torque_convention not in CONVENTIONS:
        refuse("torque_and_drag", "torque_convention", torque_convention, "'coulomb' or 'johancsik'")
    return number("torque_and_drag", "tol", tol, "a number from 1e-12 to 0.1", lambda x: 1e-12 <= x <= 0.1)


def _flexible(given, model, tol, torque_convention, pieces, laid):
    """The `TorqueAndDrag` of the soft, or buckled, string."""
    operation, told = given[2], [*_on_motor(given[1], given[2])]
    soft = soft_string(chain_of(pieces, torque_convention == "coulomb"), -operation.weight, operation.torque, tol)
    buckled = None
    if model != SOFT:
        try:
            buckled = buckled_string(soft, pieces, sections_of([place.component for place in laid]), tol)
        except LockUp as stuck:
            if model != ROD:
                raise
            told.insert(0, f"{_LOCKS_UP}: {stuck}")
    solved, used = buckled or soft, BUCKLED if buckled or model == BUCKLED else SOFT
    error = max(map(share, (solved.error, solved.torque_error), scales_of(solved, pieces)))
    ends = [(x.tension[-1, -1], x.torque[-1, -1]) for x in (solved, soft)]
    differences = {SOFT: tuple(float(a - b) for a, b in zip(*ends, strict=True))} if buckled else {}
    judge = partial(_judged, given, model, used, tol - error, tol, pieces, laid, soft, solved, told)
    return TorqueAndDrag(*given, used, tol, torque_convention, error, differences, laid, pieces, solved, rod_in_contact,
                         judge)  # fmt: skip


def _judged(given, model, used, left, tol, pieces, laid, soft, solved, told):
    """The `Judged` of a flexible string; left: of the tolerance, for the model; told: more sentences."""
    sections = sections_of([place.component for place in laid])
    left_out = model_errors(given[0].path, pieces, soft, solved, sections, rings_of(laid, given[0]))
    scales = scales_of(solved, pieces)
    shares = {what: share(parts.total, scale) for what, parts, scale in zip(_QUANTITIES, left_out, scales, strict=True)}
    why = [f"model = '{model}' as asked"] if model != AUTO else []
    why += [*_on_buckling(model, soft, solved, sections), *_on_what_is_left_out(used, left_out, shares)]
    EA = sections.EA[pieces.component[solved.chain.origin]][:, None]
    strain = float(np.nan_to_num(np.abs(solved.tension) / EA).max())
    if strain > 0.01:
        why.append(f"BEYOND WHAT ANY PIPE CARRIES: the tension strains it by {100 * strain:.3g} %")
    beyond = [what for what, part in shares.items() if part > left]
    why += told
    whole = [*why, *(f"NOT ENOUGH for tol = {tol:g} in the {what}" for what in beyond)]
    if model == AUTO and beyond:
        exceeding = " and the ".join(beyond)
        why.append(f"the {used} string's error in the {exceeding} exceeds tol = {tol:g}: solving the rod in contact")
    if not (bent := given[1].bent):
        return Judged(tuple(whole), max(shares.values()), tuple(parts.total for parts in left_out), tuple(why))
    whole.append(
        f"THE BEND of {bent} IS NOT IN IT: a string on the axis of the hole has none, and what it "
        "adds to the wall's forces is not estimated; model='rod' has it"
    )
    why.append(f"{bent} is bent: solving the rod in contact, which has the bend")
    return Judged(tuple(whole), np.inf, (np.inf, np.inf), tuple(why))


def _on_motor(string, operation):
    """A sentence on a motor under the torque on bit; a SceneError where that stalls it."""
    motors = [part for part in string.components if isinstance(part, MudMotor)]
    check_flows(motors)
    for motor in motors:
        if motor.stands(operation.torque):
            yield f"{motor.name}: stands, since its flow does not turn it"
            continue
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
