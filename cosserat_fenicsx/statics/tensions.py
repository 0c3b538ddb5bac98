"""Tendons of given length in statics: their tensions, unknowns beside those of the nodes.

With the tangent K and the residual b at given tensions T, b's derivatives G by T, the derivatives A of the lengths by
the unknowns, and the gaps g = l - l_0 (1 + T/EA), l_0 the length that is left of a tendon without tension, Newton's
step (d, t), which is subtracted from (x, T), is that of

    [ K   G      ] [d]   [b]
    [ A  -l_0/EA ] [t] = [g]

by block elimination: K is factorised as without tendons, and S = A K^-1 G + l_0/EA is a small matrix, the compliance of
the rods against their tendons. A tendon does not push: T >= 0, g <= 0 and T g = 0 after the step. The equilibrium has
as many negative modes as K, less the negative eigenvalues of S (Haynsworth, Linear Algebra Appl. 1 (1968) 73).
"""

import numpy as np
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.algebra.building import Packed
from cosserat_fenicsx.compat import compiling
from cosserat_fenicsx.errors import SceneError

# Condition number of S above which it is singular.
_SINGULAR = 1e12
# Length over the largest one in the step below which a slack tendon is about to be taut; and, in an equilibrium, its
# share of the tendon's length, without a tension above the same number times EI/L^2.
_EDGE = 1e-9
# Change of a gap over the tendon's length, for a change of a parameter by its size, that is rounding.
_OPENS = 1e-7
# Exchanges of tendons between slack and taut in a step, per tendon.
_EXCHANGES = 20


class ThreadLengths:
    """The lengths of the tendons of given length of a problem, `Problem` or `dynamics.step_problem.StepProblem`;
    values: (tendons,) their tensions in the order of the scene, dimensionless."""

    def __init__(self, problem):
        self._problem, self._model = problem, problem.model
        model = problem.model
        self._terms = [term for term in model.actions.terms if term.kind.finds_tension]
        self._along = fem.Function(model.space)
        with compiling():
            forms = compat.forms(model.mesh, model.thread_forms(self._terms, self._along))
        self._length, self._change, force = forms
        self._force = Packed(force, (model.state, *(term.data[0] for term in self._terms)), model.constants)

    def load(self):
        """Take the tendons of the scene that the model was loaded with, in its reference configuration."""
        model = self._model
        found = [(where[0], term, where[2]) for term in self._terms for where in term._where]
        found = [next(x for x in found if x[0] is action) for action in model.scene.actions if action.shortens]
        self._where = [(term._arrays[0], rows) for _, term, rows in found]
        self._tendons = [action for action, *_ in found]
        self._softness = np.array([model.scales.force / (tendon.axial or np.inf) for tendon in self._tendons])
        self.values = np.zeros(len(found))
        self._columns, self._responses = ([self._problem.numbering.vector() for _ in found] for _ in range(2))
        self._force.refresh()
        self._at_rest = self._lengths(self._length)
        for k, tendon in enumerate(self._tendons):
            if tendon.base is not None:
                self._at_rest[k] = tendon.base / model.scales.length

    def left_at(self, t, load_factor):
        """(tendons,) lengths without tension at a time (s)."""
        unit = self._model.scales.length
        pairs = zip(self._tendons, self._at_rest * unit, strict=True)
        return np.array([tendon.left_of(length, t, load_factor) for tendon, length in pairs]) / unit

    def put(self, values):
        """Set the tensions."""
        self.values = np.array(values, dtype=float)
        self._fill(self.values)

    def _fill(self, values):
        for (array, rows), value in zip(self._where, values, strict=True):
            array[rows] = value

    def _one_by_one(self):
        """Set the tension of each tendon in turn to 1 and all others to 0; at the end their own again."""
        for unit in np.eye(len(self.values)):
            self._fill(unit)
            yield
        self._fill(self.values)

    def _lengths(self, form):
        """(tendons,) of the tendons' lengths, or of their changes along `_along`."""
        found = np.array([fem.assemble_scalar(form) for _ in self._one_by_one()])
        return self._model.comm.allreduce(found)

    def _changes(self, vector):
        """(tendons,) A times a change of the unknowns, a vector of the solver."""
        self._along.x.array[:] = 0.0
        self._problem.numbering.to_local(vector, self._along.x.array)
        return self._lengths(self._change)


