"""Derivatives of the queries of a path by parameters of its scene: the direct method.

At a point of the path the residual R(x; d) vanishes, with the unknowns x and the data d of the scene, all
dimensionless. For a parameter p

    dx/dp = -K^-1 (R_d dd/dp),

with the tangent K as factorised by Newton's method and R_d by ufl.derivative: one factorisation a point, and one
back-substitution for each parameter. dd/dp is a central difference of eighth order of the data, which are explicit
functions of the scene; so are the constraint equations of supports and joints at fixed x. The contact force carried at
the Gauss points changes by the derivative of its law. A query is then differenced along (x + t dx/dp, scene(p + t)),
which includes units, geometry and all else that it takes from the scene. No perturbed state is solved for.
"""

import contextlib
import dataclasses

import numpy as np

from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.models.compiled import DataDerivative, made_once
from cosserat_fenicsx.models.rodmesh import same_places
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.numerics import PLACES, STEP, derivative, is_smooth
from cosserat_fenicsx.results.accuracy import on_mesh
from cosserat_fenicsx.results.path import PerturbedPath
from cosserat_fenicsx.results.queries import Sensitivity
from cosserat_fenicsx.scene.action import path_dependent
from cosserat_fenicsx.scene.parameters import parameter_of
from cosserat_fenicsx.statics.problem import record_of, solvers_of

# Newton iterations from the recorded state to the same state, and its largest motion (lengths, rad).
_ITERATIONS, _MOVED = 25, 1e-3
_REACH = 5e-3  # largest motion (lengths, rad) over which queries are differenced
# Data that depend on the position: motion over which they are differenced (lengths, rad), iterations, accuracy.
_AHEAD, _FOLLOWED, _SETTLED = 1e-5, 50, 1e-7


def sensitivity(path, query, parameters):
    """See `Path.sensitivity`."""
    if not callable(query):
        raise SceneError(f"query = {query!r}: expected a function of the path, lambda path: path.position('rod.end')")
    if not len(path):
        raise SceneError("sensitivity: the path has no converged point to differentiate at: expected at least one")
    found = parameters_of(path.scene, parameters)
    value, derivatives, errors = _numbers(query(path)), {}, {}
    with Direct.along(path, found) as direct:
        direct.find(path)
        for parameter, rate in zip(found, direct.rates(), strict=True):
            step = direct.step(parameter, rate)
            values = [_numbers(query(direct.moved(path, parameter, rate, k * step))) for k in PLACES]
            derivatives[parameter.name], errors[parameter.name] = derivative(values, step)
            if direct.without and np.isnan(derivatives[parameter.name]).any():
                direct.refuse_points()
    return Sensitivity.by(found, value, derivatives, errors)


def _numbers(value):
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        kind = type(value).__name__
        raise SceneError(f"query returns a {kind}: expected a number or an array, such as one of its parts") from None


def parameters_of(scene, given, critical=False):
    """The `Parameter`s of a scene from one or several names or parameters (critical: of critical loads), or a
    SceneError: no such parameter, or loads whose derivatives are not known."""
    given = [given] if isinstance(given, str) or not hasattr(given, "__iter__") else given
    found = [parameter_of(scene, each) for each in given]
    if path_dependent(scene):
        raise SceneError("sensitivity: a load of the scene has memory: expected loads that depend on the state alone")
    if any(load.rough for load in scene.actions) and any(load.refreshed is not None for load in scene.actions):
        raise SceneError(
            "sensitivity: derivatives are not known where a tendon has friction and a wall's data turn with the "
            "position: expected one of the two"
        )
    for load in scene.actions:
        if critical and load.refreshed is not None:
            raise SceneError(
                f"sensitivity: derivatives of critical loads are not known with a {type(load).__name__}, whose data "
                "turn with the position: expected other loads, such as a Wall or a Foundation"
            )
    return found


