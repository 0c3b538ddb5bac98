"""The forms of `forms/determinate.py` on a model's mesh, compiled: theta alone in a plane, q alone in space."""

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import determinate as eq
from cosserat_fenicsx.forms import planar, spatial
from cosserat_fenicsx.forms.equilibrium import Section, VirtualMotion
from cosserat_fenicsx.forms.point import NONE, Point
from cosserat_fenicsx.forms.rotation import rotation_matrix, rotation_vector
from cosserat_fenicsx.models.compiled import (
    action_densities,
    action_work,
    compile_all,
    derivative_in,
    measures,
)
from cosserat_fenicsx.models.laws import as_matrix, law_of


def compile_in_plane(model, displacements, rotations, N, N_permanent):
    """The `CompiledForms` of a `DeterminateInPlane`; its second variations: in the plane and out of it.

    Args:
        model: supplies mesh, spaces, data and the terms of the actions.
        displacements: space of three components per node, on which the forces do work.
        rotations: space of two components per node, the small rotations about axes in the plane.
        N, N_permanent: the contact force at the Gauss points per unit of the load factor and of the permanent one, two
            components; the latter None where there is no permanent load.
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

    section = planar.section_of(law_of(data.K, data.K_inv, data.J, data.G), data.R_R, data.v_R)
    motion = planar.motion_of((0, 0), U[0], along(U)[0])
    n = planar.in_plane(_known_force(model, N, N_permanent))
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = about_normal(phi)
    derivative = derivative_in(trial, U, U_node)

    def point_at(place, rest, frame):
        theta = (U if place == "line" else U_node)[0]
        return Point(None, None, planar.rotation_matrix(theta), planar.along_normal(theta), rest=rest, frame=frame)

    acting = action_work(model, dx, test, point_at, (U, U_node))
    internal = eq.moments(n, motion, section, test, ds)
    tangent = derivative(internal)

    psi, w = ufl.TestFunction(rotations), ufl.TrialFunction(rotations)
    rigid, direction = about_plane(psi), about_plane(w)
    sideways = ds(eq.second_variation(n, motion, section, rigid, direction))
    return _compiled(
        model, internal, tangent, acting, [tangent, sideways], derivative, [None, (rigid, direction)], dx,
        displacements, point_at, (U, U_node),
    )  # fmt: skip


def compile_in_space(model, displacements, rotations, N, N_permanent):
    """The `CompiledForms` of a `DeterminateInSpace`.

    Args:
        model: supplies mesh, spaces, data and the terms of the actions.
        displacements: space of three components per node, on which the forces do work.
        rotations: space of three components per node, the small rotations.
        N, N_permanent: the contact force at the Gauss points per unit of the load factor and of the permanent one; the
            latter None where there is no permanent load.
    """
    U = model.state
    U_node = compat.alias(U)
    data, dx = model.data, measures(model)

    def ds(a):
        return a * dx.gauss

    def along(w):
        return w.dx(0)

    section = Section(law_of(data.K, data.K_inv, data.J, data.G), as_matrix(data.R_R), data.v_R)
    motion = spatial.motion_of(ufl.as_vector([0, 0, 0]), U, along(U), U_node)
    n = _known_force(model, N, N_permanent)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = eq.quaternion_tests_of(phi, along(phi))
    derivative = derivative_in(trial, U, U_node)

    def point_at(place, rest, frame):
        q = U if place == "line" else U_node
        return Point(None, None, rotation_matrix(q), rotation_vector(q), rest=rest, frame=frame)

    acting = action_work(model, dx, test, point_at, (U, U_node))
    internal = eq.moments(n, motion, section, test, ds) + spatial.unit_quaternion(motion, test) * dx.nodes
    tangent = derivative(internal)

    psi, w = ufl.TestFunction(rotations), ufl.TrialFunction(rotations)
    rigid, direction = eq.tests_of(psi, along(psi)), eq.tests_of(w, along(w))
    second = ds(eq.second_variation(n, motion, section, rigid, direction))
    return _compiled(
        model, internal, tangent, acting, [second], derivative, [(rigid, direction)], dx, displacements, point_at,
        (U, U_node),
    )  # fmt: skip


def _known_force(model, N, N_permanent):
    n = model.load_factor * N
    return n if N_permanent is None else n + model.permanent_factor * N_permanent


def _compiled(
    model, residual, tangent, acting, seconds, derivative, variations, dx, displacements, point_at, unknowns
):
    """The `CompiledForms`, with the virtual work of the dead forces on displacements."""
    moved = VirtualMotion(ufl.TestFunction(displacements), NONE)
    forces = action_work(model, dx, moved, point_at, ())
    densities = action_densities(model, point_at)
    return compile_all(
        model, residual, tangent, acting, seconds, derivative, variations=variations, forces=forces,
        densities=densities, unknowns=unknowns,
    )  # fmt: skip
