"""Eq. (8) of the paper as a method: the secant formula of second order."""

import numpy as np

from cosserat_fenicsx import analytic
from trials.cells import Answer, Method, NotForIt


class Secant(Method):
    """See `cells.Method`."""

    key, title = "secant", "eq. (8),\nsecant formula"
    what = "the closed form of second order, eq. (8) of the paper: the column's delta alone"
    spatial, turn = False, (0.0, 0.0, 1.2)

    def solve(self, problem, jump=False):
        """delta at the load factors; infinite at the pole, nan beyond."""
        (along, across, out), moment = problem["force"], problem["moment"][2]
        extra = {"history", "turn", "guided", "follower"} & set(problem)
        if extra or problem["radius"] or across or out or not along < 0:
            raise NotForIt("it knows the eccentric column alone")
        critical = np.pi**2 * problem["EI"] / (2 * problem["length"]) ** 2
        etas = -along / critical * np.array(problem["load_factors"])
        delta = analytic.secant_delta(etas, -moment / along)
        said = "" if np.isfinite(delta[-1]) or np.isinf(delta[-1]) else "no number beyond the pole"
        note = "infinite at the pole" if np.isinf(delta).any() else ""
        return Answer(np.column_stack([np.zeros_like(delta), delta, np.zeros_like(delta)]), said, note)
