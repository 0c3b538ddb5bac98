"""Base of equilibrium and time step problems: residual, tangent and its inverse in C, with hooks in Python."""

import contextlib
import weakref
from functools import cache

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.algebra.building import Pointers, module
from cosserat_fenicsx.algebra.elimination import condensed

#: Hooks: requests of C to Python, see newton.c.
STATE, RESIDUAL, TANGENT, INTERFACE, ADD_UP, SUM, MATRICES, COUNT, CONTACT, NODES, MAPS = (1 << k for k in range(11))


@cache
def _hook():
    """Let C call `Called._answer`."""
    ffi, _ = module()

    def keep(kind, failure, trace):  # C cannot pass it on; Ctrl-C is raised here as soon as Python is entered
        ffi.from_handle(trace.tb_frame.f_locals["owner"])().failure = failure.with_traceback(trace)

    @ffi.def_extern(name="python_hook", error=1, onerror=keep)
    def hook(owner, what, a, b):
        """See `hook` in newton.c: 0, or 1 after an exception, which is kept."""
        ffi.from_handle(owner)()._answer(what, a, b)
        return 0

    return hook


class Called(Pointers):
    """An object whose hooks C calls; failure: the exception raised by the last hook, if any."""

    def __init__(self):
        super().__init__()
        _hook()
        self._handle, self.failure = self._ffi.new_handle(weakref.ref(self)), None

    def raise_failure(self):
        """Raise the exception that was kept, if any."""
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure

    def _answer(self, what, a, b):
        raise NotImplementedError


