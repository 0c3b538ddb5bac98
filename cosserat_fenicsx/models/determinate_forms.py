"""The forms of `forms/determinate.py` on a model's mesh, compiled: theta alone in a plane, q alone in space."""

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import determinate as eq
from cosserat_fenicsx.forms import planar, spatial
from cosserat_fenicsx.forms.equilibrium import Section
from cosserat_fenicsx.forms.loads import Test
from cosserat_fenicsx.forms.rotation import rotation_matrix
from cosserat_fenicsx.models.compiled import (
    compile_all,
    derivative_in,
    load_work,
    measures,
    turned_loads,
    with_live_loads,
)


def compile_in_plane(model, displacements, rotations, N):
    """The `CompiledForms` of a `DeterminateInPlane`; its second variations: in the plane and out of it.

    Args:
        model: supplies mesh, spaces, data and the load terms.
        displacements: space of three components a node, on which the forces work.
        rotations: space of two components a node, the small rotations about axes in the plane.
        N: the contact force at the Gauss points per unit of load factor, two components.
    """
    U = model.state
    U_node = compat.alias(U)
    data, dx = model.data, measures(model)

    def ds(a):
        return a * dx.gauss

    def along(w):
        return w.dx(0)  # the mesh is the line of arc length

    def about_normal(w):
        return eq.tests_of(planar.along_normal(w[0]), planar.along_normal(along(w)[0]))

    def about_plane(w):
        return eq.tests_of(planar.in_plane(w), planar.in_plane(along(w)))

    section = planar.section_of(data.K, data.K_inv, data.J, data.R_R, data.v_R)
    motion = planar.motion_of((0, 0), U[0], along(U)[0])
    n = model.load_factor * planar.in_plane(N)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = about_normal(phi)
    derivative = derivative_in(trial, U, U_node)
    R_node = planar.rotation_matrix(U_node[0])
    loads = load_work(model, dx, test, R_node, (U, U_node))
    internal = eq.moments(n, motion, section, test, ds)
    residual, tangent = with_live_loads(model, loads, internal, derivative(internal), derivative)

    psi, w = ufl.TestFunction(rotations), ufl.TrialFunction(rotations)
    rigid, direction = about_plane(psi), about_plane(w)
    sideways = ds(eq.second_variation(n, motion, section, rigid, direction))
    sideways -= turned_loads(model, loads, rigid, R_node, direction.phi)
    force = _work_of_forces(model, dx, displacements, R_node)
    return compile_all(model, residual, tangent, loads.dead, [tangent, sideways], force=force)


def compile_in_space(model, displacements, rotations, N):
    """The `CompiledForms` of a `DeterminateInSpace`.

    Args:
        model: supplies mesh, spaces, data and the load terms.
        displacements: space of three components a node, on which the forces work.
        rotations: space of three components a node, the small rotations.
        N: the contact force at the Gauss points per unit of load factor.
    """
    U = model.state
    U_node = compat.alias(U)
    data, dx = model.data, measures(model)

    def ds(a):
        return a * dx.gauss

    def along(w):
        return w.dx(0)

    R_R = ufl.as_matrix([[data.R_R[3 * i + j] for j in range(3)] for i in range(3)])
    section = Section(data.K, data.K_inv, data.J, R_R, data.v_R)
    motion = spatial.motion_of(ufl.as_vector([0, 0, 0]), U, along(U), U_node)
    n = model.load_factor * N
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = eq.quaternion_tests_of(phi, along(phi))
    derivative = derivative_in(trial, U, U_node)
    R_node = rotation_matrix(U_node)
    loads = load_work(model, dx, test, R_node, (U, U_node))
    internal = eq.moments(n, motion, section, test, ds) + spatial.unit_quaternion(motion, test) * dx.nodes
    residual, tangent = with_live_loads(model, loads, internal, derivative(internal), derivative)

    psi, w = ufl.TestFunction(rotations), ufl.TrialFunction(rotations)
    rigid, direction = eq.tests_of(psi, along(psi)), eq.tests_of(w, along(w))
    second = ds(eq.second_variation(n, motion, section, rigid, direction))
    second -= turned_loads(model, loads, rigid, R_node, direction.phi)
    force = _work_of_forces(model, dx, displacements, R_node)
    return compile_all(model, residual, tangent, loads.dead, [second], force=force)


def _work_of_forces(model, dx, displacements, R_node):
    """What the dead forces do on displacements alone; or None."""
    moved = Test(ufl.TestFunction(displacements), ufl.as_vector([0, 0, 0]))
    return load_work(model, dx, moved, R_node, ()).dead
