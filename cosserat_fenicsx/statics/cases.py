"""`compile`: a scene whose numbers change from case to case, prepared once for many equilibria.

The equilibrium at one load factor is found as `solve` finds it where two meshes suffice: a sweep of the load factor on
the first mesh, Newton's method on the one of elements half as long, and an error estimate from both. The problems of
both meshes stay loaded. In fixed units the numbers that C reads are linear functions of the loads, found once from
several scenes; those of the law follow from the sections and materials of the cases. Where neither describes a scene
exactly, each case is loaded by itself. Cases that cannot be decided this way are solved by `solve`.
"""

import itertools
import threading
import uuid
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from cosserat_fenicsx.algebra.pool import release
from cosserat_fenicsx.checks import number
from cosserat_fenicsx.errors import NotConverged, SceneError, nearest
from cosserat_fenicsx.models.base import Scales
from cosserat_fenicsx.models.signature import Signature, choose
from cosserat_fenicsx.models.formulation import formulation_of
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.compared import NAMES
from cosserat_fenicsx.scene.action import path_dependent
from cosserat_fenicsx.scene.parameters import admitted_laws, check_once, laws_with, parameter_of, scene_with
from cosserat_fenicsx.scene.scene import Scene, check_tensions
from cosserat_fenicsx.statics.meshes import meshes_for, resolving_turns, turning_in_law
from cosserat_fenicsx.statics.pair import Loaded, Pair
from cosserat_fenicsx.statics.path.recorder import CORRECTIONS, NEAR
from cosserat_fenicsx.statics.problem import check_arguments, make_solvers
from cosserat_fenicsx.statics.solve import solve

#: What a case may be asked for: {name of a method of `Path`: the estimated error that bounds its own}.
QUERIES = {"position": "position", "displacement": "position", "rotation_angle": "rotation", "force": "force",
           "moment": "moment"}  # fmt: skip
_DEGREE = 4  # the default of `solve`
# Changes of the parameters, over their sizes, of the scenes by which the dependence of the data is found and checked.
_BESIDE, _APART, _CHECK = 0.043, 0.25, -0.117
_BLOCK = 256  # cases that are solved at once
_SERVED = 1000  # cases after which several are solved in lock step, whose kernels take seconds to compile once
# Most numbers of sections and materials of which all corners of a box are looked at, and largest relative difference of
# stiffnesses by formulas for many cases.
_MOST_CORNERS, _SAME = 6, 1e-14


@dataclass(frozen=True, eq=False)
class Cases:
    """The answers of `CompiledScene.batch`, or of one case, without the first axis then.

    Attributes:
        values: (cases, queries) SI units, the components of vectors inertial; NaN where there is no equilibrium.
        errors: (cases, queries) estimated errors of the values, in the same units.
        by_solve: (cases,) of bool: which went to `solve`.
        failures: {index of a case: why it has no equilibrium}.
    """

    values: np.ndarray
    errors: np.ndarray
    by_solve: np.ndarray
    failures: dict = field(default_factory=dict)


def compile(  # noqa: A001  public as cf.compile
    scene: Scene,
    over: Sequence[str],
    query: Sequence[tuple],
    *,
    load_factor: float = 1.0,
    tol: float = 1e-6,
) -> "CompiledScene":
    """Prepare a scene for many equilibria that differ in some of its numbers.

    Args:
        scene: a `Scene`.
        over: names of the numbers that change, "rods.column.section.diameter", "loads[0].force[2]"; see `Parameter`.
            Numbers of loads, and of the sections and materials of uniform rods, are the fastest.
        query: what is asked of every equilibrium: tuples (name, station) or (name, station, component), with the names
            "position", "displacement" (m), "rotation_angle" (rad), "force" (N) and "moment" (N m) of the methods of
            `Path`, and the component 0, 1 or 2 of vectors, inertial.
        load_factor: of the equilibrium, not 0.
        tol: largest estimated error, as of `solve`.

    Returns:
        CompiledScene, a function of the values.

    Raises:
        SceneError: an unknown name (the message names the nearest), or an argument outside its range.
    """
    check_arguments(scene, tol, None, owner="compile")
    number("compile", "load_factor", load_factor, "a finite number other than 0", lambda x: 0 < abs(x) < np.inf)
    check_tensions(scene, [load_factor])
    names = [over] if isinstance(over, str) else list(over)
    for name in names:
        if not isinstance(name, str):
            raise SceneError(f"compile: over holds {name!r}: expected names such as 'rods.column.section.diameter'")
    if not names:
        raise SceneError("compile: over is empty: expected at least one name of a number")
    check_once(scene, names)
    queries = [Query.of(scene, x) for x in query]
    if not queries:
        raise SceneError("compile: query is empty: expected tuples such as ('displacement', 'rod.end', 0)")
    return CompiledScene(scene, names, queries, float(load_factor), tol)


