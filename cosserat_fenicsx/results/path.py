"""An equilibrium path as arrays with named fields."""

from collections import namedtuple
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Self

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.results.accuracy import leading_of
from cosserat_fenicsx.results.compared import NAMES, Errors, mesh_of, sizes_of, words_of
from cosserat_fenicsx.results.contacts import (
    ROD_FORCE,
    Contacts,
    RodContacts,
    contacts_in_words,
    contacts_of,
    rod_contacts_of,
)
from cosserat_fenicsx.results.modes import ModesAlong
from cosserat_fenicsx.results.records import Event, Records
from cosserat_fenicsx.results.recovery import Threads, element_contact
from cosserat_fenicsx.results.result import by_name
from cosserat_fenicsx.results.rods import MOVES_MOST, RodResult
from cosserat_fenicsx.results.queries import Sensitivity, Uncertainty
from cosserat_fenicsx.scene.action import Action, actions_in_words
from cosserat_fenicsx.scene.parameters import Parameter, check_once
from cosserat_fenicsx.scene.rod import RodOrName

# Most events that `print` names.
_EVENTS = 6
_KINDS = {"limit": "Limit point", "bifurcation": "Bifurcation", "flutter": "Flutter"}
# The state of a point by the sign of its number of negative modes.
_STATES = {0: "stable", 1: "unstable", -1: "undecided"}


def _of_events(name):
    return lambda path: np.array([getattr(event, name) for event in path.events])


# Quantities of every point, and of every event.
_QUANTITIES = by_name(
    Quantity("load_factor", getter="load_factors"),
    Quantity("stage", getter=lambda path: path.stage if path.scene.stages else None),
    Quantity("steps"),
    Quantity("negative_modes"),
    Quantity("stable"),
    Quantity("iterations", "Newton iterations"),
    Quantity("error", "estimated error", digits=2),
    Quantity("error_position", "estimated error of positions", getter="errors.position", digits=2),
    Quantity("error_rotation", "estimated error of rotations", getter="errors.rotation", digits=2),
    Quantity("error_force", "estimated error of contact forces", getter="errors.force", digits=2),
    Quantity("error_moment", "estimated error of contact moments", getter="errors.moment", digits=2),
    Quantity("event_kind", "kind", axes=("event",), getter=_of_events("kind")),
    Quantity("event_stage", "stage", axes=("event",),
             getter=lambda path: _of_events("stage")(path) if path.scene.stages else None),
    Quantity("event_load_factor", "load factor", axes=("event",), getter=_of_events("load_factor")),
    Quantity("event_after", "index of the point before it", axes=("event",), getter=_of_events("after")),
    Quantity("event_residual", "residual", axes=("event",), getter=_of_events("residual")),
    Quantity("event_error", "relative difference from a coarser mesh", axes=("event",), getter=_of_events("error")),
    Quantity("event_mode", "mode", "1", "xyz", "inertial", ("event", "s"),
             lambda path, rod: np.array([path.mode(x, rod) for x in path.events]) if path.events else None),
)  # fmt: skip


