"""Rods that touch each other in a time step, with elastic surfaces (`RodContact`).

The points of a pair that are nearest at the start of a step and those at its end are two pairs of material points; with
the vector w from the first to the second point and the distance d of the nearest ones, the change of |w|^2 in the step
is at least that of d^2 at the former, and at most that at the latter. So between them there is a pair where both are
equal. The force of the step acts there: its size is the mean one between both depths of penetration
(`Surface.mean_force`), its direction the mean of w at the start and at the end. Then its work is the change of the
stored energy, exactly, also where contacts slide; and it has no resultant force and no resultant moment.

Friction acts across it at one point of space between both, on either rod with its moment about the centreline. Its law
is set-valued: surfaces stick at the end of the step, or else slip there against a friction at its bound. (With the slip
in the step instead, that at the end would be the opposite of that at the start where they come to stick, for ever: the
rule is trapezoidal.) What sticks does not creep. Where the slip turns back in a step, so that such a friction would add
energy, the law holds for the slip in the step: the work of friction is never positive.

Newton's method has the tangent of the rods without contact, by whose inverse gaps and slips respond linearly to forces.
With it the forces of all contacts are found before a step is taken (algebra/contact.c); what is not linear is in the
next residual.
"""

import numpy as np
from scipy.sparse import csr_array

from cosserat_fenicsx.algebra.building import Pointers
from cosserat_fenicsx.numerics import small_rotations
from cosserat_fenicsx.strands import Strands, across, closest_segments, in_words, overlap

# Gaps of contacts that are looked for, over the largest radius; movement of a node, over the smallest radius, after
# which they are looked for again where there are some, and the least gap, over the largest, where there are none.
_REACH, _AGAIN, _NEAR = 8.0, 0.25, 4.0
# Largest movement of a node in a step over the smallest radius and the gap (a point between nodes moves up to 1.3 times
# as far, so that two strands approach each other by less than the sum of their radii); the same of a pair.
_SHARE, _PAIR = 0.35, 2.6
# Gaps of polygons that are looked for where rods touch, over the largest radius.
_CLOSE = 0.25
# Largest depth, over the sum of the radii; and that of polygons where no contact is known, over the smallest radius.
_DEEPEST, _DEEP = 0.5, 0.02
# Steps to the place where a force acts; Newton steps for the forces, and their relative change that ends them.
_TO_PLACE, _MOST, _SMALL = 6, 40, 1e-13
# Sweeps over the contacts for forces by a linear law; changes of the motion that end them, over the first one and over
# the largest radius.
_SWEEPS, _SHARE_LEFT, _SMALLEST = 2000, 1e-12, 1e-16
# Slip over the largest movement in the step, and over the largest radius, below which a contact sticks; error of a
# friction over the largest bound.
_STICKS, _ROUNDING, _BROKEN = 1e-5, 1e-9, 1e-3


def _farthest(x, before):
    """The largest movement of a node between positions (N, 3)."""
    return np.linalg.norm(x - before, axis=1).max()


class _Look:
    """The contacts at positions x (N, 3): `touches` with their `law`, stored `energy`, and a lower bound of the `gap`
    between any two strands. They are followed from those, `known`, at positions `of` where they were looked for."""

    def __init__(self, x, of, known, touches, gap, surface):
        self.x, self.of, self.known, self.touches, self.law = x, of, known, touches, surface.law(touches)
        self.gap = min(touches.gap.min(initial=gap), gap)
        self.energy = float(surface.energy(self.law, -touches.gap).sum())


