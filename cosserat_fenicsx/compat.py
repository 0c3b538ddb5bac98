"""Differences between releases of dolfinx and PETSc: the only module that depends on the installed versions.

Supported: dolfinx 0.5.2 (Debian 12), 0.9.0 (Debian 13), 0.11.0 (Debian's development branch) and those between.
All other modules call the functions below and contain no version checks.
"""

import contextlib
import logging
import math
import platform

import numpy as np

from cosserat_fenicsx import interrupts
from cosserat_fenicsx.errors import InstallationError
from cosserat_fenicsx.processor import instructions

_HOW_TO_INSTALL = (
    "Install it with the system's packages (Debian and Ubuntu: 'apt install python3-dolfinx', then run the "
    "interpreter that sees them, /usr/bin/python3 or a virtual environment made with --system-site-packages) "
    "or with conda ('conda install -c conda-forge fenics-dolfinx'). In a checkout, 'make setup' does it all."
)

try:
    import _cffi_backend
    import dolfinx
    import ufl
    from dolfinx import fem, jit
    from dolfinx import mesh as dolfinx_mesh
    from mpi4py import MPI
    from petsc4py import PETSc
except ImportError as missing:
    raise InstallationError(f"dolfinx cannot be imported ({missing}). {_HOW_TO_INSTALL}") from missing

interrupts.renew()

_VERSION = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])
if _VERSION < (0, 5):
    raise InstallationError(f"dolfinx {dolfinx.__version__} is too old: 0.5 or later is needed. {_HOW_TO_INSTALL}")


def require_real_scalars(scalar_type=PETSc.ScalarType):
    """Refuse a PETSc built for complex numbers: a rod's equilibrium is a real problem.

    Raises:
        InstallationError: PETSc's scalar is complex.
    """
    if "complex" in scalar_type.__name__:
        raise InstallationError(
            f"PETSc was built for complex numbers ({scalar_type.__name__}); cosserat_fenicsx needs the real build. "
            "On Debian: 'apt install python3-dolfinx-real' and unset PETSC_DIR and PETSC_ARCH."
        )


require_real_scalars()


_REASONS = PETSc.SNES.ConvergedReason
#: SNES's reason for a residual that is not a number.
RESIDUAL_NOT_A_NUMBER = (
    _REASONS.DIVERGED_FNORM_NAN if PETSc.Sys.getVersion() < (3, 25) else _REASONS.DIVERGED_FUNCTION_NANORINF
)


@contextlib.contextmanager
def quiet_compiler():
    """Silence the just-in-time compiler's log: 0.5 reports every build and cache look-up at INFO on the root logger."""
    before = logging.root.manager.disable
    logging.disable(max(before, logging.INFO))
    try:
        yield
    finally:
        logging.disable(before)


_JIT_DEFAULTS = getattr(jit, "DOLFINX_DEFAULT_JIT_OPTIONS", None) or jit.DOLFINX_DEFAULT_JIT_PARAMETERS


@contextlib.contextmanager
def waiting_for_compilers(seconds):
    """Wait so long (whole s) for another process that compiles the same form; None for dolfinx's own 10 s, unless the
    user has set a time."""
    before = _JIT_DEFAULTS["timeout"]
    if seconds is not None:
        _JIT_DEFAULTS["timeout"] = (seconds, before[1])
    try:
        yield
    finally:
        _JIT_DEFAULTS["timeout"] = before


if _VERSION < (0, 8):

    def lagrange(mesh, degree, size, *, discontinuous=False):
        """A Lagrange element with `size` components: nodes at the Gauss-Lobatto points, numbered node by node."""
        family = "Discontinuous Lagrange" if discontinuous else "Lagrange"
        return ufl.VectorElement(family, mesh.ufl_cell(), degree, dim=size)

    def at_quadrature_points(mesh, quadrature_degree, size):
        """An element whose `size`-component values live at the Gauss points of `quadrature_degree`."""
        return ufl.VectorElement("Quadrature", mesh.ufl_cell(), quadrature_degree, dim=size, quad_scheme="default")

    def mixed(*elements):
        """The product of several elements."""
        return ufl.MixedElement(*elements)

    def function_space(mesh, element):
        """The finite element space of `element` on `mesh`."""
        return fem.FunctionSpace(mesh, element)

    def interval_domain():
        """UFL's domain of a line, without a mesh."""
        cell = ufl.Cell("interval", geometric_dimension=1)
        # FFCx 0.5 gives the element this variant when it compiles: signatures before and after must be equal
        return ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1, variant="equispaced"))

    def create_interval_mesh(comm, cells, x):
        """A mesh of intervals on a line from `cells (n, 2)` and `x (m, 1)`, given on rank 0 alone."""
        return dolfinx_mesh.create_mesh(comm, cells, x, interval_domain())

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

