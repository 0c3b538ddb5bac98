"""The C code of this folder: compiled once a machine, at first use, and kept beside dolfinx's compiled forms. Forms and
expressions for C are kernels whose coefficients are packed once, and then only those that change.

Only a C compiler and Python's headers are needed, which dolfinx needs as well.

For problems in lock step, in `lanes.c`, a kernel computes several elements at once, one in each lane of a vector:
FFCx's C is compiled again with a vector in place of every number that differs from case to case.
"""

import contextlib
import ctypes
import functools
import hashlib
import math
import os
import re
import shlex
import subprocess
import sysconfig
import threading
from pathlib import Path

import cffi
import numpy as np

from cosserat_fenicsx import code_cache, compat  # before dolfinx, whose import it guards
from cosserat_fenicsx.code_cache import instructions
from cosserat_fenicsx.compat import PETSc, compiling, cpp
from cosserat_fenicsx.errors import InstallationError

SOURCES = tuple(
    Path(__file__).with_name(f"{name}.c")
    for name in ("chain", "ties", "newton", "lanes", "sweep", "compared", "wall_law", "contact")
)
# What -ffast-math would add hides numbers that are not finite, and changes sums. Python's own -fwrapv slows loops down.
_FLAGS = ("-O3", "-fno-math-errno", "-ffp-contract=fast", "-fno-wrapv", "-fopenmp-simd", "-fvisibility=hidden", "-g0")


@functools.cache
def module(*sources):
    """cffi's (ffi, lib) of C files (default: this folder's) and the header of the first one, which must only declare;
    lines with # are for C alone. Of a file without a header the functions that are declared `extern`.

    C finds the number of arguments of FFCx's kernels as KERNEL_ARGUMENTS. Processes that come at the same time wait for
    the one that compiles; a file that is damaged or belongs to another system is made again. Raises InstallationError:
    there is no C compiler that works, or the cache cannot be used."""
    with compiling():
        name, *task = _task(sources or SOURCES)
        made = code_cache.load(name)
        if made is None:
            with code_cache.alone_with(name) as part:
                made = code_cache.load(name)
                if made is None:
                    code_cache.install(_build(name, part, *task))
                    made = code_cache.load(name)
        if made is None:
            raise ImportError(f"{name}: what was compiled cannot be loaded")
        return made.ffi, made.lib


@functools.cache
def begin():
    """Let a thread compile the files of this folder where they are not; the caller has forms compiled meanwhile.

    `module` reports any failure.
    """
    with contextlib.suppress(Exception):
        name, *task = _task(SOURCES)
        if not (code_cache.folder() / (name + code_cache.SUFFIX)).exists():
            threading.Thread(target=_compile, args=(name, *task), daemon=True).start()


def _compile(name, *task):
    # not within `compiling`, which changes what all threads share
    with contextlib.suppress(Exception), code_cache.alone_with(name) as part:
        code_cache.install(_build(name, part, *task))


def _task(sources):
    """Name of the module, files, header and flags."""
    flags = [*_FLAGS, *instructions(), f"-DKERNEL_ARGUMENTS={compat.KERNEL_ARGUMENTS}"]
    flags += code_cache.more_flags()
    header = sources[0].with_suffix(".h")
    header = header if header.exists() else sources[0]
    contents = [file.read_bytes() for file in (*sources, header)]
    key = hashlib.sha256(repr((contents, flags, code_cache.SUFFIX, cffi.__version__)).encode())
    return f"cosserat_{sources[0].stem}_{key.hexdigest()[:20]}", sources, header, flags


def _build(name, folder, sources, header, flags):
    from cffi import recompiler  # rarely needed, and slow to import

    declarations = header.read_text(encoding="utf-8")
    if header in sources:
        declarations = "\n".join(re.findall(r"^extern [^;{]*;", declarations, re.MULTILINE))
    builder = cffi.FFI()
    builder.cdef("\n".join(line for line in declarations.splitlines() if not line.startswith("#")))
    glue, made = folder.absolute() / "module.c", folder.absolute() / (name + code_cache.SUFFIX)
    code = "".join(f'#include "{source.absolute()}"\n' for source in sources)
    recompiler.make_c_source(builder, name, code, str(glue))
    headers = sysconfig.get_path("include"), sysconfig.get_path("platinclude")
    command = [*_linker(), "-fPIC", *(f"-I{path}" for path in headers), *flags, str(glue), "-o", str(made), "-lm"]
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8", errors="replace", cwd=folder
        )
    except OSError as problem:
        raise cffi.VerificationError(str(problem)) from problem
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"{command[0]}: exit code {done.returncode}"]
        causes = (line for line in lines if "error" in line or "failed" in line)  # ld's come before gcc's
        raise cffi.VerificationError(next(causes, lines[0]))
    return made


