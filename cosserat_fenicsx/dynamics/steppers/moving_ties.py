"""Constraints of supports and joints in a time step: they hold at its end, their reactions act at mid-step."""

from cosserat_fenicsx.algebra.tie_rows import TieRows, by_nodes, reactions_by_multipliers, reactions_by_nodes


class MovingTies(TieRows):
    """See `TieRows`. Reactions along the directions at mid-step keep the order 2, and do no work in a rigid rotation.

    Attributes:
        share: where in the step reactions act: 0 at its start, 1 at its end.
    """

    share = 0.5

    def begin(self, ties):
        """Start a step at the current state; `ties` are the constraints at its end."""
        self._ties, self._start = ties, self.seen[0]
        self._forget()

    def _middle(self):
        """The tied nodes' unknowns where reactions act."""
        return self.share * self.seen[0] + (1 - self.share) * self._start

    def _evaluate(self, eta):
        """Values at the end of the step, and gradients where reactions act."""
        if self._values[0] != eta:
            ties, motion_of = self._ties, self.model.tied_motion
            c, self._at_end = ties.evaluate(motion_of(self.seen[0]), eta)
            _, gradients = ties.evaluate(motion_of(self._middle()), eta)
            self._values = eta, (c, gradients)
        return self._values[1]

    def residual_blocks(self, eta):
        """See `TieRows`; `StepNewton` stops before numbers overflow."""
        return self._blocks(eta)

    def tangent_blocks(self, eta):
        """See `TieRows`."""
        (nodal, multipliers), (_, gradients), middle, ties = self.seen, self._evaluate(eta), self._middle(), self._ties
        change = ties.change(self.model.tied_motion(middle), eta, multipliers)
        trial, test = self.model.tie_maps(middle)
        trial_at_end, _ = self.model.tie_maps(nodal)
        equations = by_nodes(ties.on_nodes(self._at_end)[self._added], trial_at_end)
        reactions = reactions_by_multipliers(test, ties.on_nodes(gradients)[self._added])
        return reactions_by_nodes(test, change, self.share * trial), reactions, equations

    def work(self, eta):
        """Work of the reactions on the structure in the step, dimensionless; on the last rank, else 0."""
        if not self._here:
            return 0.0
        nodal, (_, gradients) = self.seen[0], self._evaluate(eta)
        trial, _ = self.model.tie_maps((nodal + self._start) / 2)
        passed = trial @ (nodal - self._start)[:, :, None]
        return -float(self._ties.reactions(gradients, self._reactions()).ravel() @ passed.ravel())

    def _reactions(self):
        """The multipliers that `work` takes."""
        return self.seen[1]
