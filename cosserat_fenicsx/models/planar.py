"""The planar model: r in the plane and theta in P_p, dimensionless."""

import itertools

import numpy as np
import ufl

from cosserat_fenicsx.forms import planar as eq
from cosserat_fenicsx.forms.point import NONE
from cosserat_fenicsx.models.base import RodModel
from cosserat_fenicsx.models.compiled import along
from cosserat_fenicsx.models.rod_data import turned


class PlaneModel(RodModel):
    """Base of planar models: vectors have components along the plane's axes, sections the order (a, e_3, t)."""

    frame_size, strain_size, force_size = 2, 2, 2

    def cross_section(self):
        return eq.section_of(self.data.law, self.data.R_R, self.data.v_R)

    def vector(self, a):
        return eq.in_plane(a)

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
        if (np.abs(half[..., 1:] - half[..., :-1]) < np.pi).all():
            return 2 * half
        ends = self.rods.first_nodes(self.signature.degree)
        return 2 * np.concatenate([np.unwrap(half[..., a:b]) for a, b in itertools.pairwise(ends)], axis=-1)

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
    rq, fields = np.empty((*theta.shape, 7)), np.empty((*m.shape, 9))
    half = theta / 2
    rq[..., :3] = r @ axes[:2] + offset
    rq[..., 3], rq[..., 4:] = np.cos(half), np.sin(half)[..., None] * axes[2]
    for first, part in ((0, n), (6, r_s)):
        fields[..., first : first + 3] = part @ axes[:2]
    fields[..., 3:6] = m[..., None] * axes[2]
    return rq, fields


class PlanarModel(PlaneModel):
    """The model for scenes in a plane."""

    name, components, moves, turn = "planar", 3, 2, 1.0
    variations = (
        (3, False, lambda w: eq.tests_of(w, along(w))),
        (3, True, lambda w: eq.sideways_tests_of(w, along(w))),
    )

    def motion_of(self, w, nodal):
        return eq.motion_of(along(w), w[2], along(w)[2])

    def tests_of(self, phi, motion):
        return eq.tests_of(phi, along(phi))

    def point_of(self, w, w_t=None, *, rest, frame):
        r_t, omega = (NONE, NONE) if w_t is None else (eq.in_plane(w_t), eq.along_normal(w_t[2]))
        return eq.point_of(w, along(w), rest=rest, frame=frame, r_t=r_t, omega=omega)

    def components_of(self, n):
        return ufl.as_vector([n[0], n[1]])

    def fields_of(self, n, m, r_s):
        return ufl.as_vector([n[0], n[1], m[2], r_s[0], r_s[1]])

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
        self._inside, self.tied_off = self._variation_axes()[0], self._out_of_plane()[self.tied_slots]

    def positions(self):
        return self.state.x.array[self.nodal[:, :2]] @ self.axes[:2] + self._out_of_plane()[self.slots]

    def tied_motion(self, values):
        e3, half = self.axes[2], values[:, 2:] / 2
        rq = np.empty((len(values), 7))
        rq[:, :3] = values[:, :2] @ self.axes[:2]
        rq[:, :3] += self.tied_off
        rq[:, 3:4], rq[:, 4:] = np.cos(half), np.sin(half) * e3
        return rq

    def tie_maps(self, values):
        return self._inside.T[None], self._inside[None]

    def held_forces(self, forces):
        """See `RodModel`: those in the plane and about its normal."""
        return forces @ self._inside.T @ self._inside

    def unknowns_of(self, rq):
        return np.concatenate([rq[..., :3] @ self.axes[:2].T, self._angles(rq)[..., None]], axis=-1)

    def expansion(self):
        axes, offset = self.axes, self._out_of_plane()

        def expand(load_factors, nodal, gauss):
            n, m, r_s = gauss[..., :2], gauss[..., 2], gauss[..., 3:]
            return in_space(axes, offset, nodal[..., :2], nodal[..., 2], n, m, r_s)

        return expand