class _Pairs:
    """The contacts of a step, from a `_Look` at its start to positions x at its end, with their forces: `force` (m,)
    with its derivative `slope` by the depth at the end, at the places `element`, `place` (m, 2), along `direction`;
    `apart`: (m,) the distance of these places where forces act. now: `Touches` at x where they are known, or None."""

    def __init__(self, strands, surface, start, x, h, at_end, now):
        self._strands, self._surface, self._h = strands, surface, h
        self._at_end, before = at_end, start.touches
        self.which = np.flatnonzero(before.gap < _PAIR * _farthest(x, start.x))
        self.before, self.law = before.of(self.which), tuple(part[self.which] for part in start.law)
        self.now = strands.followed(x, self.before) if now is None else now.of(self.which)
        self.force, self.slope, self.mean = self.forces(-self.now.gap)
        self.element, self.place, self.direction = self.now.element, self.now.place, self.now.normal
        self.apart = self.now.distance
        if not at_end and len(self.now):
            self._find_places(start.x, x)

    def forces(self, depth):
        """(m,) forces where the depths at the end are these, their derivatives, and the elastic forces alone."""
        surface, before = self._surface, -self.before.gap
        damping = surface.damping / self._h
        if self._at_end:
            mean, slope = surface.force(self.law, depth)
        else:
            mean, slope = surface.mean_force(self.law, before, depth)
        factor = 1 + damping * (depth - before)
        held = factor > 0
        return (np.where(held, mean * factor, 0.0), np.where(held, slope * factor + damping * mean, 0.0), mean)

    def _find_places(self, x0, x1):
        """Find the points where forces act, by false position, and the directions there."""
        pressed = np.flatnonzero(self.force)
        if not len(pressed):
            return
        strands, before, now = self._strands, self.before.of(pressed), self.now.of(pressed)
        target = (now.distance - before.distance) * (now.distance + before.distance)
        both = np.concatenate([x0, x1 - x0], axis=1)

        def off(share):
            element, place = strands.between(before, now, share)
            found = strands.apart(both, element, place)
            start, change = found[:, :3], found[:, 3:]
            return np.sum(change * (2 * start + change), axis=1) - target, (element, place, 2 * start + change)

        low, high = np.zeros(len(now)), np.ones(len(now))
        (at_low, _), (at_high, _) = off(low), off(high)
        small = 1e-16 * now.distance**2
        for step in range(_TO_PLACE):
            difference = at_low - at_high
            slides = difference > small
            share = np.where(slides, low + (high - low) * at_low / np.where(slides, difference, 1.0), (low + high) / 2)
            share = np.minimum(np.maximum(share, 0.0), 1.0)
            left, found = off(share)
            if np.abs(left[slides]).max(initial=0.0) <= 1e-15 * (now.distance**2).max():
                break
            above = left > 0
            low, high = np.where(above, share, low), np.where(above, high, share)
            at_low = np.where(above, left, at_low * (0.5 if step else 1.0))
            at_high = np.where(above, at_high * (0.5 if step else 1.0), left)
        self.element, self.place, self.direction, self.apart = (
            part.copy() for part in (self.element, self.place, self.direction, self.apart)
        )
        self.element[pressed], self.place[pressed], mean = found
        self.direction[pressed] = mean / (now.distance + before.distance)[:, None]
        self.apart[pressed] = np.linalg.norm(mean, axis=1) / 2

    def pulls(self, which, parts):
        """Nodes (k, n) that move the places of some pairs, and forces and moments there, (k, parts, n, 6), of unit
        forces along `direction` and, of three parts, across it on the surfaces, which turn with it in the step."""
        strands, element, direction = self._strands, self.element[which], self.direction[which]
        sides = across(direction, self.before.normal[which]) if parts > 1 else None
        found = strands.surface_pulls(element, self.place[which], direction, self.apart[which], sides)
        return strands.movers(element), found


