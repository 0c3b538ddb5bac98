"""One step of a moving model as PETSc wants it: residual and tangent in the solver's unknowns."""

from dolfinx import fem

from cosserat_fenicsx.algebra.equations import Equations
from cosserat_fenicsx.algebra.packed import Packed
from cosserat_fenicsx.dynamics.steppers.moving_ties import MovingTies


class StepProblem(Equations):
    """The equations of a step, whatever the scheme that made the model's forms.

    Args:
        model: see `models.moving.Moving` for the protocol.

    Attributes:
        see `Equations`; x is at the end of the step.
        fresh: whether the tangent is made anew when it is next asked for, or the one at hand serves on.
        h: the length of the step, dimensionless.
        load_factor: what all loads and prescribed motions are multiplied by.
    """

    ties_class = MovingTies

    def __init__(self, model):
        super().__init__(model)
        self._known, self._loads, self._momenta, self._vector = (self.numbering.vector() for _ in range(4))
        self._start = model.start.x.array
        self.load_factor, self.fresh = 1.0, True

    def _kind(self):
        return "general" if self.ties or self.model.comm.size > 1 else "blocks"

    def _ends(self):
        """The Functions that change from step to step, the state first: it alone changes within one."""
        return self.model.state, self.model.start, self.model.velocity

    def load(self, scene, layout, load_factor=1.0):
        """Take the numbers of a scene; the state becomes its reference configuration, at rest, at the time 0."""
        model = self.model
        model.load(scene, layout)
        self.load_factor = model.load_factor.value = load_factor
        self._pack()
        self._assemble(self._dead, self._loads)
        self._begun = False  # reactions of another scene are no guess
        self.begin()

    def _pack(self):
        """Take the numbers of a scene into all forms; what changes in time is looked up anew at every assembly."""
        forms, moving, (state, *beginning) = self.model.forms, tuple(self.model.moving_loads), self._ends()
        self._residual, self._tangent, self._live = (
            None if form is None else Packed(form, (state,), (*beginning, *moving))
            for form in (forms.residual, forms.tangent, forms.live)
        )
        self._momentum = Packed(forms.momentum, self._ends())
        self._dead = None if forms.dead is None else Packed(forms.dead, moving)

    def begin(self):
        """Take the model's state and velocity as the start of what follows."""
        multipliers = self.ties.everywhere() if self.ties and self._begun else None
        self.numbering.from_local(self._state, self.x)
        if multipliers is not None:
            self.ties.put(self.x, multipliers)
        self.set_state(self.x)
        self._start[:] = self._state
        self.fresh = self._begun = True

    def aim(self, t, h):
        """The next step goes from the time t (s), where the state is, to t + h."""
        model = self.model
        self.h = model.h.value = h / model.time
        self._start[:] = self._state
        self._take_loads(t + h / 2)
        self._assemble(self._momentum, self._momenta)
        self._known.set(0.0)
        self._known.axpy(model.time / h, self._momenta)
        self._known.axpy(self.load_factor, self._loads)
        if self.ties:
            self.ties.begin(model.ties_at(t + h))

    def _take_loads(self, t):
        """Loads as they are at the time t (s), and whatever else does not change within a step."""
        if self.model.moving_loads:
            self.model.loads_at(t)
            self._assemble(self._dead, self._loads)
        self._residual.catch_up()
        if self._live:
            self._live.catch_up()

    def guess(self, values):
        """Start Newton from local numbers of the state; reactions stay what they were."""
        multipliers = self.ties.everywhere() if self.ties else None
        self.numbering.from_local(values, self.x)
        if self.ties:
            self.ties.put(self.x, multipliers)

    def function(self, snes, x, b):
        """Residual at x for SNES."""
        self.set_state(x)
        self._put_stresses(x, b)
        b.axpy(-1.0, self._known)
        if self.ties:
            self.ties.add_residual(b, self.load_factor)

    def _put_stresses(self, x, b):
        """What of the residual depends on the state, but for added equations, into b."""
        self._assemble(self._residual, b)

    def jacobian(self, snes, x, A, P):
        """Tangent at the state that `function` was last called with; kept where it is not to be fresh."""
        if not self.fresh:
            return
        self.fresh = False
        P.zeroEntries()
        self._tangent.catch_up()
        self._tangent.add_to_matrix(P)
        if self.ties:
            self.ties.add_tangent(P, self.load_factor)
        P.assemble()

    def work(self):
        """What loads and supports did in the step from `start` to the state, dimensionless, over all ranks."""
        model, eta, done = self.model, self.load_factor, 0.0
        if self._live or self._loads.norm() > 0:
            self.numbering.from_local(model.passed(), self._vector)
            done = eta * self._loads.dot(self._vector)
        if self._live:
            self._assemble(self._live, self._known)
            done += eta * self._known.dot(self._vector)
        if self.ties:
            done += model.comm.allreduce(self.ties.work(eta))
        return done

    def momenta(self):
        """Linear and angular momentum of the state, see `Moving.momenta`."""
        self._local[:] = 0.0
        self._momentum.add_to_vector(self._local)
        return self.model.momenta(self._local)

    def dissipated(self):
        """What damping took in the step from `start` to the state, dimensionless, over all ranks; zero without damping."""
        return self._scalar(self.model.forms.dissipated) if self.model.damped else 0.0

    def energies(self):
        """Kinetic and strain energy of the state, dimensionless, over all ranks."""
        return tuple(self._scalar(form) for form in (self.model.forms.kinetic, self.model.forms.strain))

    def _scalar(self, form):
        return self.model.comm.allreduce(fem.assemble_scalar(form))

    def memory(self):
        """This rank's part of what the steps to come depend on; of a tangent that is kept, its entries."""
        kept = {"x": self.x.array_r.copy(), "state": self._state.copy(), "fresh": bool(self.fresh)}
        if not self.fresh:
            rows, columns, values = self.A.getValuesCSR()
            kept["tangent"] = {"rows": rows, "columns": columns, "values": values}
        return kept

    def recall(self, memory):
        """Take back what `memory` gave."""
        self._state[:] = memory["state"]
        self.x.array_w[:] = memory["x"]
        self.set_state(self.x)
        self.fresh = bool(memory["fresh"])
        if not self.fresh:
            tangent = memory["tangent"]
            self.A.setValuesCSR(tangent["rows"], tangent["columns"], tangent["values"])
            self.A.assemble()
