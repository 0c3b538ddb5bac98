"""Equilibria of rods that touch each other: the laws of all contacts, solved exactly on the compliance of the rods.

In every iteration the step dx and the contact forces l follow from

    (K - sum l d2g) dx + r - G^T l = 0,    g + G dx >= 0,    l >= 0,    l (g + G dx) = 0,

with the rods' tangent K and residual r without contact, the gaps g, their derivatives G, and their second derivatives
d2g, in which the nearest points slide. K is never assembled: the columns of G^T and of the few eigenvectors of d2g are
solved with its factors, and what is left is a small complementarity problem.

No rod passes through another: a step moves points by so little that two strands, which are never nearer than half the
sum of their radii, cannot cross in it.
"""

import numpy as np

from cosserat_fenicsx.algebra.newton import LimitedNewton, Solved
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.strands import Strands, in_words

# Largest movement of a node in a step over the smallest radius and the gap (a point between nodes moves up to 1.3 times
# as far, so that two strands approach each other by less than the sum of their radii); largest rotation, rad.
_SHARE, _WIDEST = 0.35, 0.5
# Gaps of contacts that are looked for, over the largest radius.
_REACH = 8.0
# Least distance of two centrelines, over the sum of the radii.
_CLOSEST = 0.5
# Size of a full step (rod lengths, rad) at which it ends, this one or, by the contraction, the next; and of two in turn
# that do not shrink, which rounding leaves.
_SETTLED, _ROUNDING = 1e-11, 2e-7
# Iterations allowed, and full steps; full steps after which shares of steps are taken in turn.
_MOST, _MOST_FULL, _PATIENCE, _SHARES = 300, 40, 20, (1.0, 0.5, 0.7)
# Residual force of a node at equilibrium, over the largest force.
_BALANCED = 1e-7
# Distance from an element's end, in elements, that is at it.
_AT_END = 1e-6
# A contact of the iteration before is the same up to this sliding, over the radius; added to the diagonal of the
# compliance, over its mean.
_SAME, _REGULAR = 4.0, 1e-12
# First stiffness of springs that keep the tangent stable, over that of the rods at a contact; factor of the next one;
# the largest; eigenvalues of the compliance that need none, over its mean: out of equilibrium it is not symmetric.
_SPRING, _STIFFER, _STIFFEST, _NOTHING = 1e-3, 10.0, 1e6, 1e-6


def complementary(A, b):
    """l >= 0 with A l + b >= 0 and l (A l + b) = 0, for a positive definite A: by the method of active sets."""
    from scipy.optimize import nnls  # late: scipy is slow to import

    size = np.sqrt(np.diag(A))
    L = np.linalg.cholesky(A / size / size[:, None])
    found, _ = nnls(L.T, -np.linalg.solve(L, b / size), maxiter=50 * len(b) + 100)
    return found / size


class _Steps(LimitedNewton):
    """Newton steps of a problem whose direction `RodContacts` completes."""

    def __init__(self, problem, contacts):
        super().__init__(problem, 1.0, _WIDEST)
        self._contacts = contacts

    def _direction(self):
        return super()._direction() and self._contacts.complete(self._change)

    def limit(self, longest):
        """Set the longest displacement of a node, in the model's unit of length."""
        self._longest = longest


