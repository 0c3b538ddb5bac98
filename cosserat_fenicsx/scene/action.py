"""Actions on rods: the interface of loads, springs, dashpots and walls to models, solvers and time steppers; and parts
of a scene in words, for messages, tables and pictures.

An action defines where it acts, the data of its virtual work there, and the virtual work itself, a UFL function of
`forms.point.Point` (position, rotation, velocities), a virtual motion and these data. Everything else is derived from
that: tangents and second variations by differentiation, whether it is dead or depends on the state, whether its force
is statically known, whether it lies in a plane. No solver, stepper or model refers to an action by name.
"""

import pickle
from collections import namedtuple

import numpy as np

from cosserat_fenicsx.parts import Part
from cosserat_fenicsx.scene.signals import at


#: A scalar (size 1) or a vector (size 3, inertial) in a virtual work: value (size,), or (n, size) along a rod.
Datum = namedtuple("Datum", "value unit size")

# Powers of force, length and time of each unit; whether a vector with this unit is axial, like a moment: in a plane
# motion it is normal to the plane. "m from origin" marks positions, which models measure from `Scene.origin`; "axis"
# unit vectors along axes that are normal to the plane.
_UNITS = {
    "1": (0, 0, 0, False),
    "axis": (0, 0, 0, True),
    "m": (0, 1, 0, False),
    "1/m": (0, -1, 0, False),
    "rad/m": (0, -1, 0, True),
    "m from origin": (0, 1, 0, False),
    "m/s": (0, 1, -1, False),
    "rad/s": (0, 0, -1, True),
    "N": (1, 0, 0, False),
    "N m": (1, 1, 0, True),
    "N/m": (1, -1, 0, False),
    "N m/m": (1, 0, 0, True),
    "N/m^2": (1, -2, 0, False),
    "N m/rad": (1, 1, 0, True),
    "N s/m": (1, -1, 1, False),
    "N m s/rad": (1, 1, 1, True),
    "N s/m^2": (1, -2, 1, False),
    "N s^2/m^3": (1, -3, 2, False),
    "kg": (1, -1, 2, False),
    "kg/m": (1, -2, 2, False),
    "kg m": (1, 0, 2, False),
    "kg m^2": (1, 1, 2, False),
}
#: The units that data may have.
UNITS = tuple(_UNITS)
#: `Action.traits` of work that depends on positions and rotations, of which UFL takes up to three minutes to find them:
#: of one whose force lies in the plane of its vectors, and of one whose force may leave it.
IN_PLANE = {"dead": False, "known_force": False, "rates": False, "turns": True, "flat": True}
IN_SPACE = IN_PLANE | {"flat": False}


def vector(value, unit):
    """A `Datum` of three inertial components, (3,) or (n, 3)."""
    return Datum(np.asarray(value, dtype=float), _known(unit), 3)


def scalar(value, unit):
    """A `Datum` of one number, or (n,) along a rod."""
    return Datum(np.asarray(value, dtype=float)[..., None], _known(unit), 1)


def powers(unit):
    """(force, length, time) powers of a unit."""
    return _UNITS[unit][:3]


def is_axial(unit):
    """Whether a vector with this unit is axial, like a moment: in a plane motion it is normal to the plane."""
    return _UNITS[unit][3]


def _known(unit):
    if unit not in _UNITS:
        raise ValueError(f"unit {unit!r}: expected one of {', '.join(UNITS)}")
    return unit


