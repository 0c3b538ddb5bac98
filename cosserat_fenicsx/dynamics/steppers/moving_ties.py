"""Constraints of supports and joints in a time step: they hold at its end, their reactions act at mid-step."""

import numpy as np

from cosserat_fenicsx.algebra.tie_rows import TieRows, by_nodes, reactions_by_multipliers, reactions_by_nodes


class MovingTies(TieRows):
    """See `TieRows`. Reactions along the directions at mid-step keep the order 2, and do no work in a rigid rotation.

    Attributes:
        share: where in the step reactions act: 0 at its start, 1 at its end.
    """

    share = 0.5

    def begin(self, ties):
        """Start a step at the current state; `ties` are the constraints at its end."""
        self._ties_at_end = ties
        if self._here:
            self._start = self.seen[0].copy()
            self._added_values = (None, None)

    def _middle(self):
        return self.share * self.seen[0] + (1 - self.share) * self._start

    def _evaluate(self, eta):
        if self._added_values[0] != eta:
            nodal, multipliers = self.seen[0], self.seen[1][list(self._added)]
            ties, motion_of = self._ties_at_end, self.model.tied_motion
            c, self._at_end, _ = ties.evaluate(motion_of(nodal), eta, multipliers, self._added)
            _, gradient, change = ties.evaluate(motion_of(self._middle()), eta, multipliers, self._added)
            self._added_values = eta, (c, gradient, change)
        return self._added_values[1]

    def _derivatives(self, eta):
        _, gradient, change = self._evaluate(eta)
        trial, test = self.model.tie_maps(self._middle())
        trial_at_end, _ = self.model.tie_maps(self.seen[0])
        equations = by_nodes(self._at_end, trial_at_end)
        return reactions_by_nodes(test, change, self.share * trial), reactions_by_multipliers(test, gradient), equations

    def work(self, eta):
        """Work of the reactions on the structure in the step, dimensionless; on the last rank, else 0."""
        if not self._here:
            return 0.0
        _, gradient, _ = self._evaluate(eta)
        trial, _ = self.model.tie_maps((self.seen[0] + self._start) / 2)
        passed = np.einsum("kbe,ke->kb", trial, self.seen[0] - self._start)
        return -float(np.einsum("ikb,kb,i->", gradient, passed, self._reactions()[list(self._added)]))

    def _reactions(self):
        """The multipliers that `work` takes."""
        return self.seen[1]
