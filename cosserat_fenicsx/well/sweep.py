"""Torque and drag over many depths of the bit, for several operations and coefficients of friction.

Every depth is solved on its own, the rod too: an answer does not depend on those before it, nor on where a sweep was
broken off. Starting from the state at a neighbouring depth saves little: Newton's steps go into finding which nodes of
the mesh touch the wall. On the first mesh they were 21 to 23, and one start of ten failed, at depths 110 m apart, and
13 at 1 to 30 m, where the start by springs takes 24; the finer meshes, which take 60 % of the time, remain the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from cosserat_fenicsx.checks import File, Numbers, finite_array, instance, refuse
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.parts import from_data, members, to_data, use
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.results.result import Charted, by_name
from cosserat_fenicsx.storage.mark import NotMarked, mark_of
from cosserat_fenicsx.storage.store import Kind, Nowhere, Store
from cosserat_fenicsx.well import tables
from cosserat_fenicsx.well.criteria import LockUp
from cosserat_fenicsx.well.components import DrillString
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.pieces import pieces_of, within
from cosserat_fenicsx.well.solve import AUTO, BUCKLED, ROD, SOFT, torque_and_drag

#: Numbers that are kept of an answer; `locked` is where the string locks up, m, or NaN; `model` the index of its model.
KEPT = ("hook_load", "surface_torque", "error", "model_error", "hook_left_out", "torque_left_out", "locked", "model")
_MODELS = (SOFT, BUCKLED, ROD)
KIND = Kind(
    what="sweep", home="well.sweep", call="depth_sweep", again="the same call of depth_sweep continues from there",
    differs="it holds another sweep, expected the same call, or another folder",
)  # fmt: skip
#: Arguments that are parts; the others are plain, but for the operations.
_PARTS = {"hole": Borehole, "string": DrillString, "mud": Mud}
_CASES = ("operation", "friction", "depth")


@dataclass(frozen=True, eq=False, repr=False)
class DepthSweep(Charted):
    """Surface loads over the depth of the bit, from `depth_sweep`; `plot` draws hook load and surface torque over it,
    downwards ("broomstick").

    Attributes:
        operations, depths (m), friction: as asked for; friction is (None,) for the hole's own.
        values: {name: array (operations, friction, depths)} of "hook_load" (N), "surface_torque" (N m), "error",
            "model_error", "hook_left_out" (N) and "torque_left_out" (N m) (see `TorqueAndDrag`), "locked" (m): where
            the string locks up, which leaves the others NaN, and "model", from which `models` follows. NaN: not
            computed yet.
        notes: {(operation, friction, depth): text}, by indices, of the answers to look at: why there is none (the
            string locks up, no equilibrium was found), or why it is not as accurate as asked.
    """

    operations: tuple[Operation, ...]
    depths: np.ndarray
    friction: tuple
    values: dict[str, np.ndarray]
    notes: dict[tuple[int, int, int], str] = field(default_factory=dict)

    #: For messages.
    axis, _rows_axis, _chart = "answer", "depth", "well.charts.sweep_figure"
    _quantities = by_name(
        Quantity("operation", axes=("operation",), getter=lambda x: np.array([one.name for one in x.operations])),
        Quantity("friction", axes=("friction",), getter=lambda x: np.array([_as_text(one) for one in x.friction])),
        Quantity("depth", unit="m", axes=("depth",), getter="depths"),
        Quantity("hook_load", unit="N", axes=_CASES, digits=5),
        Quantity("surface_torque", unit="N m", axes=_CASES, digits=5),
        *(Quantity(name, label, unit, axes=_CASES, getter=lambda x, name=name: x.values[name])
          for name, label, unit in (("error", "estimated relative error of the solution", "1"),
                                    ("model_error", "estimated relative error of the model", "1"),
                                    ("hook_left_out", "estimated error of the model's hook load", "N"),
                                    ("torque_left_out", "estimated error of the model's surface torque", "N m"),
                                    ("locked", "measured depth where it locks up", "m"))),
        Quantity("models", "model", axes=_CASES),
        Quantity("notes", axes=("depth",),
                 getter=lambda x: np.array(["; ".join(x.noted(k)) for k in range(len(x.depths))])),
    )  # fmt: skip

    hook_load = property(lambda self: self.values["hook_load"], doc="(operations, friction, depths) N.")
    surface_torque = property(lambda self: self.values["surface_torque"], doc="(operations, friction, depths) N m.")

    @property
    def done(self) -> np.ndarray:
        """(operations, friction, depths) whether it is computed, or was found to have no answer."""
        found = ~np.isnan(self.hook_load)
        for index in self.notes:
            found[index] = True
        return found

    @property
    def models(self) -> np.ndarray:
        """(operations, friction, depths) what was solved: "soft", "buckled" or "rod"; "" where nothing was."""
        return np.array([*_MODELS, ""])[np.nan_to_num(self.values["model"], nan=len(_MODELS)).astype(int)]

    def __len__(self):
        return int(self.done.sum())

    def label(self, i: int, j: int) -> str:
        """The name of the line of operation i and friction j."""
        friction = "" if self.friction[j] is None else f", {self.friction_in_words(j)}"
        return f"{self.operations[i].name}{friction}"

    def friction_in_words(self, j: int) -> str:
        """The name of the coefficients of friction j."""
        return f"friction {_as_text(self.friction[j]) or 'of the hole'}"

    def noted(self, k: int | None = None, units: str | Mapping | Units = "SI") -> list[str]:
        """The notes in words, with operation, friction and depth; those of depth k alone where it is given."""
        units, found = Units(units), {}  # each sentence once
        lines = [*np.ndindex(self.done.shape[:2])]
        for (*line, at), note in sorted(self.notes.items()):
            if k in (None, at):
                alike = len(lines) > 1 and all(self.notes.get((*other, at)) == note for other in lines)
                who = "" if alike else f"{self.label(*line)}, "
                found[f"{who}bit at {self._told('depth', units, self.depths[at])}: {units.sentence(note)}"] = None
        return [*found]

    def columns(self, units: str | Mapping = "SI", axis: str = "") -> dict[str, np.ndarray]:
        """{heading: (depths,)} of loads and models of each operation and friction, and notes."""
        found, units, known = super().columns(units, axis), Units(units), self.quantities
        if "notes" in found:
            found["notes"] = np.array(["; ".join(self.noted(k, units)) for k in range(len(self.depths))])
        notes = found.pop("notes", None)
        for i in range(len(self.operations)):
            for j in range(len(self.friction)):
                for name in ("hook_load", "surface_torque", "models"):
                    found |= known[name].columns(getattr(self, name)[i, j], units, f"{self.label(i, j)}: ")
        return found if notes is None else found | {"notes": notes}

    def _answer(self, units):
        return tables.sweep_in_words(self, units)

    def _table(self, units, rows):
        return tables.over_depths(self, units, rows)

    def __repr__(self):
        names = ", ".join(operation.name for operation in self.operations)
        return f"DepthSweep({names}; {len(self.depths)} depths; {len(self)} of {self.done.size} answers)"


def _as_text(friction):
    """Coefficients of friction in words; "" for those of the hole."""
    if friction is None:
        return ""
    return f"{friction:g}" if np.ndim(friction) == 0 else ", ".join(f"{x:g}" for x in friction)


def depth_sweep(
    hole: Borehole,
    string: DrillString,
    operations: Sequence[Operation],
    depths: Numbers,
    *,
    mud: Mud | None = None,
    friction: Sequence | None = None,
    model: str = "auto",
    tol: float = 1e-4,
    torque_convention: str = "coulomb",
    folder: File | None = None,
    progress: bool | None = None,
) -> DepthSweep:
    """Hook load and surface torque over the depth of the bit.

    Args:
        operations: one or several. depths: measured depths of the bit, m.
        friction: coefficients to compare, each a number for the whole hole, or one for each of its sections; None for
            those of the hole.
        folder: keeps the answers as they come, as lines of JSON; the same call continues from there. None keeps none.
        progress: True or False; None shows it in runs of more than two seconds.
        hole, string, mud, model, tol, torque_convention: see `torque_and_drag`.

    Returns:
        a `DepthSweep`. Where a string locks up, no equilibrium is found, or parts below the uppermost one stand out
        above the surface, its loads are NaN, and its `notes` say so.

    Raises:
        SceneError: see `torque_and_drag`; a folder that holds another sweep.
        NotStored: the folder can no longer be written to; its `path` is the sweep so far.
        Interrupted: by Ctrl-C; its `path` is the sweep so far.
    """
    operations = (operations,) if isinstance(operations, Operation) else tuple(operations)
    if not operations:
        refuse("depth_sweep", "operations", operations, "at least one operation")
    for operation in operations:
        instance("depth_sweep", "operations", operation, Operation, "operations, such as TripOut()")
    depths = np.atleast_1d(finite_array("depth_sweep", "depths", depths, "measured depths (m)"))
    if not len(depths):
        refuse("depth_sweep", "depths", depths, "at least one measured depth (m)")
    friction = tuple(friction) if isinstance(friction, Sequence | np.ndarray) else (friction,)
    holes = [hole if value is None else hole.with_friction(value) for value in friction]
    settings = {"mud": mud, "model": model, "tol": tol, "torque_convention": torque_convention}
    within(f"depth_sweep: depths[{depths.argmax()}]", hole, float(depths.max()))
    for depth in (min(string.fitting(depths)), depths.max()):  # refuse misfits before the computation
        pieces_of(hole, string, operations[0], mud, float(depth))
    sweep = _empty(operations, depths, friction, string)
    store = Nowhere()
    if folder is not None:
        about = {"hole": hole, "string": string, "operations": operations, "depths": depths, "friction": friction}
        about |= settings
        store = Store(folder, KIND).begin(_mark(about), partial(_as_data, about))
    with store.ending(sweep):
        _put_stored(sweep, store)
        missing = np.argwhere(~sweep.done)
        with Progress([len(missing)], progress, world(), "answer") as bar:
            bar.start("depth sweep")
            for number, (i, j, k) in enumerate(missing.tolist(), start=1):
                found = _answer(holes[j], string, operations[i], float(depths[k]), settings)
                _put(sweep, (i, j, k), *found)
                row = zip((*_CASES, *KEPT, "note"), (i, j, k, *map(float, found[0]), found[1]), strict=True)
                store.keep(dict(row), sweep)
                bar.reached(number)
    return sweep


def go_on(store, scene, duration, progress):
    """`resume` of a sweep; see there."""
    for name, value in (("scene", scene), ("duration", duration)):
        if value is not None:
            refuse("resume", name, value, f"None, since {store.place} holds a sweep")
    return depth_sweep(**_asked(store), folder=store.place, progress=progress)


def read(store, scene):
    """The answers of a sweep that are stored so far."""
    asked = _asked(store)
    sweep = _empty(*(asked[name] for name in ("operations", "depths", "friction", "string")))
    _put_stored(sweep, store)
    return sweep


def _empty(operations, depths, friction, string):
    """A sweep without answers, with notes on the depths at which the string stands out above the surface."""
    shape, fits = (len(operations), len(friction), len(depths)), string.fitting(depths)
    note = f"left out, since the string is {string.least_depth:.6g} m long below its {string.components[-1].name}"
    notes = {(i, j, k): note for i, j, k in np.ndindex(shape) if depths[k] not in fits}
    return DepthSweep(operations, depths, friction, {name: np.full(shape, np.nan) for name in KEPT}, notes)


def _as_data(about):
    """The arguments of `depth_sweep` as data."""
    listed = {
        "operations": [{"is": type(x).__name__, "data": to_data(x)} for x in about["operations"]],
        "depths": about["depths"].tolist(),
        "friction": [np.asarray(x).tolist() for x in about["friction"]],
    }
    return {**about, **{name: about[name] and to_data(about[name]) for name in _PARTS}, **listed}


def _asked(store):
    """The arguments of `depth_sweep` in a folder."""
    data = store.head["scene"]
    if "missing" in data:
        raise SceneError(
            f"{store.place}: it does not hold the arguments ({data['missing']}): expected the same call of "
            "depth_sweep, which continues from there"
        )
    parts = {name: data[name] and from_data(cls, data[name]) for name, cls in _PARTS.items()}
    use([module for x in data["operations"] for module in x["data"].get("use", ())])
    operations = tuple(from_data(members(Operation)[x["is"]], x["data"]) for x in data["operations"])
    return {**data, **parts, "operations": operations, "depths": np.array(data["depths"]),
            "friction": tuple(data["friction"])}  # fmt: skip


def _put_stored(sweep, store):
    for answer in store.lines(lambda row: _answer_in(row, sweep.done.shape)):
        _put(sweep, *answer)


def _mark(about):
    try:
        return {place: found for name, value in about.items() for place, found in mark_of(value, name).items()}
    except NotMarked as problem:
        raise SceneError(
            f"depth_sweep.folder: a {problem} cannot be compared with what the folder holds: expected objects of the "
            "package, or dataclasses of numbers and texts, or no folder"
        ) from None


def _answer_in(row, shape):
    """(indices, numbers, note) of a stored row; ValueError, LookupError or TypeError if it does not fit the shape."""
    place = tuple(row[name] for name in _CASES)
    if not all(type(i) is int and 0 <= i < count for i, count in zip(place, shape, strict=True)):
        raise ValueError(f"{place}: expected indices below {shape}")
    return place, [float(row[name]) for name in KEPT], str(row["note"])


def _put(sweep, place, numbers, note):
    """Put an answer into a sweep, at its indices."""
    for name, number in zip(KEPT, numbers, strict=True):
        sweep.values[name][place] = number
    if note:
        sweep.notes[place] = note


def _answer(hole, string, operation, depth, settings):
    """The numbers of `KEPT`, and a note or ""."""
    try:
        answer = torque_and_drag(hole, string, operation, depth=depth, progress=False, **settings)
        left_out = answer.model_error, *answer.left_out
    except LockUp as locked:
        return tuple(locked.md if name == "locked" else np.nan for name in KEPT), f"locks up at md = {locked.md:.5g} m"
    except NotConverged as failed:
        # an equilibrium that is not as accurate as asked is one
        found, none = getattr(failed, "answer", None), (np.nan,) * len(KEPT)
        rod = float(_MODELS.index(ROD))
        numbers = found and (found.hook_load, found.surface_torque, found.error, *[np.nan] * 4, rod)
        return numbers or none, str(failed)
    notes = [line for line in answer.why if line.startswith("BEYOND")]
    if settings["model"] == AUTO and not answer.enough:
        why = [line for line in answer.why if line.startswith("NOT ENOUGH")]
        why += [] if answer.model == ROD else answer.why[-1:]  # why it is not the rod
        notes += [answer.words, *why]
    numbers = (answer.hook_load, answer.surface_torque, answer.error, *left_out, np.nan)
    return (*numbers, float(_MODELS.index(answer.model))), "; ".join(notes)
