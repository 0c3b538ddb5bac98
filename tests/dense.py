"""The tangent of a problem of one process as a dense matrix, from the matrices of the elements."""

import numpy as np


def tangent_of_ties(ties, eta):
    """`TieRows.tangent_blocks` as whole matrices: (nodes, nodes), (nodes, equations) and (equations, nodes)."""
    links = ties.model.signature.connections
    of_nodes, *of_ends = ties.tangent_blocks(eta)
    ends = [links.pattern.on_nodes(part, list(links.equations)).reshape(len(links.equations), -1) for part in of_ends]
    return links.pattern.full(of_nodes), ends[0].T, ends[1]


def tangent(problem):
    """The tangent at the state that `problem.function` was last called with, (unknowns, unknowns)."""
    numbering, size = problem.numbering, problem.numbering.size
    rows = numbering.rows[problem.model.cell_dofs]  # -1, where clamped, is a row and a column that are left out
    whole = np.zeros((size + 1, size + 1))
    np.add.at(whole, (rows[:, :, None], rows[:, None, :]), problem.tangent_form.matrices())
    if problem.ties:
        of_nodes, reactions, equations = tangent_of_ties(problem.ties, problem.tie_load_factor)
        nodes = problem.ties.rows.ravel()
        multipliers = numbering.first_multiplier + np.arange(numbering.multipliers)
        for i, j, part in ((nodes, nodes, of_nodes), (nodes, multipliers, reactions), (multipliers, nodes, equations)):
            np.add.at(whole, (i[:, None], j[None, :]), part)
    return whole[:size, :size]
