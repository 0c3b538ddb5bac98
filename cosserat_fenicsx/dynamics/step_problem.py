"""Residual and tangent of one time step of a moving model in the solver's unknowns; the constraints of supports and
joints hold at its end, and their reactions act at mid-step.

At a node one action with `Action.resists` may have a law: of a force along a direction and a torque about the rod's
axis, set-valued, such as those of a bit on rock.

As walls do, it acts on the compliance of the moving rods: the motion of the node in a step is a linear function of
force and torque, by the tangent of Newton's method, and with it the law is solved exactly before Newton's step is
taken. So the node sticks as long as a torque up to the static one can keep it.

A node that is held in a step would swing about rest from then on, since its velocity at the end is twice the mean one
less that at the start. An impulse on the node alone, whose mass is its own, stops it before the next step; what that
takes of the kinetic energy counts as dissipated.
"""

import numpy as np
from dolfinx import fem

from cosserat_fenicsx.algebra.building import MANY_IN_MOTION, Packed, take_together
from cosserat_fenicsx.algebra.equations import CONTACT, NODES, RESIDUAL, STATE, Equations
from cosserat_fenicsx.algebra.tie_rows import TieRows
from cosserat_fenicsx.dynamics.contact import NodalContact, TouchingNodes, motion_between
from cosserat_fenicsx.dynamics.touching import RodsTouching
from cosserat_fenicsx.numerics import directors, small_rotations
from cosserat_fenicsx.statics.tensions import ThreadLengths


class MovingTies(TieRows):
    """See `TieRows`. Reactions along the directions at mid-step keep order 2, and do no work in a rigid rotation."""

    share = 0.5

    def begin(self, ties):
        """Start a step at the current state; `ties` are the constraints at its end."""
        self._start[:] = self.nodal
        self.take(ties)

    def work(self, load_factor):
        """Work of the reactions on the structure in the step, dimensionless; on the last rank, else 0."""
        if not self._here:
            return 0.0
        nodal, reactions = self.nodal, self.reactions(load_factor, self._acted())
        trial, _ = self.model.tie_maps((nodal + self._start) / 2)
        passed = trial @ (nodal - self._start)[:, :, None]
        return -float(reactions.ravel() @ passed.ravel())

    def _acted(self):
        """The multipliers that `work` takes."""
        return self.multipliers


