"""Models with inertia, between the two ends of a time step."""

import math
from dataclasses import replace

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.connections import ties_of
from cosserat_fenicsx.models.laws import law_data, viscous_values
from cosserat_fenicsx.models.moving_forms import SpatialStep, compile_momentum
from cosserat_fenicsx.models.nodal_inertia import check_inertia, nodal_inertia, nodal_lateral, nodal_offsets
from cosserat_fenicsx.models.rod_data import gauss_function, joined, rod_data
from cosserat_fenicsx.models.scales import Scales
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.models.stations import Delays
from cosserat_fenicsx.quaternions import cross, small_rotations
from cosserat_fenicsx.scene.damping import Damping
from cosserat_fenicsx.scene.signals import signals_of


class Moving:
    """Mixin that adds inertia to a `RodModel`; it must come first among the bases.

    Inertia is integrated with the nodes as points, as |q| = 1 is: the order of convergence is that of the elements,
    every nodal q is a unit quaternion, and the mass matrix is block diagonal.

    Attributes:
        state: unknowns of the nodes at the end of a step; start, velocity: unknowns and their rates at its beginning.
        h: the Constant h, the length of the step.
        time: unit of time, s.
        damped: whether any rod has damping.
        offset: Function, the mass centre from the axis, along the inertial axes at rest; None in a scene without
            eccentric rods.
        lateral: Function, see `nodal_inertia.nodal_lateral`; None in a scene without such masses.
        viscosity: the Functions of the law of the strain rates, as `laws.law_of` takes them.
        delays: the `Delays` of its actions.
    """

    variations = ()
    #: independent components of a section's rotational inertia
    inertia_size = 0

    def _motion_fields(self):
        """Make the Functions that the forms need in addition to those of a `RodModel`."""
        mesh, points = self.mesh, self.signature.points
        self.start, self.velocity = fem.Function(self.space), fem.Function(self.space)
        # dolfinx makes an array of a Function anew whenever it is asked for one
        self._arrays = self.state.x.array, self.start.x.array, self.velocity.x.array
        self.h = fem.Constant(mesh, np.float64(1))
        self.mass, self.drag = self._at_element_nodes(1), self._at_element_nodes(1)
        self.inertia = self._at_element_nodes(self.inertia_size)
        self.offset = self._at_element_nodes(3) if self.signature.eccentric else None
        self.lateral = self._at_element_nodes(self.moves) if self.signature.lateral else None
        coupled = self.signature.coupled
        Kt, Jt = (gauss_function(mesh, points, 9 if coupled else 3) for _ in range(2))
        self.viscosity = Kt, None, Jt, gauss_function(mesh, points, 9) if coupled else None

    def _at_element_nodes(self, size):
        element = compat.lagrange(self.mesh, self.signature.degree, size, discontinuous=True)
        return fem.Function(compat.function_space(self.mesh, element))

    def load(self, scene, layout):
        """See `RodModel`; mass and inertia too.

        Raises:
            SceneError: a rod without mass or inertia.
        """
        check_inertia(scene)
        scales, heaviest = Scales.of(scene), max(float(rod.profile.range[1].mass) for rod in scene.rods)
        self.time = math.sqrt(heaviest * scales.length**2 / scales.force)
        super().load(scene, layout)
        self._origins = np.concatenate([
            np.tile(scene.origin(rod) / scales.length, (cells * self.signature.degree + 1, 1))
            for rod, cells in zip(scene.rods, layout.counts, strict=True)
        ])  # fmt: skip
        mass, J, frames = nodal_inertia(scene, layout, self.nodes)
        drags = [rod.damping.drag * self.time if rod.damping else 0.0 for rod in scene.rods]
        self._fill_nodes(self.mass, mass[..., None] / heaviest)
        inertia = self._section_inertia(J / (heaviest * scales.length**2), frames)
        if self.offset is not None:
            offset, more = nodal_offsets(scene, layout, self.nodes, mass)
            self._fill_nodes(self.offset, offset / scales.length)
            inertia = inertia + six_of(more / (heaviest * scales.length**2))
        self._fill_nodes(self.inertia, inertia)
        if self.lateral is not None:
            directions = nodal_lateral(scene, layout, self.nodes) / math.sqrt(heaviest)
            self._fill_nodes(self.lateral, directions @ self.axes[: self.moves].T)
        self._fill_nodes(self.drag, np.repeat(drags, layout.counts)[:, None, None] * np.ones((1, len(self.nodes), 1)))
        self.start.x.array[:] = self.state.x.array
        self.velocity.x.array[:] = 0.0
        self._damp()
        self.delays = Delays(self)

    def _damp(self):
        """Fill in the viscosity of the rods."""
        scene, layout, coupled = self.scene, self.layout, self.signature.coupled
        damped = [rod.damping or Damping() for rod in scene.rods]
        units = replace(self.scales, force=self.scales.force * self.time)
        given = joined([
            law_data(damping.viscosity(rod.stiffness_at(x * rod.length)), units, coupled=coupled)
            for rod, damping, x in zip(scene.rods, damped, layout.inside(self.rule.gauss), strict=True)
        ])  # fmt: skip
        data = rod_data(scene, layout, self.scales, self.rule, self.reference, coupled=coupled)
        data = self._section_data(data._replace(**given._asdict()))
        for function, values in zip(self.viscosity, viscous_values(data), strict=True):
            if function is not None:
                self.rods.fill(function, values)
        self.damped = damped != [Damping()] * len(damped)

    def _fill_nodes(self, function, values):
        """Fill a Function with values (elements, p + 1, k) at the nodes of every element, in the scene's order."""
        local = values[self.rods.cells]
        local[self.rods.reversed] = local[self.rods.reversed][:, ::-1]
        space = function.function_space
        order = np.argsort(np.argsort(compat.element_nodes(space)))
        function.x.array.reshape(-1, values.shape[2])[compat.cell_nodes(space)] = local[:, order]

    # -- for subclasses to define ------------------------------------------------------------------------------------

    def _section_inertia(self, J, frames):
        """(elements, p + 1, inertia_size) from Jrho about d_1, d_2, d_3 (.., 3) and the frames at rest (.., 3, 3)."""
        raise NotImplementedError

    def passed(self):
        """(local degrees of freedom,) the step from `start` to `state` in the components of the test functions, so that
        its product with a load vector is work: displacements, and small rotations."""
        raise NotImplementedError

    def set_velocity(self, linear, angular):
        """Set velocities and angular velocities (N, 3) of all nodes, dimensionless, inertial, scene's order."""
        raise NotImplementedError

    def rates(self):
        """A function from the nodes' unknowns and their rates, (.., components) each, to velocities and angular
        velocities (.., 6), inertial, dimensionless."""
        raise NotImplementedError

    def _momenta_of(self, p):
        """Linear and angular momenta, (n, 3) each, inertial, from assembled rows (n, components) of nodes."""
        raise NotImplementedError

    # -- for time steppers and results -------------------------------------------------------------------------------

    @property
    def slots(self):
        """(n,) the scene's number of every local node."""
        return self._slots

    def slot_of(self, station):
        """The scene's number of the node at a station."""
        rod, vertex = self.layout.vertex(self.scene, station)
        return sum(self.layout.counts[:rod]) * self.signature.degree + rod + vertex * self.signature.degree

    @property
    def owned_nodes(self):
        """Number of the local nodes that this rank owns; they come first."""
        return self._owned_nodes

    @property
    def dofs_of_nodes(self):
        """(n, components) local degrees of freedom of the local nodes."""
        return self._nodal

    @property
    def rate_arrays(self):
        """The arrays of the rates of the state."""
        return (self._arrays[2],)

    @property
    def ends(self):
        """The Functions of a step that forms depend on; only the first, the state, changes within it."""
        return self.state, self.start, self.velocity

    def accept(self, h):
        """Update the rates to those of `state` after a step of length h, by the trapezoidal rule."""
        now, before, rates = self._arrays
        rates[:] = 2 / h * (now - before) - rates

    def loads_at(self, t):
        """Fill the forms' Functions with the loads at the time t (s); whether they differ from those before."""
        return self.actions.at(t)

    def ties_at(self, t):
        """The `Ties` at the time t (s)."""
        driven = any(signals_of(support) for support in self.scene.supports)
        return self.ties.with_numbers_of(ties_of(self.scene, t)) if driven else self.ties

    def largest_of(self, change, turns):
        """Largest displacement (lengths), or rotation (rad) times `turns`, in a change of the state, over all ranks."""
        nodal = change[self._nodal]
        moved, turned = (np.square(x).sum(axis=1).max(initial=0.0) for x in np.split(nodal, [self.moves], axis=1))
        local = math.sqrt(max(moved, (turns * self.turn) ** 2 * turned))
        return self.comm.allreduce(local, op=MPI.MAX) if self.comm.size > 1 else local

    def turned_over(self):
        """Whether a node of any rank rotated by half a turn or more in the step: the solution is then spurious."""
        return False

    def snapshot_of_rates(self):
        """(N, components) `velocity` at the nodes, in the scene's order, on all ranks, dimensionless."""
        return self._gather_nodes(self._arrays[2][self._nodal[: self._owned_nodes]])

    def momenta(self, tested):
        """Linear (3,) and angular momentum (3,) about the inertial origin, over all ranks, dimensionless.

        Args:
            tested: (local degrees of freedom,) the assembled `forms.momentum`, contributions of this rank's elements.
        """
        linear, angular = self._momenta_of(tested[self._nodal])
        place = self.positions() + self._origins[self._slots]
        both = np.concatenate([linear.sum(axis=0), (cross(place, linear) + angular).sum(axis=0)])
        both = self.comm.allreduce(both) if self.comm.size > 1 else both
        return both[:3], both[3:]


