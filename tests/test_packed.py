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
        with solvers.solvers_of(scene, layout, formulation=formulation, degree=degree) as (problem, _, stability):
            model, forms = problem.model, problem.model.forms
            moving = [model.state, *model.carried]
            if packed is None:
                kinds = forms.residual, forms.tangent, forms.second_variations[0]
                packed = [Packed(form, moving, model.constants) for form in kinds]
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
                    np.testing.assert_allclose(found, local.array_r, rtol=0, atol=1e-14 * np.abs(found).max())
                A = model.numbering.matrix(model.cell_dofs, np.empty(0, dtype=int))
                for form, mine, A in (
                    (forms.tangent, packed[1], A),
                    (forms.second_variations[0], packed[2], stability.parts[0].K),
                ):
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
