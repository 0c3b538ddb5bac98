"""Contact of a rod with obstacles and walls: the gap of a point of its axis, pressure, and Coulomb friction.

Obstacles and straight walls are gap functions: (position, *shape) -> distance of the position from the surface,
negative beyond it, and the unit normal there, towards the free side. Curved tubes find their nearest point as data.
Pressure and friction act on the rod's surface, where it touches: friction has a moment about the centreline.
"""

import ufl

# Lower bound of the distance from an axis over the obstacle's radius, since the radial direction is undefined on it.
# Only a ring without clearance, which is held there elastically, touches so close to it.
_ON_AXIS = 1e-10
# A gap (dimensionless) up to which a point touches: a rod that lies on an obstacle at rest is held by it from the first
# Newton iteration on.
_TOUCHES = 1e-14
# A lower bound of the square of a friction force, dimensionless.
_NO_FORCE = 1e-60


def linear(depth, stiffness):
    """The pressure of a wall at a penetration."""
    return stiffness * depth


# -- gap functions -----------------------------------------------------------------------------------------------------


def plane(r, point, normal):
    """The gap function of a plane."""
    return ufl.dot(r - point, normal), normal


def sphere(r, point, radius):
    """The gap function of a sphere, outside."""
    return _round(r - point, radius)


def cylinder(r, point, axis, radius):
    """The gap function of a cylinder, outside."""
    d = r - point
    return _round(d - ufl.dot(d, axis) * axis, radius)


def hole(r, point, axis, radius):
    """The gap function of a cylinder, inside."""
    gap, normal = cylinder(r, point, axis, radius)
    return -gap, -normal


def _round(away, radius):
    size = ufl.sqrt(ufl.max_value(ufl.dot(away, away), (_ON_AXIS * radius) ** 2))
    return size - radius, away / size


def shifted(shape, normal, change):
    """The displacement of a surface that moves in itself by a vector, such as a belt, where its normal is given."""
    return change


def turned(shape, normal, change):
    """The same of a cylinder that rotates about its axis by an angle, outside."""
    _, axis, radius = shape
    return change * radius * ufl.cross(axis, normal)


# -- virtual work ------------------------------------------------------------------------------------------------------


def at_surface(test, normal, pressure, friction, arm):
    """Virtual work of a pressure along the normal and of a friction force at the distance `arm` from the axis."""
    return ufl.dot(pressure * normal + friction, test.phi_r) - ufl.dot(arm * ufl.cross(normal, friction), test.phi)


def pressed(gap, stiffness, *law, pressure=linear):
    """The pressure, per length, of what is stiff at a gap."""
    return pressure(ufl.conditional(ufl.le(gap, _TOUCHES), -gap, 0), stiffness, *law)


def obstacle_work(point, test, surface, shape, arm, stiffness, *law, pressure=linear):
    """Virtual work of an obstacle without friction, per length of the rod.

    Args:
        point: a `Point`; test: a `VirtualMotion`.
        surface, shape: a gap function and its data.
        arm: radius of the rod's surface. stiffness: force per area.
        law: numbers of the function `pressure` after the penetration and the stiffness.
    """
    gap, normal = surface(point.r, *shape)
    return pressed(gap - arm, stiffness, *law, pressure=pressure) * ufl.dot(normal, test.phi_r)


