"""The soft string with the wall force of a helix: as `softstring`, with r F^2/(4 EI) more where the compression F = -T
is above the load of a helix (`criteria.helix_load`), and no more where it is a snake.

The friction of a helix grows with F^2: pushed from above, a string locks up where F grows beyond all bounds. Method:
from the lowest place where a helix begins, piece by piece up the hole, by SciPy's DOP853 in atan(F/F_0), which is
finite there; where the state changes is found as an event.
"""

import math
from collections import namedtuple
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.well import criteria
from cosserat_fenicsx.well.softstring import UP_TO, Chain, Solved, soft_string


@dataclass(frozen=True)
class _Integration:
    """Settings of the integration up the hole."""

    # Pairs of relative tolerances, tried in turn; the difference of the two solutions is the error estimate.
    rtols: tuple = ((1e-10, 1e-12), (1e-11, 1e-13))
    rough: float = 1e-6  # relative tolerance where a few digits suffice
    least: float = 1e-12  # smallest tolerance of the soft string below
    changes: int = 20  # most changes of state within one piece
    unbounded: float = math.pi / 2 - 1e-6  # atan(F/F_0) above which F counts as infinite


_SET = _Integration()

#: Arrays over the pieces of a chain: EI (N m^2), clearance (m), known: whether these are; and load: the compression of
#: a helix, such as `criteria.helix_load`.
_Start = namedtuple("_Start", "EI clearance known load")


def buckled_string(soft, pieces, sections, tol):
    """The `Solved` with helices, from the soft string without them; None if it has none. Raises LockUp: the string
    locks up; NotConverged: the tolerance was not reached."""
    for rtols in _SET.rtols:
        start, first = _begin(soft, pieces, sections, criteria.helix_load)
        if first is None:
            return None
        marches = [_March(soft, start, pieces.bottom[-1], rtol).up(first) for rtol in rtols]
        ends = zip(*((m.tension[-1, -1], m.torque[-1, -1]) for m in marches), strict=True)
        errors, found = [abs(float(a - b)) for a, b in ends], marches[-1]
        grown = growth(found, pieces, sections)[first]
        errors = soft.error * grown + errors[0], soft.torque_error * grown + errors[1]
        if errors[0] <= tol * np.abs(found.tension).max() and errors[1] <= tol * np.abs(found.torque).max():
            return found._replace(error=errors[0], torque_error=errors[1])
        soft = soft_string(soft.chain, soft.tension[0, 0], soft.torque[0, 0], max(tol / (4 * grown), _SET.least))
    raise NotConverged(
        f"torque_and_drag: the buckled string did not reach tol = {tol:g}: its helix multiplies errors from below by "
        f"{grown:.2g}, as close to lock-up as it is. Expected a larger tol"
    )


def earliest_helix(soft, pieces, sections):
    """The `Solved`, roughly, of a string whose snakes are helices, and which begins to be one as early as a helix is
    known to be possible: more than the friction of whatever shape it has. Raises LockUp: such a string locks up."""
    start, first = _begin(soft, pieces, sections, criteria.earliest_helix_load)
    return soft if first is None else _March(soft, start, pieces.bottom[-1], _SET.rough).up(first)


def growth(solved, pieces, sections):
    """(n,) factors by which helices above the lower ends of pieces amplify a change of tension there."""
    if not solved.helical.any():
        return np.ones(len(solved.helical))
    start = _start(solved.chain, pieces, sections, None)
    mean = np.abs(solved.tension @ UP_TO[-1])
    with np.errstate(invalid="ignore", divide="ignore"):
        rate = np.where(solved.helical, np.abs(solved.chain.drag) * start.clearance * mean / (2 * start.EI), 0.0)
    return np.exp(np.cumsum((rate * solved.chain.length)[::-1])[::-1])


def _start(chain, pieces, sections, load):
    EI, clearance = sections.EI[pieces.component[chain.origin]], (pieces.hole - pieces.radius)[chain.origin]
    return _Start(EI, clearance, np.isfinite(EI) & (clearance > 1e-9), load)


def _begin(soft, pieces, sections, load):
    """The `_Start`, and the lowest piece of the soft string with compression above `load`, None without one."""
    start = _start(soft.chain, pieces, sections, load)
    with np.errstate(invalid="ignore", divide="ignore"):
        loads = load(start.EI[:, None], start.clearance[:, None], soft.chain.weight[:, None],
                     soft.side * soft.chain.climb[:, None])  # fmt: skip
        above = np.flatnonzero((start.known[:, None] & (-soft.tension > loads)).any(axis=1))
    return start, int(above[0]) if len(above) else None


class LockUp(SceneError):
    """The string locks up: no thrust moves it. md: where, m."""

    def __init__(self, md):
        super().__init__(
            f"torque_and_drag: the string locks up at md = {md:.6g} m: the wall force of its helix holds any thrust "
            "from above there, and nothing moves. Expected less friction, weight on bit or length"
        )
        self.md = md


