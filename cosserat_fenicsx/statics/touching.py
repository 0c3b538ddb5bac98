"""Equilibria of rods that touch each other: the laws of all contacts, solved exactly on the compliance of the rods.

In every iteration the step dx and the contact forces l follow from

    (K - sum l d2g) dx + r - G^T l = 0,    g + G dx >= 0,    l >= 0,    l (g + G dx) = 0,

with the rods' tangent K and residual r without contact, the gaps g, their derivatives G, and their second derivatives
d2g, in which the nearest points slide. K is not assembled: the columns of G^T and of the few eigenvectors of d2g are
solved with its factors, and what is left is a small complementarity problem, for the changes of the forces. Of many
contacts without friction K is assembled, with the rows of those that press, and factorised as a sparse matrix.

With friction, contacts that touched in the last accepted state have two more forces across the normal, on the surfaces
and so with moments about the centrelines. Coulomb's law is exact: such a contact does not slip since that state, or
friction is at its bound and against the slip. The response of slips to forces is found like that of the gaps, and the
laws of all contacts are solved together (`rubbing`); how friction turns with the contact is in the next residual.

No rod passes through another: a step moves points by so little that two strands, which are never nearer than half the
sum of their radii, cannot cross in it.
"""

import numpy as np

from cosserat_fenicsx.algebra.eigen import RepeatedFactors, constrained_factors
from cosserat_fenicsx.algebra.newton import LimitedNewton, Solved
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.numerics import small_rotations
from cosserat_fenicsx.strands import AT_BOUND, Strands, across, in_words

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
# Residual force of a node at equilibrium, over the largest force; the one that rounding leaves where no load acts.
_BALANCED, _UNLOADED = 1e-7, 1e-12
# Distance from an element's end, in elements, that is at it.
_AT_END = 1e-6
# A contact of the iteration before is the same up to this sliding, over the radius; added to the diagonal of the
# compliance, over its mean.
_SAME, _REGULAR = 4.0, 1e-12
# Gap at which rods touch, over the largest radius, and the most by which contacts may give at a state for a compliance
# that was made definite; unknowns and rows of a node: of forces and moments.
_TOUCHES, _GIVES, _FORCES = 1e-5, 1e-6, [0, 1, 2, 4, 5, 6]
# Laws of friction: iterations; error that ends them; least share of a step; error that is none.
_MOST_LAWS, _LAWS, _LEAST, _LAWS_MET = 60, 1e-13, 1e-3, 1e-8
# Springs that keep the tangent stable, over the stiffness of rods at a contact: against gaps of contacts that press,
# which do not move where they go on pressing, and then against motions across them too, which makes steps short;
# eigenvalues of the compliance that need none, over its mean: out of equilibrium it is not symmetric.
_SPRINGS = ((0.0, 0.0), (1.0, 0.0), (30.0, 0.0), (1e3, 0.0), *((1e3, 10.0**k) for k in range(-3, 7)))
_NOTHING = 1e-6
# Forces and columns above which the sparse tangent is factorised with the contacts' rows, and above which nothing else
# is tried where that fails; sets of contacts that press which are tried; those after which they change one by one;
# error of a force, and of a gap, over the largest force and radius; contacts that give the typical compliance.
_MANY, _TOO_MANY, _MOST_SETS, _ALL, _OF_FORCE, _OF_GAP, _SAMPLES = 1000, 2500, 60, 4, 1e-9, 1e-10, 8


def complementary(A, b):
    """l >= 0 with A l + b >= 0 and l (A l + b) = 0, for a positive definite A: by the method of active sets."""
    from scipy.optimize import nnls  # late: scipy is slow to import

    size = np.sqrt(np.diag(A))
    L = np.linalg.cholesky(A / size / size[:, None])
    found, _ = nnls(L.T, -np.linalg.solve(L, b / size), maxiter=50 * len(b) + 100)
    return found / size


