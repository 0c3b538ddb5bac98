"""The spatial model: r and q in P_p, dimensionless; the form of circulatory actions on its unknowns; the viscous law,
and the model of all that resists small velocities about a state. And the planar model: r in the plane and theta.
"""

import contextlib
import itertools
from dataclasses import replace
from functools import partial

import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import law, planar
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.forms.equilibrium import VirtualMotion, balance, frame
from cosserat_fenicsx.forms.point import NONE, slowed
from cosserat_fenicsx.models.base import RodModel
from cosserat_fenicsx.models.compiled import (
    CompiledForms,
    acting_at,
    action_work,
    along,
    compile_parts,
    shared,
    measures,
    nonzero,
    section_of,
    varied_actions,
)
from cosserat_fenicsx.models.rod_data import gauss_function, joined, law_data, law_of, turned, viscous_values
from cosserat_fenicsx.numerics import small_rotations, spun
from cosserat_fenicsx.scene.rod import Damping


def small_motion_of(w):
    """The `VirtualMotion` of small displacements and rotations (r, theta)."""
    return eq.rotation_tests_of(w, along(w))


_EYE = np.eye(3)


class SpatialModel(RodModel):
    """The model for any scene."""

    name, kind, moves, turn = "spatial", "SPATIAL", 3, 2.0
    variations = ((6, False, small_motion_of),)

    def __init__(self, comm, signature):
        formulation = signature.formulation
        self.multipliers, self.rows_turn = formulation.multipliers, formulation.galerkin
        self.components = 7 + self.multipliers
        super().__init__(comm, signature)

    def _compile(self, spaces):
        self.stiffness = fem.Constant(self.mesh, np.float64(1))  # of the second variation, see `stress_alone`
        return super()._compile(spaces)

    def motion_of(self, w, nodal):
        return eq.state_of(w, along(w), nodal)

    def tests_of(self, phi, motion):
        return self.signature.formulation.tests(phi, along(phi), motion.q, motion.q_s)

    def point_of(self, w, w_t=None, *, rest, frame):
        r_t, omega = (NONE, NONE) if w_t is None else eq.velocities(w, w_t)
        return eq.point_of(w, along(w), rest=rest, frame=frame, r_t=r_t, omega=omega)

    def constraint(self, motion, test, nodal, phi):
        return self.signature.formulation.equations(motion, test, nodal, phi)

    def _at_rest(self):
        others = [1.0, 0, 0, 0, *self.multipliers * [0.0]]
        return np.column_stack([self.reference, np.tile(others, (len(self.reference), 1))])

    def _variation_axes(self):
        return (np.eye(6),)

    def positions(self):
        return self.state.x.array[self.nodal[:, :3]]

    def tied_motion(self, values):
        return values[:, :7]

    def tie_maps(self, values):
        size, q = self.components, values[:, 3:7]
        of_moments = self.signature.formulation.rows_of_moments(q)
        trial, test = np.zeros((len(values), 6, size)), np.zeros((len(of_moments), size, 6))
        trial[:, :3, :3] = test[:, :3, :3] = _EYE
        test[:, 3:, 3:] = of_moments
        trial[:, 3:, 3:7] = small_rotations(q)
        return trial, test

    def small_motion_maps(self, tangent):
        """See `RodModel`: the row of the scalar component of q is |q|^2 = 1, whose derivative is along q."""
        along, rows = tangent[:, 3, 3:7], np.zeros((6, 7))
        squared = np.square(along).sum(axis=1)[:, None, None]
        rows[:3, :3], rows[3:, 4:] = _EYE, _EYE
        motion, rest = np.zeros((len(tangent), 7, 6)), np.zeros((len(tangent), 7, 7))
        motion[:, :3, :3] = _EYE
        q = along / np.sqrt(squared[:, :, 0])
        motion[:, 3:, 3:] = spun(q[:, None], _EYE).swapaxes(1, 2)
        rest[:, 3:, 3] = along / squared[:, :, 0]
        return rows, motion, rest

    def turned_reactions(self, values, reactions):
        turned = self.signature.formulation.turned_rows(values[:, 3:7], reactions[:, 3:])
        return np.pad(turned, ((0, 0), (3, 0), (3, 0)))

    def unknowns_of(self, rq):
        """See `RodModel`; multipliers start at zero, to which they converge under refinement."""
        return np.pad(rq, ((0, 0),) * (rq.ndim - 1) + ((0, self.multipliers),)) if self.multipliers else rq

    @contextlib.contextmanager
    def stress_alone(self):
        """Context in which the second variation has only the geometric stiffness of contact force, moment and loads."""
        self.stiffness.value = 0.0
        try:
            yield
        finally:
            self.stiffness.value = 1.0

    def shape_of(self, change):
        """(N, 3) displacements of all nodes, scene's order, on all ranks, from a change of this rank's vector."""
        vector, local = self.numbering.vector(), np.zeros_like(self.state.x.array)
        vector.array_w[:] = change
        self.numbering.to_local(vector, local)
        return self._gather_nodes(local[self.nodal[: self.owned_nodes, :3]])

    def everywhere(self, motion):
        """(N, 6) a motion of all nodes in the scene's order, on all ranks, from that of this rank's free nodes, (nodes,
        6), in the order of its part of the solver's vector."""
        numbering, local = self.second_variations[0].numbering, np.zeros((len(self.nodal), 6))
        vector = numbering.vector()
        vector.array_w[:] = motion.ravel()
        numbering.to_local(vector, local.reshape(-1))
        return self._gather_nodes(local[: self.owned_nodes])

    def change_of(self, motion):
        """This rank's change of the solver's vector by (r, theta) in the second variation's numbering."""
        state, nodal = self.state.x.array, self.nodal
        moved, change = np.zeros(6 * len(nodal)), np.zeros_like(state)
        self.second_variations[0].numbering.to_local(motion, moved)
        moved = moved.reshape(-1, 6)
        change[nodal[:, :3]] = moved[:, :3]
        change[nodal[:, 3:7]] = spun(state[nodal[:, 3:7]], moved[:, 3:])
        vector = self.numbering.vector()
        self.numbering.from_local(change, vector)
        return vector.array_r.copy()

    def expansion(self):
        return lambda load_factors, nodal, gauss: (nodal[..., :7], gauss)


