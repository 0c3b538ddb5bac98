"""Supports, joints and loads of a scene as plain data (`Mark`), and as signs on the rods at rest, or on the rods of a
path or a motion.

Actions are read by the units of their data, whatever their class: a vector in N is a force, one in N/m a force along
the rod, a number in N/m a spring.
"""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.pictures.drawing import quantity
from cosserat_fenicsx.pictures.symbols import Pose, Symbols
from cosserat_fenicsx.pictures.view import view_of
from cosserat_fenicsx.scene.action import describe
from cosserat_fenicsx.scene.signals import at, sample_times, signals_of
from cosserat_fenicsx.scene.supports import Hinge, Prescribed, Roller

# Size of a sign over the extent of the drawing; from this number of signs on they are smaller, at least by this share.
_SIZE, _MANY, _SMALLEST = 0.048, 12, 0.5
# Points of a thread along a rod.
_ALONG_THREAD = 201
# Share of a force normal to a plane scene from which on the scene is seen from a corner.
_OUT_OF_PLANE = 0.1


class Resting:
    """The rods of a scene at rest, with its loads at load factor 1, and at their largest if they depend on time; radii:
    {rod: the radius that it is drawn with, m}."""

    time, rests = None, True

    def __init__(self, radii):
        self._radii = radii

    def share(self, load):
        """The factor of a load."""
        return 1.0

    def supports(self, scene):
        """The supports that hold, of a scene at rest those of all stages."""
        return scene.all_supports

    def line(self, rod):
        """(n, 3) the centreline of a rod, m."""
        return rod.curve.position(np.linspace(0, rod.length, 101))

    def beside(self, rod, arms):
        """(n, 3) points off the centreline, m, at even arc lengths; arms (n, 3), m, turn with the sections and are
        inertial in the reference, and reach out of the rod as it is drawn."""
        line, directors = self._sections(rod, np.linspace(0, 1, len(arms)))
        sizes = np.linalg.norm(arms, axis=1, keepdims=True)
        arms = arms * np.maximum(1.0, 1.05 * self._radii[rod] / np.maximum(sizes, 1e-30))
        material = np.einsum("kji,kj->ki", rod.curve.frame(np.linspace(0, rod.length, len(arms))), arms)
        return line + np.einsum("kij,kj->ki", directors, material)

    def _sections(self, rod, x):
        s = x * rod.length
        return rod.curve.position(s), rod.curve.frame(s)

    def pose(self, station):
        """The `Pose` of a section."""
        rod = station.rod
        return self._pose(station, rod.curve.position(station.s), rod.curve.frame(station.s))

    def radius(self, rod):
        """The radius that a rod is drawn with, m."""
        return self._radii[rod]

    def _pose(self, station, place, directors):
        rod, d3 = station.rod, directors[:, 2]
        inwards = d3 if station.s == 0 else -d3 if station.s == rod.length else None
        return Pose(place, directors, directors @ rod.curve.frame(station.s).T, inwards, self._radii[rod])


class Deformed(Resting):
    """The rods at point k of a path or a motion, with displacements magnified, all shifted by a vector (3,), m."""

    rests = False

    def __init__(self, result, k, radii, magnify, shift):
        super().__init__(radii)
        self._result, self._k, self._magnify, self._shift = result, k, magnify, shift
        self.time = result.along_axis[k] if result.axis == "time" else 0.0

    def share(self, load):
        return self._result.share_of(load, self._k)

    def supports(self, scene):
        return self._result.supports_at(self._k)

    def line(self, rod):
        return self._sections(rod, np.linspace(0, 1, 101))[0]

    def pose(self, station):
        places, directors = self._sections(station.rod, np.array([station.s / station.rod.length]))
        return self._pose(station, places[0], directors[0])

    def _sections(self, rod, x):
        places, directors = self._result.sample(self._k, rod, x)
        reference = rod.curve.position(x * rod.length)
        return reference + self._magnify * (places - reference) + self._shift, directors


