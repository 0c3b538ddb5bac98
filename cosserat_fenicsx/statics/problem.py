"""The compiled static problem of a scene on one mesh, with its solvers, reused for all loads, steps and scenes of its
signature by one caller at a time; what is asked of the scene; and the record of an equilibrium."""

import contextlib

import numpy as np

from cosserat_fenicsx.algebra.elimination import ZERO_PIVOT
from cosserat_fenicsx.algebra.equations import RESIDUAL, STATE, Equations
from cosserat_fenicsx.algebra.newton import Newton
from cosserat_fenicsx.algebra.building import Packed, PackedExpression, take_together
from cosserat_fenicsx.algebra.pool import PROBLEMS
from cosserat_fenicsx.algebra.tie_rows import TieRows
from cosserat_fenicsx.checks import tolerance, whole
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.models.determinate import DeterminateInPlane, DeterminateInSpace
from cosserat_fenicsx.models.spatial import PlanarModel, SpatialModel
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.results.compared import NAMES, criteria_of
from cosserat_fenicsx.results.contacts import check_passes
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.results.records import Record
from cosserat_fenicsx.scene.action import describe
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.stages import refuse_stages
from cosserat_fenicsx.scene.statical import check_no_mechanism
from cosserat_fenicsx.statics.stability import NegativeModes
from cosserat_fenicsx.statics.tensions import Tensions
from cosserat_fenicsx.statics.thread_friction import ThreadFriction
from cosserat_fenicsx.statics.touching import RodContacts


def check_arguments(scene, tol, elements, bound=NAMES, *, owner="solve"):
    """Refuse (SceneError) arguments of `solve`, or of another function (`owner`) of static scenes, out of range."""
    if not isinstance(scene, Scene):
        hint = ", as in read(file).scene" if hasattr(scene, "scene") else ""
        raise SceneError(f"scene is a {type(scene).__name__}: expected a Scene{hint}")
    if not scene.stages:
        check_static(scene)
    elif owner != "solve":
        refuse_stages(owner, scene)
    if owner != "solve":
        refuse_rod_contact(owner, scene)
    if owner not in ("solve", "modes") or scene.rod_contact:
        refuse_given_lengths(owner, scene)
    refuse_rough_threads(owner, scene, scene.rod_contact or owner not in ("solve", "modes"))
    tolerance(owner, tol)
    criteria_of(bound)
    if elements is not None:
        whole(owner, "elements", elements)


@per_scene
def check_static(scene):
    """Refuse a scene without loads, or with parts that act in motions alone."""
    acts = scene.loads or any(support.moves for support in scene.supports)
    if not acts and scene.whole is scene:
        raise SceneError(
            "Scene.loads is empty: expected at least one load, such as Force(rod.end, (0, 0, -1)), or a Prescribed "
            "motion"
        )
    for item in scene.moving:
        still = "a vector, a function of the arc length as Along(function)"
        if getattr(item, "gaps", None) is not None:
            still = "a surface without velocity or spin"
        raise SceneError(
            f"Scene: the {type(item).__name__} depends on time, which a static analysis excludes: expected {still}, "
            "or a motion: cf.simulate(scene, duration) in Python, a duration under [simulate] in a scene file, "
            "--duration on the command line"
        )
    for action in scene.actions:
        if action.touches:
            raise SceneError(
                f"Scene: the {type(action).__name__} acts in motions alone: expected a TubeWall or a TubeRing for an "
                "equilibrium, or a motion: cf.simulate(scene, duration)"
            )
    check_no_mechanism(scene)


def refuse_rod_contact(owner, scene, comm=None):
    """Refuse (SceneError) rods that touch each other where a function, the `owner` of the message, does not have them;
    comm: of `solve`, which has them for scenes without stages, on one rank; None elsewhere."""
    if scene.rod_contact and comm is None:
        raise SceneError(
            f"{owner}: RodContact acts in `solve` and `simulate` alone: expected a scene without it, or the "
            "equilibrium by solve"
        )
    if scene.rod_contact and scene.rod_contact.stiffness is not None:
        raise SceneError(
            f"{owner}: rods that touch each other have hard surfaces in equilibria: expected a RodContact without "
            "stiffness, or a motion by simulate"
        )
    if scene.rod_contact and (scene.stages or comm.size > 1):
        raise SceneError(f"{owner}: a RodContact is solved for on one rank and in one stage: expected a scene without "
                         "stages, and one process")  # fmt: skip


