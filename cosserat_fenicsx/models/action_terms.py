"""The data of a scene's actions on a mesh: a term for each kind of virtual work, and its Functions."""

from collections import namedtuple

import numpy as np
import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.rod_data import element_function, gauss_function
from cosserat_fenicsx.models.signature import place_actions
from cosserat_fenicsx.models.sliding import SlidingThread
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.scene.profiles import BESIDE_BREAK
from cosserat_fenicsx.scene.signals import at, signals_of, values_at, with_values

# Quadrature on an interval between kinks: exact for data that are linear there, up to p = 4.
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


def nearest_polynomials(action, rod, s, starts, lengths):
    """The `Datum`s of an action along a rod at the Gauss points s (elements * p,), m, as the nearest polynomials on
    elements with kinks inside; starts, lengths: (elements,), m.

    Gauss points may miss a narrow peak. The polynomial of degree p - 1 that is nearest in the mean square has the same
    integrals against polynomials of degree p - 1, the total and the moment of a load among them, and its values at the
    p Gauss points are integrals against the Lagrange polynomials through these points, which are orthogonal.
    """
    given = action.data(rod, s)
    if not len(starts):
        return given
    p = len(s) // len(starts)
    at_gauss = (s.reshape(-1, p) - starts[:, None]) / lengths[:, None]
    order = np.argsort(starts)
    ends = np.concatenate([starts, starts + lengths, action.kinks(rod)])
    edges = np.unique(ends[(ends >= starts.min()) & (ends <= (starts + lengths).max())])
    middles, sizes = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    owner = order[np.searchsorted(starts[order], middles, side="right") - 1]
    inside = middles < starts[owner] + lengths[owner]  # a rank need not own neighbouring elements
    owner, middles, sizes = owner[inside], middles[inside], sizes[inside]
    places = middles[:, None] + sizes[:, None] * _PLACES / 2
    local = (places - starts[owner][:, None]) / lengths[owner][:, None]
    basis = np.ones((*local.shape, p))
    for q in range(p):
        for other in set(range(p)) - {q}:
            x_q, x_other = at_gauss[owner, q, None], at_gauss[owner, other, None]
            basis[:, :, q] *= (local - x_other) / (x_q - x_other)
    weights = (sizes / lengths[owner])[:, None] * _WEIGHTS / 2
    gauss = np.polynomial.legendre.leggauss(p)[1] / 2  # symmetric: reversed elements have the same
    found = []
    for datum, sampled in zip(given, action.data(rod, places.ravel()), strict=True):
        if len(np.reshape(datum.value, (-1, datum.size))) != len(s):  # a constant
            found.append(datum)
            continue
        values = np.zeros((len(starts), p, datum.size))
        parts = np.einsum("kg,kgq,kgi->kqi", weights, basis, sampled.value.reshape(*local.shape, datum.size))
        np.add.at(values, owner, parts)
        found.append(datum._replace(value=(values / gauss[:, None]).reshape(-1, datum.size)))
    return tuple(found)


class Densities:
    """The densities of the actions of a model's current scene."""

    def load(self, model):
        """Prepare for the model's scene. Dead densities are evaluated once, per unit of each of the two factors."""
        self._model, self._dead = model, None
        if not model.forms.density or model.signature.lives_along_rods:
            return
        factors = model.load_factor, model.permanent_factor
        before = [float(factor.value) for factor in factors]
        self._dead = []
        for i in range(2):
            for j, factor in enumerate(factors):
                factor.value = float(i == j)
            self._dead.append(self._at(model.forms.density, len(model.forms.gauss)))
        for factor, value in zip(factors, before, strict=True):
            factor.value = value

    def at(self, load_factors):
        """`here` at several load factors (k,), for dead densities: (k, elements, points, 6) or None, and None."""
        if self._dead is None:
            return None, None
        of_load, of_permanent = self._dead
        permanent = float(self._model.permanent_factor.value) * of_permanent
        return np.multiply.outer(load_factors, of_load) + permanent, None

    def here(self):
        """The densities at the model's state, inertial, dimensionless, (elements, points, 6) each or None: at the Gauss
        points, and at the nodes for actions integrated there."""
        model, at_gauss = self._model, None
        if self._dead is not None:
            at_gauss, _ = self.at(float(model.load_factor.value))
        elif model.forms.density:
            at_gauss = self._at(model.forms.density, len(model.forms.gauss))
        if not model.forms.node_density:
            return at_gauss, None
        return at_gauss, self._at(model.forms.node_density, len(model.nodes))

    def _at(self, expressions, points):
        values = sum(self._model.gathered(each, points, 6) for each in expressions).reshape(-1, points, 2, 3)
        return (values @ self._model.axes).reshape(-1, points, 6)


