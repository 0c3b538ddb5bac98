"""A string in its hole as a scene: one rod, hung from its upper end, with the hole's wall around it.

A string with bends has a reference line of straight pieces at angles, with a frame that does not twist. Also the states
from which an equilibrium is looked for, on the axis or in a helix: (r, q) (n, 7) at arc lengths s (n,), m; q is the
rotation from the rod's straight reference, without a jump of sign.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from cosserat_fenicsx.actions.walls import TubeRing, TubeWall, value_at
from cosserat_fenicsx.checks import finite_array, number, refuse, store
from cosserat_fenicsx.numerics import directors, product_conjugate
from cosserat_fenicsx.scene.curves import Curve, Line, exponential
from cosserat_fenicsx.scene.loads import Force, LineForce, Moment
from cosserat_fenicsx.scene.rod import Rod
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.sections import Stiffness
from cosserat_fenicsx.scene.signals import AlongPieces
from cosserat_fenicsx.scene.supports import Clamp, Hinge
from cosserat_fenicsx.well.contacts import high_side
from cosserat_fenicsx.well.criteria import snake_load


@dataclass(frozen=True)
class _BentLine(Curve):
    """A line with kinks, whose frame jumps there. line: the `Line` without them. places: ascending arc lengths of the
    kinks, m. turns: of each the rotation vector (rad) in components of the frame above it."""

    line: Line
    places: tuple[float, ...]
    turns: tuple[tuple[float, float, float], ...]
    length: float = field(init=False)

    uniform = True

    def __post_init__(self):
        frames = [self.line.frame(0.0)]
        for turn in self.turns:
            frames.append(frames[-1] @ exponential(np.array(turn)))
        frames, ends = np.array(frames), np.array([0.0, *self.places])
        corners = np.cumsum([np.zeros(3), *(np.diff(ends)[:, None] * frames[:-1, :, 2])], axis=0)
        store(self, length=self.line.length, _frames=frames, _ends=ends, _corners=corners)

    @property
    def breaks(self):
        return self.places

    @property
    def sides(self):
        """(kinks, 3) inertial unit vectors to the side that each kink bends the line to, across the piece above."""
        a, b, _ = np.array(self.turns).T
        local = np.column_stack([b, -a, np.zeros(len(a))]) / np.hypot(a, b)[:, None]
        return np.einsum("nij,nj->ni", self._frames[:-1], local)

    def _piece(self, s):
        """Indices of the pieces at arc lengths s (..); at a kink of the piece below it."""
        return np.searchsorted(self._ends, s, side="right").clip(min=1) - 1

    def position(self, s):
        """Inertial points at the arc lengths s (n,), m; shape (n, 3)."""
        s = np.asarray(s, dtype=float)
        at = self._piece(s)
        return self.line.start + self._corners[at] + (s - self._ends[at])[..., None] * self._frames[at, :, 2]

    def frame(self, s):
        """R_R at the arc lengths s (n,); shape (n, 3, 3), at a kink that below it."""
        return self._frames[self._piece(np.asarray(s, dtype=float))]

    def turned(self, s):
        """(n, 4) quaternions of the rotation from the first frame to that at s (n,); at a kink half of its own."""
        turns = self._frames @ self._frames[0].T
        trace = np.trace(turns, axis1=1, axis2=2)
        skew = turns - turns.transpose(0, 2, 1)  # bends are small: far from half a turn
        q = np.column_stack([1 + trace, skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        above = np.searchsorted(self._ends, s, side="left").clip(min=1) - 1
        q = q[above] + q[self._piece(s)]
        return q / np.linalg.norm(q, axis=1, keepdims=True)


def bent_line(line, path, bends, carried):
    """The reference line of a string with `bends`, see `string_in`, that lies in the hole without twist. line: the
    `Line` without bends. path: the `WellPath`. carried: function of tangents (n, 3) that gives the rotations without
    twist from the line's frame to them, (n, 4)."""
    turns = []
    for s, angle, side in bends:
        near = path.nearest(None, np.append(path.md[path.md < s], s))
        frame = directors(carried(near.tangent)[-1:])[0] @ line.frame(0.0)
        high = high_side(near.tangent[-1:], north=True)[0]
        to = np.cos(side) * high + np.sin(side) * np.cross(near.tangent[-1], high)
        a, b, _ = frame.T @ to
        turns.append((-angle * b, angle * a, 0.0))  # d_3 x the side in which it is bent
    return _BentLine(line, tuple(float(s) for s, _, _ in bends), tuple(map(tuple, np.array(turns).tolist())))