class Action(Part, family="load or action", homes=("cosserat_fenicsx.scene.loads", "cosserat_fenicsx.actions")):
    """Base of loads, springs, dashpots and walls.

    A class of your own is a `PointAction` with a `station`, or a `LineAction` with a `rod`: a frozen dataclass with a
    method `data` and a static method `work`, in UFL.

    Attributes:
        station: the `Station` it acts at; None for a distributed action (`acts_on`). rod: the rod it acts along, or
            None.
        at_nodes: of a distributed action: it is integrated with the nodes as quadrature points (Gauss-Lobatto) instead
            of Gauss points, as contact requires.
        scaled: whether it is multiplied by the load factor; otherwise it acts in full.
        permanent: for an action that is not scaled: whether it is applied in steps, from zero, before the scaled ones,
            such as a weight.
        amplitude: a factor on all of it, of a load that a stage before has applied in part, or that a stage releases.
        follows: whether it depends on the rotation and has no potential.
        work: a static method ``(point, virtual motion, *data)`` -> UFL, or the name of a function in `forms.loads`: the
            virtual work at a point, per reference length of a distributed action. None for an action with inertia
            alone.
        memory: internal variables, kept from one accepted state to the next: a `Datum` each, its initial value, passed
            to `work` after `data`.
        evolve: a static method ``(point, *data, *memory)`` -> a list of UFL expressions, the new values of the memory.
        finds_friction: whether the last of its memory is a friction force that statics find with the state, by the
            method of multipliers (`statics.path.track`). The last of its `data` is then the stiffness against slip.
        delayed: None; or a method that returns what depends on the earlier motion of its `station`, made for one
            motion: an object with `longest`, the longest step that it allows (s), `begin` (motion) at the time 0,
            `at` (t) -> {attribute: value}, of the action at a time in the next step, `accept` (t, h, motion) after a
            step from t (s) to t + h, `undo` (), which takes back the last step, `memory` and `recall` as of
            `dynamics.stepper.Stepper`, and `far_end` () -> four numbers on the last step, of which results keep the
            means between saved states: velocity (m/s), force (N), angular velocity (rad/s) and torque (N m) where it
            ends; and `more` ones after them, if it has that attribute. `motion` is a
            `models.action_terms.StationMotion`.
        resists: whether it resists the motion of its `station`, along a direction and about the axis d3, in motions.
            Its `delayed` then also has `down` and `axis`, unit vectors (3,), inertial: the direction, and the axis at
            rest; `start` (h) at the begin of a step of the length h (s); and `forces` (free, compliance) -> (2,) force
            (N) and torque (N m) against the motion in the step, from the motion without them, (2,) m and rad, and what
            they take off, (2, 2). Those of the last call before `accept` are those of the step. `held` says whether
            the station was at rest in the last step, along and about.
        touches: whether it is a wall that nodes of rods touch in motions (dynamics/contact.py), in place of a virtual
            work. It then has `stiffness` (N/m^2; N/m at a station), `damping` (s/m), `begins` (m) and a method
            `tube_around` (arc lengths s (n,), points (n, 3) of the rod, measured depths (n,) near them) -> the
            `actions.walls.Around` of the points.
        presses: whether it is a wall with a force on the parts of rods that touch it alone, which has a kink where
            contact begins. It then has a method `first_contact`, which takes what that of `gaps` takes and returns gaps
            and normals, and the stiffness (N/m^2) along and across the normal where contact begins.
        gaps: None; or, of an obstacle, a method (rod, arc lengths s (n,), its points there (n, 3)) -> gaps (n,) between
            the rod's surface and the obstacle, m, and unit normals (n, 3) towards the free side. It then has
            `stiffness` (N/m^2), `friction`, with it `sticks` (N/m^2), `law` and `largest_step`, how far (m) a rod may
            move at once without passing through it unseen.
        rods_touch: whether it keeps rods from passing through each other (`actions.rod_contact.RodContact`), without a
            virtual work.
        in_law: whether it is no load but a part of the law along a rod. Its `data` are then what sections have without
            stress beyond the reference, inertial in the reference: curvature and twist, rad/m, and strain, 1.
        is_thread: whether it is the tension of a thread along a rod, which is no part of the rod's contact force. Its
            `data` are then the tension, N, and the arm from the axis to the thread, m, and its derivative along the
            rod, inertial in the reference.
        rough: whether it is a thread with friction, whose tension falls along the rod as it turns (`turning`). It then
            has `friction`, `pulled` and `tension`, and no potential.
        shortens: whether it is a thread of given length, whose tension is found (statics.tensions). It then has
            `shortening` (m) and `axial` (N, or None), is not `scaled`, and the tension in its `data` is 0. In a stage
            it has the shares of the shortening that are done before and with the load factor, `wound`, its length in
            the state where it came in, `base` (m; None for the reference), and its tension at the begin, `begun` (N).
        traits: None; or a dict of the fields of `models.formulation.Traits`, where it takes long to find them from
            `work`, such as `IN_PLANE`.
    """

    at_nodes, scaled, permanent, follows, memory, evolve, traits = False, True, False, False, (), None, None
    delayed, resists, touches, presses, gaps, in_law, is_thread = None, False, False, False, None, False, False
    rods_touch = shortens = rough = finds_friction = False
    wound, base, begun = (0.0, 1.0), None, 0.0
    amplitude = 1.0

    def acts_on(self, rod):
        """Whether it acts along a rod."""
        return rod is self.rod

    def data(self, rod, s):
        """The `Datum`s in `work`, at arc lengths s (n,) of a rod, m."""
        return ()

    def breaks(self, rod):
        """Arc lengths (m) where a distributed action is not smooth: elements end there."""
        return ()

    def kinks(self, rod):
        """Arc lengths (m) where the data of a distributed action are not smooth, though elements need not end there."""
        return ()

    def check_rod(self, rod):
        """Refuse a rod that it cannot act along.

        Raises:
            SceneError: naming the property that the rod lacks.
        """

    def check_scene(self, scene):
        """Refuse a scene that it cannot act in.

        Raises:
            SceneError: naming what the scene lacks.
        """

    def inertia(self, rod):
        """Mass (kg) and moments of inertia about d_1, d_2, d_3 (kg m^2, (3,)) that it adds at its station; or None."""
        return None

    def added_mass(self, rod, s, side):
        """Of a distributed action: masses per length that move with the axis of a rod at arc lengths s (...), m: (those
        across it, those along its tangent at rest), (...) each, kg/m; or None. `side` as for `Rod.stiffness_at`."""
        return None

    def holds(self, scene):
        """The rigid motions that it resists elastically, so that they are no mechanism.

        Returns:
            [(station, row)], rows (6,) over (displacement, small rotation), inertial.
        """
        return ()

    def beside(self, s):
        """Of a wall along rods that nodes touch: arc lengths s (n,), m, of a rod; where its surface has a step, those
        just above or below it, where the part is that stands out and touches."""
        return s

    def tube(self):
        """For pictures, of an action that keeps a rod inside a tube: (n, 3) points of the tube's axis, m, and (n,) how
        far the rod may move from there, m; else None."""
        return None

    @property
    def smooth(self):
        """The same action without friction and at rest, by which equilibria with and without friction are compared."""
        return self

    def drawn(self, low, high):
        """For pictures, of an obstacle: (n, m, 3) points of its surface, m, as large as the box with the corners low
        and high (3,), m; else None."""
        return None

    def companions(self, scene):
        """Actions that it adds to a scene, such as the weight of its point masses."""
        return ()

    #: For data that depend on the rod's position (such as the nearest point of a curved axis): a method
    #: (rod, s (n,), r (n, 3)) -> the `Datum`s of `data` for a rod whose points are at r (m, inertial). It is evaluated
    #: in every Newton iteration; its derivative by r is not in the tangent.
    refreshed = None
    #: None; or, of an action at a station, a class and what tells apart those that it cannot join: its object of
    #: several actions at stations of one rod has a `refreshed` for a point of each.
    together = None
    #: Whether its `added_mass` along a rod is smaller than that across.
    lateral = False
    #: Whether it stands for the inertia of a motion, so that motions and natural modes refuse it.
    of_inertia = False


