"""A model's equations in PETSc's and SLEPc's terms: vectors, matrices, factorisations, eigenvalues."""
