"""Rayleigh's quotients of buckling modes, and what bounded stiffnesses and rounding may leave in them."""

import contextlib
from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.statics.energies import Energies

# Bound on the rounding error of x^T K x with an assembled K, over eps |x|^T |K| |x|.
_SAFETY = 2.0
# With d, the relative error of an eigenvalue of the assembled matrices, the quotient of its mode is off by this times
# d^2; and an eigenvalue of an unsymmetric pencil by this times the d of its mode's energy.
_SQUARED, _UNSYMMETRIC = 10.0, 3.0


class Quotients(NamedTuple):
    """Of n modes, (n,) each: Rayleigh's quotients K/slack with less of the energy of bounded stiffnesses; the shares of
    the energies that are due to these bounds; relative rounding errors of the quotients, and of the eigenvalues of
    assembled unsymmetric matrices."""

    values: np.ndarray
    softness: np.ndarray
    rounding: np.ndarray
    of_unsymmetric: np.ndarray


def quotients(problem, part, slack, vectors, small):
    """The `Quotients` of modes.

    The entries of K are as large as the stiffnesses against stretch and shear, so that their rounding may exceed the
    stiffness of a slender rod in bending by far. Where the bound on it is not small, energies are computed from small
    strains instead; the quotients are then off by the square of the modes' errors alone.

    Args:
        problem: a `Problem`; part: the `Part` of its second variation, assembled at the state.
        slack: the decrease of the second variation per unit of load factor.
        vectors: modes, PETSc vectors in their numbering.
        small: relative rounding errors below this may stay.
    """
    if not vectors:
        return Quotients(*(np.empty(0),) * 4)
    comm = problem.model.comm
    whole, decrease = (np.array([(A * v).dot(v) for v in vectors]) for A in (part.K, slack))
    of_slack = _rounding(slack, vectors, comm) / np.abs(decrease)
    of_matrix = _rounding(part.K, vectors, comm) / whole
    if of_matrix.max() <= small:
        softness = _softness(part, vectors, whole)
        rounding, values = of_matrix, (1 + softness) * whole / decrease
    else:
        bounded, less = _energies(problem, part, vectors)
        softness, values = less / bounded - 1, less / decrease
        of_matrix = np.abs(whole / bounded - 1)
        rounding = _SQUARED * of_matrix**2 + _mixed(values, of_matrix)
    return Quotients(values, softness, rounding + of_slack, _UNSYMMETRIC * of_matrix + of_slack)


def _rounding(A, vectors, comm):
    """(n,) bounds on the rounding errors of x^T A x."""
    starts, columns, values = A.getValuesCSR()
    rows, values, found = np.repeat(np.arange(len(starts) - 1), np.diff(starts)), np.abs(values), []
    for v in vectors:
        x = np.abs(v.array_r)
        found.append(float((x[rows] * values) @ np.concatenate(comm.allgather(x))[columns]))
    return _SAFETY * np.finfo(float).eps * comm.allreduce(np.array(found))


def _mixed(values, off):
    """(n,) relative errors of quotients whose modes are mixed by relative errors `off` of the eigenvalues."""
    apart = np.abs(values[:, None] - values) / np.abs(values)
    mixed = np.minimum(apart, off[:, None] ** 2 / np.where(apart > 0, apart, 1.0))
    return mixed.max(axis=1)


@contextlib.contextmanager
def _less_bounded(model):
    """Context in which the second variation has bounded stiffnesses b less the excess of a mode's energy: b (2 - b/K),
    so that the energy of a mode with bounded b is about that of the true one."""
    bound = model.bounded_stiffness()
    model.stiffen(bound * (2 - bound / model.section.K))
    try:
        yield
    finally:
        model.stiffen(model.bounded_K)


def _softness(part, vectors, whole):
    """(n,) shares of energies that are due to bounds; whole: (n,) the energies."""
    matrix = part.K.copy()
    with _less_bounded(part.model):
        part.load()
        part.assemble()
        part.K.axpy(-1.0, matrix)
        excess = np.array([(part.K * v).dot(v) for v in vectors])
    part.load()
    matrix.copy(part.K)
    return excess / whole


def _energies(problem, part, vectors):
    """(2, n) energies of modes from small strains: with the bounded stiffnesses, and with less of their excess."""
    model = problem.model
    rows = model.rows_of_nodes
    whole = [np.concatenate(model.comm.allgather(vector.array_r)) for vector in vectors]
    modes = [np.where(rows >= 0, vector[rows], 0.0) for vector in whole]
    energies = Energies(problem, modes, part.resistance)
    bounded = energies.here()
    with _less_bounded(model):
        return np.array([bounded, energies.here()])
