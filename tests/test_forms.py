"""The forms: Taylor tests, rigid motions, FFCx's kernels, and the constraint equations of supports and joints."""

import ctypes
from dataclasses import replace

import dense
import numpy as np
import pytest
import ufl
from conftest import column
from dense import tangent_of_ties
from dolfinx import cpp, fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat
from cosserat_fenicsx.algebra.pool import PROBLEMS
from cosserat_fenicsx.dynamics.schemes import SCHEMES
from cosserat_fenicsx.dynamics.simulate import solvers_of as moving_solvers
from cosserat_fenicsx.models import compiled
from cosserat_fenicsx.models.connections import TiePattern, Ties
from cosserat_fenicsx.models.formulation import OF_MOTION, Displacement, Mixed, Multiplier
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.scene.supports import AngleTie, PositionTie, TurnTie
from cosserat_fenicsx.statics.problem import Problem
from cosserat_fenicsx.statics.problem import solvers_of as static_solvers
from cosserat_fenicsx.statics.stability import NegativeModes

pytestmark = pytest.mark.serial
#: The multiplier formulation with n from the motion, which the carried n equals in equilibrium.
GALERKIN = Multiplier(force=OF_MOTION)


def problem_of(formulation, *, arm=False, rigid=False):
    k = column(arm=arm)[0].stiffness
    section = None
    if rigid:
        section = cf.Stiffness(shear=(np.inf, np.inf), axial=np.inf, bending=k.bending, torsion=k.torsion)
    rod, scene = column(
        arm=arm, diameter=2.0, section=section
    )  # thick, so that all parts of the tangent have similar size
    layout = Layout.of(scene, 3)
    signature = Signature.of(scene, layout, formulation=formulation, degree=2)
    problem = Problem(SpatialModel(MPI.COMM_SELF, signature))
    problem.load(scene, layout)
    return problem


def residual(problem, x):
    y, b = problem.x.duplicate(), problem.b.duplicate()
    y.array_w[:] = x
    problem.function(y, b)
    return b.array.copy()


def tangent(problem, x):
    residual(problem, x)
    return dense.tangent(problem)


@pytest.mark.parametrize("arm", [False, True])
@pytest.mark.parametrize(
    ("formulation", "rigid"), [(Displacement(), False), (GALERKIN, False), (Mixed(), True), (Multiplier(), True)]
)
def test_tangent_is_the_derivative_of_the_residual(formulation, rigid, arm):
    """Taylor: |F(x + h d) - F(x) - h J d| falls with h^2."""
    problem = problem_of(formulation, arm=arm, rigid=rigid)
    random = np.random.default_rng(0)
    x = problem.x.array.copy()
    x += 0.1 * random.normal(size=len(x))
    problem.set_load_factor(0.7)
    direction = random.normal(size=len(x))
    F, J = residual(problem, x), tangent(problem, x)
    Jd = J @ direction
    steps = 1e-3 * 0.5 ** np.arange(4)
    errors = [np.linalg.norm(residual(problem, x + h * direction) - F - h * Jd) for h in steps]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(rates, 2, atol=0.05)


@pytest.mark.parametrize(("carried", "of_motion"), [(Mixed(), Displacement()), (Multiplier(), GALERKIN)])
def test_condensed_tangent_meets_the_displacement_tangent_at_equilibrium(carried, of_motion):
    """Where the carried n agrees with the motion, the mixed-integration-point tangent is the derivative."""
    rod, scene = column()
    path = cf.solve(scene, [0.9], model="spatial", elements=3, degree=2, comm=MPI.COMM_SELF)
    problems = []
    for formulation in (carried, of_motion):
        layout = Layout.of(scene, 3)
        problem = Problem(SpatialModel(MPI.COMM_SELF, Signature.of(scene, layout, formulation=formulation, degree=2)))
        problem.load(scene, layout)
        problems.append(problem)
    mixed, plain = problems
    model = mixed.model
    model.state.x.array[model.nodal[:, :7]] = path._records[0].rq[model.slots]
    problem.numbering.from_local(model.state.x.array, problem.x)
    x = problem.x.array.copy()
    for problem in problems:
        problem.set_load_factor(0.9)
        residual(problem, x)
    model.before.x.array[:] = model.state.x.array
    model.step.x.array[:] = 0
    for _ in range(2):  # the update with a zero step takes n to that of the motion
        mixed.advance()
    A, B = tangent(mixed, x), tangent(plain, x)
    assert np.linalg.norm(A - B) < 1e-9 * np.linalg.norm(B)


