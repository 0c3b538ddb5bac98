"""A torsional pendulum as a `StringModel`, for tests of what is around the models; and the scene that it belongs to."""

import numpy as np

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.protocol import LEDGER, PROFILE, SERIES

_COLUMNS = ("times", *SERIES, *LEDGER)


class Pendulum:
    """A bit on a spring below a drive, with dry friction at rest above that in motion, and a delay of ten steps."""

    name, why = "torsion", ("a pendulum",)
    inertia, stiffness = 374.0, 473.0

    def __init__(self, scene, dt=None, elements=None):
        self.scene, self.dt, self.time, self.steps, self.counts = scene, dt or 0.01, 0.0, 0, {"halved": 0}
        self.depths = np.linspace(0.0, 1000.0, 5)
        self.angle = self.speed = self.top = self.work = self.lost = self.torque = 0.0
        self.delayed = np.zeros(10)
        self.fails_at = self.stops_at = None

    def advance(self, steps):
        return np.array([self._step() for _ in range(steps)])

    def _step(self):
        if self.steps == self.stops_at:
            raise KeyboardInterrupt
        if self.steps == self.fails_at:
            raise cf.NotConverged(f"the step at t = {self.time:g} s fails")
        h, Om, law = self.dt, self.scene.drive.signal()(self.time + self.dt), self.scene.bit.law
        self.top += h * Om
        spring = self.stiffness * (self.top - self.angle) + 1e-3 * self.delayed[self.steps % 10]
        moving = self.speed != 0 or abs(spring) > law.static
        friction = law.dynamic if moving else spring
        new = self.speed + h / self.inertia * (spring - friction)
        self.speed = 0.0 if not moving or (self.speed > 0 >= new) else new
        self.delayed[self.steps % 10] = self.speed
        self.torque, self.lost = friction, self.lost + h * friction * self.speed
        self.angle, self.work, self.steps = self.angle + h * self.speed, self.work + h * Om * spring, self.steps + 1
        self.time = self.steps * h
        told = {"times": self.time, "drive_speed": Om, "drive_angle": self.top, "surface_torque": spring,
                "bit_speed": self.speed, "bit_angle": self.angle, "torque_on_bit": friction,
                "kinetic": self.inertia * self.speed**2 / 2, "strain": spring**2 / 2 / self.stiffness,
                "work_of_drive": self.work, "lost_at_bit": self.lost, "lost_at_wall": 0.0,
                "lost_in_mud": 0.0}  # fmt: skip
        return [told.get(name, np.nan) for name in _COLUMNS]

    def profile(self):
        found = np.full((len(PROFILE), len(self.depths)), np.nan)
        x = self.depths / self.depths[-1]
        found[0] = self.top + x * (self.angle - self.top)
        found[1] = (1 - x) * self.scene.drive.signal()(self.time) + x * self.speed
        found[2], found[6] = self.torque, (x == 1) & (self.speed == 0)
        return found

    def memory(self):
        names = ("time", "steps", "angle", "speed", "top", "work", "lost", "torque")
        return {**{name: getattr(self, name) for name in names}, "delayed": self.delayed.copy(), "counts": self.counts}

    def recall(self, memory):
        self.delayed[:] = memory["delayed"]
        vars(self).update({name: value for name, value in memory.items() if name != "delayed"})


def scene(**changed):
    pipe = cf.well.DrillPipe(2000.0, size="5 in 19.50 lb/ft")
    law = cf.drilling.Stribeck(static=6000.0, dynamic=3000.0)
    given = {
        "string": cf.well.DrillString([pipe]),
        "drive": cf.drilling.TopDrive(60 * cf.units.rpm),
        "bit": cf.drilling.BitOnRock(law),
    }
    return cf.drilling.Drilling(**{**given, **changed})


def use(monkeypatch, **settings):
    """Let `simulate` take the pendulum; `settings`: its attributes."""
    from cosserat_fenicsx.drilling import motion

    def made(scene, name, dt, elements):
        model = Pendulum(scene, dt, elements)
        vars(model).update(settings)
        return model

    monkeypatch.setattr(motion, "model_of", made)
