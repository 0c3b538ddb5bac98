"""Results that are read from files of quantities."""

import json
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import File
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Quantities, Quantity
from cosserat_fenicsx.results.export import saved
from cosserat_fenicsx.results.result import Result


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


def read_result(file: File) -> StoredResult:
    """The quantities of a result that `save` wrote, with the same digits. No code is stored or run.

    Files of `Path.save` and `History.save` are read by `read_path` and `read_history`.

    Raises:
        SceneError: it cannot be read, is damaged, holds something else, or is of a newer release.
    """
    with saved.opened(file, "result") as store:
        if store.attrs.get("format") != saved.QUANTITIES:
            reader = {"Path": "read_path", "History": "read_history"}.get(store.attrs.get("kind"), "another function")
            raise SceneError(f"{file}: expected a file that `save` of another result wrote, or {reader} to read it")
        if store.attrs["version"] > saved.VERSION:
            raise SceneError(f"{file}: its format is {store.attrs['version']}, and this release reads {saved.VERSION}")
        head = json.loads(saved.checked(store, "head"))
        found = StoredResult(head, {said["name"]: saved.checked(store, said["name"]) for said in head["quantities"]})
        if not found.quantities:
            raise ValueError("it holds no quantity")
        return found