def rubbing(A, b, friction, start):
    """Forces (m, 3) of contacts, normal and across it, by which motions A f + b obey Signorini's and Coulomb's laws.

    By Newton's method for the nonsmooth equations of Alart & Curnier (Comput. Methods Appl. Mech. Engrg. 92 (1991)
    353), with shares of steps until their residual falls, from given forces and from those without friction. A: (3 m, 3
    m), positive definite, not necessarily symmetric; b: (3 m,); friction: (m,) coefficients; start: (m, 3) forces.
    Returns (m, 3) forces, and the largest error of a force by its law over the largest force."""
    m, normal = len(friction), np.arange(len(friction)) * 3
    across = normal[:, None] + (1, 2)
    stiff = 1 / np.diag(A)
    r = np.repeat(stiff[normal], 3)
    r[across] = (2 / (1 / stiff[across]).sum(axis=1))[:, None]

    def off(f):
        """The equations, their derivatives by the forces and by the motion, as blocks of a contact (m, 3, 3)."""
        z = (f - r * (A @ f + b)).reshape(m, 3)
        pressed, bound, size = z[:, 0] > 0, friction * np.maximum(z[:, 0], 0), np.linalg.norm(z[:, 1:], axis=1)
        slips = size > bound
        safe = np.where(slips, size, 1.0)
        way, share = z[:, 1:] / safe[:, None], np.where(slips, bound / safe, 1.0)
        by = np.zeros((m, 3, 3))  # of the projection of z
        by[:, 0, 0] = pressed
        by[:, 1:, 1:] = share[:, None, None] * (np.eye(2) - np.where(slips, 1.0, 0.0)[:, None, None]
                                                * way[:, :, None] * way[:, None])  # fmt: skip
        by[:, 1:, 0] = np.where(slips & pressed, friction, 0.0)[:, None] * way
        projected = np.c_[np.maximum(z[:, 0], 0), share[:, None] * z[:, 1:]].ravel()
        return f - projected, by

    best, least = None, np.inf
    pressing = np.zeros((m, 3))
    pressing[:, 0] = complementary((A[np.ix_(normal, normal)] + A[np.ix_(normal, normal)].T) / 2, b[normal])
    for f in (start.ravel().copy(), pressing.ravel()):
        error, by = off(f)
        for _ in range(_MOST_LAWS):
            size, scale = np.linalg.norm(error), np.abs(f).max()
            if size < least:
                best, least = f, size
            if size <= _LAWS * scale:
                return f.reshape(m, 3), size / scale if scale else 0.0
            J = np.eye(3 * m) - (by @ (np.eye(3 * m) - r[:, None] * A).reshape(m, 3, -1)).reshape(3 * m, -1)
            step, share = np.linalg.lstsq(J, error, rcond=None)[0], 1.0
            error, by = off(f - step)
            while share > _LEAST and not np.linalg.norm(error) < (1 - 1e-3 * share) * size:
                share /= 2
                error, by = off(f - share * step)
            f = f - share * step
    return best.reshape(m, 3), least / max(np.abs(best).max(), np.finfo(float).tiny)


