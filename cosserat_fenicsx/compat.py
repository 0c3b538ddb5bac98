"""Differences between releases of dolfinx and PETSc: the only module that depends on the installed versions.

Supported: dolfinx 0.5.2 (Debian 12), 0.9.0 (Debian 13), 0.11.0 (Debian's development branch) and those between.
All other modules call the functions below and contain no version checks.
"""

import contextlib
import logging
import math
import platform
import threading
import warnings

import numpy as np

from cosserat_fenicsx import code_cache, interrupts
from cosserat_fenicsx.code_cache import instructions
from cosserat_fenicsx.errors import CosseratError, InstallationError

_HOW_TO_INSTALL = (
    "Install it with the system's packages (Debian and Ubuntu: 'apt install python3-dolfinx', then run the "
    "interpreter that sees them, /usr/bin/python3 or a virtual environment made with --system-site-packages) "
    "or with conda ('conda install -c conda-forge fenics-dolfinx'). In a checkout, 'make setup' does it all."
)

_show_warnings = warnings.showwarning
try:
    import _cffi_backend
    import dolfinx
    import ffcx
    import ffcx.codegeneration.jit as ffcx_compiler
    import ffcx.naming as ffcx_names
    import ufl
    from dolfinx import cpp, fem, jit
    from dolfinx import mesh as dolfinx_mesh
    from petsc4py import PETSc
except ImportError as missing:
    raise InstallationError(f"dolfinx cannot be imported ({missing}). {_HOW_TO_INSTALL}") from missing

if warnings.showwarning is not _show_warnings:  # FFCx sends all warnings of a program to its log, also our own
    logging.captureWarnings(False)

interrupts.renew()

_VERSION = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])
if _VERSION < (0, 5):
    raise InstallationError(f"dolfinx {dolfinx.__version__} is too old: 0.5 or later is needed. {_HOW_TO_INSTALL}")


def require_real_scalars(scalar_type=PETSc.ScalarType):
    """Refuse a PETSc built for complex numbers: a rod's equilibrium is a real problem."""
    if "complex" in scalar_type.__name__:
        raise InstallationError(
            f"PETSc was built for complex numbers ({scalar_type.__name__}); cosserat_fenicsx needs the real build. "
            "On Debian: 'apt install python3-dolfinx-real' and unset PETSC_DIR and PETSC_ARCH."
        )


require_real_scalars()


@contextlib.contextmanager
def quiet_compiler():
    """Silence the just-in-time compiler's log: 0.5 reports every build and cache look-up at INFO on the root logger."""
    before = logging.root.manager.disable
    logging.disable(max(before, logging.INFO))
    try:
        yield
    finally:
        logging.disable(before)


@contextlib.contextmanager
def compiling():
    """Context manager in which C is compiled or loaded from the cache of compiled forms. Raises InstallationError: the
    cache cannot be written or read, or there is no C compiler that works."""
    try:
        with quiet_compiler():
            yield
    except CosseratError:
        raise
    except Exception as problem:
        said = str(problem).strip().partition("\n")[0] or type(problem).__name__
        if type(problem).__name__ == "VerificationError" or "VerificationError" in said or "CompileError" in said:
            raise InstallationError(
                f"the C compiler has failed ({said}): expected one that works, such as by 'apt "
                f"install gcc python3-dev', room for its files in {code_cache.folder()}, and no CC set to another"
            ) from problem
        if isinstance(problem, OSError | ImportError) or "just-in-time" in said:
            raise InstallationError(
                f"the cache of compiled forms in {code_cache.folder()} cannot be used ({said}): make room there, "
                "remove what is damaged, or set XDG_CACHE_HOME to a folder that can be written to"
            ) from problem
        raise


