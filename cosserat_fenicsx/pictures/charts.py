"""Shared parts of all charts, by matplotlib: style, sizes in pixels, units, panels, legends, ledgers of energy; files.

A chart is drawn for the width that it is shown at: fonts keep a size that can be read, panels, legends, titles and
labels are arranged in the room that there is.
"""

import io
import math
import textwrap
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import number
from cosserat_fenicsx.errors import LibraryMissing, SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.ranks import Alone, on_first

#: Colours and styles of lines, in their order; colour of auxiliary lines.
COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown", "tab:pink", "tab:gray")
STYLES = ("-", "--", ":", "-.")
GREY = "0.45"
#: Settings of matplotlib for all charts; size of the font of notes within a panel, points.
STYLE = {"font.size": 9, "axes.titlesize": 9, "legend.fontsize": 8, "figure.titlesize": 10, "axes.grid": True,
         "grid.alpha": 0.3, "legend.frameon": False, "legend.borderaxespad": 0.2, "lines.linewidth": 1.2,
         "axes.formatter.useoffset": False,
         "figure.constrained_layout.h_pad": 0.05}  # fmt: skip
SMALL = 7.5
# Default dots per inch; minimum, at which the smallest font has 9 pixels; allowed widths, pixels.
_DPI, _LEAST_DPI, _WIDTHS = 150, 90, (300, 10_000)
# Factor by which panels are narrowed before they are set in several rows; maximum height of a row over its width.
_SQUEEZED, _TALL = 1.3, 1.2
# Maximum passes of the arrangement of texts; mean width of a letter over the size of its font.
_PASSES, _LETTER = 5, 0.55
_ENERGY, _DONE = Quantity("stored energy", unit="J"), Quantity("work, losses", unit="J")
_UNACCOUNTED = Quantity("not accounted for", unit="J")
# Lines of up to this many points have markers.
_FEW = 40
# Ranges of logarithmic axes, high over low, below which powers of ten are too few.
_FEW_DECADES = 100
# Energies below this share of the largest are not drawn.
_LITTLE = 1e-9
# Requested width in pixels, and units, of the current chart.
_pixels = ContextVar("_pixels", default=None)
_units = ContextVar("_units", default="SI")


def draw_chart(make, file=None, comm=Alone, *, width=None, units="SI"):
    """The Figure that `make` draws on an `empty_figure`; or None where a file is given, which rank 0 writes; width: of
    the picture, pixels; None for 150 to the inch; units: that `scale` takes, see `Units`. A SceneError for a file's
    ending that matplotlib does not know, a width outside 300 to 10000, or unknown units; an OSError where the file
    cannot be written."""
    if width is not None:
        low, high = _WIDTHS
        width = number("plot", "width", width, f"pixels, from {low} to {high}", lambda x: low <= x <= high)
    look = asked(width, Units(units))

    def drawn():
        with look, styled():
            figure = make()
            arrange(figure)
        return figure

    if file is None:
        return drawn()
    on_first(comm, lambda: _write(drawn(), Path(file)))
    return None


@contextmanager
def asked(width=None, units="SI"):
    """Within it, figures have a width in pixels, and charts and pictures these units."""
    tokens = _pixels.set(width), _units.set(Units(units))
    try:
        yield
    finally:
        _pixels.reset(tokens[0])
        _units.reset(tokens[1])


def _write(figure, file, dpi=None):
    known = figure.canvas.get_supported_filetypes()
    if file.suffix.removeprefix(".") not in known:
        raise SceneError(f"{file}: expected a name that ends in .{', .'.join(sorted(known))}")
    if dpi:
        figure.set_dpi(dpi)
        figure.draw_without_rendering()  # letters are not exactly in proportion, and labels at the edge would be cut
    figure.set_layout_engine("none")  # all is where `arrange` has put it
    picture = io.BytesIO()  # complete in memory first: a full disk leads matplotlib to other exceptions than OSError
    figure.savefig(picture, format=file.suffix[1:], dpi=figure.dpi)
    with replaced(file) as fresh:
        fresh.write_bytes(picture.getvalue())


