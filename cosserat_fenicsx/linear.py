"""Which direct solver factors what, and the settings it must not be without."""


def factor_tangent(pc, A, kind="general"):
    """What solves with a tangent.

    Args:
        kind: "general": LU that pivots, because q_a may be zero, and so may the diagonal of an added equation; "plain":
            LU that does not, PETSc's own, a third of the cost; "symmetric": Cholesky with signs.
    """
    pc.setType("cholesky" if kind == "symmetric" and A.comm.size == 1 else "lu")
    if A.comm.size > 1:
        _mumps(pc, A)
    elif kind == "general":
        pc.setFactorSolverType("klu")
    else:
        pc.setFactorOrdering("nd")


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