def refuse_rough_threads(owner, scene, all_of_them=True):
    """Refuse (SceneError) tendons with friction where a function, the `owner` of the message, does not have them; or
    only those beside tendons of given length."""
    way = "paths of `solve`, compared with each other" if all_of_them else "tensions in place of lengths"
    for load in scene.all_loads:
        if load.rough and (all_of_them or any(other.shortens for other in scene.all_loads)):
            raise SceneError(
                f"{owner}: {describe(load)} has friction, which `solve`, derivatives of states, `modes` and `simulate` "
                "alone know, the first three without tendons of given length and rods that touch each other: expected "
                f"friction=0, or {way}"
            )


def refuse_given_lengths(owner, scene):
    """Refuse (SceneError) tendons of given length where a function, the `owner` of the message, does not have them."""
    for load in scene.all_loads:
        if load.shortens:
            raise SceneError(
                f"{owner}: only `solve`, `modes`, `simulate` and derivatives of states take a {type(load).__name__} of "
                "given length, in equilibria without rods that touch each other: expected its tension, such as "
                "path.tendon(tendon).tension"
            )


@per_scene
def _has_numbers_alone(scene):
    """Whether no data of a scene are functions, whose values may change."""
    own = all(type(load).__module__.startswith("cosserat_fenicsx.") for load in scene.loads)
    called = any(map(callable, (value for load in scene.loads for value in vars(load).values())))
    return own and not called and all(rod.profile.uniform for rod in scene.rods)


#: Change of the load factor for central differences, whose error is of second order in that of prescribed rotations.
CHANGE = 1e-4


