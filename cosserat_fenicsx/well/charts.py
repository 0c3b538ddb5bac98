"""Charts of torque and drag, by matplotlib: depth runs downwards."""

from pathlib import Path

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.figures import save
from cosserat_fenicsx.ranks import on_first, world

_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown", "tab:pink", "tab:gray")
_STYLES = ("-", "--", ":", "-.")


def draw(make, file):
    """Make a Figure, and write it where a file is given.

    Raises:
        SceneError: matplotlib is missing, or the file's ending is unknown to it.
        OSError: the file cannot be written.
    """
    if file is None:
        return make()
    on_first(world(), lambda: _save(make(), Path(file)))
    return None


def _save(figure, file):
    known = figure.canvas.get_supported_filetypes()
    if file.suffix.removeprefix(".") not in known:
        raise SceneError(f"{file}: expected a name that ends in .{', .'.join(sorted(known))}")
    save(figure, file)


def _axes(columns, width):
    """A Figure and axes side by side that share the depth, which runs downwards."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise SceneError("charts need matplotlib: pip install matplotlib") from None
    figure = Figure(figsize=(width, 7), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, columns, sharey=True, squeeze=False)[0]
    axes[0].invert_yaxis()
    for panel in axes:
        panel.grid(alpha=0.3)
    return figure, axes


def answer_figure(answer):
    """Tension with the loads of buckling, torque where there is some, and side force along the string."""
    turns = np.abs(answer.torque).max() > 0
    figure, axes = _axes(2 + bool(turns), 13 if turns else 9)
    md = answer.md
    axes[0].plot(answer.tension / 1e3, md, color="black", label="effective tension")
    if np.isfinite(answer.true_tension).any():
        axes[0].plot(answer.true_tension / 1e3, md, color="tab:gray", linestyle="--", label="true tension")
    low = min(answer.tension.min(), 0.0) * 1.5 - 0.1 * np.abs(answer.tension).max()
    for name, colour, style in (("He-Kyllingstad", "tab:orange", "-"), ("Lubinski", "tab:red", ":")):
        critical = -answer.critical_load(name)
        critical = np.where(critical > low, critical, np.nan)  # a picture of what is near
        if np.isfinite(critical).any():
            axes[0].plot(critical / 1e3, md, color=colour, linestyle=style, label=f"buckles below: {name}")
    axes[0].axvline(0.0, color="black", linewidth=0.6)
    axes[0].set(xlabel="tension (kN)", ylabel="measured depth (m)")
    axes[0].legend(fontsize=8)
    if turns:
        axes[1].plot(answer.torque / 1e3, md, color="black")
        axes[1].set_xlabel(f"torque (kN m), {answer.torque_convention}")
    axes[-1].plot(answer.side_force, md, color="black")
    axes[-1].set_xlabel("side force of the wall per length (N/m)")
    ends = [section.to for section in answer.hole.sections[:-1] if section.to < answer.depth]
    for panel in axes:
        for end in ends:
            panel.axhline(end, color="tab:blue", linewidth=0.6)
    figure.suptitle(
        f"{answer.operation.name}, bit at {answer.depth:g} m, {answer.model} string: hook load "
        f"{answer.hook_load / 1e3:.1f} kN, surface torque {answer.surface_torque / 1e3:.2f} kN m"
    )
    return figure


def sweep_figure(sweep):
    """Hook load and surface torque over the depth of the bit."""
    turns = np.nanmax(np.abs(sweep.surface_torque), initial=0.0) > 0
    figure, axes = _axes(1 + bool(turns), 6.5 * (1 + bool(turns)))
    for i, operation in enumerate(sweep.operations):
        for j in range(len(sweep.friction)):
            look = {"color": _COLOURS[i % len(_COLOURS)], "linestyle": _STYLES[j % len(_STYLES)]}
            look |= {"label": sweep.label(i, j), "marker": "." if len(sweep.depths) < 30 else None}
            axes[0].plot(sweep.hook_load[i, j] / 1e3, sweep.depths, **look)
            if turns and operation.direction(1.0)[1]:
                axes[1].plot(sweep.surface_torque[i, j] / 1e3, sweep.depths, **look)
    axes[0].set(xlabel="hook load (kN)", ylabel="measured depth of the bit (m)")
    if turns:
        axes[1].set_xlabel("surface torque (kN m)")
    for panel in axes:
        panel.legend(fontsize=8)
    figure.suptitle(
        "Hook load and torque over the depth of the bit" if turns else "Hook load over the depth of the bit"
    )
    return figure
