"""Which direct solver factors what, and the settings it must not be without."""

from petsc4py import PETSc


def solve_with_tangent(ksp, kind="general"):
    """How a KSP uses the factors of a tangent: a factorisation that pivots within blocks alone loses digits on slender rods,
    which two steps of refinement bring back."""
    ksp.setType("richardson" if kind == "blocks" else "preonly")
    if kind == "blocks":
        ksp.setNormType(PETSc.KSP.NormType.NONE)
        ksp.setTolerances(max_it=3)


def factor_tangent(pc, A, kind="general"):
    """What solves with a tangent, one process or many.

    Args:
        kind: "general": LU that pivots everywhere, because the diagonal of an added equation, or of a contact force's, may be
            zero; "blocks": PETSc's own of a matrix stored by blocks, which pivots within those of the nodes (q_a may be
            zero), a third of the cost; "plain": PETSc's own, which does not pivot; "symmetric": Cholesky with signs.
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
    if K.comm.size == 1:
        pc.setType("cholesky")
        pc.setFactorOrdering("nd")
    else:
        factor_constrained(pc, K)


def factor_constrained(pc, K, null=0.0):
    """The same, of a matrix whose diagonal may be zero, because of added equations.

    Args:
        null: what pivots must be below to count as zero; 0.0 for rounding, relative to the largest row.
    """
    pc.setType("cholesky")
    factor = _mumps(pc, K)
    factor.setMumpsIcntl(13, 1)  # the root front in one piece, or negative pivots are not all counted
    factor.setMumpsIcntl(24, 1)  # null pivots are counted apart
    factor.setMumpsCntl(3, -null)


def _mumps(pc, A):
    pc.setOperators(A)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, 200)  # room for fill: too little of it fails without a word
    return factor