def _linker():
    """The command that makes a module of Python's; the environment's CC replaces its compiler, as everywhere."""
    words, compiler = (sysconfig.get_config_var(name) for name in ("LDSHARED", "CC"))
    if os.environ.get("CC") and words.startswith(compiler):
        words = os.environ["CC"] + words[len(compiler) :]
    return shlex.split(words)


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

    def in_lanes(self, *shape):
        """(array (.., LANES), C's pointer to it) for numbers of all lanes, where a vector may begin."""
        shape, size = (*shape, self._lib.LANES), 8 * self._lib.LANES
        room = np.zeros(math.prod(shape) + self._lib.LANES)
        first = -room.ctypes.data % size // 8
        array = room[first : first + math.prod(shape)].reshape(shape)
        return array, self.doubles(array)

    def call(self, name, *given):
        """Call a function of C; arrays are given as pointers to their numbers, None as 0."""
        pointers, at, null = [], self._ffi.from_buffer, self._ffi.NULL
        for x in given:
            if isinstance(x, np.ndarray):
                x = at(_POINTERS[x.dtype.char], x if x.flags.c_contiguous else np.ascontiguousarray(x))
            pointers.append(null if x is None else x)
        return getattr(self._lib, name)(*pointers)


class Mesh(Pointers):
    """The C structure `mesh` (`c`) of elements on rods, `counts` on each, of an `ElementRule`."""

    def __init__(self, counts, rule, **arrays):
        super().__init__()
        self.c = c = self._ffi.new("mesh *")
        c.rods, c.elements, c.p, c.points = len(counts), sum(counts), len(rule.nodes) - 1, len(rule.gauss)
        c.nodes, c.first = c.p * c.elements + c.rods, self.integers(np.cumsum([0, *counts]))
        self.keep(
            at_gauss=rule.at_gauss, slopes=rule.slopes, from_slopes=rule.from_slopes, leading=rule.leading,
            weights=rule.weights, by_fields=rule.contact_from_fields, by_densities=rule.contact_from_densities, **arrays
        )  # fmt: skip

    def keep(self, **arrays):
        """Give C arrays of floats, but those that are None."""
        for name, array in arrays.items():
            if array is not None:
                setattr(self.c, name, self.doubles(np.ascontiguousarray(array, dtype=float)))


# C's types of numpy's arrays.
_POINTERS = {"d": "double[]", "i": "int[]"}
# What is added to an index so that no other number looks like one; and how many elements tell which columns have it.
_MARK, _ASKED = 0.8765432198765432, 16


class _Kernel(Pointers):
    """The C structure `kernel` and the arrays that it points to."""

    def __init__(self, compiled, address, mesh, elements, size):
        super().__init__()
        self._compiled = compiled  # keeps the machine code
        self.address, self.size, self.elements, ffi = address, size, elements, self._ffi
        self.c = kernel = ffi.new("kernel *")
        kernel.tabulate, kernel.elements, kernel.size = ffi.cast("void *", address), elements, size
        corners = compat.geometry_dofs(mesh)[:elements]
        kernel.x, kernel.corners = self.doubles(mesh.geometry.x), self.integers(corners)
        kernel.A = self.doubles(np.zeros(size))

    def _set(self, w, c, sources, constants):
        """Give C packed coefficients w and constants c; sources: (values, indices, first column) that change."""
        kernel, ffi = self.c, self._ffi
        kernel.w, kernel.width, kernel.c = self.doubles(w), w.shape[1], self.doubles(c)
        self._sources = ffi.new("source[]", max(1, len(sources)))
        for to, (values, which, column) in zip(self._sources, sources, strict=False):
            to.values, to.which = self.doubles(values), self.integers(which)
            to.count, to.column = which.shape[1], column
        self._constants = ffi.new("double *[]", [self.doubles(value) for value, _ in constants] or 1)
        kernel.source, kernel.sources = self._sources, len(sources)
        kernel.constant = ffi.cast("double **", self._constants)
        kernel.slot = self.integers([slot for _, slot in constants])
        kernel.constants = len(constants)


