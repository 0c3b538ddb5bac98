"""Threads with friction in statics: their tensions follow the whole shape, which the tangent does not know.

With the tangent K at given tensions T, the residual's derivatives G by T at the Gauss points, and those C of T by the
unknowns, a solution for the forces b is that of (K + G C) x = b. With t = C x this is

    (1 + C K^-1 G) t = C K^-1 b,    x = K^-1 (b - G t),

where the part beside 1 is compact: GMRES (Saad & Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856) takes few steps,
each with one solution by the factors of K, whatever the mesh.
"""

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx import compat
from cosserat_fenicsx.algebra.building import Packed
from cosserat_fenicsx.algebra.eigen import gmres
from cosserat_fenicsx.compat import compiling
from cosserat_fenicsx.errors import NotConverged

# Residual over the right side of what is solved, and most steps of GMRES.
_SOLVED, _MOST = 1e-13, 60
# Length by which a thread may slide back, over the length of its rod; and the tension, over that of buckling, that
# holds nothing.
_BACK, _NOTHING = 1e-7, 1e-12


class ThreadFriction:
    """The threads with friction of a `Problem`."""

    def __init__(self, problem):
        self._problem, self._model = problem, problem.model
        model, terms = problem.model, [term for term in problem.model.actions.terms if term.kind.slides]
        with compiling():
            (force,) = compat.forms(model.mesh, model.thread_forms(terms, model.step)[2:])
        self._force = Packed(force, (model.state, *(term.data[0] for term in terms)), model.constants)

    def load(self):
        """Take the threads of the scene that the model was loaded with, in its reference configuration."""
        model = self._model
        factors = {"load": model.load_factor, "permanent": model.permanent_factor}
        self._threads = [(x, factors[term.kind.scaled]) for term, found in model.actions.sliding for x in found]
        model.actions.refresh()
        self._force.refresh()
        self._local, self._column = np.zeros_like(model.state.x.array), self._problem.numbering.vector()
        self._before = None

    def stuck(self, rows):
        """[(thread, blocks, rows)] of the stiffness of threads that stick, see `small_motions.of_blocks`, zero where
        they have no tension; rows: [(nodes, 6) row numbers of each rod]."""
        found, p = [], self._model.signature.degree
        for thread, factor in self._threads:
            factor = float(factor.value) * thread.action.amplitude
            own, first = rows[self._model.scene.number(thread.action.rod)], p * np.arange(len(thread.tensions))
            at = own[first[:, None] + np.arange(p + 1)].reshape(len(first), -1)
            found.append((thread.action, thread.stuck(factor), at))
        return found

    def _changes(self, x):
        """C times a vector of the solver."""
        self._problem.numbering.to_local(x, self._local)
        return np.concatenate([thread.change(self._local[None]).ravel() for thread, _ in self._threads])

    def _moved(self, t):
        """K^-1 G times changes of the tensions."""
        problem, found, first = self._problem, self._problem.numbering.vector(), 0
        for thread, factor in self._threads:
            size = thread.tensions.size
            thread.put(float(factor.value) * t[first : first + size].reshape(thread.tensions.shape))
            first += size
        problem._assemble(self._force, self._column)
        problem.solve_at_tensions(self._column, found)
        for thread, _ in self._threads:
            thread.put(thread.tensions)
        return found

    def complete(self, x):
        """Complete x = K^-1 b to the solution with tensions that follow; False where it was not found."""
        right = self._changes(x)
        size = float(np.linalg.norm(right))
        if not size:
            return True
        if not np.isfinite(size):
            return False
        matrix = PETSc.Mat().createPython((len(right), len(right)), self, comm=PETSc.COMM_SELF)
        b, t = (PETSc.Vec().createWithArray(y, comm=PETSc.COMM_SELF) for y in (right, np.zeros_like(right)))
        solver = gmres(matrix, _MOST)
        solver.getPC().setType("none")
        solver.setGMRESRestart(_MOST)
        solver.setTolerances(rtol=_SOLVED)
        solver.solve(b, t)
        found = solver.getResidualNorm() <= np.sqrt(_SOLVED) * size
        if found:
            x.axpy(-1.0, self._moved(t.array_r))
        for used in (solver, matrix, b, t):
            used.destroy()
        return found

    def mult(self, matrix, t, image):
        """1 + C K^-1 G times changes of the tensions, for PETSc."""
        image.array_w[:] = t.array_r + self._changes(self._moved(t.array_r))

    def accept(self):
        """Accept the state as the next one of a path; NotConverged where a thread has slid back since the last one."""
        before, self._before = self._before, [thread.left() for thread, _ in self._threads]
        for (thread, factor), now, last in zip(self._threads, self._before, before or self._before, strict=True):
            pull, action = float(factor.value) * thread.action.amplitude * thread.tensions.max(), thread.action
            k = int(np.argmax(now - last))
            if pull > _NOTHING and now[k] - last[k] > _BACK * max(now[0], now[-1]):
                raise NotConverged(
                    f"the {type(action).__name__} of {action.rod.name} slides back at s = {thread.ends[k]:.4g} m on "
                    f"the way to the load factor {self._problem.load_factor:g}, by "
                    f"{(now[k] - last[k]) * self._model.scales.length:.3g} m: expected a path on which it slides "
                    f"towards the {action.pulled} of the rod alone, which loads that lengthen it and falling tensions "
                    "do not allow"
                )
