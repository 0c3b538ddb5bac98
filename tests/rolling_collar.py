"""The pinned collar of 12 m in reference/d_whirl.json that rolls backward round its hole, started in steady rolling."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import ufl
from scipy.interpolate import CubicSpline

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.walls import HoleRing
from cosserat_fenicsx.scene import action

#: d_whirl.json, without axial compression, as far as these tests need it.
COLLAR = json.loads((Path(__file__).parent / "reference" / "whirl.json").read_text())
LENGTH, ARM, CLEARANCE = 12.0, COLLAR["od"] / 2, COLLAR["clearance"]
AXIS = cf.well.WellPath.from_survey([0, 100], [0, 0], [0, 0])


@dataclass(frozen=True)
class Drive(action.PointAction):
    """A moment about the z axis, impedance (speed - spin); a `Dashpot` would resist bending rotations too."""

    station: object
    impedance: float
    speed: float

    scaled = False

    def data(self, rod, s):
        return action.scalar(self.impedance, "N m s/rad"), action.scalar(self.speed, "rad/s")

    @staticmethod
    def work(point, test, impedance, speed):
        axis = ufl.as_vector([0, 0, 1])
        return impedance * (speed - ufl.dot(point.omega, axis)) * ufl.dot(axis, test.phi)


def collar(drag=None):
    """The rod; drag: of its momenta, 1/s."""
    od, bore, E, G, rho = (COLLAR[name] for name in ("od", "id", "E", "G", "rho"))
    area, second = np.pi / 4 * (od**2 - bore**2), np.pi / 64 * (od**4 - bore**4)
    shear, bending, J = COLLAR["shear_stiffness"], COLLAR["EI"], rho * second
    section = cf.Stiffness(
        (shear, shear), E * area, (bending, bending), 2 * G * second, mass=COLLAR["total_mass"], inertia=(J, J, 2 * J)
    )
    drag = COLLAR["drag_per_length"] / COLLAR["total_mass"] if drag is None else drag
    return cf.Rod(cf.Line((0, 0, 0), (0, 0, LENGTH)), section, damping=cf.Damping(drag=drag))


def rolling(spin, stiffness, friction):
    """(rod, scene, start, rate): a ring in the middle touches; rate: that of rolling without slip, rad/s.

    It starts in the deflected shape w of an undamped beam that turns with its contact, (EI w'''' = m rate^2 w), with
    the velocities of a rod whose twist stays the same.
    """
    rod, middle = collar(), LENGTH / 2
    radius = CLEARANCE
    for _ in range(20):
        rate = -ARM / radius * spin
        b = (COLLAR["total_mass"] * rate**2 / COLLAR["EI"]) ** 0.25
        ratio = -np.cos(b * middle) / np.cosh(b * middle)
        size = radius / (np.sin(b * middle) + ratio * np.sinh(b * middle))
        normal = 2 * COLLAR["EI"] * size * b**3 * (-np.cos(b * middle) + ratio * np.cosh(b * middle))
        radius = CLEARANCE + abs(normal) / stiffness

    def deflection(s):
        x = b * min(s, LENGTH - s)
        return size * (np.sin(x) + ratio * np.sinh(x))

    pins = [cf.Pin(rod.start), cf.Pin(rod.end)]
    pull = cf.LineForce(rod, cf.signals.Along(lambda s: (COLLAR["total_mass"] * rate**2 * deflection(s), 0, 0)))
    held = [*pins, cf.Prescribed(rod.at(middle), displacement=(radius, 0, 0))]
    start = cf.solve(cf.Scene([rod], held, [pull, cf.Spring(rod.start, rotational=1e2)]), [1.0], elements=8, degree=2)
    s = np.linspace(0, LENGTH, 201)
    w = CubicSpline(s, [start.displacement(rod.at(x))[-1, 0] for x in s])

    def angular(s):
        slope = float(w(s, 1))
        own = spin + (spin - rate) * slope**2 / 2  # about d_3: the twist then stays
        return (own - rate) * slope, 0.0, own + rate * slope**2 - own * slope**2 / 2

    velocity = cf.InitialVelocity(rod, linear=lambda s: (0.0, rate * float(w(s)), 0.0), angular=angular)
    ring = HoleRing(rod.at(middle), AXIS, CLEARANCE, ARM, stiffness=stiffness, friction=friction)
    scene = cf.Scene([rod], pins, [ring, Drive(rod.start, 1e5, spin)], velocities=[velocity])
    return rod, scene, start, rate


def whirl(history, rod):
    """Angle (n,) round the hole and distance (n,) from its axis of the middle of the rod, and its spin (n,)."""
    r, spin = history.position(rod.at(LENGTH / 2)), history.angular_velocity(rod.at(LENGTH / 2))[:, 2]
    return np.unwrap(np.arctan2(r[:, 1], r[:, 0])), np.hypot(r[:, 0], r[:, 1]), spin
