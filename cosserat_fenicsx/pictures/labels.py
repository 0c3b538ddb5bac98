"""Texts in a drawing that neither overlap each other nor leave the picture."""

import itertools

import numpy as np

# Mean width of a letter and height of a line over the font's size; pixels between labels, and to the picture's edge.
_LETTER, _LINE, _GAP, _EDGE = 0.56, 1.15, 3, 4
# Distances (pixels) from what a label belongs to, and turns (deg) of its direction, in the order of preference; from
# the last distances a thin line leads back.
_DISTANCES, _TURNS, _LEADER = (16, 26, 42, 64, 92, 128), (0, 40, -40, 80, -80, 120, -120, 180), 40
# Pixels between a label and the middle of a rod; size of the cells in which lines are looked up, pixels.
_CLEAR, _CELL = 10, 4


class Labels:
    """The labels of a drawing; `draw` puts all of them into it.

    Args:
        view: the `View`.
        lines: lines (n, 3), m, such as rods and arrows, that labels keep off where possible.
    """

    def __init__(self, view, lines=()):
        self._view, self._placed, self._texts, self._leaders = view, [], [], []
        self._covered = _cells_of([view.pixels(_dense(line)) for line in lines], view.window)
        #: texts for which there was no room
        self.left_out = []

    def fix(self, text, point, *, size, away=(0.0, 0.0), colour="black"):
        """A label whose middle is `away` pixels (2,) from a point (3,), m, unless another label is there."""
        box = _box(text, self._view.pixels(point) + away, size)
        if self._free(box):
            self._keep(text, point, box, size, colour)

    def reserve(self, low, high):
        """Keep a rectangle free of labels: its lower left and upper right corners, pixels."""
        self._placed.append((*low, *high))

    def near(self, text, point, towards, *, size, colour="black"):
        """A label near a point (3,), m, in the direction `towards` (3,) if there is room, else in another one.

        Returns:
            whether there was room for it.
        """
        anchor, wish = self._view.pixels(point), np.array([towards @ self._view.right, towards @ self._view.above])
        wish = wish / np.linalg.norm(wish) if np.linalg.norm(wish) > 1e-6 else np.array([0.0, 1.0])
        half = np.array([_LETTER * len(text), _LINE]) * size / 2
        for strict, distance, turn in itertools.product((True, False), _DISTANCES, np.deg2rad(_TURNS)):
            cos, sin = np.cos(turn), np.sin(turn)
            way = np.array([cos * wish[0] - sin * wish[1], sin * wish[0] + cos * wish[1]])
            # the label's edge is at the distance, not its middle
            reach = min(h / max(abs(w), 1e-9) for h, w in zip(half, way, strict=True))
            box = _box(text, anchor + (distance + reach) * way, size)
            if self._free(box) and (not strict or self._clear(box)):
                self._keep(text, point, box, size, colour)
                if distance > _LEADER:
                    self._leaders.append([point, point + self._view.offset(*((distance - _GAP) * way))])
                return True
        self.left_out.append(text)
        return False

    @property
    def boxes(self):
        """The rectangles of the labels and of what is reserved: (left, bottom, right, top), pixels."""
        return list(self._placed)

    def draw(self, plotter, pyvista):
        """Put all labels into the drawing."""
        if self._leaders:
            ends = np.concatenate(self._leaders) + self._view.half * self._view.to_camera  # in front of the rods
            plotter.add_mesh(pyvista.line_segments_from_points(ends), color="darkgrey", line_width=1)
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

    def _free(self, box):
        """Whether a rectangle lies in the picture and overlaps no label."""
        low, high = np.array(box[:2]), np.array(box[2:])
        if (low < _EDGE).any() or (high > np.array(self._view.window) - _EDGE).any():
            return False
        return not any(
            box[0] < x1 + _GAP and x0 < box[2] + _GAP and box[1] < y1 + _GAP and y0 < box[3] + _GAP
            for x0, y0, x1, y1 in self._placed
        )

    def _clear(self, box):
        """Whether a rectangle lies off all rods."""
        low = np.maximum(np.array(box[:2]) - _CLEAR, 0) // _CELL
        high = np.maximum(np.array(box[2:]) + _CLEAR, 0) // _CELL
        return not self._covered[int(low[0]) : int(high[0]) + 1, int(low[1]) : int(high[1]) + 1].any()


def _box(text, at, size):
    width, height = _LETTER * size * len(text), _LINE * size
    return at[0] - width / 2, at[1] - height / 2, at[0] + width / 2, at[1] + height / 2


def plain(text):
    """A text that VTK takes literally; it reads formulas between dollar signs otherwise."""
    return text.replace("$", "\\$")


def _cells_of(lines, window):
    """Which cells of a picture points (n, 2) of lines, pixels, lie in: a boolean array over columns and rows."""
    covered = np.zeros([int(side // _CELL) + 1 for side in window], dtype=bool)
    for line in lines:
        cells = (line // _CELL).astype(int)
        cells = cells[((cells >= 0) & (cells < covered.shape)).all(axis=1)]
        covered[cells[:, 0], cells[:, 1]] = True
    return covered


def _dense(line):
    """A line with points between its own."""
    x = np.arange(len(line))
    return np.column_stack([np.interp(np.linspace(0, x[-1], 201), x, column) for column in np.asarray(line).T])
