"""A chart drawn twice: for pages on a large screen, and for those of 400 pixels, as on a telephone."""

from pathlib import Path

from mpi4py import MPI

#: Width that a chart is drawn for, pixels, and how many pixels of the file are one of these.
WIDE, NARROW = (760, 1.5), (400, 2.0)
#: Ends the names of files for narrow pages.
SUFFIX = "_narrow"


def narrow(file):
    """The name of the file for narrow pages."""
    file = Path(file)
    return file.with_name(f"{file.stem}{SUFFIX}{file.suffix}")


def draw_both(plot, file):
    """Write a chart for wide pages, and that for narrow ones beside it, see `narrow`; rank 0 writes.

    Args:
        plot: returns the Figure for a `width` in pixels, such as `DrillingHistory.plot`.
        file: .png.
    """
    for name, (width, pixels) in ((Path(file), WIDE), (narrow(file), NARROW)):
        figure = plot(width=width)
        if MPI.COMM_WORLD.rank == 0:
            name.parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(name, dpi=pixels * figure.dpi)
