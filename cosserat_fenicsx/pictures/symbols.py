"""Signs for supports, joints and loads, of a size that suits the drawing."""

import itertools
from collections import Counter, defaultdict
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.pictures.drawing import girth
from cosserat_fenicsx.pictures.view import view_of

COLOURS = {
    "supports": "#4d5b6b",
    "moved supports": "#8a5fb0",
    "released joints": "#f2b705",
    "joints": "#333333",
    "forces": "#d62728",
    "moments": "#e8710a",
    "springs": "#1f77b4",
    "masses": "#222222",
    "tendons": "#e0218a",
}
GROUPS = {
    "clamp": "supports", "pin": "supports", "hinge": "supports", "roller": "supports", "moved": "moved supports",
    "joint": "joints", "hinge joint": "released joints", "ball joint": "released joints", "force": "forces",
    "line force": "forces", "moment": "moments", "line moment": "moments", "spring": "springs",
    "turning spring": "springs", "dashpot": "springs", "mass": "masses",
}  # fmt: skip
# Moments whose axis has a smaller cosine with the view direction are drawn as double-headed arrows.
_ASIDE = 0.4
# Arrows along a rod: spacing over the size of a sign, and maximum number.
_SPACING, _MOST = 1.3, 16
# Maximum number of loads that have a label each.
_MOST_TEXTS = 8
# Lengths over the size of a sign: of an arrow, of the shortest one beside others, of those along rods; of a spring.
_ARROW, _SHORTEST, _COMB, _SPRING = 1.9, 0.9, 1.0, 1.6


@dataclass(frozen=True)
class Pose:
    """Where a section is: position (3,) m, directors (3, 3), rotation from the reference (3, 3), the direction from an
    end into the rod (3,) (None elsewhere), and the radius that the rod is drawn with, m."""

    place: np.ndarray
    directors: np.ndarray
    rotation: np.ndarray
    inwards: np.ndarray
    radius: float


