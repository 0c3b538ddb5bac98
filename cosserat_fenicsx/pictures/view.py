"""The layout of a drawing: its camera, a parallel projection; texts that neither overlap each other nor leave the
picture; axes with round limits and ticks in a suitable unit of length."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.pictures.charts import chosen_unit

# Shares of the picture's width to the left (vertical axis) and to the right (colour bar) of the drawing, and of its
# height below (horizontal axes) and above (title).
_WHOLE = (0.19, 0.21, 0.17, 0.17)
# Height below a drawing with a title of its own, over the width, which letters are in proportion to.
_BELOW = 0.12
# Likewise for one of several drawings side by side, without a colour bar.
_PANEL = (0.24, 0.07, 0.22, 0.24)


def view_of(span):
    """Unit vectors (3,): to the camera, to the right and upwards in the picture; and the upward direction in space, for
    a drawing whose extents along x, y and z are `span` (3,): a plane scene is seen along its normal, others from a
    corner."""
    thin = int(np.argmin(span))
    if span[thin] < 0.05 * span.max():
        view = np.zeros(3)
        view[thin] = -1.0 if thin == 1 else 1.0
        up = np.array([0.0, 0.0, 1.0]) if thin != 2 else np.array([0.0, 1.0, 0.0])
    else:
        view, up = np.array([1.0, -1.6, 0.8]), np.array([0.0, 0.0, 1.0])
    view = view / np.linalg.norm(view)
    right = np.cross(up, view)
    right /= np.linalg.norm(right)
    return view, right, np.cross(view, right), up


# Share of a displacement normal to a plane from which on what lies in the plane is seen from a corner; displacements
# over the extents that are none.
_LEAVES, _STILL = 0.1, 1e-9


def seen_moving(span, moved):
    """The extents that decide on the view of what has the extents `span` (3,): the largest one for all axes where it
    lies in a plane that its displacements (..., 3) leave."""
    normal, size = np.abs(view_of(span)[0]), np.linalg.norm(moved, axis=-1).max()
    leaves = size > _STILL * span.max() and (np.abs(moved) @ normal).max() > _LEAVES * size
    return np.full(3, span.max()) if normal.max() == 1.0 and leaves else span


@dataclass(frozen=True)
class View:
    """A parallel projection; to_camera, right, above: unit vectors (3,), inertial; up: the upward direction in space;
    focus: the point in the middle of the picture, m; half: half the height of the picture, m; window: (width, height),
    pixels."""

    to_camera: np.ndarray
    right: np.ndarray
    above: np.ndarray
    up: np.ndarray
    focus: np.ndarray
    half: float
    window: tuple

    @classmethod
    def of(cls, points, span, window, panel=False, title=None):
        """The view that shows all points (n, 3), m; span: see `view_of`; window: (width, height), pixels; panel:
        whether it is one of several drawings side by side; title: the height kept free for it, pixels; None for a share
        of the window's."""
        before, after, below, over = _PANEL if panel else _WHOLE
        if title is not None:
            below, over = _BELOW * window[0] / window[1], title / window[1]
        wide, tall, left, upwards = 1 - before - after, 1 - below - over, after - before, over - below
        to_camera, right, above, up = view_of(span)
        across, high = points @ right, points @ above
        width, height = np.ptp(across), np.ptp(high)
        aspect = window[0] / window[1]
        half = max(height / tall, width / (wide * aspect)) / 2
        centre = (across.max() + across.min()) / 2 * right + (high.max() + high.min()) / 2 * above
        focus = centre + half * (left * aspect * right + upwards * above)
        # at the depth of the points, which the clipping of the camera needs
        focus = focus + (points @ to_camera).mean() * to_camera
        return cls(to_camera, right, above, up, focus, half, tuple(window))

    @staticmethod
    def height(points, span, width, title):
        """The height of a window of some width, pixels, which a drawing fills as `of` places it with a title."""
        (before, after, _, _), (_, right, above, _) = _WHOLE, view_of(span)
        aspect = np.ptp(points @ above) / max(np.ptp(points @ right), 1e-300)
        return title + width * (_BELOW + (1 - before - after) * aspect)

    @property
    def pixel(self):
        """The size of a pixel, m."""
        return 2 * self.half / self.window[1]

    def pixels(self, points):
        """(..., 2) where points (..., 3), m, are in the picture, from its lower left corner."""
        away = np.asarray(points) - self.focus
        return np.stack([away @ self.right, away @ self.above], axis=-1) / self.pixel + np.array(self.window) / 2

    def offset(self, dx, dy):
        """(3,) the vector of dx pixels to the right and dy upwards, m."""
        return self.pixel * (dx * self.right + dy * self.above)

    def place(self, plotter):
        """Place the plotter's camera."""
        plotter.enable_parallel_projection()
        plotter.camera.focal_point = tuple(self.focus)
        plotter.camera.position = tuple(self.focus + 8 * self.half * self.to_camera)
        plotter.camera.up = tuple(self.up)
        plotter.camera.parallel_scale = self.half
        plotter.reset_camera_clipping_range()