class TensionsInSteps(ThreadLengths):
    """Tensions of tendons of given length in the steps of a `StepProblem`; methods as of `NodalContact`.

    A tendon of the length l has the energy k max(l - l_0, 0)^2/2, with k = EA/l_0 and l_0 its length without tension,
    of the time when loads are evaluated. The tension of a step is the change of this energy over that of l, so that
    slack and taut are one law, and smooth; in schemes whose equations hold at the end of a step it is the tension
    there. It acts in the form of a `Tendon` of given tension, whose work the books of a step then have.

    A tension depends on all nodes of a rod, which the tangent does not know. Newton's step for given tensions is
    completed: with the responses R of the motion to unit tensions and the derivatives A of the lengths, the tensions
    change by t with

        (1 + f' A R) t = f - f' A d - T

    where d is the step for the given tensions T, subtracted from the unknowns, f the law and f' its derivative.
    """

    def load(self):
        super().load()
        self._changed = self._problem.numbering.vector()

    def begin(self, h):
        problem = self._problem
        self._left = self.left_at(problem.loaded_at, problem.load_factor)
        self._before, self._answers = self._lengths(self._length), None

    def add_forces(self, b):
        """They are in the forms."""

    def _mean(self, after):
        """Changes of the energies over changes of the lengths, to those `after` the step, and their derivatives."""
        begun, ended = np.maximum(self._before - self._left, 0.0), np.maximum(after - self._left, 0.0)
        k, moved, rise = 1 / (self._softness * self._left), after - self._before, ended - begun
        taut = (begun > 0) & (ended > 0) | (moved == 0)
        share = np.where(taut, ended > 0, rise / np.where(taut, 1.0, moved))  # of the motion in which it is taut
        slope = np.where(ended > 0, share * (1 - share / 2), share**2 / 2)
        return k * (begun + ended) / 2 * share, k * slope

    def _law(self, lengths):
        if self._problem.acting_share < 1:
            return self._mean(lengths)
        k, more = 1 / (self._softness * self._left), lengths - self._left
        return k * np.maximum(more, 0.0), k * (more > 0)

    def meet(self, x, change):
        """Change Newton's step so that the laws hold after it."""
        force, slope = self._law(self._lengths(self._length))
        if not (force.any() or slope.any() or self.values.any()):
            return
        if self._answers is None:
            self._answers = self._found_answers()
        answers, compliance = self._answers
        self._changed.array_w[:] = change
        missing = force - slope * self._changes(self._changed) - self.values
        more = np.linalg.solve(np.eye(len(missing)) + slope[:, None] * compliance, missing)
        change += more @ answers
        self.put(self.values + more)

    def _found_answers(self):
        """(tendons, unknowns) by unit tensions, and (tendons, tendons) of lengths, by the first tangent of a step."""
        problem, own, found = self._problem, self.values, []
        without, column = self._columns[0], problem.numbering.vector()
        problem.function(problem.x, without)
        for unit, response in zip(np.eye(len(own)), self._responses, strict=True):
            self._fill(own + unit)
            problem.function(problem.x, column)
            column.axpy(-1.0, without)
            problem.solve(column, response)
            found.append(response.array_r.copy())
        self._fill(own)
        problem.function(problem.x, without)
        lengths = [self._changes(response) for response in self._responses]
        return np.array(found), np.transpose(lengths)

    def give_up(self):
        """The step has failed; tensions are initial guesses alone."""

    accept = give_up

    def books(self):
        """They have the work of the tensions already."""
        return 0.0, 0.0

    def here(self, t):
        """(tendons,) tensions at the state, at a time (s)."""
        left = self.left_at(t, self._problem.load_factor)
        return np.maximum(self._lengths(self._length) - left, 0.0) / (self._softness * left)

    def halfway(self, t):
        """Take the tensions whose work is that of the step of the middle t (s); returns those before."""
        own, self._left = self.values, self.left_at(t, self._problem.load_factor)
        self.put(self._mean(self._lengths(self._length))[0])
        return own

    def memory(self):
        return {"tensions": self.values.copy()}

    def recall(self, memory):
        self.put(memory["tensions"])


class SlippingInSteps:
    """Threads with friction in the steps of a `StepProblem`; methods as of `NodalContact`.

    Their tensions are those at the state where actions act in a step: the end, or the middle, from middle to middle
    then. They are data of the form of a `Tendon`, whose work the books of a step have, that of friction included.
    """

    def __init__(self, problem):
        self._problem = problem
        self._column, self._without, self._vector = (problem.numbering.vector() for _ in range(3))

    def load(self):
        """Take the threads of the scene that the model was loaded with."""
        model = self._problem.model
        factors = {"load": self._problem.load_factor, "permanent": 1.0}
        found = {id(x.action): (x, factors[term.kind.scaled]) for term, xs in model.actions.sliding for x in xs}
        self._threads = [found[id(action)] for action in model.scene.actions if action.rough]
        self.start([0.0] * len(self._threads))

    def start(self, pulls):
        """Begin a motion at the state, where threads have slid with tensions (N) of their pulled ends."""
        for (thread, factor), pull in zip(self._threads, pulls, strict=True):
            thread.let_stick(pull, factor)

    def _changes(self, vectors):
        """(k, tensions) changes of the tensions with k changes of the solver's unknowns."""
        moved = np.zeros((len(vectors), len(self._problem.state)))
        for vector, local in zip(vectors, moved, strict=True):
            self._vector.array_w[:] = vector
            self._problem.numbering.to_local(self._vector, local)
        moved *= self._problem.acting_share
        return np.concatenate([thread.change(moved).reshape(len(moved), -1) for thread, _ in self._threads], axis=1)

    def _found_answers(self):
        """(tensions, unknowns) by unit tensions, by the first tangent of a step."""
        problem, found = self._problem, []
        problem.function(problem.x, self._without)
        for thread, _ in self._threads:
            for k in range(thread.tensions.size):
                unit = np.zeros(thread.tensions.size)
                unit[k] = 1.0
                thread.keep(thread.tensions + unit.reshape(thread.tensions.shape))
                problem.function(problem.x, self._column)
                self._column.axpy(-1.0, self._without)
                problem.solve(self._column, self._vector)
                found.append(self._vector.array_r.copy())
            thread.keep(None)
        problem.function(problem.x, self._without)
        return np.array(found)

    def begin(self, h):
        self._answers = None

    def add_forces(self, b):
        """They are in the forms."""

    def meet(self, x, change):
        """Change Newton's step so that the tensions follow it."""
        if self._answers is None:
            self._answers = self._found_answers()
        free, *follow = self._changes([change, *self._answers])
        change -= np.linalg.solve(np.eye(len(free)) + np.transpose(follow), free) @ self._answers

    def give_up(self):
        """Nothing was accepted."""

    def accept(self):
        self._problem.take_where_it_acts()
        for thread, _ in self._threads:
            thread.accept()

    def books(self):
        """They have the work of the tensions already."""
        return 0.0, 0.0

    def here(self, t):
        """[(n,) tensions at the Gauss points] at the state, at a time (s)."""
        return [factor * thread.here(t).ravel() for thread, factor in self._threads]

    def memory(self):
        return {"held": [thread.held for thread, _ in self._threads]}

    def recall(self, memory):
        for (thread, _), held in zip(self._threads, memory["held"], strict=True):
            thread.held = tuple(held)