def _bordered(K, C, factors, G, small):
    """The sparse matrix of K - sum factor c c^T, c the rows of C, with rows of G as constraints that give by `small`
    times their force; symmetric where K is."""
    from scipy import sparse  # late: scipy is slow to import

    C = sparse.diags(np.sqrt(np.abs(factors))) @ C
    signs, gives = sparse.diags(np.where(factors < 0, -1.0, 1.0)), sparse.diags(np.full(G.shape[0], -small))
    return sparse.csr_array(sparse.bmat([[K, -C.T, -G.T], [-C, signs, None], [-G, None, gives]], format="csr"))


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
    """The contacts of a scene's rods at the state of a `Problem`. problem: a `Problem`, loaded with a scene that has a
    `RodContact`. force: (unknowns,) what the contacts add to the residual."""

    def __init__(self, problem):
        model = problem.model
        scene, layout, length = model.scene, model.layout, model.scales.length
        self._problem, self._model, self._length = problem, model, length
        self._nodal = model.nodal[np.argsort(model.slots)]
        self._rows = model.numbering.rows[self._nodal]
        self._friction = scene.rod_contact.friction
        self._parts = 3 if self._friction else 1
        self.strands = Strands.of(scene, layout, model.rule, length)
        counts = np.multiply(layout.counts, model.signature.degree) + 1
        self._origins = np.repeat(scene.origins / length, counts, axis=0)
        radii = self.strands.radii
        self._radius, self._largest = radii[radii > 0].min(), radii.max()
        self._newton = _Steps(problem, self)
        self._vectors = problem.numbering.vector(), problem.numbering.vector()
        self.force = np.zeros(problem.numbering.size)
        found = self.strands.near(self._x, _TOUCHES * self._largest)[0]
        self._take(found, np.zeros((len(found), self._parts)), 0)

    def _take(self, touches, forces, removed):
        self._touches, self._forces, self.removed = touches, forces, removed
        self.force[:] = 0.0
        rows, total = self._at_nodes(touches, forces)
        np.subtract.at(self.force, np.maximum(rows, 0), np.where(rows < 0, 0.0, total))

    def _pulls(self, touches):
        """Nodes (m, n) that contacts act on; forces and moments there of unit forces, (m, parts, n, 6)."""
        strands, sides = self.strands, self._sides(touches)
        pulls = strands.surface_pulls(touches.element, touches.place, touches.normal, touches.distance, sides)
        return strands.nodes_of(touches), pulls

    def _sides(self, touches):
        return across(touches.normal) if self._parts > 1 else None

    def _at_nodes(self, touches, forces):
        """Rows of the unknowns (m, n, 6), -1 where clamped, and forces and moments of contacts there."""
        nodes, pulls = self._pulls(touches)
        return self._rows[nodes][..., _FORCES], np.einsum("mp,mpni->mni", forces, pulls)

    @property
    def memory(self):
        """What `recall` takes: the contacts and their forces (m, parts): normal and, with friction, `across` it."""
        return self._touches, self._forces, self.removed

    def recall(self, memory):
        """Return to contacts and forces of another state."""
        self._take(*memory)

    @property
    def _x(self):
        return self._model.state.x.array[self._nodal[:, :3]] + self._origins

    @property
    def _q(self):
        return self._model.state.x.array[self._nodal[:, 3:7]]

    # -- equilibrium -------------------------------------------------------------------------------------------------

    def solve(self, numbers, load_factor, accepted):
        """Newton's method to an equilibrium at a load factor, by steps in which no rod passes through another. numbers:
        `Problem.numbers` to start from, where no strand is passed on the way to them from the last accepted state,
        `accepted`, from which it starts otherwise. Returns Solved."""
        problem, newton = self._problem, self._newton
        problem.set_load_factor(load_factor)
        newton.iterations, sizes, why = 0, [], ""
        problem.put(accepted)
        self._accepted = self._x, self._q, self._touches.of(self._touches.gap < _TOUCHES * self._largest)
        found, closest = self._look()
        moved, _ = problem.model.sizes(numbers[0] - accepted[0])
        if moved <= self._allowed(found):
            problem.put(numbers)
            found, closest = self._look()
            if closest < _CLOSEST:
                problem.put(accepted)
                found, closest = self._look()
        self._springs = 0  # the index of the last iteration's `_SPRINGS`
        while newton.iterations < _MOST and len(sizes) < _MOST_FULL:
            obey()
            allowed = self._allowed(found)
            newton.limit(allowed)
            self._near = found.gap < 2.7 * max(allowed, self._radius)
            self._take(found, self._known_forces(found) * self._near[:, None], 0)
            before, q = problem.numbers(), self._q
            share = _SHARES[newton.iterations % 3] if len(sizes) > _PATIENCE else 1.0
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
            # without the norms of quaternions, which no law knows at the nodes: rounding changes them
            turned = np.einsum("nij,nj->ni", small_rotations((q + self._q) / 2), self._q - q) / min(step.share, share)
            size = max(step.moved, np.linalg.norm(turned, axis=1).max())
            whole = step.share == 1.0
            last = sizes[-1] if sizes else 0.0  # of a full step before
            shrinks = size < 0.1 * last and size * size < _SETTLED * last
            if whole and (size < _SETTLED or shrinks or 0.3 * last < size < _ROUNDING > last > 0):
                self._take(touches, forces, 0)
                solved = self._confirmed(newton.iterations)
                if solved.converged or len(sizes) > _PATIENCE:
                    return solved
            sizes = [*sizes, size] if whole or len(sizes) > _PATIENCE else []
            self._springs = max(self._springs - 1, 0)
        why = why or f"Newton's iterations ran out, {self._in_words(found)}"
        return Solved(False, newton.iterations, why)

    def _confirmed(self, iterations):
        """`Solved`, where the contacts of the last step are those of the state, with its negative modes."""
        problem, (normal, *friction) = self._problem, self._forces.T
        held = np.linalg.norm(friction, axis=0) < (1 - AT_BOUND) * self._friction * normal if friction else ()
        active = np.stack([normal > 0, *[held for _ in friction]], axis=1)[self._near].ravel()
        allowed = _BALANCED * (problem.load_norm + normal.max(initial=0.0)) + max(self._model.round_off, _UNLOADED)
        if not self._newton.imbalance() <= allowed:
            return Solved(False, iterations, f"forces are left over at a node, {self._in_words(self._touches)}")
        if self._broken > _LAWS_MET:
            return Solved(False, iterations, f"no forces obey the law of friction, {self._in_words(self._touches)}")
        if self._gives > _GIVES * self._largest:
            return Solved(False, iterations, f"forces at contacts are not determined, {self._in_words(self._touches)}")
        self.removed = None if normal.any() else 0
        if self._last is None:
            return Solved(True, iterations, "converged")
        A, removed = self._last
        A = A[np.ix_(active, active)]
        self.removed = removed - np.count_nonzero(np.linalg.eigvalsh((A + A.T) / 2) < 0)
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

    def _same(self, touches, old):
        """Which (m,) of other `Touches` each contact is the same as; -1 for a new one."""
        if not len(old) or not len(touches):
            return np.full(len(touches), -1)
        from scipy.spatial import cKDTree  # late: scipy is slow to import

        both = [np.c_[self.strands.rods[x.element], x.node] for x in (touches, old)]
        kinds = np.unique(np.concatenate(both), axis=0, return_inverse=True)[1].ravel()
        s, close = np.concatenate([self._s(x) for x in (touches, old)]), _SAME * self._largest
        places = np.c_[s, kinds * 3 * close]  # those of other rods and nodes are farther
        nearest = cKDTree(places[len(touches) :]).query(places[: len(touches)], p=np.inf, distance_upper_bound=close)[1]
        return np.where(nearest < len(old), nearest, -1)

    def _known_forces(self, touches):
        """The forces of the iteration before at the same contacts; 0 at new ones."""
        old, same, forces = self._touches, self._same(touches, self._touches), np.zeros((len(touches), self._parts))
        here, old_one = same >= 0, same[same >= 0]
        forces[here, 0] = self._forces[old_one, 0]
        if self._parts > 1:
            sides, old_sides = self._sides(touches)[here], self._sides(old.of(old_one))
            forces[here, 1:] = np.einsum("mp,mpi,mqi->mq", self._forces[old_one, 1:], old_sides, sides)
        return forces

    def _s(self, touches):
        return np.column_stack([self.strands.s(touches.element[:, k], touches.place[:, k]) for k in (0, 1)])

    def _slips(self, touches, nodes, pulls):
        """Rows (m, 2, 7 n) of the unknowns, derivatives of slips by them, and (m, 2) slips since the accepted state."""
        (x, q, _), parts = self._accepted, pulls[:, 1:]
        turning = small_rotations((q + self._q) / 2)
        by = np.concatenate([parts[..., :3], np.einsum("kpni,knij->kpnj", parts[..., 3:], turning[nodes])], axis=3)
        rows = np.broadcast_to(self._rows[nodes][:, None], by.shape)
        # None where rods turn with their contact like one rigid body: Cayley's rotations about the mean direction.
        moves, sides = self.strands.moves(touches.element, touches.place), self._sides(touches)
        arms = -np.sum(parts[:, 0, :, 3:] * sides[:, None, 1], axis=2) / touches.distance[:, None]
        turned = np.einsum("nij,nj->ni", turning, self._q - q) / np.sum(q * self._q, axis=1)[:, None]
        apart, moved, turned = (
            np.einsum("kn,knj->kj", share, z[nodes])
            for share, z in ((moves, (self._x + x) / 2), (moves, self._x - x), (arms, turned))
        )
        slips = np.einsum("kpj,kj->kp", sides, moved - np.cross(turned, apart))
        return *(z.reshape(*by.shape[:2], -1) for z in (rows, by)), slips

    def complete(self, change):
        """Complete Newton's change without contact, K^-1 r, by the contacts; False where the tangent is singular."""
        touches, near, parts = self._touches, self._near, self._parts
        self._found, self._broken, self._gives = np.zeros((len(touches), parts)), 0.0, 0.0
        if not near.any():
            self._last = np.zeros((0, 0)), 0
            return True
        touches, known = touches.of(near), self._forces[near]
        nodes, pulls = self._pulls(touches)
        pressed, m = np.flatnonzero(known[:, 0] > 0), len(touches)
        columns, factors = self.strands.curvatures(self._x, touches.of(pressed))
        factors = (known[pressed, :1] * factors).ravel()
        columns = columns.reshape(len(factors), -1) if len(factors) else np.zeros((0, pulls.shape[2] * 3))
        kept = columns.any(axis=1)
        factors, columns, q = factors[kept], columns[kept], np.count_nonzero(kept)
        rows = self._rows[nodes]
        places, forces = rows[..., :3].reshape(m, -1), rows[..., _FORCES].reshape(m, -1)
        bent = np.repeat(places[pressed], 4, axis=0)[kept]
        loads = [*zip(bent, columns, strict=True),
                 *zip(np.repeat(forces, parts, axis=0), pulls.reshape(m * parts, -1), strict=True)]  # fmt: skip
        if parts == 1 and len(loads) > _MANY:
            G = self._by_unknowns(places, pulls[:, 0, :, :3].reshape(m, -1))
            done = self._complete_many(change, self._by_unknowns(bent, columns), factors, G, touches.gap, known[:, 0])
            if done or len(loads) > _TOO_MANY:
                return done
        solved = np.empty((len(change.array_r), q + m * parts))
        for k, load in enumerate(loads):
            response = self._response(*load)
            if response is None:
                return False
            solved[:, k] = response
        motions = np.c_[solved, -change.array_r]

        def moved(at, by):
            return np.einsum("...n,...nk->...k", np.where(at < 0, 0.0, by), motions[np.maximum(at, 0)])

        of_contacts = np.empty((m, parts, motions.shape[1]))
        of_contacts[:, 0] = moved(places, pulls[:, 0, :, :3].reshape(m, -1))
        start = touches.gap[:, None]
        if parts > 1:
            *slipping, slips = self._slips(touches, nodes, pulls)
            of_contacts[:, 1:], start = moved(*slipping), np.c_[start, slips]
        S = np.concatenate([moved(bent, columns), of_contacts.reshape(m * parts, -1)])
        S, d = S[:, :-1], S[:, -1]
        if parts == 1:
            S = (S + S.T) / 2
        normal = q + parts * np.arange(m)
        D, springs = np.r_[factors, np.zeros(m * parts)], np.zeros((2, q + m * parts))
        springs[0, normal[pressed]] = springs[1, :q] = 1.0
        typical = np.abs(np.diag(S))[normal].mean()
        while True:
            E = D - np.array(_SPRINGS[self._springs]) / typical @ springs
            M = np.linalg.solve(np.eye(len(E)) - E[:, None] * S, np.diag(E)) if q else np.zeros_like(S)
            A = S[q:, q:] + S[q:] @ M @ S[:, q:]
            lowest = np.linalg.eigvalsh((A + A.T)[::parts, ::parts] / 2)[0]
            if lowest > -_NOTHING * typical:
                break
            if self._springs == len(_SPRINGS) - 1:
                return False
            self._springs += 1
        A = (A + A.T) / 2 if parts == 1 else A
        if parts > 1:
            lowest = np.linalg.eigvalsh((A + A.T) / 2)[0]
        added = 2 * max(-lowest, 0.0)
        A += (_REGULAR * typical + added) * np.eye(m * parts)
        free = start.ravel() + d[q:] + S[q:] @ M @ d - A @ known.ravel()
        if parts == 1:
            forces = complementary(A, free)[:, None]
        else:
            rubs = np.where(self._same(touches, self._accepted[2]) >= 0, self._friction, 0.0)
            forces, self._broken = rubbing(A, free, rubs, known)
        more = (forces - known).ravel()
        self._gives = added * np.abs(more).max()
        spread = M @ (d + S[:, q:] @ more)
        spread[q:] += more
        change.array_w[:] -= solved @ spread
        self._found[near] = forces
        removed = 0
        if q:
            inner = np.diag(1 / factors) - S[:q, :q]
            removed = np.count_nonzero(np.linalg.eigvalsh(inner) < 0) - np.count_nonzero(factors < 0)
        M = np.linalg.solve(np.eye(q) - factors[:, None] * S[:q, :q], np.diag(factors)) if q else np.zeros((0, 0))
        self._last = S[q:, q:] + S[q:, :q] @ M @ S[:q, q:], removed
        return True

    def _response(self, rows, values):
        """The change of the unknowns by a load without contact, until the next call; None where it is singular."""
        load, answer = self._vectors
        load.array_w[:] = 0.0
        np.add.at(load.array_w, np.maximum(rows, 0), np.where(rows < 0, 0.0, values))
        return answer.array_r if self._problem.solve(load, answer) else None

    def _by_unknowns(self, rows, values):
        """(m, unknowns) a sparse matrix of values (m, n) at the rows of unknowns, -1 where clamped."""
        from scipy import sparse  # late: scipy is slow to import

        held = rows >= 0
        place = np.repeat(np.arange(len(rows)), held.sum(axis=1)), rows[held]
        return sparse.csr_array((values[held], place), shape=(len(rows), self._problem.numbering.size))

    def _complete_many(self, change, C, factors, G, gap, known):
        """`complete` without friction, without the responses to all forces: by factors of the sparse tangent with the
        rows of the contacts that press, for the set of these in which none pulls and none of the others is entered
        (block pivoting: Judice & Pires, Comput. Oper. Res. 21 (1994) 587). False where none is found.

        C: (q, unknowns) columns of `Strands.curvatures`, with their factors (q,); G: (m, unknowns) derivatives of the
        gaps (m,); known: (m,) forces of the iteration before."""
        b, K, size, q = self._problem.b.array_r, self._tangent(), G.shape[1], len(factors)
        free, samples = gap - G @ change.array_r, np.linspace(0, len(gap) - 1, _SAMPLES).astype(int)
        rows = np.arange(size)
        small = _REGULAR * np.mean([abs(G[[k]] @ self._response(rows, G[[k]].toarray().ravel())) for k in samples])
        active, best, tries = known > 0 if known.any() else free < 0, np.inf, _ALL
        for _ in range(_MOST_SETS):
            whole = _bordered(K, C, factors, G[active], small)
            solver = RepeatedFactors(whole.indptr, whole.indices)
            regular = solver.factor(whole.data)
            load = np.concatenate([-b - G.T @ np.where(active, 0.0, known), np.zeros(q), gap[active]])
            found = solver.solve(load).copy() if regular else load * np.nan
            solver.destroy()
            if not np.isfinite(found).all():
                return False
            forces = np.zeros(len(gap))
            forces[active] = known[active] + found[size + q :]
            wrong = np.where(active, forces < -_OF_FORCE * np.abs(forces).max(initial=0.0),
                             gap + G @ found[:size] < -_OF_GAP * self._largest)  # fmt: skip
            count = np.count_nonzero(wrong)
            if not count:
                change.array_w[:] = -found[:size]
                self._found[self._near, 0] = np.maximum(forces, 0)
                self._last = None
                return True
            best, tries = min(best, count), _ALL if count < best else tries - 1
            if tries < 0:  # one after another they end in finite time
                wrong[: np.flatnonzero(wrong)[-1]] = False
            active ^= wrong
        return False

    def _tangent(self):
        """The tangent without contact as a sparse matrix."""
        from scipy import sparse  # late: scipy is slow to import

        problem, model = self._problem, self._model
        links, numbering = model.signature.connections, problem.numbering
        cells = numbering.rows[model.cell_dofs]
        n = cells.shape[1]
        parts = [(np.repeat(cells, n, axis=1), np.tile(cells, n), problem.tangent_form.matrices())]
        if problem.ties:
            of_nodes, ends, back = problem.ties.tangent_blocks(problem.tie_load_factor)
            equations = np.array(links.equations, dtype=np.intp)
            blocks, rows, numbers = links.pattern.places(problem.ties.rows, equations)
            numbers = numbering.first_multiplier + numbers
            parts += [(*blocks, of_nodes), (rows, numbers, ends), (numbers, rows, back)]
        rows, columns, values = (np.concatenate([x.ravel() for x in part]) for part in zip(*parts, strict=True))
        held = (rows >= 0) & (columns >= 0)
        return sparse.csr_array((values[held], (rows[held], columns[held])), shape=(numbering.size,) * 2)

    def negative_modes(self, variation):
        """The number of negative modes in which the contacts that press remain, by the `stability.Part` of the rods;
        -1 where one is neutral. Where `removed` is None, of many contacts without friction."""
        from scipy import sparse  # late: scipy is slow to import

        variation.assemble()
        starts, columns, values = variation.K.getValuesCSR()
        K = sparse.csr_array((values, columns, starts))
        pressed = self._forces[:, 0] > 0
        touches = self._touches.of(pressed)
        columns, factors = self.strands.curvatures(self._x, touches)
        factors = (self._forces[pressed] * factors).ravel()
        rows = self._model.rows_of_nodes[self.strands.nodes_of(touches)][..., :3].reshape(len(touches), -1)
        G, C = (self._by_unknowns(*of) for of in ((rows, self.strands.gradients(touches).reshape(rows.shape)),
                (np.repeat(rows, 4, axis=0), columns.reshape(len(factors), -1))))  # fmt: skip
        scale = sparse.diags(1 / np.sqrt(np.abs(K.diagonal())))
        C, G = (sparse.csr_array(part[:, : K.shape[0]] @ scale) for part in (C, G))
        pc = constrained_factors(_bordered(scale @ K @ scale, C, factors, G, 0.0))
        negative, zero, _ = pc.getFactorMatrix().getInertia()
        pc.destroy()
        return -1 if zero else negative - np.count_nonzero(factors < 0) - len(touches)

    # -- for records -------------------------------------------------------------------------------------------------

    def nodal_forces(self):
        """(elements, p + 1, 3) forces of the contacts at the nodes of the elements that touch, inertial."""
        return self._nodal_forces(np.ones((len(self._touches), 2), dtype=bool))[..., :3]

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
        return found / (h[:, None] * weights)[..., None]

    def _nodal_forces(self, which):
        """(elements, p + 1, 6) forces and moments of those points of contacts (m, 2) alone."""
        strands, touches = self.strands, self._touches
        found = np.zeros((*strands.cells.shape, 6))
        _, total = self._at_nodes(touches, self._forces)
        total = total.reshape(len(touches), 2, 3, strands.cells.shape[1], 6) * which[:, :, None, None, None]
        for k in (0, 1):
            for j, neighbour in enumerate(strands.neighbours):
                np.add.at(found, neighbour[touches.element[:, k]], total[:, k, j])
        return found