# Widths of letters, at least those that VTK draws, and height of a line over the size of a font; pixels between labels,
# and to the edge of the picture.
_LETTERS = {**dict.fromkeys(" .,:;'|-/IJijl", 0.34), **dict.fromkeys("tfr!()[]", 0.41), **dict.fromkeys("mwMW@%", 0.99)}
_LETTER, _CAPITAL, _LINE, _GAP, _EDGE = 0.63, 0.78, 1.15, 5, 4
# Distance of numbers of two axes over the size of letters.
_ASUNDER = 0.6
# Distances (pixels) of a label from its point, and turns (deg) of its direction, in the order of preference; distance
# from which on a thin line leads back.
_DISTANCES, _LEADER = (16, 26, 42, 64, 92, 128, 180, 250, 340, 460), 40
_TURNS = (0, *(sign * turn for turn in range(20, 180, 20) for sign in (1, -1)), 180)
# Pixels between a label and the middle of a rod; size of the cells in which lines are looked up, pixels; how much more
# a label should keep off rods than off other lines.
_CLEAR, _CELL, _RODS = 10, 4, 4


class Labels:
    """The labels of a drawing in a `View`; `draw` puts all of them into it; lines: (n, 3), m, such as rods and arrows,
    that labels keep off where possible, more than off others."""

    def __init__(self, view, lines=()):
        self._view, self._placed, self._texts, self._leaders, self._ends = view, [], [], [], []
        self._reserved = []
        self._covered = _RODS * self._cells(lines)
        #: texts for which there was no room
        self.left_out = []

    def fix(self, text, places, *, size, colour="black"):
        """A label at the first of some places [(point (3,), m, pixels (2,) to its middle)] where no other is."""
        for point, away in places:
            box = _box(text, self._view.pixels(point) + away, size)
            if self._free(box):
                self._keep(text, point, box, size, colour)
                return

    def _cells(self, lines):
        return _cells_of([self._view.pixels(_dense(line)) for line in lines], self._view.window)

    def keep_off(self, lines):
        """Keep labels that come later off these lines (n, 3), m, too, where possible."""
        self._covered = np.maximum(self._covered, self._cells(lines))

    def part(self, ends):
        """Let labels, and lines to their points, cross the line between two points (2, 3), m, as little as possible."""
        self._leaders.append(tuple(self._view.pixels(ends)))

    def reserve(self, low, high):
        """Keep a rectangle free of labels: its lower left and upper right corners, pixels."""
        self._reserved.append((*low, *high))
        self._placed.append((*low, *high))

    def near(self, text, point, towards, *, size, colour="black"):
        """A label near a point (3,), m, in the direction `towards` (3,) if there is room (returned), else in another
        one; where its line crosses those of other labels and these labels least and it covers no rod, and then where it
        covers least."""
        anchor, wish = self._view.pixels(point), np.array([towards @ self._view.right, towards @ self._view.above])
        wish = wish / np.linalg.norm(wish) if np.linalg.norm(wish) > 1e-6 else np.array([0.0, 1.0])
        half = np.array([_width(text), _LINE]) * size / 2
        best, least = None, (np.inf, 0)
        for distance, turn in itertools.product(_DISTANCES, np.deg2rad(_TURNS)):
            cos, sin = np.cos(turn), np.sin(turn)
            way = np.array([cos * wish[0] - sin * wish[1], sin * wish[0] + cos * wish[1]])
            # the label's edge is at the distance, its corner in directions between
            box = _box(text, anchor + distance * way + half * np.clip(1.5 * way, -1, 1), size)
            if self._free(box) and (covered := self._covers(box)) < least:
                line = anchor, anchor + (distance - _GAP) * way
                costs = self._crosses(line, box) + covered[0], covered[1] + self._along(line)
                if costs < least:
                    best, least = (box, distance, line), costs
                if costs == (0, 0):
                    break
        if best is None:
            self.left_out.append(text)
            return False
        box, distance, (start, end) = best
        self._keep(text, point, box, size, colour)
        self._leaders.append((start, end))
        if distance > _LEADER:
            self._ends += [point, point + self._view.offset(*(end - start))]
        return True

    def evenly(self, texts, *, size, away):
        """Labels [(text, point (3,), m)] of every n-th tick of an axis, as many as have room, not so near to one of
        another axis that both read as one, if two can be; away: as of `fix`."""
        boxes, best = [_box(text, self._view.pixels(point) + away, size) for text, point in texts], []
        for spare in (_ASUNDER * size, 0.0):
            for n, first in ((n, first) for n in range(1, len(texts) + 1) for first in range(n)):
                some = range(first, len(texts), n)
                apart = not any(_overlap(boxes[i], boxes[j]) for i, j in itertools.pairwise(some))
                kept = [i for i in some if self._free(boxes[i], spare)] if apart else []
                best = max(best, kept, key=len)  # the first of equal ones
            if len(best) > 1:
                break
        for i in best:
            self._keep(*texts[i], boxes[i], size, "black")

    @property
    def boxes(self):
        """The rectangles of labels and reserved areas: (left, bottom, right, top), pixels."""
        return list(self._placed)

    def draw(self, plotter, pyvista):
        """Put all labels into the drawing."""
        if self._ends:
            ends = np.array(self._ends) + self._view.half * self._view.to_camera  # in front of the rods
            plotter.add_mesh(pyvista.line_segments_from_points(ends), color="grey", line_width=2)
            plotter.reset_camera_clipping_range()
        # one by one: of labels that are added together VTK leaves out those near others, by rules of its own
        for text, point, size, colour in self._texts:
            plotter.add_point_labels(
                [point], [plain(text)], font_size=size, text_color=colour, shape=None, show_points=False,
                always_visible=True, bold=False, justification_horizontal="center", justification_vertical="center",
                render=False,
            )  # fmt: skip

    def _keep(self, text, point, box, size, colour):
        self._placed.append(box)
        away = np.array([box[0] + box[2], box[1] + box[3]]) / 2 - self._view.pixels(point)
        self._texts.append((text, point + self._view.offset(*away), size, colour))

    def _free(self, box, spare=0.0):
        """Whether a rectangle lies in the picture and overlaps no reserved area and, wider by `spare`, no label."""
        low, high = np.array(box[:2]), np.array(box[2:])
        if (low < _EDGE).any() or (high > np.array(self._view.window) - _EDGE).any():
            return False
        wide = box[0] - spare, box[1], box[2] + spare, box[3]
        return not any(_overlap(box if other in self._reserved else wide, other) for other in self._placed)

    def _crosses(self, line, box):
        """How many labels and lines from labels to their points a label in a rectangle, with its line, would cross."""
        wide = box[0] - _GAP, box[1] - _GAP, box[2] + _GAP, box[3] + _GAP
        lines, boxes = np.reshape(self._leaders, (-1, 2, 2)), np.reshape(self._placed, (-1, 4))
        found = _crosses_boxes(lines, np.array(wide)) | _cross(np.array(line), lines)
        return int(found.sum() + _crosses_boxes(np.array(line), boxes).sum())

    def _along(self, line):
        """How many cells of lines that are no rods a line from a label to its point, (2, 2) pixels, crosses."""
        start, end = line
        cells = np.linspace(start, end, 2 + int(np.linalg.norm(end - start) / _CELL)) // _CELL
        i, j = np.clip(cells.astype(int), 0, np.array(self._covered.shape) - 1).T
        crossed = self._covered[i, j]
        return int(((crossed > 0) & (crossed < _RODS)).sum())

    def _covers(self, box):
        """How much a rectangle covers: 1 where a rod is, else 0; and cells of lines, of rods `_RODS` times as many."""
        low = np.maximum(np.array(box[:2]) - _CLEAR, 0) // _CELL
        high = np.maximum(np.array(box[2:]) + _CLEAR, 0) // _CELL
        cells = self._covered[int(low[0]) : int(high[0]) + 1, int(low[1]) : int(high[1]) + 1]
        return int(cells.max(initial=0) >= _RODS), int(cells.sum())


