"""The answer of the exact rod in its hole: forces, contact and error estimates.

A wall of stiffness k changes hook load, torque and wall force by C/k^a from those in a rigid wall: a is 1 where a
stabiliser presses on it, less where the string leaves it. From solutions at k/100, k/10 and k follows the ratio of the
last two changes, rho = 10^-a; the remaining error at k is rho/(1 - rho) times the last change.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.well.contacts import ROUGH, high_side, side_in_space
from cosserat_fenicsx.well.rod.resultants import along_elements, apart_mostly, contacts_along, with_errors
from cosserat_fenicsx.well.rod.string_scene import is_round

#: Of negative modes on a path before they are counted.
UNKNOWN = -1
# Fields with an error estimate.
_ALONG = ("side_force", "bending_moment")


class InHole:
    """A string at rest in its hole, or slipping along it; arrays are over the nodes along the string, from the top.

    Attributes:
        path: a `Path` with the rod's state as its only point, for all that a `Path` offers; scene: its `Scene`.
        s: arc length from the top, m. md: measured depth of the closest point of the hole's axis, m.
        position: (n, 3), m. offset: (n, 3) from the hole's axis, m; distance: its size. clearance: m, at a ring the
            ring's; standoff: the part of it that is left, 1 on the axis, 0 where it touches; touches: (n,) whether it
            does. node_length: the weights of integrals along the string, m.
        side: direction of the rod from the axis, rad, from the high side of the hole, clockwise looking down the hole
            (from the first axis, north, where it is vertical).
        tension: effective, N. torque: N m, that the upper part exerts in the sense of clockwise rotation on the lower.
        bending_moment: N m. These three are at the nodes by the polynomials through the Gauss points of each element,
            where they are most accurate: on 256 elements of whole wells the moment is 20 to 100 times nearer to a
            fine mesh's than by the polynomials through the nodes.
        side_force: of the wall on the rod, per length, N/m: of each element its mean, which is accurate, and the slope
            between the means of its neighbours. Within an element the wall's forces at the nodes alternate about it on
            coarse meshes, 6 to 60 times farther from a fine mesh's. node_force: the wall's forces at the nodes, N,
            exact in the balance of forces.
        hook_load: of the held end, along the hole, N; surface_torque: N m; reaction: (3,) N and (3,) N m there.
        wall_force: sum of all forces of the wall and of the rings, across the rod, without friction, N.
        ring_forces: (rings, 3) on the string, with friction, N.
        contacts: [`Contact`] resultants, from the top down, see `contacts_along`. distributed_force: `side_force`
            without the peaks of those that are concentrated, N/m: its integral and these are the `wall_force`. rough:
            the concentrated ones whose estimated error is above 0.5 % of them.
        stretch: m, twist: rad, of the string by tension and torque, from the true stiffness (NaN where a section has
            none); an `extensible` string has them in its state.
        factor: stiffness of the wall that it was solved with, over that in the scene; wall_stiffness: N/m^2, with it.
        errors: {"hook_load": N, "surface_torque": N m, "wall_force": N}, estimated, from those in a rigid wall; error:
            the largest relative error of the first two, of the torque only where the string turns; of_stiffness: its
            part from the wall's softness, see `RodErrors`.
        errors_along: {"side_force": N/m, "bending_moment": N m}: the differences from the mesh before that 95 % of the
            string's length are below; beside concentrated forces they may be larger. They do not count in `error`.
        balance: N, between the reaction and the sum of all other forces.
        negative_modes: number of negative eigenvalues of the second variation without friction, -1 where it is
            singular. Where it is not 0, the string would buckle, or buckle otherwise, but for friction.
        steps: Newton steps, on this mesh and on those before.
    """

    def __init__(self, string, path, factor=1.0):
        self.string, self.path, self.scene, self.factor = string, path, path.scene, factor
        self.steps, self.negative_modes = int(path.iterations[0]), None
        self.estimates, self.errors, self.error, self.of_stiffness = None, {}, np.inf, np.inf
        self._mesh_before = None

    def take_modes(self, count):
        """Take the number of negative modes, which is None on meshes that finer ones follow."""
        self.negative_modes = count
        self.path._all["negative_modes"][:] = self.path._records[0].negative_modes = count

    def estimate(self, values, before):
        """Set the errors. values: {factor: {name: value}} in walls of several stiffnesses on this mesh, see
        `RodErrors`; before: the `InHole` on the mesh before, or None; ignored where its mesh is no coarser."""
        if before:
            self.steps += before.steps
            if before.path.elements[0] < self.path.elements[0]:
                self._mesh_before = before
        string = self.string
        arm = max(radius for _, radius in string.wall.contact_radius)
        least = _ERRORS.least_load * string.whole_weight
        wall = max(self.wall_force, least)
        scales = {
            "hook_load": max(abs(self.hook_load), least),
            "surface_torque": max(abs(self.surface_torque), _ERRORS.least_torque * arm * wall),
            "wall_force": wall,
        }
        rounding = {name: self.balance * (arm if name == "surface_torque" else 1.0) for name in NAMES}
        counted = ("hook_load", "surface_torque") if string.turns else ("hook_load",)
        coarser, along = self._mesh_before and self._mesh_before.estimates, 0.0
        if coarser:
            along = max(self._apart(_ALONG_OF[name], self._mesh_before) / scales[name] for name in counted)
        self.estimates = found = RodErrors(values, scales, rounding, counted, coarser, string.stiffest_rings, along)
        self.errors, self.error, self.of_stiffness = found.errors, found.error, found.of_stiffness

    def _apart(self, name, other):
        """The difference of a field from that of another `InHole` which most of the string's length is below."""
        there = np.interp(self.s, other.s, getattr(other, name))
        return apart_mostly(getattr(self, name), there, self.node_length)

    @cached_property
    def errors_along(self):
        """See the class; infinite where there is no mesh before."""
        other = self._mesh_before
        if other is None:
            return dict.fromkeys(_ALONG, np.inf)
        return {name: self._apart(name, other) for name in _ALONG}

    @property
    def wall_stiffness(self):
        return self.factor * self.string.wall.stiffness

    # -- along the string --------------------------------------------------------------------------------------------

    @cached_property
    def s(self):
        return self.path.layout.node_s(self.path.rule.nodes)[0] * self.string.rod.length

    @property
    def _record(self):
        return self.path._records[0]

    @cached_property
    def position(self):
        return self._record.rq[:, :3] * self.path.scales.length + self.scene.origin(self.string.rod)

    @cached_property
    def _near(self):
        return self.string.path.nearest(self.position, self.s)

    @property
    def md(self):
        return self._near.md

    @cached_property
    def offset(self):
        away = self.position - self._near.position
        return away - (away * self._near.tangent).sum(axis=1)[:, None] * self._near.tangent

    @cached_property
    def distance(self):
        return np.linalg.norm(self.offset, axis=1)

    @cached_property
    def _outward(self):
        """(n, 3) unit vectors from the axis to the rod; zero where it is centred."""
        clear = self.distance > 1e-9 * self.string.clearance
        return np.where(clear[:, None], self.offset / np.where(clear, self.distance, 1.0)[:, None], 0.0)

    @cached_property
    def _ring_nodes(self):
        """(rings,) the node of each ring."""
        stations = np.array([ring.station.s for ring in self.string.rings])
        return np.abs(self.s - stations[:, None]).argmin(axis=1)

    @cached_property
    def clearance(self):
        found = self.string.wall.sizes(self.s, self.md)[0]
        found[self._ring_nodes] = [ring.clearance for ring in self.string.rings]
        return found

    @cached_property
    def standoff(self):
        clear = self.clearance > 0
        return np.where(clear, 1 - self.distance / np.where(clear, self.clearance, 1.0), 0.0)

    @cached_property
    def _pressed(self):
        """(rings,) whether each ring touches."""
        at = self._ring_nodes
        return self.distance[at] > self.clearance[at]

    @cached_property
    def touches(self):
        found = self.node_force > 0
        found[self._ring_nodes] |= self._pressed
        return found

    @cached_property
    def side(self):
        return side_in_space(self._near.tangent, self._outward)

    @cached_property
    def _contact(self):
        """(elements, nodes, 6) n and m, N and N m, inertial."""
        return self.path._contact[0] * np.repeat([self.path.scales.force, self.path.scales.moment], 3)

    @cached_property
    def _along(self):
        """(n, 3) tangents of the rod: its third director."""
        q = self._record.rq[:, 3:7]
        q = q / np.linalg.norm(q, axis=1, keepdims=True)
        return np.einsum("nij,nj->ni", directors(q), self.string.rod.curve.frame(self.s)[:, :, 2])

    def _between_gauss(self, part, scale):
        """(n, 3) of n or m at the nodes, by the polynomials through the Gauss points of each element: where a force at
        a point loads an element, they do not alternate as those through its nodes. At the ends as in equilibrium."""
        at_gauss = self._record.gauss_fields[..., part] * scale
        found = self._averaged(np.einsum("jg,cgi->cji", self.path.rule.between_gauss(self.path.rule.nodes), at_gauss))
        found[0], found[-1] = self._contact[0, 0, part], self._contact[-1, -1, part]
        return found

    @cached_property
    def _moment(self):
        """(n, 3) N m."""
        return self._between_gauss(slice(3, 6), self.path.scales.moment)

    @cached_property
    def tension(self):
        return (self._between_gauss(slice(3), self.path.scales.force) * self._along).sum(axis=1)

    @cached_property
    def torque(self):
        return -(self._moment * self._along).sum(axis=1)

    @cached_property
    def bending_moment(self):
        return np.linalg.norm(self._moment + self.torque[:, None] * self._along, axis=1)

    # -- the wall ------------------------------------------------------------------------------------------------------

    @property
    def _nodes(self):
        """(elements, nodes) the nodes of each element."""
        degree = self.path.degree
        return np.arange(self.path.elements[0])[:, None] * degree + np.arange(degree + 1)

    @cached_property
    def _of_nodes(self):
        """(elements, nodes) lengths that the nodes stand for, m."""
        return self.path.layout.sizes(self.scene)[:, None] * self.path.rule.lobatto

    @cached_property
    def _wall_density(self):
        """(elements, nodes, 3) force of the wall per length, friction included, N/m."""
        return self._record.densities[1][..., :3] * self.path.scales.force / self.path.scales.length

    @cached_property
    def element_pressures(self):
        """(elements, nodes) force of the wall across the rod, per length, N/m."""
        return 0.0 - (self._wall_density * self._outward[self._nodes]).sum(axis=2)

    @cached_property
    def side_force(self):
        return self._smoothed(self.element_pressures)

    def _smoothed(self, pressures):
        """(n,) N/m, from pressures (elements, nodes), see `side_force`."""
        sizes = self._of_nodes.sum(axis=1)
        means = (pressures * self._of_nodes).sum(axis=1) / sizes
        return self._averaged(along_elements(means, sizes, self.path.rule.nodes)[..., None])[:, 0]

    def _summed(self, values):
        """(n, ..) sums over the elements at every node of values (elements, nodes, ..)."""
        p, found = self.path.degree, np.zeros((len(self.s), *values.shape[2:]))
        for j in range(p + 1):
            found[j : len(found) - p + j : p] += values[:, j]
        return found

    def _averaged(self, values):
        """(n, k) from values (elements, nodes, k): where elements meet, means by lengths, which keeps integrals."""
        return self._summed(values * self._of_nodes[..., None]) / self.node_length[:, None]

    @cached_property
    def node_length(self):
        return self._summed(self._of_nodes)

    @cached_property
    def node_force(self):
        return self._summed(self.element_pressures * self._of_nodes)

    @cached_property
    def ring_forces(self):
        """(rings, 3) N: the jump of the contact force, which no other load at the station shares."""
        found = np.empty((len(self.string.rings), 3))
        for i, ring in enumerate(self.string.rings):
            _, vertex = self.path.layout.vertex(self.scene, ring.station)
            after = self._contact[vertex, 0, :3] if vertex < len(self._contact) else self.string.bottom
            found[i] = self._contact[vertex - 1, -1, :3] - after
        return found

    @cached_property
    def _ring_pressures(self):
        """(rings,) N: across the hole, without friction; of the size of rounding where a ring does not touch."""
        friction = [ring.friction * np.hypot(*ring.slip[0][1]) for ring in self.string.rings]
        return np.linalg.norm(self.ring_forces, axis=1) / np.hypot(1.0, friction)

    @cached_property
    def on_bit(self):
        """Of the lower end: the force (N) with which its ring presses on the wall, and the tilt (rad) of the string
        against the hole; each (2,): to the high side of the hole (north where it is vertical), and to the right of it
        looking down the hole. NaN forces where no ring is at the lower end."""
        tangent = self._near.tangent[-1]
        high = high_side(tangent[None], north=True)[0]
        across = np.array([high, np.cross(tangent, high)])
        end = self.string.rod.length * (1 - 1e-9)
        at_end = [i for i, ring in enumerate(self.string.rings) if ring.station.s > end]
        force = -across @ self.ring_forces[at_end].sum(axis=0) if at_end else np.full(2, np.nan)
        return force, np.arcsin(across @ self._along[-1])

    @cached_property
    def tool_faces(self):
        """(bends,) rad: the sides of the hole to which the string's bends point its lower end, as in `string_in`."""
        curve, at = self.string.rod.curve, [int(np.argmin(np.abs(self.s - s))) for s in self.string.rod.curve.breaks]
        q = self._record.rq[at, 3:7]
        sides = directors(q / np.linalg.norm(q, axis=1, keepdims=True)) @ curve.sides[..., None] if at else np.zeros(0)
        return side_in_space(self._near.tangent[at], sides[..., 0]) if at else sides

    @cached_property
    def wall_force(self):
        return float(self.node_force.sum() + self._ring_pressures.sum())

    @cached_property
    def _layer(self):
        """(elements,) length of the layer in the wall, m."""
        ends = self.s[:: self.path.degree]
        EI = self.string.bending[self.string.section_at((ends[1:] + ends[:-1]) / 2)]
        return (4 * EI / self.wall_stiffness) ** 0.25

    @cached_property
    def _kinks(self):
        """Arc lengths (m) where the pressure may jump: stations of the survey, ends of sections of string and hole."""
        string, length = self.string, float(self.string.ends[-1])
        stations = np.interp(string.path.md, self.md, self.s, left=np.nan, right=np.nan)
        found = np.concatenate([stations, string.ends[:-1], list(string.wall.breaks(string.rod))])
        return np.unique(found[(found > 0) & (found < length)])

    @cached_property
    def _resultants(self):
        """See `contacts_along`."""
        rings = [
            (ring.station.s, force)
            for ring, force, pressed in zip(self.string.rings, self._ring_pressures, self._pressed, strict=True)
            if pressed
        ]
        s, side = self.s[self._nodes], self.side[self._nodes]
        return contacts_along(s, self._of_nodes, self.element_pressures, side, self._layer, rings, self._kinks)

    @cached_property
    def contacts(self):
        """[`Contact`] above rounding size; errors of forces at points also by the mesh before, see
        `with_errors`."""
        largest = max((x.force for x in self._resultants[0]), default=0.0)
        known = [x for x in self._resultants[0] if x.force > 1e-10 * largest]
        other = self._mesh_before
        reach = other and 2 * float(other._layer.max()) + float(np.ptp(other.s[other._nodes], axis=1).max())
        rings = [ring.station.s for ring in self.string.rings]
        return with_errors(known, other and other._resultants[0], reach, self._layer_at, rings)

    def _layer_at(self, s):
        return self._layer[np.clip(np.searchsorted(self.s[:: self.path.degree], s) - 1, 0, len(self._layer) - 1)]

    @property
    def rough(self):
        return [x for x in self.contacts if x.start == x.end and x.error > ROUGH * x.force]

    @cached_property
    def distributed_force(self):
        return self._smoothed(self._resultants[1])

    # -- the ends ----------------------------------------------------------------------------------------------------

    @cached_property
    def reaction(self):
        """Force (3,), N, and moment (3,), N m, on the held end."""
        force, moment = self.path.reaction(self.string.support)
        return force[0], moment[0]

    @property
    def hook_load(self):
        return float(-self.reaction[0] @ self._near.tangent[0])

    @property
    def surface_torque(self):
        return float(self.reaction[1] @ self._near.tangent[0])

    @cached_property
    def balance(self):
        string = self.string
        weight = np.array([0.0, 0.0, string.whole_weight])
        wall = (self._wall_density * self._of_nodes[..., None]).sum(axis=(0, 1)) + self.ring_forces.sum(axis=0)
        return float(np.linalg.norm(self.reaction[0] + weight + string.bottom + wall))

    @property
    def scale(self):
        """Size of the forces that are balanced, N."""
        return self.wall_force + self.string.whole_weight + float(np.linalg.norm(self.string.bottom))

    # -- deformations outside the equilibrium -----------------------------------------------------------------------

    def _integral(self, values, of_section):
        """Integral over the string of values at the nodes over a stiffness of the sections."""
        found = np.array([np.nan if x.matrix is not None else of_section(x) for x in self.string.sections])
        return float((self.node_length * values / found[self.string.section_at(self.s)]).sum())

    @property
    def stretch(self):
        return self._integral(self.tension, lambda x: x.axial)

    @property
    def twist(self):
        return self._integral(self.torque, lambda x: x.torsion if is_round(x) else np.nan)

    def __repr__(self):
        elements = self.path.elements[0]
        return f"<InHole: hook load {self.hook_load:.6g} N, {elements} elements, {self.steps} Newton steps>"