else:
    import basix.ufl

    def lagrange(mesh, degree, size, *, discontinuous=False):
        """A Lagrange element with `size` components: nodes at the Gauss-Lobatto points, numbered node by node."""
        return basix.ufl.element(
            "Lagrange", mesh.basix_cell(), degree, shape=(size,), discontinuous=discontinuous or degree == 0
        )

    def at_quadrature_points(mesh, quadrature_degree, size):
        """An element whose `size`-component values live at the Gauss points of `quadrature_degree`."""
        return basix.ufl.quadrature_element(mesh.basix_cell(), value_shape=(size,), degree=quadrature_degree)

    def mixed(*elements):
        """The product of several elements."""
        return basix.ufl.mixed_element(list(elements))

    def function_space(mesh, element):
        """The finite element space of `element` on `mesh`."""
        return fem.functionspace(mesh, element)

    def interval_domain():
        """UFL's domain of a line, without a mesh."""
        return ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,)))

    def create_interval_mesh(comm, cells, x):
        """A mesh of intervals on a line from `cells (n, 2)` and `x (m, 1)`, given on rank 0 alone."""
        coordinates = basix.ufl.element("Lagrange", "interval", 1, shape=(1,))
        if _VERSION < (0, 10):
            return dolfinx_mesh.create_mesh(comm, cells, x, coordinates)
        return dolfinx_mesh.create_mesh(comm, cells, coordinates, x)

    def create_solid_mesh(comm, cells, x):
        """A mesh of second-order hexahedra from `cells (n, 27)`, in basix' order of nodes, and `x (m, 3)`."""
        coordinates = basix.ufl.element("Lagrange", "hexahedron", 2, shape=(3,))
        if _VERSION < (0, 10):
            return dolfinx_mesh.create_mesh(comm, cells, x, coordinates)
        return dolfinx_mesh.create_mesh(comm, cells, coordinates, x)

    def evaluate(expression, mesh, cells):
        """Values of a compiled expression in `cells`, shape (cells, points * components)."""
        values = expression.eval(mesh, cells)
        return values.reshape(len(cells), math.prod(values.shape[1:]))

    def geometry_dofs(mesh):
        """Indices into `mesh.geometry.x` of the two ends of every local cell, shape (cells, 2)."""
        return mesh.geometry.dofmap if _VERSION < (0, 11) else mesh.geometry.dofmaps[0]


def alias(function):
    """A second UFL coefficient that shares the values of `function`.

    FFCx treats a coefficient under a one-point quadrature rule as constant over the cell, and then uses that value for
    every other rule of the same form, too. A term with its own rule must therefore use another coefficient.
    """
    return fem.Function(function.function_space, function.x)


def form_for_speed(form):
    """A form compiled with more optimisation, for kernels that run very often: a tenth more to compile, and from a
    sixth to half of the running time less."""
    options = {"cffi_extra_compile_args": ["-O3", "-g0", *instructions()]}
    return fem.form(form, **{"jit_params" if _VERSION < (0, 6) else "jit_options": options})


#: Gives a function that compiles a communicator as its first argument: rank 0 calls it before the others.
rank_0_first = jit.mpi_jit_decorator


def on_rows(expression):
    """For `rank_0_first`: a compiled function (numbers, results) that adds the values of a UFL expression of the
    components of one ufl.Constant, for every row of `numbers` (m, components), to the rows of `results` (m, ..); both
    contiguous."""
    compiled, module, _ = jit.ffcx_jit(MPI.COMM_SELF, (expression, np.array([[0.5]])))
    call, buffer, null = compiled.tabulate_tensor_float64, module.ffi.from_buffer, module.ffi.NULL
    others = (null,) * (3 if _VERSION < (0, 10) else 4)

    def add(numbers, results):
        given, found = buffer("double[]", numbers), buffer("double[]", results)
        step, size = numbers.shape[1], math.prod(results.shape[1:])
        for i in range(len(numbers)):
            call(found + i * size, null, given + i * step, *others)

    return add


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
    in the order of its dofs, then all of the next; c holds the values of the Constants likewise.
    """
    compiled, of_ufl = expression.ufcx_expression, expression.ufl_expression
    functions = ufl.algorithms.extract_coefficients(of_ufl)
    positions = (compiled.original_coefficient_positions[i] for i in range(compiled.num_coefficients))
    constants = ufl.algorithms.analysis.extract_constants(of_ufl)
    return _address(compiled), [functions[i] for i in positions], list(constants)


def _address(compiled):
    return int(_cffi_backend.FFI().cast("uintptr_t", compiled.tabulate_tensor_float64))  # cffi.FFI loads a C parser


def element_nodes(space):
    """Reference coordinates in [0, 1] of the nodes of a blocked Lagrange space, in the order of its cell dofs."""
    points = space.element.interpolation_points
    return (points() if callable(points) else points)[:, 0].copy()


def cell_nodes(space):
    """Local node (block) indices of every local cell of a space, shape (cells, nodes per cell); a rank may have
    none."""
    dofmap = space.dofmap
    cells = dofmap.list if hasattr(dofmap, "list") else dofmap.map()  # a space of Python's, or one of C++'s
    cells = cells() if callable(cells) else cells
    if not hasattr(cells, "array"):
        return cells
    return cells.array.reshape(cells.num_nodes, space.dofmap.dof_layout.num_dofs)


def version():
    """Versions of dolfinx, PETSc, numpy and Python, for reports."""
    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    python = platform.python_version()
    return f"dolfinx {dolfinx.__version__}, PETSc {petsc}, numpy {np.__version__}, Python {python}"
