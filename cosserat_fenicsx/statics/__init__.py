"""Equilibrium: Newton's method, paths with their events and branches, meshes fine enough, `solve` and `buckling`."""
