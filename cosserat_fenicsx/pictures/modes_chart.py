"""Chart of modes along a path, or over the rate of a steady rotation (Campbell diagram), by matplotlib."""

import numpy as np

from cosserat_fenicsx.pictures.charts import COLOURS, GREY, scale, stacked

# The markers of unstable states, and the room above the highest frequency.
_UNSTABLE, _ROOM = {"marker": "x", "color": "tab:red", "ls": "", "label": "grows"}, 1.08


def of_modes(found, seen, orders):
    """See `ModesAlong.plot`."""
    figure, (above, below) = stacked(7.5, (3.2, 1.8))
    known, over = found.quantities, found.value(found._over)
    quantity = known["frequency" if seen == "rotating" else "inertial_frequency"]
    frequencies, growth = quantity.of(found), known["growth_rate"].of(found)
    unsure = found.in_turn(np.array([x.unsure for x in found.modes]))
    growth = np.where(np.abs(growth) > unsure, growth, 0.0)
    along, size = scale(known[found._over], over)
    heading, of_frequency = scale(quantity, frequencies)
    grows = found.in_turn(np.array([np.isin(x.kind, ("flutter", "divergence")) for x in found.modes]))
    for k in range(frequencies.shape[1]):
        for axes, values in ((above, frequencies / of_frequency), (below, growth)):
            axes.plot(over / size, values[:, k], color=COLOURS[k % len(COLOURS)])
            axes.plot(over[grows[:, k]] / size, values[grows[:, k], k], **_UNSTABLE)
    top = _ROOM * np.nanmax(frequencies, initial=0.0) / of_frequency
    if found._over == "rate":
        for order in orders:
            above.plot(over / size, order * over / (2 * np.pi) / of_frequency, ":", color=GREY, lw=0.8)
            end = min(over[-1], 2 * np.pi * top * of_frequency / order)
            above.annotate(f"{order} x", (end / size, order * end / (2 * np.pi) / of_frequency), color=GREY)
    above.set(ylabel=heading, ylim=(0, top or 1.0))
    below.set(ylabel=scale(known["growth_rate"], growth)[0], xlabel=along)
    handles, labels = above.get_legend_handles_labels()
    if grows.any():
        above.legend(handles[:1], labels[:1])
    figure.suptitle(f"{found.scene.title or 'Modes'}: {frequencies.shape[1]} modes" + (
        f", seen in the {seen} frame" if found.rotates else ""
    ))  # fmt: skip
    return figure