# Points of an element, in [0, 1], that are closer than this are the same.
_SAME = 1e-9


class ActionTerms:
    """The `Term`s of a `Signature` on a `RodMesh`; nodes: reference coordinates of an element's nodes, ascending."""

    def __init__(self, rods, signature, nodes):
        self.terms = [Term(rods, signature, nodes, kind) for kind in signature.terms]

    def fill(self, model, time=1.0):
        """Fill the Functions with the data of the scene of a `RodModel` at the time 0; time: its unit of time, s."""
        placed = place_actions(model.scene, model.layout)
        for term, (_, members) in zip(self.terms, placed, strict=True):
            term.fill(model, members, time)

    def at(self, t):
        """Fill the Functions with the data at the time t (s); returns whether they have changed."""
        return any([term.put(t) for term in self.terms if term.moves])

    @property
    def move(self):
        """Whether any data depend on time."""
        return any(term.moves for term in self.terms)

    @property
    def data(self):
        """The Functions of the data of all terms."""
        return [function for term in self.terms for function in term.data]

    @property
    def refreshed(self):
        """The Functions that are updated with the state in every Newton iteration."""
        return [function for term in self.terms if term.kind.refreshed for function in term.data]

    @property
    def turns_with_position(self):
        """Whether data depend on the position in a way that is not in the tangent."""
        return any(term.kind.refreshed and not term.kind.slides for term in self.terms)

    @property
    def sliding(self):
        """(`Term`, its `SlidingThread`s) of threads with friction."""
        return [(term, term.sliding) for term in self.terms if term.sliding]

    @property
    def tensions(self):
        """The Functions of the tensions of tendons of given length."""
        return [term.data[0] for term in self.terms if term.kind.finds_tension]

    def refresh(self):
        """Update the data that depend on the position, at the model's state."""
        for term in self.terms:
            if term.kind.refreshed:
                term.refresh()

    def soften(self, share):
        """Multiply the stiffness of all obstacles by a share, in statics; 1 restores it."""
        for term in self.terms:
            term.soften(share)

    def withdraw(self, gap):
        """Move the surfaces of all obstacles away from rods by a gap, dimensionless; 0 restores them."""
        for term in self.terms:
            term.withdraw(gap)

    @property
    def memory_functions(self):
        """The Functions of the actions' memory (history variables)."""
        return [function for term in self.terms for function in term.memory]

    @property
    def memory(self):
        """The arrays of the actions' memory."""
        return [function.x.array for function in self.memory_functions]

    def follow(self, delayed):
        """Take the values of actions that depend on earlier motion from {id of the action: its `Action.delayed`}."""
        for term in self.terms:
            term.follow(delayed)

    @property
    def sticking(self):
        """The terms with friction that is found with the state (`Action.finds_friction`)."""
        return [term for term in self.terms if term.finds_friction]

    @property
    def friction(self):
        """Copies of the friction that was found with the state, of each of the terms `sticking`."""
        return [term.held.copy() for term in self.sticking]

    @friction.setter
    def friction(self, values):
        for term, friction in zip(self.sticking, values, strict=True):
            term.held[:] = friction

    def forget_friction(self):
        """Return to the friction of the last accepted state."""
        self.friction = [term.accepted for term in self.sticking]

    def begin_friction(self):
        """Count slip from the state, with friction that is zero there."""
        for term in self.sticking:
            term.commit()
            term.held[:] = 0.0

    def commit(self):
        """Update the actions' memory to the state, which has been accepted."""
        for term in self.terms:
            if term.memory:
                term.commit()


