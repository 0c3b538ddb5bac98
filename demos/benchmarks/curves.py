"""A chart of curves: what a problem draws where its result has no picture of its own."""

from cosserat_fenicsx.pictures.charts import draw_chart, legend, stacked


def curve(file, lines, across, up):
    """Draw lines into a file.

    Args:
        lines: {name: (x, y)}; a name "" stays without legend; up to ten points are drawn as points.
        across, up: labels of the axes, with units.
    """

    def make():
        figure, (axes,) = stacked(6.0, [3.0])
        for name, (x, y) in lines.items():
            axes.plot(x, y, "o" if len(x) <= 10 else "-", label=name or None)
        axes.set(xlabel=across, ylabel=up)
        if any(lines):
            legend(axes)
        return figure

    return draw_chart(make, file)
