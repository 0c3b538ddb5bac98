"""Charts of torque and drag, by matplotlib: depth runs downwards."""

import numpy as np

from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.well.contacts import usual_force

_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown", "tab:pink", "tab:gray")
_STYLES = ("-", "--", ":", "-.")
# A torque below this part of the largest tension times the contact radius is not drawn.
_LITTLE = 1e-4


def draw_answer(answer, file):
    """See `TorqueAndDrag.plot`."""
    return draw_chart(lambda: answer_figure(answer), file, world())


def draw_sweep(sweep, file):
    """See `DepthSweep.plot`."""
    return draw_chart(lambda: sweep_figure(sweep), file, world())


def _axes(columns, width):
    """A Figure and axes side by side that share the depth, which runs downwards."""
    figure = empty_figure(width, 7)
    axes = figure.subplots(1, columns, sharey=True, squeeze=False)[0]
    axes[0].invert_yaxis()
    for panel in axes:
        panel.grid(alpha=0.3)
    return figure, axes


def answer_figure(answer):
    """Along the string: tension with the loads of buckling, torque where there is some, side force, and the forces of
    the wall at points where there are some."""
    points = [(md, force, side) for md, end, force, side in answer.contacts if md == end]
    turns = np.abs(answer.torque).max() > _LITTLE * np.abs(answer.tension).max() * answer.pieces.radius.max()
    draws = [_tension, *([_torque] if turns else []), _side_force]
    draws += [lambda axes, _: _at_points(axes, points)] if points else []
    figure, axes = _axes(len(draws), 1 + 4 * len(draws))
    ends = [section.to for section in answer.hole.sections[:-1] if section.to < answer.depth]
    for panel, drawn in zip(axes, draws, strict=True):
        drawn(panel, answer)
        for end in ends:
            panel.axhline(end, color="tab:blue", linewidth=0.6)
    axes[0].set_ylabel("measured depth (m)")
    figure.suptitle(
        f"{answer.operation.name}, bit at {answer.depth:g} m, {answer.words}: hook load "
        f"{answer.hook_load / 1e3:.1f} kN, surface torque {round(answer.surface_torque / 1e3, 2) + 0.0:.2f} kN m"
    )
    return figure


def _tension(axes, answer):
    md = answer.md
    axes.plot(answer.tension / 1e3, md, color="black", label="effective tension")
    if np.isfinite(answer.true_tension).any():
        axes.plot(answer.true_tension / 1e3, md, color="tab:gray", linestyle="--", label="true tension")
    low = min(answer.tension.min(), 0.0) * 1.5 - 0.1 * np.abs(answer.tension).max()
    # what decides for the state: in a vertical hole Lubinski's load, which is the greater one there
    critical = -np.maximum(answer.critical_load("He-Kyllingstad"), answer.critical_load("Lubinski"))
    critical = np.where(critical > low, critical, np.nan)  # a picture of what is near
    if np.isfinite(critical).any():
        label = "buckles below: He-Kyllingstad or Lubinski"
        axes.plot(critical / 1e3, md, color="tab:orange", label=label)
    axes.axvline(0.0, color="black", linewidth=0.6)
    axes.set_xlabel("tension (kN)")
    axes.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0))


def _torque(axes, answer):
    axes.plot(answer.torque / 1e3, answer.md, color="black")
    axes.set_xlabel(f"torque (kN m), {answer.torque_convention}")


def _side_force(axes, answer):
    axes.plot(answer.side_force, answer.md, color="black")
    axes.set_xlabel("side force of the wall per length (N/m)")
    usual = usual_force(answer.side_force)
    if answer.side_force.max() > usual > 0:
        axes.set_xlim(-0.03 * usual, usual)
        axes.set_xlabel("side force of the wall per length (N/m), peaks cut off")


def _at_points(axes, points):
    md, force = np.array([(md, force) for md, force, _ in points]).T
    axes.barh(md, force / 1e3, height=0.0, edgecolor="black", linewidth=1.0)
    for side in sorted({side for *_, side in points}):
        where = np.array([name == side for *_, name in points])
        axes.plot(force[where] / 1e3, md[where], ".", label=f"{side} side")
    axes.set_xlabel("forces of the wall at points (kN)")
    axes.set_xlim(left=0.0)
    axes.legend(fontsize=8)


def sweep_figure(sweep):
    """Hook load and surface torque over the depth of the bit."""
    turns = any(operation.direction(1.0)[1] for operation in sweep.operations)
    figure, axes = _axes(1 + bool(turns), 6.5 * (1 + bool(turns)))
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