class Term:
    """Actions of one `TermKind`: a virtual work, and the Functions of its data and of its memory (history variables).

    weight: Function: 1 where distributed actions act; 2 over the element length at the station of a point action,
    because the end-point rule gives each end half that length; 0 elsewhere. moves: whether any data depend on time;
    compiled_evolution: the compiled `evolution`; None without memory; acting: (action, rod) of those that depend on
    time, with their values at the time of the last `put`; accepted: `held` of the last accepted state, or None;
    sliding: the `SlidingThread`s of threads with friction.
    """

    sliding = ()

    def __init__(self, rods, signature, nodes, kind):
        self.kind, self._rods, self._nodes, self._signature = kind, rods, nodes, signature
        self.weight = self._function(1)
        self.data = [self._function(size) for size in kind.sizes]
        self.memory = [self._function(size) for size in kind.memory]
        self._rest = self._frame = self.compiled_evolution = None
        # dolfinx makes a new array at every access to `x.array`
        self._arrays = [f.x.array.reshape(-1, size) for f, size in zip(self.data, kind.sizes, strict=True)]

    def _function(self, size):
        mesh, place = self._rods.mesh, self.kind.place
        if self.kind.at_gauss:
            return gauss_function(mesh, self._signature.points, size)
        return element_function(mesh, 1 if place == "point" else self._signature.degree, size)

    # -- UFL ---------------------------------------------------------------------------------------------------------

    def rest(self):
        """Position at rest; its Function is made at the first call."""
        self._rest = self._rest or self._function(3)
        return self._rest

    def frame(self):
        """Directors at rest as the columns of a matrix; its Function is made at the first call."""
        self._frame = self._frame or self._function(9)
        return ufl.as_matrix([[self._frame[3 * i + j] for j in range(3)] for i in range(3)])

    @property
    def numbers(self):
        """Data and memory as UFL scalars and vectors."""
        sizes = (*self.kind.sizes, *self.kind.memory)
        return [f if size == 3 else f[0] for f, size in zip((*self.data, *self.memory), sizes, strict=True)]

    def work(self, point, test):
        """The virtual work, weighted, per unit of the measure."""
        return self.weight[0] * self.kind.work(point, test, *self.numbers)

    def evolution(self, point):
        """The update of the memory: its UFL expression, and the points of an element where it is evaluated."""
        changed = [x for a in self.kind.evolve(point, *self.numbers) for x in (a if a.ufl_shape else [a])]
        return ufl.as_vector(changed), self._dof_places

    # -- numbers -----------------------------------------------------------------------------------------------------

    @property
    def _dof_places(self):
        """Reference coordinates of the degrees of freedom of an element, in dolfinx's order."""
        if self.kind.at_gauss:
            return np.polynomial.legendre.leggauss(self._signature.points)[0] / 2 + 0.5
        return compat.element_nodes(self.weight.function_space)

    def fill(self, model, members, time):
        """Fill in the data of actions; members: (action, index of its rod, element end or None); time: s."""
        self._model, self._time = model, time
        scene, layout, rods, x = model.scene, model.layout, self._rods, self._dof_places
        numbers = compat.cell_nodes(self.weight.function_space)  # the same for all Functions of this term
        first, cells = rods.first_cells, rods.cells
        begin, size = np.concatenate([b[:-1] for b in layout.breaks]), layout.sizes(scene)
        lengths = np.array([rod.length for rod in scene.rods])
        along = np.where(rods.reversed[:, None], 1 - x, x)
        starts, sizes = begin[cells] * lengths[rods.cell_rod], size[cells]
        # where data jump at an end of elements, a node there counts to each of them with the data of its side
        inset = (BESIDE_BREAK * lengths[rods.cell_rod] * (self.kind.place == "node"))[:, None]
        s = starts[:, None] + np.clip(sizes[:, None] * along, inset, sizes[:, None] - inset)
        weight = np.zeros(self.weight.x.array.shape)
        in_turn = np.argsort(rods.cell_rod, kind="stable")  # this rank's elements, rod by rod
        bounds = np.searchsorted(rods.cell_rod[in_turn], np.arange(len(scene.rods) + 1))
        counts = layout.counts
        # (action, rod, rows of the values, arc lengths, their elements and points, starts and lengths of elements)
        self._where = []
        for action, rod, vertex in members:
            mine, value = in_turn[bounds[rod] : bounds[rod + 1]], 1.0
            here = np.ones((len(mine), s.shape[1]), dtype=bool)
            if vertex is not None:
                inner = min(vertex, counts[rod] - 1)
                here = (rods.cell_inner[mine] == inner)[:, None] & (np.abs(along[mine] - (vertex - inner)) < _SAME)
                value = 2 * model.scales.length / size[first[rod] + inner]
            i, points = np.nonzero(here)
            at_points, mine = (mine[i], points), mine[here.any(axis=1)]
            weight[numbers[at_points]] = value * action.amplitude
            elements = starts[mine], sizes[mine]
            self._where.append((action, scene.rods[rod], numbers[at_points], s[at_points], at_points, elements))
        self.weight.x.array[:] = weight
        # tensions that are found are not data
        self.moves = not self.kind.finds_tension and any(signals_of(action) for action, _, _ in members)
        # data of one member also where none acts, so that no virtual work divides by zero there
        action, rod = self._where[0][:2]
        data = (*at(action, 0.0).data(rod, np.zeros(1)), *action.memory)
        for function, datum in zip((*self.data, *self.memory), data, strict=True):
            function.x.array.reshape(-1, datum.size)[:] = self._scaled(datum, rod)
        self._values = None
        self._delayed = {}
        self.put(0.0)
        self._values = None  # the first step then counts as a change, which is checked
        self._refreshing = [*self._joined()] if self._where[0][0].refreshed else []
        for k, function in enumerate(self.memory):
            for action, rod, rows, *_ in self._where:
                function.x.array.reshape(-1, action.memory[k].size)[rows] = self._scaled(action.memory[k], rod)
        self.accepted = self.held.copy() if self.finds_friction else None
        if self.kind.slides:
            self.sliding = [SlidingThread(model, self, action, rod, rows, at_points[0])
                            for action, rod, rows, _, at_points, _ in self._where]  # fmt: skip
        if self._rest is not None:
            self._rest.x.array.reshape(-1, 3)[numbers] = self._interpolated(model.reference[model.slots]) @ model.axes.T
        if self._frame is not None:
            for i, rod in enumerate(scene.rods):
                here = in_turn[bounds[i] : bounds[i + 1]]
                frames = model.axes @ rod.curve.frame(s[here].ravel())
                self._frame.x.array.reshape(-1, 9)[numbers[here].ravel()] = frames.reshape(-1, 9)

    def _joined(self):
        """What `refresh` does, for each action or for several at stations together: (`Action.refreshed`, rod, rows, arc
        lengths, nodes and their shares (n, k), of whose positions a point's is the sum)."""
        model, several = self._model, {}
        shares = model.rule.basis(self._dof_places)[:, model.node_order]
        places = np.arange(shares.shape[1])[None].repeat(len(shares), axis=0)
        if np.isclose(shares.max(axis=1), 1.0).all():  # at nodes
            places, shares = shares.argmax(axis=1)[:, None], np.ones((len(shares), 1))
        for k, (action, rod, *where, _) in enumerate(self._where):
            if len(where[0]):
                several.setdefault((id(rod), action.together or k), []).append((action, rod, *where))
        for members in several.values():
            actions, (rod, *_), *where = zip(*members, strict=True)
            action = actions[0].together[0](actions) if len(actions) > 1 else actions[0]
            rows, s, (cells, points) = (np.concatenate(parts, axis=-1) for parts in where)
            nodes = np.take_along_axis(model.cell_nodes[cells], places[points], axis=1)
            whole = np.array_equal(rows, np.arange(len(self._arrays[0])))
            yield action.refreshed, rod, slice(None) if whole else rows, s, nodes, shares[points]

    def follow(self, delayed):
        self._delayed = {id(action): delayed[id(action)] for action, *_ in self._where if id(action) in delayed}
        self.moves = self.moves or bool(self._delayed)

    def _values_of(self, action, t):
        delayed = self._delayed.get(id(action))
        return values_at(action, t) if delayed is None else {**values_at(action, t), **delayed.at(t)}

    def put(self, t):
        """Fill in the data at the time t, s; returns whether they have changed."""
        # on all ranks, since a user's function of time may communicate
        values = [self._values_of(action, t) for action, *_ in self._where]
        if values == self._values:
            return False
        self._values, self.acting = values, []
        for array in self._arrays if self.kind.place == "law" else ():
            array[:] = 0.0
        for now, (action, rod, rows, s, _, elements) in zip(values, self._where, strict=True):
            now = with_values(action, now)
            if now is not action:
                self.acting.append((now, rod))
            if not len(rows):
                continue
            rough = self.kind.at_gauss and len(now.kinks(rod))
            self._take(nearest_polynomials(now, rod, s, *elements) if rough else now.data(rod, s), rod, rows)
        for thread in self.sliding:
            thread.pull(t)
        return True

    def soften(self, share):
        """See `ActionTerms`; walls whose data are refreshed have stages of their own."""
        action, rod = self._where[0][:2]
        if action.presses and not self.kind.refreshed:
            data = action.data(rod, np.zeros(1))
            self._multiply([k for k, datum in enumerate(data) if datum.unit == "N/m^2"], share)

    def withdraw(self, gap):
        """See `ActionTerms`: by less of what is the radius of rods."""
        action = self._where[0][0]
        if action.gaps is not None:
            self._multiply([], 1.0)
            for _, _, rows, *_ in self._where:
                self._arrays[len(action.shape())][rows] -= gap

    def _multiply(self, which, share):
        """Multiply some of the data by a share, where actions act: `put` fills in no others again."""
        self._values = None
        self.put(0.0)
        for k in which:
            for _, _, rows, *_ in self._where:
                self._arrays[k][rows] *= share

    def _take(self, data, rod, rows):
        adds = self.kind.place == "law"
        for array, datum in zip(self._arrays, data, strict=True):
            array[rows] = self._scaled(datum, rod) + array[rows] if adds else self._scaled(datum, rod)

    def _scaled(self, datum, rod):
        """The value of a `Datum`, dimensionless, vectors along the model's axes."""
        value, model = datum.value, self._model
        if datum.unit == "m from origin":
            value = value - model.scene.origin(rod)
        value = value / model.scales.of_unit(datum.unit, self._time)
        return value @ model.axes.T if datum.size == 3 and model.signature.flat else value

    def _interpolated(self, nodal):
        """(local elements, points per element, k) interpolated from nodal values (local nodes, k)."""
        model = self._model
        basis = model.rule.basis(self._dof_places)[:, model.node_order]
        return np.einsum("qj,cji->cqi", basis, nodal[model.cell_nodes])

    def refresh(self):
        """Fill in the actions' data at the positions of the model's state."""
        for thread in self.sliding:
            thread.refresh()
        if self.sliding:
            return
        model = self._model
        r = model.positions()
        for refreshed, rod, rows, s, nodes, shares in self._refreshing:
            place = np.einsum("nk,nki->ni", shares, r[nodes]) * model.scales.length + model.scene.origin(rod)
            self._take(refreshed(rod, s, place), rod, rows)

    def commit(self):
        """Store the memory evaluated at the state."""
        self._store(self.memory)
        self.accepted = self.held.copy() if self.finds_friction else None

    @property
    def finds_friction(self):
        return self._where[0][0].finds_friction

    @property
    def held(self):
        """The array of the friction that is found with the state; writable."""
        return self.memory[-1].x.array

    def find_friction(self):
        """Store the friction of the state, no other memory; returns the largest elastic slip that changed it."""
        before = self.held.copy()
        self._store(self.memory[-1:])
        changed = np.abs(self.held - before).reshape(-1, 3).max(axis=1)
        return float((changed / self._arrays[-1][:, 0])[self.weight.x.array != 0].max(initial=0.0))

    def stiffen(self, share):
        """Multiply the stiffness against slip; 1 restores it."""
        self._multiply([-1], share)

    def _store(self, memory):
        sizes, cells = self.kind.memory, self._model._local_cells
        values = compat.evaluate(self.compiled_evolution, self._rods.mesh, cells).reshape(len(cells), -1, sum(sizes))
        parts = np.split(values, np.cumsum(sizes)[:-1], axis=2)[-len(memory) :]
        for function, part in zip(memory, parts, strict=True):
            function.x.array.reshape(-1, part.shape[2])[compat.cell_nodes(function.function_space)] = part


