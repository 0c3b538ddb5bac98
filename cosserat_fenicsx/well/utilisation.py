"""How much of a string's strength its loads take, along the string: `TorqueAndDrag.utilisation`; and its chart."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.pictures.charts import COLOURS, GREY, legend, scale, unit_of
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.results.result import ChartedBetween, by_name
from cosserat_fenicsx.well.strength import GRADES, MODES, UNKNOWN, PipeStrength, bent, span_of, usual_yield
from cosserat_fenicsx.well.charts import (
    DEPTH,
    depths_between,
    over_depth,
    rows_between,
    string_in_hole,
    title_of,
)
from cosserat_fenicsx.well.components import DrillPipe
from cosserat_fenicsx.well.contacts import stretches
from cosserat_fenicsx.well.pieces import von_mises
from cosserat_fenicsx.well.tables import shown_rows

#: Distance of tool joints (m) where it is not given: of pipe of range 2.
RANGE_2 = 9.45
#: Where in a section, in the order of `Utilisation.by_surface`.
SURFACES = ("outer, tension side", "outer, compression side", "inner, tension side", "inner, compression side")
_KINDS = {"von_mises": "von Mises", "tension": "tension", "torsion": "torsion", "burst": "burst",
          "collapse": "collapse", "fatigue": "fatigue"}  # fmt: skip
_ALONG = ("place",)


def strengths_of(owner, laid, grade, wear):
    """[`PipeStrength`] of components in their places, None of a bit; see `TorqueAndDrag.utilisation`."""
    names = list(dict.fromkeys(place.component.name for place in laid))
    for what, given in (("grade", grade), ("wear", wear)):
        for name in given if isinstance(given, Mapping) else ():
            if name not in names:
                raise SceneError(f"{owner}: {what}[{name!r}]: no component of this name, {nearest(name, names)}")
    return [_strength(owner, place.component, grade, wear) for place in laid]


def _strength(owner, part, grade, wear):
    if part.touches == "bottom":
        return None
    if part.outer_diameter is None:
        raise SceneError(
            f"{owner}: {part.name} has no diameters, so that its stresses are not known: expected a component with "
            "outer and inner diameter, such as DrillPipe(size='5 in 19.50 lb/ft')"
        )
    worn = isinstance(part, DrillPipe)  # the classes of wear are of drill pipe
    left = wear.get(part.name, 1.0) if isinstance(wear, Mapping) else wear if worn else 1.0
    usual = usual_yield(part)
    given = grade.get(part.name, usual) if isinstance(grade, Mapping) else grade if usual is None else usual
    if given is None:
        refuse(owner, f"grade[{part.name!r}]", None, f"a grade ({', '.join(GRADES)}) or a yield strength (Pa)")
    if worn and part.joint_spacing is None and (part.tool_joint or 0.0) > part.outer_diameter:
        part = replace(part, joint_spacing=RANGE_2)
    return PipeStrength(part, given, left)


@dataclass(frozen=True, eq=False, repr=False)
class Utilisation(ChartedBetween):
    """Loads over what the body of the string bears, from `TorqueAndDrag.utilisation`: 1 is the limit.

    Arrays run along `md` as those of the answer; NaN of the bit, and where something is not known, which `notes` say.
    `plot` draws the string in its hole, its utilisation, tension with what it may be, and the dogleg of the hole with
    what is allowed, depth downwards.

    Attributes:
        answer: the `TorqueAndDrag`. strengths: [`PipeStrength`] from the bit up, None of a bit.
    """

    answer: Any
    strengths: list

    _rows_axis, _chart = "place", "well.utilisation.utilisation_figure"
    _quantities = by_name(
        Quantity("largest", "largest utilisation, von Mises", axes=()),
        Quantity("worst_at", "its measured depth", "m", axes=()),
        Quantity("md", "measured depth", unit="m", axes=_ALONG, short="md"),
        Quantity("component_name", "component", axes=_ALONG),
        Quantity("von_mises", "von Mises stress over yield strength", axes=_ALONG, digits=3, short="von Mises"),
        Quantity("worst_surface", axes=_ALONG),
        Quantity("tension", "tension over its limit", axes=_ALONG, digits=3, short="tension"),
        Quantity("torsion", "torsion over its limit", axes=_ALONG, digits=3, short="torsion"),
        Quantity("burst", "burst over its limit", axes=_ALONG, digits=3, short="burst"),
        Quantity("collapse", "collapse over its limit", axes=_ALONG, digits=3, short="collapse"),
        Quantity("fatigue", "bending over its fatigue limit", axes=_ALONG, digits=3, short="fatigue"),
        Quantity("bending_stress", unit="Pa", axes=_ALONG, digits=4, short="bending"),
        Quantity("dogleg_severity", "dogleg", "rad/m", axes=_ALONG, shown="deg/30m", digits=3),
        Quantity("allowed_dogleg", unit="rad/m", axes=_ALONG, shown="deg/30m", digits=3),
        Quantity("joint_factor", "factor of tool joints on bending", axes=_ALONG, digits=4),
        Quantity("contact_mode", "contact between tool joints", axes=_ALONG),
        Quantity("by_surface", "von Mises", parts=SURFACES, axes=_ALONG),
    )  # fmt: skip
    _on_screen = ("md", "component_name", "von_mises", "tension", "torsion", "burst", "collapse", "fatigue",
                  "bending_stress", "dogleg_severity", "allowed_dogleg")  # fmt: skip

    md = property(lambda self: self.answer.md, doc="Measured depths, m.")
    component_name = property(lambda self: self.answer.value("component_name"), doc="Names of components.")
    dogleg_severity = property(lambda self: self.answer.dogleg_severity, doc="Curvature of the hole, rad/m.")

    def __len__(self):
        return len(self.md)

    def _of(self, value):
        """Values at `md` of a function of a `PipeStrength` and of the places of its component; NaN of a bit."""
        found = np.full(len(self.md), np.nan)
        for i, strength in enumerate(self.strengths):
            here = self.answer.component == i
            if strength is not None and here.any():
                found[here] = value(strength, here)
        return found

    @cached_property
    def _bent(self):
        """Curvature of the pipe where tool joints carry it, over the hole's, and its `mode`."""
        answer, mode = self.answer, np.zeros(len(self.md), dtype=int)

        def factor(strength, here):
            half, gap = span_of(strength.pipe)
            if half is None:
                return 1.0
            curvature, worn = answer.dogleg_severity[here], (strength.pipe.outer_diameter - strength.outer_diameter) / 2
            found = bent(strength.bending, half, gap + worn, answer.tension[here], curvature)
            mode[here] = found.mode
            largest = np.maximum(found.joint, found.middle)
            straight = np.where(found.mode == UNKNOWN, np.nan, 1.0)
            return np.divide(largest, curvature, out=straight, where=curvature > 0)

        return self._of(factor), mode

    joint_factor = property(
        lambda self: self._bent[0], doc="Of tool joints on the curvature; see `bending_between_joints`."
    )

    @property
    def contact_mode(self) -> np.ndarray:
        """Texts: how the body touches the wall between tool joints, as `PipeBetweenJoints.mode`."""
        return np.array(MODES)[self._bent[1]]

    @cached_property
    def curvature(self) -> np.ndarray:
        """Largest curvature of the pipe, rad/m, with the bending stiffness EI of its worn body throughout: of the hole
        times `joint_factor`, or of the hole and of a helix with the string's clearance where the compression F is above
        the worn pipe's load of buckling (r F/2 EI); of the rod in contact its moment over EI where that is larger,
        which is too much where the hole imposes the curvature on a worn pipe. Tensions, and moments of the rod, are
        those of the answer, whose pipe is as it was given."""
        answer, EI = self.answer, self._of(lambda strength, here: strength.bending)
        along = answer.dogleg_severity * self.joint_factor
        if answer.model == "rod":
            return np.maximum(along, answer.bending_moment / EI)
        with np.errstate(invalid="ignore"):
            buckled = answer.buckles_at(EI)[0] < -answer.tension
        helix = answer.dogleg_severity + answer.clearance * -answer.tension / (2 * EI)
        return np.where(buckled, np.maximum(along, helix), along)

    @cached_property
    def bending_stress(self) -> np.ndarray:
        """Largest, Pa."""

        def stress(strength, here):
            return strength.pipe.material.E * strength.outer_diameter / 2 * self.curvature[here]

        return self._of(stress)

    @cached_property
    def by_surface(self) -> np.ndarray:
        """(n, 4) von Mises stress over the yield strength, at the places `SURFACES` of the section."""
        answer, found = self.answer, np.full((len(self.md), 4), np.nan)
        outside, inside = answer._pressures
        for i, strength in enumerate(self.strengths):
            here = answer.component == i
            if strength is not None and here.any():
                section = strength.section
                moment = strength.bending * self.curvature[here]
                pressures = outside[here], inside[here]
                true = strength.true_tension(answer.tension[here], *pressures)
                found[here] = (von_mises(section, true, answer.torque[here], moment, *pressures)
                               / strength.yield_strength).T  # fmt: skip
        return found

    @cached_property
    def von_mises(self) -> np.ndarray:
        """(n,) the largest of `by_surface`."""
        return self.by_surface.max(axis=1)

    @property
    def worst_surface(self) -> np.ndarray:
        """(n,) texts: where in the section that is; "" where it is not known."""
        which = np.argmax(np.nan_to_num(self.by_surface, nan=-1.0), axis=1)
        return np.where(np.isnan(self.von_mises), "", np.array(SURFACES)[which])

    @cached_property
    def tension(self) -> np.ndarray:
        """(n,) effective tension or compression over the tension at yield."""
        return self._of(lambda strength, here: np.abs(self.answer.tension[here]) / strength.tension)

    @cached_property
    def torsion(self) -> np.ndarray:
        """(n,) torque over the torque at yield with the tension there."""

        def share(strength, here):
            return _over(np.abs(self.answer.torque[here]), strength.torque_at(self.answer.tension[here]))

        return self._of(share)

    @cached_property
    def burst(self) -> np.ndarray:
        """(n,) pressure inside above that outside, over the limit."""
        outside, inside = self.answer._pressures
        return self._of(lambda strength, here: np.maximum(inside[here] - outside[here], 0.0) / strength.burst)

    @cached_property
    def collapse(self) -> np.ndarray:
        """(n,) pressure outside, less the part that the one inside carries, over the limit with the tension there."""
        outside, inside = self.answer._pressures

        def share(strength, here):
            pressure = np.maximum(strength.outer_excess(outside[here], inside[here]), 0.0)
            return _over(pressure, strength.collapse(self.answer.tension[here]))

        return self._of(share)

    @cached_property
    def fatigue(self) -> np.ndarray:
        """(n,) bending stress over what drill pipe may have when it rotates; NaN of other components."""
        return self._of(lambda strength, here: _over(self.bending_stress[here],
                                                     strength.fatigue_stress(self.answer.tension[here])))  # fmt: skip

    @cached_property
    def allowed_dogleg(self) -> np.ndarray:
        """(n,) curvature of a hole, rad/m, in which drill pipe may rotate with the tension there (Lubinski)."""
        return self._of(lambda strength, here: strength.allowed_dogleg(self.answer.tension[here]))

    @property
    def largest(self) -> float:
        """The largest `von_mises`; NaN where it is nowhere known."""
        return float(np.nanmax(self.von_mises, initial=-np.inf)) if np.isfinite(self.von_mises).any() else np.nan

    @property
    def worst_at(self) -> float:
        """Its measured depth, m."""
        return float(self.md[self._worst()])

    def _worst(self, name="von_mises"):
        return int(np.argmax(np.nan_to_num(getattr(self, name), nan=-1.0)))

    def notes(self, units: Any = "SI") -> list[str]:
        """Sentences on what is exceeded, not known or assumed, in some units."""
        return list(self._notes(Units(units)))

    def _notes(self, units):
        turns = self.answer.operation.direction(1.0)[1] != 0
        for name, kind in _KINDS.items():
            where = self._where(np.nan_to_num(getattr(self, name)) > 1, units)
            if where and (turns or name != "fatigue"):
                yield f"EXCEEDED: {kind} at md = {where}."
        if not turns:
            yield "The string does not rotate here, so that fatigue and the allowed dogleg are those if it did."
        unknown = self._where(self._bent[1] == UNKNOWN, units)
        if unknown:
            yield (
                f"NOT KNOWN: bending at md = {unknown}: in compression the body touches the wall or buckles between "
                "its tool joints; utilisation by von Mises and fatigue leave these places out. Solve it with "
                "model='rod' and the joints as Centraliser(spacing, diameter)."
            )
        assumed = {x.pipe.name for x, place in zip(self.strengths, self.answer.laid, strict=True)
                   if x is not None and x.pipe is not place.component}  # fmt: skip
        if assumed:
            far = units.told(RANGE_2, "m")
            yield f"Assumed: tool joints every {far} (range 2) on the {', '.join(sorted(assumed))}: give joint_spacing."

    def _where(self, where, units):
        unit, size = units.on_screen(self.quantities["md"])
        found = [f"{a / size:.5g} to {b / size:.5g}" for a, b in stretches(self.md, where)]
        more = f" and {len(found) - 3} more" if len(found) > 3 else ""
        if not found and where.any():
            found = [f"{self.md[where][0] / size:.5g}"]
        return f"{', '.join(found[:3])}{more} {unit}" if found else ""

    @property
    def _by_name(self):
        """{name: `PipeStrength`} of the components that have one."""
        return {x.pipe.name: x for x in self.strengths if x is not None}

    def _about(self):
        return {"kind": "Utilisation", "operation": self.answer.operation.name, "depth": self.answer.depth,
                "yield_strength": {name: x.yield_strength for name, x in self._by_name.items()}}  # fmt: skip

    def _answer(self, units):
        i = self._worst()
        yield (
            f"{self.answer.operation.name}, bit at {self._told('md', units, self.answer.depth)}: largest utilisation "
            f"{self.largest:.3g} of the yield strength (von Mises), at md = {self._told('md', units, self.worst_at)}, "
            f"{self.component_name[i]}, {self.worst_surface[i]} of bending{self._known_part()}. Strength: "
            f"{', '.join(self._grades(units))}."
        )
        others = [(name, kind, self._worst(name)) for name, kind in list(_KINDS.items())[1:]]
        told = [f"{kind} {getattr(self, name)[j]:.3g} at {self._told('md', units, self.md[j])}"
                for name, kind, j in others if np.nan_to_num(getattr(self, name)[j]) > 0]  # fmt: skip
        if told:
            yield f"The largest shares of each limit alone: {', '.join(told)}."
        yield from self._notes(units)

    def _known_part(self):
        return ", where it is known" if (self._bent[1] == UNKNOWN).any() else ""

    def _grades(self, units):
        """Yield strength and wear of each component."""
        for x in self._by_name.values():
            wear = f" with {100 * x.wear:g} % of the wall left" if x.wear < 1 else ""
            yield f"{x.pipe.name} {units.told(x.yield_strength, 'Pa', form='.4g')}{wear}"

    def _more(self, units):
        for strength in self._by_name.values():
            yield from strength.sentences(units)

    def _table(self, units, rows):
        which = np.array(shown_rows(self.answer))
        which = which[screen.rows_of(len(which), rows)]
        names = [x for x in self._on_screen if not (x in ("burst", "torsion") and not np.nanmax(getattr(self, x)) > 0)]
        known = self.quantities
        return screen.table([(known[x], np.asarray(known[x].of(self))[which]) for x in names], units, rows,
                            "loads over limits of the pipe body",
                            "von Mises over yield strength; each other load over its limit alone; fatigue and allowed "
                            "dogleg: of drill pipe that rotates")  # fmt: skip

    def __repr__(self):
        return f"Utilisation({self.answer.operation.name}: largest {self.largest:.4g} at md = {self.worst_at:g} m)"


