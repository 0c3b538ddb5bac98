"""Derivatives of a torque and drag answer by friction, weights, mud and loads on the bit, and its uncertainty."""

import math
from collections.abc import Iterable, Mapping

import numpy as np

from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.results.sensitivity import Sensitivity, Uncertainty
from cosserat_fenicsx.well.softstring import Change, rates_of

#: {query: its unit}
_QUERIES = {"hook_load": "N", "surface_torque": "N m", "tension": "N", "torque": "N m"}


class Differentiated:
    """Base of `TorqueAndDrag` with its derivatives."""

    def sensitivity(self, parameters: Iterable[str], query: str = "hook_load") -> Sensitivity:
        """Derivatives of a soft string's loads, exactly: the linearised equations are solved on the same pieces.

        Args:
            parameters: names: "friction" (the same change everywhere), "hole.sections[0].friction", "mud.density"
                (inside the string too where it is the same there), "weight" (N/m in mud, of all components),
                "string.components[0].weight" (in mud), "operation.weight" and "operation.torque" (on bit).
            query: "hook_load" (N), "surface_torque" (N m), or "tension" and "torque" at all of `md`.

        Returns:
            Sensitivity, in SI units.

        Raises:
            SceneError: an unknown name or query, a string with a helix, or the rod in contact.
        """
        rod = self.model not in ("soft", "buckled")
        if rod or self.solved.helical.any():
            why = "by the rod in contact" if rod else "for a string with a helix"
            raise SceneError(
                f"sensitivity: this answer is {why} (model = '{self.model}'), which has no derivatives: "
                "expected the answer of torque_and_drag(..., model='soft')"
            )
        if query not in _QUERIES:
            raise SceneError(f"query = {query!r}: {nearest(query, _QUERIES)}")
        names = [parameters] if isinstance(parameters, str) else list(parameters)
        known = self._parameters()
        for name in names:
            if name in ("mud.density", "mud.inside") and isinstance(self.mud and self.mud.density, tuple):
                raise SceneError(
                    f"parameter {name!r} of a string: it is rows of depth and density, which have no one derivative: "
                    "expected one density, Mud(density), or the difference of the answers of two Mud([...])"
                )
            if name not in known:
                plain = ", ".join(x for x in known if "[" not in x)
                raise SceneError(
                    f"parameter {name!r} of a string: known: {plain}, hole.sections[i].friction with i from 0 to "
                    f"{len(self.hole.sections) - 1}, string.components[i].weight with i from 0 to {len(self.laid) - 1}"
                )
        found = {name: known[name] for name in names}
        rates = {name: self._rate(change, query) for name, (change, _, _) in found.items()}
        zero = {name: np.zeros_like(rate) for name, rate in rates.items()}
        return Sensitivity(
            np.asarray(getattr(self, query)), rates, zero, {name: value for name, (_, value, _) in found.items()},
            {name: unit for name, (_, _, unit) in found.items()}, query, _QUERIES[query],
        )  # fmt: skip

    def uncertainty(
        self,
        standard_deviations: Mapping[str, float | str],
        query: str = "hook_load",
        correlation: np.ndarray | None = None,
    ) -> Uncertainty:
        """The first-order standard deviation of a load, with the share of each parameter; it can be printed.

        Args:
            standard_deviations: {name: standard deviation}; names and query as of `sensitivity`.
            correlation: see `Sensitivity.uncertainty`; that of a `FrictionFit` for its coefficients.

        Raises:
            SceneError: as of `sensitivity` and `Sensitivity.uncertainty`.
        """
        return self.sensitivity(standard_deviations, query).uncertainty(standard_deviations, correlation)

    def _rate(self, change, query):
        tension, torque = rates_of(self.solved, self.pieces, change, self.torque_convention == "coulomb")
        if query in ("tension", "torque"):
            return self._down(tension if query == "tension" else torque)
        return np.asarray((tension if query == "hook_load" else torque)[-1, -1])

    def _parameters(self):
        """{name: (`Change`, value, unit)} of all parameters."""
        pieces, operation, mud = self.pieces, self.operation, self.mud
        none, ones = np.zeros(len(pieces.top)), np.ones(len(pieces.top))
        found = {
            "friction": (Change(none, ones, 0.0, 0.0), math.nan, "1"),
            "weight": (Change(ones, none, 0.0, 0.0), math.nan, "N/m"),
            "operation.weight": (Change(none, none, -1.0, 0.0), operation.weight, "N"),
            "operation.torque": (Change(none, none, 0.0, 1.0), operation.torque, "N m"),
        }
        if mud is not None and not isinstance(mud.density, tuple):
            weights = np.array([_by_density(place.component, mud) for place in self.laid])[pieces.component]
            found["mud.density"] = Change(weights, none, 0.0, 0.0), mud.density, "kg/m^3"
        section = np.searchsorted([x.to for x in self.hole.sections[:-1]], (pieces.top + pieces.bottom) / 2)
        for i, one in enumerate(self.hole.sections):
            change = Change(none, (section == i).astype(float), 0.0, 0.0)
            found[f"hole.sections[{i}].friction"] = change, one.friction, "1"
        for i in range(len(self.laid)):
            here = pieces.component == i
            weights = set(pieces.weight[here])
            weight = float(weights.pop()) if len(weights) == 1 else math.nan  # of several, or of none
            found[f"string.components[{i}].weight"] = Change(here.astype(float), none, 0.0, 0.0), weight, "N/m"
        return found


def _by_density(component, mud):
    """Derivative of the weight in mud (N/m) by the mud's density, inside too where it is the same; 0 where the weight
    in mud is given. See `components.weight_in_mud`."""
    if component.weight is not None:
        return 0.0
    bore = math.pi / 4 * component.inner_diameter**2
    lifted = component.mass / component.material.density + bore
    return -mud.gravity * (lifted - bore * (mud.inside == mud.density))
