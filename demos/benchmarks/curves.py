"""A chart of curves: what a problem draws where its result has no picture of its own."""

from cosserat_fenicsx.pictures.charts import draw_chart, empty_figure, legend


def charted(xlabel, ylabel, lines, equal=False):
    """A function that draws lines into a file.

    Args:
        xlabel, ylabel: of the axes, with units.
        lines: [(label, or None for a line without legend, x, y, style)].
        equal: whether both axes have one scale.
    """

    def figure():
        made = empty_figure(7.5, 4.5)
        axes = made.add_subplot()
        for label, x, y, style in lines:
            axes.plot(x, y, style, label=label)
        axes.set(xlabel=xlabel, ylabel=ylabel, aspect="equal" if equal else "auto")
        if any(label for label, *_ in lines):
            legend(axes)
        return made

    return lambda file: draw_chart(figure, file)


def curve(file, lines, across, up):
    """Draw {name: (x, y)} into a file: up to ten points as points, up to sixty as points on a line; a name "" without
    legend; `across`, `up`: labels."""
    styles = {name: "o" if len(x) <= 10 else ".-" if len(x) <= 60 else "-" for name, (x, _) in lines.items()}
    charted(across, up, [(name or None, x, y, styles[name]) for name, (x, y) in lines.items()])(file)
