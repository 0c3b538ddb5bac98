"""Static equilibrium: paths with their critical points and branches, mesh refinement, `solve` and `buckling`."""
