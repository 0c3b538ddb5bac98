"""Rods that touch each other in a time step, with elastic surfaces (`RodContact`).

The points of a pair that are nearest at the start of a step and those at its end are two pairs of material points; with
the vector w from the first to the second point and the distance d of the nearest ones, the change of |w|^2 in the step
is at least that of d^2 at the former, and at most that at the latter. So between them there is a pair where both are
equal. The force of the step acts there: its size is the mean one between both depths of penetration
(`Surface.mean_force`), its direction the mean of w at the start and at the end. Then its work is the change of the
stored energy, exactly, also where contacts slide; and it has no resultant force and no resultant moment.

Newton's method has the tangent of the rods without contact, by whose inverse gaps respond linearly to forces. With it
the forces of all contacts are found before a step is taken; what is not linear is in the next residual.
"""

import numpy as np
from scipy.sparse import csr_array

from cosserat_fenicsx.strands import Strands, closest_segments

# Gaps of contacts that are looked for, over the largest radius; movement of a node, over the smallest radius, after
# which they are looked for again where there are some, and the least gap, over the largest, where there are none.
_REACH, _AGAIN, _NEAR = 8.0, 0.25, 4.0
# Largest movement of a node in a step over the smallest radius and the gap (a point between nodes moves up to 1.3 times
# as far, so that two strands approach each other by less than the sum of their radii); the same of a pair.
_SHARE, _PAIR = 0.35, 2.6
# Largest depth, over the sum of the radii; and that of polygons where no contact is known, over the smallest radius.
_DEEPEST, _DEEP = 0.5, 0.02
# Steps to the place where a force acts; Newton steps for the forces, and their relative change that ends them.
_TO_PLACE, _MOST, _SMALL = 6, 40, 1e-13


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
    with its derivative `slope` by the depth at the end, at the places `element`, `place` (m, 2), along `direction`."""

    def __init__(self, strands, surface, start, x, h, at_end, now=None):
        self._strands, self._surface, self._start, self._h, self._at_end = strands, surface, start, h, at_end
        before = start.touches
        self.which = np.flatnonzero(before.gap < _PAIR * _farthest(x, start.x))
        self.before, self.law = before.of(self.which), tuple(part[self.which] for part in start.law)
        self.now = strands.followed(x, self.before) if now is None else now.of(self.which)
        self.force, self.slope, self.mean = self.forces(-self.now.gap)
        self.element, self.place, self.direction = self.now.element, self.now.place, self.now.normal
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
        strands, before, now = self._strands, self.before, self.now
        target = (now.distance - before.distance) * (now.distance + before.distance)

        def off(share):
            element, place = strands.between(before, now, share)
            start, change = (strands.apart(x, element, place) for x in (x0, x1 - x0))
            return np.sum(change * (2 * start + change), axis=1) - target, (element, place, 2 * start + change)

        low, high = np.zeros(len(now)), np.ones(len(now))
        (at_low, _), (at_high, _) = off(low), off(high)
        small = 1e-16 * now.distance**2
        for step in range(_TO_PLACE):
            difference = at_low - at_high
            slides = difference > small
            share = np.where(slides, low + (high - low) * at_low / np.where(slides, difference, 1.0), (low + high) / 2)
            share = np.clip(share, 0.0, 1.0)
            left, found = off(share)
            if np.abs(left[slides]).max(initial=0.0) <= 1e-15 * (now.distance**2).max():
                break
            above = left > 0
            low, high = np.where(above, share, low), np.where(above, high, share)
            at_low = np.where(above, left, at_low * (0.5 if step else 1.0))
            at_high = np.where(above, at_high * (0.5 if step else 1.0), left)
        self.element, self.place, mean = found
        self.direction = mean / (now.distance + before.distance)[:, None]

    def pulls(self, rows):
        """Rows (m, n) of the unknowns, -1 where clamped, and (m, n) what unit forces are there; rows: (N, 3)."""
        strands, shape = self._strands, (len(self.now), -1)
        pulls = strands.pulls(self.element, self.place, self.direction)
        return rows[strands.movers(self.element)].reshape(shape), pulls.reshape(shape)

    def gradients(self, rows):
        """The same with the derivatives of the gaps at the end."""
        shape = len(self.now), -1
        return (rows[self._strands.nodes_of(self.now)].reshape(shape),
                self._strands.gradients(self.now).reshape(shape))  # fmt: skip


class RodsTouching:
    """The contacts of a scene's rods in the steps of a loaded `StepProblem`; its methods are those of `SpinLaw`."""

    def __init__(self, problem):
        model = problem.model
        scene, layout, length = model.scene, model.layout, model.scales.length
        self._problem, self._scene, self._length = problem, scene, length
        self._at_end = problem.acting_share == 1
        action = scene.rod_contact
        self._nodal = model.nodal[np.argsort(model.slots)][:, :3]
        self._rows = model.numbering.rows[self._nodal]
        self._strands = strands = Strands.of(scene, layout, model.rule, length)
        counts = np.multiply(layout.counts, model.signature.degree) + 1
        self._origins = np.repeat(scene.origins / length, counts, axis=0)
        self._surface = action.surface(strands, model.rule.lobatto, model.scales, model.time)
        radii = strands.radii
        self._radius, self._largest = radii[radii > 0].min(), radii.max()
        self._vectors = problem.numbering.vector(), problem.numbering.vector()
        self._look, self._polygons = None, _Polygons(scene, layout, model.rule, length)

    @property
    def _x(self):
        return self._problem.state[self._nodal] + self._origins

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
        self._start, self._h, self._columns = self._look, h, {}
        self._end = self._pairs = None
        self._longest = _SHARE * (self._radius + max(self._look.gap, 0.0))

    def give_up(self):
        self._end = None

    def _at(self, x, now=None):
        return _Pairs(self._strands, self._surface, self._start, x, self._h, self._at_end, now)

    def add_forces(self, b):
        self._now = pairs = self._at(self._x)
        pressed = np.flatnonzero(pairs.force)
        if len(pressed):
            rows, pulls = (part[pressed] for part in pairs.pulls(self._rows))
            np.add.at(b, np.maximum(rows, 0), np.where(rows < 0, 0.0, -pulls * pairs.force[pressed][:, None]))

    def meet(self, x, change):
        """Change Newton's step so that the laws hold after it."""
        pairs = self._now
        if not len(pairs.now):
            return
        rows, gradients = pairs.gradients(self._rows)
        gradients, rows = np.where(rows < 0, 0.0, gradients), np.maximum(rows, 0)
        free = np.einsum("kj,kj->k", gradients, change[rows]) - pairs.now.gap  # depths without a change of forces
        near = np.flatnonzero((free > 0) | (pairs.force > 0))
        if not len(near):
            return
        columns = np.column_stack([self._response(pairs, k) for k in near])
        A = np.einsum("kj,kjl->kl", gradients[near], columns[rows[near]])
        depth, before, law = -pairs.now.gap[near], pairs.force[near], pairs.forces
        whole = -pairs.now.gap
        for _ in range(_MOST):
            whole[near] = depth
            force, slope, _ = (part[near] for part in law(whole))
            off = depth - free[near] + A @ (force - before)
            step = np.linalg.solve(np.eye(len(near)) + A * slope, off)
            depth = depth - step
            if np.abs(step).max() <= _SMALL * self._largest:
                break
        whole[near] = depth
        change -= columns @ (law(whole)[0][near] - before)

    def _response(self, pairs, k):
        """The change of the unknowns by a unit force of a pair, as at its first contact in the step."""
        name = pairs.which[k]
        if name not in self._columns:
            load, answer = self._vectors
            rows, pulls = (part[k] for part in pairs.pulls(self._rows))
            load.set(0.0)
            np.add.at(load.array_w, np.maximum(rows, 0), np.where(rows < 0, 0.0, pulls))
            self._problem.solve(load, answer)
            self._columns[name] = answer.array_r.copy()
        return self._columns[name]

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
            return f"{self._in_words(look.touches, k)}, more than half of both radii: its stiffness is too small"
        return self._polygons.objection(x, look.touches, self._strands)

    def _in_words(self, touches, k):
        (a, s), (b, t) = (
            (self._scene.rods[self._strands.rods[touches.element[k, i]]].name,
             self._strands.s(touches.element[:, i], touches.place[:, i])[k] * self._length) for i in (0, 1)
        )  # fmt: skip
        deep = -touches.gap[k] * self._length
        return f"rod '{a}' at s = {s:.6g} m enters rod '{b}' at s = {t:.6g} m by {deep:.3g} m"

    def books(self):
        """Change of the stored energy in the step, and what was dissipated; dimensionless."""
        pairs = self._pairs
        lost = (pairs.force - pairs.mean) * (pairs.before.gap - pairs.now.gap)
        return self._end.energy - self._start.energy, float(lost.sum())

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
    """Fine polygons along rods, whose distances show, independently of `Strands`, that no rod has entered another where
    no contact is known."""

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
        reach = _NEAR * self._of[2].max()
        if self._seen is not None:
            last, clear = self._seen
            if clear > _PAIR * _farthest(x, last) * self._length:
                return ""
        rods, s, radii = self._of
        gap, sag, *places = closest_segments(self._matrix @ x * self._length, rods, s, radii, self._apart, reach)
        depth = -(gap + sag) - _DEEP * self._radius
        deep = np.flatnonzero(depth > 0)
        if len(deep):
            pair = np.sort(strands.rods[touches.element], axis=1)
            for k in deep[np.argsort(-depth[deep])]:
                (a, u), (b, v) = (place[k] for place in places)
                same = (pair == np.sort([int(a), int(b)])).all(axis=1)
                if depth[k] > -touches.gap[same].min(initial=0.0) * self._length:
                    first, second = (self._scene.rods[int(i)].name for i in (a, b))
                    return (
                        f"rod '{first}' at s = {u:.6g} m enters rod '{second}' at s = {v:.6g} m by {-gap[k]:.3g} m, "
                        "deeper than at the contacts that the mesh shows: expected more elements"
                    )
        self._seen = x, (gap - sag).min(initial=reach)
        return ""
