"""Stability of an equilibrium by the negative squares of the second variation in (r, theta).

The form never leaves |q| = 1, so that a stable state has none, whatever the formulation. A dead moment in space is not
conservative and makes the tangent unsymmetric; its symmetric part in the rotation variables is what is counted. In a
plane the second variation falls into two parts, the motions in the plane and those out of it.
"""

from petsc4py import PETSc

from cosserat_fenicsx import linear
from cosserat_fenicsx.packed import Packed


class NegativeModes:
    """Counts negative squares at a problem's state.

    Args:
        problem: a `Problem`; its model carries the second variation, in parts.

    Attributes:
        parts: the `Part`s of the second variation.
        sideways: how many of the negative squares that were counted last lead out of the plane; 0 in space.
    """

    def __init__(self, problem):
        self.parts = [Part(problem, i) for i in range(len(problem.model.second_variations))]
        self.sideways = 0

    def load(self):
        """Take the numbers of the scene that the model was loaded with."""
        for part in self.parts:
            part.load()

    def count(self):
        """Number of negative squares at the problem's state and load factor.

        Returns:
            int, or -1 where the second variation is singular to round-off.
        """
        counts = [part.count() for part in self.parts]
        self.sideways = sum(n for n, part in zip(counts, self.parts, strict=True) if part.variation.sideways and n > 0)
        return -1 if -1 in counts else sum(counts)


class Part:
    """A part of the second variation that decouples from the others.

    Args:
        problem: a `Problem`.
        index: of the part among its model's `second_variations`.

    Attributes:
        variation: the model's `SecondVariation`.
        K: its matrix; pc: the factorisation.
    """

    def __init__(self, problem, index):
        self.problem, self._index = problem, index
        model = problem.model
        self.variation = variation = model.second_variations[index]
        tied = variation.tied
        self.K = variation.numbering.matrix(variation.cell_dofs, tied[tied >= 0])
        self.K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._form = Packed(variation.form, (model.state, *model.carried))
        self.pc = PETSc.PC().create(model.comm)
        linear.factor_second_variation(self.pc, self.K)

    def load(self):
        """Take the numbers of the scene that the model was loaded with."""
        self.variation = self.problem.model.second_variations[self._index]
        self._form.refresh()

    def assemble(self):
        """The second variation at the problem's state and load factor, in K."""
        problem, variation = self.problem, self.variation
        self.K.zeroEntries()
        self._form.add_to_matrix(self.K)
        if problem.ties:
            problem.ties.add_second_variation(self.K, variation.tied, variation.axes, problem.load_factor)
        self.K.assemble()

    def count(self):
        """Number of negative squares, or -1 where the form is singular to round-off."""
        self.assemble()
        self.pc.setOperators(self.K)
        self.pc.setUp()
        negative, zero, _ = self.pc.getFactorMatrix().getInertia()
        return -1 if zero else negative