class RodContacts:
    """The contacts of a scene's rods at the state of a `Problem`.

    Args:
        problem: a `Problem`, loaded with a scene that has a `RodContact`.

    Attributes:
        force: (unknowns,) what the contacts add to the residual.
    """

    def __init__(self, problem):
        model = problem.model
        scene, layout, length = model.scene, model.layout, model.scales.length
        self._problem, self._model, self._length = problem, model, length
        self._nodal = model.nodal[np.argsort(model.slots)][:, :3]
        self._rows = model.numbering.rows[self._nodal]
        self.strands = Strands.of(scene, layout, model.rule, length)
        counts = np.multiply(layout.counts, model.signature.degree) + 1
        self._origins = np.repeat(scene.origins / length, counts, axis=0)
        radii = self.strands.radii
        self._radius, self._largest = radii[radii > 0].min(), radii.max()
        self._newton = _Steps(problem, self)
        self._vectors = problem.numbering.vector(), problem.numbering.vector()
        self.force = np.zeros(problem.numbering.size)
        self._take(self.strands.near(self._x, 0.0)[0], None, 0)

    def _take(self, touches, forces, removed):
        self._touches, self._forces = touches, np.zeros(len(touches)) if forces is None else forces
        self.removed = removed
        self.force[:] = 0.0
        rows, gradients = self._gradients(touches)
        np.add.at(self.force, np.maximum(rows, 0), np.where(rows < 0, 0.0, -gradients * self._forces[:, None]))

    @property
    def memory(self):
        """What `recall` takes: the contacts and their forces."""
        return self._touches, self._forces, self.removed

    def recall(self, memory):
        """Return to contacts and forces of another state."""
        self._take(*memory)

    @property
    def _x(self):
        return self._model.state.x.array[self._nodal] + self._origins

    def _gradients(self, touches):
        """Rows of the unknowns (m, n), -1 where clamped, and derivatives of the gaps by them."""
        nodes = self.strands.nodes_of(touches)
        shape = len(touches), 3 * nodes.shape[1]
        return self._rows[nodes].reshape(shape), self.strands.gradients(touches).reshape(shape)

    # -- equilibrium -------------------------------------------------------------------------------------------------

    def solve(self, numbers, load_factor, accepted):
        """Newton's method to an equilibrium at a load factor, by steps in which no rod passes through another.

        Args:
            numbers: `Problem.numbers` to start from, where no strand is passed on the way to them from the last
                accepted state, `accepted`, from which it starts otherwise.

        Returns:
            Solved.
        """
        problem, newton = self._problem, self._newton
        problem.set_load_factor(load_factor)
        newton.iterations, spring, sizes, why = 0, 0.0, [], ""
        problem.put(accepted)
        found, closest = self._look()
        moved, _ = problem.model.sizes(numbers[0] - accepted[0])
        if moved <= self._allowed(found):
            problem.put(numbers)
            found, closest = self._look()
            if closest < _CLOSEST:
                problem.put(accepted)
                found, closest = self._look()
        self._spring = spring
        while newton.iterations < _MOST and len(sizes) < _MOST_FULL:
            obey()
            self.force[:] = 0.0
            self._touches_now = found
            newton.limit(self._allowed(found))
            before, share = problem.numbers(), _SHARES[newton.iterations % 3] if len(sizes) > _PATIENCE else 1.0
            step = newton.step(share)
            if step is None:
                why = "the tangent is singular or the residual is not a number"
                break
            forces, touches = self._found, found
            found, closest = self._look()
            while closest < _CLOSEST:
                share = 0.5 * min(step.share, share)
                if share < 1e-6:
                    break
                problem.put(before)
                newton.take(share)
                found, closest = self._look()
            self._touches, self._forces = touches, forces
            size = max(step.moved, step.turned)
            whole = step.share == 1.0
            last = sizes[-1] if sizes else 0.0  # of a full step before
            shrinks = size < 0.1 * last and size * size < _SETTLED * last
            if whole and (size < _SETTLED or shrinks or 0.3 * last < size < _ROUNDING > last > 0):
                self._take(touches, forces, 0)
                return self._confirmed(newton.iterations)
            sizes = [*sizes, size] if whole or len(sizes) > _PATIENCE else []
            self._spring = self._spring / _STIFFER if self._spring > 1e-14 else 0.0
        why = why or f"Newton's iterations ran out, {self._in_words(found)}"
        return Solved(False, newton.iterations, why)

    def _confirmed(self, iterations):
        """`Solved`, where the contacts of the last step are those of the state, with its negative modes."""
        problem, (A, removed), active = self._problem, self._last, self._forces > 0
        allowed = _BALANCED * (problem.load_norm + self._forces.max(initial=0.0)) + self._model.round_off
        if not self._newton.imbalance() <= allowed:
            return Solved(False, iterations, f"forces are left over at a node, {self._in_words(self._touches)}")
        self.removed = removed - np.count_nonzero(np.linalg.eigvalsh(A[np.ix_(active, active)]) < 0)
        return Solved(True, iterations, "converged")

    def _look(self):
        return self.strands.near(self._x, _REACH * self._largest)

    def _allowed(self, touches):
        """The longest displacement of a node in a step."""
        return _SHARE * (self._radius + max(touches.gap.min(initial=_REACH * self._largest), 0.0))

    def _in_words(self, touches):
        if not len(touches):
            return "without a contact of rods"
        k = int(np.argmin(touches.gap))
        found = in_words(self._model.scene.rods, self.strands.place_of(touches, k, self._length), "next to")
        return f"with {found}, at a gap of {touches.gap[k] * self._length:.3g} m"

    def _known_forces(self, touches):
        """The forces of the iteration before at the same contacts; 0 at new ones."""
        forces, old = np.zeros(len(touches)), self._touches
        if not len(old) or not len(touches):
            return forces
        (rods, s), (old_rods, old_s) = ((self.strands.rods[x.element], self._s(x)) for x in (touches, old))
        off = np.abs(s[:, None] - old_s).max(axis=2)
        same = (rods[:, None] == old_rods).all(axis=2) & (touches.node[:, None] == old.node)
        off = np.where(same & (off < _SAME * self._largest), off, np.inf)
        nearest = off.argmin(axis=1)
        here = np.isfinite(off[np.arange(len(touches)), nearest])
        forces[here] = self._forces[nearest[here]]
        return forces

    def _s(self, touches):
        return np.column_stack([self.strands.s(touches.element[:, k], touches.place[:, k]) for k in (0, 1)])

    def complete(self, change):
        """Complete Newton's change without contact, K^-1 r, by the contacts; False where the tangent is singular."""
        touches, largest = self._touches_now, self._newton._longest
        near = touches.gap < 2.7 * max(largest, self._radius)
        self._found = np.zeros(len(touches))
        if not near.any():
            self._last = np.zeros((len(touches),) * 2), 0
            return True
        touches = touches.of(near)
        known = self._known_forces(touches)
        rows, gradients = self._gradients(touches)
        pressed = np.flatnonzero(known > 0)
        columns, factors = self.strands.curvatures(self._x, touches.of(pressed))
        factors = (known[pressed][:, None] * factors).ravel()
        kept = columns.reshape(len(factors), -1).any(axis=1) if len(factors) else np.zeros(0, dtype=bool)
        factors, m = factors[kept], len(touches)
        q = len(factors)
        values = np.concatenate([columns.reshape(-1, gradients.shape[1])[kept], gradients])
        at = np.concatenate([np.repeat(rows[pressed], 4, axis=0)[kept], rows])
        values, at = np.where(at < 0, 0.0, values), np.maximum(at, 0)
        solved = np.empty((len(change.array_r), len(values)))
        load, answer = self._vectors
        for k in range(len(values)):
            load.array_w[:] = 0.0
            np.add.at(load.array_w, at[k], values[k])
            if not self._problem.solve(load, answer):
                return False
            solved[:, k] = answer.array_r
        S = np.einsum("kj,kjl->kl", values, solved[at])
        d = -np.einsum("kj,kj->k", values, change.array_r[at])
        S = (S + S.T) / 2
        D = np.concatenate([factors, np.zeros(m)])
        typical = np.abs(np.diag(S))[q:].mean()
        while True:
            E = D - self._spring / typical
            M = np.linalg.solve(np.eye(q + m) - E[:, None] * S, np.diag(E)) if self._spring or q else np.zeros_like(S)
            A = S[q:, q:] + S[q:] @ M @ S[:, q:]
            A = (A + A.T) / 2
            lowest = np.linalg.eigvalsh(A)[0]
            if lowest > -_NOTHING * typical:
                break
            if self._spring > _STIFFEST:
                return False
            self._spring = max(self._spring * _STIFFER, _SPRING)
        A += (_REGULAR * typical + 2 * max(-lowest, 0.0)) * np.eye(m)
        forces = complementary(A, touches.gap + d[q:] + S[q:] @ M @ d)
        spread = M @ (d + S[:, q:] @ forces)
        spread[q:] += forces
        change.array_w[:] -= solved @ spread
        self._found[near] = forces
        removed = 0
        if q:
            inner = np.diag(1 / factors) - S[:q, :q]
            removed = np.count_nonzero(np.linalg.eigvalsh(inner) < 0) - np.count_nonzero(factors < 0)
        whole = np.zeros((len(near),) * 2)
        M = np.linalg.solve(np.eye(q) - factors[:, None] * S[:q, :q], np.diag(factors)) if q else np.zeros((0, 0))
        whole[np.ix_(near, near)] = S[q:, q:] + S[q:, :q] @ M @ S[:q, q:]
        self._last = whole, removed
        return True

    # -- for records -------------------------------------------------------------------------------------------------

    def nodal_forces(self):
        """(elements, p + 1, 3) forces of the contacts at the nodes of the elements that touch, inertial."""
        return self._nodal_forces(np.ones((len(self._touches), 2), dtype=bool))

    def densities(self):
        """(elements, p + 1, 6) the same per length, for the contact forces of elements: without forces at points where
        elements end, which act between them; those of nodes along a line there are shared by both."""
        strands, touches = self.strands, self._touches
        end = (np.abs(touches.place - 0.5) > 0.5 - _AT_END) & (touches.node < 0)[:, None]
        found = self._nodal_forces(~end)
        h, weights = strands.sizes, self._model.rule.lobatto
        before, after = strands.joined
        both = h[before] + h[after]
        total = found[before, -1] + found[after, 0]
        for element, node in ((before, -1), (after, 0)):
            found[element, node] = total * (h[element] / both)[:, None]
        found /= (h[:, None] * weights)[..., None]
        return np.concatenate([found, np.zeros_like(found)], axis=2)

    def _nodal_forces(self, which):
        """The forces of those points of contacts (m, 2) alone."""
        strands, touches = self.strands, self._touches
        found = np.zeros((*strands.cells.shape, 3))
        for k, sign in ((0, -1.0), (1, 1.0)):
            element = touches.element[:, k]
            basis = strands.basis(element, touches.place[:, k])
            push = (sign * self._forces * which[:, k])[:, None] * touches.normal
            for neighbour, part in zip(strands.neighbours, np.split(basis, 3, axis=1), strict=True):
                np.add.at(found, neighbour[element], part[..., None] * push[:, None, :])
        return found
