"""The forms: Taylor test of every tangent, balance under rigid motions, and the second variation."""

import dense
import numpy as np
import pytest
from conftest import column
from mpi4py import MPI

import cosserat_fenicsx as cf
from cosserat_fenicsx.models.formulation import OF_MOTION, Displacement, Mixed, Multiplier
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.statics.problem import Problem
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