def styled():
    """A context manager in which charts have the `STYLE`; a SceneError where matplotlib is missing."""
    try:
        from matplotlib import rc_context
    except ImportError:
        raise LibraryMissing(
            "charts need matplotlib: pip install 'cosserat-fenicsx[pictures]', or pip install matplotlib"
        ) from None
    return rc_context(STYLE)


def unit_of(quantity, *values):
    """(unit, size) of a `Quantity` in a unit of the chart that suits all the values, the size in its own unit."""
    every = np.concatenate([np.ravel(x) for x in values]) if values else ()
    return Units(_units.get()).on_screen(quantity, every)


def chosen_unit(unit):
    """(unit, size) requested for numbers of an SI unit, size in the SI unit; None where none was."""
    return Units(_units.get()).chosen(Quantity("number", unit=unit))


def sentence(text):
    """A sentence in the units of the current chart or picture, see `Units.sentence`."""
    return Units(_units.get()).sentence(text)


def scale(quantity, *values):
    """(heading, size): the label of a `Quantity` with a unit, see `unit_of`."""
    unit, size = unit_of(quantity, *values)
    return quantity.heading(unit), size


# -- panels and legends ------------------------------------------------------------------------------------------------


def room_for(width):
    """A width in inches, limited to the room in the requested width in pixels."""
    return width if _pixels.get() is None else min(width, _pixels.get() / _LEAST_DPI)


