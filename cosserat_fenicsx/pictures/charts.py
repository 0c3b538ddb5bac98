"""Charts of matplotlib as files."""

import io
from pathlib import Path

from cosserat_fenicsx.errors import LibraryMissing, SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.ranks import on_first

#: Colours and styles of lines, in their order; of what is not the subject.
COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown", "tab:pink", "tab:gray")
STYLES = ("-", "--", ":", "-.")
GREY = "0.45"


def empty_figure(width, height):
    """A Figure (inches) that needs no screen.

    Raises:
        SceneError: matplotlib is missing.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise LibraryMissing(
            "charts need matplotlib: pip install 'cosserat-fenicsx[pictures]', or pip install matplotlib"
        ) from None
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def draw_chart(make, file, comm):
    """The Figure that `make` returns; or None where a file is given, which rank 0 writes.

    Raises:
        SceneError: the file's ending is unknown to matplotlib; or `make` raised it.
        OSError: the file cannot be written.
    """
    if file is None:
        return make()
    on_first(comm, lambda: _write(make(), Path(file)))
    return None


def _write(figure, file):
    known = figure.canvas.get_supported_filetypes()
    if file.suffix.removeprefix(".") not in known:
        raise SceneError(f"{file}: expected a name that ends in .{', .'.join(sorted(known))}")
    save(figure, file)


def save(figure, file):
    """Write a Figure at 150 dots per inch, in the format of the file's ending.

    It is complete in memory first: a full disk leads matplotlib to other exceptions than OSError.

    Raises:
        OSError: the file cannot be written.
    """
    picture = io.BytesIO()
    figure.savefig(picture, format=Path(file).suffix[1:] or "png", dpi=150)
    with replaced(file) as fresh:
        fresh.write_bytes(picture.getvalue())