@pytest.mark.parametrize("formulation", [Mixed(), Displacement(), Multiplier()])
def test_a_rigid_motion_strains_nothing(formulation):
    problem = problem_of(formulation)
    model = problem.model
    a = np.array([0.3, -0.5, 0.7, 0.4])
    a /= np.linalg.norm(a)
    w, v = a[0], a[1:]
    x = model.state.x.array  # the clamped end too
    r = x[model.nodal[:, :3]]
    turned = r + 2 * np.cross(v, np.cross(v, r) + w * r)
    x[model.nodal[:, :3]] = turned + [1.0, 2.0, 3.0]
    x[model.nodal[:, 3:7]] = a
    problem.numbering.from_local(x, problem.x)
    assert np.abs(residual(problem, problem.x.array.copy())).max() < model.round_off


def test_second_variation_counts_what_an_eigensolver_counts():
    rod, scene = column(eccentricity=0.0)
    layout = Layout.of(scene, 4)
    model = SpatialModel(MPI.COMM_SELF, Signature.of(scene, layout, formulation="mixed", degree=2))
    problem = Problem(model)
    stability = NegativeModes(problem)
    problem.load(scene, layout)
    stability.load()
    from cosserat_fenicsx.algebra.newton import Newton

    newton = Newton(problem)
    newton.allow(10)
    for eta, expected in ((0.5, 0), (1.5, 2), (9.5, 4), (26.0, 6)):
        problem.set_load_factor(eta)
        assert newton.solve().converged
        assert stability.count() == expected
        (part,) = stability.parts
        part.assemble()
        rows = np.arange(part.K.size[0], dtype=np.int32)
        eigenvalues = np.linalg.eigvalsh(part.K.getValues(rows, rows))
        assert (eigenvalues < 0).sum() == expected


def model_of(formulation, *, rigid=False):
    """A model in a random state, on elements of unequal length, under loads that depend on the state."""
    rod, scene = column(arm=True)
    k = rod.stiffness
    if rigid:
        section = cf.Stiffness(shear=(np.inf, np.inf), axial=np.inf, bending=k.bending, torsion=k.torsion)
        rod, scene = column(arm=True, section=section)
    scene = replace(scene, loads=[*scene.loads, cf.LineForce(rod, (0, 1e3, 0))])
    layout = Layout.of(scene, 3)
    model = SpatialModel(MPI.COMM_SELF, Signature.of(scene, layout, formulation=formulation, degree=4))
    model.load(scene, layout)
    random = np.random.default_rng(1)
    model.mesh.geometry.x[:, 0] *= np.linspace(0.7, 1.3, len(model.mesh.geometry.x))
    for function in (model.state, model.before, model.step, *model.carried):
        function.x.array[:] = random.normal(size=len(function.x.array))
    model.load_factor.value = 0.7
    return model


def call(address, A, w, c, coordinates):
    """Add what a kernel computes to A."""
    kernel = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * compat.KERNEL_ARGUMENTS)(address)
    arrays = [np.ascontiguousarray(a, dtype=float) for a in (w, c, coordinates)]
    assert arrays[2].size == compat.KERNEL_COORDINATES
    kernel(A.ctypes.data, *(a.ctypes.data for a in arrays), *[None] * (compat.KERNEL_ARGUMENTS - 4))


def dofs(space):
    """Local degrees of freedom of every cell."""
    size = space.dofmap.index_map_bs
    return (compat.cell_nodes(space)[:, :, None] * size + np.arange(size)).reshape(len(compat.cell_nodes(space)), -1)


