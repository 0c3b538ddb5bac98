"""Repeated assembly of a compiled form: its coefficients are packed once, and then only those that change.

dolfinx packs all coefficients of a form in every assembly, which costs more than the element kernels of a coarse rod.
"""

import numpy as np
from dolfinx import cpp

from cosserat_fenicsx import compat


class Packed:
    """A form with its packed coefficients.

    Args:
        form: a compiled form.
        moving: the Functions whose values are packed anew in every assembly.
        slow: those whose values change rarely, and are packed anew by `catch_up`; all others by `refresh`.
    """

    def __init__(self, form, moving, slow=()):
        self._kernel = compat.kernel(form)
        self._constants = cpp.fem.pack_constants(self._kernel)
        self._places = []  # (values, key, columns, indices of the entries in the values, whether slow)
        for functions, is_slow in ((moving, False), (slow, True)):
            for function in functions:
                self._find(function.x.array, is_slow)
        self.refresh()

    def _find(self, numbers, is_slow):
        """Find the columns where a Function's values are packed, by packing indices in place of values, twice."""
        kept, index = numbers.copy(), np.arange(len(numbers), dtype=float)
        numbers[:] = index
        first = self._pack()
        numbers[:] = index + 1
        second = self._pack()
        numbers[:] = kept
        for key, array in first.items():
            columns = np.flatnonzero((array != second[key]).any(axis=0))
            for run in np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1):
                if len(run):
                    which = array[:, run].astype(np.intp)
                    self._places.append((numbers, key, slice(run[0], run[-1] + 1), which, is_slow))

    def _pack(self):
        return {key: array.copy() for key, array in cpp.fem.pack_coefficients(self._kernel).items()}

    def refresh(self):
        """Pack all coefficients anew; to be called after the values of a scene are filled in."""
        self._coefficients = self._pack()
        views = [
            (numbers, self._coefficients[key][:, run], which, slow) for numbers, key, run, which, slow in self._places
        ]
        self._views, self._slow = ([view[:3] for view in views if view[3] == slow] for slow in (False, True))

    def catch_up(self):
        """Pack the current values of the slow Functions."""
        for numbers, view, which in self._slow:
            view[...] = numbers[which]

    def _renew(self):
        for numbers, view, which in self._views:
            view[...] = numbers[which]
        if len(self._constants):
            self._constants = cpp.fem.pack_constants(self._kernel)
        return self._constants, self._coefficients

    def add_to_vector(self, array):
        """Add a linear form to an array of local degrees of freedom, ghosts included."""
        cpp.fem.assemble_vector(array, self._kernel, *self._renew())

    def add_to_matrix(self, A):
        """Add a bilinear form to a PETSc matrix by the matrix's local-to-global map; -1 there means to skip."""
        cpp.fem.petsc.assemble_matrix(A, self._kernel, *self._renew(), [])
