"""One file a rung: a form of `cosserat_fenicsx.forms` put on a mesh, with its spaces, scales and boundary conditions."""