class Problem(Equations):
    """Residual and tangent of a model in statics; see `Equations`.

    load_factor: of loads and prescribed motions; while `begins`, that of permanent loads, from 0 to 1, before all
    others. touching: the `RodContacts` of the scene, or None. fields: the `PackedExpression` of `CompiledForms.fields`,
    or None; tensions: the `Tensions` of tendons of given length, sliding: the `ThreadFriction`, or None; load_norm:
    Euclidean norm of the dead loads at load factor 1, dimensionless; sweep: the `Sweep` that finds points in C, once it
    was asked for.
    """

    ties_class, sweep, touching = TieRows, None, None

    def __init__(self, model):
        self._refreshes, self._remembers = bool(model.actions.refreshed), bool(model.actions.memory)
        super().__init__(model, STATE * self._refreshes)
        forms, constants = model.forms, model.constants
        moving = model.changing
        advance = None
        if forms.advance:
            elements, size = model.carried_dofs.shape
            advance = PackedExpression(forms.advance, model.mesh, elements, size)
        self.take_forms(Packed(forms.residual, moving, constants), Packed(forms.tangent, moving, constants), advance)
        self._dead, self._permanent, *self._difference = (self.numbering.vector() for _ in range(4))
        self._loads, self._permanent_loads = (
            Packed(form, (), ()) if form else None for form in (forms.dead, forms.permanent)
        )
        self._live = [function.x.array for function in model.carried]
        self.load_factor = self.load_norm = 0.0
        self._share = model.permanent_factor.value  # written in place, as `load_factor_array`
        self.take_loads((self._dead.array, self.load_factor_array), (self._permanent.array, self._share))
        self.fields = None
        if forms.fields and model.comm.size == 1:
            size = len(forms.gauss) * forms.fields_size
            self.fields = PackedExpression(forms.fields, model.mesh, len(model.cell_dofs), size)
        self.tensions = Tensions(self) if model.actions.tensions else None
        self.sliding = ThreadFriction(self) if any(term.kind.slides for term in model.actions.terms) else None
        self._loaded, self.begins, self._hooks = None, False, self.c.hooks

    def load(self, scene, layout):
        """Set the data of a scene, in its reference configuration; False where the same data were loaded already."""
        model = self.model
        anew = not self._holds(scene, layout)
        if anew:
            self._loaded = None
            model.load(scene, layout)
            if self.ties:
                self.ties.load()
            self._residual.refresh()
            self.tangent_form.refresh()
            for packed, vector in ((self._loads, self._dead), (self._permanent_loads, self._permanent)):
                if packed:
                    packed.refresh()
                self._assemble(packed, vector)
            self.load_norm = self._dead.norm() + self._permanent.norm() + model.load_norm
            self._loaded = scene, layout
        else:
            model.rest()
        self.elimination.c.zero_pivot = ZERO_PIVOT
        self.begins = any(kind.scaled == "permanent" for kind in model.signature.terms)
        self.load_factor_array[...] = 0.0
        self.set_load_factor(0.0)
        self.numbering.from_local(self._state, self.x)
        self.set_state(self.x)
        for threads in filter(None, (self.tensions, self.sliding)):
            threads.load()
        self.touching = RodContacts(self) if scene.rod_contact else None
        self.c.hooks = self._hooks | RESIDUAL * bool(self.touching)
        return anew

    def forget(self):
        """Load the next scene again, even if it is the one that is loaded."""
        self._loaded = None

    def _holds(self, scene, layout):
        """Whether this scene is loaded on this mesh, without user-defined functions, whose values may change."""
        if self._loaded is None or self._loaded[0] is not scene or self._remembers or not _has_numbers_alone(scene):
            return False
        return self._loaded[1].keys == layout.keys

    def set_load_factor(self, load_factor):
        """Set the factor of loads and prescribed motions; while `begins`, that of permanent loads."""
        self.load_factor = load_factor
        if self.begins:
            self._share[...] = load_factor
        else:
            self.load_factor_array[...] = load_factor

    def soften(self, share):
        """Multiply the stiffness of all obstacles by a share; 1 restores it."""
        self.model.actions.soften(share)
        self._residual.refresh()
        self.tangent_form.refresh()

    def stiffen(self, share):
        """Multiply the stiffness of rough obstacles against slip; 1 restores it."""
        for term in self.model.actions.sticking:
            term.stiffen(share)
        self._residual.refresh()
        self.tangent_form.refresh()

    def end_beginning(self):
        """Set the factor of permanent loads to 1 and the load factor to 0."""
        self.begins = False
        self._share[...] = 1.0
        self.set_load_factor(0.0)

    def factor(self):
        super().factor()
        if self.tensions:
            self.tensions.forget()

    solve_at_tensions = Equations.solve

    def solve_without_tendons(self, b, x):
        """`solve`, at the tensions of tendons of given length."""
        solved = self.solve_at_tensions(b, x)
        if solved and self.sliding and not self.sliding.complete(x):
            solved = False
            self._fail(x)
        return solved

    def _fail(self, x):
        self.c.singular = 1
        x.set(np.nan)

    def solve(self, b, x):
        solved = self.solve_without_tendons(b, x)
        if solved and self.tensions:
            solved = self.tensions.complete(b, x)
            if not solved:
                self._fail(x)
        return solved

    def multipliers(self):
        """Those of the constraint equations, then the tensions of tendons of given length."""
        tensions = [self.tensions.values] if self.tensions else []
        return np.concatenate([super().multipliers(), *tensions])

    def commit(self):
        """Accept the state: path-dependent loads update their history variables."""
        if self._remembers:
            self.model.actions.commit()

    def numbers(self):
        """Copies of all arrays that define the state: this rank's unknowns, then the carried fields."""
        tensions = [self.tensions.values.copy()] if self.tensions else []
        return [self.x.array_r.copy(), *(live.copy() for live in self._live), *tensions]

    def put(self, numbers):
        """Set the state from what `numbers` returned, or from a linear combination of such."""
        self.x.array_w[:] = numbers[0]
        if self.tensions:
            *numbers, tensions = numbers
            self.tensions.put(tensions)
        for live, values in zip(self._live, numbers[1:], strict=True):
            live[:] = values
        self.set_state(self.x)

    def begin_at(self, values, n, multipliers):
        """Set the state from a solution on another mesh; values, n: see `RodModel.set_motion`."""
        self.model.set_motion(values, n)
        if self.tensions:
            multipliers, tensions = np.split(multipliers, [-len(self.tensions.values)])
            self.tensions.put(tensions)
        self.numbering.from_local(self._state, self.x)
        if self.ties:
            self.ties.put(self.x, multipliers)
        self.set_state(self.x)

    def starts(self, values, n, multipliers):
        """(k, n) `numbers`, one after another, of several states as of `begin_at`, of one process."""
        size, state = self.numbering.size, np.zeros((len(values), len(self._state)))
        found = np.zeros((len(values), size + self.c.carries))
        for k, force in enumerate(n):  # n may be among the unknowns
            self.model.put_force(force)
            found[k, size:] = self._live[0] if self._live else ()
            state[k] = self._state
        state[:, self.model.nodal] = values[:, self.model.slots]
        found[:, self.numbering.of_free] = state[:, self.numbering.free]
        if self.ties:
            self.ties.put_all(found, multipliers)
        return found

    def rates(self, slope):
        """The first-order changes of all arrays of `numbers` along a change of the unknowns per unit of load factor
        (owned entries); that of the carried contact force by the linearised strains, without loss of digits on slender
        rods, and by the actions in the law."""
        tensions = [self.tensions.slope.copy()] if self.tensions else []
        if not self.c.advance:
            return [slope, *tensions]
        behind, ahead = (self._advanced(step) for step in (0.0, slope))
        return [slope, ahead - behind + self.rate_by_law(), *tensions]

    def rate_by_law(self):
        """The change of the carried contact force with the load factor at the state, by actions in the law."""
        if not any(kind.place == "law" and kind.scaled == "load" for kind in self.model.signature.terms):
            return 0.0
        here, behind = self.load_factor, self._advanced(0.0)
        self.set_load_factor(here + 1.0)  # the law is linear in the load factor
        change = self._advanced(0.0) - behind
        self.set_load_factor(here)
        return change

    def mismatch(self):
        """The contact force by the strains minus the carried one, rounding; None where no force is carried."""
        return self._advanced(0.0) - self._live[0] if self.c.advance else None

    def _advanced(self, step):
        """The carried contact force after a step from the state (owned entries)."""
        model, vector, (live,) = self.model, self.numbering.vector(), self._live
        before, vector.array_w[:] = live.copy(), step
        model.before.x.array[:], model.step.x.array[:] = self._state, 0.0
        self.numbering.to_local(vector, model.step.x.array)
        self._lib.put_values(self._advance.c, self.c.advance_dofs, self.c.carried)
        found, live[:] = live.copy(), before
        return found

    def assemble_data_derivative(self, form, clamped, vector):
        """The change of the residual at the state, without supports and joints, with data (form: see `DataDerivative`)
        and with clamped nodes (clamped: change of the model's state array there, zero elsewhere), in a vector of the
        solver."""
        self._local[:] = 0.0
        Packed(form, (), ()).add_to_vector(self._local)
        if clamped.any():
            dofs = self.model.cell_dofs
            np.add.at(self._local, dofs, np.einsum("eij,ej->ei", self.tangent_form.matrices(), clamped[dofs]))
        self.numbering.add_up(self._local, vector)

    def _change_residual(self, x, b):
        super()._change_residual(x, b)
        if self.touching:
            b += self.touching.force

    def _refresh(self):
        if self._refreshes:
            self.model.actions.refresh()

    def is_load_derivative(self, b):
        """Whether a vector is what `load_derivative` returns."""
        return b is self._difference[0]

    def load_derivative(self, x):
        """d residual/d load factor at x by a central difference, exact for loads; valid until the next call."""
        load_factor = self.load_factor
        change = CHANGE * max(1.0, abs(load_factor))
        for vector, ahead in zip(self._difference, (change, -change), strict=True):
            self.set_load_factor(load_factor + ahead)
            self.function(x, vector)
        self.set_load_factor(load_factor)
        derivative, behind = self._difference
        derivative.axpy(-1.0, behind)
        derivative.scale(0.5 / change)
        return derivative


