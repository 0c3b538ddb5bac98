"""Saved results are read: paths and motions as such, of others their quantities."""

import json
from importlib import import_module
from typing import Any

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import File
from cosserat_fenicsx.quantities import Quantities, Quantity
from cosserat_fenicsx.results import saved
from cosserat_fenicsx.results.history import History
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.results.result import Result

# Functions that read a whole result, with their modules above this room, by the class that its file names.
_READERS = {"Path": ("statics.path.recorder", "read_path"), "History": ("dynamics.simulate", "read_history")}


class StoredResult(Result):
    """A result that `read_result` read: its quantities, tables and charts, but no other methods of its class.

    Attributes:
        kind: name of the class of the result. about: {name: value} what it was computed with.
    """

    def __init__(self, head: dict[str, Any], values: dict[str, np.ndarray]):
        self.kind, self.about = head["kind"], head["about"]
        self._head, self._stored = head, values
        self._rows_axis, self._over, self._beside = head["rows_axis"], head["over"], head["beside"]
        self._on_screen = tuple(head["on_screen"])

    @property
    def quantities(self) -> dict[str, Quantity]:
        found = Quantities()
        for said in self._head["quantities"]:
            said = {name: tuple(x) if isinstance(x, list) else x for name, x in said.items()}
            found[said["name"]] = Quantity(**said, getter=lambda result, name=said["name"]: result._stored[name])
        return found

    def __len__(self):
        return self._head["rows"]

    def _about(self):
        return self.about

    def _answer(self, units):
        return self._head["answer"]

    def __repr__(self):
        return f"<StoredResult: {self.kind}, {len(self)} rows, {len(self._stored)} quantities>"


def read_result(file: File, *, comm: MPI.Comm | None = None) -> StoredResult | Path | History:
    """The result that `save` wrote, with the same digits. No code is stored or run.

    Args:
        file: its name.
        comm: MPI communicator of a path or a motion, whose ranks all read the file; default all.

    Returns:
        A `Path` or a `History` with all its methods; of other results a `StoredResult` of their quantities.

    Raises:
        SceneError: it cannot be read, is damaged, holds something else, or is of a newer release.
    """
    with saved.opened(file, "result") as store:
        saved.check_format(file, store.attrs, "result", saved.FORMAT, saved.QUANTITIES)
        if store.attrs["format"] == saved.QUANTITIES:
            head = json.loads(saved.checked(store, "head"))
            values = {said["name"]: saved.checked(store, said["name"]) for said in head["quantities"]}
            if not values:
                raise ValueError("it holds no quantity")
            return StoredResult(head, values)
        module, reader = _READERS[store.attrs["kind"]]
    return getattr(import_module(f"cosserat_fenicsx.{module}"), reader)(file, comm=comm)
