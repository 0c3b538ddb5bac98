"""Whether loads have a potential; where they have none, the skew-symmetric part of the second variation and the static
bifurcations, which are the real eigenvalues of an unsymmetric pencil."""

import contextlib

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from cosserat_fenicsx.algebra import eigen
from cosserat_fenicsx.algebra.packed import Packed
from cosserat_fenicsx.algebra.pencil import constraint_rows, on_every_rank
from cosserat_fenicsx.algebra.pool import PROBLEMS
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.models.spatial import CirculatoryModel

# Rounding error of d omega over the terms that cancel in it.
_ROUNDING = 1e-10


@contextlib.contextmanager
def circulatory_part(scene, layout, degree, comm):
    """Context manager that gives the `CirculatoryPart` of a scene on a mesh; collective over the communicator."""
    signature = Signature.of(scene, layout, formulation="mixed", degree=degree)
    key = ("circulatory", signature)
    with PROBLEMS.lend(key, comm, lambda: CirculatoryModel(comm, signature), NotConverged) as model:
        model.load(scene, layout)
        yield CirculatoryPart(model)


def conservative_along(path):
    """Whether the loads have a potential in the neighbourhood of every point of a path; each rank computes it alone."""
    with circulatory_part(path.scene, path.layout, path.degree, MPI.COMM_SELF) as part:
        return all(part.vanishes(record.rq, record.load_factor) for record in path._records)


class CirculatoryPart:
    """Exterior derivative d omega of the virtual work omega of a scene's loads, by a loaded `CirculatoryModel`;
    matrices have the numbering of the spatial model's second variation."""

    def __init__(self, model):
        self._model = model
        (self._variation,) = model.second_variations
        self._form = self._variation.form and Packed(self._variation.form, (), ())

    def skew(self, rq, load_factor):
        """The skew-symmetric part of the second variation, a PETSc matrix, dimensionless; rq: (N, 7) of all nodes."""
        skew = self.matrix(rq, load_factor)
        skew.axpy(-1.0, skew.copy().transpose(), PETSc.Mat.Structure.DIFFERENT)
        skew.scale(-0.5)
        return skew

    def matrix(self, rq, load_factor):
        """The matrix of the bilinear form h of `models.circulatory`: d omega(w, psi) = h(w, psi) - h(psi, w)."""
        model, variation = self._model, self._variation
        model.take(rq, load_factor)
        matrix = variation.numbering.matrix(variation.cell_dofs, variation.tied, model.signature.connections.pattern)
        if self._form:
            self._form.refresh()
            self._form.add_to_matrix(matrix)
        matrix.assemble()
        return matrix

    def vanishes(self, rq, load_factor):
        """Whether the loads have a potential in the neighbourhood of a state, for all motions that the supports allow;
        False for loads that depend on the history of the motion."""
        if self._model.remembers:
            return False
        if not self._form:
            return True
        h, tied = on_every_rank(self.matrix(rq, load_factor)), self._variation.tied
        total = h.shape[0]
        held = sparse.csr_matrix(constraint_rows(self._model.held(rq, load_factor), tied, total))
        solve = sparse.csr_matrix(np.linalg.pinv((held @ held.T).toarray(), rcond=_ROUNDING))
        allowed = sparse.identity(total) - held.T @ solve @ held
        return bool(abs(allowed @ (h - h.T) @ allowed).max() <= _ROUNDING * abs(h).max())


# Eigenvalues computed: the first number times the requested count, plus the second; complex ones and those of the
# opposite load are discarded.
_PER_REQUESTED, _EXTRA = 4, 12


def static_bifurcations(slack, K, count):
    """Changes mu of the load factor, from the state, at which the linearised second variation K - mu slack is singular:
    (1/mu (n,), descending; null vectors as PETSc vectors), n <= count. Both K and slack, its decrease per unit of load
    factor, are pairs (symmetric part, skew-symmetric part) of PETSc matrices with the same numbering."""
    A, B = (symmetric.copy() for symmetric, _ in (slack, K))
    for total, (_, skew) in ((A, slack), (B, K)):
        total.axpy(1.0, skew, PETSc.Mat.Structure.DIFFERENT)
    values, vectors = eigen.real_of_pencil(A, B, _PER_REQUESTED * count + _EXTRA)
    return values[:count], vectors[:count]