@dataclass(frozen=True)
class _Stiffening:
    """Settings of the rod, its wall and its rings."""

    # Torsional over bending stiffness of round sections: torsion winds a long string up by many turns, which changes
    # nothing else of it, but makes Newton's method fail. The twist is computed from the torque afterwards.
    torsion: float = 1e4
    of_rings: float = 100.0  # stiffness of a ring (N/m) over the wall's (N/m^2), since a ring digs in less
    per_bending: float = 1e13  # cap on the stiffness of a ring above the wall's, in EI/L^3, for rounding
    most: float = 1e13  # cap on ring stiffness (N/m) during wall stiffening
    rounding: float = 1.0  # cap on a ring's rounding force (N) during wall stiffening
    samples: int = 257  # of the lateral load
    typical: float = 0.9  # quantile of the lateral load
    least: float = 0.1  # floor of the lateral load, over the weight
    safe: float = 3.0  # the first spring over the softest in which the string does not buckle


_SET = _Stiffening()


@dataclass(frozen=True)
class StringScene:
    """A string in its hole.

    Attributes:
        path: the `WellPath`; scene: with one `rod`, its `support`, the `wall` and the `rings`.
        sections: the true `Stiffness` of each section; ends: (n,) their lower ends, m.
        weight: (n,) N/m; bottom: force at the lower end (3,), N.
        clearance: the smallest one of the wall, m. torque: at the lower end, against the rotation of drilling, N m.
        words: the simplifications, as text.
        begins: measured depth of the upper end, m.
    """

    path: object
    scene: Scene
    rod: Rod
    support: object
    wall: TubeWall
    rings: tuple
    sections: tuple
    ends: np.ndarray
    weight: np.ndarray
    bottom: np.ndarray
    clearance: float
    torque: float
    words: str
    begins: float = 0.0

    def near(self, s):
        """Points of the hole's axis, see `WellPath.nearest`, beside the rod on it at arc lengths s (n,), m."""
        return self.path.nearest(None, s + self.begins)

    def section_at(self, s):
        """(n,) indices of the sections at arc lengths s (n,)."""
        return np.searchsorted(self.ends[:-1], s)

    @property
    def whole_weight(self):
        """N."""
        return float(np.diff(self.ends, prepend=0.0) @ self.weight)

    @property
    def turns(self):
        """Whether torque is applied, or friction exerts one."""
        return bool(self.torque or any(across for _, (_, across) in self.wall.slip))

    @property
    def hand(self):
        """Hand of the helix that torque, or else the friction of rotation, favours: -1 where the angle round the axis
        falls down the hole, 1 where it grows, and where there is neither."""
        around = self.torque or sum(across for _, (_, across) in self.wall.slip)
        return -1 if around > 0 else 1

    @cached_property
    def bending(self):
        """Bending stiffness of the sections, N m^2."""
        return np.array([bending_of(section) for section in self.sections])

    def tension(self, s):
        """(n,) N at arc lengths s (n,) on the axis, without friction."""
        ends = np.append(0.0, self.ends)
        z, at = (self.near(x).position[:, 2] for x in (ends, s))
        above = np.append(0.0, np.cumsum(self.weight * np.diff(z)))
        part = self.section_at(s)
        along = self.bottom @ self.near(self.ends[-1:]).tangent[0]
        return along + above[-1] - (above[part] + self.weight[part] * (at - z[part]))

    @cached_property
    def _sampled(self):
        """The axis at points along the string, and section and tension (N) of what lies between these."""
        s = np.linspace(0.0, self.ends[-1], _SET.samples)
        return self.near(s), self.section_at(s)[1:], self.tension(s)[:-1]

    @cached_property
    def _typical(self):
        """A lateral load that few of the string are above, N/m."""
        near, at, tension = self._sampled
        down = np.array([0.0, 0.0, 1.0]) - near.tangent[:, 2:] * near.tangent
        load = tension[:, None] * near.curvature[1:] + self.weight[at, None] * down[1:]
        return max(np.quantile(np.linalg.norm(load, axis=1), _SET.typical), _SET.least * self.weight.max())

    @property
    def bending_length(self):
        """Length along which the typical load bends the string by the clearance, m."""
        return float((self.bending.min() * self.clearance / self._typical) ** 0.25)

    @cached_property
    def spring(self):
        """Stiffness of a spring to the axis in which the loads, and the string's resistance to the axis's curvature k,
        move it by about twice the clearance c, and in which its compression F does not buckle it; over the wall's
        stiffness. The moment EI k acts within the length sqrt(8 c/k), which gives EI k^2/(16 c^2); F^2/(4 EI) prevents
        buckling."""
        (near, at, tension), typical = self._sampled, self._typical
        EI = self.bending[at]
        buckles = (np.minimum(tension, 0.0) ** 2 / (4 * EI)).max()
        bends = (EI * (near.curvature[1:] ** 2).sum(axis=1)).max() / (16 * self.clearance**2)
        return float(max(typical / (2 * self.clearance), bends, _SET.safe * buckles) / self.wall.stiffness)

    @property
    def stiffest_rings(self):
        """Factor of the wall's stiffness from which on some ring is not made stiffer."""
        return min((ring.stage.most for ring in self.rings), default=np.inf)

    def leave(self, factor):
        """Set the walls for an answer: stiffer by a factor, without springs."""
        for stage in self.stages:
            stage.wall, stage.spring, stage.friction, stage.anchor = factor, 0.0, 1.0, None

    @property
    def stages(self):
        """The `Stage`s of the wall and of the rings."""
        return [wall.stage for wall in (self.wall, *self.rings)]


