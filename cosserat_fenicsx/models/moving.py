"""Models that move: a rung with inertia, between the two ends of a step in time."""

import math

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.connections import ties_of
from cosserat_fenicsx.models.moving_forms import SpatialStep, compile_momentum
from cosserat_fenicsx.models.rod_data import check_inertia, gauss_function, nodal_inertia, rod_data
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.scene.damping import Damping


class Moving:
    """What a rung adds to a `RodModel` to move; it must come first among the bases.

    Inertia is integrated with the nodes as points, as |q| = 1 is: the order is that of the elements, every nodal q is a
    rotation, and momenta belong to nodes.

    Attributes:
        state: unknowns of the nodes at the end of a step; start, velocity: unknowns and their rates at its beginning.
        h: the Constant h, the length of the step.
        time: unit of time, s.
        damped: whether any section is.
    """

    variations = ()
    #: numbers of the inertia of a node's section against turning
    inertia_size = 0

    def _motion_fields(self):
        """The Functions that the forms know beside those of a `RodModel`."""
        mesh, points = self.mesh, self.shape.points
        self.start, self.velocity = fem.Function(self.space), fem.Function(self.space)
        self.h = fem.Constant(mesh, np.float64(1))
        self.mass, self.drag = self._at_element_nodes(1), self._at_element_nodes(1)
        self.inertia = self._at_element_nodes(self.inertia_size)
        self.Kt, self.Jt = gauss_function(mesh, points, 3), gauss_function(mesh, points, 3)

    def _at_element_nodes(self, size):
        element = compat.lagrange(self.mesh, self.shape.degree, size, discontinuous=True)
        return fem.Function(compat.function_space(self.mesh, element))

    def load(self, scene, layout):
        """See `RodModel`; mass and inertia too.

        Raises:
            SceneError: a rod without mass or inertia.
        """
        check_inertia(scene)
        super().load(scene, layout)
        scales = self.scales
        heaviest = max(float(rod.profile.range[1].mass) for rod in scene.rods)
        self.time = math.sqrt(heaviest * scales.length**2 / scales.force)
        self._origins = np.concatenate([
            np.tile(scene.origin(rod) / scales.length, (cells * self.shape.degree + 1, 1))
            for rod, cells in zip(scene.rods, layout.counts, strict=True)
        ])  # fmt: skip
        mass, J, frames = nodal_inertia(scene, layout, self.nodes)
        drags = [rod.damping.drag * self.time if rod.damping else 0.0 for rod in scene.rods]
        self._fill_nodes(self.mass, mass[..., None] / heaviest)
        self._fill_nodes(self.inertia, self._section_inertia(J / (heaviest * scales.length**2), frames))
        self._fill_nodes(self.drag, np.repeat(drags, layout.counts)[:, None, None] * np.ones((1, len(self.nodes), 1)))
        self.start.x.array[:] = self.state.x.array
        self.velocity.x.array[:] = 0.0
        self._damp()

    def _damp(self):
        """Take the viscosity of the rods."""
        scene, layout, scales = self.scene, self.layout, self.scales
        damped = [rod.damping or Damping() for rod in scene.rods]
        given = [
            damping.viscosity(rod.stiffness_at(x * rod.length))
            for rod, damping, x in zip(scene.rods, damped, layout.inside(self.rule.gauss), strict=True)
        ]
        Kt, Jt = (np.concatenate(values) for values in zip(*given, strict=True))
        bending = scales.moment * scales.length
        data = rod_data(scene, layout, scales, self.rule, self.reference)
        data = self._section_data(data._replace(K=Kt / (scales.force * self.time), J=Jt / (bending * self.time)))
        self.rods.fill(self.Kt, data.K)
        self.rods.fill(self.Jt, data.J)
        self.damped = damped != [Damping()] * len(damped)

    def _fill_nodes(self, function, values):
        """Values (elements, p + 1, k) at the nodes of every element, in the scene's order, into a Function."""
        local = values[self.rods.cells]
        local[self.rods.reversed] = local[self.rods.reversed][:, ::-1]
        space = function.function_space
        order = np.argsort(np.argsort(compat.element_nodes(space)))
        function.x.array.reshape(-1, values.shape[2])[compat.cell_nodes(space)] = local[:, order]

    # -- what a rung fills in ----------------------------------------------------------------------------------------

    def _section_inertia(self, J, frames):
        """(elements, p + 1, inertia_size) from Jrho about d_1, d_2, d_3 (.., 3) and the frames at rest (.., 3, 3)."""
        raise NotImplementedError

    def passed(self):
        """(local numbers,) the step from `start` to `state` as something that loads do work on: displacements, and
        small rotations where tests have rotations."""
        raise NotImplementedError

    def set_velocity(self, linear, angular):
        """Take velocities (N, 3) and angular velocities (N, 3) of all nodes, dimensionless, inertial, the scene's order."""
        raise NotImplementedError

    def rates(self):
        """A function from the nodes' unknowns and their rates, (.., components) each, to velocities and angular
        velocities (.., 6), inertial, dimensionless."""
        raise NotImplementedError

    def _momenta_of(self, p):
        """Linear and angular momenta, (n, 3) each, inertial, in the rows (n, components) of nodes."""
        raise NotImplementedError

    def _positions(self):
        """(n, 3) of the local nodes, inertial, from where their structure starts."""
        raise NotImplementedError

    # -- what steppers and results ask for ---------------------------------------------------------------------------

    @property
    def slots(self):
        """(n,) the scene's number of every local node."""
        return self._slots

    @property
    def rate_arrays(self):
        """The local numbers that tell how fast the state changes."""
        return (self.velocity.x.array,)

    def accept(self, h):
        """Take the rates of `state` after a step of length h: the trapezoidal rule."""
        rates = self.velocity.x.array
        rates[:] = 2 / h * (self.state.x.array - self.start.x.array) - rates

    def loads_at(self, t):
        """Put the loads at the time t (s) into the forms' Functions."""
        self._loads.at(t)

    @property
    def moving_loads(self):
        """The Functions of loads that depend on time."""
        return self._loads.moving

    def ties_at(self, t):
        """The `Ties` at the time t (s)."""
        return self.ties.with_numbers_of(ties_of(self.scene, t))

    def largest_of(self, change, turns):
        """Largest move (lengths), or turn (rad) times `turns`, in a change of the local numbers, over all ranks."""
        nodal = change[self._nodal]
        moved, turned = (np.square(x).sum(axis=1).max(initial=0.0) for x in np.split(nodal, [self.moves], axis=1))
        local = math.sqrt(max(moved, (turns * self.turn) ** 2 * turned))
        return self.comm.allreduce(local, op=MPI.MAX) if self.comm.size > 1 else local

    def turned_over(self):
        """Whether some node turned by half a turn or more in the step, over all ranks: it is then not the one meant."""
        return False

    def snapshot_of_rates(self):
        """(N, components) `velocity` at the nodes, the scene's order, all ranks, dimensionless."""
        return self._gather_nodes(self.velocity.x.array[self._nodal[: self._owned_nodes]])

    def momenta(self, tested):
        """Linear (3,) and angular momentum (3,) about the inertial origin, over all ranks, dimensionless.

        Args:
            tested: (local numbers,) the assembled `forms.momentum`, contributions of this rank's elements.
        """
        linear, angular = self._momenta_of(tested[self._nodal])
        place = self._positions() + self._origins[self._slots]
        both = np.concatenate([linear.sum(axis=0), (np.cross(place, linear) + angular).sum(axis=0)])
        return np.split(self.comm.allreduce(both), 2)


