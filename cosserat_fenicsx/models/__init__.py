"""The models: forms of `cosserat_fenicsx.forms` on a mesh, with spaces, scales and boundary conditions."""