def string_in(path, lengths, stiffness, weight, contact_radius, wall_stiffness, *, radius, friction=0.0,
              slip=(0.0, 0.0), bottom_tension=0.0, bottom_torque=0.0, rings=(), hinge=None, extensible=False,
              has_arm=True, bends=()):  # fmt: skip
    """The `StringScene` of a string in a hole.

    Args:
        path: a `WellPath`, m.
        lengths: (n,) of the string's sections from the top down, m.
        stiffness: n `Stiffness`, or one for all.
        weight: (n,) or one, N/m, in the fluid (> 0).
        contact_radius: (n,) or one, radius of the surface that touches, m.
        radius: of the hole, m; or pieces [(md_end, radius)].
        friction: coefficient; or pieces [(md_end, coefficient)].
        slip: (c_a, c_r), unit direction of slip of the string's surface: (1, 0) up the hole, (-1, 0) down, (0, 1)
            turning (clockwise seen from above); (0, 0) for no friction; or one for each section, (n, 2).
        bottom_tension: N, along the hole at the string's end; negative: weight on bit.
        bottom_torque: torque on bit, N m, against the rotation.
        rings: [(s, clearance, radius)] of stabilisers and bits: stations (m from the top) that stay within a clearance
            (m) of the hole's axis; 0 centres the string there.
        wall_stiffness: N/m^2.
        hinge: None; or the direction about which the top turns freely, in place of a clamp.
        extensible: whether the axial stiffness counts in the equilibrium; the lengths are then without stretch.
        has_arm: whether friction acts on the surface; False: on the centreline.
        bends: [(s, angle, side)] stations (m from the top, ascending) at which the string is bent where it is free of
            stress: by an angle (rad) to a side of the hole (rad clockwise from its high side, looking down it).

    Raises:
        SceneError: naming the argument, its value and the expected one.
    """
    lengths = _numbers("lengths", lengths, None, "positive numbers (m)", lambda x: x > 0)
    weight = _numbers("weight", weight, len(lengths), "positive numbers (N/m)", lambda x: x > 0)
    arms = _numbers("contact_radius", contact_radius, len(lengths), "positive numbers (m)", lambda x: x > 0)
    sections = tuple(stiffness) if isinstance(stiffness, list | tuple) else (stiffness,) * len(lengths)
    if len(sections) != len(lengths) or not all(isinstance(x, Stiffness) for x in sections):
        refuse("solve_in_hole", "stiffness", stiffness, f"one Stiffness, or {len(lengths)} of them")
    ends = np.cumsum(lengths)
    length = float(ends[-1])
    if length > path.length * (1 + 1e-9):
        refuse("solve_in_hole", "lengths", length, f"together no more than the length of the hole, {path.length:g} m")
    top, bottom = (path.nearest(None, np.array([x])) for x in (0.0, length))
    start = tuple(top.position[0])
    held = [_in_place(x, extensible) for x in sections]
    straight = Line(start, tuple(top.position[0] + length * top.tangent[0]))
    rod = Rod(
        bent_line(straight, path, bends, partial(_carried, straight)) if bends else straight,
        held[0] if len(held) == 1 else [*zip(ends[:-1].tolist(), held[:-1], strict=True), (None, held[-1])],
        name="string",
    )
    if np.shape(slip) == (len(lengths), 2):
        slip = [*zip(ends.tolist(), map(tuple, np.asarray(slip).tolist()), strict=True)]
    wall = TubeWall(
        rod, path, radius, [*zip(ends.tolist(), arms.tolist(), strict=True)], wall_stiffness, friction, slip,
        has_arm=has_arm,
    )  # fmt: skip
    t = bottom.tangent[0]
    pull = number("solve_in_hole", "bottom_tension", bottom_tension, "a number (N)", math.isfinite)
    torque = number("solve_in_hole", "bottom_torque", bottom_torque, "a number (N m)", math.isfinite)
    down = AlongPieces([(float(end), (0.0, 0.0, float(w))) for end, w in zip(ends, weight, strict=True)])
    loads = [LineForce(rod, down)]
    loads += [Force(rod.end, tuple(pull * t))] if pull else []
    loads += [Moment(rod.end, tuple(-torque * t))] if torque else []
    stiffest = _SET.per_bending * max(bending_of(section) for section in sections) / length**3
    ring_stiffness = min(_SET.of_rings * wall.stiffness, max(wall.stiffness, stiffest))
    around = tuple(
        TubeRing(
            rod.at(s),
            path,
            clearance,
            ring_radius,
            ring_stiffness,
            *(value_at(given, [s]).tolist()[0] for given in (wall.friction, wall.slip)),
        )
        for s, clearance, ring_radius in rings
    )
    for ring in around:
        ring.stage.most = max(1.0, min(_SET.most, _SET.rounding / (np.finfo(float).eps * length)) / ring.stiffness)
    support = Clamp(rod.start) if hinge is None else Hinge(rod.start, hinge)
    words = "the string's lengths are those under load" if not extensible else "the string stretches"
    return StringScene(path, Scene([rod], [support], [*loads, wall, *around]), rod, support, wall, around, sections,
                       ends, weight, pull * t, wall.clearance, torque, words)  # fmt: skip