if _VERSION < (0, 8):

    def lagrange(mesh, degree, size, *, discontinuous=False):
        """A Lagrange element with `size` components: nodes at the Gauss-Lobatto points, numbered node by node."""
        family = "Discontinuous Lagrange" if discontinuous else "Lagrange"
        return ufl.VectorElement(family, mesh.ufl_cell(), degree, dim=size)

    def at_quadrature_points(mesh, quadrature_degree, size):
        """An element whose `size`-component values live at the Gauss points of `quadrature_degree`."""
        return ufl.VectorElement("Quadrature", mesh.ufl_cell(), quadrature_degree, dim=size, quad_scheme="default")

    def _usual_elements(p):
        """Those of rods with nodal unknowns in P_p."""
        families = [("Lagrange", p, {}), ("Discontinuous Lagrange", p, {}), ("Discontinuous Lagrange", 1, {}),
                    ("Quadrature", 2 * p - 1, {"quad_scheme": "default"})]  # fmt: skip
        found = [ufl.VectorElement(family, ufl.interval, q, dim=size, **more) for family, q, more in families
                 for size in range(1, 10)]  # fmt: skip
        return list(dict.fromkeys(found))

    def mixed(*elements):
        """The product of several elements."""
        return ufl.MixedElement(*elements)

    def function_space(mesh, element):
        """The finite element space of `element` on `mesh`."""
        return _constructed(lambda: fem.FunctionSpace(mesh, element), _element(mesh.comm, element))

    def interval_domain():
        """UFL's domain of a line, without a mesh."""
        cell = ufl.Cell("interval", geometric_dimension=1)
        # FFCx 0.5 gives the element this variant when it compiles: signatures before and after must be equal
        return ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1, variant="equispaced"))

    # Chains from which on their mesh is made without the search of dolfinx.
    _MANY_CHAINS = 100

    def create_interval_mesh(comm, cells, x):
        """A mesh of chains of intervals on a line from `cells (n, 2)`, chain after chain, and `x (m, 1)`, given on rank
        0 alone; and the number in `cells` of every local cell."""
        one = {"partitioner": _of_one_rank} if comm.size == 1 else {}
        if comm.size > 1 or len(x) - len(cells) < _MANY_CHAINS:
            made = dolfinx_mesh.create_mesh(comm, cells, x, interval_domain(), **one)
            return made, made.topology.original_cell_index
        # dolfinx looks for an order of cells and vertices for a time that grows by the square of the number of chains,
        # and finds the given one: take the geometry of a single chain through all vertices, with the cells of this mesh
        ends, vertices = np.arange(len(x)), cpp.graph.AdjacencyList_int32
        whole = dolfinx_mesh.create_mesh(comm, np.column_stack([ends[:-1], ends[1:]]), x, interval_domain(), **one)
        if not np.array_equal(whole.geometry.input_global_indices, ends):
            raise RuntimeError("this release of dolfinx reorders a chain of intervals: a defect of cosserat_fenicsx")
        whole.geometry.dofmap.array[: cells.size] = cells.ravel()
        topology = cpp.mesh.Topology(comm, cpp.mesh.CellType.interval)
        for dimension, entities in enumerate((ends[:, None], cells)):
            topology.set_index_map(dimension, cpp.common.IndexMap(comm, len(entities)))
            topology.set_connectivity(vertices(entities.astype(np.int32)), dimension, 0)
        made = cpp.mesh.Mesh(comm, topology, whole.geometry)
        return dolfinx_mesh.Mesh(made, interval_domain()), np.arange(len(cells))

    def _of_one_rank(comm, ranks, dimension, cells, ghosts):
        """Where cells belong, without the search that dolfinx makes on one rank too."""
        return cpp.graph.AdjacencyList_int32(np.zeros((cells.num_nodes, 1), dtype=np.int32))

    def create_solid_mesh(comm, cells, x):
        """A mesh of second-order hexahedra from `cells (n, 27)`, in basix' order of nodes, and `x (m, 3)`."""
        coordinates = ufl.VectorElement("Lagrange", ufl.hexahedron, 2, variant="equispaced")
        return dolfinx_mesh.create_mesh(comm, cells, x, ufl.Mesh(coordinates))

    def evaluate(expression, mesh, cells):
        """Values of a compiled expression in `cells`, shape (cells, points * components)."""
        return expression.eval(cells)

    def geometry_dofs(mesh):
        """Indices into `mesh.geometry.x` of the two ends of every local cell, shape (cells, 2)."""
        return mesh.geometry.dofmap.array.reshape(-1, 2)

    def pieces(given, made):
        """What a form or Expression of dolfinx was made from: code for `from_pieces`, the function spaces of its
        arguments, its Functions and its Constants; given: the UFL; None where the release gives no such access."""
        if not isinstance(given, ufl.Form):
            return ("expression", made.ufcx_expression), [], *_read(made)
        code, functions = made.ufcx_form, given.coefficients()
        used = [functions[code.original_coefficient_position[i]] for i in range(code.num_coefficients)]
        spaces = [a.ufl_function_space() for a in given.arguments()]
        return ("form", code), spaces, used, list(given.constants())

    def from_pieces(code, mesh, spaces, functions, constants):
        """A form or an Expression without arguments of dolfinx from what `pieces` tells, on a mesh."""
        kind, compiled = code
        objects = [[x._cpp_object for x in part] for part in (spaces, functions, constants)]
        mesh = mesh.ufl_domain().ufl_cargo()
        if kind == "form":
            return _Form(compiled, *objects, dict.fromkeys(_WHERE), mesh, _FFI, None)
        made = fem.Expression.__new__(fem.Expression)
        made._ufcx_expression, made._code, made._argument_function_space = compiled, None, None
        made.read = functions, constants  # in place of UFL, for `_read`
        address = _FFI.cast("uintptr_t", _FFI.addressof(compiled))
        made._cpp_object = cpp.fem.create_expression_float64(address, *objects[1:], mesh, None)
        return made

    _Form, _FFI = type("Form", (fem.forms.FormMetaClass, cpp.fem.Form_float64), {}), _cffi_backend.FFI()
    _WHERE = [getattr(cpp.fem.IntegralType, x) for x in ("cell", "exterior_facet", "interior_facet", "vertex")]