def _overlap(box, other):
    """Whether rectangles overlap, or are nearer than a gap."""
    (a, b, c, d), (x0, y0, x1, y1) = box, other
    return a < x1 + _GAP and x0 < c + _GAP and b < y1 + _GAP and y0 < d + _GAP


def _cross(line, others):
    """Which of other line segments (n, 2, 2) a segment (2, 2) crosses, pixels."""
    c, d = others[:, 0], others[:, 1]

    def side(p, q, r):
        return np.sign((q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0])

    return (side(*line, c) * side(*line, d) < 0) & (side(c, d, line[0]) * side(c, d, line[1]) < 0)


def _crosses_boxes(lines, boxes):
    """Which line segments (..., 2, 2) touch which rectangles (..., 4), pixels; one of the two may be single."""
    start, along = lines[..., 0, :], lines[..., 1, :] - lines[..., 0, :] + 1e-9  # never along an axis
    ends = np.sort([(boxes[..., :2] - start) / along, (boxes[..., 2:] - start) / along], axis=0)
    return np.maximum(ends[0].max(axis=-1), 0.0) <= np.minimum(ends[1].min(axis=-1), 1.0)


def _width(text):
    """Of a text, over the font's size."""
    return sum(_LETTERS.get(x, _CAPITAL if x.isupper() else _LETTER) for x in text)


