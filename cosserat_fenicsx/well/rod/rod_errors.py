"""How well a rod in its hole is known: what a finer mesh and a stiffer wall would change.

A wall of stiffness k changes hook load, torque and wall force by C/k^a from those in a rigid wall: a is 1 where a
stabiliser presses on it, less where the string leaves it. From solutions at k/100, k/10 and k follows the ratio of the
last two changes, rho = 10^-a; what is left at k is rho/(1 - rho) times the last change.
"""

import numpy as np

#: What is known with errors: hook load, N; surface torque, N m; sum of the wall's forces, N.
NAMES = ("hook_load", "surface_torque", "wall_force")
# Errors of the finer mesh over changes from one mesh to the next, whose signs alternate: what covered 97 random wells,
# but for the wall force of one buckled string.
_OF_CHANGE = {"hook_load": 3.0, "surface_torque": 4.0, "wall_force": 6.0}
# Smallest scales that errors are relative to: of the hook load, over the string's weight; of the torque, over that of
# the wall's forces at the string's surface.
_LEAST_LOAD, _LEAST_TORQUE = 1e-3, 1e-3
# Caution over what is left of the wall's softness; bounds of the ratio of changes; the ratio where it is not known.
_CAUTION, _RATIOS, _UNKNOWN = 2.0, (0.1, 0.9), 0.5
#: What is left of the wall's softness on a finer mesh where it was found on a coarser one, which may not resolve the
#: layer in the wall and then tells a part of it: at least this, relative, the largest one of 150 strings.
UNSEEN = 9e-6
# A change by the mesh that is smaller than this part of the change before it is small by chance: changes fall to a
# twentieth (the median, from equal elements to others) or a seventh (later).
_FALLS = 1 / 32


class RodErrors:
    """Estimated errors of an `InHole`.

    Attributes:
        values: {factor: {name: value}} at walls so many times stiffer than the scene's, ascending; ratio: of their last
            two changes; changes: {name: relative change from the mesh before}, infinite without one.
        errors: {name: error} in N and N m; error: the largest relative one of hook load and torque, that of the torque
            only where the string turns; of_stiffness: the part of it that is left of the wall's softness.
    """

    def __init__(self, values, scales, rounding, counted, before=None, capped=np.inf):
        """
        Args:
            values: see there. scales: {name: size that an error is relative to}. rounding: {name: error}. counted:
                names of those in `error`. before: the `RodErrors` on the mesh before. capped: factor above which rings
                are not made stiffer, so that changes tell nothing of theirs.
        """
        self.values, self._capped = dict(sorted(values.items())), capped
        self._of_rings = before._of_rings if before else dict.fromkeys(NAMES, 0.0)
        self._by_stiffness, self.ratio = self._left_of_softness(scales, counted, before)
        changes = dict.fromkeys(NAMES, np.inf)
        common = set(self.values) & set(before.values if before else ())
        if common:
            factor = max(common)
            changes = _changes(before.values[factor], self.values[factor], scales, counted)
        if before is not None:
            known = {name: x for name, x in before.changes.items() if np.isfinite(x)}
            changes |= {name: max(changes[name], _FALLS * x) for name, x in known.items()}
        self.changes = changes
        of_mesh = {name: _OF_CHANGE[name] * changes[name] * scales[name] for name in NAMES}
        self.errors = {name: of_mesh[name] + self._by_stiffness[name] + rounding[name] for name in NAMES}
        self.error = max(self.errors[name] / scales[name] for name in counted)
        self.of_stiffness = max(self._by_stiffness[name] / scales[name] for name in counted)

    def _left_of_softness(self, scales, counted, before):
        """{name: what a rigid wall would change}, and the ratio of changes."""
        walls = list(self.values.values())
        if len(walls) < 2:
            if before is None:
                return dict.fromkeys(NAMES, np.inf), _UNKNOWN
            unseen = UNSEEN * min(1.0, walls[0]["wall_force"] / scales["wall_force"])  # none without contact
            return {name: max(x, unseen * scales[name]) for name, x in before._by_stiffness.items()}, before.ratio
        changes = [_changes(a, b, scales, counted) for a, b in zip(walls, walls[1:], strict=False)]
        ratio = before.ratio if before else _UNKNOWN
        if len(changes) > 1:
            sizes = [max(change.values()) for change in changes[-2:]]
            ratio = float(np.clip(sizes[1] / sizes[0], *_RATIOS)) if sizes[0] > 0 else _UNKNOWN
            changes[-1] = {name: max(x, _RATIOS[0] * changes[-2][name]) for name, x in changes[-1].items()}
        share = _CAUTION * ratio / (1 - ratio)
        factors = list(self.values)
        if factors[-1] > self._capped:  # what is left of rings is known from walls in which they were stiffer, too
            known = [pair for pair in zip(changes, factors[1:], strict=True) if pair[1] <= self._capped]
            if known:
                change, factor = known[-1]
                softer = share * factor / self._capped  # a ring's effect is as its softness
                self._of_rings = {name: softer * x * scales[name] for name, x in change.items()}
        return {name: max(share * x * scales[name], self._of_rings[name]) for name, x in changes[-1].items()}, ratio


def _changes(there, here, scales, counted):
    """{name: relative change}, not less than the largest of those that count and of the wall force: a single quantity
    may change little by chance."""
    own = {name: abs(here[name] - there[name]) / scales[name] for name in NAMES}
    largest = max(own[name] for name in {*counted, "wall_force"})
    return {name: max(largest, change) for name, change in own.items()}


def errors_of(answer, values, before=None):
    """The `RodErrors` of an `InHole`.

    Args:
        values: {factor: {name: value}} on its mesh, see `RodErrors`. before: the `RodErrors` on the mesh before.
    """
    string = answer.string
    weight = np.diff(string.ends, prepend=0.0) @ string.weight
    arm = max(radius for _, radius in string.wall.contact_radius)
    least = _LEAST_LOAD * weight
    wall = max(answer.wall_force, least)
    scales = {
        "hook_load": max(abs(answer.hook_load), least),
        "surface_torque": max(abs(answer.surface_torque), _LEAST_TORQUE * arm * wall),
        "wall_force": wall,
    }
    rounding = {name: answer.balance * (arm if name == "surface_torque" else 1.0) for name in NAMES}
    counted = ("hook_load", "surface_torque") if string.turns else ("hook_load",)
    return RodErrors(values, scales, rounding, counted, before, string.stiffest_rings)


def values_of(answer):
    """{name: value} of an `InHole`."""
    return {name: getattr(answer, name) for name in NAMES}