else:  # the same functions, see above
    import basix.ufl

    def lagrange(mesh, degree, size, *, discontinuous=False):
        return basix.ufl.element(
            "Lagrange", mesh.basix_cell(), degree, shape=(size,), discontinuous=discontinuous or degree == 0
        )

    def at_quadrature_points(mesh, quadrature_degree, size):
        return basix.ufl.quadrature_element(mesh.basix_cell(), value_shape=(size,), degree=quadrature_degree)

    def mixed(*elements):
        return basix.ufl.mixed_element(list(elements))

    def function_space(mesh, element):
        return fem.functionspace(mesh, element)

    def interval_domain():
        return ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,)))

    def create_interval_mesh(comm, cells, x):
        made = _mesh(comm, cells, x, basix.ufl.element("Lagrange", "interval", 1, shape=(1,)))
        return made, made.topology.original_cell_index

    def create_solid_mesh(comm, cells, x):
        return _mesh(comm, cells, x, basix.ufl.element("Lagrange", "hexahedron", 2, shape=(3,)))

    def _mesh(comm, cells, x, coordinates):
        given = (x, coordinates) if _VERSION < (0, 10) else (coordinates, x)
        return dolfinx_mesh.create_mesh(comm, cells, *given)

    def evaluate(expression, mesh, cells):
        values = expression.eval(mesh, cells)
        return values.reshape(len(cells), math.prod(values.shape[1:]))

    def pieces(given, made):
        return None

    def geometry_dofs(mesh):
        return mesh.geometry.dofmap if _VERSION < (0, 11) else mesh.geometry.dofmaps[0]