def _box(text, at, size):
    width, height = _width(text) * size, _LINE * size
    return at[0] - width / 2, at[1] - height / 2, at[0] + width / 2, at[1] + height / 2


def plain(text):
    """A text that VTK takes literally; it reads formulas between dollar signs otherwise."""
    return text.replace("$", "\\$")


def _cells_of(lines, window):
    """Which cells of a picture points (n, 2) of lines, pixels, lie in: 1 of an array over columns and rows, else 0."""
    covered = np.zeros([int(side // _CELL) + 1 for side in window], dtype=int)
    for line in lines:
        cells = (line // _CELL).astype(int)
        cells = cells[((cells >= 0) & (cells < covered.shape)).all(axis=1)]
        covered[cells[:, 0], cells[:, 1]] = 1
    return covered


def _dense(line):
    """A line with points between its own."""
    x = np.arange(len(line))
    return np.column_stack([np.interp(np.linspace(0, x[-1], 201), x, column) for column in np.asarray(line).T])


_UNITS = ((2e4, 1e3, "km"), (0.05, 1.0, "m"), (5e-5, 1e-3, "mm"), (5e-8, 1e-6, "µm"), (0.0, 1e-9, "nm"))
# Maximum intervals between ticks on the longest axis; half length of a flat axis over the longest.
_INTERVALS, _FLAT = 6, 0.03
# Pixels: length of a tick, shortest labelled axis, distance of the axes from the box (room for signs of supports).
_TICK, _SEEN, _ASIDE = 8, 20, 26


@dataclass(frozen=True)
class Axis:
    """An axis of the box around a drawing: name and unit; low, high: m; ticks: (m, text), none where it is flat."""

    name: str
    low: float
    high: float
    ticks: tuple


def axes_of(points, most=_INTERVALS):
    """The three `Axis` of a drawing of points (n, 3), m, with at most `most` intervals on the longest one."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    unit, scale = chosen_unit("m") or next((unit, scale) for least, scale, unit in _UNITS if size >= least)
    step = scale * round_step(size / scale, most)
    first, last = (x.astype(int).tolist() for x in (np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)))
    axes = []
    for name, a, b, middle in zip("xyz", first, last, (low + high) / 2, strict=True):
        ticks = tuple((k * step, text_of(k * step, step, scale)) for k in range(a, b + 1)) if b > a else ()
        ends = (a * step, b * step) if ticks else (middle - _FLAT * size, middle + _FLAT * size)
        axes.append(Axis(f"{name} ({unit})", *ends, ticks))
    return tuple(axes)


def draw_axes(plotter, pyvista, axes, view, labels, font=None, signs=()):
    """Draw the edges of the box that carry ticks, outside in the picture: z at the left, x and y below; and the floor
    of a box that is not flat. axes: three `Axis`; labels: the `Labels` that its texts join; font: pixels; signs: points
    (n, 3), m, of arrows and other signs, which axes lie outside of."""
    font = font or max(9, round(view.window[1] / 55))
    corner = {(i, end): getattr(axes[i], end) for i in range(3) for end in ("low", "high")}
    lines = []
    middle = view.pixels([(axis.low + axis.high) / 2 for axis in axes])
    names = []
    for i, axis in enumerate(axes):
        if not axis.ticks:
            continue
        j, k = (i + 1) % 3, (i + 2) % 3
        edges = []
        for ends in itertools.product(("low", "high"), repeat=2):
            edge = np.empty((2, 3))
            edge[:, i], edge[:, j], edge[:, k] = (axis.low, axis.high), corner[j, ends[0]], corner[k, ends[1]]
            edges.append(edge)
        x, y = np.moveaxis(view.pixels(edges).mean(axis=1), -1, 0)
        edge = edges[int(np.argmin(x if i == 2 else y + 1e-3 * x))]
        along = np.diff(view.pixels(edge), axis=0)[0]
        if np.linalg.norm(along) < _SEEN:  # the view is along this axis
            continue
        out = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        out *= np.sign(out @ (view.pixels(edge).mean(axis=0) - middle)) or 1.0
        ends = view.pixels(edge)
        places = view.pixels(np.reshape(signs, (-1, 3))) - ends[0]
        inside = np.abs(places @ along / (along @ along) - 0.5) < 0.5 + _TICK / np.linalg.norm(along)
        edge = edge + view.offset(*(max(_ASIDE, _ASIDE / 2 + (places[inside] @ out).max(initial=0.0)) * out))
        lines.append(edge)
        if i == 2:  # where labels beside a drawing would have their lines cross it
            labels.part(edge)
        room = font * (max(_width(text) for _, text in axis.ticks) / 2 * abs(out[0]) + 0.55 * abs(out[1]))
        points = np.repeat(edge[:1], len(axis.ticks), axis=0)
        points[:, i] = [value for value, _ in axis.ticks]
        lines += [np.array([point, point + view.offset(*(-_TICK * out))]) for point in points]
        numbers = [(text, point) for (_, text), point in zip(axis.ticks, points, strict=True)]
        labels.evenly(numbers, size=font, away=(font / 2 + room) * out)
        beside = font / 2 + 2 * room + font * ((_width(axis.name) / 2 + 0.6) * abs(out[0]) + abs(out[1]))
        end = edge[int(np.argmax(view.pixels(edge)[:, 1] * (1 if i == 2 else -1)))]
        beyond = font * np.array([0.0, 1.3 if i == 2 else -2.4])  # over the vertical axis, under the others
        names.append((axis.name, [(edge.mean(axis=0), beside * out), (end, beyond)]))
    for name, places in names:
        labels.fix(name, places, size=font)
    if np.abs(view.to_camera).max() < 1:  # seen obliquely
        (x0, x1), (y0, y1), z = *((axis.low, axis.high) for axis in axes[:2]), axes[2].low
        floor = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z], [x0, y0, z]])
        plotter.add_mesh(pyvista.lines_from_points(floor), color="lightgrey", line_width=1)
    labels.keep_off(lines)
    for line in lines:
        plotter.add_mesh(pyvista.Line(*line), color="dimgrey", line_width=1)


def round_step(size, most):
    """The least of 1, 2 and 5 times a power of ten that divides `size` into at most `most` intervals."""
    decade = 10.0 ** math.floor(math.log10(size / most))
    return next(f * decade for f in (1, 2, 5, 10) if size / (f * decade) <= most * (1 + 1e-9))


def text_of(value, step, scale=1.0):
    """A tick's value, a multiple of `step`, in a unit of size `scale`, with the digits that the step needs."""
    digits = max(0, -math.floor(math.log10(step / scale) + 1e-9))
    text = f"{value / scale:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text
