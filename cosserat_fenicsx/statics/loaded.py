"""One mesh of many cases of a scene: its problem stays loaded, and C writes the numbers of a case over those before."""

from collections import namedtuple
from functools import cached_property

import numpy as np
from dolfinx import fem

from cosserat_fenicsx.algebra.building import Pointers
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.models.rod_data import bending_lengths, bounded, field_values
from cosserat_fenicsx.results.compared import of_sections
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.results.records import Record, Records
from cosserat_fenicsx.statics.path.load_control import StepControl, Sweep
from cosserat_fenicsx.statics.path.track import Track, step_control

_STEPS = StepControl()
# Rejected steps after which a case is left to `solve`, whose load control looks at the stiffness at rest then.
_PATIENCE = 2
# Seconds after which C returns, so that Ctrl-C is obeyed.
_SECONDS = 0.05


class CasesPath(Path):
    """The equilibria of many cases, each of them a path of one point, in the units of the first one.

    Attributes:
        stiffnesses: for every rod (least, largest) with K and J (cases, 3), where they differ; or None.
    """

    apart, stiffnesses = True, None

    @property
    def _of_sections(self):
        by_statics = self.model == "determinate"
        return of_sections(self.scene, self.scales, self.layout, self.degree, by_statics, self.stiffnesses)


#: Places of an array that C reads, which of the numbers of a case they take, and C's pointers to all three.
Place = namedtuple("Place", "array places which to at of")


