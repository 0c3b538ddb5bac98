"""A string in its hole in space, by pyvista, with radii and clearance enlarged."""

from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import positive
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.drawing import frame, load_pyvista
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.well.contacts import usual_force

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
    plotter = pyvista.Plotter(off_screen=True, window_size=_WINDOW)
    plotter.set_background("white")
    string = pyvista.MultipleLines(axis + enlarge * _picture(answer.offset[at]))
    string[_FIELD] = answer.distributed_force[at]
    string["radius"] = enlarge * (hole - answer.clearance[at])
    tube = string.tube(scalars="radius", absolute=True, n_sides=16)
    force = answer.distributed_force
    most = min(force.max(), usual_force(force)) or 1.0  # peaks would hide all else
    plotter.add_mesh(tube, scalars=_FIELD, cmap="viridis", clim=(0.0, most),
                     scalar_bar_args={"vertical": True, "position_x": 0.86, "position_y": 0.25,
                                      "color": "black"})  # fmt: skip
    wall = pyvista.MultipleLines(axis)
    wall["radius"] = enlarge * hole
    plotter.add_mesh(wall.tube(scalars="radius", absolute=True, n_sides=24), color="peru", opacity=0.2)
    plotter.add_text(
        f"{answer.operation.name}, bit at {answer.depth:g} m, {answer.words}\n"
        f"radii and clearance {enlarge:g} times as large; x east, y north, z upwards", font_size=11, color="black",
    )  # fmt: skip
    frame(plotter, axis)
    plotter.screenshot(file)
    plotter.close()


def _picture(rows):
    """North, east, down as x to the east, y to the north, z upwards."""
    return np.stack([rows[:, 1], rows[:, 0], -rows[:, 2]], axis=1)