def signs_of(pyvista, scene, shapes, everywhere, span):
    """The `Symbols` of a scene: supports and joints on the last of the shapes (`Resting` or `Deformed`), each load on
    the last one where it is not zero; everywhere: all points of the drawing (n, 3), m; span: see `span_of`."""
    last, loads = shapes[-1], _acting(scene, shapes)
    supports = marks_of_supports(last.supports(scene))
    to_camera, right, above, _ = view_of(span)
    count = len(supports) + sum(mark.station is not None for _, mark, _ in loads)
    size = sign_size(span, count)
    symbols = Symbols(pyvista, span, size, [shape.line(rod) for shape in shapes for rod in scene.rods])
    for mark in supports:
        told = last.rests and mark.kind == "moved" and mark.vector is not None and mark.vector.any()
        symbols.support(mark, last.pose(mark.station), quantity(np.linalg.norm(mark.vector), "m") if told else "")
    for mark in joints_of(scene):
        symbols.joint(mark, last.pose(mark.station))
    for thread in (load for load in scene.all_loads if load.is_thread):
        s = np.linspace(0, thread.rod.length, _ALONG_THREAD)
        _, arms, _ = at(thread, 0.0).data(thread.rod, s)
        symbols.thread(last.beside(thread.rod, arms.value))
    top = {}
    for _, mark, _ in loads:
        if mark.unit:
            top[mark.unit] = max(top.get(mark.unit, 0.0), float(np.linalg.norm(mark.vector, axis=-1).max()))
    for load, mark, shape in loads:
        text = _words(load, mark, shape)
        if mark.station is not None:
            share = np.linalg.norm(mark.vector) / top[mark.unit] if mark.unit else 1.0
            symbols.load(mark, shape.pose(mark.station), share, text)
        elif mark.rod is not None:
            symbols.along(mark, shape.line(mark.rod), shape.radius(mark.rod), top[mark.unit], text)
        else:
            corner = (everywhere @ right).max() * right + (everywhere @ above).max() * above
            corner = corner + (everywhere @ to_camera).mean() * to_camera
            symbols.everywhere(mark, corner + 1.5 * size * (right - above), type(load).__name__)
    return symbols


def sign_size(span, count):
    """The size of a sign, m, in a drawing of extents `span` (3,), m, with `count` signs."""
    return _SIZE * float(span.max()) * max(_SMALLEST, min(1.0, (_MANY / max(count, 1)) ** 0.5))


def span_of(scene, shapes, everywhere):
    """(3,) the extents that decide on the view: of the points; the largest for all axes where the points lie in a
    plane, but forces or the normal of a roller do not. The arguments are those of `signs_of`."""
    span = np.ptp(everywhere, axis=0)
    normal = np.abs(view_of(span)[0])
    supports = marks_of_supports(shapes[-1].supports(scene))
    for mark in (*supports, *(mark for _, mark, _ in _acting(scene, shapes))):
        if mark.vector is not None and mark.kind in ("force", "line force", "roller", "spring") and normal.max() == 1.0:
            vectors = np.atleast_2d(mark.vector)
            if (np.abs(vectors @ normal) > _OUT_OF_PLANE * np.linalg.norm(vectors, axis=1).max()).any():
                return np.full(3, span.max())
    return span


def without_sign(scene, tubes, threads=True):
    """Words for the loads that are not drawn; tubes, threads: whether obstacles around rods, and threads, are."""
    corner = np.zeros(3)

    def drawn(load):
        shaped = tubes and (load.tube() is not None or load.drawn(corner, corner + 1) is not None)
        return shaped or load.rods_touch or (threads and load.is_thread) or has_sign(load, scene)

    kinds = {}
    for load in scene.all_loads:
        if not drawn(load):
            kinds.setdefault(type(load).__name__, []).append(load)
    return ", ".join(describe(same[0]) if len(same) == 1 else f"{len(same)} {name}s" for name, same in kinds.items())


def _acting(scene, shapes):
    """(load, mark, shape) of everything that acts, on the last shape where it does."""
    found = []
    for load in scene.all_loads:
        for shape in reversed(shapes):
            marks = loads_of(load, scene, shape.share(load), shape.time)
            if marks:
                found += [(load, mark, shape) for mark in marks]
                break
    return found


def _words(load, mark, shape):
    """The size of a load, "up to" the largest where it changes along the rod or, unless a time is shown, with time."""
    if not mark.unit:
        return ""
    sizes = np.linalg.norm(np.atleast_2d(mark.vector), axis=1)
    changes = np.ptp(sizes) > 1e-6 * sizes.max() or (shape.time is None and bool(signals_of(load)))
    return f"{'up to ' if changes else ''}{quantity(sizes.max(), mark.unit)}{' (follows)' if mark.turns else ''}"


# Most joints that are drawn where they are rigid.
_MANY_JOINTS = 40
# Samples along a rod of a load on it.
_SAMPLES = 33
_POINT_LOADS = {"N": "force", "N m": "moment"}
_LINE_LOADS = {"N/m": "line force", "N m/m": "line moment"}
_DEVICES = {"N/m": "spring", "N m/rad": "turning spring", "N s/m": "dashpot", "N m s/rad": "dashpot"}


