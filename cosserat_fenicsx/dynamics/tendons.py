"""Tendons of given length in a time step, with a stiffness.

A tendon of the length l has the energy k max(l - l_0, 0)^2/2, with k = EA/l_0 and l_0 its length without tension, of
the time when loads are evaluated. The tension of a step is the change of this energy over that of l, so that slack and
taut are one law, and smooth; in schemes whose equations hold at the end of a step it is the tension there. It acts in
the form of a `Tendon` of given tension, whose work the books of a step then have.

A tension depends on all nodes of a rod, which the tangent does not know. Newton's step for given tensions is completed:
with the responses R of the motion to unit tensions and the derivatives A of the lengths, the tensions change by t with

    (1 + f' A R) t = f - f' A d - T

where d is the step for the given tensions T, subtracted from the unknowns, f the law and f' its derivative.
"""

import numpy as np

from cosserat_fenicsx.statics.tensions import ThreadLengths


class TensionsInSteps(ThreadLengths):
    """The tensions in the steps of a `StepProblem`; methods as of `NodalContact`."""

    def load(self):
        super().load()
        self._changed = self._problem.numbering.vector()

    def begin(self, h):
        problem = self._problem
        self._left = self.left_at(problem.loaded_at, problem.load_factor)
        self._before, self._answers = self._lengths(self._length), None

    def add_forces(self, b):
        """They are in the forms."""

    def _mean(self, after):
        """Changes of the energies over changes of the lengths, to those `after` the step, and their derivatives."""
        begun, ended = np.maximum(self._before - self._left, 0.0), np.maximum(after - self._left, 0.0)
        k, moved, rise = 1 / (self._softness * self._left), after - self._before, ended - begun
        taut = (begun > 0) & (ended > 0) | (moved == 0)
        share = np.where(taut, ended > 0, rise / np.where(taut, 1.0, moved))  # of the motion in which it is taut
        slope = np.where(ended > 0, share * (1 - share / 2), share**2 / 2)
        return k * (begun + ended) / 2 * share, k * slope

    def _law(self, lengths):
        if self._problem.acting_share < 1:
            return self._mean(lengths)
        k, more = 1 / (self._softness * self._left), lengths - self._left
        return k * np.maximum(more, 0.0), k * (more > 0)

    def meet(self, x, change):
        """Change Newton's step so that the laws hold after it."""
        force, slope = self._law(self._lengths(self._length))
        if not (force.any() or slope.any() or self.values.any()):
            return
        if self._answers is None:
            self._answers = self._found_answers()
        answers, compliance = self._answers
        self._changed.array_w[:] = change
        missing = force - slope * self._changes(self._changed) - self.values
        more = np.linalg.solve(np.eye(len(missing)) + slope[:, None] * compliance, missing)
        change += more @ answers
        self.put(self.values + more)

    def _found_answers(self):
        """Changes of the unknowns by unit tensions (tendons, unknowns), and (tendons, tendons) of the lengths, a column
        for each; as of the first tangent of a step."""
        problem, own, found, lengths = self._problem, self.values, [], []
        without, column = self._columns[0], problem.numbering.vector()
        problem.function(problem.x, without)
        for unit, response in zip(np.eye(len(own)), self._responses, strict=True):
            self._fill(own + unit)
            problem.function(problem.x, column)
            column.axpy(-1.0, without)
            problem.solve(column, response)
            found.append(response.array_r.copy())
        self._fill(own)
        problem.function(problem.x, without)
        lengths = [self._changes(response) for response in self._responses]
        return np.array(found), np.transpose(lengths)

    def give_up(self):
        """The step has failed; tensions are initial guesses alone."""

    accept = give_up

    def books(self):
        """They have the work of the tensions already."""
        return 0.0, 0.0

    def here(self, t):
        """(tendons,) tensions at the state, at a time (s)."""
        left = self.left_at(t, self._problem.load_factor)
        return np.maximum(self._lengths(self._length) - left, 0.0) / (self._softness * left)

    def halfway(self, t):
        """Take the tensions whose work is that of the step, at the time t (s) of its middle; those before are
        returned."""
        own, self._left = self.values, self.left_at(t, self._problem.load_factor)
        self.put(self._mean(self._lengths(self._length))[0])
        return own

    def memory(self):
        return {"tensions": self.values.copy()}

    def recall(self, memory):
        self.put(memory["tensions"])