_MODELS = {
    ("determinate", True): DeterminateInPlane,
    ("determinate", False): DeterminateInSpace,
    ("planar", True): PlanarModel,
    ("spatial", False): SpatialModel,
}
# Largest ratio of the load factors at which two meshes find negative modes, for the finding to be confirmed.
_ALIKE = 1.5


class Promoted(Exception):
    """A planar solution that has to be continued with the spatial model; reason: a sentence for `Path.why`; between:
    the load factors between which negative modes appeared, where the mesh is too coarse to be sure of them; else None.
    """

    def __init__(self, reason, between=None):
        super().__init__(reason)
        self.reason, self.between = reason, between

    def agrees(self, before):
        """Whether the exception on the mesh before, or None, confirms the negative modes: on a mesh that does not
        resolve the contact force a taut wire seems to buckle, at a load factor that grows with refinement."""
        if self.between is None:
            return True
        if before is None or before.between is None:
            return False
        (a, b), (c, d) = (sorted(map(abs, found.between)) for found in (self, before))
        return max(a, c) <= _ALIKE * min(b, d)


# Unknowns from which on a problem takes a GB or so.
_LARGE = 200_000
# Exceptions that leave the problem and its solvers fit for use: they are raised between two steps.
_OUTCOMES = (NotConverged, Promoted)


