"""FFCx's kernels, called by address: the same vectors, matrices and values as dolfinx gives on each of its releases."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
import ufl
from conftest import column
from dolfinx import cpp, fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat
from cosserat_fenicsx.models.formulation import Displacement, Mixed
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.models.spatial import SpatialModel

pytestmark = pytest.mark.serial


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
