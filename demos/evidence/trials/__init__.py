"""The table of `failures`: methods and trials.

cells           a cell: a number and a verdict
problems        the problems, as dicts that every method reads, and the reference solutions
catalogue       the trials: the problem, the criterion, and the cell for a method's answer
ways            trials that compare several ways to one final state
methods         the columns of the table and their protocol
own             this package through its public interface: the default, the models, the formulations
chains          the co-rotational beam and the reconstructed MCRE
rotation_vector a rod with incremental rotation vectors
bare            Newton's method by hand on dolfinx and PETSc, on this package's own forms
programs        the peers, each in a separate process
table, picture  the output
"""
