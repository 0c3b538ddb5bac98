"""Two meshes of many cases of a scene, solved and compared in C; and how their numbers depend on those of a case.

In fixed units the numbers that C reads are linear functions of the loads, found once from several scenes; those of the
law follow from the stiffnesses of the cases.
"""

import numpy as np

from cosserat_fenicsx.algebra.building import Pointers
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.results import accuracy, compared
from cosserat_fenicsx.results.accuracy import LONGEST_IN_LAYER, equal_elements
from cosserat_fenicsx.results.compared import NAMES, cells_of, held_by_law, transferred
from cosserat_fenicsx.scene.action import without_stress
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
        self._linear = None
        coarse, fine = meshes
        p = self._compared = self._ffi.new("comparison *")
        p.coarse, p.fine, p.tol, p.resolved, p.in_layer = coarse.c, fine.c, tol, RESOLVED, LONGEST_IN_LAYER
        for name in ("ahead", "of_ends", "safety", "safety_below", "asymptotic"):
            setattr(p, name, getattr(accuracy, name.upper()))
        for name in ("nothing", "least_moment", "vanishing", "rounding", "noise"):
            setattr(p, name, getattr(compared, name.upper()))
        p.far, p.equal, p.single = accuracy.FAR_AHEAD, equal_elements(fine.layout), min(coarse.layout.counts) == 1
        rule = fine.model.rule
        places = compared.compared(coarse.layout, fine.layout, rule)
        p.places = len(places.inside)
        for name, array in (("inside", places.inside), ("weights", places.weights)):
            setattr(p, name, self.doubles(np.ascontiguousarray(array)))
        p.cells = self.integers(places.cells)
        self._transfer(rule)
        self._told = self._ffi.new("query[]", len(queries))
        p.query, p.queries = self._told, len(queries)
        for told, query in zip(self._told, queries, strict=True):
            cell, weights = compared.located(fine.layout, rule, query.rod, query.share)
            told.kind, told.rod = NAMES.index(query.kind), query.rod
            told.place = _PLACES[query.name] + (query.component or 0)
            told.cell, told.weights = cells_of(fine.layout)[query.rod].start + cell, self.doubles(np.array(weights))
        c = self._cases = self._ffi.new("cases *")
        c.meshes, c.first, c.near, c.patience = p, abs(load_factor) / 10, near, _SECONDS
        self._written = self._ffi.new("written[]", 1)
        c.written, self._empty = self._written, np.zeros((1, 1))
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
        """Which numbers of a point of the fine mesh depend on n at the Gauss points: arrays of (number, point,
        component in the model, derivative); None where none do."""
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
        p.length, p.turned = scene.lengths.max() / scales.length, fine.turned
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
        self._cases.written, self._cases.parts = self._written, len(parts)
        return True

    # -- cases -------------------------------------------------------------------------------------------------------

    def numbers(self, values, K=None, J=None):
        """(cases, n) what C writes for cases: their parameters (cases, parameters), and K and J (cases, rods, 3), N and
        N m^2, where these depend on them."""
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
        """Solve cases in C, with their `numbers`, or as the scene that is loaded: (which are decided (cases,), values
        and estimated errors (cases, queries))."""
        c, from_buffer = self._cases, self._ffi.from_buffer
        numbers = self._empty if numbers is None else np.ascontiguousarray(numbers)
        undecided, (found, errors) = np.zeros(count, np.int32), np.zeros((2, count, len(self._queries)))
        c.values, c.width = from_buffer("double[]", numbers), numbers.shape[1]
        c.found, c.errors = from_buffer("double[]", found), from_buffer("double[]", errors)
        c.undecided, c.count, c.next = from_buffer("int[]", undecided), count, 0
        for mesh in self.meshes:
            mesh.ready()
        try:
            while self._lib.run_cases(c) == self._lib.LATER:
                self._done()
            self._done()
        finally:
            for mesh in self.meshes:
                mesh.c.sweep.load_factor[0] = 0.0
        return undecided == 0, found, errors

    def _done(self):
        for mesh in self.meshes:
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
