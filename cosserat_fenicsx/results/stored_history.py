"""A `History` whose states lie in a file, written as they come and read as they are asked for."""

import numpy as np

from cosserat_fenicsx.element import ElementRule
from cosserat_fenicsx.errors import NotStored
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.results.history import History, Instant
from cosserat_fenicsx.storage.instantfile import InstantFile


class StoredHistory(History):
    """See `History`; of its states none stays in memory. The first rank writes them, all ranks read them.

    Attributes:
        folder: where it lies, a `pathlib.Path`.
    """

    _computed = ()

    def told(self):
        """What it says of itself beside the scene, in words and numbers that `json` keeps."""
        rule = {name: getattr(self.rule, name).tolist() for name in ("nodes", "gauss", "weights")}
        names = ("model", "degree", "unknowns", "why", "scheme")
        return {name: getattr(self, name) for name in names} | {"time_unit": self._time_unit, "rule": rule}

    @classmethod
    def as_told(cls, told, scene, layout, scales, comm, expand=None):
        """One that is `told` again, for the scene; `expand` as of a model, where states are still to come."""
        rule = ElementRule(**{name: np.array(values) for name, values in told["rule"].items()})
        history = cls(scene, layout, scales, rule, comm=comm, rounding=0.0, model=told["model"], formulation="displacement",
                      degree=told["degree"], unknowns=told["unknowns"], why=told["why"], expand=expand)  # fmt: skip
        history.scheme, history._time_unit = told["scheme"], told["time_unit"]
        return history

    def keep_in(self, folder):
        """Where the states lie.

        Args:
            folder: a `pathlib.Path`; what is in it already counts.
        """
        self.folder, self._file, self._done = folder, InstantFile(folder / "instants.npy"), 0
        return self

    def go_on_after(self, count):
        """So many states were saved before what is appended from now on; those that are there beyond stay until they are
        written anew, with the same digits."""
        self._done = count

    def append(self, record):
        """Add a saved state.

        Raises:
            NotStored: it cannot be written.
        """
        rq, gauss = self._expand(np.array([record.load_factor]), record.rq[None], record.gauss_fields[None])
        whole = Instant(**{**vars(record), "rq": rq[0], "gauss_fields": gauss[0]})
        self._try(lambda: self._file.put(self._done, whole), f"the state at t = {record.time:.6g} s")
        self._done += 1
        self._file.look()

    def settle(self, write):
        """Have the states so far, and then what `write()` writes, outlive whatever happens.

        Raises:
            NotStored: it cannot be written.
        """
        self._try(lambda: (self._file.settle(), write()), "what a resumed motion goes on from")

    def _try(self, action, what):
        try:
            on_first(self.comm, action)
        except OSError as problem:
            until = f"the states up to t = {self.times[-1]:.6g} s are" if len(self) else "nothing is"
            raise NotStored(
                f"{self.folder}: {what} cannot be written: {problem.strerror or problem}. Make room; {until} kept there, "
                f"and cosserat_fenicsx.resume({str(self.folder)!r}), or `cosserat resume {self.folder}`, goes on with it",
                self,
            ) from None

    def at_points(self, which):
        """The history of some of its times alone, in memory."""
        part = History.__new__(History)
        vars(part).update(vars(self))
        part._expanded, part._appended = [self[k] for k in which], []
        return part

    @property
    def _records(self):
        return self._file

    def __len__(self):
        return len(self._file)

    def _array(self, name):
        return np.array(self._file.rows[name]) if len(self) else np.empty(0)

    _booked = _array
    _all_rq = property(lambda self: self._column("rq", 7))
    _all_rates = property(lambda self: self._column("rates", 6))
    _all_gauss = property(lambda self: self._file.rows["gauss_fields"])

    def _column(self, name, size):
        return self._file.rows[name] if len(self) else np.empty((0, len(self._rest), size))
