"""The signs of a scene's supports, joints and loads on its rods at rest, or on those of a path or a motion."""

import numpy as np

from cosserat_fenicsx.pictures.drawing import quantity
from cosserat_fenicsx.pictures.marks import has_sign, joints_of, loads_of, supports_of
from cosserat_fenicsx.pictures.symbols import Pose, Symbols
from cosserat_fenicsx.pictures.view import view_of
from cosserat_fenicsx.scene.describe import describe
from cosserat_fenicsx.scene.signals import signals_of

# Size of a sign over the extent of the drawing; from this number of signs on they are smaller, at least by this share.
_SIZE, _MANY, _SMALLEST = 0.048, 12, 0.5
# A plane scene is seen from a corner where a force has this share normal to the plane.
_OUT_OF_PLANE = 0.1


class Resting:
    """The rods of a scene at rest, with its loads at load factor 1, and at their largest if they depend on time.

    Args:
        radii: {rod: the radius that it is drawn with, m}.
    """

    factor, time = 1.0, None

    def __init__(self, radii):
        self._radii = radii

    def line(self, rod):
        """(n, 3) the centreline of a rod, m."""
        return rod.curve.position(np.linspace(0, rod.length, 101))

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
    """The rods at point k of a path or a motion, their displacements magnified."""

    def __init__(self, result, k, radii, magnify):
        super().__init__(radii)
        self._result, self._k, self._magnify = result, k, magnify
        timed = result.axis == "time"
        self.factor, self.time = (1.0, result.along_axis[k]) if timed else (result.along_axis[k], 0.0)

    def line(self, rod):
        """See `Resting`."""
        return self._moved(rod, np.linspace(0, 1, 101))[0]

    def pose(self, station):
        """See `Resting`."""
        places, directors = self._moved(station.rod, np.array([station.s / station.rod.length]))
        return self._pose(station, places[0], directors[0])

    def _moved(self, rod, x):
        places, directors = self._result.sample(self._k, rod, x)
        reference = rod.curve.position(x * rod.length)
        return reference + self._magnify * (places - reference), directors


def signs_of(pyvista, scene, shapes, everywhere):
    """The `Symbols` of a scene.

    Supports and joints are drawn on the last of the shapes, each load on the last one where it is not zero.

    Args:
        shapes: `Resting` or `Deformed`s.
        everywhere: all points of the drawing (n, 3), m.
    """
    last, supports, loads = shapes[-1], supports_of(scene), _acting(scene, shapes)
    span = _span(everywhere, [*supports, *(mark for _, mark, _ in loads)])
    to_camera, right, above, _ = view_of(span)
    count = len(supports) + sum(mark.station is not None for _, mark, _ in loads)
    size = _SIZE * float(span.max()) * max(_SMALLEST, min(1.0, (_MANY / max(count, 1)) ** 0.5))
    symbols = Symbols(pyvista, span, size, [shape.line(rod) for shape in shapes for rod in scene.rods])
    for mark in supports:
        symbols.support(mark, last.pose(mark.station))
    for mark in joints_of(scene):
        symbols.joint(mark, last.pose(mark.station))
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


def _span(everywhere, marks):
    """(3,) the extents that decide on the view: those of the points; the largest for all axes where the points lie in a
    plane, but forces do not, or the normal of a roller."""
    span = np.ptp(everywhere, axis=0)
    normal = np.abs(view_of(span)[0])
    for mark in marks:
        if mark.vector is not None and mark.kind in ("force", "line force", "roller", "spring") and normal.max() == 1.0:
            vectors = np.atleast_2d(mark.vector)
            if (np.abs(vectors @ normal) > _OUT_OF_PLANE * np.linalg.norm(vectors, axis=1).max()).any():
                return np.full(3, span.max())
    return span


def without_sign(scene, tubes):
    """Words for the loads that are not drawn; tubes: whether tubes around rods are."""
    left_out = [load for load in scene.loads if not has_sign(load, scene) and not (tubes and load.tube() is not None)]
    return ", ".join(dict.fromkeys(map(describe, left_out)))


def _acting(scene, shapes):
    """(load, mark, shape) of everything that acts, on the last shape where it does."""
    found = []
    for load in scene.loads:
        for shape in reversed(shapes):
            marks = loads_of(load, scene, shape.factor, shape.time)
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
