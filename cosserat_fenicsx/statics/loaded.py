"""One mesh of many cases of a scene: its problem stays loaded, and C writes the numbers of a case over those before."""

from collections import namedtuple
from functools import cached_property

import numpy as np
from dolfinx import fem

from cosserat_fenicsx.algebra.building import Pointers
from cosserat_fenicsx.models.rod_data import bending_lengths, bounded, field_values
from cosserat_fenicsx.results.compared import rounding_of, shortest_of
from cosserat_fenicsx.statics.meshes import surely_resolved
from cosserat_fenicsx.statics.path.load_control import StepControl, Sweep
from cosserat_fenicsx.statics.path.track import Track, step_control

_STEPS = StepControl()
# Rejected steps after which a case is left to `solve`, whose load control looks at the stiffness at rest then.
_PATIENCE = 2
# The kinds of chain.h by the components of a node's unknowns.
_KINDS = {1: "IN_PLANE", 4: "IN_SPACE", 3: "PLANAR", 7: "SPATIAL"}

#: Places of an array that C reads, and which of the numbers of a case they take.
Place = namedtuple("Place", "array places which")


class Loaded(Pointers):
    """A problem of its own on one mesh, with what C needs to expand its states (`c`, the `mesh` of chain.h).

    EI, N m^2, is that of the units, which then depend on no case; load_factor: of all cases; iterations: of Newton's
    method in a step; turned: the largest angle of `surely_resolved`.
    """

    def __init__(self, solvers, scene, layout, EI, load_factor, *, iterations):
        super().__init__()
        self.problem, self.newton, self.stability = self.solvers = solvers
        self.model, self.layout = self.problem.model, layout
        self.model.EI = EI
        self._load_factor, self.c, self._kept, self._nodal = np.array([load_factor]), self._ffi.new("mesh *"), {}, None
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
        c, model, rule = self.c, self.model, self.model.rule
        elements, points = model._in_space.K.shape[:2]
        components = model.components - getattr(model, "multipliers", 0)
        c.kind = getattr(self._lib, _KINDS[components])
        c.rods, c.elements, c.nodes, c.p = len(self.layout.counts), elements, len(model.reference), len(rule.nodes) - 1
        c.points, c.components, c.forces = points, model.components, model.force_size
        c.first = self.integers(np.cumsum([0, *self.layout.counts]))
        if hasattr(model, "_tree"):
            order = [(rod, entry, -1 if before is None else before) for rod, entry, before in model._tree._order]
            c.order = self.integers(np.array(order))
        unknowns, fields = self.problem.numbering.size, self.problem.fields
        numbers = np.arange(1.0, unknowns + 1)
        of_fields = np.arange(float(fields.elements * fields.size)).reshape(1, fields.elements, -1) if fields else None
        here, which = model.snapshots(np.stack([0 * numbers, numbers]), of_fields)
        c.__setattr__("from", self.integers(np.where(here[1] == here[0], -1, here[1] - 1)))
        if fields:
            c.field_from = self.integers(which[0])
        for name, matrix in (
            ("basis", rule.at_gauss), ("slopes", rule.slopes), ("from_slopes", rule.from_slopes),
            ("by_fields", rule.contact_from_fields), ("by_densities", rule.contact_from_densities),
        ):  # fmt: skip
            setattr(c, name, self.doubles(np.ascontiguousarray(matrix)))
        for name, shape in (
            ("nodal", (c.nodes, c.components)), ("placed", (c.nodes, 3)), ("motion", (c.nodes, 7)),
            ("gauss", (elements, points, 9)), ("contact", (elements, c.p + 1, 6)),
        ):  # fmt: skip
            setattr(c, name, self.doubles(np.zeros(shape)))

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
            while form:
                yield form
                form = form._others

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
        """{name: (cases, n)} numbers of the law, from K and J (cases, rods, 3), N and N m^2: of an element (elements,
        3) where `law_places` says so."""
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
                for _, of_elements, column in form._places(function.x.array):
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