class RodsTouching(Pointers):
    """The contacts of a scene's rods in the steps of a loaded `StepProblem`; methods as of `NodalContact`."""

    def __init__(self, problem):
        super().__init__()
        model = problem.model
        scene, layout, length = model.scene, model.layout, model.scales.length
        self._problem, self._scene, self._length = problem, scene, length
        self._at_end = problem.acting_share == 1
        action = scene.rod_contact
        self._nodal = model.nodal[np.argsort(model.slots)]
        self._rows = model.numbering.rows[self._nodal]
        self._strands = strands = Strands.of(scene, layout, model.rule, length)
        counts = np.multiply(layout.counts, model.signature.degree) + 1
        self._origins = np.repeat(scene.origins / length, counts, axis=0)
        self._surface = action.surface(strands, model.rule.lobatto, model.scales, model.time)
        radii = strands.radii
        self._radius, self._largest = radii[radii > 0].min(), radii.max()
        self._vectors = problem.numbering.vector(), problem.numbering.vector()
        self._parts = 3 if action.friction else 1
        self._c = self._ffi.new("pairs *", {"parts": self._parts, "most": _SWEEPS, "friction": action.friction,
                                            "share": _SHARE_LEFT, "smallest": _SMALLEST * self._largest})  # fmt: skip
        self._body, self._rows_of = self._bodies()
        self._look, self._polygons = None, _Polygons(scene, layout, model.rule, length)

    def _bodies(self):
        """(rods,) which body each rod is part of, and the rows of the unknowns of each body. Rods are bodies of their
        own where each is solved without the others, and else all are one."""
        problem, strands = self._problem, self._strands
        size, count = len(self._vectors[0].array_r), strands.rods.max() + 1
        if problem.interface or problem.tensions:
            return np.zeros(count, dtype=int), [np.arange(size)]
        model, of_rows = problem.model, np.zeros(size, dtype=int)
        rows = problem.numbering.rows[model.cell_dofs]
        rods = np.broadcast_to(strands.rods[model.rods.cells[: len(rows)], None], rows.shape)
        of_rows[rows[rows >= 0]] = rods[rows >= 0]
        order = np.argsort(of_rows, kind="stable")
        return np.arange(count), np.split(order, np.searchsorted(of_rows[order], np.arange(1, count)))

    @property
    def _x(self):
        return self._problem.state[self._nodal[:, :3]] + self._origins

    @property
    def _q(self):
        return self._problem.state[self._nodal[:, 3:]]

    def _looked(self, x):
        reach = _REACH * self._largest
        touches, _ = self._strands.near(x, reach)
        return _Look(x, x, touches, touches, reach, self._surface)

    def _moved_on(self, look, x):
        """The look at other positions, by the same contacts; None where they have to be looked for again."""
        moved, known, touches = _farthest(x, look.of), look.known, look.known
        gap = _REACH * self._largest - _PAIR * moved
        if len(known):
            touches = self._strands.followed(x, known) if moved <= _AGAIN * self._radius else None
        elif gap < _NEAR * self._largest:
            touches = None
        return None if touches is None else _Look(x, look.of, known, touches, gap, self._surface)

    def begin(self, h):
        x = self._x
        if self._look is None or not np.array_equal(x, self._look.x):
            self._look = self._looked(x)
        self._start, self._q0, self._h, self._columns, self._near = self._look, self._q, h, {}, None
        count = len(self._start.touches)
        self._rubbing, self._of_step = np.zeros((count, 2)), np.full(count, self._at_end)
        if self._parts > 1:
            rates = self._problem.model.velocity.x.array[self._nodal]
            turning = (small_rotations(self._q0) @ rates[:, 3:, None])[..., 0]
            self._ahead = h / 2 * np.concatenate([rates[:, :3], turning], axis=1)
        self._end = self._pairs = self._now = None
        self._longest = _SHARE * (self._radius + max(self._look.gap, 0.0))

    def give_up(self):
        self._end = None

    def _at(self, x, now=None):
        return _Pairs(self._strands, self._surface, self._start, x, self._h, self._at_end, now)

    def _friction(self, pairs):
        """(m, 2) the friction of pairs, at most in proportion to their normal forces."""
        return self._rubbing[pairs.which] * (pairs.force > 0)[:, None]

    def add_forces(self, b):
        self._now = pairs = self._at(self._x)
        pressed = np.flatnonzero(pairs.force)
        if len(pressed):
            nodes, pulls = pairs.pulls(pressed, self._parts)
            forces = pairs.force[pressed][:, None]
            if self._parts > 1:
                forces = np.c_[forces, self._friction(pairs)[pressed]]
            total = np.einsum("kp,kpni->kni", forces, pulls)
            rows = self._rows[nodes][:, :, [0, 1, 2, 4, 5, 6]]
            np.subtract.at(b, np.maximum(rows, 0), np.where(rows < 0, 0.0, total))

    def meet(self, x, change):
        """Change Newton's step so that the laws hold after it."""
        pairs, parts = self._now, self._parts
        if not len(pairs.now):
            return
        free = pairs.now.gap - self._changes(change, *self._gradients(pairs, slice(None)))
        near = np.flatnonzero((free < 0) | (pairs.force > 0))
        if not len(near):
            return
        nodes, pulls = pairs.pulls(near, parts)
        A, own, columns = self._compliance(pairs, near, nodes, pulls)
        before, motion = np.zeros((2, len(near), parts))
        before[:, 0], motion[:, 0] = pairs.force[near], free[near]
        if parts > 1:
            before[:, 1:] = self._friction(pairs)[near]
            motion[:, 1:] = -self._changes(change, *self._by_unknowns(nodes, pulls[:, 1:]))
            slips, ahead = self._slips(nodes, pulls, pairs.which[near])
            motion[:, 1:] += slips - ahead
        force, gap, multiplier, law = before.copy(), pairs.now.gap[near], np.zeros(len(near)), self._c
        whole = pairs.now.gap.copy()
        law.count, law.compliance = len(near), self._pointer(A.data)
        law.start, law.place, law.own = (self._pointer(x, "int *") for x in (A.indptr, A.indices, own))
        law.motion, law.force, law.multiplier = (self._pointer(part) for part in (motion, force, multiplier))
        for _ in range(_MOST):
            whole[near] = gap
            normal, slope = (np.ascontiguousarray(part[near]) for part in pairs.forces(-whole)[:2])
            law.gap, law.normal, law.slope = (self._pointer(part) for part in (gap, normal, slope))
            self._lib.settle_pairs(law)
            last, gap = gap, motion[:, 0].copy()
            if np.abs(gap - last).max() <= _SMALL * self._largest:
                break
        if parts > 1:
            self._rubbing[:] = 0.0
            self._rubbing[pairs.which[near]] = force[:, 1:]
            adds = np.sum(force[:, 1:] * (motion[:, 1:] + ahead), axis=1) > 0
            self._of_step[pairs.which[near[adds]]] = True
        change -= columns @ (force - before).ravel()

    def _pointer(self, array, kind="double *"):
        """C's pointer to an array that lives as long as it is used."""
        return self._ffi.cast(kind, array.ctypes.data)

    @staticmethod
    def _changes(change, rows, by):
        """Changes of motions (..., n) by those of the unknowns; rows: -1 where clamped."""
        return np.sum(np.where(rows < 0, 0.0, change[rows]) * by, axis=-1)

    def _gradients(self, pairs, which):
        """Rows of the unknowns (k, n) and derivatives of the gaps at the end."""
        now = pairs.now.of(which)
        rows = self._rows[self._strands.nodes_of(now)][..., :3]
        return rows.reshape(len(now), -1), self._strands.gradients(now).reshape(len(now), -1)

    def _by_unknowns(self, nodes, pulls):
        """Rows (k, 1, n) and derivatives (k, parts, n) of the work of pulls (k, parts, nodes, 6) by the unknowns."""
        turning = small_rotations((self._q0 + self._q) / 2)[nodes]
        of_q = np.einsum("kpni,knij->kpnj", pulls[..., 3:], turning)
        by = np.concatenate([pulls[..., :3], of_q], axis=3)
        return self._rows[nodes].reshape(len(nodes), 1, -1), by.reshape(*by.shape[:2], 7 * nodes.shape[1])

    def _slips(self, nodes, pulls, names):
        """(k, 2) slips in the step across pairs, and half of those at its start's rates where the law asks, or 0."""
        turned = small_rotations((self._q0 + self._q) / 2) @ (self._q - self._q0)[:, :, None]
        motion = np.concatenate([self._x - self._start.x, turned[..., 0]], axis=1)
        slips, ahead = (np.einsum("kpni,kni->kp", pulls[:, 1:], x[nodes]) for x in (motion, self._ahead))
        return slips, np.where(self._of_step[names][:, None], 0.0, ahead)

    def _compliance(self, pairs, near, nodes, pulls):
        """Motions of gaps and slips (k parts, k parts), sparse, by unit forces of the first contacts, where those of
        the contact itself begin in them, and changes of the unknowns (unknowns, k parts) by these forces."""
        names, parts = pairs.which[near], self._parts
        if self._near is None or not np.array_equal(self._near[0], names):
            k, size = len(near), len(self._vectors[0].array_r)
            self._respond(names, self._rows[nodes][:, :, [0, 1, 2, 4, 5, 6]], pulls)
            rows, found = zip(*(self._columns[name] for name in names.tolist()), strict=True)
            places = np.concatenate([np.tile(at, parts) for at in rows])
            starts = np.cumsum([0, *np.repeat([len(at) for at in rows], parts)])
            columns = csr_array((np.concatenate([x.ravel() for x in found]), places, starts), shape=(k * parts, size))
            of_parts = [self._gradients(pairs, near)]
            if parts > 1:
                at, by = self._by_unknowns(nodes, pulls[:, 1:])
                of_parts += [(at[:, 0], by[:, i]) for i in (0, 1)]
            at, by = (np.concatenate(part, axis=1) for part in zip(*of_parts, strict=True))
            widths = [part.shape[1] for part, _ in of_parts]
            held, row = at >= 0, parts * np.arange(k)[:, None] + np.repeat(np.arange(parts), widths)
            motions = csr_array((by[held], (row[held], at[held])), shape=(k * parts, size))
            A, row = (columns @ motions.T).tocoo(), np.arange(k * parts, dtype=np.int64)
            first, each = row // parts * parts, np.repeat(row, parts)  # own motions are there, also where they are zero
            at = np.append(A.row, each), np.append(A.col, (first[:, None] + np.arange(parts)).ravel())
            A = csr_array((np.append(A.data, np.zeros(len(each))), at), shape=A.shape)
            keys = np.repeat(row, np.diff(A.indptr)) * len(row) + A.indices
            own = np.searchsorted(keys, row * len(row) + first).astype(np.intc)
            A.indptr, A.indices = A.indptr.astype(np.intc), A.indices.astype(np.intc)
            self._near = names, A, own, columns.T.tocsr()
        return self._near[1:]

    def _respond(self, names, rows, pulls):
        """Find changes by unit forces of pairs, as at their first contact in the step: in `_columns` by name the rows
        of unknowns that change, and the changes (parts, rows). One solution serves many pairs that have no rod in
        common, since rods that are not joined do not move each other."""
        strands, (load, answer) = self._strands, self._vectors
        new = [i for i, name in enumerate(names.tolist()) if name not in self._columns]
        bodies = self._body[strands.rods[self._start.touches.element[names[new]]]]
        rounds, taken = {}, [0] * len(self._rows_of)
        for i, (a, b) in zip(new, bodies.tolist(), strict=True):
            free = ~(taken[a] | taken[b])
            bit = free & -free  # the first round in which neither has its turn
            taken[a] |= bit
            taken[b] |= bit
            rounds.setdefault(bit, []).append((i, a, b))
        for together in rounds.values():
            which = [i for i, _, _ in together]
            places = [self._rows_of[a] if a == b else np.concatenate([self._rows_of[a], self._rows_of[b]])
                      for _, a, b in together]  # fmt: skip
            found = [np.empty((pulls.shape[1], len(at))) for at in places]
            for part in range(pulls.shape[1]):
                load.set(0.0)
                at = rows[which]
                np.add.at(load.array_w, np.maximum(at, 0), np.where(at < 0, 0.0, pulls[which, part]))
                self._problem.solve(load, answer)
                for values, place in zip(found, places, strict=True):
                    values[part] = answer.array_r[place]
            self._columns |= {names[i]: both for i, *both in zip(which, places, found, strict=True)}

    # -- after a step ------------------------------------------------------------------------------------------------

    def objection(self):
        """Why the step that has converged must not be accepted, "" where it may be."""
        x = self._x
        if _farthest(x, self._start.x) > self._longest:
            return "a rod moved by more than its radius allows in one step"
        moved_on = self._moved_on(self._start, x)
        self._pairs = self._at(x, moved_on.touches if moved_on else None)
        self._end = look = moved_on or self._looked(x)
        both = self._strands.radii[look.touches.element].sum(axis=1)
        if (-look.touches.gap > _DEEPEST * both).any():
            k = int(np.argmin(look.touches.gap / both))
            found = in_words(self._scene.rods, self._strands.place_of(look.touches, k, self._length), "overlaps")
            deep = -look.touches.gap[k] * self._length
            return f"{found} by {deep:.3g} m, more than half of both radii: its stiffness is too small"
        if self._breaks_laws():
            k = self._pairs.which[np.argmax(self._pairs.force)]
            found = in_words(self._scene.rods, self._strands.place_of(self._start.touches, k, self._length), "next to")
            return f"the forces between rods do not follow from the motion, such as those of {found}"
        return self._polygons.objection(x, look.touches, self._strands)

    def _rubbed(self):
        """Normal forces (k,), frictions, slips in the step and of the law (k, 2), of pairs that press."""
        pairs = self._pairs
        pressed = np.flatnonzero(pairs.force)
        friction = self._friction(pairs)[pressed]
        slips, ahead = self._slips(*pairs.pulls(pressed, self._parts), pairs.which[pressed])
        return pairs.force[pressed], friction, slips, slips - ahead

    def _breaks_laws(self):
        """Whether normal forces differ from the last iteration's, or frictions break their law or add energy."""
        pairs, last = self._pairs, self._now
        if np.array_equal(pairs.which, last.which):
            off = np.abs(pairs.force - last.force).max(initial=0.0)
            if off > _BROKEN * pairs.force.max(initial=0.0):
                return True
        if self._parts == 1:
            return False
        normal, friction, slips, slip = self._rubbed()
        bound, size = self._scene.rod_contact.friction * normal, np.linalg.norm(slip, axis=1)
        moved = _STICKS * _farthest(self._x, self._start.x) + _ROUNDING * self._largest
        rubs = size > moved
        off = np.linalg.norm(friction + bound[:, None] * slip / np.where(rubs, size, 1.0)[:, None], axis=1)
        beyond = np.linalg.norm(friction, axis=1) - bound
        adds = np.sum(friction * slips, axis=1) > moved * _BROKEN * bound.max(initial=0.0)
        return bool(adds.any() or (np.where(rubs, off, beyond) > _BROKEN * bound.max(initial=0.0)).any())

    def books(self):
        """Change of the stored energy in the step, and what was dissipated; dimensionless."""
        pairs = self._pairs
        lost = float(np.sum((pairs.force - pairs.mean) * (pairs.before.gap - pairs.now.gap)))
        if self._parts > 1:
            _, friction, slips, _ = self._rubbed()
            lost += float(np.maximum(-np.sum(friction * slips, axis=1), 0.0).sum())
        return self._end.energy - self._start.energy, lost

    def accept(self):
        """Accept the step."""
        self._look = self._end

    def memory(self):
        """See `Stepper.memory`; what `_Polygons` has seen decides on no digits."""
        self._look = self._look or self._looked(self._x)
        return {"looked": self._look.of.copy()}

    def recall(self, memory):
        self._look, x = self._looked(memory["looked"]), self._x
        if not np.array_equal(x, self._look.x):
            self._look = self._moved_on(self._look, x) or self._looked(x)


