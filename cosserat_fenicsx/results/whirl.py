"""Whirl of a section in its hole: rate, ratio to the spin, radius, contact."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import number
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.results.orbits import orbit_of

_RPM = 30 / np.pi
# A section that stays within this share of the clearance from the axis does not whirl.
_LITTLE = 1e-3


@dataclass(frozen=True)
class Whirl:
    """The whirl of a section between two times. All means are over time.

    Attributes:
        since, until: s.
        rate: mean rate at which the section's axis goes round that of the hole, rad/s: positive in the direction of the
            spin (forward whirl), negative against it (backward whirl). Found from the angle that it covers, without the
            times when it is nearer to the axis than a hundredth of the largest radius; NaN where it has no angle.
        spin: mean rate of rotation of the section about the axis of the hole, right-handed about its tangent, rad/s.
        radius, largest: mean and largest distance from the axis, m.
        clearance: smallest clearance, m.
        contact_radius: of the rod's surface, m.
        contact: share of the time in contact.
        force: (smallest, mean, largest) normal force of the wall on the nearest node of the mesh while it is in
            contact, N; zeros without contact.
        resolved: False where states were saved too seldom to count the turns.
    """

    since: float
    until: float
    rate: float
    spin: float
    radius: float
    largest: float
    clearance: float
    contact_radius: float
    contact: float
    force: tuple[float, float, float]
    resolved: bool

    @property
    def ratio(self) -> float:
        """The rate over the size of the spin: 1 in synchronous whirl, negative backward; NaN without spin."""
        return self.rate / abs(self.spin) if self.spin else np.nan

    @property
    def rolling(self) -> float:
        """The ratio of backward rolling without slip at this radius: minus the contact radius over the radius."""
        return -self.contact_radius / self.radius if self.radius > _LITTLE * self.clearance else np.nan

    @property
    def direction(self) -> str:
        """Which way it goes round: "forward", "backward", or "none" where it stays within a thousandth of the clearance
        from the axis."""
        if np.isnan(self.rate) or self.rate == 0 or self.largest <= _LITTLE * self.clearance:
            return "none"
        return "forward" if self.rate > 0 else "backward"

    def __str__(self):
        when = f"From {self.since:g} to {self.until:g} s"
        spin = f"spin {self.spin:.4g} rad/s ({self.spin * _RPM:.4g} rpm)"
        radius = f"radius {1e3 * self.radius:.4g} mm in the mean, {1e3 * self.largest:.4g} mm at most, of a clearance "
        radius += f"of {1e3 * self.clearance:.4g} mm"
        if self.direction == "none":
            what = f"no whirl, {spin}"
        else:
            ratio = (
                "" if np.isnan(self.ratio) else f", ratio {self.ratio:.4f} (rolling without slip: {self.rolling:.4f})"
            )
            what = f"{self.direction} whirl at {self.rate:.5g} rad/s ({self.rate * _RPM:.4g} rpm), {spin}{ratio}"
        contact = "no contact"
        if self.contact:
            low, mean, high = (x / 1e3 for x in self.force)
            contact = f"in contact {100 * self.contact:.3g} % of the time, normal force {low:.4g} to {high:.4g} kN, "
            contact += f"mean {mean:.4g} kN"
        doubt = "" if self.resolved else " States were saved too seldom to count the turns: the rate is uncertain."
        return f"{when}: {what}; {radius}; {contact}.{doubt}"


def whirl(history, station, wall=None, since=None):
    """See `History.whirl`."""
    found = orbit_of(history, station, wall, "whirl")
    if len(found.times) < 2:
        raise SceneError("whirl: expected a motion with at least two times")
    first, last = float(found.times[0]), float(found.times[-1])
    if since is not None:
        before = float(found.times[-2])
        since = number("whirl", "since", since, f"a time (s), at most {before:g}, the last but one saved",
                       lambda t: t <= before)  # fmt: skip
    return whirl_of(found.since(first if since is None else since), last)


def whirl_of(orbit, until=None):
    """The `Whirl` of an `Orbit` of at least two times."""
    lengths = np.diff(orbit.times)
    counted, whole = lengths @ orbit.turns, lengths.sum()
    spin = _mean(orbit.spin, lengths)
    rate = orbit.steps.sum() / counted if counted > 0 else np.nan
    touching = orbit.normal > 0  # unknown counts as none
    force = orbit.normal[touching]
    return Whirl(
        since=float(orbit.times[0]),
        until=float(orbit.times[-1] if until is None else until),
        rate=float(rate * (-1.0 if spin < 0 else 1.0)),
        spin=spin,
        radius=_mean(orbit.radius, lengths),
        largest=float(orbit.radius.max()),
        clearance=float(orbit.clearance.min()),
        contact_radius=orbit.contact_radius,
        contact=float(lengths @ touching[1:] / whole),  # a force is that of the step before its state
        force=(float(force.min()), float(force.mean()), float(force.max())) if len(force) else (0.0, 0.0, 0.0),
        resolved=orbit.resolved,
    )


def _mean(values, lengths):
    """Over time, by trapezoids."""
    return float(lengths @ (values[1:] + values[:-1]) / 2 / lengths.sum())