class MovingSpatial(Moving, SpatialModel):
    """The spatial model with inertia."""

    variations = ()
    inertia_size = 6

    def _compile(self, spaces):
        self._motion_fields()
        return compile_momentum(SpatialStep(self))

    def _section_inertia(self, J, frames):
        return six_of(np.einsum("...ij,...j,...kj->...ik", frames, J, frames))

    def passed(self):
        """See `Moving`."""
        now, before = (array.reshape(-1, 7) for array in self._arrays[:2])  # node by node
        work = now - before
        work[:, 4:] = turned_by(work[:, 3:], (now[:, 3:] + before[:, 3:]) / 2)
        work[:, 3] = 0.0
        return work.ravel()

    def turned_over(self):
        """See `Moving`; a q of the other sign also satisfies |q| = 1."""
        q, before = (array.reshape(-1, 7)[:, 3:] for array in self._arrays[:2])  # node by node
        here = bool(((q * before) @ np.ones(4) <= 0).any())
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


def six_of(I):
    """(.., 6) components of symmetric matrices (.., 3, 3), row by row from the diagonal on."""
    return I[..., [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]


def spun(q, omega):
    """(.., 4) the rates omega q/2 of q (.., 4) for angular velocities omega (.., 3)."""
    v = q[..., 1:]
    scalar = -np.einsum("...i,...i->...", omega, v)[..., None]
    return np.concatenate([scalar, q[..., :1] * omega + np.cross(omega, v)], axis=-1) / 2


def turned_by(dq, q):
    """(.., 3) the inertial rotations 2 vec(dq conj(q))/|q|^2 of changes dq of q, (.., 4) each."""
    return (small_rotations(q) @ dq[..., None])[..., 0]