class _March:
    """One integration up the hole."""

    def __init__(self, soft, start, depth, rtol):
        self._soft, self._start, self._rtol = soft, start, rtol
        self._scale = max(np.abs(soft.tension).max(), 1.0)
        self._depth = depth - np.concatenate([[0.0], np.cumsum(soft.chain.length)])
        self._rows = []

    def up(self, first):
        """The `Solved`, integrated from piece `first` on."""
        soft = self._soft
        tension, torque = soft.tension[first, 0], soft.torque[first, 0]
        for i in range(first, len(soft.chain.length)):
            tension, torque = self._piece(i, tension, torque)
        chains, *columns = zip(*self._rows, strict=True)
        rows = [np.array(column) for column in columns]
        below = [getattr(soft, name)[:first] for name in ("tension", "torque", "side", "side_force", "helical")]
        chain = Chain(
            *(np.concatenate([old[:first], new]) for old, new in zip(soft.chain, np.array(chains).T, strict=True))
        )
        chain = chain._replace(origin=chain.origin.astype(int))
        tension, torque, side, force, helical = (np.concatenate(both) for both in zip(below, rows, strict=True))
        return Solved(chain, soft.at, tension, torque, side, force, np.nan, np.nan, helical.astype(bool))

    def _piece(self, i, tension, torque):
        """Tension and torque at the upper end of a piece, from those at its lower end."""
        piece = Chain(*(array[i].item() for array in self._soft.chain))
        done, helical = 0.0, None
        for _ in range(_SET.changes):
            t, n = map(float, piece.down(done))
            part = piece._replace(length=piece.length - done, t=t, n=n)  # without what is done
            equations = _Equations(part, self._start, i, self._scale)
            helical = equations.over(0.0, tension) > 0 if helical is None else not helical
            end, tension, torque, row = self._integrate(equations, helical, tension, torque, self._depth[i] - done)
            self._rows.append(row)
            done += end
            if done >= piece.length * (1 - 1e-12):
                return tension, torque
        raise NotConverged(
            f"torque_and_drag: the string changes its state again and again at md = {self._depth[i]:.6g} m"
        )

    def _integrate(self, equations, helical, tension, torque, md):
        """Up to the end of the piece or to the next change of state."""
        piece, scale = equations.piece, self._scale

        def rates(u, y):
            F = scale * math.tan(y[0])
            along, side = equations.loads(u, -F, helical)
            slope = -along - piece.drag * side
            return slope * scale / (scale**2 + F**2), piece.turn * side

        def change(u, y):
            return equations.over(u, -scale * math.tan(y[0]))

        def unbounded(u, y):
            return _SET.unbounded - y[0]

        change.terminal, change.direction = True, -1 if helical else 1
        unbounded.terminal = True
        start = [math.atan(-tension / scale), torque]
        found = solve_ivp(rates, (0.0, piece.length), start, method="DOP853", rtol=self._rtol, dense_output=True,
                          atol=[self._rtol * 1e-2, self._rtol * max(abs(torque), 1e-3 * scale)],
                          events=(change, unbounded))  # fmt: skip
        if not found.success:
            raise NotConverged(f"torque_and_drag: the buckled string at md = {md:.6g} m: {found.message}")
        end = float(found.t[-1])
        if len(found.t_events[1]):
            raise LockUp(md - end)
        u = self._soft.at * end
        x, moments = found.sol(u)
        tensions = -scale * np.tan(x)
        side = np.array([equations.loads(*place, helical)[1] for place in zip(u, tensions, strict=True)])
        part = piece._replace(length=end)
        row = part, tensions, moments, side / piece.climb, float(UP_TO[-1] @ side) * end / piece.climb, helical
        return end, float(tensions[-1]), float(moments[-1]), row


class _Equations:
    """Loads on a piece at the distance u from its lower end; scalars."""

    def __init__(self, piece, start, i, scale):
        self.piece, self._load, self._scale = piece, start.load, scale
        self._EI, self._clearance, self._known = start.EI[i], start.clearance[i], start.known[i]

    def loads(self, u, tension, helical):
        """Weight along the hole, and load across it with the force of a helix, per length."""
        piece, angle = self.piece, self.piece.curvature * u
        cos, sin = math.cos(angle), math.sin(angle)
        across = piece.curvature * tension + piece.weight * (piece.n * cos + piece.t * sin)
        side = math.hypot(across, piece.weight * piece.b)
        if helical:
            side += criteria.helix_side(self._EI, self._clearance, tension)
        return piece.weight * (piece.t * cos - piece.n * sin), side

    def over(self, u, tension):
        """Positive where the string is a helix, over the scale of its tension."""
        if not self._known:
            return -1.0
        load = self._load(self._EI, self._clearance, self.piece.weight, self.loads(u, tension, False)[1])
        return float(-tension - load) / self._scale