@dataclass(frozen=True)
class Query:
    """What is asked of every case: a method of `Path`, at a share of the length of a rod, and a component or None."""

    name: str
    rod: int
    share: float
    component: int | None
    label: str

    @property
    def kind(self):
        """The estimated error that bounds its own."""
        return QUERIES[self.name]

    @classmethod
    def of(cls, scene, given):
        if not isinstance(given, tuple) or len(given) not in (2, 3):
            raise SceneError(f"compile: query holds {given!r}: expected tuples such as ('displacement', 'rod.end', 0)")
        name, station, component = given[0], given[1], given[2] if len(given) == 3 else None
        if name not in QUERIES:
            raise SceneError(f"compile: query {name!r}: {nearest(name, QUERIES)}")
        scalar = name == "rotation_angle"
        if (component is not None) if scalar else (component not in (0, 1, 2)):
            raise SceneError(
                f"compile: query {given!r}: expected {'no component' if scalar else 'a component, 0 to 2'}"
            )
        station = scene.station(station) if isinstance(station, str) else station
        if getattr(station, "rod", None) not in scene.rods:
            raise SceneError(f"compile: query {given!r}: expected a station of the scene, or its name")
        label = f"{name} {station}" if component is None else f"{name} {station} {'xyz'[component]}"
        return cls(name, scene.number(station.rod), station.s / station.rod.length, component, label)

    def on(self, path):
        """(points,) values and (points,) estimated errors."""
        rod = path.scene.rods[self.rod]
        station = rod.end if self.share == 1 else rod.at(self.share * rod.length)
        values = getattr(path, self.name)(station)
        k = NAMES.index(self.kind)
        unit = (path.scales.length, 1.0, path.scales.force, path.scales.moment)[k]
        return values if self.component is None else values[:, self.component], path._errors[k] * (
            path._reference.sizes[k] * unit
        )


@dataclass(frozen=True, eq=False)
class CasesTask:
    """The task of `study` that solves the cases of a compiled scene: pickle takes it, and it can be compared."""

    scene: Scene
    names: tuple[str, ...]
    queries: tuple[Query, ...]
    load_factor: float
    tol: float

    @cached_property
    def compiled(self):
        """The `CompiledScene` of this process."""
        return CompiledScene(*(getattr(self, x.name) for x in fields(self)))

    @cached_property
    def _token(self):
        return uuid.uuid4().hex

    def __reduce__(self):
        return _known_task, (self._token, *(getattr(self, x.name) for x in fields(self)))

    @property
    def units(self):
        """{name of a parameter or of a result: its unit}."""
        found = {name: parameter_of(self.scene, name).unit for name in self.names}
        return found | {f"{what}{x.label}": _UNITS[x.kind] for x in self.queries for what in ("", _ERROR_OF)}

    def many(self, cases):
        """Of each case {label of a query: value, and "error of" it: its estimated error}, or why it has none."""
        found = self.compiled.batch([[case[name] for name in self.names] for case in cases])
        labels = [f"{what}{x.label}" for what in ("", _ERROR_OF) for x in self.queries]
        rows = np.concatenate([found.values, found.errors], axis=1).tolist()
        return [found.failures.get(k) or dict(zip(labels, row, strict=True)) for k, row in enumerate(rows)]


_ERROR_OF = "error of "
_UNITS = {"position": "m", "rotation": "rad", "force": "N", "moment": "N m"}
# The tasks of this process by their tokens: an executor sends one with every case.
_TASKS = {}


def _known_task(token, *given):
    if token not in _TASKS:
        _TASKS.clear()  # of studies before
        _TASKS[token] = CasesTask(*given)
    return _TASKS[token]


