"""Two meshes of many cases of a scene, whose problems stay loaded, solved and compared in C, which writes the numbers
of a case over those before; and how their numbers depend on those of a case.

In fixed units the numbers that C reads are linear functions of the loads, found once from several scenes; those of the
law follow from the stiffnesses of the cases.
"""

from collections import namedtuple
from functools import cached_property

import numpy as np
from dolfinx import fem

from cosserat_fenicsx.algebra.building import LockStep, Mesh, Pointers, allowed
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.models.rod_data import bending_lengths, bounded, field_values
from cosserat_fenicsx.results import accuracy, compared
from cosserat_fenicsx.results.accuracy import LONGEST_IN_LAYER, equal_elements
from cosserat_fenicsx.results.compared import NAMES, cells_of, held_by_law, rounding_of, shortest_of, transferred
from cosserat_fenicsx.scene.action import without_stress
from cosserat_fenicsx.statics.meshes import surely_resolved
from cosserat_fenicsx.statics.path.load_control import StepControl, Sweep
from cosserat_fenicsx.statics.path.track import Track, step_control
from cosserat_fenicsx.statics.refinement import RESOLVED

# Seconds after which C returns, so that Ctrl-C is obeyed.
_SECONDS = 0.05
# Largest relative difference of data that count as the same.
_SAME = 2e-14
# Where C finds the first component of what is asked for: displacement, q, n, m.
_PLACES = {"position": 0, "displacement": 0, "rotation_angle": 3, "force": 7, "moment": 10}


