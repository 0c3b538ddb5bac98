"""A sequence of states of a scene: how they are added, looked up, copied and pickled."""

import copy
import itertools
import pickle
from collections.abc import Sequence
from functools import cached_property
from typing import Self

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.results.records import Records
from cosserat_fenicsx.results.result import OnNodes
from cosserat_fenicsx.scene.action import unpicklable


class States(OnNodes):
    """Base class of `Result` with its list of states. It can be copied and pickled. Subclasses have `along_axis`, (n,)
    the load factor or the time (s) of each state, and `label(k)`, the label of state k in pictures.

    A deep copy shares the scene, so that stations of the scene's rods can be used with both. A loaded pickle has a copy
    of the scene: stations are taken from `result.rod(name)`, or given by name. It belongs to the one process that
    loaded it.
    """

    #: name of the quantity in `along_axis`; fields in files in addition to `xdmf.FIELDS`
    axis, more_fields = "", {}
    #: whether stability is judged by the number of negative modes
    counts_modes = True
    #: what messages call one of the states
    counted = property(lambda self: self.axis)
    #: cached properties, which are cleared when a state is added
    _computed = ("_records", "_motion")

    def __init__(self, scene, layout, scales, rule, *, comm, model, formulation, degree, unknowns, why, connections,
                 expand):  # fmt: skip
        self.scene, self.layout, self.scales, self.rule, self.comm = scene, layout, scales, rule, comm
        self.model, self.formulation, self.degree, self.unknowns = model, formulation, degree, unknowns
        self.elements, self.why, self._connections = layout.counts, why, connections
        self._expand, self._appended = expand, []
        self._expanded: Records | None = None

    @classmethod
    def of(cls, model, formulation, why=()):
        """An empty result for the scene that a model was loaded with; `why`: sentences on the choice of the model."""
        return cls(
            model.scene,
            model.layout,
            model.scales,
            model.rule,
            comm=model.comm,
            model=model.name,
            formulation=formulation,
            degree=model.signature.degree,
            unknowns=model.unknowns,
            why=[*why, *(model.scene.cautions if cls.counts_modes else model.scene.doubts), *model.scene.by_default],
            connections=model.signature.connections,
            expand=model.expansion(),
        )

    def share_of(self, load, k):
        """The factor of a load in state k."""
        return float(self.along_axis[k]) if load.scaled and self.axis != "time" else 1.0

    def place_of(self, k):
        """Where state k is on the path or in time, in words: "load factor 0.5", "time 0.001 s"."""
        return f"{self.axis} {self.along_axis[k]:.6g}{' s' * (self.axis == 'time')}"

    def supports_at(self, k):
        """The supports that hold in state k."""
        return self.scene.supports

    def append(self, record):
        """Add a converged state."""
        self.extend(record)

    def extend(self, records):
        """Add converged states at once: `Records`, whose `rq` and `gauss_fields` are of the form that a `Record` that
        is appended has."""
        self._appended.append(records)
        self._forget()

    def _forget(self):
        for name in self._computed:
            self.__dict__.pop(name, None)

    @property
    def _all(self):
        """The `Records` of all states, expanded to three dimensions; None where there is none."""
        if self._appended:
            kinds = itertools.groupby(self._appended, key=lambda x: isinstance(x, Records))
            parts = (part if whole else [Records.of(list(part))] for whole, part in kinds)
            new, self._appended = Records.joined([*itertools.chain.from_iterable(parts)]), []
            load_factors = np.array(new["load_factor"], dtype=float)
            rq, gauss_fields = self._expand(load_factors, new["rq"], new["gauss_fields"])
            new = Records(new.kind, new.columns | {"rq": rq, "gauss_fields": gauss_fields})
            self._expanded = new if self._expanded is None else Records.joined([self._expanded, new])
        return self._expanded

    @cached_property
    def _records(self):
        """A list of all records, expanded to three dimensions."""
        return [] if self._all is None else self._all.listed()

    def __len__(self) -> int:
        first = 0 if self._expanded is None else len(self._expanded)
        return first + sum(len(x) if isinstance(x, Records) else 1 for x in self._appended)

    def __getitem__(self, k: int | slice) -> Self:
        """State k, or the states of a slice: a result of the same kind with these states alone, in SI units as ever.

        `at_points` takes a list of indices. Neither has events. Raises IndexError: there is no state k; SceneError: k
        is no whole number."""
        if isinstance(k, slice):
            return self.at_points(list(range(len(self))[k]))
        return self.at_points([self._index(k, "[{!r}]")])

    def at_points(self, which: Sequence[int] | np.ndarray) -> Self:
        """The result with some of its states only.

        Args:
            which: their indices.

        Raises:
            IndexError, SceneError: as of `result[k]`.
        """
        return self._with(self._taken([self._index(k, "at_points([{!r}])") for k in which]))

    def _index(self, k, where):
        """The index k of a state, checked; `where` for messages, with {!r} for k."""
        count, whole = len(self), hasattr(k, "__index__") and not isinstance(k, bool | np.bool_) and not np.ndim(k)
        if whole and -count <= k < count:
            return k
        expected = f"expected the index of a {self.counted}, a whole number from {-count} to {count - 1}"
        raise (IndexError if whole else SceneError)(f"{where.replace('{!r}', repr(k))}: {expected}")

    def _taken(self, which):
        """The `_expanded` of a result with the states `which` alone."""
        return None if self._all is None else self._all.at(which)

    def _with(self, expanded):
        """A copy with other states, already expanded."""
        part = object.__new__(type(self))
        vars(part).update(vars(self))
        part._forget()
        part._expanded, part._appended = expanded, []
        return part

    def _array(self, name):
        """(states,) numbers of all states, which need not be expanded for it."""
        parts = [*([] if self._expanded is None else [self._expanded]), *self._appended]
        columns = (x[name] if isinstance(x, Records) else [getattr(x, name)] for x in parts)
        return np.concatenate([np.empty(0), *columns])

    def _stacked(self, name):
        """(states, ..) arrays of all states; None where they have none."""
        return self._all[name]

    @property
    def steps(self) -> np.ndarray:
        """(n,) number of steps since the start, see the class."""
        return self._array("steps").astype(int)

    @property
    def iterations(self) -> np.ndarray:
        """(n,) Newton iterations since the previous state, rejected steps included."""
        return self._array("iterations").astype(int)

    # -- copies ------------------------------------------------------------------------------------------------------

    def __copy__(self):
        return self._with(self._taken(range(len(self))))

    def __deepcopy__(self, memo):
        memo |= {id(shared): shared for shared in (self.scene, self.comm)}
        other = memo[id(self)] = copy.copy(self)
        vars(other).update({name: copy.deepcopy(value, memo) for name, value in vars(other).items()})
        return other

    def __getstate__(self):
        """Plain data, without the communicator, and without the model's expansion, since all states are expanded."""
        names = unpicklable(self.scene)
        if names:
            raise pickle.PicklingError(
                f"a {type(self).__name__} cannot be pickled where its scene cannot: {names}. Functions must be defined "
                "at module level: expected no lambda and no nested function"
            )
        plain = vars(copy.copy(self))
        return {name: value for name, value in plain.items() if name not in ("comm", "_expand", "_rest")}

    def __setstate__(self, state):
        vars(self).update(state, comm=MPI.COMM_SELF, _expand=None)
