"""Static bifurcations under loads without a potential: the real eigenvalues of an unsymmetric pencil."""

from petsc4py import PETSc

from cosserat_fenicsx.algebra import eigen

# Eigenvalues computed: the first number times the requested count, plus the second. More than requested, because those
# of the opposite load and complex ones, which are discarded, are among them.
_PER_REQUESTED, _EXTRA = 4, 12


def static_bifurcations(slack, K, count):
    """Changes of the load factor, from the state, at which the linearised second variation K - mu slack is singular.

    Args:
        slack: the decrease of the second variation per unit of load factor.
        K: the second variation at the state. Both are pairs (symmetric part, skew-symmetric part) of PETSc matrices
            with the same numbering.
        count: largest number of load factors to return.

    Returns:
        (1/mu (n,), descending; null vectors as PETSc vectors), n <= count.
    """
    A, B = (symmetric.copy() for symmetric, _ in (slack, K))
    for total, (_, skew) in ((A, slack), (B, K)):
        total.axpy(1.0, skew, PETSc.Mat.Structure.DIFFERENT)
    values, vectors = eigen.real_of_pencil(A, B, _PER_REQUESTED * count + _EXTRA)
    return values[:count], vectors[:count]
