"""A chart drawn twice: for pages on a large screen, and for those of 400 pixels, as on a telephone."""

from pathlib import Path

from cosserat_fenicsx.ranks import Alone, on_first

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
            figure.savefig(name, dpi=pixels * figure.dpi)

    on_first(comm, write)
