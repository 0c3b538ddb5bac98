"""A drill-string in motion with a rod for its lower part, and waves for the pipe above: `mixed_scene`."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.actions.walls import HoleRing, HoleWall, TubeRing, TubeWall, value_at
from cosserat_fenicsx.checks import instance, number, refuse, whole
from cosserat_fenicsx.drilling.history import COLUMNS, DrillingHistory
from cosserat_fenicsx.drilling.pipe_above import PipeAbove
from cosserat_fenicsx.drilling.rod_bit import BitAtEnd
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.protocol import follows_the_bit
from cosserat_fenicsx.drilling.wall_friction import law_of, static_weight
from cosserat_fenicsx.numerics import directors, small_rotations
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.results.history import History
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.results.screen import InWords
from cosserat_fenicsx.scene.curves import Line
from cosserat_fenicsx.scene.loads import Force, LineForce
from cosserat_fenicsx.scene.rod import Damping, Rod
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.signals import AlongPieces
from cosserat_fenicsx.scene.supports import Roller
from cosserat_fenicsx.well.components import DrillPipe
from cosserat_fenicsx.well.pieces import rings_of
from cosserat_fenicsx.well.rod.string_scene import StringScene

# Length (m) below which a part is absent.
_NOTHING = 1e-9
# Default stiffness of the wall, N/m^2, and of rings, N/m.
_WALL = 1e8
# Default length (m) of elements, and the fewest.
_ELEMENT, _FEWEST = 6.0, 8
# Default damping of the wall in motions, s/m.
_DAMPING = 10.0
# Speed (m/s) for which the rebound from the wall is reported.
_TOUCH = 0.03
_DOWN = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class MixedScene(InWords):
    """A `Scene` of the lower part of a string, for `simulate`.

    Attributes:
        scene: of the rod, its loads, the wall of the hole, and the pipe above. at_rest: the same rod with a wall
            without friction; `rest` finds its equilibrium.
        rod: from the top down. above: the `PipeAbove`. bit: the `BitAtEnd`, or None. depth: measured depth of the
            rod's upper end, m.
        why: sentences on approximations. drilling: the `Drilling` that it was made of.
    """

    scene: Scene
    at_rest: Scene
    rod: Rod
    above: PipeAbove
    bit: BitAtEnd | None
    depth: float
    why: tuple
    drilling: Drilling
    _string: StringScene | None = field(default=None, repr=False)

    def sentences(self, units: Units):
        """On the rod, what the model leaves out, and the drill-string that it was made of, in some units."""
        yield (
            f"Rod of {units.told(self.rod.length, 'm')} below md = {units.told(self.depth, 'm')}; the pipe above, with "
            f"waves of torsion and stretch, pulls at it with {units.told(self.above.tension, 'N', form='.4g')}."
        )
        yield from (units.sentence(f"{x[0].upper()}{x[1:]}.") for x in self.why[1:])
        yield from self.drilling.sentences(units)

    def rest(self, elements: int, degree: int, *, comm: MPI.Comm | None = None) -> Path:
        """The equilibrium at the wall without friction, to `start` a motion from: with the same mesh nothing moves.

        Args:
            elements, degree: those of the motion. comm: MPI communicator; default all ranks.

        Returns:
            A `Path` of one point; its `stable` says whether the rod would buckle but for friction.

        Raises:
            SceneError: a string without a hole, whose motion has `start=1.0`.
            NotConverged: no equilibrium was found.
        """
        if self._string is None:
            refuse("mixed_scene", "drilling.hole", None, "a Borehole for `rest`; without one start=1.0 in `simulate`")
        # imported here, since it needs dolfinx, which a scene does not
        from cosserat_fenicsx.well.rod.rod_in_hole import at_rest

        whole("rest", "elements", elements)
        return at_rest(self._string, elements, degree, comm)

    def run(
        self,
        duration: float,
        *,
        dt: float = 1e-3,
        elements: int | None = None,
        degree: int = 2,
        save_every: float | None = None,
        progress: bool | None = None,
        comm: MPI.Comm | None = None,
    ) -> DrillingHistory:
        """The motion from rest, in one call: `rest`, `simulate` and `as_drilling`.

        Args:
            duration: s. dt: step, s. elements: of the rod; None for one of about 6 m. degree, save_every, progress,
                comm: as for `simulate`.

        Raises:
            SceneError, NotConverged: see `rest` and `simulate`.
        """
        from cosserat_fenicsx.dynamics.simulate import simulate  # it needs dolfinx

        mesh = {"elements": elements or max(_FEWEST, math.ceil(self.rod.length / _ELEMENT)), "degree": degree}
        start = 1.0 if self._string is None else self.rest(**mesh, comm=comm)
        return self.as_drilling(simulate(self.scene, duration, dt=dt, **mesh, start=start, save_every=save_every,
                                         progress=progress, comm=comm))  # fmt: skip

    def as_drilling(self, history: History) -> DrillingHistory:
        """Series at the surface and at the bit of a motion of `scene`, as of other models of strings: its charts,
        tables, stick-slip, and files. Rows are the saved states but the first.

        Speeds, torques, hook load and weight on bit are means between states, in which the bit must turn by less than a
        whole turn. There is no ledger of energy, which `history` has for the rod.

        Raises:
            SceneError: a motion of another scene, or with less than two states.
        """
        if self.rod not in history.scene.rods or len(history) < 2:
            refuse("as_drilling", "history", history, "a motion of the `scene`, with two states or more")
        rod, times, dt = self.rod, history.times, np.diff(history.times)
        far, q = history.far_end(self.above)[1:], history.rotation(rod.end)
        middle, change = (q[1:] + q[:-1]) / 2, np.diff(q, axis=0)
        size, tangent = np.linalg.norm(middle, axis=1, keepdims=True), rod.curve.frame(rod.length)[:, 2]
        # 4 tan(angle/4), about the mean axis of the bit
        about = np.einsum("nij,nj,ni->n", small_rotations(middle), change, directors(middle / size) @ tangent)
        turned, axis = 4 * np.arctan(about / 4), directors(q[1:]) @ tangent
        moved = np.einsum("ni,ni->n", np.diff(history.position(rod.end), axis=0), axis)
        on_bit = np.zeros((len(dt), 4)) if self.bit is None else history.far_end(self.bit)[1:]
        rows = dict.fromkeys(COLUMNS, np.full(len(dt), np.nan)) | {
            "times": times[1:], "drive_speed": far[:, 2], "drive_angle": np.cumsum(far[:, 2] * dt),
            "surface_torque": far[:, 3], "bit_speed": turned / dt, "bit_angle": np.cumsum(turned),
            "torque_on_bit": on_bit[:, 3],
            "hook_load": self.above.at_rest[0] - far[:, 1], "bit_velocity": moved / dt, "bit_advance": np.cumsum(moved),
            "weight_on_bit": on_bit[:, 1], "motor_speed": far[:, 4:].sum(axis=1),
        }  # fmt: skip
        rows |= dict(enumerate(far[:, 4:].T)) if far.shape[1] > 5 else {}
        ends = np.array([0.0, self.depth, self.drilling.bit_depth])
        return DrillingHistory(self.drilling, "rod below pipe", self.why, dt.mean(), ends, np.array([*rows.values()]).T)


def mixed_scene(drilling: Drilling, depth: float | None = None, *, wall_damping: float = _DAMPING) -> MixedScene:
    """A rod for a string's lower part in its hole, which may bend, and waves for the pipe above.

    Components of the axes are north, east, down, as in a `WellPath`; without a hole the string is vertical below the
    origin. The rod is straight where it is free of stress. Its upper end is held on the axis of the hole, where it may
    turn and move along. With a hole, the rod's nodes touch the wall, and stabilisers and the bit touch it as rings,
    with the friction of the hole; a `BitOnRock` below a string without a `Bit` is centred in the hole. The bit's law
    acts at the lower end (`BitAtEnd`), its weight along the hole. The pipe above rubs at the wall where its waves
    meet (`PipeAbove.rubs`), and starts with the tension of the equilibrium without friction.

    Args:
        drilling: a `Drilling` with a `DrillString`.
        depth: measured depth of the rod's upper end, m or text, such as "9800 ft"; None for the lower end of the lowest
            `DrillPipe`. A joint or two of pipe above, such as 30.0, leave a rod for the whole string.
        wall_damping: of the wall of the hole and its rings, s/m, see `HoleWall`. A body that comes down on the wall
            with the speed v leaves it with about v (1 - 2 damping v/3). Without damping a bit in gauge chatters from
            step to step, and the energy balance suffers.

    Returns:
        MixedScene.

    Raises:
        SceneError: discs, a depth outside the string, a bent housing below the depth, drags of torsion and of axial
            motion that differ, a start in steady rotation, or what `BitAtEnd` refuses.
    """
    instance("mixed_scene", "drilling", drilling, Drilling, "a Drilling")
    if not hasattr(drilling.string, "components"):
        refuse("mixed_scene", "drilling.string", drilling.string, "a DrillString; discs are no rod")
    if drilling.start != "rest":
        refuse("mixed_scene", "drilling.start", drilling.start, "'rest', from which the rod starts")
    top = _depth(drilling, depth)
    for joint in drilling.joints:
        if not joint.turns or drilling.places[joint.segment].bottom > top - _NOTHING:
            refuse("mixed_scene", "drilling.string", joint.tool, "a string without OscillationTool, and without a "
                   f"MudMotor at or below the rod's upper end, {top:g} m: a deeper one, or a Collar in its place; "
                   "drilling.simulate has them")  # fmt: skip
    damping = number(
        "mixed_scene", "wall_damping", wall_damping, "a number of s/m, not negative", lambda x: 0 <= x < math.inf
    )
    parts = list(zip(drilling.places, drilling.segments, strict=True))  # from the top down
    below = [
        (max(place.top, top), place.bottom, place.component, x) for place, x in parts if place.bottom > top + _NOTHING
    ]
    for _, _, part, _ in below:
        if part.bend:
            refuse(part, "bend", part.bend, "None in mixed_scene, whose rod is straight where it is free of stress")
    above = [replace(x, length=min(place.bottom, top) - place.top) for place, x in parts if place.top < top - _NOTHING]
    (start, _), (t, along) = _axis(drilling, np.array([top, drilling.bit_depth]))
    ends = np.array([bottom - top for _, bottom, _, _ in below])
    sections = [_section(part, x) for _, _, part, x in below]
    rod = Rod(Line(tuple(start), tuple(start + ends[-1] * t)),
              sections[0] if len(sections) == 1 else [*zip(ends.tolist(), sections, strict=True)],
              name="lower part", damping=_damping(drilling))  # fmt: skip
    weight = np.array([x.weight for _, _, _, x in below])
    weights = [(float(x), (0.0, 0.0, float(w))) for x, w in zip(ends, weight, strict=True)]
    on_bit = static_weight(drilling)
    whole = [np.array([0.0, *(place.bottom for place, _ in parts)]), np.array([top, *(part[1] for part in below)])]
    heights = [np.diff(_axis(drilling, md)[0][:, 2]) for md in whole]
    hanging = float(weight @ heights[1]) - on_bit
    hook_load = float(np.array([x.weight for _, x in parts]) @ heights[0]) - on_bit
    rough = drilling.hole and (drilling.friction or any(x.friction for x in drilling.hole.sections))
    pipe = PipeAbove(rod.start, tuple(above), drilling.drive, drilling.hook, hanging, drilling.drag,
                     drilling if rough else None, follows_the_bit(drilling), (hook_load, on_bit),
                     tuple((joint.segment, joint) for joint in drilling.joints))  # fmt: skip
    resting = replace(pipe, follows=False)
    weights = LineForce(rod, AlongPieces(weights) if len(weights) > 1 else weights[0][1])
    thrust = [Force(rod.end, tuple(-on_bit * along))] if on_bit else []
    bit = None if drilling.bit is None else BitAtEnd(rod.end, drilling.bit, tuple(along))
    held = (rod.start,) if drilling.hole else (rod.start, rod.end)
    supports = [Roller(x, tuple(across)) for x in held for across in np.linalg.svd(t[None])[2][1:]]
    radii = [(float(x), part.body_radius) for x, (_, _, part, _) in zip(ends, below, strict=True)]
    still, moving = _walls(drilling, rod, top, radii, damping)
    at_rest = Scene([rod], supports, [weights, resting, *thrust, *still])
    scene = Scene([rod], supports, [weights, pipe, *([bit] if bit else []), *moving])
    string = None
    if still:
        wall, *rings = still
        string = StringScene(drilling.hole.path, at_rest, rod, None, wall, tuple(rings), tuple(sections), ends, weight,
                             -on_bit * along, wall.clearance, 0.0, "at rest without friction", top)  # fmt: skip
    return MixedScene(scene, at_rest, rod, pipe, bit, top, tuple(_why(drilling, top, damping)), drilling, string)


def _section(part, segment):
    """The `Stiffness` of a component, with the mass and the torsion of its tool joints."""
    given = replace(part.stiffness, mass=segment.rhoA)
    if given.matrix is not None:
        return given
    return replace(given, torsion=segment.GJ, inertia=(*given.inertia[:2], segment.rhoJ))


def _depth(drilling, depth):
    if depth is None:
        pipes = [place.bottom for place in drilling.laid if isinstance(place.component, DrillPipe)]
        if not pipes or max(pipes) >= drilling.bit_depth:
            refuse("mixed_scene", "depth", depth, "the measured depth (m) of the rod's upper end, where no component "
                   "lies below the lowest DrillPipe")  # fmt: skip
        return max(pipes)
    expected = f"a depth (m) within the string, above 0 and below {drilling.bit_depth:g} m"
    return number("mixed_scene", "depth", depth, expected, lambda x: 0 < x < drilling.bit_depth)


def _axis(drilling, md):
    """Points (n, 3) and tangents (n, 3) of the axis at measured depths (n,)."""
    if drilling.hole is None:
        return md[:, None] * _DOWN, np.tile(_DOWN, (len(md), 1))
    return drilling.hole.path.position(md), drilling.hole.path.tangent(md)


def _damping(drilling):
    if drilling.damped:
        refuse("mixed_scene", "drilling.string", drilling.string, "components without damping_time: the pipe above the "
               "rod has none")  # fmt: skip
    drag = drilling.drag
    if drag is None or drag.torsion == drag.axial == 0:
        return None
    if drag.torsion != drag.axial:
        refuse("mixed_scene", "drilling.drag", drag, "the same rate of torsion and axial motion, for the rod")
    return Damping(drag=drag.torsion)


def _walls(drilling, rod, top, radii, damping):
    """The walls and rings for equilibria, and those for motions."""
    hole = drilling.hole
    if hole is None:
        return [], []
    radius = [(section.to, section.diameter / 2) for section in hole.sections]
    given = {"stiffness": hole.wall_stiffness or _WALL, "begins": top}
    friction = [(section.to, section.friction) for section in hole.sections]
    if drilling.friction is not None:
        law, _, of_hole = law_of(drilling.friction)
        if law.function is not None:
            refuse("mixed_scene", "drilling.friction", drilling.friction, "a WallFriction, of which the rod's wall "
                   "takes the kinetic coefficient; other laws act in drilling.simulate")  # fmt: skip
        friction = [(to, law.kinetic * (x if of_hole else 1.0)) for to, x in friction]
    rings = [ring[:3] for ring in rings_of(drilling.laid, hole)[::-1] if ring.s > top + _NOTHING]
    if drilling.bit is not None and (not rings or rings[-1][0] < drilling.bit_depth - _NOTHING):
        rings.append((drilling.bit_depth, 0.0, radii[-1][1]))
    stations = [rod.end if s > drilling.bit_depth - _NOTHING else rod.at(s - top) for s, *_ in rings]
    rubs = value_at(friction, [s for s, *_ in rings]).tolist()
    return tuple(
        [along(rod, hole.path, radius, radii, friction=friction, **given, **more),
         *(at(station, hole.path, *sizes, friction=mu, **given, **more)
           for station, (_, *sizes), mu in zip(stations, rings, rubs, strict=True))]
        for along, at, more in ((TubeWall, TubeRing, {}), (HoleWall, HoleRing, {"damping": damping}))
    )  # fmt: skip


def _why(drilling, top, damping):
    yield f"rod below {top:g} m, waves of torsion and stretch in the pipe above"
    if drilling.hole is not None:
        yield "bending of the pipe above is left out: friction by the wall force of a soft string, with its tension"
        friction = drilling.friction
        law, _, of_hole = law_of(friction)
        most = law.still * (max(x.friction for x in drilling.hole.sections) if of_hole else 1.0)
        if most:
            yield (f"the wall bears the friction around it too, as in torque_and_drag: up to "
                   f"{1 - 1 / math.hypot(1, most):.1%} less of it than in drilling.simulate")  # fmt: skip
            yield ("the support of the rod's upper end has no friction: what the wall would bear there, about half "
                   "the load on the first span, does not rub")  # fmt: skip
        if friction is not None and friction.decays:
            yield "friction at the rod's wall is the kinetic one, at rest too"
        if drilling.hole.wall_stiffness is None:
            yield f"the wall has a stiffness of {_WALL:g} N/m^2"
        if damping:
            kept = max(1 - 2 * damping * _TOUCH / 3, 0.0)
            yield (f"the wall has a damping of {damping:g} s/m (wall_damping): what touches it at {_TOUCH:g} m/s "
                   f"leaves it with about {kept:.0%} of that")  # fmt: skip
    yield "mud adds no mass to sideways motions of the rod"
    bit = drilling.bit
    if bit is None or bit.weight is None:
        return
    if follows_the_bit(drilling):
        yield "without a Hook its load stays the same: the string follows the bit that drills"
    elif math.isinf(bit.rock_stiffness) and not bit.law.drills:
        yield "the weight on bit is constant: the bit does not leave the rock"
