"""Problems in lock step: FFCx's kernels for several elements at once, one in each lane of a vector, for `lanes.c`.

FFCx's C is compiled again with a vector in place of every number that differs from case to case.
"""

import ctypes
import functools
import hashlib
import re
from pathlib import Path

import numpy as np

from cosserat_fenicsx import code_cache
from cosserat_fenicsx.algebra.building import Pointers, module
from cosserat_fenicsx.errors import InstallationError

_PRELUDE = """\
#include "{header}"
#include <math.h>
#include <stdint.h>
typedef double lanes __attribute__((vector_size({lanes} * sizeof(double))));
"""
# The functions that are replaced, and their arguments.
_FUNCTIONS = {"fabs": "a", "sqrt": "a", "cos": "a", "sin": "a", "fmax": "ab", "fmin": "ab"}
_LANEWISE = """\
static inline lanes lanes_{name}({arguments})
{{
    for (int i = 0; i < {lanes}; i++) a[i] = {name}({values});
    return a;
}}
"""


class _Symbol(ctypes.Structure):
    """What the system's loader says of an address: `Dl_info`."""

    _fields_ = [("file", ctypes.c_char_p), ("base", ctypes.c_void_p), ("name", ctypes.c_char_p),
                ("address", ctypes.c_void_p)]  # fmt: skip


def _source(address):
    """(name, C) of a compiled kernel, from the file that FFCx has left beside its machine code; None without."""
    symbol = _Symbol()
    if not ctypes.CDLL(None).dladdr(ctypes.c_void_p(address), ctypes.byref(symbol)) or not symbol.name:
        return None
    stem = Path(symbol.file.decode()).name.removesuffix(code_cache.SUFFIX)
    name, file = symbol.name.decode(), code_cache.folder() / f"{stem}.c"  # from where it was made it has been moved
    if code_cache.why_unsafe(file) is not None or not file.exists():
        return None
    code = file.read_text(encoding="utf-8")
    begin = code.find(f"void {name}(double* restrict A,")
    return None if begin < 0 else (name, _up_to_its_last_brace(code[begin:]))


def _up_to_its_last_brace(code):
    """The function of C with which a text begins."""
    depth = 0
    for brace in re.finditer("[{}]", code):
        depth += 1 if brace[0] == "{" else -1
        if not depth:
            return code[: brace.end()] + "\n"
    return code


def _in_lanes(code):
    """A kernel with vectors in place of numbers; tables and coordinates stay as they are."""
    code = re.sub(r"(?<!static const )\bdouble\b", "lanes", code)
    code = code.replace("const lanes* restrict coordinate_dofs", "const double* restrict coordinate_dofs")
    code = re.sub(r"\blanes (\w+) = 0(\.0)?;", r"lanes \1 = {0};", code)
    return "static " + re.sub(rf"\b({'|'.join(_FUNCTIONS)})\(", r"lanes_\1(", code)


@functools.cache
def _functions(addresses, lanes):
    """{address: C's function for one element of each lane}; None where there is none."""
    sources = {address: _source(address) for address in addresses}
    if None in sources.values():
        return None
    kernels = dict(sources.values())
    text = "".join(
        _LANEWISE.format(name=name, lanes=lanes, arguments=", ".join(f"lanes {x}" for x in given),
                         values=", ".join(f"{x}[i]" for x in given))
        for name, given in _FUNCTIONS.items()
    )  # fmt: skip
    text += "\n".join(map(_in_lanes, kernels.values()))
    text += f"\nvoid *const lane_kernels[] = {{{', '.join(f'(void *){name}' for name in kernels)}}};\n"
    stem = f"lanes_{hashlib.sha256(text.encode()).hexdigest()[:20]}"
    with code_cache.alone_with(stem) as part:
        for end, content in (
            ("h", f"extern void *const lane_kernels[{len(kernels)}];\n"),
            ("c", _PRELUDE.format(header=f"{stem}.h", lanes=lanes) + text),
        ):
            (part / f"{stem}.{end}").write_text(content, encoding="utf-8")
            (part / f"{stem}.{end}").replace(code_cache.folder() / f"{stem}.{end}")
    try:
        _, lib = module(code_cache.folder() / f"{stem}.c")
    except InstallationError:  # what these vectors cannot do, such as a choice between two numbers
        return None
    places = {name: lib.lane_kernels[i] for i, name in enumerate(kernels)}
    return {address: places[name] for address, (name, _) in sources.items()}


def allowed(problem, variations):
    """Whether problems such as this one may be solved in lock step: nothing is left to an interface or to Python."""
    chains = [problem.c.chain, *(variations.c.chain[k] for k in range(variations.c.parts))]
    c = problem.c
    return (c.serial and not (c.hooks or c.ties or c.contact or c.matrices) and all(x.kept == 0 for x in chains)
            and not any(variations.c.tied[k] for k in range(variations.c.parts)))  # fmt: skip


class LockStep(Pointers):
    """The C structure `lock_step` (`c`; None where kernels cannot be compiled for lanes) for problems such as this one;
    variations: its `NegativeModes`."""

    def __init__(self, problem, variations):
        super().__init__()
        parts = [part.form for part in variations.parts]
        forms = [problem._residual, problem.tangent_form, *parts]
        self.c, lanes = None, self._lib.LANES
        self._functions = _functions(tuple(x.address for form in forms for x in form.parts()), lanes)
        if self._functions is None:
            return
        self.c, self._kernels = self._ffi.new("lock_step *"), []
        self.c.residual, self.c.tangent, *second = map(self._kernel, forms)
        for k, kernel in enumerate(second):
            self.c.second[k] = kernel
        chains = [problem.c.chain, *(variations.c.chain[k] for k in range(variations.c.parts))]
        self.c.A = self._room(max(form.size for form in forms))
        self.c.front = self._room(max(x.elements * x.room * (x.room + 1) for x in chains))
        self.c.x = self._room(problem.c.size)

    def _kernel(self, form):
        """C's `lane_kernel` of a form and of those that are added to it."""
        found = self._ffi.NULL
        for part in [*form.parts()][::-1]:
            kernel = self._ffi.new("lane_kernel *")
            kernel.tabulate, kernel.next = self._functions[part.address], found
            kernel.w, kernel.c, kernel.constants = self._room(part._w.size), self._room(part._c.size), part._c.size
            self._kernels.append(kernel)
            found = kernel
        return found

    def _room(self, count):
        """C's pointer to numbers of all lanes, where a vector may begin."""
        size = 8 * self._lib.LANES
        room = np.zeros(self._lib.LANES * (count + 1))
        first = -room.ctypes.data % size // 8
        return self.doubles(room[first:])
