"""Arrays of numpy for C."""

import numpy as np

from cosserat_fenicsx.algebra.building import module


class Pointers:
    """Base of what gives C pointers to arrays: these are kept as long as the object. `sources`: see `module`."""

    def __init__(self, *sources):
        self._ffi, self._lib = module(*sources)
        self._arrays = []

    def doubles(self, array):
        """C's pointer to an array of floats."""
        self._arrays.append(array)
        return self._ffi.cast("double *", array.ctypes.data)

    def integers(self, array):
        """C's pointer to an array of 32-bit integers, which is copied if it is not one."""
        array = np.ascontiguousarray(array, dtype=np.int32)
        self._arrays.append(array)
        return self._ffi.cast("int *", array.ctypes.data)