class _Polygons:
    """Fine polygons along rods, which show, without `Strands`, that no rod has entered another."""

    def __init__(self, scene, layout, rule, length):
        self._scene, self._length, self._apart = scene, length, scene.rod_contact.apart(scene)
        starts, rows, columns, weights, count = np.cumsum([0, *layout.counts]), [], [], [], 0
        p = len(rule.nodes) - 1

        def at(rod, s):
            nonlocal count
            i = scene.number(rod)
            breaks = np.asarray(layout.breaks[i])
            element = np.clip(np.searchsorted(breaks, s / rod.length, side="right") - 1, 0, layout.counts[i] - 1)
            place = (s / rod.length - breaks[element]) / np.diff(breaks)[element]
            first = p * starts[i] + i + p * element
            columns.append((first[:, None] + np.arange(p + 1)).ravel())
            weights.append(rule.basis(place).ravel())
            rows.append(np.repeat(count + np.arange(len(s)), p + 1))
            count += len(s)
            return np.zeros((len(s), 3))

        _, *self._of = scene.rod_contact.polygons(scene.rods, at)
        weights, rows, columns = (np.concatenate(part) for part in (weights, rows, columns))
        nodes = p * starts[-1] + len(layout.counts)
        self._matrix = csr_array((weights, (rows, columns)), shape=(count, nodes))
        self._radius, self._seen = self._of[2].min(), None

    def objection(self, x, touches, strands):
        """See `RodsTouching.objection`, for positions x and the contacts known there, those of `Strands`."""
        if self._seen is not None:
            last, spare = self._seen
            if spare > 2 * _PAIR * _farthest(x, last) * self._length:
                return ""
        rods, s, radii = self._of
        reach, count = (_CLOSE if (touches.gap < 0).any() else _NEAR) * radii.max(), len(self._scene.rods)
        found = closest_segments(self._matrix @ x * self._length, rods, s, radii, self._apart, reach)
        known = np.zeros((count, count))
        pair = tuple(np.sort(strands.rods[touches.element], axis=1).T)
        np.maximum.at(known, pair, -touches.gap * self._length)
        pair = tuple(np.sort([place[:, 0] for place in found[2:]], axis=0).astype(int))
        allowed = known[pair] + _DEEP * self._radius
        if why := overlap(self._scene.rods, found, allowed):
            return f"{why}, deeper than at the contacts that the mesh shows: expected more elements"
        self._seen = x, (allowed + found[0] + found[1]).min(initial=reach)
        return ""