#: Quantities with error estimates: hook load, N; surface torque, N m; sum of the wall's forces, N.
NAMES = ("hook_load", "surface_torque", "wall_force")
# Of the quantities that the string has at its upper end, the field along it.
_ALONG_OF = {"hook_load": "tension", "surface_torque": "torque"}
# Errors of the finer mesh over changes from one mesh to the next, of what `error` does not count.
_OF_CHANGE = {"hook_load": 3.0, "surface_torque": 4.0, "wall_force": 6.0}


@dataclass(frozen=True)
class _Errors:
    """Settings of the error estimates."""

    least_load: float = 1e-3  # smallest scale of hook loads, over the string's weight
    least_torque: float = 1e-3  # smallest scale of torques, over the wall's forces times the contact radius
    caution: float = 2.0  # safety factor of the remaining effect of the wall's softness
    ratios: tuple[float, float] = (0.1, 0.9)  # bounds of the ratio of changes
    unknown: float = 0.5  # that ratio where it is not known
    # A change by the mesh below this share of the change before is taken as small by chance: changes fall to a
    # twentieth (the median) or a seventh.
    falls: float = 1 / 10
    # Errors of the finer mesh over what changed of hook load and torque; and the share of the change along most of the
    # string that counts beside it, as it is not small by chance: with 0.1 one of 131 errors in wells that no setting
    # was chosen by was 1.1 times its estimate. All elements differ, see `_Meshes.parts`.
    of_change: float = 1.5
    along: float = 0.2