#: At a station, inertial: displacement (m) and rotation vector (rad, below a full turn) from the reference, velocity
#: (m/s), angular velocity (rad/s), and the rotation R from the reference (3, 3).
StationMotion = namedtuple("StationMotion", "displacement rotation velocity angular_velocity R")


class StationNode:
    """The node of a station of the scene of a loaded spatial moving model."""

    def __init__(self, model, station):
        self._model = model
        slot = model.slot_of(station)
        here = np.flatnonzero(model.slots[: model.owned_nodes] == slot)
        self._dofs = model.nodal[here[0]] if len(here) else None
        self._rest = model.reference[slot]

    def _everywhere(self, *functions):
        """(functions, 7) values at the node."""
        found = np.zeros((len(functions), 7))
        if self._dofs is not None:
            found[:] = [function.x.array[self._dofs] for function in functions]
        comm = self._model.comm
        return comm.allreduce(found) if comm.size > 1 else found

    def now(self):
        """The `StationMotion` of the state."""
        model = self._model
        w, rates = self._everywhere(model.state, model.velocity)
        return self._motion(w, model.rates()(w, rates))

    def of_step(self, h):
        """The `StationMotion` halfway through the step of length h (dimensionless) from `start` to the state: means."""
        model = self._model
        w, before = self._everywhere(model.state, model.start)
        middle = (w + before) / 2
        return self._motion(middle, model.rates()(middle, (w - before) / h))

    def _motion(self, w, rates):
        model = self._model
        length, q = model.scales.length, w[3:] / np.linalg.norm(w[3:])
        v, omega = rates[:3] * length / model.time, rates[3:] / model.time
        size = np.linalg.norm(q[1:])
        turned = 2 * np.arctan2(size, q[0]) / size * q[1:] if size else np.zeros(3)
        return StationMotion((w[:3] - self._rest) * length, turned, v, omega, directors(q[None])[0])