def ends(model):
    return model.mesh.geometry.x[compat.geometry_dofs(model.mesh)]


@pytest.mark.parametrize(("formulation", "rigid"), [(Mixed(), False), (Displacement(), False), (Mixed(), True)])
def test_kernels_assemble_what_dolfinx_assembles(formulation, rigid):
    """Coefficients at Gauss points, a Constant, and where the rod is rigid unknowns in a mixed space."""
    model = model_of(formulation, rigid=rigid)
    assert (model.space is model.nodal_space) == (not rigid)
    cells = dofs(model.space)
    forms = model.forms
    vector = np.zeros(len(model.state.x.array))
    matrix = np.zeros((len(vector), len(vector)))
    parts = [(form, vector) for form in forms.residual] + [(form, matrix) for form in forms.tangent]
    for form, whole in parts:
        address, compiled = compat.kernel_address(form), compat.kernel(form)
        (coefficients,) = cpp.fem.pack_coefficients(compiled).values()
        constants = cpp.fem.pack_constants(compiled)
        assert len(constants) == (form not in (forms.residual[0], forms.tangent[0]))  # the load factor
        for here, w, coordinates in zip(cells, coefficients, ends(model), strict=True):
            A = np.zeros((len(here),) * whole.ndim)
            call(address, A, w, constants, coordinates)
            whole[np.ix_(*[here] * whole.ndim)] += A
    expected = sum(fem_petsc.assemble_vector(form).array for form in forms.residual)
    np.testing.assert_allclose(vector, expected, rtol=0, atol=1e-14 * np.abs(expected).max())
    rows, expected = np.arange(len(vector), dtype=np.int32), 0
    for form in forms.tangent:
        A = fem_petsc.assemble_matrix(form)
        A.assemble()
        expected = expected + A.getValues(rows, rows)
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=1e-14 * np.abs(expected).max())
    assert np.abs(expected).max() > 0


@pytest.mark.parametrize("name", ["fields", "advance", "density"])
def test_expressions_have_the_values_that_dolfinx_gives(name):
    """The Functions and Constants in the order in which a caller must pack them."""
    model = model_of(Mixed())
    expression = getattr(model.forms, name)
    (expression,) = expression if name == "density" else (expression,)
    address, functions, constants = compat.expression_address(expression)
    assert len(constants) == (name == "density")
    c = np.concatenate([[], *(constant.value.ravel() for constant in constants)])
    w = np.concatenate([function.x.array[dofs(function.function_space)] for function in functions], axis=1)
    expected = compat.evaluate(expression, model.mesh, np.arange(len(w), dtype=np.int32))
    found = np.zeros_like(expected)
    for values, here, coordinates in zip(found, w, ends(model), strict=True):
        call(address, values, here, c, coordinates)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.abs(expected).max())
    assert np.abs(expected).max() > 0


def test_a_form_of_several_kernels_is_refused():
    model = model_of(Displacement())
    dx = ufl.Measure("dx", domain=model.mesh)
    two = fem.form(ufl.TestFunction(model.space)[0] * (dx(1) + dx(2)))
    with pytest.raises(ValueError, match="2 integrals over cells, expected 1"):
        compat.kernel_address(two)


ETA, STEP = 0.4, 1e-6
NODES = [(0, 1), (0, -1), (0, 1), (2, -1), (2, -1), (0, -1), (1, 2)]


def moved(rq, node, direction, amount):
    """(r, q) after a small displacement (directions 0 to 2) or inertial rotation (3 to 5) of one node."""
    rq, change = rq.copy(), np.zeros(3)
    change[direction % 3] = amount
    if direction < 3:
        rq[node, :3] += change
        return rq
    half, (a, v) = np.linalg.norm(change) / 2, (rq[node, 3], rq[node, 4:])
    c, s = np.cos(half), change / 2
    rq[node, 3:] = np.append(c * a - s @ v, c * v + a * s + np.cross(s, v))
    return rq