def friction_force(point, surface, shape, arm, stiffness, friction, stick, moved, turned, held, carried=None):
    """The normal, the pressure and the friction force of an obstacle, per length of the rod, with Coulomb's law.

    The surface sticks elastically: the force changes by -stick times the slip since the last accepted state, and is
    returned to friction times the pressure where it is larger (return mapping; Simo & Hughes, Computational
    Inelasticity, 1998, ch. 1). Slip is that of the material point that touched in
    that state, so a rod that rolls does not slip. It begins where the point touches: a rod that is laid down has no
    friction from its way there. In the second variation the limit is fixed: where a rod slips, friction is a dead
    force.

    Args:
        see `obstacle_work`; friction: the coefficient; stick: force per area.
        moved, turned, held: of the last accepted state: the displacement; the normal there, turned back by the rotation
            from the reference, minus the normal at rest; the friction force.
        carried: of a surface that moves in itself: a function such as `shifted`, and its motion since that state.
    """
    gap, normal = surface(point.r, *shape)
    gap_before, before = surface(point.rest + moved, *shape)
    touched = surface(point.rest, *shape)[1] + turned
    slip = point.u - moved - arm * (point.R * touched - before)
    if carried is not None:
        motion, change = carried
        slip = slip - motion(shape, normal, change)
    trial = held - stick * slip
    trial = trial - ufl.dot(trial, normal) * normal
    pressure = pressed(gap - arm, stiffness)
    limit = pressed(surface(point.fixed.r, *shape)[0] - arm, stiffness)
    size, most = ufl.sqrt(ufl.max_value(ufl.dot(trial, trial), _NO_FORCE)), friction * ufl.max_value(limit, 0)
    still = ufl.le(size, ufl.max_value(most, _NO_FORCE**0.5))  # without a force, a rod at rest sticks, too
    share = ufl.conditional(still, 1, most / size)
    touches = ufl.And(ufl.le(gap - arm, _TOUCHES), ufl.le(gap_before - arm, _TOUCHES))
    return normal, pressure, ufl.conditional(touches, share, 0) * trial


def rough_work(point, test, surface, shape, arm, *data, **carried):
    """Virtual work of an obstacle with friction, see `friction_force`."""
    return at_surface(test, *friction_force(point, surface, shape, arm, *data, **carried), arm)


def remembered(point, surface, shape, *data, **carried):
    """What `friction_force` remembers of an accepted state: `moved`, `turned`, `held`."""
    normal, _, force = friction_force(point, surface, shape, *data, **carried)
    return [point.u, ufl.transpose(point.R) * normal - surface(point.rest, *shape)[1], force]


def wall_work(point, test, c0, t0, k0, clearance, stiffness, spring, anchor, along, across, arm, *law, pressure=linear):
    """Virtual work of the wall of a curved tube, with Coulomb friction in a known direction of slip, per length of the
    rod.

    With d0 = r - c0 the nearest point moves by sigma = t0 . d0/(1 - k0 . d0) along the axis, which is zero in value and
    gives the derivative of the projection: c = c0 + t0 sigma, t = t0 + k0 sigma. The distance from the axis is
    a = sqrt(rho . rho) with rho = d - t (t . d), d = r - c, its direction e = rho/a, the pressure
    p = stiffness <a - clearance>, or another law `pressure`.

    Args:
        point: a `Point`; test: a `VirtualMotion`.
        c0, t0, k0: the point of the axis that is nearest to r, the unit tangent and the curvature vector there.
        clearance: radius of the tube minus that of the rod. stiffness: of the wall, force per area.
        spring: force per area of an elastic bed without friction, across the axis, from the point `anchor`.
        along, across: friction coefficient times the components of the unit direction of slip, against t and along
            t x e: the friction is p (along t - across t x e).
        arm: radius of the rod's surface.
        law: numbers of the function `pressure` after the penetration and the stiffness.
    """
    d0 = point.r - c0
    sigma = ufl.dot(t0, d0) / (1 - ufl.dot(k0, d0))
    d, t = d0 - sigma * t0, t0 + sigma * k0
    rho = d - ufl.dot(t, d) * t
    a = ufl.sqrt(ufl.max_value(ufl.dot(rho, rho), (_ON_AXIS * (clearance + arm)) ** 2))
    e = rho / a
    p = pressed(clearance - a, stiffness, *law, pressure=pressure)
    friction = p * ufl.dot(e, e) * (along * t - across * ufl.cross(t, e))
    held = point.r - anchor
    bed = spring * (held - ufl.dot(t, held) * t)
    return at_surface(test, -e, p, friction, arm) - ufl.dot(bed, test.phi_r)