class Equations(Called):
    """Residual and tangent of a model (`models.base.RodModel`) in the solver's unknowns; hooks: those of STATE,
    RESIDUAL and MATRICES that a subclass needs in addition; c: the C structure `problem`.

    x, b: unknowns, residual; the model's state follows x. load_factor_array: of one value, the factor of loads and
    prescribed motions; ties: the `TieRows` of supports and joints, or None; elimination, interface: of the `Packed`
    tangent_form, the latter None where nothing is left.
    """

    #: the class of `ties`, called with (model, numbering, handle of hooks)
    ties_class = None

    def __init__(self, model, hooks=0):
        super().__init__()
        self.model, self.numbering = model, model.numbering
        numbering = self.numbering
        self.ties = self.ties_class(model, numbering, self._handle) if model.signature.connections.ties else None
        tied = self.ties.rows if self.ties else np.empty((0, numbering.block), dtype=np.int64)
        self.elimination, self.interface = condensed(
            model, numbering, model.cell_dofs, tied, delays=model.force_is_unknown
        )
        self.x, self.b = numbering.vector(), numbering.vector()
        self._vector_of_x = numbering.vector()  # for transfers between ranks
        self._state = model.state.x.array
        # written in place: the setter of a constant's `value` takes as long as a residual of few elements
        self.load_factor_array = model.load_factor.value
        self._local = np.zeros(len(numbering.rows))
        self._fill(hooks)

    def _fill(self, hooks):
        model, numbering, ffi = self.model, self.numbering, self._ffi
        serial = numbering.comm.size == 1
        hooks |= (STATE | ADD_UP | SUM) * (not serial)
        system = serial and self.interface and self.interface.dense
        hooks |= (TANGENT | INTERFACE) * bool(self.interface and not system)
        self.c = problem = ffi.new("problem *")
        problem.self, problem.hooks, problem.serial, problem.chain = self._handle, hooks, serial, self.elimination.c
        problem.size, problem.locals, problem.frees = numbering.size, len(self._local), len(numbering.free)
        problem.free, problem.of_free = self.integers(numbering.free), self.integers(numbering.of_free)
        problem.local = self.doubles(self._local)
        problem.system, problem.ties = system or ffi.NULL, self.ties.c if self.ties else ffi.NULL
        problem.tie_load_factor = self.doubles(self.load_factor_array)
        if hooks & MATRICES:
            #: (elements, n, n) where MATRICES is among the hooks
            self.matrices = np.zeros((*model.cell_dofs.shape, model.cell_dofs.shape[1]))
            problem.matrices = self.doubles(self.matrices)
        for name in ("state", "before", "step"):
            setattr(problem, name, self.doubles(getattr(model, name).x.array))
        mine = self.elimination.interface - numbering.first
        here = np.full(self.elimination.unknowns, -1)
        here[: len(mine)] = np.where((mine >= 0) & (mine < numbering.size), mine, -1)
        self._on_interface = np.zeros(len(here))
        problem.interfaces, problem.of_interface = len(here), self.integers(here)
        problem.interface = self.doubles(self._on_interface)

    def take_forms(self, residual, tangent, advance=None):
        """Set the `Packed` residual and tangent, and the `PackedExpression` of the carried contact force or None."""
        problem = self.c
        self._residual, self.tangent_form, self._advance = residual, tangent, advance
        problem.residual, problem.tangent, problem.dofs = residual.c, tangent.c, residual.dofs_c
        if advance:
            problem.advance = advance.c
            (carried,) = self.model.carried
            problem.carried, problem.carries = self.doubles(carried.x.array), len(carried.x.array)
            problem.advance_dofs = self.integers(self.model.carried_dofs)

    def take_loads(self, *loads):
        """Set up to three (vector, array of its factor) to subtract from the residual."""
        for k, (vector, factor) in enumerate(loads):
            self.c.load[k], self.c.factor[k] = self.doubles(vector), self.doubles(factor)

    @property
    def tie_load_factor(self):
        """The load factor of prescribed motions; 0 while permanent loads are applied, before all others."""
        return float(self.load_factor_array)

    # -- for solvers -------------------------------------------------------------------------------------------------

    def function(self, x, b):
        """b = the residual at x; the state follows."""
        self._done(self._lib.residual(self.c, self._read(x), self._written(b)))

    def factor(self):
        """Factors of the tangent at the state that `function` was last called with."""
        self._done(self._lib.tangent(self.c))

    def solve(self, b, x):
        """x = tangent^-1 b; False where the last tangent is singular."""
        self._done(self._lib.solve(self.c, self._read(b), self._written(x)))
        return not self.c.singular

    def corrected(self):
        """Context manager: `solve` may be less exact, as Newton's method corrects what it leaves."""
        return self.interface.corrected() if self.interface else contextlib.nullcontext()

    def advance(self):
        """Update the contact force that is carried at the Gauss points by the step from `model.before` to the state."""
        self._lib.advance(self.c)

    def set_state(self, x):
        """Copy a vector of unknowns into the model's state, ghosts included."""
        self._done(self._lib.take_state(self.c, self._read(x)))

    def _read(self, vector):
        return self._ffi.from_buffer("double[]", vector.array_r)

    def _written(self, vector):
        return self._ffi.from_buffer("double[]", vector.array_w)

    def _done(self, failed):
        self.raise_failure()
        if failed:
            raise MemoryError("C code of algebra/newton.c failed")

    def memory(self):
        """The factors of the tangent, as arrays."""
        interface = {"interface": self.interface.memory()} if self.interface else {}
        return self.elimination.memory() | interface

    def recall(self, memory):
        """Restore what `memory` returned."""
        self.elimination.recall(memory)
        if self.interface:
            self.interface.recall(memory["interface"])
        self.c.singular = 0

    # -- hooks -------------------------------------------------------------------------------------------------------

    def _answer(self, what, a, b):
        numbering, ties = self.numbering, self.ties
        if what == STATE:
            x = self._array(a, numbering.size)
            if numbering.comm.size > 1:
                self._vector_of_x.array_w[:] = x
                numbering.to_local(self._vector_of_x, self._state)
                if ties:
                    ties.see(x)
            if b:
                self._refresh()
        elif what == RESIDUAL:
            self._change_residual(self._array(a, numbering.size), self._array(b, numbering.size))
        elif what == TANGENT:
            self._factor_interface()
        elif what == INTERFACE:
            self._solve_interface()
        elif what == ADD_UP:
            numbering.add_up(self._local, self._vector_of_x)
            self._array(b, numbering.size)[:] = self._vector_of_x.array_r
        elif what == SUM:
            self._array(a, 1)[0] = numbering.comm.allreduce(float(a[0]))
        elif what == CONTACT:
            self._touch(self._array(a, numbering.size), self._array(b, numbering.size))
        elif what == MAPS:
            shape = ties.nodal.shape
            forces = self._array(b, 6 * shape[0]).reshape(-1, 6)
            ties.find_maps(self._array(a, ties.nodal.size).reshape(shape), forces)
        elif what == NODES:
            numbering.comm.Allreduce(MPI.IN_PLACE, self._array(a, 7 * self.contact.count))
        else:
            self._change_matrices()

    def _array(self, pointer, size):
        return np.frombuffer(self._ffi.buffer(pointer, 8 * size))

    def _refresh(self):
        """Update what depends on the state, before it is evaluated."""

    def _change_residual(self, x, b):
        """Change the residual b at x, arrays of this rank's unknowns."""

    def _touch(self, x, change):
        """Where laws act at nodes: change Newton's step, which is subtracted from x; arrays of this rank's unknowns."""

    def _change_matrices(self):
        """Change `matrices`, of the elements."""

    def _factor_interface(self):
        comm = self.numbering.comm
        singular = comm.allreduce(self.c.singular, op=MPI.MAX) if comm.size > 1 else self.c.singular
        of_ties = self.ties.tangent_blocks(self.tie_load_factor) if self.ties and not singular else (np.empty(0),)
        self.c.singular = 1 if singular else not self.interface.factor(*of_ties)

    def _solve_interface(self):
        b, comm = self._on_interface, self.numbering.comm
        if comm.size > 1:
            comm.Allreduce(MPI.IN_PLACE, b)
        if not self.c.singular:
            self.interface.solve(b)

    # -- for results -------------------------------------------------------------------------------------------------

    def _assemble(self, form, vector):
        """Assemble a packed form into a solver's vector; None gives zero."""
        self._local[:] = 0.0
        if form:
            form.add_to_vector(self._local)
        self.numbering.add_up(self._local, vector)

    def tie_forces(self):
        """(ties, 2, 6) inertial force and moment of every tie on its stations, on all ranks; zero for the ground."""
        return self.ties.forces(self.tie_load_factor) if self.ties else np.empty((0, 2, 6))

    def at_ties(self, x, load_factors):
        """(multipliers (n, ties), `tie_forces` (n, ties, 2, 6)) at unknowns x (n, size) and load factors (n,)."""
        return self.ties.along(x, load_factors) if self.ties else (np.empty((len(x), 0)), np.empty((len(x), 0, 2, 6)))

    def multipliers(self):
        """Multipliers (reactions) of the constraint equations, on all ranks."""
        return self.ties.everywhere() if self.ties else np.empty(0)