class MovingSpatial(Moving, SpatialModel):
    """The spatial rung with inertia."""

    variations = ()
    inertia_size = 6

    def _compile(self, spaces):
        self._motion_fields()
        return compile_momentum(SpatialStep(self))

    def _section_inertia(self, J, frames):
        I_R = np.einsum("...ij,...j,...kj->...ik", frames, J, frames)
        return I_R[..., [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]

    def passed(self):
        """See `Moving`."""
        now, before = (function.x.array.reshape(-1, 7) for function in (self.state, self.start))  # node by node
        work = now - before
        work[:, 4:] = turned_by(work[:, 3:], (now[:, 3:] + before[:, 3:]) / 2)
        work[:, 3] = 0.0
        return work.ravel()

    def turned_over(self):
        """See `Moving`; -q would do as well as q for |q| = 1."""
        q, before = (f.x.array[self._nodal[:, 3:]] for f in (self.state, self.start))
        here = bool((np.einsum("ni,ni->n", before, q) <= 0).any())
        return self.comm.allreduce(here, op=MPI.LOR) if self.comm.size > 1 else here

    def set_velocity(self, linear, angular):
        """See `Moving`."""
        slots, nodal, x = self._slots, self._nodal, self.velocity.x.array
        x[nodal[:, :3]] = linear[slots]
        x[nodal[:, 3:]] = spun(self.state.x.array[nodal[:, 3:]], angular[slots])

    def rates(self):
        """See `Moving`."""
        return lambda nodal, rates: np.concatenate([rates[..., :3], turned_by(rates[..., 3:], nodal[..., 3:])], axis=-1)

    def _momenta_of(self, p):
        return p[:, :3], p[:, 4:]

    def _positions(self):
        return self.state.x.array[self._nodal[:, :3]]


def spun(q, omega):
    """(.., 4) the rates omega q/2 of q (.., 4) that angular velocities omega (.., 3) amount to."""
    v = q[..., 1:]
    scalar = -np.einsum("...i,...i->...", omega, v)[..., None]
    return np.concatenate([scalar, q[..., :1] * omega + np.cross(omega, v)], axis=-1) / 2


def turned_by(dq, q):
    """(.., 3) the inertial rotations 2 vec(dq conj(q))/|q|^2 of changes dq of q, (.., 4) each."""
    a, b, c, d = np.moveaxis(q, -1, 0)
    da, db, dc, dd = np.moveaxis(dq, -1, 0)
    turned = a * db - da * b - dc * d + dd * c, a * dc - da * c - dd * b + db * d, a * dd - da * d - db * c + dc * b
    return np.stack([2 / (a * a + b * b + c * c + d * d) * x for x in turned], axis=-1)
