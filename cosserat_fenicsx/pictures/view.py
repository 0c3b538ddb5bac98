"""The camera of a drawing: a parallel projection, and what is where in the picture."""

from dataclasses import dataclass

import numpy as np

# The drawing fills these shares of the width, left of the colour bar, and of the height, between title and lowest axis,
# and is moved by these shares of the picture's half sizes, to the left and upwards.
_WHOLE = (0.62, 0.64, 0.12, -0.03)
# Likewise in one of several drawings side by side, without a colour bar.
_PANEL = (0.72, 0.58, -0.06, 0.02)


def view_of(span):
    """Directions for a drawing whose extents along x, y and z are `span` (3,): a plane scene is seen along its normal,
    others from a corner.

    Returns:
        Unit vectors (3,): to the camera, to the right and upwards in the picture; and the upward direction in space.
    """
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


@dataclass(frozen=True)
class View:
    """A parallel projection.

    Attributes:
        to_camera, right, above: unit vectors (3,), inertial; up: the upward direction in space.
        focus: the point in the middle of the picture, m.
        half: half the height of the picture, m.
        window: (width, height), pixels.
    """

    to_camera: np.ndarray
    right: np.ndarray
    above: np.ndarray
    up: np.ndarray
    focus: np.ndarray
    half: float
    window: tuple

    @classmethod
    def of(cls, points, span, window, panel=False):
        """The view that shows all points (n, 3), m.

        Args:
            span: (3,) the extents that decide on its direction.
            window: (width, height), pixels.
            panel: whether it is one of several drawings side by side.
        """
        wide, tall, left, upwards = _PANEL if panel else _WHOLE
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