_ERRORS = _Errors()
#: Least effect of the wall's softness, relative, on a finer mesh where it was found on a coarser one, which may not
#: resolve the layer in the wall: the largest one of 157 operations in random wells is 1.3e-5 where the coarse mesh
#: shows less.
UNSEEN = 1.5e-5


class RodErrors:
    """Estimated errors of an `InHole`. values: {factor: {name: value}} in walls stiffer than the scene's by ascending
    factors; ratio: of the last two changes; changes: {name: relative change from the mesh before}, infinite without
    one; errors: {name: error} in N and N m; error: the largest relative error of hook load and torque, of the torque
    only where the string turns; of_stiffness: its part from the wall's softness."""

    def __init__(self, values, scales, rounding, counted, before=None, capped=np.inf, along=0.0):
        """
        Args:
            values: see there. scales: {name: size that an error is relative to}. rounding: {name: error}. counted:
                names of those in `error`. before: the `RodErrors` on the mesh before. capped: factor above which rings
                are not made stiffer, so that changes do not show their effect. along: relative change along most of the
                string, from the mesh before.
        """
        self.values, self._capped = dict(sorted(values.items())), capped
        self._of_rings = before._of_rings if before else dict.fromkeys(NAMES, 0.0)
        self._by_stiffness, self.ratio = self._left_of_softness(scales, counted, before)
        changes = dict.fromkeys(NAMES, np.inf)
        common = set(self.values) & set(before.values if before else ())
        if common:
            factor = max(common)
            changes = _changes(before.values[factor], self.values[factor], scales, (*counted, "wall_force"))
            here = _changes(before.values[factor], self.values[factor], scales, counted)
            changes |= {name: here[name] + _ERRORS.along * along for name in counted}
        if before is not None:
            known = {name: x for name, x in before.changes.items() if np.isfinite(x)}
            changes |= {name: max(changes[name], _ERRORS.falls * x) for name, x in known.items()}
        self.changes = changes
        shares = _OF_CHANGE | dict.fromkeys(counted, _ERRORS.of_change)
        of_mesh = {name: shares[name] * changes[name] * scales[name] for name in NAMES}
        self.errors = {name: of_mesh[name] + self._by_stiffness[name] + rounding[name] for name in NAMES}
        self.error = max(self.errors[name] / scales[name] for name in counted)
        self.of_stiffness = max(self._by_stiffness[name] / scales[name] for name in counted)

    def _left_of_softness(self, scales, counted, before):
        """{name: change to a rigid wall}, and the ratio of changes."""
        walls = list(self.values.values())
        if len(walls) < 2:
            if before is None:
                return dict.fromkeys(NAMES, np.inf), _ERRORS.unknown
            unseen = UNSEEN * min(1.0, walls[0]["wall_force"] / scales["wall_force"])  # none without contact
            return {name: max(x, unseen * scales[name]) for name, x in before._by_stiffness.items()}, before.ratio
        counted = (*counted, "wall_force")
        changes = [_changes(a, b, scales, counted) for a, b in zip(walls, walls[1:], strict=False)]
        ratio = before.ratio if before else _ERRORS.unknown
        if before and max(self.values) > max(before.values):  # beyond what the coarse mesh has shown
            ratio = max(ratio, _ERRORS.unknown)
        if len(changes) > 1:
            sizes = [max(change.values()) for change in changes[-2:]]
            ratio = float(np.clip(sizes[1] / sizes[0], *_ERRORS.ratios)) if sizes[0] > 0 else _ERRORS.unknown
            changes[-1] = {name: max(x, _ERRORS.ratios[0] * changes[-2][name]) for name, x in changes[-1].items()}
        share = _ERRORS.caution * ratio / (1 - ratio)
        factors = list(self.values)
        if factors[-1] > self._capped:  # the effect of rings is known from walls in which they were stiffer, too
            known = [pair for pair in zip(changes, factors[1:], strict=True) if pair[1] <= self._capped]
            if known:
                change, factor = known[-1]
                softer = share * factor / self._capped  # a ring's effect is as its softness
                self._of_rings = {name: softer * x * scales[name] for name, x in change.items()}
        return {name: max(share * x * scales[name], self._of_rings[name]) for name, x in changes[-1].items()}, ratio


def _changes(there, here, scales, counted):
    """{name: relative change}, at least the largest of those that count: one alone may change little by chance."""
    own = {name: abs(here[name] - there[name]) / scales[name] for name in NAMES}
    largest = max(own[name] for name in counted)
    return {name: max(largest, change) for name, change in own.items()}