def _numbers(name, value, count, expected, accept):
    """(n,) numbers; one number counts for all `count`."""
    array = np.atleast_1d(finite_array("solve_in_hole", name, value, expected))
    if array.ndim == 1 and count is not None and len(array) == 1:
        array = np.full(count, array[0])
    if array.ndim != 1 or not len(array) or not accept(array).all() or (count is not None and len(array) != count):
        refuse("solve_in_hole", name, value, expected if count is None else f"{expected}, one or {count}")
    return array


def _in_place(section, extensible):
    """The stiffness that is solved with."""
    if section.matrix is not None:
        return section
    held = section if extensible else replace(section, axial=math.inf)
    return replace(held, torsion=max(section.torsion, _SET.torsion * section.bending[0])) if is_round(section) else held


def is_round(section):
    """Whether a section's bending does not depend on its twist."""
    return section.matrix is None and math.isclose(*section.bending, rel_tol=1e-12)


def bending_of(section):
    """The smaller bending stiffness of a section, N m^2."""
    return float(min(section.bending) if section.matrix is None else np.diag(section.matrix)[3:5].min())


def on_axis(rod, path, s, begins=0.0):
    """Of a rod that lies on the axis without twist, from the measured depth at which it begins, m."""
    near = path.nearest(None, s + begins)
    return _untwisted(rod, s, near.position, near.tangent)