class Path(RodResult):
    """An equilibrium path: a sequence of converged points.

    Beside those of `RodResult` it has these attributes.

    Attributes:
        load_factors: (n,); those of its stage, of a scene with stages.
        stage: (n,) index of the scene's `Stage`; -1 for the scene's own loads.
        steps: (n,) number of steps of the continuation since the start, on the mesh of the path: those to points in
            between, which are not kept, count; where the points were corrected from a coarser mesh each is one step.
        negative_modes: (n,) number of negative eigenvalues of the second variation; 0 at a stable point, -1 where it is
            singular, and where it differs with and without the nodes that touch a smooth obstacle and do not press on
            it. Where the loads have no potential (see `conservative`) its symmetric part is used, which does not
            detect flutter.
        stable: (n,) bool.
        errors: the estimated errors of position, rotation, force and moment, and of further criteria that `tol` bounds,
            each (n,), see there.
        error: (n,) the largest of those that `tol` bounds; NaN where not estimated.
        bounded: names of those that `tol` bounds.
        rounding: the error of positions and rotations that the rounding of the residual alone may cause, relative.
        events: every `Event` of the path in order: limit points and bifurcations, and flutter after `modes`.
        left: whether the path continues on a branch from its first bifurcation.
        cautions: the sentences of `why` that `print` shows.
        control: "load", or "arc" where the path, or a part of it, was followed in arc length.
    """

    axis = "load factor"
    _kind, _more_about, _coordinates = "Path", ("control",), ("load_factor",)
    _quantities = _QUANTITIES
    #: whether the formulation's virtual rotations are changes of q instead of independent small rotations
    galerkin = False
    _computed = (*RodResult._computed, "_contact", "_cut", "conservative", "_reference", "_roughness")
    # functions of a path that compute its `conservative` and its `sensitivity`
    _potential = _differentiated = _vibrating = None

    def __init__(self, *args, **more):
        super().__init__(*args, **more)
        self.events: list[Event] = []
        self.control, self.left = "load", False
        self.cautions: list[str] = []
        self.rounding, self.bounded, self.criteria = 0.0, NAMES, ()
        self._known_errors = self.by_mesh = None

    @property
    def quantities(self) -> dict[str, Quantity]:
        """{name: `Quantity`}, with the errors of further criteria that `tol` bounds, and forces of rods that touch."""
        further = ((x.name, f"estimated error of {words_of(x.name)}", f"errors.{x.name}") for x in self.criteria)
        touches = [ROD_FORCE] if self.scene.rod_contact else []
        return super().quantities | by_name(
            *(Quantity(f"error_{name}", label, getter=getter, digits=2) for name, label, getter in further), *touches
        )

    @classmethod
    def of(cls, model, why=(), potential=None, differentiated=None, vibrating=None):
        """See `Result`; `potential`: a function of the path that computes its `conservative`; `differentiated`: one of
        the path, a query and parameters that computes its `sensitivity`; `vibrating`: one of the path, a number and
        `damped` that computes its `modes`."""
        formulation = model.signature.formulation
        path = super().of(model, formulation.name, why)
        path.rounding, path.galerkin = formulation.force.rounding * model.round_off, formulation.galerkin
        path._potential, path._differentiated, path._vibrating = potential, differentiated, vibrating
        return path

    @property
    def _mesh(self):
        return mesh_of(self.scene, self.scales, self.layout, self.rule, self.model == "determinate")

    @cached_property
    def _reference(self):
        return sizes_of(self)

    @cached_property
    def _roughness(self):
        return leading_of(self)

    def at_points(self, which: Sequence[int] | np.ndarray) -> Self:
        """A path of some of the points, without events.

        Args:
            which: their indices.
        """
        part = super().at_points(which)
        part.events = []
        for name, values in (("_known_errors", self._errors), ("by_mesh", self.by_mesh)):
            setattr(part, name, None if values is None else values[:, which])
        return part

    def with_points(self, others, which):
        """A path that merges these points with those of another path on the same mesh.

        Args:
            others: the other `Path`.
            which: (n,) of bool: for every point of the result, in order, whether it comes from `others`.
        """
        whole, order = self.at_points([]), np.where(which, len(self) + np.cumsum(which) - 1, np.cumsum(~which) - 1)
        whole._expanded = Records.joined([self._all, others._all]).at(order)
        return whole

    def __repr__(self):
        reach = f"load factors {self.load_factors[0]:g} .. {self.load_factors[-1]:g}" if len(self) else "empty"
        points = f"{len(self)} point{'' if len(self) == 1 else 's'}"
        return f"<Path: {points}, {reach}, {self.model}, {self.unknowns} unknowns>"

    def _answer(self, units):
        if not len(self):
            yield "No point of the path was computed."
            return
        yield from self._doubts(units)
        at, the = (f"{title}: at", f"{title}: the") if (title := self.scene.title) else ("At", "The")
        limit = next((x for x in self.events if x.kind == "limit" and x.after < len(self) - 1), None)
        if limit is not None:
            told = f"limit load factor is {limit.load_factor:.6g}{self._of_stage(limit.stage)}"
            yield f"{the} {told}: what follows lies beyond it."
            at = "At"
        station = self._most_displaced()
        turned = np.where((angle := self.rotation_angle(station)) > 1e-12, angle, 0.0)[-1]
        yield (
            f"{at} the load factor {self.load_factors[-1]:.6g}{self._of_stage(self.stage[-1])}, "
            f"{_STATES[np.sign(self.negative_modes[-1])]}, "
            f"{station} is displaced by {self._moved_in_words(station, units)} and turned by {turned:.6g} rad."
        )
        yield from self.cautions
        yield from errors_in_words(self)
        yield from map(units.sentence, contacts_in_words(self))
        told, others = self._events_in_words()
        yield from told
        if others:
            yield f"... and {len(others)} more by `details()`"
        if not self.left and any(event.kind == "bifurcation" for event in self.events):
            yield (
                "The path stays on its branch there; --branch 1 or -1 (branch= in Python) leaves it at the first "
                "bifurcation."
            )

    def _events_in_words(self):
        """Those that `print` names, limit points before others, and the other ones, each along the path."""
        words = [
            f"{_KINDS[event.kind]} at the load factor {event.load_factor:.7g}{self._of_stage(event.stage)}"
            for event in self.events
        ]
        order = sorted(range(len(words)), key=lambda k: (self.events[k].kind == "bifurcation", k))
        return [[words[k] for k in sorted(part)] for part in (order[:_EVENTS], order[_EVENTS:])]

    def _of_stage(self, stage):
        """The name of a stage after one of its load factors, in sentences."""
        return f" of {self.stage_label(stage)}" if self.scene.stages else ""

    def when(self, k: int, form: str = ".6g") -> str:
        """The load factor of point k in words, with its stage."""
        return f"load factor {self.load_factors[k]:{form}}{self._of_stage(self.stage[k])}"

    def stage_label(self, stage: int) -> str:
        """The name of a stage, or its number, in tables and pictures; empty of a scene without stages."""
        return ""

    def _more(self, units):
        yield from self._events_in_words()[1]
        yield from super()._more(units)

    def _table(self, units, rows, station=None):
        if not len(self):
            return None
        chosen, station = "" if station else MOVES_MOST, self.station(station or self._most_displaced())
        known, stable = self.quantities, [stability(count) for count in self.negative_modes]
        title = f"{self.scene.title}\n" if self.scene.title else ""
        which, digits = None, 9 if rows == screen.ROWS else 6
        ends = np.append(np.flatnonzero(np.diff(self.stage)), len(self) - 1)
        if rows == screen.ROWS:
            beside = {k for event in self.events for k in (event.after, event.after + 1)} | {*ends.tolist()}
            which = [k for k in range(len(self)) if k < rows // 2 or k >= len(self) - rows // 2 or k in beside]
        elif len(ends) > 1:
            which = np.union1d(ends[-rows:], screen.rows_of(len(self), rows - len(ends)))
        shown = min(rows, len(self)) if which is None else len(which)
        left_out = ""
        if shown < len(self):
            left_out = f"{shown} of {len(self)} points: path.csv has all (-o DIR; path.write('path.csv') in Python).\n"
        return screen.table(
            [
                *([(known["stage"], [self.stage_label(k) for k in self.stage])] if self.scene.stages else []),
                (known["load_factor"], self.load_factors),
                (Quantity("displacement", unit="m", parts="xyz", short="d", digits=digits), self.displacement(station)),
                (Quantity("rotation", unit="rad", noise=1e-12, digits=digits), self.rotation_angle(station)),
                (known["stable"], stable),
                (Quantity("iterations"), self.iterations),
                (Quantity("estimated_error", digits=2, short="est. error"), self.error),
            ],
            units,
            rows,
            f"{title}{self.model} model, {self.formulation} formulation, {self._mesh_in_words()}",
            f"{left_out}dx, dy, dz, size of the rotation: of {station}{chosen}. "
            "stable: 'no (2)' has two negative modes. "
            f"iterations: Newton's, since the row above. est. error: the largest of {_bounded(self)}. "
            f"{actions_in_words(self.scene)}",
            which,
            gaps=rows == screen.ROWS,
        )

    @property
    def stage(self) -> np.ndarray:
        """(n,) whole numbers, see the class."""
        return np.full(len(self), -1)

    @property
    def load_factors(self) -> np.ndarray:
        """(n,), see the class."""
        return self._array("load_factor").astype(float)

    @property
    def negative_modes(self) -> np.ndarray:
        """(n,) whole numbers, see the class."""
        return self._array("negative_modes").astype(int)

    @property
    def stable(self) -> np.ndarray:
        """(n,) bool."""
        return self.negative_modes == 0

    @cached_property
    def conservative(self) -> bool:
        """Whether the loads have a potential near every point, for all motions in space that the supports allow.

        A dead moment has none where its section can turn about two axes. It is computed on first use, which may take a
        second."""
        return self._potential(self)

    def sensitivity(
        self, query: Callable[[Self], object] | Event, parameters: Iterable[str | Parameter]
    ) -> Sensitivity:
        """Derivatives of a query by numbers of the scene, at every point of the path, by the direct method.

        The discrete equations on the path's mesh are differentiated: one back-substitution with Newton's tangent for
        each point and parameter, see statics/sensitivity.py. Every rank calls.

        Args:
            query: a function of a path that returns a number or an array, smooth in the state, such as
                ``lambda path: path.displacement("column.end")[:, 0]``, of `position`, `rotation`, `force`, `moment`,
                `reaction`, `largest` and so on. Or one of `events`, for its critical load factor: of a limit point by
                the null vector of the tangent; of a bifurcation, which the parameter must not destroy, by the
                eigenvalue that vanishes.
            parameters: names of numbers, "rods.column.material.E", "rods.column.section.diameter", "loads[0].force[2]"
                (see `Parameter` for others).

        Returns:
            Sensitivity: {name: array of the shape of the query}, SI units.

        Raises:
            SceneError: an unknown parameter (names the nearest), one that changes the model or destroys a bifurcation,
                a query of another kind, an empty path, loads with memory.
            NotConverged: the tangent is singular at a point of the path.
        """
        if self._differentiated is None:
            raise SceneError(
                "sensitivity: it is not known along a path through stages: expected a scene without stages"
            )
        return self._differentiated(self, query, parameters)

    def uncertainty(
        self,
        standard_deviations: Mapping[str | Parameter, float | str],
        query: Callable[[Self], object] | Event,
        correlation: np.ndarray | None = None,
    ) -> Uncertainty:
        """The first-order standard deviation of a query, with the share of each parameter; it can be printed.

        Args:
            standard_deviations: {name of a number of the scene, or `Parameter`: its standard deviation, in its unit}.
            query: see `sensitivity`. correlation: see `Sensitivity.uncertainty`.

        Raises:
            SceneError, NotConverged: as of `sensitivity` and `Sensitivity.uncertainty`.
        """
        check_once(self.scene, standard_deviations)
        return self.sensitivity(query, standard_deviations).uncertainty(standard_deviations, correlation)

    def contacts(self, obstacle: Action) -> Contacts | RodContacts:
        """Where rods touch an obstacle or each other, and the forces there; `print` shows a table of the last state.

        Args:
            obstacle: of the scene, such as a `Plane`; or its `RodContact`, which gives the `RodContacts` of the last
                state (`path[k].contacts` those of state k).

        Raises:
            SceneError: something else.
        """
        if obstacle is self.scene.rod_contact is not None:
            return rod_contacts_of(self, len(self) - 1)
        return contacts_of(self, obstacle)

    @property
    def along_axis(self) -> np.ndarray:
        """(n,) the load factors."""
        return self.load_factors

    def label(self, k: int) -> str:
        """The label of point k in pictures."""
        return f"{self.load_factors[k]:.3g}" + ("" if self.stable[k] else " (unstable)")

    @property
    def errors(self) -> Errors:
        """Estimated errors of what queries return anywhere along the rods, each (n,), relative; NaN where not known.

        position: over the largest displacement at that point of the path (where sections mainly rotate, over their
        rotation times the radius of gyration). rotation: the angle (rad) over the largest rotation, 2 sin(angle/2), or
        over the largest displacement over the length of the longest rod if that is more. force: of n, over the largest
        size of n, or that of m over that length if that is more. moment: of m, over its largest size (over that of n
        times that length where m is nothing but rounding). Positions and rotations: over at least 1e-6 of the largest
        of the path. Rounding is included, over the largest size on the path, since it is the same at small loads: that
        of n is large on slender rods which bend without a large n.
        """
        known = np.full((len(self.judged), len(self)), np.nan) if self._errors is None else self._errors
        return Errors(*known) if len(known) == len(NAMES) else namedtuple("Errors", self.judged)(*known)

    @property
    def judged(self):
        """Names of the criteria with error estimates: the four of the package, then further ones of `bound`."""
        return (*NAMES, *(criterion.name for criterion in self.criteria))

    @property
    def error(self) -> np.ndarray:
        """(n,) the largest estimated error of those that are `bounded`, see `errors`."""
        return np.full(len(self), np.nan) if self._errors is None else self._errors[self.bounds].max(axis=0)

    @property
    def bounds(self):
        """Indices of the `bounded` criteria."""
        return [self.judged.index(name) for name in self.bounded]

    @property
    def worst(self):
        """(n,) as `error`, without the rounding of n and m, which no mesh reduces; NaN where unknown."""
        return np.full(len(self), np.nan) if self.by_mesh is None else self.by_mesh[self.bounds].max(axis=0)

    def set_errors(self, errors):
        """Set the estimated errors (4, n) of the mesh, with those of rounding as a lower bound."""
        self.by_mesh, self._known_errors = np.maximum(errors, self.rounding), None

    @property
    def _errors(self):
        """(4, n) the estimated errors, those of rounding included; None where they are unknown."""
        if self._known_errors is None and self.by_mesh is not None:
            self._known_errors = np.maximum(self.by_mesh, self.rounding_errors)
        return self._known_errors

    @property
    def rounding_errors(self):
        """(4, n) errors of n and m by rounding, over their largest sizes on the path; 0 for the others, see
        `rounding`."""
        sizes = self._reference.sizes
        return self._reference.rounding / sizes.max(axis=1, initial=1e-300)[:, None]

    def modes(self, count: int = 6, *, damped: bool | None = None) -> ModesAlong:
        """The modes at every point of the path, on its mesh, followed from point to point.

        Where a vibration begins to grow between two points, the load factor is located by bisection on the growth rate,
        to a relative 1e-9, and joins `events` as "flutter". Its error is the difference from elements twice as long,
        where load control leads there.

        Args:
            count: how many at each point, see `modes` of the package; flutter of a higher mode is not seen.
            damped: see there.

        Raises:
            SceneError, NotConverged: as of `modes`; an empty path; more Gauss points than the degree.
        """
        if self._vibrating is None:
            raise SceneError(
                "modes: they are not known along a path through stages: expected those of one stage, "
                "path.part(stage).modes(count)"
            )
        return self._vibrating(self, count, damped)

    def mode(self, event: Event, rod: RodOrName | None = None) -> np.ndarray:
        """(nodes, 3) the mode of an event at the nodes of a rod (default the first), see `Event`."""
        return event.mode[self._rows(rod)[1]]

    @cached_property
    def _contact(self):
        """(points, elements, nodes per element, 6) n and m, dimensionless; they jump at point loads."""
        return Threads(self).taken_from(self._cut) if self.scene.has_threads else self._cut

    @cached_property
    def _cut(self):
        """As `_contact`, with the forces of threads along the rods: all that a cut carries."""
        carried = Threads(self).at_gauss() if self.scene.has_threads else None
        return element_contact(self, self._all, carried)

    def _at_clamp(self, point, joined):
        """See `Reactions`: from the contact forces and moments at the ends of the elements there."""
        internal = -self._stacked("clamp_loads")[:, point]
        for rod, vertex in joined:
            cells = self._cells(rod)
            if vertex > 0:
                internal += self._cut[:, cells.start + vertex - 1, -1]
            if cells.start + vertex < cells.stop:
                internal -= self._cut[:, cells.start + vertex, 0]
        return internal

    def _contact_of(self, k):
        return self._contact[k]

    def _contact_in(self, cell):
        return self._contact[:, cell]


class PerturbedPath(Path):
    """States of a slightly changed scene; stations, rods and supports of the given path's scene stand for its own."""

    @classmethod
    def beside(cls, path, model):
        """An empty one for the scene that a model was loaded with, beside `path`."""
        found = cls.of(model)
        found._given, found.comm = path, path.comm
        return found

    def station(self, station):
        """See `Result`: its own station at the same share of the rod's length."""
        scene = self.scene
        if not isinstance(station, str) and getattr(station, "rod", None) in scene.rods:
            return station
        known = self._given.station(station)
        rod, share = self.rod(known.rod), known.s / known.rod.length
        return rod.end if share == 1 else rod.at(share * rod.length)

    def rod(self, rod=None):
        if rod in self.scene.rods:
            return rod
        return self.scene.rods[self._given.scene.rods.index(self._given.rod(rod))]

    def reaction(self, support):
        if support not in self.scene.supports:
            found = [self.scene.supports[i] for i in self._given.scene.supports_of(support)]
            parts = [super(PerturbedPath, self).reaction(x) for x in found]
            return tuple(sum(part) for part in zip(*parts, strict=True))
        return super().reaction(support)


def errors_in_words(path):
    """A sentence on the largest estimated errors; none where they are unknown."""
    known = [(name, values.max()) for name, values in path.errors._asdict().items() if not np.isnan(values).any()]
    if known and len(path):
        by_rounding = dict(zip(path.judged, path.rounding_errors.max(axis=1), strict=True))
        told = ", ".join(
            f"{words_of(name)} {worst:.1e}{' (rounding)' if 0 < worst <= by_rounding[name] else ''}"
            for name, worst in known
        )
        yield f"Estimated errors, each relative to the largest of its kind, are at most: {told}."


def _bounded(path):
    """The criteria that `tol` bounds, in words."""
    *names, last = map(words_of, path.bounded)
    return f"{', '.join(names)} and {last}, relative" if names else f"{last}, relative"


def stability(negative_modes):
    """'yes', 'no (2)' with the number of negative modes, or 'undecided'."""
    if negative_modes < 0:
        return "undecided"
    return "yes" if negative_modes == 0 else f"no ({negative_modes})"