class PointAction(Action):
    """An action at a `station`; see `Action`."""

    rod = None


class LineAction(Action):
    """An action along a `rod`, per unit of reference length; see `Action`."""

    station = None


def has_permanent(scene):
    """Whether a scene has permanent loads, so that its state at the load factor 0 is not the reference."""
    return any(action.permanent for action in scene.actions)


def without_stress(scene, rod, s, t=0.0):
    """(2, 2, n, 3), material: what the actions in the law give sections of a rod without stress at arc lengths s (n,),
    m, and the time t (s): in full, and per unit of the load factor; curvature and twist, rad/m, and strain."""
    found, frames = np.zeros((2, 2, len(s), 3)), rod.curve.frame(s)
    for action in scene.actions:
        if action.in_law and action.acts_on(rod):
            data = at(action, t).data(rod, s)
            found[int(action.scaled)] += [np.einsum("kji,kj->ki", frames, datum.value) for datum in data]
    return found


def path_dependent(scene):
    """Whether an action of a scene has a memory, so that states must be computed in order."""
    return any(action.memory for action in scene.actions)


def rubs(scene):
    """Whether an obstacle of a scene has friction: an equilibrium is then reached by load control alone."""
    return any(load.gaps is not None and load.friction for load in scene.all_loads)


def describe(item):
    """A support or a load as text: its class and its station."""
    name = item.called or type(item).__name__
    if item.station is not None:
        return f"{name} at {item.station}"
    return f"{name} on {item.rod.name}" if item.rod is not None else name


