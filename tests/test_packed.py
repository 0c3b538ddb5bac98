"""Packed forms assemble the same as dolfinx does, at any state, also after another scene was loaded."""

import numpy as np
import pytest
from conftest import COMM, column
from dolfinx.fem import petsc as fem_petsc

from cosserat_fenicsx.algebra.building import Packed, functions_in_lanes, take_together
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.statics.problem import solvers_of

pytestmark = pytest.mark.ranks


@pytest.mark.parametrize("formulation", ["mixed", "displacement", "multiplier"])
@pytest.mark.parametrize("degree", [1, 3])
def test_packed_forms_are_the_forms(formulation, degree):
    """Every part of a form to the last digit, and their sum."""
    random = np.random.default_rng(COMM.rank)
    packed = None
    for length in (20.0, 30.0):
        _, scene = column(arm=True, length=length)
        layout = Layout.of(scene, 3)
        with solvers_of(scene, layout, formulation=formulation, degree=degree) as (problem, _, _):
            model, forms = problem.model, problem.model.forms
            moving = [model.state, *model.carried]
            compiled = forms.residual, forms.tangent, forms.second_variations[0]
            assert [len(parts) for parts in compiled] == [2, 2, 2]
            if packed is None:
                factors = model.load_factor, model.permanent_factor
                packed = [[Packed(form, moving, factors) for form in (*parts, parts)] for parts in compiled]
            for form in (form for forms in packed for form in forms):
                form.refresh()
            for eta in (0.3, 0.8):
                problem.set_load_factor(eta)
                for function in moving:
                    function.x.array[:] = random.normal(size=len(function.x.array))
                    function.x.scatter_forward()
                total = 0
                for part, mine in zip(forms.residual, packed[0], strict=False):
                    with fem_petsc.assemble_vector(part).localForm() as local:
                        found = np.zeros(len(local.array_r))
                        mine.add_to_vector(found)
                        np.testing.assert_array_equal(found, local.array_r)
                        total += found
                found = np.zeros(len(total))
                packed[0][-1].add_to_vector(found)
                np.testing.assert_allclose(found, total, rtol=0, atol=1e-14 * np.abs(total).max(initial=0))
                for parts, (*mine, together) in zip(compiled[1:], packed[1:], strict=True):
                    total = assembled(parts[0], together.add_to_matrix)
                    size = total.norm()
                    for part, my in zip(parts, mine, strict=True):
                        whole = assembled(part, lambda A, part=part: fem_petsc.assemble_matrix(A, part))
                        total.axpy(-1.0, whole)
                        assert whole.norm() > 0
                        whole.axpy(-1.0, assembled(part, my.add_to_matrix))
                        assert whole.norm() == 0
                    assert total.norm() < 1e-14 * size
                    half = Packed(parts, moving, factors, symmetric=True)
                    whole = assembled(parts[0], together.add_to_matrix)
                    whole.axpy(1.0, whole.copy().transpose())
                    whole.axpy(-2.0, assembled(parts[0], half.add_to_matrix))
                    assert whole.norm() < 1e-14 * size
                    np.testing.assert_array_equal(half.matrices(), half.matrices().swapaxes(1, 2))


def test_several_elements_at_once_are_each_alone():
    """A residual of two parts, of numbers of elements that are no multiples of how many are computed at once."""
    random, packed = np.random.default_rng(COMM.rank), None
    for length in (20.0, 30.0):
        _, scene = column(arm=True, length=length)
        with solvers_of(scene, Layout.of(scene, 3), formulation="displacement", degree=2) as (problem, _, _):
            model = problem.model
            if packed is None:
                factors = model.load_factor, model.permanent_factor
                packed = [Packed(model.forms.residual, [model.state], factors) for _ in range(2)]
                parts = [*packed[0].parts()]
                packed[1].take_together(functions_in_lanes(tuple(part.address for part in parts), 4))
                assert len(parts) == 2 and (COMM.size > 1 or parts[0].elements % 4)
            found, size = [], len(model.state.x.array)
            model.state.x.array[:] = random.normal(size=size)
            problem.set_load_factor(0.3)
            for form in packed:
                form.refresh()
                model.state.x.array[:] += 0.1
                problem.set_load_factor(0.8)
                found.append(np.zeros(size))
                form.add_to_vector(found[-1])
                model.state.x.array[:] -= 0.1
            np.testing.assert_allclose(*found, rtol=0, atol=1e-14 * np.abs(found[0]).max(initial=0))


@pytest.mark.parametrize("elements", [7, 8])
def test_tangents_of_several_elements_at_once(elements):
    """The motion by a tangent and the negative modes are those of elements one by one."""
    random, (_, scene) = np.random.default_rng(0), column(arm=True)
    with solvers_of(scene, Layout.of(scene, elements), degree=2) as (problem, _, stability):
        forms = [problem._residual, problem.tangent_form, stability.whole.form]
        b, x = problem.numbering.vector(), problem.numbering.vector()
        problem.x.array_w[:] += 1e-3 * random.normal(size=problem.numbering.size)
        problem.set_load_factor(0.3)
        found = []
        for many in (False, True):
            if many:
                take_together(*forms)
            for form in forms:
                form.refresh()
            problem.function(problem.x, b)
            problem.factor()
            assert problem.solve(b, x)
            found.append((x.array_r.copy(), stability.count(), stability.logarithm))
        for form in forms:
            form.c.together = form._ffi.NULL
        np.testing.assert_allclose(found[0][0], found[1][0], rtol=0, atol=1e-10 * np.abs(found[0][0]).max(initial=0))
        assert found[0][1] == found[1][1] and found[0][2] == pytest.approx(found[1][2], abs=1e-8)


def assembled(form, add):
    """The matrix of a form's shape to which `add` adds."""
    A = fem_petsc.create_matrix(form)
    add(A)
    A.assemble()
    return A
