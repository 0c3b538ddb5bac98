"""A collar between pinned ends whose mass centre is off its axis, in mud, and its steady forward whirl.

The amplitudes are those of an exact Timoshenko beam with rotary and gyroscopic terms, pinned at both ends, with the
eccentricity e of the steel alone: deflection in the middle, m, at 0.3, 0.5, 0.7, 0.9, 1.3 and 2 times the critical
speed.
"""

import numpy as np

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.centrifugal import Centrifugal
from cosserat_fenicsx.actions.fluids import AddedMass

LENGTH, OUTER, INNER, ECCENTRICITY, CLEARANCE = 12.0, 0.1714, 0.0714, 0.0127, 0.02225
E, G, DENSITY, MUD, ADDED, SHEAR = 206e9, 79.3e9, 7850.0, 1200.0, 1.7, 756104382.6990502
#: {axial compression, N: {rpm: deflection in the middle, m}}
AMPLITUDES = {
    0.0: {
        40.23629955464223: 0.001184480828348832,
        67.06049925773705: 0.0039952113207506095,
        93.88469896083186: 0.01153104608640505,
        120.70889866392667: 0.051340392989792996,
        174.35729807011631: -0.029468132017189317,
        268.2419970309482: -0.016205880300325666,
    },
    150e3: {57.74393256347253: 0.003997962348733395, 150.13422466502857: -0.02944889481332581},
}
#: rpm at which the deflection reaches the clearance
FIRST_CONTACT = 108.11340683050571


class Collar:
    """The collar under an axial compression (N), with a share of the eccentricity.

    Attributes:
        rod, middle: the rod, and its station in the middle; mass: with the mud, kg/m.
    """

    def __init__(self, compression=0.0, share=1.0):
        area, I = np.pi / 4 * (OUTER**2 - INNER**2), np.pi / 64 * (OUTER**4 - INNER**4)
        section = cf.Stiffness((SHEAR, SHEAR), E * area, (E * I, E * I), 2 * G * I, mass=DENSITY * area,
                               inertia=(DENSITY * I, DENSITY * I, 2 * DENSITY * I))  # fmt: skip
        self.rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, LENGTH)), section, name="collar",
                          eccentricity=(share * ECCENTRICITY, 0))  # fmt: skip
        self.middle = self.rod.at(LENGTH / 2)
        self._supports = [cf.Pin(self.rod.start), *(cf.Roller(self.rod.end, a) for a in ((1, 0, 0), (0, 1, 0)))]
        mud = np.pi / 4 * MUD * (ADDED * OUTER**2 + INNER**2)
        self._loads, self.mass = [AddedMass(self.rod, mud)], DENSITY * area + mud
        if compression:
            self._loads.append(cf.Force(self.rod.end, (0, 0, -compression), permanent=True))

    def whirl(self, rpm, elements=8):
        """Path of the steady whirl; a weak spring keeps the free spin from being a mechanism."""
        held = [Centrifugal((0, 0, rpm * np.pi / 30)), cf.Spring(self.rod.start, rotational=1e-3)]
        scene = cf.Scene([self.rod], self._supports, [*self._loads, *held])
        return cf.solve(scene, [1.0], elements=elements, degree=2, model="spatial")

    def deflection(self, path):
        """That in the middle of a whirl's path, m, positive towards the heavy side."""
        return path.displacement(self.middle)[-1, 0]

    def motion(self, rpm, duration, dt, scheme="momentum", elements=8, more=()):
        """History from the steady whirl on, with more actions from then on."""
        moving = Centrifugal((0, 0, rpm * np.pi / 30)).velocities([self.rod])
        scene = cf.Scene([self.rod], self._supports, [*self._loads, *more], velocities=moving)
        start = self.whirl(rpm, elements)
        return cf.simulate(scene, duration, dt=dt, scheme=scheme, start=start, elements=elements, degree=2)

    def deflections(self, history):
        """(n,) distances of the middle from the axis of rotation, m."""
        return np.hypot(*history.position(self.middle)[:, :2].T)
