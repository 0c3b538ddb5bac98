"""The planar model: r in the plane and theta in P_p, dimensionless."""

from functools import partial

import numpy as np
import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms import planar as eq
from cosserat_fenicsx.models.base import RodModel
from cosserat_fenicsx.models.compiled import action_densities, action_work, compile_all, derivative_in, measures
from cosserat_fenicsx.models.rod_data import law_of, stiff_enough, turned


def compile_planar(model, variations):
    """The `CompiledForms` of a `PlanarModel`; its second variations are the one in the plane and the one out of it.

    Args:
        model: supplies mesh, spaces, data and the terms of the actions.
        variations: space of three components per node.
    """
    U, before, step = model.state, model.before, model.step
    U_node = compat.alias(U)
    data, dx = model.data, measures(model)

    def ds(a):
        return a * dx.gauss

    def along(w):
        return w.dx(0)  # the mesh is the line of arc length

    def motion_of(u):
        return eq.motion_of(along(u), u[2], along(u)[2])

    section = eq.section_of(law_of(data.K, data.K_inv, data.J, data.G), data.R_R, data.v_R)
    motion = motion_of(U)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = eq.tests_of(phi, along(phi))
    derivative = derivative_in(trial, U, U_node)
    force = model.signature.formulation.force
    n, phi_n = (None if a is None else eq.in_plane(a) for a in force.symbols(model, U, phi))
    along_step = partial(ufl.derivative, coefficient=before, argument=step)
    weak = force.weak_form(n, phi_n, motion, motion_of(before), section, test, ds, derivative, along_step)
    advance = None if weak.advance is None else ufl.as_vector([weak.advance[0], weak.advance[1]])

    def point_at(place, rest, frame):
        return eq.point_of(*((U, along(U)) if place == "line" else (U_node, along(U_node))), rest=rest, frame=frame)

    acting = action_work(model, dx, test, point_at, (U, U_node))

    psi, w = ufl.TestFunction(variations), ufl.TrialFunction(variations)
    stiff, seconds, variations_of = section._replace(law=stiff_enough(weak.n, data)), [], []
    for tests_of in (eq.tests_of, eq.sideways_tests_of):
        rigid, direction = tests_of(psi, along(psi)), tests_of(w, along(w))
        seconds.append(ds(equilibrium.second_variation(weak.n, motion, stiff, rigid, direction)))
        variations_of.append((rigid, direction))
    m = equilibrium.contact_moment(weak.n, motion, section)
    fields = ufl.as_vector([weak.n[0], weak.n[1], m[2], motion.r_s[0], motion.r_s[1]])
    densities = action_densities(model, point_at)
    contact = ufl.as_vector(list(equilibrium.contact(motion, section)[0])[:2]) if model.carried else None
    return compile_all(
        model, weak.internal, weak.tangent, acting, seconds, derivative, variations=variations_of, fields=fields,
        advance=advance, densities=densities, unknowns=(U, U_node), contact=contact,
    )  # fmt: skip