class Loaded(Pointers):
    """A problem of its own on one mesh.

    Args:
        solvers: the new problem, its Newton solver and its `NegativeModes`; scene, layout: to load.
        load_factor: of all cases; iterations: of Newton's method in a step; near: largest motion of a correction.
    """

    def __init__(self, solvers, scene, layout, EI, load_factor, *, iterations, near):
        super().__init__()
        self.problem, self.newton, self.stability = self.solvers = solvers
        self.model, self._layout = self.problem.model, layout
        self.model.EI = EI  # so that units depend on no case
        self.load(scene)
        self._places = None
        track = Track(*solvers, iterations)
        track.begin_here()
        self._sweep, self._load_factor = Sweep(track, self.problem.fields), np.array([load_factor])
        self.newton.allow(iterations)
        self._lib, self._control = step_control(largest=np.inf)
        self._control.smallest, self._control.patience = _STEPS.smallest * abs(load_factor), _PATIENCE
        self._scratch, sweep = np.zeros(2), self._sweep.c
        self._counts = np.zeros(2, dtype=np.int32)
        sweep.control, sweep.patience, sweep.room, sweep.every = self._control, np.inf, 2, False
        sweep.load_factors, sweep.count = self.doubles(self._load_factor), 1
        sweep.recorded_load_factors = self.doubles(self._scratch)
        sweep.recorded_iterations = sweep.recorded_steps = self.integers(self._counts)
        self._cases = self._ffi.new("cases *")
        self._cases.sweep, self._cases.first, self._cases.near = sweep, abs(load_factor) / 10, near
        self._cases.patience = _SECONDS
        only = self.integers(np.zeros(1))
        self._of_rounding, self._of_loads = (
            Place(None, only, [0], self._ffi.addressof(struct, name), only, only)
            for struct, name in ((self.newton.c, "rounding"), (sweep, "loads"))
        )

    def load(self, scene):
        """Load a scene of the same signature; its rest state is that of the cases."""
        self.problem.forget()
        self.problem.load(scene, self._layout)
        self.stability.load()
        self._rest = np.concatenate(self.problem.numbers())
        model, lengths = self.model, [rod.length / self.model.scales.length for rod in scene.rods]
        sizes = self._layout.sizes(scene) / model.scales.length
        self._lengths = sizes, bending_lengths(model._in_space, lengths, self._layout.counts)

    def _take_limits(self):
        self._sweep.c.loads, self.newton.c.rounding = self.problem.load_norm, self.model.round_off

    # -- what differs from case to case -----------------------------------------------------------------------------

    def _packed(self):
        """All `Packed` forms of the problem and its second variation."""
        forms = [self.problem._residual, self.problem.tangent_form, *(part.form for part in self.stability.parts)]
        for form in forms:
            while form:
                yield form
                form = form._others

    def arrays(self):
        """(list of arrays that C reads, {name: further array that results and checks need}) of the loaded scene."""
        model, problem = self.model, self.problem
        functions = [f for f in model.data if f is not None] + model.actions.data
        states = (model.state, model.before, model.step, *model.carried)
        functions += [f for f in vars(model).values() if isinstance(f, fem.Function)]
        read = [form._w for form in self._packed()] + [problem._dead.array]
        read += [f.x.array for f in functions if not any(f is state for state in states)]
        known = getattr(model, "_known", None)
        more = {
            "densities": (model.densities._dead or [None])[0], "known": known, "dead": problem._dead.array,
            "nodal": None if known is None else model.nodal_forces[0], "reference": model.reference,
            "geometry": model.mesh.geometry.x, "rest": self._rest, "scales": np.array([*vars(model.scales).values()]),
        }  # fmt: skip
        return [x.reshape(-1) for x in read], {k: x.reshape(-1).copy() for k, x in more.items() if x is not None}

    def stretched(self, K, J):
        """{name: (cases, n)} numbers of the Functions of the law, and the `RodData` of the cases, from K and J (cases,
        rods, 3), N and N m^2."""
        model, counts = self.model, self._layout.counts
        scales, data, cases = model.scales, model._in_space, len(K)
        owner = np.repeat(np.arange(len(counts)), counts)
        points = data.K.shape[1]

        def at_points(values):
            return np.repeat(values[:, owner].reshape(-1, 1, 3), points, axis=1)

        def tiled(values):
            return np.tile(values, (cases, *(1,) * (values.ndim - 1)))

        K, J = K / scales.force, J / (scales.force * scales.length**2)
        whole = data._replace(K=at_points(K), J=at_points(J), R_R=tiled(data.R_R), v_R=tiled(data.v_R))
        section = model._section_data(whole)
        sizes, lengths = self._lengths
        stiff = bounded(
            section, model.signature.formulation.force.stiff, np.tile(sizes, cases), np.tile(lengths, cases)
        )
        found = dict(zip(("K", "K_inv", "K_stiff", "J"), field_values(section, stiff), strict=False))
        shape = (cases, len(owner), points, 3)
        of_cases = section._replace(
            K=section.K.reshape(shape), J=section.J.reshape(shape), R_R=model.section.R_R, v_R=model.section.v_R
        )
        rounding = model.round_off_of(of_cases, sizes)
        return {name: values.reshape(cases, -1) for name, values in found.items()}, of_cases, rounding

    def place(self, array, places, which=None):
        """A `Place` of an array that C reads."""
        which = np.arange(len(places)) if which is None else which
        return Place(array, places, which, self.doubles(array), self.integers(places), self.integers(which))

    def law_places(self):
        """[(name, `Place`, which of the numbers of `stretched` it takes)]; found once."""
        if self._places is None:
            self._places, model = [], self.model
            for name in ("K", "K_inv", "K_stiff", "J"):
                function, shape = getattr(model.data, name), (*model._in_space.K.shape[:2], 3)
                kept = function.x.array.copy()
                model.rods.fill(function, np.arange(np.prod(shape), dtype=float).reshape(shape))
                which = function.x.array.astype(int)
                function.x.array[:] = kept
                self._places.append((name, self.place(function.x.array, np.arange(len(which)), which)))
                for form in self._packed():
                    for _, of_elements, column in form._places(function.x.array):
                        rows = np.arange(form.elements)[:, None] * form._w.shape[1]
                        places = rows + column + np.arange(of_elements.shape[1])
                        of_array = which[of_elements.astype(int).ravel()]
                        self._places.append((name, self.place(form._w.reshape(-1), places.ravel(), of_array)))
        return self._places

    # -- cases -------------------------------------------------------------------------------------------------------

    def run(self, count, written, starts=None):
        """Solve cases in C, from rest, or from starts (cases, numbers) by Newton's method alone.

        Args:
            written: [(`Place`, values (cases, n))].

        Returns:
            (which are undecided (cases,), unknowns (cases, n), fields (cases, elements, n) or None).
        """
        c, sweep, problem, pointers = self._cases, self._sweep.c, self.problem, Pointers()
        self._take_limits()
        parts = self._ffi.new("written[]", max(1, len(written)))
        for part, (place, values) in zip(parts, written, strict=False):
            values = np.ascontiguousarray(values)
            part.to, part.place, part.which, part.count = place.to, place.at, place.of, len(place.which)
            part.values, part.width = pointers.doubles(values), values.shape[1]
        fields = problem.fields
        undecided, found = np.zeros(count, dtype=np.int32), np.zeros((count, problem.numbering.size))
        found_fields = np.zeros((count, fields.elements, fields.size)) if fields else None
        c.written, c.parts, c.count, c.next, c.corrects = parts, len(written), count, 0, starts is not None
        c.starts = pointers.doubles(self._rest if starts is None else np.ascontiguousarray(starts))
        c.found, c.undecided = pointers.doubles(found), self._ffi.cast("int *", undecided.ctypes.data)
        if fields:
            c.found_fields = pointers.doubles(found_fields)
        try:
            while self._lib.run_cases(c) == self._lib.LATER:
                self._checked()
            self._checked()
        finally:
            sweep.load_factor[0] = 0.0
        return undecided.astype(bool), found, found_fields

    def _checked(self):
        self.problem.raise_failure()
        self.stability.raise_failure()
        obey()

    def limits(self, rounding, dead, nodal):
        """What C needs for the limits of the residual's norm, as parts of `written`.

        Args:
            rounding: (cases,) see `RodModel.round_off_of`; or None for that of the loaded scene.
            dead, nodal: (cases, n) dead loads, and forces from which statics gives n; or None where all are those of
                the loaded scene.
        """
        parts = []
        if rounding is not None:
            parts.append((self._of_rounding, rounding[:, None]))
        if dead is not None or nodal is not None:
            known = self.problem._dead.array, *getattr(self.model, "nodal_forces", ())
            loads = 0.0
            for values, loaded in zip((dead, nodal), known, strict=False):
                loads = loads + np.linalg.norm(loaded.reshape(1, -1) if values is None else values, axis=1)
            parts.append((self._of_loads, loads[:, None]))
        return parts

    def path(self, x, fields, why, section=None, known=None, densities=None, stiffnesses=None, rounding=None):
        """The `CasesPath` of unknowns and fields that C has found.

        Args:
            section, known, densities: the `RodData`, contact forces by statics, and loads along rods (cases, ...) of
                the cases, where they differ; else None.
            stiffnesses: see `CasesPath`; rounding: (cases,) see `RodModel.round_off_of`.
        """
        model, count = self.model, len(x)
        kept = model.section, getattr(model, "_known", None)
        try:
            model.section = kept[0] if section is None else section
            if known is not None:
                model._known = known.reshape(count, *kept[1].shape)
            path = CasesPath.of(model, why)
        finally:
            model.section = kept[0]
            if known is not None:
                model._known = kept[1]
        load_factors = np.full(count, self._load_factor[0])
        at_gauss, _ = model.densities.at(load_factors)
        if densities is not None and at_gauss is not None:
            at_gauss = self._load_factor[0] * densities.reshape(at_gauss.shape)
        nodal, fields = model.snapshots(x, fields)
        none, ones = np.zeros(count, dtype=int), np.ones(count, dtype=int)
        path.extend(Records(Record, {
            "load_factor": load_factors, "rq": nodal, "gauss_fields": fields, "negative_modes": none,
            "iterations": none, "reactions": np.empty((count, 0)), "neutral": none.astype(bool),
            "densities": (at_gauss, None), "tie_forces": np.empty((count, 0, 2, 6)),
            "clamp_loads": np.full((count, model.clamps.count, 6), np.nan), "steps": ones,
        }))  # fmt: skip
        path.stiffnesses = stiffnesses
        if rounding is not None:
            path.rounding = model.signature.formulation.force.rounding * rounding
        return path

    def starts(self, rq, n):
        """(cases, numbers) the numbers of states on another mesh, see `Problem.begin_at`."""
        model, values = self.model, self.model.unknowns_of(rq)
        if model.force_is_unknown:
            found = np.empty((len(rq), len(self._rest)))
            for row, here, force in zip(found, values, n, strict=True):
                self.problem.begin_at(here, force, ())
                row[:] = np.concatenate(self.problem.numbers())
            return found
        of_values, of_force = self._of_starts
        force = (n @ model.axes[: model.force_size].T).reshape(len(n), -1)
        return np.concatenate([values.reshape(len(n), -1)[:, of_values], force[:, of_force]], axis=1)

    @cached_property
    def _of_starts(self):
        """For every unknown the number of the nodes' values that it is, and for every carried one that of n."""
        model, problem, carried = self.model, self.problem, []
        shape = len(model.reference), model.components
        model.state.x.array[model.nodal] = np.arange(np.prod(shape), dtype=float).reshape(shape)[model.slots]
        problem.numbering.from_local(model.state.x.array, problem.x)
        for function in model.carried:
            shape = (*model._in_space.K.shape[:2], model.force_size)
            model.rods.fill(function, np.arange(np.prod(shape), dtype=float).reshape(shape))
            carried.append(function.x.array.astype(int))
        of_values = problem.x.array_r.astype(int)
        model.rest()
        return of_values, np.concatenate([*carried, np.zeros(0, dtype=int)])