class StepProblem(Equations):
    """The equations of a step, whatever the scheme that made the forms of its model (`models.moving.Moving`); see
    `Equations`; x is the state at the end of the step.

    fresh: whether the next iteration takes a new tangent; h: the length of the step, dimensionless; load_factor:
    multiplies all loads and prescribed motions; loaded_at: time (s) of the loads of the step; tensions: the
    `TensionsInSteps` of tendons of given length, slipping: the `SlippingInSteps` of those with friction, or None.
    """

    ties_class = MovingTies
    #: see `Equations`
    changes = 0
    #: where actions act, from the start (0) to the end (1) of a step; and where loads are evaluated
    acting_share = loads_share = 0.5
    #: whether the momentum at the start of a step is part of its equations
    takes_momentum = True

    def __init__(self, model):
        self._refreshes = bool(model.actions.refreshed)
        super().__init__(model, self.changes | STATE * self._refreshes)
        self._known, self._loads, self._vector = (self.numbering.vector() for _ in range(3))
        self.take_loads((self._known.array, np.ones(1)))
        self._start = model.start.x.array
        self.load_factor, self.fresh, self.contact, self.touching, self._laws = 1.0, True, None, [], []
        self._at_stations = []
        self.rods_touching, self.tensions = None, TensionsInSteps(self) if model.actions.tensions else None
        self.slipping = SlippingInSteps(self) if any(term.kind.slides for term in model.actions.terms) else None
        self._hooks = self.c.hooks
        self._pack()

    def load(self, scene, layout, load_factor=1.0):
        """Load the data of a scene; the state becomes its reference configuration, at rest, at the time 0."""
        model = self.model
        model.load(scene, layout)
        if self.ties:
            self.ties.load()
        self.load_factor = model.load_factor.value = load_factor
        for packed in self._packed:
            packed.refresh()
        self._assemble_loads()
        walls = [action for action in scene.actions if action.touches]
        self.contact = NodalContact(self, walls, at_end=self.acting_share == 1) if walls else None
        self._at_stations = [StationLaw(self, action) for action in scene.actions if action.resists]
        self.rods_touching = RodsTouching(self) if scene.rod_contact else None
        threads = [*filter(None, [self.tensions, self.slipping])]
        for found in threads:
            found.load()
        self._laws = [*threads, *self._at_stations, *filter(None, [self.rods_touching])]
        self.touching = [self.contact, *self._laws] if walls else self._laws
        self.c.contact = self.contact.c if walls else self._ffi.NULL
        of_contact = NODES * (model.comm.size > 1) * bool(walls)
        self.c.hooks = self._hooks | (CONTACT | RESIDUAL) * bool(self._laws) | of_contact
        self._law_moves = any(term.moves and term.kind.place == "law" for term in model.actions.terms)
        self._carries = any(term.moves and term.memory for term in model.actions.terms)
        self._begun = False  # the reactions of another scene are no initial guess
        self.begin()

    def _pack(self):
        """Pack all forms, whose data are those of any scene of the signature."""
        forms, self._packed = self.model.forms, []
        self.take_forms(self._pack_form(forms.residual), self._pack_form(forms.tangent))
        self._live, self._momentum, self._dead, self._permanent = (
            self._pack_form(form) for form in (forms.live, forms.momentum, forms.dead, forms.permanent)
        )
        if sum(self.model.signature.counts) >= MANY_IN_MOTION:
            take_together(self._residual, self._momentum)

    def _pack_form(self, form):
        """A form, or the sum of a tuple of forms, for assembly, with data that may change in time; None for None."""
        if not form:
            return None
        model, actions = self.model, self.model.actions
        moving = (*model.ends, *actions.data, *actions.memory_functions)
        self._packed.append(Packed(form, moving, model.constants))
        return self._packed[-1]

    def _refresh(self, share=None):
        """Evaluate data that depend on the position, at this share of the step."""
        if not self._refreshes:
            return
        share = self.acting_share if share is None else share
        end = self._state.copy()
        self._state[:] = (1 - share) * self._start + share * end
        self.model.actions.refresh()
        self._state[:] = end

    @property
    def state(self):
        return self._state

    def begin(self):
        """Use the model's current state and velocity as the start of the next step."""
        multipliers = self.ties.everywhere() if self.ties and self._begun else None
        self.numbering.from_local(self._state, self.x)
        if multipliers is not None:
            self.ties.put(self.x, multipliers)
        self.set_state(self.x)
        self._start[:] = self._state
        self.fresh = self._begun = True

    def begin_again(self):
        """Give up the last step: the state is that at its start."""
        for part in self.touching:
            part.give_up()
        self.begin()

    def begin_step(self, t, h):
        """Prepare the step from the time t (s), that of the current state, to t + h."""
        model = self.model
        self.h = model.h.value = h / model.time
        self._start[:] = self._state
        self.loaded_at, self._middle, self._until = t + self.loads_share * h, t + h / 2, t + h
        self._of_law = self._work_of_law(t, self._middle)
        self._take_loads(self.loaded_at)
        self._known.set(0.0)
        for law in self._at_stations:
            law.settle()
        if self.takes_momentum:
            self._assemble(self._momentum, self._known)
            self._known.scale(1 / self.h)
        self._known.axpy(1.0, self._loads)
        if self.ties:
            self.ties.begin(model.ties_at(t + h))
        for part in self.touching:
            part.begin(self.h)

    def _change_residual(self, x, b):
        super()._change_residual(x, b)
        for law in self._laws:
            law.add_forces(b)

    def _touch(self, x, change):
        for law in self._laws:
            law.meet(x, change)

    def _take_loads(self, t):
        """Evaluate the loads at the time t (s)."""
        self._acting_at = t
        model = self.model
        if model.actions.move and (model.loads_at(t) or model.comm.size > 1):  # all ranks, or none
            self._assemble_loads()

    def _work_of_law(self, t, until):
        """The work of actions in the law from the time t to another (s), whose data stay: its energy's change."""
        if not self._law_moves:
            return 0.0
        energies = []
        for time in (t, until):
            self._take_loads(time)
            energies.append(self._scalar(self.model.forms.strain))
        return energies[1] - energies[0]

    def _assemble_loads(self):
        """Assemble the loads that do not depend on the state, times the load factor, or unscaled where permanent."""
        self._assemble(self._dead, self._loads)
        self._loads.scale(self.load_factor)
        if self._permanent:
            self._assemble(self._permanent, self._vector)
            self._loads.axpy(1.0, self._vector)

    def guess(self, values):
        """Set the initial guess of Newton's method to local values of the state; reactions are kept."""
        multipliers = self.ties.everywhere() if self.ties else None
        self.numbering.from_local(values, self.x)
        if self.ties:
            self.ties.put(self.x, multipliers)

    def stepping(self, start, **numbers):
        """The C structure `stepping` for `iterate`: Newton's method from `x`; start: the unknowns before the step."""
        found, self._increment = self._ffi.new("stepping *", numbers), self.numbering.vector()
        found.problem, found.start = self.c, self.doubles(start)
        vectors = {"x": self.x, "b": self.b, "change": self._increment}
        for name, vector in vectors.items():
            setattr(found, name, self.doubles(vector.array))
        found.turning = self.numbering.nodes * (self.numbering.block == 7)
        if found.turning and not self.ties:
            self.c.now, self._turned = found.x, np.zeros(7 * self.numbering.nodes)
            self.c.turned, self.c.turns = self.doubles(self._turned), self.numbering.nodes
        return found

    def iterate(self, stepping):
        """Newton's method from the current guess; the state follows `x`."""
        self._done(self._lib.iterate(stepping))

    def work(self):
        """Work of loads, supports and actions in the law in the step from `start` to the state, dimensionless, over all
        ranks; data of the actions in the law are then those at the end of the step."""
        model, load_factor, done = self.model, self.load_factor, 0.0
        if self._live or self._loads.norm() > 0:
            self.numbering.from_local(self._passed(), self._vector)
            done = self._loads.dot(self._vector)
        if self._live:
            self._refresh(0.5)
            self._assemble(self._live, self._known)
            done -= self._known.dot(self._vector)
        if self.ties:
            done += model.comm.allreduce(self.ties.work(load_factor))
        done += self._of_law + self._work_of_law(self._middle, self._until)
        return done - sum(part.books()[0] for part in self.touching)

    def _passed(self):
        """(local degrees of freedom,) the step from `start` to the state in the components of the test functions, so
        that its product with a load vector is work: displacements, and small rotations."""
        found = self._state - self._start
        if self.numbering.block == 7:
            arrays = (self._ffi.from_buffer("double[]", array) for array in (self._start, self._state, found))
            self._lib.find_motion(len(found) // 7, 7, *arrays)
        return found

    def multipliers_at(self, t):
        """`multipliers`, then the tensions of tendons at the state, of the time t (s): of those with friction at the
        Gauss points, and of those of given length."""
        slipping, tensions = self.slipping.here(t) if self.slipping else [], self.tensions
        return np.concatenate([self.multipliers(), *slipping, *([tensions.here(t)] if tensions else [])])

    def take_where_it_acts(self):
        """Evaluate data that depend on time or on the position where the actions of the step just solved act."""
        self._take_loads(self.loaded_at)
        self._refresh()

    def momenta(self):
        """Linear and angular momentum of the state, see `Moving.momenta`."""
        self._local[:] = 0.0
        self._momentum.add_to_vector(self._local)
        return self.model.momenta(self._local)

    def dissipated(self):
        """Energy dissipated by damping in the step from `start` to the state, dimensionless, over all ranks."""
        lost = self._scalar(self.model.forms.dissipated) if self.model.damped else 0.0
        return lost + sum(part.books()[1] for part in self.touching)

    def accept(self):
        """Accept the step; after its energies are recorded."""
        self.model.accept(self.h)
        if self._carries:
            self._take_loads(self._until)
        self.model.actions.commit()
        if self._carries:
            self._take_loads(self.loaded_at)
        for part in self.touching:
            part.accept()

    def energies(self):
        """Kinetic and strain energy of the state, dimensionless, over all ranks."""
        return tuple(self._scalar(form) for form in (self.model.forms.kinetic, self.model.forms.strain))

    def _scalar(self, form):
        return self.model.comm.allreduce(fem.assemble_scalar(form))

    def clamp_forces(self):
        """(points, 6) force and moment that held every clamped point in the last step; on all ranks."""
        clamps = self.model.clamps
        if not clamps.count:
            return np.empty((0, 6))
        if self._law_moves:
            self._take_loads(self.loaded_at)
        return clamps.of_step() - clamps.loads(self.load_factor, self._acting_at)

    def memory(self):
        """This rank's part of the data that later steps depend on, with a tangent in use."""
        kept = {"x": self.x.array_r.copy(), "state": self._state.copy(), "fresh": bool(self.fresh)}
        if not self.fresh:
            kept["tangent"] = super().memory()
            if self.c.turns:
                kept["turned"] = self._turned.copy()
        for i, part in enumerate(self.touching):
            kept[f"touching {i}"] = part.memory()
        return kept

    def recall(self, memory):
        self._state[:] = memory["state"]
        self.x.array_w[:] = memory["x"]
        self.set_state(self.x)
        self.fresh = bool(memory["fresh"])
        if not self.fresh:
            super().recall(memory["tangent"])
            if self.c.turns:
                self._turned[:] = memory["turned"]
        for i, part in enumerate(self.touching):
            part.recall(memory[f"touching {i}"])


class StationLaw:
    """The law of an action in a loaded `StepProblem`; its methods are those of `NodalContact`, and `settle`."""

    def __init__(self, problem, action):
        self._problem, model = problem, problem.model
        slot = model.slot_of(action.station)
        self._nodes = TouchingNodes(problem, np.array([slot]))
        self._dofs = model.nodal[np.flatnonzero(model.slots == slot)]  # with those of other ranks' nodes
        self._law, self._time, scales = model.delays.of(action), model.time, model.scales
        #: units of motion (m, 1) and of force and torque (N, N m)
        self._motions, self._units = np.array([scales.length, 1.0]), scales.force * np.array([1.0, scales.length])
        self._forces, self._axis, self._responses = np.zeros(2), self._law.axis, None
        # energy of impulses that is not yet in the books, and of those in the books of the last step, if it is accepted
        self._stopped, self._booked = 0.0, None

    def settle(self):
        """Stop a held node, see the module; before a step is begun. Schemes with accelerations keep it as it is."""
        along, about = self._law.held
        problem = self._problem
        if not (along or about) or not problem.takes_momentum and problem.acting_share == 1:
            return
        model = problem.model
        w, rates = (self._nodes.of_local(x)[0] for x in (problem.state, model.velocity.x.array))
        turning = small_rotations(w[3:])
        axis = directors(w[None, 3:] / np.linalg.norm(w[3:]))[0] @ self._law.axis
        speeds = rates[:3] @ self._law.down * along, turning @ rates[3:] @ axis * about
        if not any(speeds):
            return
        before = problem.energies()[0]
        more = np.concatenate([-speeds[0] * self._law.down, -speeds[1] / 4 * axis @ turning])
        model.velocity.x.array[self._dofs] += more
        self._stopped += before - problem.energies()[0]

    def begin(self, h):
        self._before = self._nodes.of_local(self._problem.state)
        self._begun, self._responses, self._booked = self._forces, None, None
        self._law.start(h * self._time)

    def accept(self):
        self._booked, self._stopped = self._stopped, 0.0

    def give_up(self):
        self._forces = self._begun
        if self._booked is not None:
            self._stopped, self._booked = self._booked, None

    def _acting(self, forces):
        """(1, 6) of force and torque against the motion."""
        return -np.concatenate([forces[0] * self._law.down, forces[1] * self._axis])[None]

    def add_forces(self, b):
        self._nodes.subtract(self._acting(self._forces), b)

    def _motion(self, after):
        """(2,) motion along the direction and about the axis in the step, and the axis in its middle."""
        middle = (self._before + after)[0, 3:]
        self._axis = directors(middle[None] / np.linalg.norm(middle))[0] @ self._law.axis
        moved = motion_between(self._before, after)[0]
        return np.array([moved[:3] @ self._law.down, moved[3:] @ self._axis])

    def meet(self, x, change):
        after = self._nodes.unknowns(x, change)
        moved = self._motion(after)
        if self._responses is None:
            self._responses = [self._nodes.response(-self._acting(unit)).copy() for unit in np.eye(2)]
            turning, columns = small_rotations(after[0, 3:]), []
            for response in self._responses:
                found = self._nodes.of_vector(response)[0]
                columns.append([found[:3] @ self._law.down, turning @ found[3:] @ self._axis])
            self._compliance = np.transpose(columns)
        before = self._forces
        free = self._motions * (moved + self._compliance @ before)
        self._forces = self._law.forces(free, self._motions[:, None] * self._compliance / self._units) / self._units
        for response, more in zip(self._responses, self._forces - before, strict=True):
            change += response * more

    def books(self):
        moved = self._motion(self._nodes.of_local(self._problem.state))
        return 0.0, self._stopped + float(self._forces @ moved)

    def memory(self):
        return {"forces": np.array(self._forces), "axis": np.array(self._axis)}

    def recall(self, memory):
        self._forces, self._axis = memory["forces"].copy(), memory["axis"].copy()