def test_gradient():
    rng = np.random.default_rng(7)

    def vector():
        return tuple(rng.normal(size=3))

    q = rng.normal(size=(3, 4))
    rq = np.hstack([rng.normal(size=(3, 3)), q / np.linalg.norm(q, axis=1, keepdims=True)])
    ties = [
        PositionTie(0, 1, vector(), 0.3), PositionTie(0, None, vector(), 0.7), AngleTie(0, 1, vector(), vector()),
        AngleTie(2, None, vector(), vector()), TurnTie(2, None, vector(), vector()),
        TurnTie(0, None, vector(), (0, 0, 0)),
        AngleTie(1, 2, vector(), vector()),
    ]  # fmt: skip
    known = Ties(ties, TiePattern(NODES, 3), rng.normal(size=(3, 3)), 2.0)
    gradient = known.pattern.on_nodes(known.evaluate(rq, ETA)[1])
    for node in range(3):
        for direction in range(6):
            c1, c0 = (known.evaluate(moved(rq, node, direction, sign * STEP), ETA)[0] for sign in (1, -1))
            np.testing.assert_allclose((c1 - c0) / (2 * STEP), gradient[:, node, direction], atol=1e-8)


SECTION = cf.Stiffness((1e4, 1e4), 1e4, (500.0, 500.0), 500.0, mass=1.0, inertia=(10.0, 10.0, 20.0))


def held_twice(rotation):
    """Two rods with a hinge between them, moved and perhaps turned at one end, on a roller at the other."""
    a, b = cf.Rod(cf.Line((0, 0, 0), (5, 0, 0)), SECTION, name="a"), cf.Rod(cf.Line((5, 0, 0), (9, 3, 0)), SECTION)
    moved = cf.Prescribed(a.start, displacement=(0.1, 0.2, 0.0), rotation=rotation)
    return cf.Scene([a, b], [moved, cf.Roller(b.end, (0, 1, 0))], [], joints=[cf.Joint(a.end, b.start, (0, 0, 1))])


def solvers_of(kind, model):
    """The solvers of a static formulation or of a scheme for motion."""
    static = kind in ("mixed", "multiplier")
    scene = held_twice((0.0, 0.0, 0.3) if static else None)
    layout = Layout.of(scene, 2)
    if static:
        return static_solvers(scene, layout, formulation=kind, degree=2, model=model)
    return moving_solvers(scene, layout, 2, kind, 1.0, MPI.COMM_WORLD, model)


@pytest.mark.parametrize(
    ("kind", "model"),
    [
        ("mixed", "spatial"), ("mixed", "planar"), ("multiplier", "spatial"), ("momentum", "spatial"),
        ("momentum", "planar"), ("generalised-alpha", "spatial"),
    ],
)  # fmt: skip
def test_blocks_of_a_problem(kind, model):
    """The derivatives in the rows of a solver, of statics and of a step, are those of the residual, for changes that
    keep |q| = 1 where a rotation is prescribed."""
    rng = np.random.default_rng(3)
    with solvers_of(kind, model) as (problem, *_):
        rows, model = problem.ties, problem.model
        problem.set_state(problem.x)
        multipliers = problem.numbering.first_multiplier + np.arange(problem.numbering.multipliers)
        places, turned = np.append(rows.rows, multipliers), model.name == "spatial" and not hasattr(rows, "begin")
        count, added = model.tied_at_rest.size, list(model.signature.connections.equations)

        def see(y):
            unknowns = np.zeros(problem.numbering.size)
            unknowns[places] = y
            rows.see(unknowns)

        def residual(y):
            see(y)
            found = np.zeros(problem.numbering.size)
            rows.add_residual(found, ETA)
            return found[places]

        def random(size):
            y = np.append(model.tied_at_rest, np.zeros(len(added))) + size * rng.normal(size=count + len(added))
            if turned:
                quaternions_of(y)[:] /= np.linalg.norm(quaternions_of(y), axis=1, keepdims=True)
            return y

        def quaternions_of(y):
            return y[:count].reshape(-1, model.components)[:, 3:7]

        if hasattr(rows, "begin"):
            see(random(0.05))
            rows.begin(model.ties)
        y = random(0.2)
        see(y)
        of_nodes, reactions, equations = tangent_of_ties(rows, ETA)
        J = np.block([[of_nodes, reactions], [equations, np.zeros((len(added), len(added)))]])
        for column in np.eye(len(y)):
            if turned:
                q, dq = quaternions_of(y), quaternions_of(column)
                dq -= (q * dq).sum(axis=1, keepdims=True) * q
            change = (residual(y + STEP * column) - residual(y - STEP * column)) / (2 * STEP)
            np.testing.assert_allclose(change, J @ column, atol=1e-8)