class CompiledScene:
    """The function that `compile` returns: of the values of the parameters, in the order of their names.

    Attributes:
        names: of the parameters.
        model: "determinate", "planar" or "spatial" of the fast way; "" where there is none.
        why: sentences on how cases are solved.
    """

    def __init__(self, scene, names, queries, load_factor, tol):
        self.names, self.why, self.model = tuple(names), [], ""
        self._scene, self._queries, self._load_factor, self._tol = scene, queries, load_factor, tol
        self._pair, self._linear, self._served = None, False, 0
        self._comm, self._lock = communicator(), threading.Lock()
        self._begin("there are several ranks" if self._comm.size > 1 else self._prepare())

    def _begin(self, obstacle):
        if obstacle:
            self._pair, self.model = None, ""
            self.why = [f"every case goes to solve: {obstacle}"]

    def task(self) -> CasesTask:
        """What `study` takes this object for: a task whose arguments are the parameters, by their names."""
        task = CasesTask(self._scene, self.names, tuple(self._queries), self._load_factor, self._tol)
        if self._comm.size == 1:
            vars(task)["compiled"] = self
        return task

    def __repr__(self):
        return f"<CompiledScene over {', '.join(self.names)}: {'; '.join(self.why)}>"

    def __call__(self, values: Sequence[float]) -> Cases:
        """The `Cases` of one case.

        Args:
            values: of the parameters, (parameters,).

        Raises:
            SceneError: another number of values, or values that the scene refuses.
            NotConverged: as of `solve`.
        """
        found = self._solved(self._checked(values, 1)[None], raises=True)
        return Cases(found.values[0], found.errors[0], found.by_solve[0])

    def batch(self, array: np.ndarray) -> Cases:
        """The `Cases` of many cases, solved in C one after another.

        Args:
            array: (cases, parameters) values.

        Raises:
            SceneError: another shape, or values that are not finite.
        """
        return self._solved(self._checked(array, 2), raises=False)

    def _checked(self, given, dimensions):
        try:
            array = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            array = np.full(1, np.nan)
        if array.ndim != dimensions or array.shape[-1] != len(self.names) or not np.isfinite(array).all():
            one = "finite numbers" if dimensions == 1 else "rows of finite numbers, one a case,"
            raise SceneError(f"values = {given!r:.100}: expected {one} for {', '.join(self.names)}")
        return array

    # -- preparation -------------------------------------------------------------------------------------------------

    def _prepare(self):
        """Load both meshes, and find how their data depend on the parameters; the obstacle where there is one."""
        scene, self._formulation = self._scene, formulation_of(None)
        parameters = [parameter_of(scene, name) for name in self.names]
        base, sizes = (np.array([getattr(x, name) for x in parameters]) for name in ("value", "size"))
        signs = np.resize([1.0, -0.7, 0.6, -0.9, 0.8], len(base))  # no two parameters change alike
        self._at, checked = base + _BESIDE * sizes * signs, base + _CHECK * sizes * signs[::-1]
        try:
            reference, other = (scene_with(scene, self.names, values) for values in (self._at, checked))
            steps = [scene_with(scene, self.names, self._at + _APART * sizes * unit) for unit in np.eye(len(base))]
        except SceneError as problem:
            return f"numbers close to those of the scene are refused: {problem}"
        obstacle = _obstacle(reference)
        if obstacle:
            return obstacle
        self._kind = self._kind_of(reference)
        layout, usual, turning, choice, signatures = self._kind
        if turning is not None:
            return "prescribed rotations or moments turn a rod by many radians"
        self.model = choice.model
        meshes = self._load(reference)
        if meshes[0].problem.begins or any(kind.scaled == "full" for kind in signatures[0].terms):
            return "loads act that the load factor does not scale"
        self._pair = self._paired(meshes, reference)
        self._reference, self._layout, self._of_law = reference, layout, np.zeros(len(base), dtype=bool)
        self._box = self._at, self._at
        if all(x.profile.constant for x in scene.rods) and not signatures[0].coupled:
            self._find_dependence(parameters, steps, _APART * sizes, checked, other)
        how = "a linear map and the laws of the sections" if self._linear else "loading every case"
        self.why += [f"the {self.model} model, on {' and '.join(str(sum(x.layout.counts)) for x in meshes)} elements",
                     f"data by {how}"]  # fmt: skip
        return ""

    def _load(self, scene):
        """A scene on both meshes, loaded in problems of their own, which end with this object."""
        layout, *_, signatures = self._kind
        scales, of_motion = Scales.of(self._scene), signatures[0].formulation.force.of_motion
        layouts, iterations = (layout, layout.finer(scene, 2)), (10 if of_motion is False else 30, CORRECTIONS)
        meshes = [
            Loaded(make_solvers(self._comm, signature, together=False), scene, mesh, scales.moment * scales.length,
                   self._load_factor, iterations=most)
            for signature, mesh, most in zip(signatures, layouts, iterations, strict=True)
        ]  # fmt: skip
        for mesh in meshes:
            weakref.finalize(self, release, mesh.solvers).atexit = False
        return meshes

    def _paired(self, meshes, scene):
        return Pair(meshes, scene, self._queries, self._tol, self._load_factor, near=NEAR)

    def _find_dependence(self, parameters, steps, changes, checked, other):
        """Find how the numbers that C reads depend on the parameters."""
        self._of_law = np.array(self._find_laws(steps))
        self._law = [x for x, of_law in zip(parameters, self._of_law, strict=True) if of_law]
        laws = laws_with(self._scene, self._law, checked[None, self._of_law]) if self._law else None
        self._at_once = self._law and self._takes_arrays(np.stack([self._at, checked])[:, self._of_law])
        if self._fits(other) and (laws is None or np.isfinite(laws[0]).all()):
            others = [(j, changes[j], steps[j]) for j in np.flatnonzero(~self._of_law)]
            self._linear = self._pair.depend(self._at, others, (checked, other, laws))
        self._pair.load(self._reference)

    def _kind_of(self, scene):
        """Key of meshes and compiled code: (first mesh, usual one, mesh for turns, choice, signatures)."""
        layout, usual = (
            x and turning_in_law(scene, x, [self._load_factor]) for x in meshes_for(scene, _DEGREE, self._tol, False)
        )
        choice = choose(scene, formulation=self._formulation, degree=_DEGREE)
        turning = resolving_turns(scene, layout, abs(self._load_factor))
        signatures = [
            Signature.of(scene, mesh, formulation=self._formulation, degree=_DEGREE, model=choice.model)
            for mesh in (layout, layout.finer(scene, 2))
        ]
        return layout, usual, turning, choice, signatures

    def _fits(self, scene):
        """Whether `solve` would use the same code and meshes for a scene."""
        layout, usual, turning, choice, signatures = self._kind_of(scene)
        known = self._kind
        return (
            turning is None and choice.model == known[3].model and signatures == known[4]
            and (usual is None) == (known[1] is None)
            and all(map(np.array_equal, layout.breaks, known[0].breaks))
        )  # fmt: skip

    def _takes_arrays(self, values):
        """Whether the formulas of all sections take arrays."""
        try:
            known, found = (f(self._scene, self._law, values) for f in (laws_with, admitted_laws))
        except Exception:  # noqa: BLE001  of any section, by whoever defined it
            return False
        with np.errstate(invalid="ignore"):  # infinite stiffnesses are not compared
            return all((np.abs(a - b) <= _SAME * a).all() for a, b in zip(known, found, strict=True))

    def _find_laws(self, steps):
        """Which parameters change the stiffnesses of rods."""
        before = [rod.profile.range[0] for rod in self._reference.rods]
        return [
            any(not np.array_equal(a.K, b.profile.range[0].K) or not np.array_equal(a.J, b.profile.range[0].J)
                for a, b in zip(before, scene.rods, strict=True))
            for scene in steps
        ]  # fmt: skip

    # -- cases -------------------------------------------------------------------------------------------------------

    def _solved(self, array, *, raises):
        shape = len(array), len(self._queries)
        found = Cases(np.full(shape, np.nan), np.full(shape, np.nan), np.ones(len(array), dtype=bool))
        if self._pair:
            step = _BLOCK if self._linear else 1
            for first in range(0, len(array), step):
                part = slice(first, first + step)
                with self._lock:
                    decided, values, errors = self._fast(array[part])
                found.values[part][decided], found.errors[part][decided] = values[decided], errors[decided]
                found.by_solve[part] = ~decided
        for k in np.flatnonzero(found.by_solve).tolist():
            try:
                scene = scene_with(self._scene, self.names, array[k])
                path = solve(scene, [self._load_factor], tol=self._tol, progress=False, comm=self._comm)
            except (SceneError, NotConverged) as failure:
                if raises:
                    raise
                found.failures[k] = str(failure)
                continue
            found.values[k], found.errors[k] = self._asked(path, 0)
        return found

    def _asked(self, path, which):
        """Values and errors (.., queries) of points of a path."""
        told = [query.on(path) for query in self._queries]
        return (np.stack(each, axis=-1)[which] for each in zip(*told, strict=True))

    def _fast(self, array):
        """(which cases are decided (n,), values and errors (n, queries))."""
        nothing = np.zeros(len(array), dtype=bool), *np.full((2, len(array), len(self._queries)), np.nan)
        if not self._linear:
            try:
                scene = scene_with(self._scene, self.names, array[0])
            except SceneError:
                return nothing
            if not self._fits(scene):
                return nothing
            self._pair.load(scene)
            return self._pair.run(1)
        admitted, laws = self._admitted(array)
        if not admitted.any():
            return nothing
        if not admitted.all():  # others stand for cases that are refused
            which = np.where(admitted, np.arange(len(array)), np.argmax(admitted))
            array, laws = array[which], [x[which] for x in laws]
        self._served += len(array)
        if self._served - len(array) < _SERVED <= self._served:
            self._pair.in_lock_step(lambda: self._paired(self._load(self._reference), self._reference))
        decided, values, errors = self._pair.run(len(array), self._pair.numbers(array, *laws))
        return decided & admitted, values, errors

    def _admitted(self, array):
        """(cases that the scene's constructors admit, K, J or None): boxes of numbers by their corners."""
        low, high = (f(array, axis=0) for f in (np.min, np.max))
        if (low < self._box[0]).any() or (high > self._box[1]).any():
            box = np.minimum(low, self._box[0]), np.maximum(high, self._box[1])
            if not self._admits_box(box):
                columns = np.flatnonzero(~self._of_law)
                names = [self.names[j] for j in columns]
                admitted = np.array([not names or self._admits(names, row) for row in array[:, columns]], dtype=bool)
                laws = laws_with(self._scene, self._law, array[:, self._of_law]) if self._law else ()
                return admitted & (np.isfinite(laws[1]).all(axis=(1, 2)) if laws else True), laws
            self._box = box
        laws = admitted_laws if self._at_once else laws_with
        laws = laws(self._scene, self._law, array[:, self._of_law]) if self._law else ()
        return np.ones(len(array), dtype=bool), laws

    def _admits_box(self, box):
        ends = [(self.names[j], end[j]) for j in np.flatnonzero(~self._of_law) for end in box]
        if not all(self._admits([name], [value]) for name, value in ends):
            return False
        if not self._law:
            return True
        if len(self._law) > _MOST_CORNERS:
            return False
        corners = np.array([*itertools.product(*np.array(box)[:, self._of_law].T)])
        return bool(np.isfinite(laws_with(self._scene, self._law, corners)[1]).all())

    def _admits(self, names, values):
        try:
            scene = scene_with(self._scene, names, values)
            turning_in_law(scene, self._layout, [self._load_factor])
        except SceneError:
            return False
        return True


def _obstacle(scene):
    """Why a scene has no fast way; "" where it may have one."""
    if path_dependent(scene):
        return "a load has memory"
    if scene.rod_contact:
        return "rods touch each other"
    for action in scene.actions:
        if action.refreshed is not None or action.rough or action.presses or action.touches:
            return f"the {type(action).__name__} depends on the position"
        if any(map(callable, vars(action).values())):
            return f"the {type(action).__name__} is a function"
    if not all(rod.uniform for rod in scene.rods):
        return "a curve or a section is a function of the arc length"
    if any(not x.clamps for x in scene.supports) or any(not x.rigid for x in scene.joints):
        return "supports or joints have constraint equations"
    return ""
