"""A `History` whose states are stored in a file, written as they are saved and read on demand."""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import ElementRule
from cosserat_fenicsx.results.history import History
from cosserat_fenicsx.results.records import Instant, Ledger, Records
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.storage.store import Kind

#: Scalars of an `Instant` by their types in the file, and its arrays; the fields of its `Ledger` follow.
_OF_INSTANT = {"time": "<f8", "load_factor": "<f8", "steps": "<i8", "iterations": "<i8"}
_ARRAYS = ("rq", "rates", "gauss_fields", "reactions", "tie_forces", "clamp_forces", "wall_forces", "far_ends")
KIND = Kind(
    what="motion", home="dynamics.simulate", call="simulate", differs="the scene is not the one of the motion",
    again="cosserat_fenicsx.resume({place!r}), or `cosserat resume {quoted}`, continues it", tables=("instants",),
    each_rank=True, starts=True, rounding=1e-9, scene=Scene,
)  # fmt: skip


class StoredHistory(History):
    """A `History` that keeps no states in memory: rank 0 writes them to a folder, all ranks read them."""

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

    def keep_in(self, store):
        """Set the `Store` of the states, and return the history; stored states of other rods or meshes are refused."""
        self.folder, self._store, self._file = store.place, store, store.table("instants", are_instants)
        cells, rule, dtype = sum(self.elements), self.rule, self._file.dtype[0]
        nodes = cells * self.degree + len(self.elements)
        shapes = {"rq": (nodes, 7), "rates": (nodes, 6), "gauss_fields": (cells, len(rule.gauss), 9)}
        for name, shape in shapes.items() if dtype is not None else ():
            if dtype[name].shape != shape:
                raise SceneError(f"{self._file.file}: {name} has the shape {dtype[name].shape}: expected {shape}")
        return self

    def append(self, record):
        """Add a saved state; NotStored where it cannot be written."""
        rq, gauss = self._expand(np.array([record.load_factor]), record.rq[None], record.gauss_fields[None])
        whole = {**vars(record), **record.ledger._asdict(), "rq": rq[0], "gauss_fields": gauss[0]}
        names = (*_OF_INSTANT, *Ledger._fields, *_ARRAYS)
        row = np.zeros(1, [(name, _OF_INSTANT.get(name, "<f8"), np.shape(whole[name])) for name in names])
        for name in names:
            row[name] = whole[name]
        self._store.put(self, f"the state at t = {record.time:.6g} s", instants=row)

    def at_points(self, which):
        """A `History` in memory of the states at the indices `which`."""
        part = History.__new__(History)
        mine = {name: value for name, value in vars(self).items() if name not in ("folder", "_file", "_store")}
        taken = [self._records[self._index(k, f"at_points([{k!r}])")] for k in which]
        vars(part).update(mine, _expanded=Records.of(taken) if taken else None, _appended=[])
        return part

    def __copy__(self):
        return self._with(None)

    def __getstate__(self):
        """Pickle the folder instead of the states, which are read from there again."""
        return {**super().__getstate__(), "folder": self.folder.resolve(), "_store": None}

    @property
    def _records(self):
        return Instants(self._file)

    def __len__(self):
        return len(self._file)

    def _array(self, name):
        return np.array(self._file.rows[name]) if len(self) else np.empty(0)

    _booked = _array
    _stacked = property(lambda self: self._file.rows.__getitem__)


class Instants:
    """The rows of a `Table` as a sequence of `Instant`s."""

    def __init__(self, table):
        self._table = table

    def __len__(self):
        return len(self._table)

    def __getitem__(self, k):
        row = self._table.rows[k]
        more = {name: row[name].item() for name in _OF_INSTANT}
        more |= {name: np.array(row[name]) for name in _ARRAYS}
        ledger = Ledger(*(np.array(row[name]) if row[name].ndim else row[name].item() for name in Ledger._fields))
        return Instant(rq=more.pop("rq"), negative_modes=0, ledger=ledger, **more)

    def __iter__(self):
        return (self[k] for k in range(len(self)))


def are_instants(dtype, shape):
    """Whether a dtype and a shape of rows are those of saved states."""
    expected = {**_OF_INSTANT, **dict.fromkeys((*Ledger._fields, *_ARRAYS), "<f8")}
    return not shape and dtype.names is not None and {x: dtype[x].base.str for x in dtype.names} == expected
