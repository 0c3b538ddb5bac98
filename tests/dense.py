"""The tangent of a problem of one process as a dense matrix, from the matrices of the elements."""

import numpy as np


def tangent(problem):
    """The tangent at the state that `problem.function` was last called with, (unknowns, unknowns)."""
    numbering, size = problem.numbering, problem.numbering.size
    rows = numbering.rows[problem.model.cell_dofs]  # -1, where clamped, is a row and a column that are left out
    whole = np.zeros((size + 1, size + 1))
    np.add.at(whole, (rows[:, :, None], rows[:, None, :]), problem.tangent_form.matrices())
    if problem.ties:
        of_nodes, reactions, equations = problem.ties.tangent_blocks(problem.eta)
        nodes = problem.ties.rows.ravel()
        multipliers = numbering.first_multiplier + np.arange(numbering.multipliers)
        for i, j, part in ((nodes, nodes, of_nodes), (nodes, multipliers, reactions), (multipliers, nodes, equations)):
            np.add.at(whole, (i[:, None], j[None, :]), part)
    return whole[:size, :size]
