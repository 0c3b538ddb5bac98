"""A sequence of states of a scene: how they are added, looked up, copied and pickled."""

import copy
import pickle
from collections.abc import Sequence
from typing import Self

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.results.result import OnNodes
from cosserat_fenicsx.scene.describe import unpicklable


class States(OnNodes):
    """Base class of `Result` with its list of states. It can be copied and pickled.

    A deep copy shares the scene, so that stations of the scene's rods can be used with both. A loaded pickle has a copy
    of the scene: its stations are those of `result.rod(name)`, or are given by name. It belongs to the one process that
    loaded it.
    """

    #: name of the quantity in `along_axis`; fields in files in addition to `xdmf.FIELDS`
    axis, more_fields = "", {}
    #: whether stability is judged by the number of negative modes
    counts_modes = True
    #: cached properties, which are cleared when a state is added
    _computed = ("_all_rq", "_motion", "_moved")

    def __init__(self, scene, layout, scales, rule, *, comm, model, formulation, degree, unknowns, why, connections,
                 expand):  # fmt: skip
        self.scene, self.layout, self.scales, self.rule, self.comm = scene, layout, scales, rule, comm
        self.model, self.formulation, self.degree, self.unknowns = model, formulation, degree, unknowns
        self.elements, self.why, self._connections = layout.counts, why, connections
        self._expand, self._expanded, self._appended = expand, [], []

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
            why=[*why, *(model.scene.cautions if cls.counts_modes else model.scene.doubts)],
            connections=model.signature.connections,
            expand=model.expansion(),
        )

    def append(self, record):
        """Add a converged state."""
        self._appended.append(record)
        self._forget()

    def _forget(self):
        for name in self._computed:
            self.__dict__.pop(name, None)

    @property
    def _records(self):
        """All records, expanded to three dimensions."""
        if self._appended:
            new, self._appended = self._appended, []
            gauss = None if new[0].gauss_fields is None else np.array([x.gauss_fields for x in new])
            load_factors = np.array([x.load_factor for x in new])
            rq, fields = self._expand(load_factors, np.array([x.rq for x in new]), gauss)
            for x, x.rq, x.gauss_fields in zip(new, rq, fields, strict=True):
                self._expanded.append(x)
        return self._expanded

    def __len__(self) -> int:
        return len(self._expanded) + len(self._appended)

    def __getitem__(self, k: int | slice) -> Self:
        """State k, or the states of a slice: a result of the same kind with these states alone, in SI units as ever.

        `at_points` takes a list of indices. Neither has events.

        Raises:
            IndexError: there is no state k.
            SceneError: k is no whole number.
        """
        if isinstance(k, slice):
            return self.at_points(list(range(len(self))[k]))
        return self.at_points([self._index(k, f"[{k!r}]")])

    def at_points(self, which: Sequence[int] | np.ndarray) -> Self:
        """The result with some of its states only.

        Args:
            which: their indices.

        Raises:
            IndexError, SceneError: as of `result[k]`.
        """
        return self._with(self._taken([self._index(k, f"at_points([{k!r}])") for k in which]))

    def _index(self, k, where):
        """The index k of a state, checked; `where` for messages."""
        expected = f"expected the index of a {self.axis}, a whole number from {-len(self)} to {len(self) - 1}"
        if isinstance(k, bool | np.bool_) or not hasattr(k, "__index__"):
            raise SceneError(f"{where}: {expected}")
        if not -len(self) <= k < len(self):
            raise IndexError(f"{where}: {expected}")
        return k

    def _taken(self, which):
        """What `_expanded` of a result with the states `which` is."""
        return [self._records[k] for k in which]

    def _with(self, expanded):
        """A copy with other states, already expanded."""
        part = object.__new__(type(self))
        vars(part).update(vars(self))
        part._forget()
        part._expanded, part._appended = expanded, []
        return part

    def _array(self, name):
        return np.array([getattr(record, name) for record in (*self._expanded, *self._appended)])

    def _stacked(self, name):
        """(states, ..) arrays of all records."""
        return np.array([getattr(record, name) for record in self._records])

    @property
    def iterations(self) -> np.ndarray:
        """(n,) Newton iterations since the previous state, rejected steps included."""
        return self._array("iterations").astype(int)

    @property
    def along_axis(self) -> np.ndarray:
        """(n,) the load factor or the time (s) of each state."""
        raise NotImplementedError

    def label(self, k: int) -> str:
        """The label of state k in pictures."""
        raise NotImplementedError

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
                f"a {type(self).__name__} cannot be pickled where its scene cannot: {names}. Functions must have a "
                "name at the top of a module to be found by: expected no lambda and no function within a function"
            )
        plain = vars(copy.copy(self))
        return {name: value for name, value in plain.items() if name not in ("comm", "_expand", "_rest")}

    def __setstate__(self, state):
        vars(self).update(state, comm=MPI.COMM_SELF, _expand=None)