def some_of(texts, most=6):
    """Texts in a row: all of them, or the first ones and how many more there are."""
    texts = list(texts)
    more = f" and {len(texts) - most} more" if len(texts) > most + 1 else ""
    return ", ".join(texts[:most] if more else texts) + more


def part_in_words(item):
    """A part of a scene in messages: as `describe`, or by its name or class."""
    return describe(item) if hasattr(item, "station") else getattr(item, "name", type(item).__name__)


def actions_in_words(scene):
    """Sentences that list the actions and prescribed motions of a scene, by whether the load factor multiplies them,
    and what its stages change."""
    groups = (
        ("Loads, times the load factor", [x for x in scene.loads if x.scaled]),
        ("Prescribed motions, times the load factor", [x for x in scene.supports if x.moves]),
        ("Permanent loads, applied in full before", [x for x in scene.loads if x.permanent]),
        ("Not multiplied by the load factor", [x for x in scene.loads if not x.scaled and not x.permanent]),
    )
    lines = [f"{title}: {some_of(map(describe, items))}." for title, items in groups if items]
    legs = scene.legs if scene.stages else []
    named = {x.place: x.item for leg in legs for x in (*leg.standing, *leg.ramped, *leg.supports)}
    for leg in legs[-len(scene.stages) :]:
        stage = scene.stages[leg.stage]
        groups = ("applies", stage.loads), ("holds", stage.supports), ("releases", [named[x] for x in stage.release])
        changes = [f"{verb} {some_of(map(describe, items))}" for verb, items in groups if items]
        lines.append(f"Stage {leg.name or leg.stage}: {'; '.join(changes)}.")
    return "\n".join(lines) or "Loads: none."


def unpicklable(scene):
    """Text that names the parts of a scene that cannot be pickled; "" if all can be."""
    if _pickles(scene):
        return ""
    for group in ("rods", "loads", "supports", "velocities"):  # all other parts only refer to rods
        items = list(enumerate(getattr(scene, group)))
        names = [f"{group}[{i}] ({part_in_words(item)})" for i, item in items if not _pickles(item)]
        if names:
            return ", ".join(names)
    return "the scene"


def _pickles(thing):
    try:
        pickle.dumps(thing)
    except Exception:  # methods of user-defined parts may raise anything
        return False
    return True
