"""An eccentric collar between pinned ends in its hole, in mud, turned by a flexible coupling: scenes of whirl.

12 m of 6 3/4 in collar in an 8 1/2 in hole that is vertical; the mass centre of the steel lies half an inch off the
axis. Mud moves with the axis and damps it. SI units, angles in rad.
"""

import numpy as np
from scipy.interpolate import CubicSpline

import cosserat_fenicsx as cf

LENGTH, OUTER, INNER, HOLE, OFFSET = 12.0, 0.1714, 0.0714, 0.2159, 0.0127
ARM, CLEARANCE = OUTER / 2, (HOLE - OUTER) / 2
#: Mass of steel and of mud that moves with the axis, kg/m; drag of 5 % of the critical damping of the first mode,
#: N s/m^2; bending stiffness, N m^2.
STEEL_MASS, MUD_MASS, DRAG, EI = 149.6953, 51.8744, 283.1071, 8464506.9
MESH = {"elements": 8, "degree": 2}
_STEEL, _MIDDLE, _BEGIN = cf.Material(206e9, 0.2989, density=7850.0), LENGTH / 2, 0.2
_AXIS = cf.well.WellPath.from_survey([0, 100], [0, 0], [0, 0])
# The coupling above the collar: stiff in torsion, soft in bending, but so short (_BEGIN, m) that no torque buckles it.
_SHAPE = ((0.06, 0.06), (-0.06, 0.06), (-0.06, -0.06), (0.06, -0.06))
_COUPLING = cf.Stiffness((1e7, 1e7), 1e8, (5e2, 5e2), 1e5, mass=1.0, inertia=(1e-2, 1e-2, 2e-2), outline=_SHAPE)


def rods(eccentricity=OFFSET):
    """The collar and the coupling, with their joint, and the bearings of the collar, of which the lower one lets it
    slide."""
    collar = cf.Rod(cf.Line((0, 0, _BEGIN), (0, 0, _BEGIN + LENGTH)), cf.Tube(OUTER, INNER), _STEEL, name="collar",
                    eccentricity=(eccentricity, 0.0))  # fmt: skip
    coupling = cf.Rod(cf.Line((0, 0, 0), (0, 0, _BEGIN)), _COUPLING, name="coupling")
    bearings = [cf.Pin(collar.start), *(cf.Roller(collar.end, normal) for normal in ((1, 0, 0), (0, 1, 0)))]
    return collar, coupling, [cf.Joint(collar.start, coupling.end)], bearings


def spun_up(speed, until, friction, stiffness=1e9):
    """The collar in the wall of its hole, spun up from rest to a speed (rad/s) at a time (s).

    Returns:
        collar, wall, scene.
    """
    collar, coupling, joints, bearings = rods()
    drive = cf.Prescribed(coupling.start, displacement=(0, 0, 0), rotation=cf.signals.RunUp((0, 0, speed), 0.0, until))
    wall = cf.well.HoleWall(
        collar, _AXIS, HOLE / 2, ARM, stiffness=stiffness, friction=friction, damping=0.2, begins=_BEGIN
    )
    scene = cf.Scene([collar, coupling], [drive, *bearings], [wall, *_mud(collar)], joints,
                     title="Eccentric collar in its hole")  # fmt: skip
    return collar, wall, scene


def rolling(spin, friction, duration, stiffness=1e9):
    """The collar with a ring in the middle that rolls backward round the hole from the start on, driven at a spin
    (rad/s) for a duration (s).

    It starts in the deflected shape w of an undamped beam that turns with its contact, EI w'''' = m rate^2 w.

    Returns:
        collar, ring, scene, start: the last an equilibrium for `simulate`.
    """
    collar, coupling, joints, bearings = rods()
    mass, rate = STEEL_MASS + MUD_MASS, -ARM / CLEARANCE * spin
    b = (mass * rate**2 / EI) ** 0.25
    ratio = -np.cos(b * _MIDDLE) / np.cosh(b * _MIDDLE)
    size = CLEARANCE / (np.sin(b * _MIDDLE) + ratio * np.sinh(b * _MIDDLE))

    def deflection(s):
        x = b * min(s, LENGTH - s)
        return size * (np.sin(x) + ratio * np.sinh(x))

    pull = cf.LineForce(collar, cf.signals.Along(lambda s: (mass * rate**2 * deflection(s), 0, 0)))
    held = [cf.Clamp(coupling.start), *bearings, cf.Prescribed(collar.at(_MIDDLE), displacement=(CLEARANCE, 0, 0))]
    start = cf.solve(cf.Scene([collar, coupling], held, [pull], joints), [1.0], **MESH)
    s = np.linspace(0, LENGTH, 201)
    w = CubicSpline(s, [start.displacement(collar.at(x))[-1, 0] for x in s])

    def angular(s):
        return (spin - rate) * float(w(s, 1)), 0.0, spin

    def coupled(s):
        return s / _BEGIN * (spin - rate) * float(w(0.0, 1)), 0.0, spin

    velocities = [
        cf.InitialVelocity(collar, linear=lambda s: (0.0, rate * float(w(s)), 0.0), angular=angular),
        cf.InitialVelocity(coupling, angular=coupled),
    ]
    turn = cf.signals.Ramp((0, 0, spin * 2 * duration), 0.0, 2 * duration)
    drive = cf.Prescribed(coupling.start, displacement=(0, 0, 0), rotation=turn)
    ring = cf.well.HoleRing(
        collar.at(_MIDDLE), _AXIS, CLEARANCE, ARM, stiffness=stiffness, friction=friction, damping=0.2, begins=_BEGIN
    )
    scene = cf.Scene([collar, coupling], [drive, *bearings], [ring, *_mud(collar)], joints, velocities=velocities)
    return collar, ring, scene, start


def least_friction(spin):
    """The least friction coefficient of steady backward rolling of an Euler beam that touches a rigid wall in the
    middle, without unbalance, at a spin (rad/s); infinite where rolling needs no wall.

    The force of the wall is F = 4 EI b^3 c/(tan(b L/2) - tanh(b L/2)), b^4 = (m nu^2 - i d nu)/EI, nu the rate of
    rolling, m and d mass and drag per length, c the clearance: its part -Re F is normal, Im F friction.
    """
    nu = -spin * ARM / CLEARANCE
    b = (((STEEL_MASS + MUD_MASS) * nu**2 - 1j * DRAG * nu) / EI) ** 0.25
    force = 4 * EI * b**3 * CLEARANCE / (np.tan(b * _MIDDLE) - np.tanh(b * _MIDDLE))
    return abs(force.imag) / -force.real if force.real < 0 else np.inf


def _mud(collar):
    return [cf.AddedMass(collar, MUD_MASS), cf.LinearDrag(collar, DRAG)]