def alias(function):
    """A second UFL coefficient that shares the values of `function`.

    FFCx treats a coefficient under a one-point quadrature rule as constant over the cell, and then uses that value for
    every other rule of the same form, too. A term with its own rule must therefore use another coefficient.
    """
    return fem.Function(function.function_space, function.x)


#: Gives a function that compiles a communicator as its first argument: rank 0 calls it before the others.
rank_0_first = jit.mpi_jit_decorator

# Held while a function of dolfinx or FFCx is replaced.
_REPLACING = threading.RLock()


@contextlib.contextmanager
def _replaced(module, name, function):
    with _REPLACING:
        before = getattr(module, name)
        setattr(module, name, function)
        try:
            yield
        finally:
            setattr(module, name, before)


class _NotInCache(Exception):
    """The cache has no compiled module of this name."""


def _from_cache(name, objects, folder, timeout):
    """In place of FFCx's own function, which waits for other processes, and loads incomplete files too."""
    module = code_cache.load(name)
    if module is None:
        raise _NotInCache(name)
    return [getattr(module.lib, x) for x in objects], module


@contextlib.contextmanager
def _with_expressions(given):
    """While FFCx compiles forms, it adds code for (UFL expression, points) to their module."""
    real = ffcx_compiler._compile_objects

    def all_of_them(decl, forms, names, module_name, *others, **more):
        beside = _names_of(given, module_name)
        decl += ffcx_compiler.UFC_EXPRESSION_DECL + "".join(f"extern ufcx_expression {name};\n" for name in beside)
        return real(decl, [*forms, *given], [*names, *beside], module_name, *others, **more)

    with _replaced(ffcx_compiler, "_compile_objects", all_of_them if given else real):
        yield


def _names_of(given, module_name):
    """FFCx's names of compiled (UFL expression, points) in a module."""
    return [ffcx_names.expression_name(pair, module_name) for pair in given]


_FLAGS = "-g0", "-w"


def name_of(what, *given):
    """See `code_cache.name_of`, for what follows from the code of dolfinx, UFL and FFCx, and from flags, too."""
    programs = version(), ufl.__version__, ffcx.__version__
    return code_cache.name_of(what, programs, _FLAGS, instructions(), tuple(code_cache.more_flags()), given)


# {address of a compiled form or expression: names of its module and its own}, and modules by their names.
_NAMES, _MODULES = {}, {}


def _note(module):
    _MODULES[module.__name__] = module
    for name in dir(module.lib):
        if name.startswith(("form_", "expression_")):
            _NAMES[_address_of(getattr(module.lib, name))] = module.__name__, name


def _address_of(compiled):
    return int(_cffi_backend.FFI().cast("uintptr_t", _cffi_backend.FFI().addressof(compiled)))


def to_names(code):
    """What `pieces` gives as code, as names, which other processes understand."""
    kind, compiled = code
    return kind, *_NAMES[_address_of(compiled)]


def from_names(kind, module, name):
    """The code that `to_names` has named. Raises LookupError: it is not in the cache."""
    if module not in _MODULES:
        made = code_cache.load(module)
        if made is None:
            raise LookupError(module)
        _note(made)
    return kind, getattr(_MODULES[module].lib, name)


