"""Packed forms assemble the same as dolfinx does, at any state, also after another scene was loaded."""

import numpy as np
import pytest
from conftest import COMM, column
from dolfinx.fem import petsc as fem_petsc

from cosserat_fenicsx.algebra.packed import Packed
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.statics import solvers


@pytest.mark.parametrize("formulation", ["mixed", "displacement", "multiplier"])
@pytest.mark.parametrize("degree", [1, 3])
def test_packed_forms_are_the_forms(formulation, degree):
    random = np.random.default_rng(COMM.rank)
    packed = None
    for length in (20.0, 30.0):
        _, scene = column(arm=True, length=length)
        layout = Layout.of(scene, 3)
        with solvers.solvers_of(scene, layout, formulation=formulation, degree=degree) as (problem, _, _):
            model, forms = problem.model, problem.model.forms
            moving = [model.state, *model.carried]
            compiled = forms.residual, forms.tangent, forms.second_variations[0]
            if packed is None:
                factors = model.load_factor, model.permanent_factor
                packed = [Packed(form, moving, factors) for form in compiled]
            for form in packed:
                form.refresh()
            for eta in (0.3, 0.8):
                problem.set_load_factor(eta)
                for function in moving:
                    function.x.array[:] = random.normal(size=len(function.x.array))
                    function.x.scatter_forward()
                with fem_petsc.assemble_vector(forms.residual).localForm() as local:
                    found = np.zeros(len(local.array_r))
                    packed[0].add_to_vector(found)
                    np.testing.assert_array_equal(found, local.array_r)
                for form, mine in zip(compiled[1:], packed[1:], strict=True):
                    A = fem_petsc.create_matrix(form)
                    matrices = []
                    for add in (lambda A, form=form: fem_petsc.assemble_matrix(A, form), mine.add_to_matrix):
                        A.zeroEntries()
                        add(A)
                        A.assemble()
                        matrices.append(A.copy())
                    difference, whole = matrices
                    size = whole.norm()
                    difference.axpy(-1.0, whole)
                    assert size > 0 and difference.norm() == 0