def turns_of_helix(EI, compression, torque, hand):
    """(n,) rate h b, rad per m, of a long helix along a wall with small slopes. For a hand h, b makes its energy least:

        U/length = r^2 (EI b^4 - F b^2 + h Q b^3)/2,   b = (-1.5 h Q + (2.25 Q^2 + 8 EI F)^(1/2))/(4 EI),

    and the hand with h Q < 0 has less of it. Without torque b = (F/(2 EI))^(1/2) (Lubinski, Althouse & Logan,
    J. Petr. Technol. 14 (1962) 655, doi:10.2118/178-PA).

    Args:
        EI: N m^2, (n,). compression: F, N, (n,). torque: Q, N m, as in `InHole.torque`; hand: 1 where the angle
            grows down the hole, clockwise looking down it, -1 where it falls.
    """
    Q = -hand * torque
    return hand * (1.5 * Q + np.sqrt(2.25 * Q**2 + 8 * EI * compression)) / (4 * EI)


def energy_of_helix(EI, compression, torque, clearance, rate):
    """(n,) energy (J/m) of a long helix less the straight string's, see `turns_of_helix`."""
    return clearance**2 * (EI * rate**4 - compression * rate**2 + torque * rate**3) / 2


def in_helix(string, s):
    """Of a `StringScene` that winds along the wall, without twist, where its compression F without friction is beyond
    the load of a snake: with the rate of `turns_of_helix` and the hand that the torque favours. It fades to the
    axis where F is less, within half a turn of both ends and at the rings."""
    near, part = string.near(s), string.section_at(s)
    EI, weight = string.bending[part], string.weight[part]
    compression = np.maximum(-string.tension(s), 0.0)
    clearance = string.wall.sizes(s, near.md)[0]
    side = weight * np.hypot(near.tangent[:, 0], near.tangent[:, 1])
    rate = np.abs(turns_of_helix(EI, compression, string.torque, string.hand)) * (compression > 0)
    angle = np.append(0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(s)))
    held = np.array([0.0, string.ends[-1], *(ring.station.s for ring in string.rings)])
    turned = rate * np.abs(s[:, None] - held).min(axis=1)
    share = np.clip(compression / snake_load(EI, clearance, weight, side) - 1, 0, 1) * np.clip(turned / np.pi, 0, 1)
    d = directors(_untwisted(string.rod, s, near.position, near.tangent)[:, 3:]) @ string.rod.curve.frame(s)
    away = np.cos(angle)[:, None] * d[:, :, 0] + string.hand * np.sin(angle)[:, None] * d[:, :, 1]
    r = near.position + (share * clearance)[:, None] * away
    along = np.gradient(r, s, axis=0)
    return _untwisted(string.rod, s, r, along / np.linalg.norm(along, axis=1, keepdims=True))


def _untwisted(rod, s, position, tangent):
    """A line (n, 3), m, without twist, whose bends are straightened, at arc lengths s (n,)."""
    q = _carried(rod.curve, tangent)
    if rod.curve.breaks:
        q = product_conjugate(q, rod.curve.turned(s))
    return np.column_stack([position, q])


def _carried(curve, tangent):
    """(n, 4) rotations without twist from the first frame of a curve to unit tangents (n, 3) along a line."""
    before = np.concatenate([curve.frame(np.zeros(1))[:, :, 2], tangent[:-1]])
    cos = np.einsum("ni,ni->n", before, tangent)
    q = np.column_stack([1 + cos, np.cross(before, tangent)])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    done = 1  # products of the small rotations of 1, 2, 4, .. nodes
    while done < len(q):
        q[done:] = product_conjugate(q[done:], q[:-done] * (1.0, -1.0, -1.0, -1.0))
        done *= 2
    return q / np.linalg.norm(q, axis=1, keepdims=True)