def _compiled(kind, objects, level="-O3", beside=()):
    """FFCx's (compiled objects, module, code) of a list of UFL's ("forms", "expressions" or "elements"), all in one
    module, from the cache or compiled; beside: (UFL expression, points) that are compiled with forms; they come last.

    Modules are compiled for speed: a tenth more to compile than by default, and from a sixth to half of the running
    time less. The macro among the flags gives them names of their own: no other program makes them. Warnings are off:
    FFCx's C has variables that it does not use.
    """
    mark = "=" + ffcx_names.compute_signature(beside, "") if beside else ""
    flags = [level, *_FLAGS, *instructions(), f"-DCOSSERAT_FENICSX{mark}", *code_cache.more_flags()]

    def found(folder):
        with _with_expressions(beside):
            compiled, module, code = getattr(ffcx_compiler, f"compile_{kind}")(
                objects, cache_dir=folder, cffi_extra_compile_args=flags
            )
        _note(module)
        return [*compiled, *(getattr(module.lib, name) for name in _names_of(beside, module.__name__))], module, code

    def cached():
        with _replaced(ffcx_compiler, "get_cached_module", _from_cache):
            return found(code_cache.folder())

    with _REPLACING:
        try:
            return cached()
        except _NotInCache as missing:
            name = str(missing)
        with code_cache.alone_with(name) as part:
            try:
                return cached()
            except _NotInCache:
                made = found(part)
                code_cache.install(*(part / f"{name}{end}" for end in (code_cache.SUFFIX, ".c", ".c.cached")))
                return made


def _constructed(make, found):
    """An object of dolfinx whose code is `found`: (compiled, module, code)."""
    with _replaced(jit, "ffcx_jit", lambda *_, **__: found):
        return make()


@rank_0_first
def _compiled_one_by_one(forms, pairs):
    """(compiled, module, code) of each form and of each (UFL expression, points), which are in one module."""
    if not forms and not pairs:
        return []
    names = _names_of(pairs, "")
    once = dict(zip(names, pairs, strict=True))  # those of two actions of one kind have one name, and are one code
    beside = list(once.values())
    found, module, code = _compiled("forms", forms, beside=beside) if forms else _compiled("expressions", beside)
    made = dict(zip(once, found[len(forms) :], strict=True))
    return [(compiled, module, code) for compiled in (*found[: len(forms)], *map(made.get, names))]


def together(mesh, forms, expressions):
    """dolfinx's forms of a list of UFL's, and Expressions of a list of (UFL expression, points (m,)), compiled into one
    module; each form and each expression may be None, and gives None."""
    pairs = [(a, np.reshape(points, (-1, 1))) for a, points in expressions]
    given = [form for form in forms if form is not None], [pair for pair in pairs if pair[0] is not None]
    found = iter(_compiled_one_by_one(mesh.comm, *given))
    return (
        [None if form is None else _constructed(lambda form=form: fem.form(form), next(found)) for form in forms],
        [None if a is None else _constructed(lambda a=a, x=x: fem.Expression(a, x), next(found)) for a, x in pairs],
    )


def forms(mesh, given):
    """dolfinx's forms of a list of UFL's, or None for None, compiled together."""
    return together(mesh, given, [])[0]


def expressions(mesh, given):
    """dolfinx's Expressions of a list of (UFL expression or None, points (m,)), or None for None, compiled together."""
    return together(mesh, [], given)[1]


# (elements, what `_compiled` gives for them) of this process, where the release compiles elements.
_ELEMENTS = []


@rank_0_first
def _element(element):
    """(compiled, module, code) of an element, for releases that compile them: thirty take the time of one."""
    if not any(element in elements for elements, _ in _ELEMENTS):
        p = (element.degree() + 1) // 2 if element.family() == "Quadrature" else element.degree()
        usual = _usual_elements(max(1, p))
        elements = usual if element in usual else [element]
        _ELEMENTS.append((elements, _compiled("elements", elements, "-O0")))
    elements, (found, module, code) = next(known for known in _ELEMENTS if element in known[0])
    return found[elements.index(element)], module, code


def on_rows(expressions):
    """For `rank_0_first`: compiled functions (numbers, results) that add the values of UFL expressions of the
    components of one ufl.Constant, for every row of `numbers` (m, components), to the rows of `results` (m, ..); both
    contiguous; address: of the kernel of each, which takes a row in place of a form's constants."""
    found, module, _ = _compiled("expressions", [(a, np.array([[0.5]])) for a in expressions])
    buffer, null = module.ffi.from_buffer, module.ffi.NULL
    others = (null,) * (3 if _VERSION < (0, 10) else 4)

    def adding(compiled):
        def add(numbers, results):
            given, into = buffer("double[]", numbers), buffer("double[]", results)
            step, size = numbers.shape[1], math.prod(results.shape[1:])
            for i in range(len(numbers)):
                compiled.tabulate_tensor_float64(into + i * size, null, given + i * step, *others)

        add.address = _address(compiled)
        return add

    return [adding(compiled) for compiled in found]