class CirculatoryModel(SpatialModel):
    """A `SpatialModel` whose only form shows whether the actions on rods have a potential.

    The virtual work of the actions is a one-form omega on the configurations. If its exterior derivative d omega
    vanishes for all motions that the supports allow, the actions have a potential near that state, and the second
    variation is symmetric. Otherwise -d omega/2 is the skew-symmetric part of the second variation (circulatory forces,
    Ziegler). The form is h of `_form`, stored as the second variation. h is None, and nothing is compiled, if the
    actions have a potential in every state, as dead forces have.
    """

    def _compile(self, spaces):
        return shared(self, spaces, lambda: CompiledForms(**compile_parts(self, {0: self._form(*spaces)}, {}, None)))

    def _form(self, rotations):
        """h with d omega(w, psi) = h(w, psi) - h(psi, w): h(w, psi) = D_w omega(psi) + omega(w x psi)/2, because the
        Lie bracket of two fields of inertial rotations is their cross product. h is assembled, rather than d omega,
        because its norm gives the rounding error of d omega."""
        U, U_node, dx = self.state, compat.alias(self.state), measures(self)
        psi, w = ufl.TestFunction(rotations), ufl.TrialFunction(rotations)
        test, direction = small_motion_of(psi), small_motion_of(w)

        def point_at(place, rest, frame):
            return self.point_of(U if place == "line" else U_node, rest=rest, frame=frame)

        work = partial(action_work, self, dx, point_at=point_at, unknowns=(U, U_node))
        form = varied_actions(work(test), test, direction)
        bracket_s = ufl.cross(direction.phi_s, test.phi) + ufl.cross(direction.phi, test.phi_s)
        of_bracket = work(VirtualMotion(NONE, ufl.cross(direction.phi, test.phi), NONE, bracket_s))
        for factor, part in (
            *((self.load_factor, part) for part in of_bracket.dead.values()),
            *((self.permanent_factor, part) for part in of_bracket.permanent.values()),
            *((live.factor, live.form) for live in of_bracket.live),
        ):
            form += 0.5 * factor * part
        return form or None

    @property
    def remembers(self):
        """Whether an action has memory: its work then depends on the path, and it has no potential."""
        return any(kind.memory for kind in self.signature.terms)

    def take(self, rq, load_factor):
        """Set the state from (r, q) of all nodes (N, 7), dimensionless, in the scene's order, and a load factor."""
        self.set_motion(self.unknowns_of(rq), np.zeros((sum(self.signature.counts), len(self.forms.gauss), 3)))
        self.load_factor.value = load_factor
        self.actions.refresh()

    def held(self, rq, load_factor):
        """Gradients of the constraint equations of supports and joints, (equations, tied nodes, 6)."""
        if not self.ties:
            return np.zeros((0, 0, 6))
        return self.ties.pattern.on_nodes(self.ties.evaluate(rq[self.tied_slots], load_factor)[1])