class Symbols:
    """The signs of a drawing; span: (3,) the extents that decide on the view, see `view.view_of`; size: of a sign, m;
    lines: centrelines of rods (n, 3), m, which arrows keep off as they do of each other. covers: lines (n, 3), m, over
    what the signs cover; texts: (text, point, direction, colour) of the labels of the loads."""

    def __init__(self, pyvista, span, size, lines):
        self._pyvista, self._size, self.texts, self.covers = pyvista, size, [], []
        self.span, (self._view, self._right, self._up, self._vertical) = span, view_of(span)
        self._taken = [self._flat(np.concatenate(lines))]
        self._meshes, self._lines = defaultdict(list), defaultdict(list)

    @property
    def points(self):
        """(n, 3) points of all signs, m."""
        every = [mesh.points for meshes in (self._meshes, self._lines) for group in meshes.values() for mesh in group]
        return np.concatenate(every) if every else np.empty((0, 3))

    @property
    def groups(self):
        """{words: colour} of the signs that there are."""
        used = {*self._meshes, *self._lines}
        return {words: colour for words, colour in COLOURS.items() if words in used}

    def grouped_texts(self):
        """The texts that are not empty; where there are many, those that are alike only once, with their number."""
        texts = [text for text in self.texts if text[0]]
        if len(texts) <= _MOST_TEXTS:
            return texts
        alike = Counter((text, colour) for text, *_, colour in texts)
        first = {(text[0], text[3]): text for text in reversed(texts)}
        return [(f"{text} (each of {alike[text, colour]})" if alike[text, colour] > 1 else text, *place, colour)
                for (text, colour), (_, *place, _) in first.items()]  # fmt: skip

    def draw(self, plotter):
        """Put all signs into the drawing."""
        solid, thin = {"ambient": 0.45, "smooth_shading": False}, {"line_width": 4}
        for drawn, look in ((self._meshes, solid), (self._lines, thin)):
            for words, meshes in drawn.items():
                joined = self._pyvista.merge(meshes) if len(meshes) > 1 else meshes[0]
                plotter.add_mesh(joined, color=COLOURS[words], **look)

    # -- supports and joints -----------------------------------------------------------------------------------------

    def support(self, mark, pose, text=""):
        """A plate for a clamp, a cone for a pin, a cone with the axis for a hinge, a cone on balls for a roller; with
        an arrow for a prescribed displacement. text: the label of that arrow; without one it is not drawn."""
        a = self._size
        if mark.kind in ("clamp", "moved"):
            across = max(1.2 * a, 2.6 * pose.radius)
            out = np.zeros(3) if pose.inwards is None else -pose.inwards
            self._add(mark, self._box(pose.place + 0.17 * a * out, pose.directors, (across, across, 0.34 * a)))
            if text:
                along = mark.vector / np.linalg.norm(mark.vector)
                away = self._placed(mark, pose.place, along, _ARROW * a, pose.radius + 0.2 * a, True)
                self.texts.append((text, *away, COLOURS[GROUPS[mark.kind]]))
            return
        down = self._below(mark, pose)
        leaves = pose.inwards is not None and down @ pose.inwards < -1e-6  # beyond the end there is no rod
        radius = pose.radius * girth(mark.station)
        height, top = 0.75 * a, pose.place + (0.0 if leaves else 0.7) * radius * down
        self._cone(mark, top, -down, height, 0.42 * a)
        foot = top + height * down
        if mark.kind == "hinge":
            self._cylinder(mark, pose.place, mark.vector, max(a, 4 * radius), 1.5 * radius + 0.08 * a)
        if mark.kind == "roller":
            across = self._across(down)
            for side in (-0.25, 0.25):
                self._ball(mark, foot + 0.12 * a * down + side * a * across, 0.12 * a)
            foot = foot + 0.24 * a * down
        frame = _frame_along(down)
        self._add(mark, self._box(foot + 0.05 * a * down, frame, (1.1 * a, 1.1 * a, 0.1 * a)))

    def joint(self, mark, pose):
        """A dark ball for a rigid joint, a light one for a released one, with the axis of a hinge."""
        radius = pose.radius * girth(mark.station)
        self._ball(mark, pose.place, (1.25 if mark.kind == "joint" else 1.7) * radius)
        if mark.kind == "hinge joint":
            axis = pose.rotation @ mark.vector
            self._cylinder(mark, pose.place, axis, max(0.9 * self._size, 5 * radius), 0.9 * radius)

    # -- loads -------------------------------------------------------------------------------------------------------

    def load(self, mark, pose, share, text):
        """An arrow for a force, an arrow around the axis or a double-headed one for a moment, a zigzag for a spring;
        share: the size of the load over the largest of its kind; text: its label."""
        if mark.kind in ("force", "moment"):
            vector = pose.rotation @ mark.vector if mark.turns else mark.vector
            along, length = vector / np.linalg.norm(vector), self._size * max(_SHORTEST, _ARROW * np.sqrt(share))
            point = pose.place
            if mark.arm is not None:
                point = pose.place + pose.rotation @ mark.arm
                self._line(mark, np.array([pose.place, point]))
            force = mark.kind == "force"
            away = self._force(mark, pose, point, along, length) if force else self._moment(mark, pose, along)
            self.texts.append((text, *away, COLOURS[GROUPS[mark.kind]]))
        elif mark.kind == "mass":
            self._ball(mark, pose.place, max(0.3 * self._size, 2 * pose.radius))
        else:
            self._device(mark, pose)

    def _force(self, mark, pose, point, along, length):
        """An arrow that pushes towards the rod from outside, or pulls away from it."""
        gap = pose.radius if mark.arm is None else 0.0
        pulls = pose.inwards is not None and along @ pose.inwards < -0.3
        return self._placed(mark, point, along, length, gap, pulls)

    def _placed(self, mark, point, along, length, gap, pulls):
        """Draw an arrow where nothing else is; returns the place of its label, and the direction from there."""
        aside = np.cross(self._view, along)
        for side, pulling in itertools.product((0.0, 1.0, -1.0), (pulls, not pulls)):
            start = point + side * (gap + 0.35 * self._size) * aside
            start = start + gap * along if pulling else start - (length + gap) * along
            if self._free(start, along, length, gap):
                break
        else:
            start, pulling = point - (length + gap) * along, False
        self._arrow(mark, start, along, length)
        return (start + length * along, along) if pulling else (start, -along)

    def _free(self, start, along, length, gap):
        """Whether an arrow lies off all rods and other arrows, in the picture."""
        shaft = self._flat(start + np.outer(np.linspace(0.1, 0.75, 8) * length, along))
        away = np.linalg.norm(shaft[:, None] - np.concatenate(self._taken), axis=2).min()
        return away > max(gap, 0.12 * self._size)

    def _flat(self, points):
        """(n, 2) places of points in the picture, m."""
        return np.column_stack([points @ self._right, points @ self._up])

    def _moment(self, mark, pose, axis):
        a = self._size
        if abs(axis @ self._view) < _ASIDE:
            pulls = pose.inwards is not None and axis @ pose.inwards < -0.3
            return self._placed(mark, pose.place, axis, 2.2 * a, pose.radius, pulls)
        one = np.cross(axis, self._right)
        one = one / np.linalg.norm(one) if np.linalg.norm(one) > 0.1 else _frame_along(axis)[:, 0]
        other, radius = np.cross(axis, one), max(0.95 * a, 2.2 * pose.radius)
        angles = np.linspace(0.25 * np.pi, 1.75 * np.pi, 41)
        ring = pose.place + radius * (np.outer(np.cos(angles), one) + np.outer(np.sin(angles), other))
        self._line(mark, ring)
        ahead = (ring[-1] - ring[-2]) / np.linalg.norm(ring[-1] - ring[-2])
        self._cone(mark, ring[-1] + 0.3 * a * ahead, ahead, 0.45 * a, 0.17 * a)
        return ring[0], ring[0] - pose.place

    def _device(self, mark, pose):
        """A zigzag of a spring, a spiral of one against rotations, a piston of a dashpot, and the ground at its end."""
        a, down = self._size, self._below(mark, pose)
        if mark.kind == "turning spring":
            angles = np.linspace(0, 5 * np.pi, 80)[:, None]
            spiral = pose.place + (pose.radius + 0.05 * a * angles) * (
                np.cos(angles) * self._right + np.sin(angles) * self._up
            )
            self._line(mark, spiral)
            return
        x = np.array([0, 0.25, 0.32, 0.45, 0.58, 0.71, 0.78, 1.0])
        if mark.kind == "dashpot":
            self._cylinder(mark, pose.place + 0.6 * _SPRING * a * down, down, 0.5 * _SPRING * a, 0.22 * a)
            y = np.zeros(len(x))
        else:
            y = np.array([0, 0, 1, -1, 1, -1, 0, 0])
        self._line(mark, pose.place + _SPRING * a * x[:, None] * down + 0.25 * a * y[:, None] * self._across(down))
        self._add(mark, self._box(pose.place + (_SPRING + 0.05) * a * down, _frame_along(down), (a, a, 0.1 * a)))

    def along(self, mark, line, radius, top, text):
        """A row of arrows of a load along a rod, of lengths by `top`; line: (n, 3), m; radius: that is drawn, m."""
        way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
        count = arrows_along(way[-1], self._size)
        places, x = np.linspace(0, way[-1], count), np.linspace(0, way[-1], len(mark.vector))
        feet = np.column_stack([np.interp(places, way, column) for column in line.T])
        vectors = np.column_stack([np.interp(places, x, column) for column in mark.vector.T]) / top
        tails, tangents = [], np.gradient(feet, axis=0)
        for foot, vector, tangent in zip(feet, vectors, tangents, strict=True):
            share = np.linalg.norm(vector)
            if share < 0.02:
                continue
            along, length = vector / share, self._size * _COMB * max(share, 0.35)
            back = (length + radius) * along
            if abs(along @ tangent) > 0.8 * np.linalg.norm(tangent):  # beside the rod
                back = length / 2 * along - (radius + 0.3 * self._size) * np.cross(self._view, along)
            tails.append(foot - back)
            self._arrow(mark, tails[-1], along, length, slender=0.6, double=mark.kind == "line moment")
        if len(tails) > 1 and mark.kind == "line force":
            self._line(mark, np.array(tails))
        if tails:
            middle = len(tails) // 2
            self.texts.append((text, tails[middle], tails[middle] - feet[middle], COLOURS[GROUPS[mark.kind]]))

    def thread(self, points):
        """A thread along a rod through points (n, 3), m."""
        self.covers.append(points)
        self._lines["tendons"].append(self._pyvista.lines_from_points(points))

    def everywhere(self, mark, corner, text):
        """One arrow, beside the rods, for a load that acts on all of them."""
        along = mark.vector[0] / np.linalg.norm(mark.vector[0])
        self._arrow(mark, corner - 0.5 * _ARROW * self._size * along, along, _ARROW * self._size)
        self.texts.append((text, corner, np.cross(self._view, along), COLOURS["forces"]))

    # -- parts -------------------------------------------------------------------------------------------------------

    def _arrow(self, mark, start, along, length, slender=1.0, double=False):
        a, tip = self._size, start + length * along
        head = min(0.5 * a * slender**0.5, 0.6 * length)
        self.covers.append(np.array([start, tip]))
        self._taken.append(self._flat(np.linspace(start, tip, 12)))
        double = double or mark.kind == "moment"
        self._cylinder(mark, (start + tip - head * along) / 2, along, length - head, 0.06 * a * slender)
        for back in (0.0, 0.8 * head) if double else (0.0,):
            self._cone(mark, tip - back * along, along, head, 0.17 * a * slender)

    def _cone(self, mark, tip, along, height, radius):
        """A cone with its tip at a point, pointing along a unit vector."""
        made = self._pyvista.Cone(
            center=tip - height / 2 * along, direction=along, height=height, radius=radius, resolution=24
        )
        self._add(mark, made)

    def _cylinder(self, mark, centre, along, height, radius):
        made = self._pyvista.Cylinder(center=centre, direction=along, height=height, radius=radius, resolution=24)
        self._add(mark, made)

    def _ball(self, mark, centre, radius):
        self._add(mark, self._pyvista.Sphere(center=centre, radius=radius))

    def _box(self, centre, frame, sizes):
        corners = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5], indexing="ij")).reshape(3, -1).T * sizes
        faces = [4, 0, 1, 3, 2, 4, 4, 6, 7, 5, 4, 0, 4, 5, 1, 4, 2, 3, 7, 6, 4, 0, 2, 6, 4, 4, 1, 5, 7, 3]
        return self._pyvista.PolyData(centre + corners @ frame.T, faces)

    def _below(self, mark, pose):
        """The direction from the rod to the ground: downwards, or off the rod's end."""
        if mark.vector is not None and mark.kind in ("roller", "spring", "dashpot"):
            return -mark.vector if mark.vector @ (self._vertical + 0.01 * self._right) > 0 else np.asarray(mark.vector)
        if pose.inwards is not None and pose.inwards @ -self._vertical > 0.7:
            return self._vertical
        if pose.inwards is None and abs(pose.directors[:, 2] @ self._vertical) > 0.7:
            return self._right
        return -self._vertical

    def _across(self, down):
        """A unit vector across a direction, in the plane of the picture; to the right where it is seen end on."""
        across = np.cross(down, self._view)
        size = np.linalg.norm(across)
        return across / size if size > 0.1 else self._right

    def _line(self, mark, points):
        self.covers.append(points)
        self._lines[GROUPS[mark.kind]].append(self._pyvista.lines_from_points(points))

    def _add(self, mark, mesh):
        mesh.clear_data()
        self.covers.append(mesh.points)
        self._meshes[GROUPS[mark.kind]].append(mesh)


def arrows_along(length, size):
    """How many arrows a load along a rod of some length has; size: of a sign, m."""
    return int(np.clip(round(length / (_SPACING * size)), 3, _MOST))


def _frame_along(axis):
    """(3, 3) an orthonormal frame whose third column is a unit vector."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
