"""A string in its hole in space, by pyvista, with the clearance enlarged."""

import math
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import positive
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.axes import round_step
from cosserat_fenicsx.pictures.drawing import add_wall, frame, load_pyvista
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.well.components import Bit, Stabiliser
from cosserat_fenicsx.well.contacts import usual_force

# Width and height, pixels: of a well, and of one that is this share as wide as deep.
_WINDOW, _NARROW, _SLENDER = (1150, 950), (760, 1150), 0.2
# Largest distance from the string to the wall in the picture, and radius of the string, over the extent of the well.
_CLEARANCE, _STRING = 0.02, 0.008
_BLADES = "#5f7f9f"
_FIELD = "side force (N/m)\n"
# Points along the string; more are left out. Intervals between the numbers of the colour bar, at most.
_POINTS, _BAR = 1500, 5


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
    hole, spans = answer.hole.at(answer.md[at], "diameter") / 2, np.ptp(axis, axis=0)
    blades = [place for place in answer.laid if isinstance(place.component, Bit | Stabiliser)]
    radius, size = hole - answer.clearance[at], float(spans.max())
    pipe = np.ones(len(at), dtype=bool)
    for place in blades:
        pipe &= (answer.md[at] < place.top) | (answer.md[at] > place.bottom)
    least = float(
        radius[pipe].min() if pipe.any() else radius.min()
    )  # what is wider is drawn wider by its share of the clearance
    if enlarge is None:
        enlarge = max(float(f"{_CLEARANCE * size / max((hole - least).max(), 1e-9):.1g}"), 1.0)
    thicker = min(enlarge, max(float(f"{_STRING * size / least:.1g}"), 1.0))

    def drawn(x):
        return thicker * least + enlarge * (x - least)

    window = _NARROW if np.hypot(*spans[:2]) < _SLENDER * spans[2] else _WINDOW
    plotter = pyvista.Plotter(off_screen=True, window_size=window)
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    line = axis + enlarge * _picture(answer.offset[at])
    string = pyvista.MultipleLines(line)
    string[_FIELD] = answer.side_force[at]
    string["radius"] = np.where(pipe, drawn(radius), thicker * least)
    tube = string.tube(scalars="radius", absolute=True, n_sides=16)
    most = min(answer.side_force.max(), usual_force(answer.side_force)) or 1.0  # peaks would hide all else
    step = round_step(most, _BAR)
    count = math.ceil(most / step - 1e-9)
    plotter.add_mesh(tube, scalars=_FIELD, cmap="viridis", clim=(0.0, count * step), smooth_shading=True,
                     scalar_bar_args={"vertical": True, "position_x": 0.86, "position_y": 0.25, "color": "black",
                                      "n_labels": count + 1, "fmt": "%g", "title_font_size": 18,
                                      "label_font_size": 18})  # fmt: skip
    for place in blades:  # across the hole, whatever angle the string is drawn at
        ends = np.array([place.top, place.bottom])
        aside = [np.interp(ends.mean(), answer.md, column) for column in answer.offset.T]
        line = pyvista.MultipleLines(_picture(answer.hole.path.position(ends) + enlarge * np.array(aside)))
        plotter.add_mesh(line.tube(radius=float(drawn(place.component.contact_radius)), n_sides=32), color=_BLADES)
    add_wall(plotter, pyvista, axis, drawn(hole))
    plotter.add_text(
        f"{answer.operation.name}, bit at {answer.depth:g} m, {answer.words}\nclearance {enlarge:g} times, string "
        f"{thicker:g} times as large\nx east, y north, z upwards", font_size=12, color="black",
    )  # fmt: skip
    frame(plotter, axis)
    plotter.screenshot(file)
    plotter.close()


def _picture(rows):
    """North, east, down as x to the east, y to the north, z upwards."""
    return np.stack([rows[:, 1], rows[:, 0], -rows[:, 2]], axis=1)