def make_solvers(comm, signature, *, together=True):
    """A new `Problem`, not loaded, its Newton solver and its `NegativeModes`; together: whether several of many
    elements may be computed at once."""
    problem = Problem(_MODELS[signature.model, signature.flat](comm, signature))
    stability = NegativeModes(problem)
    if together and problem.elimination.many:
        for forms in ((problem._residual, problem.tangent_form), *((part.form,) for part in stability.parts)):
            take_together(*forms)
    return problem, Newton(problem), stability


@contextlib.contextmanager
def solvers_of(scene, layout, *, formulation="mixed", degree=4, points=None, comm=None, model="spatial"):
    """Context manager that gives the loaded `Problem`, its Newton solver and its `NegativeModes` for a scene on a mesh;
    afterwards another caller may use them, so that results must not refer to them."""
    comm = communicator(comm)
    signature = Signature.of(scene, layout, formulation=formulation, degree=degree, points=points, model=model)
    key, large = ("equilibrium", signature), signature.unknowns > _LARGE
    with PROBLEMS.lend(key, comm, lambda: make_solvers(comm, signature), _OUTCOMES, large=large) as solvers:
        problem, _, stability = solvers
        if problem.load(scene, layout):
            stability.load()
        yield solvers


def look_beside(problem, load_factor):
    """Refuse (`Passes`) a state in which a rod passes into an obstacle unseen between two nodes."""
    if problem.model.scene.has_obstacles:
        path = Path.of(problem.model)
        path.append(record_of(problem, load_factor, 0, 0, 0))
        check_passes(path)


def record_of(problem, load_factor, negative_modes, iterations, steps, neutral=False):
    """The `Record` of a problem's state, an equilibrium."""
    model, touching = problem.model, problem.touching
    at_gauss, at_nodes = model.densities.here()
    if touching:
        at_nodes = touching.densities() + (0.0 if at_nodes is None else at_nodes)
    return Record(load_factor, *model.snapshot(), negative_modes, iterations, problem.multipliers(), neutral,
                  (at_gauss, at_nodes), problem.tie_forces(), model.clamps.loads(load_factor), steps,
                  touching and touching.nodal_forces())  # fmt: skip