@dataclass(frozen=True)
class Mark:
    """A support, a joint or a load to be drawn, at a station, or along a rod (None of a load on all rods).

    kind: "clamp", "pin", "hinge", "roller", "moved"; "force", "moment", "spring", "turning spring", "dashpot", "mass";
    "line force", "line moment"; "joint", "hinge joint", "ball joint". vector, in a unit: force or moment, or along a
    rod (n, 3) of them at even arc lengths; the axis of a hinge, the normal of a roller, the direction of a spring;
    inertial, in the reference. turns: whether it turns with the section; arm: from the station to where a force acts,
    which turns with the section, in the reference, m.
    """

    kind: str
    station: object = None
    rod: object = None
    vector: np.ndarray = None
    unit: str = ""
    turns: bool = False
    arm: np.ndarray = None


def marks_of_supports(supports):
    """The `Mark`s of supports."""
    return [_support(support) for support in supports]


def _support(support):
    if support.clamps:
        return Mark("clamp", support.station)
    if isinstance(support, Prescribed):
        moved = at(support, 0.0).displacement
        return Mark("moved", support.station, vector=None if moved is None else np.array(moved, dtype=float))
    if isinstance(support, Hinge):
        return Mark("hinge", support.station, vector=np.array(support.axis))
    if isinstance(support, Roller):
        return Mark("roller", support.station, vector=np.array(support.normal))
    return Mark("pin", support.station)


def joints_of(scene):
    """The `Mark`s of the joints; of a frame with many, of those alone that are not rigid."""
    many = len(scene.joints) > _MANY_JOINTS
    return [
        Mark("joint", joint.first) if joint.rigid
        else Mark("ball joint", joint.first) if joint.release == "all"
        else Mark("hinge joint", joint.first, vector=np.array(joint.release))
        for joint in scene.joints if not (joint.rigid and many)
    ]  # fmt: skip


def loads_of(load, scene, factor, time=None):
    """The `Mark`s of a load or another action, times a factor; none where it is zero, or where drawings know no sign
    for it; time: s; None for the time at which a load that depends on time is largest."""
    times = sample_times(load, scene.horizon) if time is None and signals_of(load) else [time or 0.0]
    found = max((marks_of(at(load, t), scene, factor) for t in times), key=_size)
    return [mark for mark in found if mark.kind in _DEVICES.values() or mark.kind == "mass" or _size([mark]) > 0]


def _size(marks):
    return max((float(np.abs(mark.vector).max()) for mark in marks if mark.unit), default=0.0)


def marks_of(load, scene, factor):
    """The `Mark`s of a load or another action that does not depend on time, times a factor, also where it is zero."""
    if load.tube() is not None:  # drawn as a tube; its stiffness is no spring
        return []
    if load.station is not None:
        return _at_station(load, load.station, factor)
    rods = [rod for rod in scene.rods if load.acts_on(rod)]
    if load.rod is None:
        return _along(load, rods[0], factor, None)[:1] if rods else []
    return _along(load, load.rod, factor, load.rod)


def _at_station(load, station, factor):
    data = [(x.unit, np.reshape(x.value, (-1, x.size))[0]) for x in load.data(station.rod, np.array([station.s]))]
    found = {unit: value for unit, value in data}
    arm, direction = found.get("m"), found.get("1")
    marks = [
        Mark(_POINT_LOADS[unit], station, vector=factor * value, unit=unit, turns=load.follows,
             arm=arm if unit == "N" and arm is not None and len(arm) == 3 else None)
        for unit, value in data if unit in _POINT_LOADS and len(value) == 3
    ]  # fmt: skip
    devices = [_DEVICES[unit] for unit, value in data if unit in _DEVICES and len(value) == 1 and value[0] > 0]
    if devices:
        marks.append(Mark(devices[0], station, vector=direction))
    if load.inertia(station.rod) is not None:
        marks.append(Mark("mass", station))
    return marks


def _along(load, rod, factor, drawn_on):
    s = np.linspace(0, rod.length, _SAMPLES)
    return [
        Mark(_LINE_LOADS[x.unit], rod=drawn_on, vector=factor * np.broadcast_to(x.value, (_SAMPLES, 3)), unit=x.unit)
        for x in load.data(rod, s)
        if x.unit in _LINE_LOADS and x.size == 3
    ]


def has_sign(load, scene):
    """Whether drawings have a sign for a load, whatever its size."""
    return bool(marks_of(at(load, 0.0), scene, 1.0))
