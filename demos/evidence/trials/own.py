"""This package: the default, the models and the formulations, through its public interface."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import cosserat_fenicsx as cf
from cosserat_fenicsx.models.formulation import formulation_of
from cosserat_fenicsx.statics.problem import solvers_of
from trials import problems
from trials.cells import Answer, Method, NotForIt, Stopped, load_factor_in

_IN_ONE_STEP = {"steps": cf.StepControl(adaptive=False), "elements": 8}


@dataclass(frozen=True)
class Own(Method):
    """A column of this package, see `cells.Method`; options: of `cosserat_fenicsx.solve`."""

    key: str
    title: str
    what: str
    options: dict
    spatial: bool = True
    own: bool = True

    @property
    def turn(self):
        return (0.8, -0.6, 0.88) if self.spatial else (0.0, 0.0, 1.2)

    @property
    def tol(self):
        """The requested tolerance."""
        return self.options.get("tol", 1e-6)

    @property
    def default(self):
        """Whether it is `solve` without options."""
        return not self.options

    def solve(self, problem, jump=False, **more):
        """An `Answer`; see `methods`."""
        options = {**self.options, **more}
        if jump and not self.default:
            options |= _IN_ONE_STEP
        if problem.get("coarse") and not self.default:
            options |= {"elements": 4, "degree": 2}
        if "mesh" in problem and not self.default:
            coarser = formulation_of(self.options.get("formulation")).default_degree == 4
            options |= {"elements": problem["mesh"] * (1 if coarser else 2)}
        if "finer" in problem:
            options |= {"tol": self.tol / problem["finer"] ** 2}
        if problem.get("guided") and not self.default:
            options |= {"control": "load"}
        try:
            if "history" in problem:
                return self._in_stages(problem)
            whole = None
            if "turn" in problem and self.options.get("model") == "determinate":  # it has clamps alone
                whole = Rotation.from_rotvec(problem["turn"]).as_matrix()
            rod, scene = problems.scene_of(problem, whole)
            path = cf.solve(scene, problem["load_factors"], progress=False, **options)
        except cf.SceneError as refused:
            raise _refusal(refused) from None
        except cf.NotConverged as failure:
            raise Stopped(failure, _reached(failure)) from None
        return self._answer(path, rod, whole)

    def _answer(self, path, rod, whole):
        said = [] if path.stable.all() else [f"unstable, {max(path.negative_modes)} negative modes"]
        said += [why for why in path.why if "flutter" in why]
        tip = path.displacement(rod.end)
        if whole is not None:
            tip = path.position(rod.end) - [rod.length, 0, 0]
        events = tuple(event.load_factor for event in path.events if event.kind == "limit")
        note = f"{path.model}, {path.formulation}, degree {path.degree}, {sum(path.elements)} elements"
        return Answer(tip, "; ".join(said), note, events, int(path.iterations.sum()), path.stable)

    def _in_stages(self, problem):
        """With factors of force and moment apart: Newton's method from state to state, with the solvers of `solve`."""
        degree, elements = formulation_of(self.options.get("formulation")).default_degree, 6 * problem.get("finer", 1)
        _, scene = problems.scene_of(problem)
        plain = cf.solve(scene, [0.0], elements=elements, progress=False, **self.options)
        options = {"formulation": plain.formulation, "degree": degree, "model": plain.model}
        state = None
        for force, moment in problem["history"]:
            scaled = _with_loads(problem, force, moment)
            with solvers_of(problems.scene_of(scaled)[1], plain.layout, **options) as (solver, newton, _):
                if state is not None:
                    solver.put(state)
                solver.set_load_factor(1.0)
                newton.allow(30)
                solved = newton.solve()
                if not solved.converged:
                    raise Stopped(f"{solved.reason} at force {force:g}, moment {moment:g}", min(force, moment))
                state, model = solver.numbers(), solver.model
                snapshot = (None if a is None else a[None] for a in model.snapshot())
                rq, _ = model.expansion()(np.ones(1), *snapshot)
                tip = (rq[0, -1, :3] - model.reference[-1]) * model.scales.length
        return Answer(tip[None], "", f"{plain.model}, {plain.formulation}, degree {degree}, {elements} elements")

    def numerics(self, key):
        """(problem, answer, number, unit) of a trial about loops; number None for the error itself."""
        problem = problems.column([0.9], 1e3 if key == "residual" else 1e2, infinite=key == "lu")
        if key == "quadrature":
            if self.options.get("model") == "determinate" or self.default:
                raise NotForIt("it takes as many Gauss points as the degree")
            degree = formulation_of(self.options.get("formulation")).default_degree
            points = {"gauss_points": degree + 1, "tol": max(1e-4, self.tol), "degree": degree}
            return problem, self.solve(problem, **points), None, ""
        if key == "line_search":
            if self.default:
                raise NotForIt(
                    "it goes in steps of its own: the other columns of this package show its Newton's method alone"
                )
            answer = self.solve(problem, jump=True)
            return problem, against_steps(problem, answer, **self.options), answer.iterations, "Newton iterations"
        return problem, self.solve(problem), None, ""


def against_steps(problem, answer, **options):
    """The answer of a single step on 8 elements; its error is relative to this package's result in several steps."""
    rod, scene = problems.scene_of(problem)
    path = cf.solve(scene, problem["load_factors"], elements=_IN_ONE_STEP["elements"], progress=False, **options)
    ratio = problems.column_truth(problem)[:, 1] / path.displacement(rod.end)[:, 1]
    note = "; ".join(word for word in (answer.note, "against the same mesh in steps") if word)
    return replace(answer, tip=answer.tip * [[1, r, 1] for r in ratio], note=note)


def _with_loads(problem, force, moment):
    """The problem with factors of its loads; loads with the factor zero remain in the scene."""
    tiny = 1e-30
    return {**problem, "force": [x * (force or tiny) for x in problem["force"]],
            "moment": [x * (moment or tiny) for x in problem["moment"]]}  # fmt: skip


def _refusal(refused):
    """`NotForIt` where a model is not valid for the problem, otherwise `Stopped` before the first step."""
    words = str(refused)
    if "is not possible" in words:
        return NotForIt(words.split(": ", 1)[-1].split("; expected")[0])
    return Stopped(words, 0.0)


def _reached(failure):
    """The load factor named in the message, which may be beyond the last point; otherwise that of this point."""
    named, path = load_factor_in(failure), failure.path
    return float(path.load_factors[-1]) if np.isnan(named) and path is not None and len(path) else named


OWN = (
    Own("default", "default\ncf.solve",
        "`cosserat_fenicsx.solve(scene, load_factors)`, no options: it chooses model, degree and mesh", {}),
    Own("determinate", "rung\ndeterminate", 'model="determinate"', {"model": "determinate"}),
    Own("planar", "rung\nplanar", 'model="planar"', {"model": "planar"}, spatial=False),
    Own("mixed", "rung spatial,\nmixed", 'model="spatial", formulation="mixed"', {"model": "spatial"}),
    Own("displacement", "rung spatial,\ndisplacement", 'model="spatial", formulation="displacement", tol=1e-4',
        {"model": "spatial", "formulation": "displacement", "tol": 1e-4}),
    Own("multiplier", "rung spatial,\nmultiplier", 'model="spatial", formulation="multiplier"',
        {"model": "spatial", "formulation": "multiplier"}),
)  # fmt: skip
