"""The determinate rung in a plane: theta in P_p alone, dimensionless; statics gives n, and r follows from it."""

import numpy as np
from dolfinx import cpp
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.determinate_forms import compile_forms
from cosserat_fenicsx.models.planar import PlaneModel, in_space
from cosserat_fenicsx.models.rod_data import gauss_function
from cosserat_fenicsx.models.trees import Tree


class DeterminateModel(PlaneModel):
    """Scenes in a plane whose rods are trees, each held by one clamp alone, under dead forces."""

    name, components, moves, turn = "determinate", 1, 0, 1.0
    variations = ((1, False), (2, True))
    tangent = "symmetric"

    def _compile(self, spaces):
        p = self.shape.degree
        self._displacements = compat.function_space(self.mesh, compat.lagrange(self.mesh, p, 3))
        self._force = gauss_function(self.mesh, self.shape.points, 2)
        self._tree = Tree(self.shape)
        return compile_forms(self, self._displacements, spaces[1], self._force)

    def _at_rest(self):
        return np.zeros((len(self.reference), 1))

    def _variation_axes(self):
        e1, e2, e3 = self.axes
        none = np.zeros(3)
        return np.array([[*none, *e3]]), np.array([[*none, *e1], [*none, *e2]])

    def _round_off(self, sizes):
        """|F| cannot fall below its own rounding; here it holds moments alone."""
        eps, p = np.finfo(float).eps, self.shape.degree
        return 4 * eps * self.section.J[..., 1].max() * p / sizes.min() * np.sqrt(self.unknowns)

    def load(self, scene, layout):
        """See `RodModel`; statics gives the contact force."""
        super().load(scene, layout)
        nodal = self._nodal_forces()
        self.load_norm = float(np.linalg.norm(nodal))
        self._known = self._tree.forces(nodal, self.rule)
        self.rods.fill(self._force, self._known)

    def largest(self, change):
        """See `RodModel`: the unknowns are angles."""
        local = float(np.abs(change).max(initial=0.0))
        return self.comm.allreduce(local, op=MPI.MAX) if self.comm.size > 1 else local

    def _nodal_forces(self):
        """(N, 2) what the dead forces do on the displacements of the nodes, the scene's order, all ranks."""
        total = np.zeros((len(self.reference), 2))
        if self.forms.force is None:
            return total
        form = compat.kernel(self.forms.force)
        local = np.zeros((len(self._slots), 3))
        cpp.fem.assemble_vector(local.reshape(-1), form, cpp.fem.pack_constants(form), cpp.fem.pack_coefficients(form))
        np.add.at(total, self._slots, local[:, :2])
        return self.comm.allreduce(total) if self.comm.size > 1 else total

    def set_motion(self, rq, n):
        """See `RodModel`."""
        self._set_nodes(self._angles(rq)[:, None])

    def expansion(self):
        """See `RodModel`."""
        axes, offset, section = self.axes, self._out_of_plane(), self.section
        known, rule, tree = self._known, self.rule, self._tree
        sizes = self.layout.sizes(self.scene) / self.scales.length
        rest = self.reference @ axes[:2].T
        basis = rule.basis(rule.gauss)
        K_inv = 1 / section.K

        def expand(load_factors, nodal, gauss):
            theta = nodal[..., 0]
            inside = theta[:, tree.cell_nodes]
            turned = inside @ basis.T
            curvature = inside @ rule.slopes.T / sizes[:, None]
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