class Pair(Pointers):
    """Two `Loaded` meshes, the second of elements half as long, and a scene that is loaded in them; queries: see
    `cases.Query`; tol: largest estimated error; near: largest motion of a correction."""

    def __init__(self, meshes, scene, queries, tol, load_factor, *, near):
        super().__init__()
        self.meshes, self._queries, self._load_factor = meshes, queries, load_factor
        self._linear, self._lock_step = None, ()
        coarse, fine = meshes
        p = self._compared = self._ffi.new("comparison *")
        p.coarse, p.fine, p.tol, p.resolved, p.in_layer = coarse.c, fine.c, tol, RESOLVED, LONGEST_IN_LAYER
        for name in ("ahead", "of_ends", "safety", "safety_below", "asymptotic"):
            setattr(p, name, getattr(accuracy, name.upper()))
        p.far, p.equal, p.single = accuracy.FAR_AHEAD, equal_elements(fine.layout), min(coarse.layout.counts) == 1
        rule = fine.model.rule
        compared.of_places(self, p, compared.compared(coarse.layout, fine.layout, rule))
        self._transfer(rule)
        self._told = self._ffi.new("query[]", len(queries))
        p.query, p.queries = self._told, len(queries)
        for told, query in zip(self._told, queries, strict=True):
            cell, weights = compared.located(fine.layout, rule, query.rod, query.share)
            told.kind, told.rod = NAMES.index(query.kind), query.rod
            told.place = _PLACES[query.name] + (query.component or 0)
            told.cell, told.weights = cells_of(fine.layout)[query.rod].start + cell, self.doubles(np.array(weights))
        c = self._cases = self._ffi.new("cases *")
        c.first, c.near, c.patience, self._empty = abs(load_factor) / 10, near, _SECONDS, np.zeros((1, 1))
        self._written, self._all = self._ffi.new("written[]", 1), []
        self._join(self)
        self._take(scene)

    def _transfer(self, rule):
        """Tell C how the state of the coarse mesh becomes a start on the fine one."""
        coarse, fine = self.meshes
        model, problem, p = fine.model, fine.problem, self._compared
        (nodes, at_nodes), (cells, at_gauss) = transferred(coarse.layout, fine.layout, rule)
        size, forces, points = model.components, model.force_size, len(rule.gauss)
        nodal = size * len(coarse.model.reference)
        shape = len(model.reference), size
        model.state.x.array[model.nodal] = np.arange(1.0, np.prod(shape) + 1).reshape(shape)[model.slots]
        if model.force_is_unknown:
            model.signature.formulation.force.put(model, np.zeros((*model._in_space.K.shape[:2], forces)))
        problem.numbering.from_local(model.state.x.array, problem.x)
        numbers = problem.x.array_r.astype(int) - 1
        model.rest()
        (of_nodes,) = np.nonzero(numbers >= 0)
        node, component = np.divmod(numbers[of_nodes], size)
        parts = [(np.repeat(of_nodes, nodes.shape[1]), (size * nodes[node] + component[:, None]).ravel(),
                  at_nodes[node].ravel())]  # fmt: skip
        of_force = self._of_force()
        if of_force is not None:
            to, point, axis, weight = of_force  # of the fine mesh
            sources = forces * (points * cells[point][:, None] + np.arange(points)) + axis[:, None]
            parts.append(
                (np.repeat(to, points), (nodal + sources).ravel(), (weight[:, None] * at_gauss[point]).ravel())
            )
        to, source, weight = map(np.concatenate, zip(*parts, strict=True))
        used = weight != 0
        p.moves, p.numbers = int(used.sum()), fine.c.sweep.numbers
        p.move_to, p.move_from = self.integers(to[used]), self.integers(source[used])
        p.move_weight = self.doubles(np.ascontiguousarray(weight[used]))
        p.start = self.doubles(fine._kept["at_rest"])

    def _of_force(self):
        """Numbers of a fine point that depend on n at Gauss points: (number, point, component, derivative); or None."""
        _, fine = self.meshes
        model, problem = fine.model, fine.problem
        if not (model.carried or model.force_is_unknown):
            return None
        shape, found = (*model._in_space.K.shape[:2], model.force_size), []
        values, none = model._rest, np.zeros((*shape[:2], 3))

        def numbers(n):
            problem.begin_at(values, n, ())
            return np.concatenate(problem.numbers())

        at_rest = numbers(none)
        for point in range(shape[0] * shape[1]):
            for axis in range(shape[2]):
                n = none.copy()
                n.reshape(-1, 3)[point] = model.axes[axis]
                change = numbers(n) - at_rest
                found += [(k, point, axis, change[k]) for k in np.flatnonzero(change)]
        numbers(none)
        model.rest()
        return [np.array(x) for x in zip(*found, strict=True)]

    def load(self, scene):
        """Load a scene of the same kind, for cases without numbers of their own."""
        for mesh in self.meshes:
            mesh.load(scene)
        self._take(scene)

    def _take(self, scene):
        p, (_, fine) = self._compared, self.meshes
        scales, rule = fine.model.scales, fine.model.rule
        fine.c.length, p.turned = scene.lengths.max() / scales.length, fine.turned
        if scene.acts_in_law:

            def without(rod, s):
                full, scaled = without_stress(scene, rod, s)
                return [full + self._load_factor * scaled]

            held = held_by_law(scene, fine.layout, rule, scales, without, 1)
            p.held[0], p.held[1] = held[:, 0]
        units = scales.length, 1.0, scales.force, scales.moment
        for told, query in zip(self._told, self._queries, strict=True):
            told.unit, told.offset = units[told.kind], 0.0
            if query.name == "position":
                rod = scene.rods[query.rod]
                told.offset = rod.curve.position(query.share * rod.length)[query.component]

    # -- how numbers depend on those of a case ------------------------------------------------------------------------

    def depend(self, at, steps, other):
        """Find how the numbers depend on those (parameters,) of the loaded scene; whether that describes another scene:
        other = (its parameters, the scene, its K and J (1, rods, 3), N and N m^2, or None where the law is the same);
        steps: [(index, change of the parameter, its scene)] of those that do not change the law."""
        before = [[array.copy() for array in mesh.read] for mesh in self.meshes]
        fixed = [mesh.fixed() for mesh in self.meshes]
        derivatives = [[np.zeros((len(at), array.size)) for array in arrays] for arrays in before]
        admitted = True
        for j, step, scene in steps:
            self.load(scene)
            for mesh, known, columns in zip(self.meshes, before, derivatives, strict=True):
                for column, array, values in zip(columns, mesh.read, known, strict=True):
                    change = array - values
                    change[np.abs(change) <= _SAME * np.abs(values)] = 0.0
                    column[j] = change / step
            admitted &= self._same(fixed)
        values, scene, laws = other
        linear = [
            [_line(at, *each) for each in zip(known, columns, strict=True)]
            for known, columns in zip(before, derivatives, strict=True)
        ]
        self.load(scene)
        admitted &= self._same(fixed)
        found = [[array.copy() for array in mesh.read] for mesh in self.meshes]
        return admitted and self._describes(before, linear, found, values, laws) and self._write(linear, laws)

    def _same(self, fixed):
        return all(
            len(a) == len(b) and (np.abs(a - b) <= _SAME * np.abs(b)).all()
            for a, b in zip((mesh.fixed() for mesh in self.meshes), fixed, strict=True)
        )

    def _describes(self, before, linear, found, values, laws):
        for mesh, known, lines, wanted in zip(self.meshes, before, linear, found, strict=True):
            for array, (places, rest, derivatives) in zip(known, lines, strict=True):
                array[places] = rest + values @ derivatives
            if laws is not None:
                numbers = mesh.stretched(*laws)
                for name, place in mesh.law_places:
                    (k,) = (k for k, array in enumerate(mesh.read) if array.ctypes.data == place.array.ctypes.data)
                    known[k][place.places] = numbers[name][0, place.which]
            for a, b in zip(known, wanted, strict=True):
                noise = np.finfo(float).eps * np.abs(b).max(initial=0.0)  # of sums that vanish
                if (np.abs(a - b) > 10 * (_SAME * np.abs(b) + noise)).any():
                    return False
        return True

    def _write(self, linear, laws):
        """Tell C where it writes the numbers of a case."""
        parts, rest, derivatives, self._loads, first = [], [], [], [], 0
        for mesh, lines in zip(self.meshes, linear, strict=True):
            of_loads = []
            for k, (array, (places, constant, slopes)) in enumerate(zip(mesh.read, lines, strict=True)):
                if k < 2:  # dead loads, of which the norms count
                    others = np.delete(array, places)
                    of_loads.append((slice(first, first + len(places)), float(others @ others)))
                if not len(places):
                    continue
                parts.append((self.doubles(array), places, first + np.arange(len(places))))
                rest.append(constant)
                derivatives.append(slopes)
                first += len(places)
            self._loads.append(of_loads if any(part.start < part.stop for part, _ in of_loads) else None)
        self._rest = np.concatenate([np.zeros(0), *rest])
        self._derivatives = np.concatenate([np.zeros((linear[0][0][2].shape[0], 0)), *derivatives], axis=1)
        for mesh, of_loads in zip(self.meshes, self._loads, strict=True):
            if of_loads is not None:
                parts.append((mesh.limit("loads"), [0], [first]))
                first += 1
        for mesh in self.meshes if laws is not None else ():
            starts = {}
            for name, numbers in mesh.stretched(*laws).items():
                starts[name], first = first, first + numbers.shape[1]
            parts += [(self.doubles(place.array), place.places, starts[name] + place.which)
                      for name, place in mesh.law_places]  # fmt: skip
            parts.append((mesh.limit("rounding"), [0], [starts["rounding"]]))
        self._written = self._ffi.new("written[]", max(1, len(parts)))
        for part, (to, places, which) in zip(self._written, parts, strict=False):
            part.to, part.place, part.which, part.count = to, self.integers(places), self.integers(which), len(which)
        self._known, self._cases.written[0], self._cases.parts = (linear, laws), self._written, len(parts)
        return True

    def _join(self, pair):
        """Let C solve cases by another pair too."""
        c, k = self._cases, len(self._all)
        c.meshes[k], c.written[k], c.lanes = pair._compared, pair._written, k + 1
        for group, mesh in zip((c.coarse, c.fine), pair.meshes, strict=True):
            group.sweep[k] = mesh.c.sweep
        self._all.append(pair)

    def in_lock_step(self, more):
        """Solve cases from now on in lock step, by this pair and by others like it; more: a function that gives one,
        with the scene of `depend`. Nothing changes where the compiler, or an interface, does not allow it."""
        meshes = self.meshes
        if not all(allowed(mesh.problem, mesh.stability) for mesh in meshes):
            return
        found = [LockStep(mesh.problem, mesh.stability) for mesh in meshes]
        if not all(x.c for x in found):
            return
        self._lock_step = found
        for _ in range(self._lib.LANES - 1):
            pair = more()
            pair._write(*self._known)
            self._join(pair)
        self._cases.coarse.together, self._cases.fine.together = (x.c for x in found)

    # -- cases -------------------------------------------------------------------------------------------------------

    def numbers(self, values, K=None, J=None):
        """(cases, n) what C writes: parameters, and K, J (cases, rods, 3), N and N m^2, where these depend on them."""
        linear = self._rest + values @ self._derivatives
        parts = [linear]
        for of_loads in self._loads:
            if of_loads is not None:
                norms = [np.sqrt(others + np.square(linear[:, part]).sum(axis=1)) for part, others in of_loads]
                parts.append(sum(norms)[:, None])
        if K is not None:
            for mesh in self.meshes:
                parts += mesh.stretched(K, J).values()
        return np.concatenate(parts, axis=1)

    def run(self, count, numbers=None):
        """Solve cases in C: (which are decided (cases,), values and estimated errors (cases, queries))."""
        c, from_buffer = self._cases, self._ffi.from_buffer
        numbers = self._empty if numbers is None else np.ascontiguousarray(numbers)
        undecided, (found, errors) = np.zeros(count, np.int32), np.zeros((2, count, len(self._queries)))
        c.values, c.width = from_buffer("double[]", numbers), numbers.shape[1]
        c.found, c.errors = from_buffer("double[]", found), from_buffer("double[]", errors)
        c.undecided, c.count, c.next = from_buffer("int[]", undecided), count, 0
        meshes = [mesh for pair in self._all for mesh in pair.meshes]
        for mesh in meshes:
            mesh.ready()
        try:
            while self._lib.run_cases(c) == self._lib.LATER:
                self._done(meshes)
            self._done(meshes)
        finally:
            for mesh in meshes:
                mesh.c.sweep.load_factor[0] = 0.0
        return undecided == 0, found, errors

    def _done(self, meshes):
        for mesh in meshes:
            mesh.done()
        obey()