class Damped:
    """Mixin that adds the viscous law (Kelvin-Voigt) to a `RodModel`; viscosity: the Functions of the law of the strain
    rates, as `rod_data.law_of` takes them; damped: whether any rod has damping."""

    def _viscous_fields(self):
        """Make the Functions of the viscous law."""
        mesh, points, coupled = self.mesh, self.signature.points, self.signature.coupled
        Kt, Jt = (gauss_function(mesh, points, 9 if coupled else 3) for _ in range(2))
        self.viscosity = Kt, None, Jt, gauss_function(mesh, points, 9) if coupled else None

    def _damp(self):
        """Fill in the viscosity of the rods; against strains that infinite stiffnesses prevent it is 0."""
        scene, layout, coupled = self.scene, self.layout, self.signature.coupled
        damped = [rod.damping or Damping() for rod in scene.rods]
        units = replace(self.scales, force=self.scales.force * self.time)
        with np.errstate(invalid="ignore"):  # 0 times an infinite stiffness
            given = joined([
                law_data(damping.viscosity(rod.stiffness_at(x * rod.length)), units, coupled=coupled)
                for rod, damping, x in zip(scene.rods, damped, layout.inside(self.rule.gauss), strict=True)
            ])  # fmt: skip
        given = given._replace(K=np.where(np.isfinite(given.K), given.K, 0.0))
        data = self._section_data(self._in_space._replace(**given._asdict()))
        for function, values in zip(self.viscosity, viscous_values(data), strict=True):
            if function is not None:
                self.rods.fill(function, values)
        self.damped = damped != [Damping()] * len(damped)


class ResistingModel(Damped, CirculatoryModel):
    """A `SpatialModel` whose only form, stored as the second variation, is the virtual work of what resists small
    velocities: -d(virtual work)/d(velocities), of the viscous law and of all actions, at a state at rest."""

    def _compile(self, spaces):
        self._viscous_fields()
        return super()._compile(spaces)

    def _form(self, rotations):
        U, U_node, dx = self.state, compat.alias(self.state), measures(self)
        test, velocity = small_motion_of(ufl.TestFunction(rotations)), small_motion_of(ufl.TrialFunction(rotations))
        motion, section = self.motion_of(U, U_node), section_of(self)
        T = frame(motion, section)
        rates = T.T * (velocity.phi_r_s - ufl.cross(velocity.phi, motion.r_s)), T.T * velocity.phi_s
        form = balance(*(T * a for a in law.stress(law_of(*self.viscosity), *rates)), motion, test) * dx.gauss

        def point_at(place, rest, frame):
            return self.point_of(U if place == "line" else U_node, rest=rest, frame=frame)

        for _, term, factor, point in acting_at(self, point_at):
            change = slowed(term.work, point, test, velocity)
            measure = {"point": dx.ends, "line": dx.gauss, "node": dx.nodes}[term.kind.place]
            resisted = nonzero(-factor * change * measure)
            form = form if resisted is None else form + resisted
        return form

    def load(self, scene, layout, time):
        """See `RodModel`; time: the unit of time, s."""
        self.time = time
        super().load(scene, layout)
        self._damp()


class PlaneModel(RodModel):
    """Base of planar models: vectors have components along the plane's axes, sections the order (a, e_3, t)."""

    frame_size, strain_size, force_size = 2, 2, 2

    def cross_section(self):
        return planar.section_of(self.data.law, self.data.R_R, self.data.v_R)

    def vector(self, a):
        return planar.in_plane(a)

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


class PlanarModel(PlaneModel):
    """The model for scenes in a plane."""

    name, kind, components, moves, turn = "planar", "PLANAR", 3, 2, 1.0
    variations = (
        (3, False, lambda w: planar.tests_of(w, along(w))),
        (3, True, lambda w: planar.sideways_tests_of(w, along(w))),
    )

    def motion_of(self, w, nodal):
        return planar.motion_of(along(w), w[2], along(w)[2])

    def tests_of(self, phi, motion):
        return planar.tests_of(phi, along(phi))

    def point_of(self, w, w_t=None, *, rest, frame):
        r_t, omega = (NONE, NONE) if w_t is None else (planar.in_plane(w_t), planar.along_normal(w_t[2]))
        return planar.point_of(w, along(w), rest=rest, frame=frame, r_t=r_t, omega=omega)

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
