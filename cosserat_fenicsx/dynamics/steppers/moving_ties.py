"""Constraints of supports and joints in a time step: they hold at its end, their reactions act at mid-step."""

from cosserat_fenicsx.algebra.tie_rows import TieRows


class MovingTies(TieRows):
    """See `TieRows`. Reactions along the directions at mid-step keep order 2, and do no work in a rigid rotation."""

    share, ties = 0.5, None

    def begin(self, ties):
        """Start a step at the current state; `ties` are the constraints at its end."""
        self.ties, self._start = ties, self.seen[0]
        self._forget()

    def _forget(self):
        super()._forget()
        self._amid = (None, None)

    def _acting(self):
        end = self.seen[0]
        return end if self.share == 1 else self.share * end + (1 - self.share) * self._start

    def _gradients(self, eta):
        if self.share == 1:
            return super()._gradients(eta)
        if self._amid[0] != eta:
            _, gradients = self.ties.evaluate(self.model.tied_motion(self._acting()), eta)
            self._amid = eta, gradients
        return self._amid[1]

    def residual_blocks(self, eta):
        """See `TieRows`; `StepNewton` stops before numbers overflow."""
        return self._blocks(eta)

    def work(self, eta):
        """Work of the reactions on the structure in the step, dimensionless; on the last rank, else 0."""
        if not self._here:
            return 0.0
        nodal, reactions = self.seen[0], self.ties.reactions(self._gradients(eta), self._reactions())
        trial, _ = self.model.tie_maps((nodal + self._start) / 2)
        passed = trial @ (nodal - self._start)[:, :, None]
        return -float(reactions.ravel() @ passed.ravel())

    def _reactions(self):
        """The multipliers that `work` takes."""
        return self.seen[1]