class Tensions(ThreadLengths):
    """The tensions of the tendons of given length of a `Problem`; undetermined: whether the last solution failed since
    lengths do not determine them; slope: (tendons,) their change with the load factor, from the last solution for
    `Problem.load_derivative`; wanted, change: (tendons,) gaps for the next solution for forces other than these and the
    residual, and the change of the tensions from it."""

    def load(self):
        super().load()
        size, short = len(self.values), self._at_rest - self.left_at(0.0, 1.0)
        before, now = np.transpose([x.wound for x in self._tendons])
        self._done, self._short = before * short, now * short
        self._active = np.ones(size, dtype=bool)
        self.undetermined, self.slope, self.wanted = False, np.zeros(size), np.zeros(size)
        self._step = np.zeros(size)
        self.forget()
        self.put([x.begun / self._model.scales.force for x in self._tendons])

    @property
    def _left(self):
        """(tendons,) lengths without tension, at the load factor."""
        return self._at_rest - self._done - float(self._problem.load_factor_array) * self._short

    def forget(self):
        """The tangent has other factors."""
        self._compliance = None

    @staticmethod
    def _regular(S):
        """Whether lengths determine tensions: not where some tendons that do not stretch determine the others."""
        return not len(S) or np.linalg.cond(S) < _SINGULAR

    def _comply(self):
        """S, once for the factors of the tangent."""
        if self._compliance is None:
            for column, _ in zip(self._columns, self._one_by_one(), strict=False):
                self._problem._assemble(self._force, column)
            for column, response in zip(self._columns, self._responses, strict=True):
                self._problem.solve_without_tendons(column, response)
            found = [self._changes(response) for response in self._responses]
            self._compliance = np.array(found).T + np.diag(self._left * self._softness)
        return self._compliance

    def complete(self, b, x):
        """Complete x = K^-1 b to the solution of the bordered system: with the gaps, or their derivative by the load
        factor, where b is the problem's residual or its derivative, and with `wanted` for other forces. Slack tendons
        remain slack, except in a step for the residual. False where S is singular."""
        problem, S, moved = self._problem, self._comply(), self._changes(x)
        self.undetermined = True
        if b is problem.b:
            found = self._complementary(S, moved - self.gaps() - S @ self.values)
            if found is None:
                return False
            self._step = step = self.values - found
        else:
            of_load = problem.is_load_derivative(b)
            gaps = self.wanted
            if of_load:
                gaps = 0.0 if problem.begins else self._short * (1 + self._softness * self.values)
            on, step = self._active, np.zeros(len(moved))
            if not self._regular(S[np.ix_(on, on)]):
                return False
            step[on] = np.linalg.solve(S[np.ix_(on, on)], (moved - gaps)[on])
            self.change, self.opening = step, moved - gaps - S @ step
            if of_load:
                self.slope = -step
        for response, share in zip(self._responses, step, strict=True):
            x.axpy(-share, response)
        self.undetermined = False
        return True

    def _complementary(self, S, a):
        """T >= 0 with S T + a >= 0 and T (S T + a) = 0, by exchanges of the first tendon of the wrong sign (Murty,
        Linear Algebra Appl. 7 (1974) 65), from those that were taut last; None where S is singular, or where the
        exchanges do not end: some S that is not positive definite has no such T, or several."""
        for _ in range(_EXCHANGES * len(a)):
            on, T = self._active, np.zeros(len(a))
            if not self._regular(S[np.ix_(on, on)]):
                return None
            T[on] = -np.linalg.solve(S[np.ix_(on, on)], a[on])
            slack = S @ T + a
            wrong = np.where(on, T < 0, slack < 0)
            if not wrong.any():
                may = on | (slack <= _EDGE * np.abs(a).max())  # carry a part of what others carry
                return T if not T.any() or self._regular(S[np.ix_(may, may)]) else None
            self._active = on.copy()
            self._active[np.argmax(wrong)] ^= True
        self.undetermined = False
        return None

    def take(self, share=1.0, by_load=0.0):
        """Subtract a share of the last step from the tensions, and add a change of the load factor times `slope`."""
        self.put(self.values - share * self._step + by_load * self.slope)

    def gaps(self):
        """(tendons,) g."""
        return self._lengths(self._length) - self._left * (1 + self._softness * self.values)

    def too_short(self, load_factor, most):
        """(tendon, length, m) of one whose tension exceeds `most` on the way to a load factor; or None."""
        problem = self._problem
        problem.function(problem.x, problem.b)
        problem.factor()
        if problem.c.singular:
            return None
        wanted = self.gaps() + (load_factor - problem.load_factor) * self._short
        beyond = wanted - most * np.diag(self._comply())
        k = int(np.argmax(beyond))
        length = self._lengths(self._length)[k] * self._model.scales.length
        return (self._tendons[k], float(length)) if beyond[k] > 0 else None

    def keep(self):
        """(tendons,) which are about to be taut or slack, and remain slack where the problem is linearised."""
        edges = (self.values <= _EDGE) & (np.abs(self.gaps()) <= _EDGE * self._left)
        self._active = (self.values > 0) & ~edges
        return edges

    def refuse(self, owner, edges, expected):
        """Raise a SceneError for tendons that are about to be taut or slack."""
        tendon = self._tendons[int(np.argmax(edges))]
        raise SceneError(
            f"{owner}: the {type(tendon).__name__} of {tendon.rod.name} is neither taut nor slack at the load factor "
            f"{self._problem.load_factor:g}, and no linear theory has it: expected {expected}"
        )

    def opens(self, edges, size):
        """Whether some of these tendons get shorter or longer than their way, as `keep` has told them, by a change of
        the last solution for other forces times `size`."""
        return bool((np.abs(self.opening[edges]) * size > _OPENS * self._left[edges]).any())

    def border(self, K, held):
        """The K and the held rows of `small_motions.stiffness` with what taut tendons resist: a stiffness EA/l_0 of
        their length, or a constraint where they do not stretch; of the mixed formulation, whose tests are rotations."""
        model = self._model
        (variation,) = model.second_variations
        nodal, total = model.nodal, variation.numbering.vector()
        of_motion, on, rows = nodal[:, [0, 1, 2, 4, 5, 6]], self.values > 0, []
        for _ in self._one_by_one():
            of_state = np.zeros(len(model.state.x.array))
            self._force.add_to_vector(of_state)
            variation.numbering.add_up(of_state[of_motion].ravel(), total)
            rows.append(np.concatenate(model.comm.allgather(total.array_r)))
        rows, compliance = np.array(rows), self._left * self._softness
        from scipy import sparse  # slow to import, and equilibria do without

        stretch = sparse.csr_matrix(rows[on & (compliance > 0)] / np.sqrt(compliance[on & (compliance > 0)])[:, None])
        return K + stretch.T @ stretch, np.vstack([held, rows[on & (compliance == 0)]])

    def pivots(self):
        """(number of negative eigenvalues of S, logarithm of its determinant's size) at the problem's state."""
        problem, on = self._problem, self.values > 0
        problem.function(problem.x, problem.b)
        problem.factor()
        if problem.c.singular or not on.any():
            return 0, 0.0
        S = self._comply()[np.ix_(on, on)]
        sizes = np.linalg.eigvalsh((S + S.T) / 2)
        return int((sizes < 0).sum()), float(np.log(np.abs(sizes)).sum())