@pytest.mark.once
@pytest.mark.parametrize("kind", ["determinate", "planar", "spatial", "momentum", "energy", "generalised-alpha"])
def test_models_that_differ_in_their_meshes_share_the_work_of_ufl(kind, monkeypatch):
    """To the last digit of what UFL alone gives, whichever is built first: also what actions remember, second functions
    for one vector in P1, what resists small velocities, and derivatives, which ask UFL again."""
    load = "loads[0].force[2]"
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), cf.Tube(0.1, 0.08), cf.Material(E=1e9, nu=0.3, density=2000.0))
    loads = [cf.Force(rod.end, (1e2, 0, -2e2)), cf.Weight((0, 0, -9.81), permanent=True)]
    loads += [cf.Spring(rod.at(1.0), 1e3)] if kind in ("planar", "momentum") else []
    loads += [cf.Plane((0, 0, -0.06), (0, 0, 1), friction=0.3)] if kind in ("spatial", "generalised-alpha") else []
    scene, shared, on = cf.Scene([rod], [cf.Clamp(rod.start)], loads), set(), compiled.Pattern.on
    damped = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Dashpot(rod.end, 10.0)])

    def solved(elements):
        for idle in ("_idle_of_all", "_idle_of_one"):
            monkeypatch.setattr(PROBLEMS, idle, [])
        if kind in SCHEMES:
            more = {"model": "planar"} if kind == "momentum" else {"degree": 1} if kind == "energy" else {}
            history = cf.simulate(scene, 0.02, dt=0.004, scheme=kind, elements=elements, **more)
            found = [history.position(rod.end), history.force(rod.start), history.dissipated]
        else:
            path = cf.solve(scene, [0.5, 1.0], elements=elements, model=kind)
            found = [path.position(rod.end), path.moment(rod.start)]
            if kind != "spatial":
                found.append(path.sensitivity(lambda x: x.position(rod.end)[-1], [load])[load])
            if kind == "determinate":
                found.append(cf.modes(damped, 2, elements=elements).eigenvalues.view(float))
        return np.concatenate([np.ravel(x) for x in found])

    monkeypatch.setattr(compiled.Pattern, "on", lambda self, model, *x: shared.add(type(model)) or on(self, model, *x))
    monkeypatch.setattr(compiled, "_PATTERNS", {})
    stored = compiled.Pattern.stored
    monkeypatch.setattr(compiled.Pattern, "stored", lambda kind: None)
    first = solved(6)
    assert not shared
    second = solved(4)
    assert shared == {of for of, *_ in compiled._PATTERNS}
    compiled._PATTERNS.clear()
    assert np.array_equal(solved(4), second) and np.array_equal(solved(6), first)
    kinds = list(compiled._PATTERNS)
    for clear in (compiled._PATTERNS, shared, compat._MODULES, compat._NAMES):
        clear.clear()
    monkeypatch.setattr(compiled.Pattern, "stored", stored)  # as of another process
    assert np.array_equal(solved(6), first) and shared == {of for of, *_ in kinds}
    monkeypatch.setattr(compiled.code_cache, "load", lambda name: None)  # the code is lost
    compat._MODULES.clear()
    assert None in [stored(kind) for kind in kinds]
