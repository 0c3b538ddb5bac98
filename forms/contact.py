"""Contact of a rod with the wall of a curved tube, with Coulomb friction in a known direction of slip.

Pressure and friction act on the rod's surface, where it touches: friction has a moment about the centreline. The
nearest point of the tube's axis, its tangent and its curvature vector are data.
"""

import ufl

# Lower bound of the distance from the axis over the tube's radius, since the radial direction is undefined on the axis.
# Only a ring without clearance, which is held there elastically, touches so close to it.
_ON_AXIS = 1e-10


def linear(depth, stiffness):
    """The pressure of a wall at a penetration."""
    return stiffness * depth


def wall_work(point, test, c0, t0, k0, clearance, stiffness, spring, anchor, along, across, arm, *law, pressure=linear):
    """Virtual work of the wall, per length of the rod.

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
    p = pressure(ufl.max_value(a - clearance, 0), stiffness, *law)
    friction = p * ufl.dot(e, e) * (along * t - across * ufl.cross(t, e))
    held = point.r - anchor
    force = friction - p * e - spring * (held - ufl.dot(t, held) * t)
    return ufl.dot(force, test.phi_r) + ufl.dot(arm * ufl.cross(e, friction), test.phi)
