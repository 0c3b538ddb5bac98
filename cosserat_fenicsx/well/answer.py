"""The answer of `torque_and_drag`: surface loads, and the state along the string."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cosserat_fenicsx.checks import File, positive
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.result import ChartedBetween, by_name
from cosserat_fenicsx.well import criteria, tables
from cosserat_fenicsx.well.components import DrillString
from cosserat_fenicsx.well.contacts import WallContact, contacts_of, high_side, side_force_up_to, sides_of
from cosserat_fenicsx.well.softstring import UP_TO, Differentiated
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.pieces import Sections, down_along, sections_of, stretch, true_tension, von_mises
from cosserat_fenicsx.well.reserves import MarginOfOverpull, MostWeightOnBit, most_weight_of, overpull_of
from cosserat_fenicsx.well.utilisation import Utilisation, strengths_of

# A torque below this share of the largest tension times the contact radius is nothing that errors are compared with.
_LITTLE = 1e-2
# A torque below this share of the largest tension times the contact radius is none.
_NO_TORQUE = 1e-4


def _axis_of_hole(k):
    return lambda answer: answer.hole.path.position(answer.md)[:, k]


def _of_contacts(name):
    return lambda answer: np.array([getattr(contact, name) for contact in answer.contacts])


def _degrees(name):
    return lambda answer: np.degrees(getattr(answer, name))


_ALONG, _CONTACT = ("place",), ("contact",)
_QUANTITIES = by_name(
    Quantity("hook_load", unit="N", axes=()),
    Quantity("surface_torque", unit="N m", axes=(), noise=1e-2),
    Quantity("drag", "friction", "N", axes=()),
    Quantity("error", "estimated relative error of the solution", axes=()),
    Quantity("model_error", "estimated relative error of the model", axes=()),
    Quantity("stretch", unit="m", axes=()),
    Quantity("twist", unit="rad", axes=(), noise=1e-8),
    Quantity("neutral_point", unit="m", axes=()),
    Quantity("bit_side_force", unit="N", parts=("build", "turn"), frame="across the hole", axes=()),
    Quantity("bit_tilt", unit="rad", parts=("build", "turn"), frame="across the hole", axes=()),
    Quantity("md", "measured depth", unit="m", axes=_ALONG, short="md"),
    Quantity("north", unit="m", axes=_ALONG, getter=_axis_of_hole(0)),
    Quantity("east", unit="m", axes=_ALONG, getter=_axis_of_hole(1)),
    Quantity("down", unit="m", axes=_ALONG, getter=_axis_of_hole(2)),
    Quantity("inclination", unit="deg", axes=_ALONG, getter=_degrees("inclination"), digits=4, short="incl."),
    Quantity("azimuth", unit="deg", axes=_ALONG, getter=_degrees("azimuth")),
    Quantity("tension", "effective tension", "N", axes=_ALONG, noise=1e-2, digits=5, short="tension"),
    Quantity("true_tension", unit="N", axes=_ALONG),
    Quantity("pressure_outside", unit="Pa", axes=_ALONG),
    Quantity("pressure_inside", unit="Pa", axes=_ALONG),
    Quantity("torque", unit="N m", axes=_ALONG, noise=1e-2, digits=5),
    Quantity("side_force", unit="N/m", axes=_ALONG, dimension="force per length"),
    Quantity("distributed_force", "distributed side force", "N/m", axes=_ALONG, dimension="force per length",
             shown="N/m", digits=5, short="side force"),
    Quantity("contact_side", "contact side from the high side", "deg", axes=_ALONG, getter=_degrees("contact_side")),
    Quantity("standoff", "stand-off", axes=_ALONG),
    Quantity("clearance", unit="m", axes=_ALONG, dimension="diameter"),
    Quantity("bending_moment", unit="N m", axes=_ALONG, noise=1e-2, digits=4, short="moment"),
    Quantity("von_mises", "von Mises", "Pa", axes=_ALONG, digits=4),
    Quantity("state", axes=_ALONG, getter=lambda answer: np.array([criteria.STATES[x] for x in answer.buckling])),
    Quantity("component_name", "component", axes=_ALONG,
             getter=lambda answer: np.array([x.name for x in answer.string.components])[answer.component]),
    Quantity("contact_top", "from md", "m", axes=_CONTACT, getter=_of_contacts("top")),
    Quantity("contact_bottom", "to md", "m", axes=_CONTACT, getter=_of_contacts("bottom")),
    Quantity("contact_force", "force", "N", axes=_CONTACT, digits=5, getter=_of_contacts("force")),
    Quantity("contact_error", "error", "N", axes=_CONTACT, digits=5, getter=_of_contacts("error")),
    Quantity("contact_where", "side", axes=_CONTACT, getter=_of_contacts("side")),
    Quantity("contact_component", "component", axes=_CONTACT,
             getter=lambda answer: np.array([tables.parts_at(answer, x) for x in answer.contacts])),
)  # fmt: skip


class Judged(NamedTuple):
    """What is said of the model of an answer: see `TorqueAndDrag`; decided: the sentences on why the rod follows."""

    why: tuple[str, ...]
    model_error: float
    left_out: tuple[float, float]
    decided: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class TorqueAndDrag(Differentiated, ChartedBetween):
    """Loads of a string in its hole, from `torque_and_drag`. SI units; depths are measured depths.

    Arrays run down the hole along `md`, which repeats a depth where something jumps: the value above it, then that
    below. A string of components that are given by numbers has no true tension and no von Mises stress (NaN).

    `plot` draws the string in its hole, tension with the loads of buckling, torque, side force per length and at
    points, and bending moment along the string, depth downwards.

    Attributes:
        model: what was solved: "soft", "buckled" or "rod".
        differences: {model: (N, N m)}: hook load and surface torque less those of the other models that were solved.
        error: estimated error of hook load and surface torque as solutions of the model's equations, over the largest
            tension and torque along the string (over 1 % of that tension times the contact radius where this is more).
        enough: whether both are within `tol`, as far as they are estimated, of hook load and surface torque alone;
            False warns that the model does not suffice for the accuracy asked for.
        torque_convention: "coulomb" or "johancsik", see `torque_and_drag`.
        laid, pieces: the string in its place, and cut where anything jumps; solved: what was found on it. by_rod: the
            function that solves the rod in contact from an answer of a flexible string. judge: that gives `judged`.
    """

    words = property(lambda self: f"{self.model} string", doc="What was solved, for titles.")
    distributed_force = property(lambda self: self.side_force, doc="`side_force` (N/m) without forces at points.")
    # For the tables: how the bending moment was found, and effects that no error estimate includes.
    _quantities, _rows_axis, _beside = _QUANTITIES, "place", MappingProxyType({"_contacts": "contact"})
    _chart = "well.charts.answer_figure"
    _on_screen = ("md", "component_name", "inclination", "tension", "torque", "distributed_force", "bending_moment",
                  "von_mises", "state")  # fmt: skip
    _moment_words: ClassVar[str] = "EI times the hole's curvature"
    _leaves_out: ClassVar[str] = ""

    hole: Borehole
    string: DrillString
    operation: Operation
    mud: Mud | None
    depth: float
    model: str
    tol: float
    torque_convention: str
    error: float
    differences: dict[str, tuple[float, float]]
    laid: Any
    pieces: Any
    solved: Any
    by_rod: Any
    judge: Any

    @cached_property
    def judged(self) -> "Judged":
        """`why`, `model_error` and `left_out`, found when they are asked for."""
        return self.judge()

    def adding(self, sentence: str) -> "TorqueAndDrag":
        """The same with one more sentence in `why`."""
        return replace(self, judge=partial(self.judged._replace, why=(*self.why, sentence)))

    @property
    def why(self) -> tuple[str, ...]:
        """Sentences on what decided for the model, and what it leaves out."""
        return self.judged.why

    @property
    def model_error(self) -> float:
        """Estimate, relative as `error`, of how far hook load and surface torque of the rod in contact may be, which is
        stiff and has a clearance: the error of the model, not of its solution. NaN: not estimated, of the rod itself.
        """
        return self.judged.model_error

    @property
    def left_out(self) -> tuple[float, float]:
        """`model_error` of hook load (N) and of surface torque (N m), not relative."""
        return self.judged.left_out

    @property
    def quantities(self):
        """{name: `Quantity`}, see `Result.quantities`; friction and torques up to their estimated errors are noise."""
        known, (tension, torque) = super().quantities, scales_of(self.solved, self.pieces)
        error, least = np.nan_to_num(self.error), _NO_TORQUE * tension * self.pieces.radius.max()
        noise = {"drag": error * tension} | dict.fromkeys(("surface_torque", "torque"), max(error * torque, least))
        known.update({x: replace(known[x], noise=max(known[x].noise, float(size))) for x, size in noise.items()})
        return known

    @property
    def enough(self) -> bool:
        """Whether the errors of solution and model are within `tol`: those of hook load and surface torque."""
        return self.error + float(np.nan_to_num(self.model_error, nan=0.0, posinf=np.inf)) <= self.tol

    @property
    def hook_load(self) -> float:
        """Effective tension at the surface, N, without block and sheaves. Negative where the string must be pushed."""
        return float(self.solved.tension[-1, -1])

    @property
    def surface_torque(self) -> float:
        """N m."""
        return float(self.solved.torque[-1, -1])

    @property
    def bit_side_force(self) -> np.ndarray:
        """(2,) force with which the bit presses on the wall, N: to the high side of the hole, which builds inclination
        where it is above 0 (north where the hole is vertical), and to the right of it looking down the hole, where it
        turns. NaN of a soft string, and of one without a bit."""
        return np.full(2, np.nan)

    @property
    def bit_tilt(self) -> np.ndarray:
        """(2,) angle of the bit's axis against the hole's, rad: towards the high side, and to the right of it, see
        `bit_side_force`. NaN of a soft string, which lies on the axis."""
        return np.full(2, np.nan)

    @cached_property
    def drag(self) -> float:
        """Hook load less the hook load of the same string without friction, N."""
        return self.hook_load + self.operation.weight - self._gravity

    @cached_property
    def _gravity(self):
        """The weight in mud that pulls along the hole, N."""
        pieces, down = self.pieces, self.hole.path.position
        return float(pieces.weight @ (down(pieces.bottom) - down(pieces.top))[:, 2])

    def _down(self, rows):
        """Rows over pieces and places up the hole, as one array down it."""
        return np.ascontiguousarray(rows[::-1, ::-1]).ravel()

    @cached_property
    def _piece(self):
        """Index of the piece at `md`."""
        return self._down(np.repeat(self.solved.chain.origin[:, None], len(self.solved.at), axis=1))

    def _of_piece(self, values):
        """Values of pieces at `md`."""
        return values[self._piece]

    @cached_property
    def md(self) -> np.ndarray:
        """Measured depths, m."""
        chain, pieces = self.solved.chain, self.pieces
        below = np.concatenate([[0.0], np.cumsum(chain.length)])[:-1]
        first = np.flatnonzero(np.diff(chain.origin, prepend=-1))  # first parts of pieces, whose ends are exact
        bottom = pieces.bottom[chain.origin] - (below - np.repeat(below[first], np.diff(first, append=len(below))))
        top = np.append(bottom[1:], 0.0)
        return self._down(bottom[:, None] + (top - bottom)[:, None] * self.solved.at)

    @cached_property
    def tension(self) -> np.ndarray:
        """Effective tension, N, which balances the buoyed weight. Compression is negative."""
        return self._down(self.solved.tension)

    @cached_property
    def torque(self) -> np.ndarray:
        """N m."""
        return self._down(self.solved.torque)

    @cached_property
    def side_force(self) -> np.ndarray:
        """Force of the wall per length, N/m, across the hole and without friction."""
        return self._down(self.solved.side)

    @cached_property
    def component(self) -> np.ndarray:
        """Index of the component in `string.components`."""
        return self._of_piece(self.pieces.component)

    @cached_property
    def clearance(self) -> np.ndarray:
        """Radius of the hole less the contact radius, m."""
        return self._of_piece(self.pieces.hole - self.pieces.radius)

    @cached_property
    def inclination(self) -> np.ndarray:
        """rad."""
        return self.hole.path.inclination_at(self.md)

    @cached_property
    def azimuth(self) -> np.ndarray:
        """rad from 0 to 2 pi; without meaning where the hole is vertical."""
        return self.hole.path.azimuth_at(self.md)

    @cached_property
    def dogleg_severity(self) -> np.ndarray:
        """Curvature of the hole, rad/m."""
        return self._of_piece(self.pieces.curvature)

    @cached_property
    def bending_moment(self) -> np.ndarray:
        """N m. Of the soft string: EI times the curvature of the hole's axis. NaN where EI is not known."""
        return self._sections.EI * self.dogleg_severity

    @cached_property
    def standoff(self) -> np.ndarray:
        """Distance from the wall over the clearance: 0 in contact. The soft string is in contact wherever it loads the
        wall; 1, in the middle, elsewhere."""
        return np.where(self.side_force > 0, 0.0, 1.0)

    @cached_property
    def contact_side(self) -> np.ndarray:
        """The side of the hole that the string touches, rad clockwise from its high side looking down it: pi is the low
        side. NaN where the hole is vertical, or nothing is touched. A rotating pipe climbs by atan(e_s mu)."""
        return self._down(sides_of(self.pieces, self.solved, self.torque_convention == "coulomb"))

    @cached_property
    def offset(self) -> np.ndarray:
        """(n, 3) from the hole's axis to the string, across the hole, m. The soft string, which has no place of its
        own: to the wall where it loads it; zero where the side is not known."""
        high, side = high_side(self.hole.path.tangent(self.md)), self.contact_side[:, None]
        right = np.cross(self.hole.path.tangent(self.md), high)
        return self.clearance[:, None] * np.nan_to_num(np.cos(side) * high + np.sin(side) * right)

    @property
    def position(self) -> np.ndarray:
        """(n, 3) north, east, down of the string, m."""
        return self.hole.path.position(self.md) + self.offset

    @cached_property
    def contacts(self) -> list[WallContact]:
        """From the surface down (top, bottom, force, side) of each stretch on one side, see `WallContact`."""
        return contacts_of(self.md, self.side_force, self.contact_side, -self._down(side_force_up_to(self.solved)))

    @cached_property
    def _sections(self):
        found = sections_of([place.component for place in self.laid])
        return Sections(*(values[self.component] for values in found))

    @cached_property
    def _pressures(self):
        """Outside and inside at `md`, Pa; NaN where there is no mud."""
        if self.mud is None:
            return np.full((2, len(self.md)), np.nan)
        return self.mud.pressures(self.md, self.hole.path)

    pressure_outside = property(lambda self: self._pressures[0], doc="Of the fluid around it, with flow, Pa.")
    pressure_inside = property(lambda self: self._pressures[1], doc="Of the fluid in it, with flow, Pa.")

    @cached_property
    def true_tension(self) -> np.ndarray:
        """Force in the wall of the pipe, N: effective tension + p_i A_i - p_o A_o, with the pressures of the fluids
        and the areas of the body. NaN without mud, or without diameters."""
        return true_tension(self._sections, self.tension, *self._pressures)

    @cached_property
    def von_mises(self) -> np.ndarray:
        """The largest von Mises stress in the body of the pipe, Pa. NaN without mud, or without diameters."""
        moment = self.bending_moment
        return von_mises(self._sections, self.true_tension, self.torque, moment, *self._pressures).max(axis=0)

    def _integral(self, values):
        """Of values at `md` along the string: by the points of pieces."""
        rows = values.reshape(-1, len(self.solved.at))[::-1, ::-1]
        return float((rows @ UP_TO[-1]) @ self.solved.chain.length)

    @cached_property
    def stretch(self) -> float:
        """How much longer the string is than at rest on the ground, m: by its tension, and by the pressures of the mud
        where these and the diameters are known. NaN where EA is not known."""
        return self._integral(stretch(self._sections, self.tension, *self._pressures))

    @cached_property
    def twist(self) -> float:
        """Rotation of the surface against the lower end, rad. NaN where GJ is not known."""
        return self._integral(self.torque / self._sections.GJ)

    @cached_property
    def neutral_points(self) -> np.ndarray:
        """Measured depths where the effective tension changes its sign, m, from the surface down."""
        T, md = self.tension, self.md
        # rounding may leave something where T vanishes at a point: the crossing is there, between its neighbours
        i = np.flatnonzero(np.abs(T) > 1e-12 * np.abs(T).max())
        crosses = T[i[:-1]] * T[i[1:]] < 0
        above, below = i[:-1][crosses], i[1:][crosses]
        between = md[above] + (md[below] - md[above]) * T[above] / (T[above] - T[below])
        return np.where(below > above + 1, md[np.minimum(above + 1, len(md) - 1)], between)

    @property
    def neutral_point(self) -> float:
        """The lowest of `neutral_points`, m: the string below is in compression. NaN where there is none."""
        return float(self.neutral_points[-1]) if len(self.neutral_points) else np.nan

    @cached_property
    def buckling(self) -> np.ndarray:
        """State at `md`: 0 straight, 1 sinusoidal, 2 helical, by the loads of `well/criteria.py`. 0 where EI is not
        known, or there is no clearance."""
        with np.errstate(invalid="ignore"):
            snake, helix = self.buckling_loads < -self.tension
        return np.where(helix, criteria.HELIX, np.where(snake, criteria.SNAKE, criteria.STRAIGHT))

    @cached_property
    def buckling_loads(self) -> np.ndarray:
        """(2, n) compression, N, above which it is a snake, and a helix, at `md`; NaN where that is not known."""
        return self.buckles_at(self._sections.EI)

    def buckles_at(self, EI: np.ndarray) -> np.ndarray:
        """`buckling_loads` with another bending stiffness (n,), N m^2, at `md`."""
        F = -self.tension
        loose = np.where(self.clearance > 1e-9, self.clearance, np.nan)
        k, across, b = self._loads()
        plain = np.hypot(across - k * F, b)
        weight = self._of_piece(self.pieces.weight)
        with np.errstate(invalid="ignore"):
            return np.array([load(EI, loose, weight, plain) for load in (criteria.snake_load, criteria.helix_load)])

    @cached_property
    def helical(self) -> np.ndarray:
        """True at `md` where the wall force of a helix is in the model's answer."""
        return self._down(np.repeat(self.solved.helical[:, None], len(self.solved.at), axis=1))

    def _loads(self):
        """Curvature, and weight along normal and binormal, at `md`."""
        names = "curvature", "weight", "t", "n", "b", "bottom"
        k, weight, t, n, b, bottom = (self._of_piece(getattr(self.pieces, name)) for name in names)
        return k, weight * down_along(t, n, k * (bottom - self.md))[1], weight * b

    def critical_load(self, criterion: str) -> np.ndarray:
        """Compression (N) at `md` at which the string buckles, by a criterion of `well/criteria.py`.

        Args:
            criterion: "Dawson-Paslay", "Chen", "Wu", "He-Kyllingstad" or "Lubinski".

        Raises:
            SceneError: an unknown name.
        """
        weight, (k, across, along) = self._of_piece(self.pieces.weight), self._loads()
        return criteria.load_of(
            criterion, self._sections.EI, self.clearance, weight, self.inclination, along, across, k
        )

    def utilisation(
        self, grade: str | float | Mapping[str, Any] = "E75", wear: float | str | Mapping[str, Any] = 1.0
    ) -> Utilisation:
        """Loads over what the body of the string bears: von Mises, tension, torsion, burst, collapse, fatigue.

        Args:
            grade: of the drill pipe: "E75", "X95", "G105", "S135" or a yield strength, Pa or text such as "135 ksi";
                or a dict of these by names of components. Heavy-weight pipe (55 ksi), collars and stabilisers (110 ksi,
                100 ksi above 6 7/8 in) have their usual yield strengths where they are not in it.
            wear: share of the wall of the drill pipe that is left, or a class of API RP 7G: "new" (1), "premium" (0.8),
                "class 2" (0.7); or a dict.

        Raises:
            SceneError: an unknown grade or name, a component without diameters, no mud.
        """
        if self.mud is None:
            raise SceneError("utilisation: mud = None: expected the answer of a string in Mud(density); Mud(0) for air")
        return Utilisation(self, strengths_of("utilisation", self.laid, grade, wear))

    def margin_of_overpull(
        self, grade: str | float | Mapping[str, Any] = "E75", wear: float | str | Mapping[str, Any] = 1.0, *,
        safety: float = 1.1,
    ) -> MarginOfOverpull:  # fmt: skip
        """How much more the surface may pull than the hook load of this answer, if the string is stuck.

        Args:
            grade, wear: see `utilisation`. safety: factor on the tension.

        Raises:
            SceneError: see `utilisation`; a safety below 1.
        """
        return overpull_of(self, strengths_of("margin_of_overpull", self.laid, grade, wear), safety)

    def most_weight_on_bit(
        self, grade: str | float | Mapping[str, Any] = "E75", wear: float | str | Mapping[str, Any] = 1.0, *,
        safety: float = 1.1, buckling: str = "helical", model: str = "buckled", progress: bool | None = None,
    ) -> MostWeightOnBit:  # fmt: skip
        """The largest weight on bit of this operation, with its torque on bit, and what limits it: buckling, lock-up,
        strength (von Mises), or the weight of the string, whose hook load is then 0.

        Args:
            grade, wear: see `utilisation`. safety: factor on the von Mises stress.
            buckling: "helical" or "sinusoidal": which of them limits it.
            model: "soft"; "buckled", whose helix also holds the string back; or "rod", the exact rod in contact, of
                which at most 14 equilibria are solved, each with its hook load to 1e-3 of the largest tension: with its
                own tensions, bending moments and clearances; for "sinusoidal" it must not buckle by its second
                variation either. A string of which no equilibrium is found beyond some weight is limited by that, and
                not by lock-up, which the rod does not name. The rod takes about 20 to 50 s.
                This answer may be of another model.
            progress: of the rod; True or False; None shows it in runs of more than two seconds.

        Raises:
            SceneError: see `utilisation`; an operation without a weight on bit; a string that bears none.
            NotConverged: of the rod: the limit was not found with 14 equilibria.
        """
        return most_weight_of(self, grade, wear, safety, buckling, model, progress)

    def of_flexible(self, operation, model, solved):
        """The `TorqueAndDrag` of the same string with another operation and what was found for it, of a flexible
        string; its estimates of errors are those of this one."""
        given = {field.name: getattr(self, field.name) for field in fields(TorqueAndDrag)}
        return TorqueAndDrag(**{**given, "operation": operation, "model": model, "solved": solved})

    # -- tables and pictures -----------------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.md)

    def _about(self):
        names = ("depth", "model", "tol", "enough", "torque_convention", "why")
        return {"kind": "TorqueAndDrag", "operation": self.operation.name} | {x: getattr(self, x) for x in names}

    def _answer(self, units):
        return tables.answer_in_words(self, units)

    def _more(self, units):
        return tables.more_in_words(self, units)

    def _table(self, units, rows):
        return tables.along(self, units, rows)

    def plot_pressures(
        self,
        file: File | None = None,
        between: tuple[float, float] | None = None,
        *,
        units: Any = "SI",
        width: int | None = None,
    ):
        """Draw the fluids around the string and in it, their pressures, effective and true tension, depth downwards.

        Args:
            file, between, units, width: see `plot`.

        Raises:
            SceneError: see `plot`; no mud.
        """
        if self.mud is None:
            raise SceneError("plot_pressures: mud = None: expected the answer of a string in Mud(density)")
        return self._drawn("well.charts.pressures_figure", file, units, width, between)

    def plot_from_side(
        self,
        file: File | None = None,
        length: float | None = None,
        *,
        units: Any = "SI",
        width: int | None = None,
    ):
        """Draw the lower end of a rod in contact in its hole from the side, with the forces of the wall; across the
        hole lengths are enlarged.

        Args:
            file: .png, .pdf or another format of matplotlib (rank 0 writes); None returns the Figure.
            length: of the string that is drawn, from its lower end, m; None for all of it.
            units, width: see `plot`.

        Raises:
            SceneError: a soft string, which has no shape of its own; matplotlib is missing, or the ending is unknown.
        """
        if self.model != "rod":
            raise SceneError(f"plot_from_side: a {self.words} lies on the axis: expected an answer of model = 'rod'")
        length = None if length is None else positive("plot_from_side", "length", length, "m")
        return self._drawn("well.charts.side_figure", file, units, width, length)

    def plot_3d(
        self,
        file: File,
        enlarge: float | None = None,
        between: tuple[float, float] | None = None,
        *,
        units: Any = "SI",
        width: int | None = None,
    ) -> None:
        """Draw the string in its hole in space, coloured by the side force.

        Args:
            file: .png (rank 0 writes).
            enlarge: factor on radii and clearance, which the picture says; None for one that shows them.
            between: measured depths (m) from which to which it shows them.
            units: see `plot`.
            width: of the picture, pixels, 300 to 4000; None for one that the shape of the hole decides.

        Raises:
            SceneError: pyvista is missing, or the name does not end in .png; depths that the string has not.
        """
        from cosserat_fenicsx.well.in_space import draw_in_space

        draw_in_space(self, file, enlarge, between, units, width)

    def __repr__(self):
        loads = f"hook load {self.hook_load:.6g} N, surface torque {self.surface_torque:.6g} N m"
        return f"TorqueAndDrag({self.operation.name}, bit at {self.depth:g} m, {self.model}: {loads})"


def scales_of(solved, pieces):
    """Scales of the relative errors of hook load and surface torque: the largest tension (N) and torque (N m) along the
    string, and for the torque at least a little of that tension times the contact radius."""
    tension = np.abs(solved.tension).max()
    return tension, max(np.abs(solved.torque).max(), _LITTLE * tension * pieces.radius.max())


def share(part, whole):
    """Their ratio; 0 where there is nothing to compare with."""
    return float(part / whole) if whole > 0 else 0.0
