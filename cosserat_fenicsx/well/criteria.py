"""Loads at which a string in a hole buckles, by the usual criteria, each by its name; and the string with a helix.

EI: bending stiffness (N m^2); clearance: radius of the hole less the contact radius (m); weight: in mud (N/m);
compression: N, positive. All functions take arrays.

- Dawson-Paslay: sinusoidal, straight inclined hole, 2 sqrt(EI w sin i/r). R. Dawson & P. R. Paslay, J. Petr. Technol.
  36 (1984) 1734, doi:10.2118/11167-PA.
- Chen: helical, sqrt(2) times that: a uniform helix has the energy of the straight string. Y.-C. Chen, Y.-H. Lin &
  J. B. Cheatham, J. Petr. Technol. 42 (1990) 140, doi:10.2118/19176-PA.
- Wu: helical, 2 sqrt(2) - 1 times that: the mean over the transition. J. Wu & H. C. Juvkam-Wold, SPE 25503 (1993),
  doi:10.2118/25503-MS.
- He-Kyllingstad: sinusoidal, any hole: 2 sqrt(EI N/r) with the wall force per length N of the straight string under
  this load. X. He & A. Kyllingstad, SPE Drilling & Completion 10 (1995) 10, doi:10.2118/25370-PA.
- Lubinski: vertical hole, 1.94 (EI w^2)^(1/3). A. Lubinski, Drilling and Production Practice (1950) 178, API-50-178.
- Wu, Juvkam-Wold & Lu: helical, vertical hole, 5.55 (EI w^2)^(1/3) at the lower end when the first turn of a helix
  appears there, at whose top the compression is 0.14 (EI w^2)^(1/3). Oil & Gas J. 91 (1993) no. 33, 76. With the energy
  of the straight string a turn of length L bears 4 pi^2 EI/L^2 + w L/2 at its lower end, at least 4.05 (EI w^2)^(1/3),
  and half a sine wave 2.55: 4.05 is the mean of 2.55 and 5.55, and 0.14 is w L less than 5.55, L^3 = 16 pi^2 EI/w.

The compression at each place decides the state of a string: a snake above the greater of He-Kyllingstad's and
Lubinski's loads, a helix above the greater of sqrt(2) He-Kyllingstad's and 5.55 (EI w^2)^(1/3). A helix adds
r F^2/(4 EI) to the wall force per length.

The last three numbers belong to weight on the lower end of a string in a vertical hole. Taken at each place they leave
out the uppermost turn of a helix, from 5.55 down to 0.14 (EI w^2)^(1/3), and hold for compression that friction built
up farther below as well. The estimate of the model's error includes the possible effect: there the string is a helix
from the lowest load at which one is known, `earliest_helix_load`.

The soft string with the wall force of a helix: as `softstring`, with r F^2/(4 EI) more where the compression F = -T is
above the load of a helix (`helix_load`), and no more where it is a snake. The friction of a helix grows with F^2:
pushed from above, a string locks up where F grows beyond all bounds. Method: from the lowest place where a helix
begins, piece by piece up the hole, by SciPy's DOP853 in atan(F/F_0), which is finite there; where the state changes is
found as an event.
"""

import math
from collections import namedtuple
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.well.softstring import UP_TO, Chain, Solved, soft_string

_CHEN, _WU = np.sqrt(2.0), 2 * np.sqrt(2.0) - 1
_LUBINSKI, _VERTICAL_HELIX, _VERTICAL_TOP = 1.94, 5.55, 0.14
#: States of a string, and their names.
STRAIGHT, SNAKE, HELIX = 0, 1, 2
STATES = ("straight", "sinusoidal", "helical")


def dawson_paslay(EI, clearance, weight, inclination):
    """N; inclination in rad."""
    return 2 * np.sqrt(EI * np.abs(weight) * np.sin(inclination) / clearance)


def chen(EI, clearance, weight, inclination):
    """N; inclination in rad."""
    return _CHEN * dawson_paslay(EI, clearance, weight, inclination)


def wu(EI, clearance, weight, inclination):
    """N; inclination in rad."""
    return _WU * dawson_paslay(EI, clearance, weight, inclination)


def lubinski(EI, weight):
    """N."""
    return _LUBINSKI * np.cbrt(EI * weight**2)


