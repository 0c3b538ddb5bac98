"""Charts of torque and drag, by matplotlib: depth runs downwards."""

import numpy as np

from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure
from cosserat_fenicsx.ranks import world

_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown", "tab:pink", "tab:gray")
_STYLES = ("-", "--", ":", "-.")
_GREY = "0.45"
# Loads beyond so many times the median are not what the axis is for.
_UNUSUAL = 10.0


def draw_sweep(sweep, file):
    """See `DepthSweep.plot`."""
    return draw_chart(lambda: sweep_figure(sweep), file, world())


def draw_fit(fit, file):
    """See `FrictionFit.plot`."""
    return draw_chart(lambda: fit_figure(fit), file, world())


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
    """Hook load and surface torque over the depth of the bit, with marks where there is no answer."""
    turns = any(operation.direction(1.0)[1] for operation in sweep.operations)
    figure, axes = depth_axes(6.5 * (1 + bool(turns)), 1 + bool(turns))
    low, high = _usual_range(sweep.hook_load / 1e3)
    by_rod = sweep.models == "rod"
    both = (by_rod.any(), (np.isfinite(sweep.hook_load) & ~by_rod).any()) == (True, True)
    for i, operation in enumerate(sweep.operations):
        for j in range(len(sweep.friction)):
            look = {"color": _COLOURS[i % len(_COLOURS)], "linestyle": _STYLES[j % len(_STYLES)]}
            drawn = {**look, "label": sweep.label(i, j), "marker": "." if len(sweep.depths) < 30 else None}
            hook = sweep.hook_load[i, j] / 1e3
            panels = [(axes[0], np.where((hook < low) | (hook > high), np.nan, hook))]
            if turns and operation.direction(1.0)[1]:
                panels.append((axes[1], sweep.surface_torque[i, j] / 1e3))
            for panel, loads in panels:
                panel.plot(loads, sweep.depths, **drawn)
                if both:
                    here = by_rod[i, j]
                    panel.plot(
                        loads[here], sweep.depths[here], "s", color=look["color"], markersize=7, fillstyle="none"
                    )
            _without_answer(axes[0], sweep, i, j, (low, high), look["color"])
    axes[0].set(xlabel="hook load (kN)", ylabel="measured depth of the bit (m)")
    if turns:
        axes[1].set_xlabel("surface torque (kN m)")
    if both:
        axes[0].plot([], [], "s", color=_GREY, markersize=7, fillstyle="none", label="by the exact rod, others soft")
    if (sweep.done & np.isnan(sweep.hook_load)).any():
        axes[0].plot([], [], "X", color=_GREY, linestyle="none", label="locks up, or no answer")
    for panel in axes:
        if panel.get_legend_handles_labels()[0]:
            panel.legend(fontsize=8)
    part = "" if sweep.done.all() else f", {len(sweep)} of {sweep.done.size} answers so far"
    what = "Hook load and torque" if turns else "Hook load"
    figure.suptitle(f"{what} over the depth of the bit{part}")
    return figure


def _usual_range(loads):
    """Ends of the axis of loads; infinite where all of them are of a usual size. Before it locks up a string may take a
    thrust far beyond all others."""
    known = np.abs(loads[np.isfinite(loads)])
    if not len(known) or known.max() <= _UNUSUAL * np.median(known):
        return -np.inf, np.inf
    usual = loads[np.isfinite(loads) & (np.abs(loads) <= _UNUSUAL * np.median(known))]
    room = 0.15 * np.ptp(usual)
    return min(usual.min(), 0.0) - room, max(usual.max(), 0.0) + room


def _without_answer(axes, sweep, i, j, limits, colour):
    """Marks where a line's loads are beyond the axis, with their numbers, and where it has none, with the place of
    lock-up."""
    loads, depths = sweep.hook_load[i, j] / 1e3, sweep.depths
    note = {"fontsize": 7, "color": colour, "va": "center", "textcoords": "offset points"}

    def offset(depth, right):
        """In points: notes at one depth are below each other."""
        return right, -9 * sum(text.xy[1] == depth for text in axes.texts)

    if np.isfinite(limits).all():
        axes.set_xlim(*limits)
    for k in np.flatnonzero((loads < limits[0]) | (loads > limits[1])):
        left = loads[k] < limits[0]
        at = limits[0] if left else limits[1]
        axes.plot(at, depths[k], "<" if left else ">", color=colour, clip_on=False)
        axes.annotate(f"{loads[k]:,.0f} kN, beyond the axis: close to lock-up", (at, depths[k]),
                      offset(depths[k], 8 if left else -8), ha="left" if left else "right", **note)  # fmt: skip
    order = np.argsort(depths)
    shown = None
    for k in order:
        if np.isfinite(loads[k]):
            shown = np.clip(loads[k], *limits)
        elif sweep.done[i, j, k]:
            # below the load at the depth before
            at = {"transform": axes.get_yaxis_transform()} if shown is None else {}
            axes.plot(0.02 if shown is None else shown, depths[k], "X", color=colour, clip_on=False, **at)
            locked = sweep.values["locked"][i, j, k]
            if shown is not None and np.isfinite(locked):
                told = f"bit at {depths[k]:.6g} m: locks up, from md = {locked:.5g} m of the string on"
                axes.annotate(told, (shown, depths[k]), offset(depths[k], 8), **note)


def fit_figure(fit):
    """Measured loads and those computed with the coefficients found, over the depth of the bit."""
    loads = [(m, "hook load (kN)", m.hook_load, m.hook_load_sd) for m in fit.measurements if m.hook_load is not None]
    loads += [(m, "surface torque (kN m)", m.torque, m.torque_sd) for m in fit.measurements if m.torque is not None]
    names = list(dict.fromkeys(name for _, name, *_ in loads))
    operations = list(dict.fromkeys(m.operation for m in fit.measurements))
    figure, axes = depth_axes(6.5 * len(names), len(names))
    for panel, name in zip(axes, names, strict=True):
        panel.set_xlabel(name)
        for i, operation in enumerate(operations):
            rows = sorted(
                (m.depth, value / 1e3, sd / 1e3, (value - residual * sd) / 1e3)
                for (m, what, value, sd), residual in zip(loads, fit.residuals, strict=True)
                if what == name and m.operation == operation
            )
            if rows:
                depth, measured, sd, computed = np.array(rows).T
                told = operation.name + (f", {operation.weight / 1e3:g} kN on bit" if operation.weight else "")
                look = {"color": _COLOURS[i % len(_COLOURS)]}
                panel.errorbar(measured, depth, xerr=sd, fmt="o", markersize=5, label=told, **look)
                panel.plot(computed, depth, "-x", linewidth=1, **look)
        panel.plot([], [], "-x", color=_GREY, linewidth=1, label="computed")
        panel.legend(fontsize=8, title="measured, with standard deviations", title_fontsize=8)
    axes[0].set_ylabel("measured depth of the bit (m)")
    told = [f"{section.name or f'to {section.to:g} m'} {mu:.3f} ({low:.3f} to {high:.3f})" for section, mu, (low, high)
            in zip(fit.hole.sections, fit.friction, fit.interval, strict=True)]  # fmt: skip
    block = f", block {fit.block_weight / 1e3:.1f} kN" if fit.block_weight else ""
    figure.suptitle(f"Friction: {', '.join(told)}\nmisfit {fit.misfit:.3g}{block}", fontsize=10)
    return figure
