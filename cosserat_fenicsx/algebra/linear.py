"""The direct solver for each kind of assembled matrix, and the settings that it needs."""


def factor_general(pc, A):
    """Set an LU factorisation with pivoting over the whole matrix."""
    pc.setType("lu")
    if A.comm.size > 1:
        _mumps(pc, A)
    else:
        pc.setFactorSolverType("klu")


def factor_second_variation(pc, K):
    """Set a factorisation that gives the inertia of the matrix, i.e. its number of negative eigenvalues."""
    if K.comm.size == 1:
        pc.setType("cholesky")
        pc.setFactorOrdering("nd")
    else:
        factor_constrained(pc, K)


def factor_constrained(pc, K, null=0.0):
    """As `factor_second_variation`, for a matrix whose diagonal may be zero because of constraint equations.

    Args:
        null: pivots below this count as zero; 0.0 for a threshold of rounding, relative to the largest row.
    """
    pc.setType("cholesky")
    factor = _mumps(pc, K)
    factor.setMumpsIcntl(13, 1)  # root front not distributed: otherwise some negative pivots are not counted
    factor.setMumpsIcntl(6, 0)  # no search for a large diagonal, which gives up where a row is zero
    factor.setMumpsIcntl(24, 1)  # null pivots are counted separately
    factor.setMumpsCntl(3, -null)


def _mumps(pc, A):
    pc.setOperators(A)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, 200)  # % extra memory for fill-in: too little fails without a message
    return factor
