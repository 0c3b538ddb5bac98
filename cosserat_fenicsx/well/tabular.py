"""What answers and sweeps share: their table as a .csv file, and as a DataFrame."""

import csv
import math
from pathlib import Path
from typing import Any

from cosserat_fenicsx.checks import File
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.results.result import import_library, plain_text


class Tabular:
    """Base of results with a table: `_tables` gives {ending of the file's name: {heading: values}}, the first of which
    is the table itself."""

    def write(self, file: File) -> None:
        """Write the table as a .csv file, in SI but for angles, which are in degrees. Of a `TorqueAndDrag` it has a row
        for every place along the string, and the forces on the wall are written beside it: for "out.csv" in
        "out_contacts.csv". Of a `DepthSweep` it has a row for every depth. Rank 0 writes.

        Raises:
            SceneError: the name does not end in .csv.
            OSError: it cannot be written.
        """
        file = Path(file)
        if file.suffix.lower() != ".csv":
            raise SceneError(f"{file}: expected a name that ends in .csv")
        for ending, columns in self._tables().items():
            _write(file.with_name(f"{file.stem}{ending}{file.suffix}"), columns)

    def to_dataframe(self) -> Any:
        """A pandas DataFrame with the columns of the .csv file of `write`.

        Raises:
            InstallationError: pandas is missing.
        """
        pandas = import_library("pandas", "to_dataframe")
        return pandas.DataFrame(next(iter(self._tables().values())))

    def _tables(self):
        raise NotImplementedError


def _write(file, columns):
    def written():
        with replaced(file) as fresh, open(fresh, "w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(map(plain_text, columns))
            writer.writerows(map(_row, zip(*columns.values(), strict=True)))

    on_first(world(), written)


def _row(values):
    """Texts of a row; empty for what is not known."""
    return [plain_text(x) if isinstance(x, str) else "" if math.isnan(x) else f"{x:.9g}" for x in values]