def empty_figure(width, height):
    """A Figure (inches) that needs no screen; narrower where the requested width has no room for its fonts."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, pixels = room_for(width), _pixels.get()
    dpi = _DPI if pixels is None else pixels / width
    figure = Figure(figsize=(width, height), dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def stacked(width, heights):
    """A Figure and panels above each other with a common horizontal axis, such as time; width, heights: inches."""
    figure = empty_figure(width, 0.8 + sum(heights))
    panels = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    panels[0].margins(x=0.0)
    return figure, panels


def beside(widths, height):
    """A Figure and panels beside each other, inches, that share the vertical axis; in several rows where the picture is
    narrower. Returns the Figure; the panels, in the order of the widths; for each row the panels in it."""
    room, rows = room_for(sum(widths)), [[]]
    for k, width in enumerate(widths):
        if rows[-1] and sum(widths[i] for i in rows[-1]) + width > _SQUEEZED * room:
            rows.append([])
        rows[-1].append(k)
    figure = empty_figure(sum(widths), height if len(rows) == 1 else len(rows) * min(height, _TALL * room))
    grid, panels = figure.add_gridspec(len(rows), 1), []
    for i, row in enumerate(rows):
        inner = grid[i].subgridspec(1, len(row), width_ratios=[widths[k] for k in row])
        for j in range(len(row)):
            panels.append(figure.add_subplot(inner[j], sharey=panels[0] if panels else None))
            panels[-1].tick_params(labelleft=j == 0)
    return figure, panels, [[panels[k] for k in row] for row in rows]


def legend(*panels, **look):
    """A legend above each panel, of the names that no panel before has, in as many columns as there is room for."""
    told = set()
    for panel in panels:
        handles = dict(zip(*panel.get_legend_handles_labels()[::-1], strict=True))
        new = {name: handle for name, handle in handles.items() if name not in told}
        told |= set(new)
        if new:
            names, columns = _in_columns(panel, list(new))
            panel.legend(new.values(), names, ncols=columns, loc="lower center", bbox_to_anchor=(0.5, 1.0),
                         columnspacing=1.2, **look)  # fmt: skip


def _in_columns(panel, names):
    """Names, in lines that the width of a panel has room for, and for `Axes.legend` the number of columns."""
    size = STYLE["legend.fontsize"] / 72
    room = panel.get_subplotspec().get_position(panel.figure).width / 0.775 * panel.figure.get_figwidth() - 0.3
    letters = max(12, int((room - 4 * size) / (_LETTER * size)))
    lines = ["\n".join(textwrap.wrap(line, letters)) for line in names]
    longest = max(len(line) for text in lines for line in text.split("\n"))
    return lines, max(1, min(len(names), int(room / ((_LETTER * longest + 4) * size))))


def logarithmic(panel):
    """Make the vertical axis of a drawn panel logarithmic, with numbers between powers of ten where these are few."""
    from matplotlib.ticker import LogLocator

    panel.set_yscale("log")
    low, high = panel.get_ylim()
    if high < _FEW_DECADES * low:
        panel.yaxis.set_minor_locator(LogLocator(subs=(2, 5)))
        panel.yaxis.set_major_formatter("{x:g}")
        panel.yaxis.set_minor_formatter("{x:g}")


def ledger(times, stored, done, balance, title, about=""):
    """The Figure of a ledger of energy over times (n,), s: what is stored; works and losses, which may be many times as
    large (see `draw_energies`); and the error of their balance (n,), J; about: words after the label of what is stored.
    """
    heights = (2.6, 2.2, 1.2) if any(values.any() for _, values, *_ in done) else (3.6, 1.2)
    figure, panels = stacked(10, heights)
    draw_energies(panels[:-1], times, stored, done, about)
    heading, size = scale(_UNACCOUNTED, balance)
    panels[-1].plot(times, balance / size, color=GREY)
    panels[-1].set(xlabel="time (s)", ylabel=heading)
    figure.suptitle(title)
    return figure


def draw_energies(panels, times, stored, done, about=""):
    """Draw what is stored, with its sum, into the first panel, and works and losses (done) into the next one, if there
    is one: (label, values (n,) in J, colour, style) each; those that stay zero are left out."""
    most = max(np.abs(values).max() for _, values, *_ in (*stored, *done))
    for panel, curves, quantity in zip(panels, (stored, done), (_ENERGY, _DONE), strict=False):
        curves = [curve for curve in curves if np.abs(curve[1]).max() > _LITTLE * most]
        heading, size = scale(quantity, *(values for _, values, *_ in curves))
        if panel is panels[0]:
            heading += about
            if len(curves) > 1:  # a broad line below the others, which it would hide where it equals one of them
                total = sum(values for _, values, *_ in curves)
                panel.plot(times, total / size, color="0.8", linewidth=5, solid_capstyle="butt", label="total")
        for label, values, colour, style in curves:
            panel.plot(times, values / size, style, color=colour, label=label)
        panel.set_ylabel(heading)
    legend(*panels)


def draw_quantity(over, shown, title="", file=None, comm=Alone, **look):
    """Draw a quantity over another one, each a `Quantity` and its values (n,), of `shown` also (n, components): lines,
    one for each component, or its own `chart`; look: see `draw_chart`."""

    def make():
        figure, (panel,) = stacked(8, (4.0,))
        (across, x), (quantity, values) = over, shown
        (below, size), (beside, unit) = scale(across, x), scale(quantity, values)
        if quantity.chart is not None:
            quantity.chart(panel, x / size, values / unit)
        else:
            marker = "o-" if len(x) <= _FEW else "-"
            for part, y in zip(quantity.parts or [quantity.label], values.reshape(len(x), -1).T, strict=True):
                panel.plot(x / size, y / unit, marker, markersize=3, label=part)
            if quantity.parts:
                legend(panel)
        panel.set(xlabel=below, ylabel=beside)
        if title:
            figure.suptitle(title)
        return figure

    return draw_chart(make, file, comm, **look)


# -- texts that overlap nothing ----------------------------------------------------------------------------------------


def arrange(figure):
    """Break titles and labels into lines that fit, thin out ticks that touch, and move texts within panels apart."""
    for _ in range(_PASSES):
        figure.draw_without_rendering()
        changed = [] if figure._suptitle is None else [_fit(figure._suptitle, 0.96 * figure.bbox.width)]
        changed += [_fit_panel(panel) for panel in figure.axes if panel.get_visible()]
        if not any(changed):
            return
    figure.draw_without_rendering()


def _fit_panel(panel):
    changed = [
        _fit(panel.title, 1.05 * panel.bbox.width),
        _fit(panel.xaxis.label, 1.05 * panel.bbox.width),
        _fit(panel.yaxis.label, 1.05 * panel.bbox.height),
        _thin_out(panel.xaxis),
        _thin_out(panel.yaxis),
        _spread(panel),
    ]
    return any(changed)


def _fit(text, room):
    """Whether a text is wrapped again, since it is longer than the space for it, pixels."""
    extent = text.get_window_extent()
    length = max(extent.width, extent.height) if text.get_rotation() else extent.width
    if not text.get_text() or length <= room:
        return False
    old = text.get_text().split("\n")
    most, lines = max(8, int(max(map(len, old)) * room / length)), []
    for line in old:
        parts = math.ceil(len(line) / most)
        lines += textwrap.wrap(line, min(most, len(line) // parts + 6)) if parts > 1 else [line]
    text.set_text("\n".join(lines))
    return lines != old


def _thin_out(axis):
    """Whether an axis has fewer ticks now, since the numbers of neighbours touched."""
    from matplotlib.ticker import AutoLocator, MaxNLocator

    across = axis.axis_name == "x"
    boxes = [label.get_window_extent() for label in axis.get_ticklabels() if label.get_text() and label.get_visible()]
    ends = sorted((box.x0, box.x1) if across else (box.y0, box.y1) for box in boxes)
    gap = 3 if across else 1
    if not isinstance(axis.get_major_locator(), AutoLocator | MaxNLocator) or all(
        one[1] + gap <= other[0] for one, other in zip(ends, ends[1:], strict=False)
    ):
        return False
    axis.set_major_locator(MaxNLocator(max(1, math.ceil(0.6 * len(ends)) - 1)))
    return True


def _spread(panel):
    """Whether texts within a panel were moved, since they covered others or left the panel at a side."""
    from matplotlib.text import Text

    placed, moved = [], False
    for text in panel.texts:
        if not text.get_text():
            continue
        box = Text.get_window_extent(text)  # the extent of an annotation includes its arrow
        left, over = max(panel.bbox.x0 - box.x0, 0.0), max(box.x1 - panel.bbox.x1, 0.0)
        right = left - over if box.width < panel.bbox.width else 0.0
        box, up = box.translated(right, 0.0), 0.0
        while any(box.overlaps(other) for other in placed):
            step = 0.55 * box.height * (1.0 if text.get_va() == "bottom" else -1.0)
            box, up = box.translated(0.0, step), up + step
        placed.append(box)
        if abs(right) > 0.5 or abs(up) > 0.5:
            _move(text, right, up)
            moved = True
    return moved


def _move(text, right, up):
    """Move a text by pixels."""
    if hasattr(text, "xyann") and text.anncoords == "offset points":
        per_point = text.figure.dpi / 72
        text.xyann = (text.xyann[0] + right / per_point, text.xyann[1] + up / per_point)
    elif hasattr(text, "xyann"):
        transform = {"data": text.axes.transData, "axes fraction": text.axes.transAxes}[text.anncoords]
        text.xyann = transform.inverted().transform(transform.transform(text.xyann) + (right, up))
    else:
        transform = text.get_transform()
        text.set_position(transform.inverted().transform(transform.transform(text.get_position()) + (right, up)))


#: Width that a chart is drawn for, pixels, and how many pixels of the file are one of these.
WIDE, NARROW = (760, 1.5), (400, 2.0)
#: Ends the names of files for narrow pages.
SUFFIX = "_narrow"


def narrow(file):
    """The name of the file for narrow pages."""
    file = Path(file)
    return file.with_name(f"{file.stem}{SUFFIX}{file.suffix}")


def draw_both(plot, file, comm=Alone):
    """Write a chart (.png) for wide pages, and that for narrow ones beside it, see `narrow`; plot: returns the Figure
    for a `width` in pixels, such as `DrillingHistory.plot`; comm: of the ranks that draw it, of which the first writes.
    """
    drawn = [(Path(file), *WIDE), (narrow(file), *NARROW)]
    figures = [(name, plot(width=width), pixels) for name, width, pixels in drawn]

    def write():
        for name, figure, pixels in figures:
            name.parent.mkdir(parents=True, exist_ok=True)
            _write(figure, name, pixels * figure.dpi)

    on_first(comm, write)