def he_kyllingstad(EI, clearance, along, across, curvature):
    """N: the smallest F > 0 with F = 2 sqrt(EI N(F)/r), N^2 = (across - curvature F)^2 + along^2. along, across: weight
    per length along the binormal and along the normal of the axis (which points to the centre of its curvature), N/m;
    curvature: of the axis, 1/m. Returns infinity where no load fulfils it."""
    EI, clearance, along, across, curvature = np.broadcast_arrays(EI, clearance, along, across, curvature)
    # with F = f x: x^4 - (curvature f/q)^2 x^2 + 2 curvature f across/q^2 x - (across^2 + along^2)/q^2 = 0
    f = 2 * np.sqrt(EI * np.maximum(np.hypot(along, across), 1e-9) / clearance)
    q = f**2 * clearance / (4 * EI)
    companion = np.zeros((*f.shape, 4, 4))
    companion[..., 1, 0] = companion[..., 2, 1] = companion[..., 3, 2] = 1.0
    companion[..., 0, 3] = (across**2 + along**2) / q**2
    companion[..., 1, 3] = -2 * curvature * f * across / q**2
    companion[..., 2, 3] = (curvature * f / q) ** 2
    roots = np.linalg.eigvals(companion)
    real = (np.abs(roots.imag) < 1e-7 * np.abs(roots)) & (roots.real > 0)
    return f * np.where(real, roots.real, np.inf).min(axis=-1)


def load_of(name, EI, clearance, weight, inclination, along, across, curvature):
    """N: by the criterion of a name, see the functions above; NaN where EI or a clearance is missing. Raises
    SceneError: an unknown name."""
    loose = np.where(clearance > 1e-9, clearance, np.nan)
    straight = {"Dawson-Paslay": dawson_paslay, "Chen": chen, "Wu": wu}
    if name in straight:
        return straight[name](EI, loose, weight, inclination)
    if name == "Lubinski":
        return lubinski(EI, weight)
    if name != "He-Kyllingstad":
        refuse("TorqueAndDrag", "critical_load", name, f"{', '.join(straight)}, He-Kyllingstad or Lubinski")
    found, known = np.full(len(EI), np.nan), ~np.isnan(EI * loose)
    found[known] = he_kyllingstad(*(x[known] for x in (EI, loose, along, across, curvature)))
    return found


def snake_load(EI, clearance, weight, side):
    """N: above it the string is a snake; side: wall force per length without buckling, N/m."""
    return np.maximum(2 * np.sqrt(EI * side / clearance), lubinski(EI, weight))


def helix_load(EI, clearance, weight, side):
    """N: above it the string is a helix; side: wall force per length without buckling, N/m."""
    return np.maximum(2 * _CHEN * np.sqrt(EI * side / clearance), _VERTICAL_HELIX * np.cbrt(EI * weight**2))


def earliest_helix_load(EI, clearance, weight, side):
    """N: below it no part of a helix is expected: the load of a snake, in a vertical hole that at a helix' top."""
    return np.maximum(2 * np.sqrt(EI * side / clearance), _VERTICAL_TOP * np.cbrt(EI * weight**2))


def helix_side(EI, clearance, compression):
    """Wall force per length that a helix adds, N/m."""
    return clearance * compression**2 / (4 * EI)


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
#: a helix, such as `helix_load`.
_Start = namedtuple("_Start", "EI clearance known load")


def buckled_string(soft, pieces, sections, tol):
    """The `Solved` with helices, from the soft string without them; None if it has none. Raises LockUp: the string
    locks up; NotConverged: the tolerance was not reached."""
    for rtols in _SET.rtols:
        start, first = _begin(soft, pieces, sections, helix_load)
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
    start, first = _begin(soft, pieces, sections, earliest_helix_load)
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
            side += helix_side(self._EI, self._clearance, tension)
        return piece.weight * (piece.t * cos - piece.n * sin), side

    def over(self, u, tension):
        """Positive where the string is a helix, over the scale of its tension."""
        if not self._known:
            return -1.0
        load = self._load(self._EI, self._clearance, self.piece.weight, self.loads(u, tension, False)[1])
        return float(-tension - load) / self._scale
