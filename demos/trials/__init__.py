"""The map of `failures`: which method does what on which trial.

cells           a cell: a number and a verdict
problems        what is solved, as dicts that every method reads, and the truths
catalogue       the trials: what is tried, what right means, how a method's answer becomes a cell
ways            trials of several ways to one end
methods         the columns of the map, each of one protocol
own             this package through its public face: the default, the rungs, the formulations
chains          the co-rotational beam and the reconstructed MCRE
rotation_vector a rod with incremental rotation vectors
bare            Newton's method by hand on dolfinx and PETSc, on this package's own forms
programs        the peers, each in a process of its own
table, picture  what a reader sees
"""