def _scenes_near(scene, parameter):
    """The scenes with the parameter at `PLACES` times its step from its value."""
    try:
        found = [parameter.scene_of(parameter.value + k * STEP * parameter.size) for k in PLACES]
    except SceneError as problem:
        raise SceneError(
            f"parameter '{parameter.name}' = {parameter.value:g}: its neighbourhood, up to "
            f"{max(PLACES) * STEP * parameter.size:.3g} from it, is refused: {problem}"
        ) from None
    for part in ("rods", "supports", "loads", "joints"):
        if any(len(getattr(near, part)) != len(getattr(scene, part)) for near in found):
            raise SceneError(f"parameter '{parameter.name}': it changes the number of {part}: expected a smooth change")
    return found


class Direct:
    """The direct method on one problem and path; scenes: see `_scenes_near`, for each parameter; points: [(load factor,
    numbers, `Record`)] of the states where derivatives are taken; without: {load factor: (tendons,) which of given
    length are about to be taut or slack} of those that have no derivatives by a parameter."""

    def __init__(self, solvers, scene, layout, parameters, scenes):
        self.problem, self.newton, self.stability = self.solvers = solvers
        self.model, self._scene, self._layout = self.problem.model, scene, layout
        self._parameters, self._scenes = parameters, scenes
        self._by_data = made_once(self.model, "data_derivative", DataDerivative)
        actions = self.model.actions
        #: whether data depend on the position; and on what the tangent does not know
        self._refreshes, self._follows = bool(actions.refreshed), actions.turns_with_position
        self.points, self.without = [], {}

    @classmethod
    @contextlib.contextmanager
    def on(cls, scene, layout, parameters, scenes=None, **options):
        """Context manager that gives the `Direct` of a scene on a mesh; options: see `solvers_of`."""
        scenes = scenes or [_scenes_near(scene, parameter) for parameter in parameters]
        with solvers_of(scene, layout, **options) as solvers:
            direct, model = cls(solvers, scene, layout, parameters, scenes), solvers[0].model
            model.EI = model.scales.moment * model.scales.length  # so that units depend on no parameter
            try:
                direct.check()
                yield direct
            finally:
                model.EI = None
                direct.problem.forget()

    @classmethod
    def along(cls, path, parameters):
        """Context manager: the `Direct` of a path's mesh and model, in space where parameters move its plane."""
        scenes = [_scenes_near(path.scene, parameter) for parameter in parameters]
        model, plane = path.model, path.scene.plane
        near = [scene.plane for scene in sum(scenes, [])] if plane is not None else []
        if not all(other is not None and np.allclose(other.axes, plane.axes, rtol=0, atol=1e-12) for other in near):
            model = "spatial"
        return cls.on(
            path.scene, path.layout, parameters, scenes, formulation=path.formulation, degree=path.degree,
            points=len(path.rule.gauss), comm=path.comm, model=model,
        )  # fmt: skip

    def find(self, path):
        """Take the points of a path, solved again to rounding."""
        self._apply_permanent()
        rq, n = on_mesh(path, self._layout)
        starts = zip(path._records, self.model.unknowns_of(rq), n, strict=True)
        self.points = [self._solved(*each) for each in starts]

    def check(self):
        """Refuse parameters that change what the compiled code depends on, or the proportions of the mesh."""
        signature = self.model.signature
        near_by = zip(self._parameters, self._scenes, strict=True)
        for parameter, scene in ((parameter, scene) for parameter, scenes in near_by for scene in scenes):
            near = Signature.of(
                scene, self._layout, formulation=signature.formulation.name, degree=signature.degree,
                points=signature.points, model=signature.model,
            )  # fmt: skip
            kept = dataclasses.replace(near, slender=signature.slender, formulation=signature.formulation)
            if kept != signature:
                raise SceneError(
                    f"parameter '{parameter.name}': the model changes where it is varied: expected one that leaves "
                    "symmetries, planes and what is held as they are, or a path with model='spatial'"
                )
            sizes = [self._layout.sizes(x) / max(rod.length for rod in x.rods) for x in (scene, self._scene)]
            if not np.allclose(*sizes, rtol=1e-10, atol=0):
                raise SceneError(
                    f"parameter '{parameter.name}' changes the lengths of rods over that of the longest one: expected "
                    "one that scales all of them, or none"
                )
            if not same_places(scene, self._scene):
                raise SceneError(
                    f"parameter '{parameter.name}' moves a load, support, joint or end of a section along its rod, "
                    "and elements with it: expected one that leaves their shares of the length as they are"
                )

    # -- states ------------------------------------------------------------------------------------------------------

    def _apply_permanent(self):
        if self.problem.begins:
            self.problem.end_beginning()

    def _load(self, scene):
        self.problem.load(scene, self._layout)
        self._apply_permanent()

    def _solved(self, record, values, n):
        """(load factor, numbers, record) of a point, solved to rounding."""
        problem = self.problem
        problem.set_load_factor(record.load_factor)
        problem.begin_at(values, n, record.reactions)
        before = problem.numbers()
        self.newton.allow(_ITERATIONS)
        solved = self.newton.solve()
        if not solved.converged or self.model.largest(problem.x.array_r - before[0]) > _MOVED or record.neutral:
            reason = solved.reason if not solved.converged else "a motion is neutral, or the state is not isolated"
            raise NotConverged(
                f"sensitivity: the point at the load factor {record.load_factor:.6g} has no derivative: {reason}"
            )
        return record.load_factor, problem.numbers(), record

    # -- derivatives -------------------------------------------------------------------------------------------------

    def rates(self):
        """For each parameter the derivatives of the numbers of every point (see `Problem.numbers`); None where a tendon
        gets taut by one change and slack by the opposite one."""
        changes = [self._data_changes(*each) for each in zip(self._scenes, self._parameters, strict=True)]
        self._load(self._scene)
        found = [[] for _ in changes]
        for i, (load_factor, numbers, _) in enumerate(self.points):
            edges = self.factor(load_factor, numbers)
            for rates, of_points, parameter in zip(found, changes, self._parameters, strict=True):
                rates.append(self._rate(*of_points[i]))
                if edges.any() and self.problem.tensions.opens(edges, parameter.size):
                    rates[-1], self.without[load_factor] = None, edges
        return found

    def refuse_points(self):
        """Raise a SceneError for the points that have no derivatives."""
        load_factor, edges = next(iter(self.without.items()))
        self.problem.set_load_factor(load_factor)
        expected = "a query of other points alone, such as lambda path: path.position(station)[-1]"
        self.problem.tensions.refuse("sensitivity", edges, expected)

    def _data_changes(self, scenes, parameter):
        """For every point the derivatives of the data, of the residual of ties, and of gaps of tendons."""
        step = STEP * parameter.size

        def smooth(arrays):
            if not is_smooth(arrays, step, lambda sizes: np.max(self.model.comm.allgather(sizes), axis=0)):
                raise SceneError(
                    f"parameter '{parameter.name}' = {parameter.value:g}: the scene does not change smoothly up to "
                    f"{max(PLACES) * step:.3g} from it: expected cf.Parameter(..., scale=...) with a smaller scale; "
                    "and d1 for a Line that becomes vertical, whose directors turn there"
                )
            return derivative(arrays, step)[0]

        near, found, whole = [], [], None
        for scene in scenes:
            self._load(scene)
            data = self._by_data.data()
            near.append([])
            for point in self.points:
                if self._refreshes:  # data that depend on the position
                    self.put(point, point[1], 0.0)
                    data = self._by_data.data()
                near[-1].append((data, self._of_ties(point[0], point[1][0]), self._of_lengths(point)))
        for at_point in zip(*near, strict=True):
            data, *others = zip(*at_point, strict=True)
            if whole is None or self._refreshes:
                whole = [smooth(arrays) for arrays in zip(*data, strict=True)]
            found.append((whole, *map(smooth, others)))
        return found

    def _of_ties(self, load_factor, x):
        problem, found = self.problem, np.zeros(self.problem.numbering.size)
        if problem.ties:
            problem.ties.see(x)
            problem.ties.add_residual(found, load_factor)
        return found

    def _of_lengths(self, point):
        tensions = self.problem.tensions
        if not tensions:
            return np.zeros(0)
        self.put(point, point[1], 0.0)
        return tensions.gaps()

    def factor(self, load_factor, numbers):
        """Go to a state, and factorise the tangent there; which tendons are about to be taut or slack."""
        problem = self.problem
        problem.set_load_factor(load_factor)
        problem.put(numbers)
        edges = problem.tensions.keep() if problem.tensions else np.zeros(0, dtype=bool)
        problem.function(problem.x, problem.b)
        problem.factor()
        return edges

    def residual_change(self, data, of_ties):
        """(change of the residual at the state, a vector; change of the model's state array at clamped nodes)."""
        numbering, found = self.problem.numbering, self.problem.numbering.vector()
        self._by_data.take(data)
        clamped = np.where(numbering.rows < 0, data[-1], 0.0)
        self.problem.assemble_data_derivative(self._by_data.form, clamped, found)
        found.array_w[:] += of_ties
        return found, clamped

    def _rate(self, data, of_ties, of_lengths):
        """The change of the numbers with data and ties; data that depend on the position follow by iteration."""
        rate = self._response(*self.residual_change(data, of_ties), of_lengths)
        for _ in range(_FOLLOWED if self._follows else 0):
            moved = [a + b for a, b in zip(data, self._data_along(rate), strict=True)]
            before, rate = rate, self._response(*self.residual_change(moved, of_ties), of_lengths)
            if self.model.largest(rate[0] - before[0]) <= _SETTLED * self.model.largest(rate[0]):
                return before
        if self._follows:
            raise NotConverged("sensitivity: the iteration for loads that turn with the position did not converge")
        return rate

    def _data_along(self, rate):
        """Derivatives of the data along a change of the state."""
        here, sides = (self.problem.load_factor, self.problem.numbers(), None), []
        step = _AHEAD / max(self.model.largest(rate[0]), 1e-300)
        for k in PLACES:
            self.put(here, rate, k * step)
            sides.append(self._by_data.data())
        self.put(here, rate, 0.0)
        return [derivative(arrays, step)[0] for arrays in zip(*sides, strict=True)]

    def slope(self):
        """Derivatives of the numbers by the load factor, at the state where the tangent was factorised."""
        problem = self.problem
        self._by_data.take([0.0] * len(self._by_data.data()))
        found = self._response(problem.load_derivative(problem.x).copy(), np.zeros_like(self.model.state.x.array))
        return [found[0], *(carried + problem.rate_by_law() for carried in found[1:])]

    def _response(self, residual, moved, gaps=0.0):
        """The change of the numbers that balances changes of the residual, the gaps and the clamped nodes."""
        problem, model, rate = self.problem, self.model, self.problem.numbering.vector()
        residual.scale(-1.0)
        if problem.tensions:
            problem.tensions.wanted = -gaps
        if not problem.solve(residual, rate) or not np.isfinite(rate.norm()):
            raise NotConverged(
                f"sensitivity: the tangent is singular at the load factor {problem.load_factor:.6g}, where the path "
                "has no derivative"
            )
        problem.numbering.to_local(rate, moved)
        contact = self._by_data.contact(moved)
        carried = [] if contact is None else [contact]
        others = [np.zeros_like(x.x.array) for x in model.carried[len(carried) :]]
        if problem.tensions:
            others.append(problem.tensions.change)
        return [rate.array_r.copy(), *carried, *others]

    # -- results -----------------------------------------------------------------------------------------------------

    def step(self, parameter, rates):
        """A change of a parameter by which the state moves little."""
        fastest = max((self.model.largest(rate[0]) for rate in rates if rate is not None), default=0.0)
        return min(STEP * parameter.size, _REACH / max(fastest, 1e-300))

    def load_near(self, parameter, change):
        """Load the scene with a parameter changed."""
        self._load(parameter.scene_of(parameter.value + change))

    def put(self, point, rate, change):
        """Go to a state that is moved by a change times a rate; NaN without one."""
        load_factor, numbers, _ = point
        rate = [np.full_like(x, np.nan) for x in numbers] if rate is None else rate
        self.problem.set_load_factor(load_factor)
        self.problem.put([a + change * b for a, b in zip(numbers, rate, strict=True)])
        if self._refreshes:
            self.model.actions.refresh()

    def moved(self, path, parameter, rates, change):
        """The `PerturbedPath` beside a path by a change of a parameter."""
        self.load_near(parameter, change)
        found = PerturbedPath.beside(path, self.model)
        for point, rate in zip(self.points, rates, strict=True):
            self.put(point, rate, change)
            load_factor, _, record = point
            found.append(record_of(self.problem, load_factor, record.negative_modes, record.iterations, record.steps))
        return found
