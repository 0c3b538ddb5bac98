"""The direct solver for each kind of matrix, and the settings that it needs."""

from petsc4py import PETSc


def solve_with_tangent(ksp, kind="general"):
    """Set how a KSP uses the factors of a tangent: a factorisation that pivots only within blocks loses digits on
    slender rods, which two steps of iterative refinement recover."""
    ksp.setType("richardson" if kind == "blocks" else "preonly")
    if kind == "blocks":
        ksp.setNormType(PETSc.KSP.NormType.NONE)
        ksp.setTolerances(max_it=3)


def factor_tangent(pc, A, kind="general"):
    """Set the factorisation of a tangent, serial or parallel.

    Args:
        kind: in serial, "general": LU with pivoting over the whole matrix, because the diagonal of a constraint
            equation, or of a contact force's, may be zero; "blocks": PETSc's LU of a matrix stored in node blocks,
            which pivots within them (q_a may be zero), at a third of the cost; "plain": PETSc's LU without pivoting;
            "symmetric": LDL^T. MUMPS in parallel.
    """
    pc.setType("cholesky" if kind == "symmetric" and A.comm.size == 1 else "lu")
    if A.comm.size > 1:
        _mumps(pc, A)
    elif kind == "general":
        pc.setFactorSolverType("klu")
    else:
        pc.setFactorOrdering("nd")


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
    factor.setMumpsIcntl(24, 1)  # null pivots are counted separately
    factor.setMumpsCntl(3, -null)


def _mumps(pc, A):
    pc.setOperators(A)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, 200)  # % extra memory for fill-in: too little fails without a message
    return factor
