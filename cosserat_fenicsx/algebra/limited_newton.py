"""Newton's method with steps of limited length, for states far from the solution, such as a rod pressed against a wall.

The contact force that is carried at the Gauss points takes the same share of its step as the motion. A tangent that is
singular to rounding is solved with all the same: beside a stiff wall the pivots of a slender rod are as small, and
whoever takes the steps tests what is found by its balance.
"""

import math
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

# Smallest pivots beside a stiff wall, over those that are zero to rounding.
_SMALLER = 1e-2


@dataclass(frozen=True)
class Step:
    """A Newton step: its largest displacement (in the model's unit of length) and rotation (rad) of a node before it
    was limited, and the share of it that was taken."""

    moved: float
    turned: float
    share: float


class LimitedNewton:
    """Newton steps for one problem, from the problem's state.

    Args:
        problem: a `Problem`.
        longest: the longest displacement of a node in a step, in the model's unit of length.
        widest: the largest rotation of a node in a step, rad.

    Attributes:
        iterations: steps so far.
    """

    def __init__(self, problem, longest, widest):
        self._problem, self._longest, self._widest, self.iterations = problem, longest, widest, 0
        self._change = problem.numbering.vector()
        self._carried = [function.x.array for function in problem.model.carried]

    def step(self, share=1.0):
        """Take one step, or a share of it; None where the tangent is singular or the residual is not a number."""
        problem, x = self._problem, self._problem.x
        self._residual()
        self._factor()
        if not problem.solve(problem.b, self._change):
            return None
        moved, turned = self._size(self._change.array_r)
        if not math.isfinite(moved + turned):
            return None
        share = min(share, self._longest / moved if moved else 1.0, self._widest / turned if turned else 1.0)
        before = [carried.copy() for carried in self._carried]
        problem.model.before.x.array[:] = problem.model.state.x.array
        x.axpy(-1.0, self._change)
        problem.set_state(x)
        problem.advance()
        if share < 1.0:
            for carried, old in zip(self._carried, before, strict=True):
                carried[:] = old + share * (carried - old)
            x.axpy(1.0 - share, self._change)
            problem.set_state(x)
        self.iterations += 1
        return Step(moved, turned, share)

    def imbalance(self):
        """The largest residual force of a node at the state, in the model's unit of force."""
        model = self._problem.model
        self._residual()
        forces = model.motion_in(self._problem.b.array_r).reshape(-1, model.components - model.multipliers)
        local = np.abs(forces[:, : model.moves]).max(initial=0.0)
        return float(model.comm.allreduce(local, op=MPI.MAX)) if model.comm.size > 1 else float(local)

    def _factor(self):
        """Factors of the tangent; where it is singular to rounding, with smaller pivots."""
        problem, chain = self._problem, self._problem.elimination.c
        problem.factor()
        if problem.c.singular:
            usual, chain.zero_pivot = chain.zero_pivot, _SMALLER * chain.zero_pivot
            problem.factor()
            chain.zero_pivot = usual

    def _residual(self):
        self._problem.function(self._problem.x, self._problem.b)

    def _size(self, change):
        """Largest displacement and rotation of a node in a change of the unknowns, over all ranks."""
        model = self._problem.model
        squares = np.square(model.motion_in(change).reshape(-1, model.components - model.multipliers))
        parts = (squares[:, : model.moves], model.turn**2 * squares[:, model.moves :])
        local = np.sqrt([part.sum(axis=1).max(initial=0.0) for part in parts])
        if model.comm.size > 1:
            model.comm.Allreduce(MPI.IN_PLACE, local, op=MPI.MAX)
        return float(local[0]), float(local[1])