def _over(load, limit):
    """Their ratio; infinite where a load has no limit left."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(load > 0, load / limit, 0.0 * load * limit)  # NaN where one of them is not known


_SHARE = Quantity("share of the limit", unit="1")
_TENSION = Quantity("effective tension", unit="N", shown="kN")
_DOGLEG = Quantity("dogleg", unit="rad/m", shown="deg/30m")
_BENDING = Quantity("bending stress", unit="Pa", shown="MPa")
# The shares that are drawn, the first in black.
_SHARES = ("von_mises", "tension", "torsion", "collapse", "burst")
# Doglegs are shown up to this many times the hole's largest.
_FAR = 3.0


def utilisation_figure(use, between=None):
    """The string in its hole, shares of limits, tension, bending stress and doglegs; see `Utilisation.plot`."""
    answer = use.answer
    top, bottom = depths_between("plot", between, answer.depth)
    rotating = np.isfinite(use.allowed_dogleg).any()
    draws = [_shares, _tension, _bending, *([_doglegs] if rotating else [])]
    figure, panels, _, length = over_depth([2.0, 2.9, 2.4, 2.4, 2.4][: 1 + len(draws)], DEPTH)
    rows, room = rows_between(use.md, top, bottom), 0.01 * (bottom - top)
    depth = use.md[rows] / length
    panels[0].set_ylim((bottom + room) / length, (top - room) / length)
    string_in_hole(panels[0], answer, rows, depth)
    for panel, draw in zip(panels[1:], draws, strict=True):
        draw(panel, use, rows, depth)
    legend(*panels)
    unit, size = unit_of(DEPTH)
    told = f"largest utilisation {use.largest:.3g} (von Mises), at {use.worst_at / size:.5g} {unit}"
    figure.suptitle(f"Strength: {title_of(answer, top, bottom)}\n{told}")
    return figure


def _shares(panel, use, rows, depth):
    for i, name in enumerate(_SHARES):
        values = getattr(use, name)[rows]
        if np.nanmax(values, initial=0.0) > 1e-3:
            look = {"color": "black", "linewidth": 2.0} if i == 0 else {"color": COLOURS[i - 1]}
            panel.plot(values, depth, label=_KINDS[name], **look)
    most = max(1.15, 1.1 * min(np.nanmax(use.von_mises[rows], initial=0.0), 3.0))
    panel.axvspan(1.0, most, color="tab:red", alpha=0.15, linewidth=0, label="beyond the limit")
    panel.set_xlim(0.0, most)
    panel.set_xlabel(_SHARE.heading())


def _tension(panel, use, rows, depth):
    heading, size = scale(_TENSION)
    tension, torque = use.answer.tension[rows], use.answer.torque
    limit = use._of(lambda strength, here: strength.tension_at(torque[here]))[rows]
    panel.plot(tension / size, depth, color="black", label="effective tension")
    panel.plot(limit / size, depth, color="tab:red", label="at yield, with the torque")
    panel.axvline(0.0, color="black", linewidth=0.6)
    panel.set_xlim(right=1.15 * max(np.nanmin(limit), tension.max()) / size)
    panel.set_xlabel(heading)


def _bending(panel, use, rows, depth):
    heading, size = scale(_BENDING)
    fatigue = use._of(lambda strength, here: strength.fatigue_stress(use.answer.tension[here]))[rows]
    panel.plot(use.bending_stress[rows] / size, depth, color="black", label="bending stress")
    if np.isfinite(fatigue).any():
        panel.plot(fatigue / size, depth, color="tab:orange", label="fatigue limit of drill pipe that rotates")
    panel.set_xlim(left=0.0)
    panel.set_xlabel(heading)


def _doglegs(panel, use, rows, depth):
    heading, size = scale(_DOGLEG)
    hole, allowed = use.dogleg_severity[rows] / size, use.allowed_dogleg[rows] / size
    panel.plot(hole, depth, color=GREY, linewidth=1.5, label="dogleg of the hole")
    panel.plot(allowed, depth, color="tab:orange", linestyle="--", label="allowed dogleg (fatigue)")
    most = max(np.nanmax(hole, initial=0.0), np.nanmin(allowed) if np.isfinite(allowed).any() else 0.0)
    panel.set_xlim(0.0, _FAR * most if most > 0 else None)
    panel.set_xlabel(heading)
