"""The determinate models: unknown theta in a plane, q in space, in P_p; statics gives n, and r follows."""

import numpy as np
from dolfinx import cpp

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.base import RodModel
from cosserat_fenicsx.models.determinate_forms import compile_in_plane, compile_in_space
from cosserat_fenicsx.models.laws import moment, strain
from cosserat_fenicsx.models.planar import PlaneModel, in_space
from cosserat_fenicsx.models.rod_data import gauss_function
from cosserat_fenicsx.models.trees import Tree
from cosserat_fenicsx.quaternions import conjugate_product, directors


class _KnownForce(RodModel):
    """Scenes whose rods are trees, each held by one clamp alone, under dead forces."""

    name = "determinate"

    def _compile(self, spaces):
        self._displacements = compat.function_space(self.mesh, compat.lagrange(self.mesh, self.signature.degree, 3))
        self._force = gauss_function(self.mesh, self.signature.points, self.force_size)
        lasting = any(kind.scaled != "load" for kind in self.signature.terms)
        self._permanent = gauss_function(self.mesh, self.signature.points, self.force_size) if lasting else None
        self._tree = Tree(self.signature)
        return self._compile_with(self._displacements, spaces[-1], self._force, self._permanent)

    def _round_off(self, sizes):
        """Bound on the rounding error of |F|, which contains only moments here."""
        eps, p = np.finfo(float).eps, self.signature.degree
        J = self.section.J if self.signature.coupled else self.section.J[..., :2]
        return 4 * eps * J.max() * p / sizes.min() * np.sqrt(self.unknowns)

    def load(self, scene, layout):
        """See `RodModel`; statics gives the contact force."""
        super().load(scene, layout)
        self.load_norm = 0.0
        self._known = self._take(self.forms.force, self._force)
        self._lasting = 0.0 if self._permanent is None else self._take(self.forms.permanent_force, self._permanent)

    def _take(self, forms, function):
        """The contact force at the Gauss points that balances dead forces; also stored in a Function."""
        nodal = self._nodal_forces(forms)
        self.load_norm += float(np.linalg.norm(nodal))
        known = self._tree.forces(nodal, self.rule)
        self.rods.fill(function, known)
        return known

    def _nodal_forces(self, forms):
        """(N, d) nodal forces equivalent to the dead forces, in the scene's order, on all ranks."""
        total, local = np.zeros((len(self.reference), self.force_size)), np.zeros((len(self._slots), 3))
        for form in map(compat.kernel, forms):
            packed = cpp.fem.pack_constants(form), cpp.fem.pack_coefficients(form)
            cpp.fem.assemble_vector(local.reshape(-1), form, *packed)
        np.add.at(total, self._slots, local[:, : self.force_size])
        return self.comm.allreduce(total) if self.comm.size > 1 else total

    def _sizes(self):
        """(elements,) lengths."""
        return self.layout.sizes(self.scene) / self.scales.length


class DeterminateInPlane(_KnownForce, PlaneModel):
    """Theta alone."""

    components, moves, turn = 1, 0, 1.0
    variations = ((1, False), (2, True))
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
        known, lasting, rule, tree, sizes = self._known, self._lasting, self.rule, self._tree, self._sizes()
        rest, basis = self.reference @ axes[:2].T, rule.at_gauss

        def expand(load_factors, nodal, gauss):
            theta = nodal[..., 0]
            inside = theta[:, tree.cell_nodes]
            turned, curvature = inside @ basis.T, inside @ rule.slopes.T / sizes[:, None]
            c, s = np.cos(turned), np.sin(turned)
            t1, t2 = section.R_R[..., 0], section.R_R[..., 1]
            t = np.stack([c * t1 - s * t2, s * t1 + c * t2], axis=-1)
            a = np.stack([-t[..., 1], t[..., 0]], axis=-1)
            n = np.multiply.outer(load_factors, known) + lasting
            none = np.zeros_like(curvature)
            material = np.stack([np.einsum("...i,...i", a, n), none, np.einsum("...i,...i", t, n)], axis=-1)
            bent = np.stack([none, curvature, none], axis=-1)
            e = strain(section, material, bent)
            sheared, stretched = section.v_R[..., 0] + e[..., 0], section.v_R[..., 1] + e[..., 2]
            r_s = sheared[..., None] * a + stretched[..., None] * t
            r = tree.positions(r_s * sizes[:, None, None], rest, rule)
            return in_space(axes, offset, r, theta, n, moment(section, material, bent)[..., 1], r_s)

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
        section, known, lasting = self.section, self._known, self._lasting
        rule, tree, sizes = self.rule, self._tree, self._sizes()
        rest, basis = self.reference, rule.at_gauss
        R_R = section.R_R.reshape(*section.K.shape, 3)

        def expand(load_factors, nodal, gauss):
            inside = nodal[:, tree.cell_nodes].swapaxes(2, 3)  # (k, elements, 4, p + 1)
            q = np.moveaxis(inside @ basis.T, 3, 2)
            q_s = np.moveaxis(inside @ rule.slopes.T, 3, 2) / sizes[:, None, None]
            squared = np.einsum("...i,...i", q, q)[..., None]
            R = directors((q / np.sqrt(squared)).reshape(-1, 4)).reshape(*q.shape[:-1], 3, 3)
            T = R @ R_R
            n = np.multiply.outer(load_factors, known) + lasting
            curvature = np.einsum("...ij,...i", R_R, 2 * conjugate_product(q, q_s) / squared)
            material = np.einsum("...ij,...i", T, n)
            r_s = np.einsum("...ij,...j", T, section.v_R + strain(section, material, curvature))
            m = np.einsum("...ij,...j", T, moment(section, material, curvature))
            r = tree.positions(r_s * sizes[:, None, None], rest, rule)
            return np.concatenate([r, nodal], axis=-1), np.concatenate([n, m, r_s], axis=-1)

        return expand