class Delays:
    """The actions of a loaded moving model that depend on the earlier motion of their stations, see `Action.delayed`;
    longest: the longest step that they allow, s."""

    def __init__(self, model):
        self._model, self._actions = model, [x for x in model.scene.actions if x.delayed is not None]
        actions = self._actions
        self._all = [(action.delayed(), StationNode(model, action.station)) for action in actions]
        self.longest = min((delayed.longest for delayed, _ in self._all), default=np.inf)
        self._width = 4 + max((getattr(delayed, "more", 0) for delayed, _ in self._all), default=0)
        self._forget()
        if actions:
            model.actions.follow({id(x): delayed for x, (delayed, _) in zip(actions, self._all, strict=True)})

    def of(self, action):
        """The `Action.delayed` of an action."""
        return next(delayed for (delayed, _), x in zip(self._all, self._actions, strict=True) if x is action)

    def begin(self):
        """Begin at the model's state, at the time 0."""
        self._forget()
        for delayed, node in self._all:
            delayed.begin(node.now())

    def _forget(self):
        #: (actions, 1 + n) since the last saved state: the time (s), and the integrals of the numbers of their far ends
        self._passed = self._before = np.zeros((len(self._all), 1 + self._width))

    def accept(self, t, h):
        """Accept the step from t to t + h (s) to the model's state."""
        self._before, self._passed = self._passed, self._passed.copy()
        for (delayed, node), passed in zip(self._all, self._passed, strict=True):
            delayed.accept(t, h, node.of_step(h / self._model.time))
            numbers = np.append(1.0, delayed.far_end())
            passed[: len(numbers)] += h * numbers

    def undo(self):
        """Take back the last step."""
        self._passed = self._before
        for delayed, _ in self._all:
            delayed.undo()

    def far_ends(self, stepped):
        """(actions, n) means of their far ends since this was last called; NaN where no step led to the state."""
        passed = self._passed
        self._forget()
        return passed[:, 1:] / passed[:, :1] if stepped else np.full((len(passed), self._width), np.nan)

    def memory(self):
        kept = {str(i): delayed.memory() for i, (delayed, _) in enumerate(self._all)}
        return kept | {"passed": np.array(self._passed)} if kept else {}

    def recall(self, memory):
        """Restore what `memory` returned."""
        for i, (delayed, _) in enumerate(self._all):
            delayed.recall(memory[str(i)])
        if self._all:
            self._passed = self._before = memory["passed"].copy()
