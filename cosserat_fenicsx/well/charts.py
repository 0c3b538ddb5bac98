"""Charts of torque and drag, by matplotlib: depth runs downwards."""

import numpy as np

from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure
from cosserat_fenicsx.ranks import world

_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown", "tab:pink", "tab:gray")
_STYLES = ("-", "--", ":", "-.")


def draw_sweep(sweep, file):
    """See `DepthSweep.plot`."""
    return draw_chart(lambda: sweep_figure(sweep), file, world())


def depth_axes(width, columns=None, width_ratios=None):
    """A Figure (width in inches) and axes side by side that share the depth, which runs downwards."""
    figure = empty_figure(width, 7.5)
    axes = figure.subplots(
        1, columns or len(width_ratios), sharey=True, squeeze=False, gridspec_kw={"width_ratios": width_ratios}
    )[0]
    axes[0].invert_yaxis()
    for panel in axes:
        panel.grid(alpha=0.3)
    return figure, axes


def sweep_figure(sweep):
    """Hook load and surface torque over the depth of the bit."""
    turns = any(operation.direction(1.0)[1] for operation in sweep.operations)
    figure, axes = depth_axes(6.5 * (1 + bool(turns)), 1 + bool(turns))
    for i, operation in enumerate(sweep.operations):
        for j in range(len(sweep.friction)):
            look = {"color": _COLOURS[i % len(_COLOURS)], "linestyle": _STYLES[j % len(_STYLES)]}
            look |= {"label": sweep.label(i, j), "marker": "." if len(sweep.depths) < 30 else None}
            axes[0].plot(sweep.hook_load[i, j] / 1e3, sweep.depths, **look)
            without = sweep.depths[sweep.done[i, j] & np.isnan(sweep.hook_load[i, j])]
            if len(without):  # at the left, every line in its own column
                at = np.full(len(without), 0.02 * (1 + i * len(sweep.friction) + j)), without
                cross = {"marker": "x", "linestyle": "none", "transform": axes[0].get_yaxis_transform()}
                axes[0].plot(*at, **{**look, **cross, "label": f"{sweep.label(i, j)}: no answer"})
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