def _line(at, known, derivatives):
    """(places of the numbers that change, their values where all parameters are 0, derivatives)."""
    (places,) = np.nonzero(derivatives.any(axis=0))
    derivatives = derivatives[:, places]
    rest = known[places] - at @ derivatives
    terms = np.abs(known[places]) + np.abs(at) @ np.abs(derivatives)
    rest[np.abs(rest) <= 10 * _SAME * terms] = 0.0  # so that small loads keep digits
    return places, rest, derivatives


_STEPS = StepControl()
# Rejected steps after which a case is left to `solve`, whose load control looks at the stiffness at rest then.
_PATIENCE = 2

#: Places of an array that C reads, and which of the numbers of a case they take.
Place = namedtuple("Place", "array places which")


class Loaded(Mesh):
    """A problem of its own on one mesh, with what C needs to expand its states (`c`, the `mesh` of chain.h).

    EI, N m^2, is that of the units, which then depend on no case; load_factor: of all cases; iterations: of Newton's
    method in a step; turned: the largest angle of `surely_resolved`; solvers: not `together`, since cases write
    coefficients, of which there would be copies.
    """

    def __init__(self, solvers, scene, layout, EI, load_factor, *, iterations):
        self.problem, self.newton, self.stability = self.solvers = solvers
        self.model, self.layout = self.problem.model, layout
        super().__init__(layout.counts, self.model.rule)
        self.model.EI = EI
        self._load_factor, self._kept, self._nodal = np.array([load_factor]), {}, None
        self.load(scene)
        track = Track(*solvers, iterations)
        track.begin_here()
        self._sweep = Sweep(track, self.problem.fields)
        self.newton.allow(iterations)
        _, self._control = step_control(largest=np.inf)
        self._control.smallest, self._control.patience = _STEPS.smallest * abs(load_factor), _PATIENCE
        sweep = self.c.sweep = self._sweep.c
        sweep.control, sweep.patience, sweep.every = self._control, np.inf, False
        sweep.load_factors, sweep.count = self.doubles(self._load_factor), 1
        self._describe()

    def _describe(self):
        """Tell C what does not depend on the scene."""
        c, model = self.c, self.model
        c.kind, c.components, c.forces = getattr(self._lib, model.kind), model.components, model.force_size
        if hasattr(model, "tree"):
            c.order = self.integers(model.tree.order)
        unknowns, fields = self.problem.numbering.size, self.problem.fields
        numbers = np.arange(1.0, unknowns + 1)
        of_fields = np.arange(float(fields.elements * fields.size)).reshape(1, fields.elements, -1) if fields else None
        here, which = model.snapshots(np.stack([0 * numbers, numbers]), of_fields)
        c.__setattr__("from", self.integers(np.where(here[1] == here[0], -1, here[1] - 1)))
        if fields:
            c.field_from = self.integers(which[0])
        at_gauss = c.elements, c.points, 9
        shapes = {"nodal": (c.nodes, c.components), "fields": at_gauss, "motion": (c.nodes, 7), "gauss": at_gauss,
                  "contact": (c.elements, c.p + 1, 6)}  # fmt: skip
        self.keep(**{name: np.zeros(shape) for name, shape in shapes.items()})

    def load(self, scene):
        """Load a scene of the same signature; its rest state is that of the cases."""
        self.problem.forget()
        self.problem.load(scene, self.layout)
        self.stability.load()
        model, lengths = self.model, [rod.length / self.model.scales.length for rod in scene.rods]
        sizes, section = self.layout.sizes(scene) / model.scales.length, model.section
        self._lengths = sizes, bending_lengths(model._in_space, lengths, self.layout.counts)
        longest, self.turned = surely_resolved(scene, self.layout, model.signature.degree)
        self.c.longest = longest / model.scales.length
        low, high = scene.extremes
        gyrations, limits = self._judged(
            low.K[None], high.K[None], low.J[None], high.J[None], np.array([model.round_off])
        )
        self._keep(
            at_rest=np.concatenate(self.problem.numbers()), rest=model._rest, reference=model.reference, sizes=sizes,
            axes=model.axes, K=section.K, J=section.J, R_R=section.R_R, v_R=section.v_R, gyrations=gyrations,
            limits=limits, known=getattr(model, "_known", None), density=self._density(),
        )  # fmt: skip
        self._fixed = {
            "geometry": model.mesh.geometry.x.ravel(), "scales": np.array([*vars(model.scales).values()]),
            "turned": np.array([self.turned, longest]),
        }  # fmt: skip
        nodal = np.concatenate([np.zeros(0), *(x.ravel() for x in getattr(model, "nodal_forces", ()))])
        if self._nodal is None:
            self._nodal = nodal
        self._nodal[:] = nodal

    def _density(self):
        at_gauss, _ = self.model.densities.at(self._load_factor)
        return None if at_gauss is None else at_gauss[0]

    def _keep(self, **arrays):
        """Give C the numbers of the loaded scene, always at the same places."""
        for name, array in arrays.items():
            if array is not None and name in self._kept:
                self._kept[name][...] = array
            elif array is not None:
                self._kept[name] = np.array(array, dtype=float)
                setattr(self.c, name, self.doubles(self._kept[name]))

    def ready(self):
        """Set the limits of Newton's method for the loaded scene."""
        self._sweep.c.loads, self.newton.c.rounding = self.problem.load_norm, self.model.round_off

    def done(self):
        """After cases: raise what Python code within them has raised."""
        self.problem.raise_failure()
        self.stability.raise_failure()

    # -- what differs from case to case -----------------------------------------------------------------------------

    def _packed(self):
        """All `Packed` forms of the problem and its second variation."""
        forms = [self.problem._residual, self.problem.tangent_form, *(part.form for part in self.stability.parts)]
        for form in forms:
            yield from form.parts()

    @cached_property
    def read(self):
        """The arrays with numbers of the loaded scene: the dead loads, and the forces from which statics finds n, whose
        norms limit the residual's; then others that C reads."""
        model, problem = self.model, self.problem
        functions = [f for f in model.data if f is not None] + model.actions.data
        states = (model.state, model.before, model.step, *model.carried)
        functions += [f for f in vars(model).values() if isinstance(f, fem.Function)]
        read = [problem._dead.array, self._nodal, *(form._w for form in self._packed())]
        read += [f.x.array for f in functions if not any(f is state for state in states)]
        return [x.reshape(-1) for x in (*read, *(self._kept[name] for name in _WRITTEN if name in self._kept))]

    def fixed(self):
        """Numbers (n,) that must not depend on the parameters."""
        names = ("at_rest", "rest", "reference", "sizes", "axes")
        return np.concatenate([*(self._kept[name].ravel() for name in names), *self._fixed.values()])

    @cached_property
    def _order(self):
        """(elements, 3) the number among K (rods, 3) that each principal stiffness is."""
        data = self.model._in_space
        owner = np.repeat(np.arange(len(self.layout.counts)), self.layout.counts)
        given = np.broadcast_to((3.0 * owner[:, None] + np.arange(3.0))[:, None], data.K.shape)
        return self.model._section_data(data._replace(K=given, J=given)).K[:, 0].astype(int)

    def stretched(self, K, J):
        """{name: (cases, n)} of the law, from K and J (cases, rods, 3); of an element if `law_places` says so."""
        model, order = self.model, self._order
        force, cases, sizes = model.signature.formulation.force, len(K), self._lengths[0]
        along, turning = ((x.reshape(cases, -1) / unit)[:, order] for x, unit in self._in_units(K, J))
        flat = model._in_space._replace(K=along.reshape(-1, 1, 3), J=turning.reshape(-1, 1, 3))
        apart = np.add.outer((model.structures.max() + 1) * np.arange(cases), model.structures).ravel()
        stiff = bounded(flat, force.stiff, *(np.tile(x, cases) for x in self._lengths), apart)
        found = dict(zip(("K", "K_inv", "K_stiff", "J"), field_values(flat, stiff), strict=False))
        of_cases = flat._replace(K=along[:, :, None], J=turning[:, :, None])
        rounding = model.round_off_of(of_cases, sizes)
        found["gyrations"], found["limits"] = self._judged(K, K, J, J, rounding)
        found["law"] = np.concatenate([along, turning], axis=1)
        return {name: values.reshape(cases, -1) for name, values in found.items()} | {"rounding": rounding[:, None]}

    def _in_units(self, K, J):
        scales = self.model.scales
        return (K, scales.force), (J, scales.force * scales.length**2)

    def _judged(self, least, K, softest, J, rounding):
        """Radii of gyration (cases, rods), and the `limits` of chain.h (cases, 5), from least and largest K and J."""
        model = self.model
        (least, force), (softest, moment) = self._in_units(least, softest)
        by_statics, shortest = model.name == "determinate", shortest_of(model.scene, model.scales, self.layout)
        given = least / force, K / force, J / moment, shortest, model.signature.degree, by_statics
        gyrations, noise = rounding_of(*given)
        ends = [softest[..., :k].min(axis=(-2, -1)) / moment for k in (3, 2)]
        return gyrations, np.stack([*noise, *ends, model.signature.formulation.force.rounding * rounding], axis=1)

    @cached_property
    def law_places(self):
        """[(name, `Place`)] of the numbers of `stretched`."""
        model, found = self.model, []
        shape = (*model._in_space.K.shape[:2], 3)
        for name in ("K", "K_inv", "K_stiff", "J"):
            function = getattr(model.data, name)
            kept = function.x.array.copy()
            model.rods.fill(function, np.arange(np.prod(shape), dtype=float).reshape(shape))
            which = function.x.array.astype(int)
            which = which // (3 * shape[1]) * 3 + which % 3
            function.x.array[:] = kept
            found.append((name, Place(function.x.array, np.arange(len(which)), which)))
            for form in self._packed():
                for _, of_elements, column in form._places([function.x.array]):
                    rows = np.arange(form.elements)[:, None] * form._w.shape[1]
                    places = rows + column + np.arange(of_elements.shape[1])
                    of_array = which[of_elements.astype(int).ravel()]
                    found.append((name, Place(form._w.reshape(-1), places.ravel(), of_array)))
        element, _, component = np.indices(shape)
        for name, first in (("K", 0), ("J", 3 * shape[0])):
            array = self._kept[name].reshape(-1)
            found.append(("law", Place(array, np.arange(array.size), (first + 3 * element + component).ravel())))
        for name in ("gyrations", "limits"):
            array = self._kept[name].reshape(-1)
            found.append((name, Place(array, np.arange(array.size), np.arange(array.size))))
        return found

    def limit(self, name):
        """C's pointer to the "rounding" of Newton's method, or to the "loads" of the sweep."""
        return self._ffi.addressof(*{"rounding": (self.newton.c, "rounding"), "loads": (self._sweep.c, "loads")}[name])


# Arrays of `mesh` that differ from case to case.
_WRITTEN = ("K", "J", "known", "density", "gyrations", "limits")
