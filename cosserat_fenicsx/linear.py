"""Which direct solver factors what, and the settings it must not be without."""


def factor_tangent(pc, A):
    """LU of an unsymmetric tangent: it must pivot, because q_a may be zero; PETSc's own does not."""
    pc.setType("lu")
    if A.comm.size == 1:
        pc.setFactorSolverType("klu")
    else:
        _mumps(pc, A)


def factor_second_variation(pc, K):
    """A factorisation that tells the number of negative squares."""
    pc.setType("cholesky")
    if K.comm.size == 1:
        pc.setFactorOrdering("nd")
    else:
        factor = _mumps(pc, K)
        factor.setMumpsIcntl(13, 1)  # the root front in one piece, or negative pivots are not all counted
        factor.setMumpsIcntl(24, 1)  # null pivots are counted apart


def _mumps(pc, A):
    pc.setOperators(A)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, 200)  # room for fill: too little of it fails without a word
    return factor
