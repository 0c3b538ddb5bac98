"""A string in its hole in space, by pyvista, with radii and clearance enlarged."""

from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import positive
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.drawing import frame, load_pyvista
from cosserat_fenicsx.ranks import on_first, world

_WINDOW = 1100, 1200
# Radius of the hole in the picture, over the extent of the well.
_HOLE = 0.02
_FIELD = "side force (N/m)"
# Points along the string; more are left out.
_POINTS = 1500


def draw_in_space(answer, file, enlarge=None):
    """See `TorqueAndDrag.plot_3d`."""
    file = Path(file)
    if file.suffix != ".png":
        raise SceneError(f"{file}: expected a name that ends in .png")
    if enlarge is not None:
        positive("plot_3d", "enlarge", enlarge, "-")
    on_first(world(), lambda: _draw(answer, file, enlarge))


def _draw(answer, file, enlarge):
    pyvista = load_pyvista()
    at = np.flatnonzero(np.diff(answer.md, prepend=-1.0) > 1e-9)
    at = at[np.unique(np.linspace(0, len(at) - 1, min(len(at), _POINTS)).astype(int))]
    axis = _picture(answer.hole.path.position(answer.md[at]))
    hole = answer.hole.at(answer.md[at], "diameter") / 2
    if enlarge is None:
        enlarge = float(f"{_HOLE * np.ptp(axis, axis=0).max() / hole.max():.1g}")
    offset = answer.clearance[at, None] * _sides(answer, at)
    plotter = pyvista.Plotter(off_screen=True, window_size=_WINDOW)
    plotter.set_background("white")
    string = pyvista.MultipleLines(axis + enlarge * _picture(offset))
    string[_FIELD] = answer.side_force[at]
    string["radius"] = enlarge * (hole - answer.clearance[at])
    tube = string.tube(scalars="radius", absolute=True, n_sides=16)
    plotter.add_mesh(tube, scalars=_FIELD, cmap="viridis",
                     scalar_bar_args={"vertical": True, "position_x": 0.86, "position_y": 0.25,
                                      "color": "black"})  # fmt: skip
    wall = pyvista.MultipleLines(axis)
    wall["radius"] = enlarge * hole
    plotter.add_mesh(wall.tube(scalars="radius", absolute=True, n_sides=24), color="peru", opacity=0.2)
    plotter.add_text(
        f"{answer.operation.name}, bit at {answer.depth:g} m, {answer.model} string\n"
        f"radii and clearance {enlarge:g} times as large; x east, y north, z upwards", font_size=11, color="black",
    )  # fmt: skip
    frame(plotter, axis)
    plotter.screenshot(file)
    plotter.close()


def _picture(rows):
    """North, east, down as x to the east, y to the north, z upwards."""
    return np.stack([rows[:, 1], rows[:, 0], -rows[:, 2]], axis=1)


def _sides(answer, at):
    """(n, 3) unit vectors across the hole to where the string touches it; zero where it touches nothing."""
    t = answer.hole.path.tangent(answer.md[at])
    high = -(np.array([0.0, 0.0, 1.0]) - t * t[:, 2:])
    size = np.linalg.norm(high, axis=1, keepdims=True)
    high = high / np.where(size > 0, size, 1.0)
    angle = np.nan_to_num(answer.contact_side[at])[:, None]
    touches = np.isfinite(answer.contact_side[at])[:, None]
    return np.where(touches, np.cos(angle) * high + np.sin(angle) * np.cross(t, high), 0.0)
