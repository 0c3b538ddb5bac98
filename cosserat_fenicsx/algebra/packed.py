"""Assembly of a compiled form over and over: its coefficients are packed once, and then only those that move.

dolfinx packs all coefficients of a form at every assembly, which costs more than the elements of a coarse rod do.
"""

import numpy as np
from dolfinx import cpp

from cosserat_fenicsx import compat


class Packed:
    """A form with its packed coefficients.

    Args:
        form: a compiled form.
        moving: the Functions whose numbers change between assemblies.
        slow: those whose numbers change now and then, and are taken as they are at `catch_up`; all others at `refresh`.
    """

    def __init__(self, form, moving, slow=()):
        self._kernel = compat.kernel(form)
        self._constants = cpp.fem.pack_constants(self._kernel)
        self._places = []  # (numbers, key, columns, which number each entry is, whether it is slow)
        for functions, is_slow in ((moving, False), (slow, True)):
            for function in functions:
                self._find(function.x.array, is_slow)
        self.refresh()

    def _find(self, numbers, is_slow):
        """Where the numbers of a Function are packed: seen by packing their own indices, and then others."""
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
        """Pack everything anew; to be called when a scene's numbers were filled in."""
        self._coefficients = self._pack()
        views = [
            (numbers, self._coefficients[key][:, run], which, slow) for numbers, key, run, which, slow in self._places
        ]
        self._views, self._slow = ([view[:3] for view in views if view[3] == slow] for slow in (False, True))

    def catch_up(self):
        """Take the numbers of the slow Functions."""
        for numbers, view, which in self._slow:
            view[...] = numbers[which]

    def _renew(self):
        for numbers, view, which in self._views:
            view[...] = numbers[which]
        if len(self._constants):
            self._constants = cpp.fem.pack_constants(self._kernel)
        return self._constants, self._coefficients

    def add_to_vector(self, array):
        """Add a linear form to an array of local numbers, ghosts too."""
        cpp.fem.assemble_vector(array, self._kernel, *self._renew())

    def add_to_matrix(self, A):
        """Add a bilinear form to a PETSc matrix by its own local-to-global map; unknowns it maps to -1 are left out."""
        cpp.fem.petsc.assemble_matrix(A, self._kernel, *self._renew(), [])
