"""Charts of matplotlib as files."""

import io
from pathlib import Path

from cosserat_fenicsx.results.export.beside import replaced


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
