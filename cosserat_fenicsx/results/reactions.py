"""The reactions of supports."""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.results.on_nodes import OnNodes
from cosserat_fenicsx.scene.describe import describe
from cosserat_fenicsx.scene.rod import StationOrName
from cosserat_fenicsx.scene.supports import Support

# Components below this times the largest force or moment are rounding.
_ROUNDING = 1e-6


class Reactions(OnNodes):
    """Reactions of a result, from the residual of the equations that it solves."""

    def reaction(self, support: Support | StationOrName) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment that a support exerts on its rod in every state.

        They are the multipliers of the support's constraint equations. A clamp has none: its reaction balances the
        internal forces of the rods joined there, the loads on that point, and other supports and joints there.

        In a motion they balance loads and momenta over the step that led to a saved state: they belong to the middle of
        this step with "momentum" and "energy", to the middle of the last of its three substeps with "triple-jump", and
        to its end with "generalised-alpha". They are NaN where no step led to the state: at the start, and where a
        motion was lost.

        Args:
            support: one of `result.scene.supports`; or a station with supports, or its name: the sum of their
                reactions.

        Returns:
            force (n, 3), N, and moment (n, 3) about the station, N m, both inertial.

        Raises:
            SceneError: not a support of the scene; or a clamp at whose point an action with memory acts, since its
                force is not stored.
        """
        parts = []
        for i in self.scene.supports_of(support):
            held = self.scene.supports[i]
            parts.append(self._of_clamp(held) if held.clamps else self._of_equations(i))
        exerted = sum(parts)
        force, moment = np.split(exerted, 2, axis=1)
        return force * self.scales.force, moment * self.scales.moment

    def _of_equations(self, which):
        """(n, 6) force and moment, dimensionless, of a support with constraint equations."""
        first = sum(len(support.ties()) for support in self.scene.supports[:which])
        own = slice(first, first + len(self.scene.supports[which].ties()))
        return self._stacked("tie_forces")[:, own, 0].sum(axis=1)

    def _of_clamp(self, clamp):
        """(n, 6) force and moment, dimensionless."""
        links = self._connections
        leaders = dict(links.leaders)
        vertex = self.layout.vertex(self.scene, clamp.station)
        point = leaders.get(vertex, vertex)
        joined = [point, *(vertex for vertex, leader in links.leaders if leader == point)]
        for action in self.scene.actions:
            if action.memory and action.station and self.layout.vertex(self.scene, action.station) in joined:
                raise SceneError(
                    f"{describe(clamp)}: its reaction is unknown, since {describe(action)} at the same point has "
                    "memory, and its force is not stored"
                )
        exerted = self._at_clamp(links.clamped.index(point), joined)
        tie_forces = self._stacked("tie_forces")
        for i, (_, *stations) in enumerate(links.ties):
            for k, station in enumerate(stations):
                if station == point:
                    exerted = exerted - tie_forces[:, i, k]
        return exerted

    def _at_clamp(self, point, joined):
        """(n, 6) force and moment that hold a clamped point against internal forces and loads, dimensionless.

        Args:
            point: index of the clamped point; joined: (rod index, element end) of all rods that share it.
        """
        raise NotImplementedError


def reactions_in_words(result):
    """The reaction of every support in the last state, one sentence each."""
    contact = result._contact_of(len(result) - 1)
    n = np.linalg.norm(contact[..., :3], axis=-1).max() * result.scales.force
    m = np.linalg.norm(contact[..., 3:], axis=-1).max() * result.scales.moment
    at = result.along_axis[-1]
    when = f"at the {result.axis} {at:.6g}" if result.axis != "time" else f"in the step that ends at t = {at:.6g} s"
    for support in result.scene.supports:
        try:
            force, moment = (values[-1] for values in result.reaction(support))
        except SceneError as unknown:
            yield f"{unknown}."
            continue
        if np.isfinite(force).all():
            yield f"{describe(support)} exerts {_vector(force, n)} N and {_vector(moment, m)} N m {when}."


def _vector(a, beside):
    """Components as text, with 0 for those that are rounding relative to the largest of them or to `beside`."""
    least = _ROUNDING * max(np.abs(a).max(), beside)
    return f"({', '.join(f'{x:.6g}' if abs(x) > least else '0' for x in a)})"