class Packed(_Kernel):
    """A compiled form, linear or bilinear, integrated over this rank's elements; or several as a tuple, for their sum;
    moving, constants: the Functions and Constants whose values change; all others are read by `refresh`; symmetric:
    whether the symmetric part of the matrices is taken. dofs_c: C's pointer to the local degrees of freedom (elements,
    size) of the vector, of a linear form."""

    def __init__(self, form, moving, constants, *, symmetric=False):
        form, *others = form if isinstance(form, tuple) else (form,)
        self._others = Packed(tuple(others), moving, constants) if others else None
        self._form = compat.kernel(form)
        spaces, elements = self._form.function_spaces, self._form.mesh.topology.index_map(1).size_local
        of_spaces = [compat.cell_dofs(space)[:elements] for space in spaces]
        self._shape, self._dofs = [dofs.shape[1] for dofs in of_spaces], of_spaces[0]
        size = int(np.prod(self._shape))
        super().__init__(form, compat.kernel_address(form), self._form.mesh, elements, size)
        self.dofs_c = self.integers(self._dofs)
        packed = self._pack()
        self._key = next(iter(packed), None)
        self._w = packed[self._key] if packed else np.zeros((elements, 0))
        self._c = np.array(cpp.fem.pack_constants(self._form), dtype=float)
        sources = list(self._places([function.x.array for function in moving]))
        self._set(self._w, self._c, sources, [slot for constant in constants for slot in self._slots(constant.value)])
        if self._others:
            self.c.next = self._others.c
        if symmetric:
            self.c.symmetric = self._shape[0]

    def parts(self):
        """This form and those that are added to it."""
        part = self
        while part:
            yield part
            part = part._others

    def _pack(self):
        """{key of the integral: coefficients (elements, n)}."""
        return {key: np.ascontiguousarray(w) for key, w in cpp.fem.pack_coefficients(self._form).items()}

    def _places(self, arrays):
        """Where the values of Functions are packed, found by packing indices in place of values."""
        kept, first = [numbers.copy() for numbers in arrays], np.cumsum([0, *map(len, arrays)])
        for numbers, begin in zip(arrays, first, strict=False):
            numbers[:] = np.arange(begin, begin + len(numbers)) + _MARK
        packed = self._pack().get(self._key, self._w)
        for numbers, values in zip(arrays, kept, strict=True):
            numbers[:] = values
        off = packed[:: 1 + len(packed) // _ASKED] - _MARK
        columns = np.flatnonzero((abs(off - np.rint(off)) < 1e-6).all(axis=0)) if len(packed) else np.empty(0, int)
        of = np.searchsorted(first, packed[:1, columns].ravel(), side="right") - 1
        for run in np.split(np.arange(len(columns)), np.flatnonzero((np.diff(columns) > 1) | np.diff(of)) + 1):
            if len(run):
                k, at = of[run[0]], columns[run]
                yield arrays[k], np.rint(packed[:, at] - (_MARK + first[k])), at[0]

    def _slots(self, value):
        """The places of a Constant among the packed ones, found in the same way."""
        kept = value.copy()
        value[...] = _MARK
        found = np.flatnonzero(cpp.fem.pack_constants(self._form) == _MARK)
        value[...] = kept
        return [(value, int(slot)) for slot in found]

    def refresh(self):
        """Pack all coefficients and constants again; to be called after a scene is loaded."""
        for packed in self._pack().values():
            self._w[:] = packed
        self._c[:] = cpp.fem.pack_constants(self._form)
        if self.c.together:
            self._fill_lanes()
        if self._others:
            self._others.refresh()

    def take_together(self, functions):
        """Let C compute LANES elements of a vector at once, by `functions_in_lanes`; before `refresh`."""
        groups, lanes = -(-self.elements // self._lib.LANES), {}
        shapes = {"w": (groups, self._w.shape[1]), "c": (self._c.size,), "x": (groups, 6), "A": (self.size,)}
        for name, shape in shapes.items():
            lanes[name], pointer = self.in_lanes(*shape)
            setattr(self.c, f"lanes_{name}", pointer)
        self._lanes, self.c.together = lanes, functions[self.address]
        if self._others:
            self._others.take_together(functions)

    def _fill_lanes(self):
        mesh, lanes = self._form.mesh, self._lanes
        ends = mesh.geometry.x[compat.geometry_dofs(mesh)[: self.elements]].reshape(self.elements, 6)
        for to, numbers in ((lanes["w"], self._w), (lanes["x"], ends)):
            for lane in range(self._lib.LANES):
                part = numbers[lane :: self._lib.LANES]
                to[: len(part), :, lane] = part
                to[len(part) :, :, lane] = numbers[-1:]  # where no element is; a rank may have none at all
        lanes["c"][:] = self._c[:, None]

    def add_to_vector(self, array):
        """Add a linear form to an array of local degrees of freedom, ghosts included."""
        self._lib.add_vector(self.c, self.dofs_c, self._ffi.from_buffer("double[]", array))

    def matrices(self):
        """(elements, n, n) matrices of the elements, of a bilinear form."""
        found = np.empty((self.elements, self.size))
        self._lib.tabulate_all(self.c, self._ffi.cast("double *", found.ctypes.data))
        return found.reshape(self.elements, *self._shape)

    def add_to_matrix(self, A):
        """Add a bilinear form to a PETSc matrix by the matrix's local-to-global map; -1 there means to skip."""
        if self.c.symmetric:
            rows, n = self._dofs.astype(PETSc.IntType), self.c.symmetric
            starts = np.arange(0, n * rows.size + 1, n, dtype=PETSc.IntType)
            A.setValuesLocalIJV(starts, np.repeat(rows, n, axis=0), self.matrices(), True, rows)
            return
        self._lib.pack(self.c)
        for part in self.parts():
            cpp.fem.petsc.assemble_matrix(A, part._form, part._c, {part._key: part._w} if part._key else {}, [])


class PackedExpression(_Kernel):
    """A compiled expression at points of all local elements, ghosts included, or of this rank's own; all of its
    coefficients and constants are read at every evaluation; size: numbers of an element, (points, components)."""

    def __init__(self, expression, mesh, elements, size):
        address, functions, constants = compat.expression_address(expression)
        super().__init__(expression, address, mesh, elements, size)
        sources, column = [], 0
        for function in functions:
            which = compat.cell_dofs(function.function_space)[:elements]
            sources.append((function.x.array, which, column))
            column += which.shape[1]
        slots = [(constant.value, slot) for slot, constant in enumerate(constants)]
        self._set(np.zeros((elements, column)), np.zeros(len(constants)), sources, slots)


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
    """The system loader's record of an address: `Dl_info`."""

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
    """A kernel with vectors in place of numbers; tables stay as they are."""
    code = re.sub(r"(?<!static const )\bdouble\b", "lanes", code)
    code = re.sub(r"\blanes (\w+) = 0(\.0)?;", r"lanes \1 = {0};", code)
    return "static " + re.sub(rf"\b({'|'.join(_FUNCTIONS)})\(", r"lanes_\1(", code)


@functools.cache
def functions_in_lanes(addresses, lanes):
    """{address of a compiled kernel: C's function for one element of each lane}; None where there is none."""
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


#: Elements from which several are computed at once in equilibria, and in motions, where tangents are left as they are:
#: the code for it takes two seconds to compile, or one.
MANY_AT_REST, MANY_IN_MOTION = 1000, 100


def take_together(*forms):
    """Let C compute LANES elements of `Packed` forms at once, where there is code for it."""
    addresses = tuple(part.address for form in forms for part in form.parts())
    functions = functions_in_lanes(addresses, forms[0]._lib.LANES)
    for form in forms if functions else ():
        form.take_together(functions)


def allowed(problem, variations):
    """Whether problems such as this one may be solved in lock step: nothing is left to an interface or to Python."""
    chains = [problem.c.chain, *(variations.c.chain[k] for k in range(variations.c.parts))]
    c = problem.c
    return (c.serial and not (c.hooks or c.ties or c.contact or c.matrices) and all(x.kept == 0 for x in chains)
            and not any(variations.c.tied[k] for k in range(variations.c.parts)))  # fmt: skip


class LockStep(Pointers):
    """The C structure `lock_step` (`c`; None without kernels for lanes) for problems such as this one."""

    def __init__(self, problem, variations):
        super().__init__()
        parts = [part.form for part in variations.parts]
        forms = [problem._residual, problem.tangent_form, *parts]
        self.c, lanes = None, self._lib.LANES
        self._functions = functions_in_lanes(tuple(x.address for form in forms for x in form.parts()), lanes)
        if self._functions is None:
            return
        self.c, self._kernels = self._ffi.new("lock_step *"), []
        self.c.residual, self.c.tangent, *second = map(self._kernel, forms)
        for k, kernel in enumerate(second):
            self.c.second[k] = kernel
        chains = [problem.c.chain, *(variations.c.chain[k] for k in range(variations.c.parts))]
        rooms = {"A": max(form.size for form in forms), "x": problem.c.size,
                 "front": max(x.elements * x.room * (x.room + 1) for x in chains)}  # fmt: skip
        for name, size in rooms.items():
            _, pointer = self.in_lanes(size)
            setattr(self.c, name, pointer)

    def _kernel(self, form):
        """C's `lane_kernel` of a form and of those that are added to it."""
        found = self._ffi.NULL
        for part in [*form.parts()][::-1]:
            kernel = self._ffi.new("lane_kernel *")
            kernel.tabulate, kernel.next = self._functions[part.address], found
            (_, kernel.w), (_, kernel.c) = self.in_lanes(part._w.size), self.in_lanes(part._c.size)
            kernel.constants = part._c.size
            self._kernels.append(kernel)
            found = kernel
        return found
