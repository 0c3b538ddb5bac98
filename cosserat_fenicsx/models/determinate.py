"""The determinate rungs: theta in P_p alone in a plane, q alone in space; statics gives n, and r follows."""

import numpy as np
from dolfinx import cpp

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.base import RodModel
from cosserat_fenicsx.models.determinate_forms import compile_in_plane, compile_in_space
from cosserat_fenicsx.models.planar import PlaneModel, in_space
from cosserat_fenicsx.models.rod_data import gauss_function
from cosserat_fenicsx.models.trees import Tree
from cosserat_fenicsx.quaternions import conjugate_product, directors


class _KnownForce(RodModel):
    """Scenes whose rods are trees, each held by one clamp alone, under dead forces."""

    name = "determinate"

    def _compile(self, spaces):
        self._displacements = compat.function_space(self.mesh, compat.lagrange(self.mesh, self.shape.degree, 3))
        self._force = gauss_function(self.mesh, self.shape.points, self.force_size)
        self._tree = Tree(self.shape)
        return self._compile_with(self._displacements, spaces[-1], self._force)

    def _round_off(self, sizes):
        """|F| cannot fall below its own rounding; here it holds moments alone."""
        eps, p = np.finfo(float).eps, self.shape.degree
        return 4 * eps * self.section.J[..., :2].max() * p / sizes.min() * np.sqrt(self.unknowns)

    def load(self, scene, layout):
        """See `RodModel`; statics gives the contact force."""
        super().load(scene, layout)
        nodal = self._nodal_forces()
        self.load_norm = float(np.linalg.norm(nodal))
        self._known = self._tree.forces(nodal, self.rule)
        self.rods.fill(self._force, self._known)

    def _nodal_forces(self):
        """(N, d) what the dead forces do on the displacements of the nodes, the scene's order, all ranks."""
        total = np.zeros((len(self.reference), self.force_size))
        if self.forms.force is None:
            return total
        form = compat.kernel(self.forms.force)
        local = np.zeros((len(self._slots), 3))
        cpp.fem.assemble_vector(local.reshape(-1), form, cpp.fem.pack_constants(form), cpp.fem.pack_coefficients(form))
        np.add.at(total, self._slots, local[:, : self.force_size])
        return self.comm.allreduce(total) if self.comm.size > 1 else total

    def _sizes(self):
        """(elements,) lengths."""
        return self.layout.sizes(self.scene) / self.scales.length


class DeterminateInPlane(_KnownForce, PlaneModel):
    """Theta alone."""

    components, moves, turn = 1, 0, 1.0
    variations = ((1, False), (2, True))
    tangent = "symmetric"
    _compile_with = compile_in_plane

    def _at_rest(self):
        return np.zeros((len(self.reference), 1))

    def _variation_axes(self):
        e1, e2, e3 = self.axes
        none = np.zeros(3)
        return np.array([[*none, *e3]]), np.array([[*none, *e1], [*none, *e2]])

    def unknowns_of(self, rq):
        """See `RodModel`."""
        return self._angles(rq)[..., None]

    def expansion(self):
        """See `RodModel`."""
        axes, offset, section = self.axes, self._out_of_plane(), self.section
        known, rule, tree, sizes = self._known, self.rule, self._tree, self._sizes()
        rest, basis, K_inv = self.reference @ axes[:2].T, rule.basis(rule.gauss), 1 / section.K

        def expand(load_factors, nodal, gauss):
            theta = nodal[..., 0]
            inside = theta[:, tree.cell_nodes]
            turned, curvature = inside @ basis.T, inside @ rule.slopes.T / sizes[:, None]
            c, s = np.cos(turned), np.sin(turned)
            t1, t2 = section.R_R[..., 0], section.R_R[..., 1]
            t = np.stack([c * t1 - s * t2, s * t1 + c * t2], axis=-1)
            a = np.stack([-t[..., 1], t[..., 0]], axis=-1)
            n = np.multiply.outer(load_factors, known)
            sheared = section.v_R[..., 0] + K_inv[..., 0] * np.einsum("...i,...i", a, n)
            stretched = section.v_R[..., 1] + K_inv[..., 2] * np.einsum("...i,...i", t, n)
            r_s = sheared[..., None] * a + stretched[..., None] * t
            r = tree.positions(r_s * sizes[:, None, None], rest, rule)
            return in_space(axes, offset, r, theta, n, section.J[..., 1] * curvature, r_s)

        return expand


class DeterminateInSpace(_KnownForce):
    """The quaternion q alone."""

    components, moves, turn = 4, 0, 2.0
    variations = ((3, False),)
    _compile_with = compile_in_space

    def _at_rest(self):
        return np.tile([1.0, 0, 0, 0], (len(self.reference), 1))

    def _variation_axes(self):
        return (np.eye(6)[3:],)

    def unknowns_of(self, rq):
        """See `RodModel`."""
        return rq[..., 3:]

    def expansion(self):
        """See `RodModel`."""
        section, known, rule, tree, sizes = self.section, self._known, self.rule, self._tree, self._sizes()
        rest, basis, K_inv = self.reference, rule.basis(rule.gauss), 1 / section.K
        R_R = section.R_R.reshape(*section.K.shape, 3)

        def expand(load_factors, nodal, gauss):
            inside = nodal[:, tree.cell_nodes].swapaxes(2, 3)  # (k, elements, 4, p + 1)
            q = np.moveaxis(inside @ basis.T, 3, 2)
            q_s = np.moveaxis(inside @ rule.slopes.T, 3, 2) / sizes[:, None, None]
            squared = np.einsum("...i,...i", q, q)[..., None]
            R = directors((q / np.sqrt(squared)).reshape(-1, 4)).reshape(*q.shape[:-1], 3, 3)
            T = R @ R_R
            n = np.multiply.outer(load_factors, known)
            strain = section.v_R + K_inv * np.einsum("...ij,...i", T, n)
            r_s = np.einsum("...ij,...j", T, strain)
            curvature = np.einsum("...ij,...i", R_R, 2 * conjugate_product(q, q_s) / squared)
            m = np.einsum("...ij,...j", T, section.J * curvature)
            r = tree.positions(r_s * sizes[:, None, None], rest, rule)
            return np.concatenate([r, nodal], axis=-1), np.concatenate([n, m, r_s], axis=-1)

        return expand