def kernel(form):
    """dolfinx's C++ object of a compiled form."""
    return getattr(form, "_cpp_object", form)


#: Number of arguments of a kernel of FFCx: (A, w, c, coordinates, entity, permutation), and later `custom_data`.
KERNEL_ARGUMENTS = 6 if _VERSION < (0, 10) else 7
#: Number of doubles that a kernel reads of the coordinates of one interval: its two ends, padded to three dimensions.
KERNEL_COORDINATES = 6


def kernel_address(form):
    """Address of the compiled kernel of a form's only integral, over all cells; valid as long as the form is kept.

    The kernel adds to A; w and c are the rows of dolfinx's `pack_coefficients` and `pack_constants`.
    """
    compiled = form.ufcx_form
    if hasattr(compiled, "form_integrals"):
        start, end = compiled.form_integral_offsets[0:2]
        integrals, count = compiled.form_integrals + start, end - start
    else:
        integrals, count = compiled.integrals(0), compiled.num_integrals(0)
    if count != 1:
        raise ValueError(f"form: has {count} integrals over cells, expected 1")
    return _address(integrals[0])


def expression_address(expression):
    """(address, Functions, Constants) of a compiled expression; valid as long as it is kept.

    Its kernel adds (points * components) values to A. w holds the values of the Functions on the cell, all of the first
    in the order of its dofs, then all of the next; c holds the values of the Constants in the same way.
    """
    return _address(expression.ufcx_expression), *_read(expression)


def _read(expression):
    """The Functions and the Constants of a compiled expression, in the order of its code."""
    if hasattr(expression, "read"):
        return expression.read
    compiled, of_ufl = expression.ufcx_expression, expression.ufl_expression
    functions = ufl.algorithms.extract_coefficients(of_ufl)
    used = [functions[compiled.original_coefficient_positions[i]] for i in range(compiled.num_coefficients)]
    return used, list(ufl.algorithms.analysis.extract_constants(of_ufl))


def _address(compiled):
    return int(_cffi_backend.FFI().cast("uintptr_t", compiled.tabulate_tensor_float64))  # cffi.FFI loads a C parser


def element_nodes(space):
    """Reference coordinates in [0, 1] of the nodes of a blocked Lagrange space, in the order of its cell dofs."""
    points = space.element.interpolation_points
    return (points() if callable(points) else points)[:, 0].copy()


def cell_nodes(space):
    """Local node (block) indices of every local cell of a space, (cells, nodes per cell); a rank may have none."""
    dofmap = space.dofmap
    cells = dofmap.list if hasattr(dofmap, "list") else dofmap.map()  # a space of Python's, or one of C++'s
    cells = cells() if callable(cells) else cells
    if not hasattr(cells, "array"):
        return cells
    return cells.array.reshape(cells.num_nodes, space.dofmap.dof_layout.num_dofs)


def cell_dofs(space):
    """(local elements, n) local degrees of freedom of every element of a space, node by node."""
    block, nodes = space.dofmap.index_map_bs, np.asarray(cell_nodes(space))
    return (nodes[:, :, None] * block + np.arange(block)).reshape(len(nodes), nodes.shape[1] * block)


def version():
    """Versions of dolfinx, PETSc, numpy and Python, for reports."""
    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    python = platform.python_version()
    return f"dolfinx {dolfinx.__version__}, PETSc {petsc}, numpy {np.__version__}, Python {python}"
