"""A chart of the energies of a motion and of the error of their balance, by matplotlib."""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure

_CURVES = (
    ("kinetic", "kinetic", "tab:blue", "-"),
    ("strain", "strain", "tab:orange", "-"),
    ("energy", "kinetic + strain", "black", "-"),
    ("work", "work of loads and supports", "tab:green", "--"),
    ("dissipated", "dissipated", "tab:red", "--"),
)


def draw(history, file=None):
    """Draw the energies of a `History` over time above, and the error of the energy balance below.

    Args:
        history: with at least two times.
        file: .png, .pdf or another format of matplotlib (rank 0 writes); None returns the Figure.

    Raises:
        SceneError: fewer than two times, an unknown ending, or matplotlib is missing.
        OSError: the file cannot be written.
    """
    if len(history) < 2:
        raise SceneError("chart of energies: expected a history with at least two times")
    return draw_chart(lambda: _figure(history), file, history.comm)


def _figure(history):
    figure = empty_figure(11, 6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    for name, label, colour, style in _CURVES:
        values = getattr(history, name)
        if np.abs(values).max() > 0:
            above.plot(history.times, values, style, color=colour, label=label)
    above.set_ylabel("energy (J)")
    above.set_title(f"{history.scene.title or 'Motion'}: energy, scheme {history.scheme}")
    above.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)  # beside the axes, not over the curves
    below.plot(history.times, history.balance, color="black")
    below.set_ylabel("not accounted\nfor (J)")
    below.set_xlabel("time (s)")
    for axes in (above, below):
        axes.grid(alpha=0.3)
    return figure