class PlaneModel(RodModel):
    """Base of planar models: vectors have components along the plane's axes, sections the order (a, e_3, t)."""

    frame_size, strain_size, force_size = 2, 2, 2

    def _section_data(self, data):
        """The law in the order (a, e_3, t), the tangent t_R (2) and the strain v_R = (shear, stretch)."""
        frames = np.einsum("ab,cgbi->cgai", self.axes, data.R_R.reshape(*data.K.shape[:2], 3, 3))
        first = np.abs(frames[:, :, 2, 0]) > np.abs(frames[:, :, 2, 1])  # d_1 along the normal, otherwise d_2 (or any)
        order = np.where(first[:, :, None], [1, 0, 2], [0, 1, 2])
        t = frames[:, :, :2, 2]
        r_s = np.einsum("cgai,cgi->cga", frames, data.v_R)
        shear = t[..., 0] * r_s[..., 1] - t[..., 1] * r_s[..., 0]  # a = e_3 x t
        stretch = np.einsum("cga,cga->cg", t, r_s[..., :2])
        in_plane = data._replace(R_R=t, v_R=np.stack([shear, stretch], axis=2))
        if data.G is None:
            K, J = (np.take_along_axis(values, order, axis=2) for values in (data.K, data.J))
            return in_plane._replace(K=K, J=J)
        return turned(in_plane, _to_plane(t) @ frames)

    def _angles(self, rq):
        """(.., N) theta of (r, q), (.., N, 7): continuous along each rod, beyond full turns too."""
        half = np.arctan2(rq[..., 4:] @ self.axes[2], rq[..., 3])
        ends = np.cumsum([0, *(cells * self.signature.degree + 1 for cells in self.signature.counts)])
        rods = [np.unwrap(half[..., a:b]) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        return 2 * np.concatenate(rods, axis=-1)

    def _out_of_plane(self):
        """(N, 3) the constant component of the positions along the normal, inertial."""
        return np.outer(self.reference @ self.axes[2], self.axes[2])


def _to_plane(t):
    """(.., 3, 3) from components along the plane's axes to those along (a, e_3, t), from the tangents t (.., 2)."""
    P = np.zeros((*t.shape[:-1], 3, 3))
    P[..., 0, 0], P[..., 0, 1], P[..., 1, 2], P[..., 2, :2] = -t[..., 1], t[..., 0], 1.0, t
    return P


def in_space(axes, offset, r, theta, n, m, r_s):
    """Results of a planar model as vectors and quaternions in space.

    Args:
        axes: (3, 3) rows e_1, e_2, e_3; offset: (N, 3) the constant part of the positions.
        r, theta: at the nodes, (k, N, 2) and (k, N); n, m, r_s: at the Gauss points, (.., 2), (..), (.., 2).

    Returns:
        (r, q) (k, N, 7) and (n, m, r') (.., 9), inertial; q is continuous where theta is, beyond full turns too.
    """
    rq = np.concatenate(
        [r @ axes[:2] + offset, np.cos(theta / 2)[..., None], np.sin(theta / 2)[..., None] * axes[2]], axis=-1
    )
    return rq, np.concatenate([n @ axes[:2], m[..., None] * axes[2], r_s @ axes[:2]], axis=-1)


class PlanarModel(PlaneModel):
    """The model for scenes in a plane."""

    name, components, moves, turn = "planar", 3, 2, 1.0
    variations = ((3, False), (3, True))

    def _compile(self, spaces):
        return compile_planar(self, spaces[0])

    def _at_rest(self):
        return np.column_stack([self.reference @ self.axes[:2].T, np.zeros(len(self.reference))])

    def _variation_axes(self):
        e1, e2, e3 = self.axes
        inside, across = np.zeros((3, 6)), np.zeros((3, 6))
        inside[0, :3], inside[1, :3], inside[2, 3:] = e1, e2, e3
        across[0, :3], across[1, 3:], across[2, 3:] = e3, e1, e2
        return inside, across

    def _tie(self):
        super()._tie()
        self._inside, self._tied_off = self._variation_axes()[0], self._out_of_plane()[self.tied_slots]

    def positions(self):
        """See `RodModel`."""
        return self.state.x.array[self._nodal[:, :2]] @ self.axes[:2] + self._out_of_plane()[self._slots]

    def tied_motion(self, values):
        """See `RodModel`."""
        e3, half = self.axes[2], values[:, 2:] / 2
        rq = np.empty((len(values), 7))
        rq[:, :3] = values[:, :2] @ self.axes[:2]
        rq[:, :3] += self._tied_off
        rq[:, 3:4], rq[:, 4:] = np.cos(half), np.sin(half) * e3
        return rq

    def tie_maps(self, values):
        """See `RodModel`."""
        return self._inside.T[None], self._inside[None]

    def held_forces(self, forces):
        """See `RodModel`: those in the plane and about its normal."""
        return forces @ self._inside.T @ self._inside

    def unknowns_of(self, rq):
        """See `RodModel`."""
        return np.concatenate([rq[..., :3] @ self.axes[:2].T, self._angles(rq)[..., None]], axis=-1)

    def expansion(self):
        """See `RodModel`."""
        axes, offset = self.axes, self._out_of_plane()

        def expand(load_factors, nodal, gauss):
            n, m, r_s = gauss[..., :2], gauss[..., 2], gauss[..., 3:]
            return in_space(axes, offset, nodal[..., :2], nodal[..., 2], n, m, r_s)

        return expand
