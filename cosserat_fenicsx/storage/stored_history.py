"""A `History` whose states are stored in a file, written as they are saved and read on demand."""

import numpy as np

from cosserat_fenicsx.element import ElementRule
from cosserat_fenicsx.errors import NotStored
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.results.history import History, Instant
from cosserat_fenicsx.storage.instantfile import InstantFile


class StoredHistory(History):
    """A `History` that keeps no states in memory. Rank 0 writes them, all ranks read them.

    Attributes:
        folder: the `pathlib.Path` of the folder with the file.
    """

    _computed = ()

    def told(self):
        """Its attributes other than scene and states, as a dict that `json` can store."""
        rule = {name: getattr(self.rule, name).tolist() for name in ("nodes", "gauss", "weights")}
        names = ("model", "degree", "unknowns", "why", "scheme")
        return {name: getattr(self, name) for name in names} | {"time_unit": self._time_unit, "rule": rule}

    @classmethod
    def as_told(cls, told, scene, layout, scales, comm, connections, expand=None):
        """A `StoredHistory` from the dict of `told`; `expand`: the model's expansion, if states will be appended."""
        rule = ElementRule(**{name: np.array(values) for name, values in told["rule"].items()})
        history = cls(scene, layout, scales, rule, comm=comm, model=told["model"], formulation="displacement",
                      degree=told["degree"], unknowns=told["unknowns"], why=told["why"], connections=connections,
                      expand=expand)  # fmt: skip
        history.scheme, history._time_unit = told["scheme"], told["time_unit"]
        return history

    def keep_in(self, folder):
        """Set the folder of the states, and return the history.

        Args:
            folder: a `pathlib.Path`; states that are already in it belong to the history.

        Raises:
            SceneError: these are the states of other rods, or on another mesh.
        """
        self.folder, self._file, self._done = folder, InstantFile(folder / "instants.npy"), 0
        cells, rule = sum(self.elements), self.rule
        nodes = cells * self.degree + len(self.elements)
        self._file.expect(rq=(nodes, 7), rates=(nodes, 6), gauss_fields=(cells, len(rule.gauss), 9))
        return self

    def go_on_after(self, count):
        """Continue after the first `count` states; later ones in the file remain until they are overwritten.

        A resumed motion reproduces them digit by digit.
        """
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
        """Flush the states so far to the disk, then call `write()`, so that both survive a crash.

        Raises:
            NotStored: it cannot be written.
        """
        self._try(lambda: (self._file.settle(), write()), "the state from which a motion resumes")

    def sound(self, states):
        """Whether the first states are those that a checkpoint tells of: a dict of their number and their checksum, or
        None in checkpoints of releases before there was one. The same on all ranks.
        """
        sound = states is None or (
            states["rows"] <= len(self)
            and (self.comm.rank > 0 or self._file.checksum(states["rows"]) == states["crc32"])
        )
        return self.comm.bcast(sound)

    def states(self):
        """The number of the states so far and their checksum, for a checkpoint. On rank 0."""
        return {"rows": self._done, "crc32": self._file.checksum(self._done)}

    def _try(self, action, what):
        try:
            on_first(self.comm, action)
        except OSError as problem:
            until = f"the states up to t = {self.times[-1]:.6g} s are" if len(self) else "nothing is"
            raise NotStored(
                f"{self.folder}: {what} cannot be written: {problem.strerror or problem}. Make room; {until} kept "
                f"there, and cosserat_fenicsx.resume({str(self.folder)!r}), or `cosserat resume {self.folder}`, "
                "continues the motion",
                self,
            ) from None

    def at_points(self, which):
        """A `History` in memory of the states at the indices `which`."""
        part = History.__new__(History)
        mine = {name: value for name, value in vars(self).items() if name not in ("folder", "_file", "_done")}
        vars(part).update(
            mine, _expanded=[self._records[self._index(k, f"at_points([{k!r}])")] for k in which], _appended=[]
        )
        return part

    def __copy__(self):
        return self._with([])

    def __getstate__(self):
        """Pickle the folder instead of the states, which are read from there again."""
        return {**super().__getstate__(), "folder": self.folder.resolve()}

    @property
    def _records(self):
        return self._file

    def __len__(self):
        return len(self._file)

    def _array(self, name):
        return np.array(self._file.rows[name]) if len(self) else np.empty(0)

    _booked = _array
    _stacked = property(lambda self: self._file.rows.__getitem__)
    _all_rq = property(lambda self: self._column("rq", 7))
    _all_rates = property(lambda self: self._column("rates", 6))
    _all_gauss = property(lambda self: self._file.rows["gauss_fields"])

    def _column(self, name, size):
        return self._file.rows[name] if len(self) else np.empty((0, len(self._rest), size))
