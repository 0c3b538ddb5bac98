"""The mathematics of the rod as pure functions from UFL to UFL: no mesh, no PETSc, no numbers.

Vectors are inertial unless a name or docstring says material. Lengths are in units of the rod's length L, forces in
EI/L^2, moments in EI/L. Names follow eq. (1) of the paper: r, q, n, m, v, u, phi; index _s is d/ds, _R the reference.
"""
