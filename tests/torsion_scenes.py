"""The strings whose motion was computed elsewhere, by numpy alone: pipe and collars on rock, strings on the wall."""

import numpy as np

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.protocol import LEDGER, SERIES

#: Columns of what models of strings return.
COLUMN = {name: 1 + i for i, name in enumerate((*SERIES, *LEDGER))}
G, DENSITY, SPEED = 79.3e9, 7850.0, 3178.350331229312
PIPE, COLLARS = (3000.0, 0.127, 0.10861), (200.0, 0.1651, 0.05715)
LAW = cf.drilling.Stribeck(6000.0, 4000.0, 3.0)
SOFT = {"inertia": 2900.0, "control": cf.drilling.PI(1185.5011851288668, 4224.336965928753)}


def part(length, outer, inner, G=G, weight=100.0):
    material = cf.Material(E=2.5 * G, nu=0.25, density=DENSITY)
    return cf.well.Component(length, cf.Tube(outer, inner).stiffness(material), weight, outer / 2)


def string(*parts):
    return cf.well.DrillString(tuple(part(*x) for x in parts), order="top down")


def stick_slip(speed=2 * np.pi, *, drag=0.3, of_bit=50.0, **drive):
    """Pipe and collars with a bit."""
    return cf.drilling.Drilling(
        string(PIPE, COLLARS),
        cf.drilling.TopDrive(speed, **drive),
        cf.drilling.BitOnRock(LAW, inertia=of_bit),
        drag=cf.drilling.ViscousDrag(drag),
    )


def lying(drive, length=3000.0):
    """A horizontal pipe whose friction holds 3.52427441057226 N m a metre."""
    path = cf.well.WellPath.from_survey([0, length], [90, 90], [0, 0], degrees=True)
    pipe = cf.well.DrillString((part(length, *PIPE[1:], weight=222.00153767384313),))
    return cf.drilling.Drilling(pipe, drive, hole=cf.well.Borehole(path, cf.well.HoleSection(length, 0.2159, 0.25)))


def off_bottom():
    """The inclined well, and the wall force of its string where its tension is left out: w sin(inclination)."""
    stations, G = np.array([0.0, 500.0, *np.arange(520.0, 1601.0, 20.0), 2500.0]), 61e9
    inclination = np.interp(stations, [500.0, 1600.0], [0.0, 60.0])
    path = cf.well.WellPath.from_survey(stations, inclination, 0 * stations, degrees=True)
    parts = (2270.0, 0.146529, 0.123024), (230.0, 0.187, 0.095)
    weights = [DENSITY * np.pi / 4 * (outer**2 - inner**2) * 9.81 for _, outer, inner in parts]
    laid = cf.well.DrillString([part(*x, G, w) for x, w in zip(parts, weights, strict=True)], order="top down")
    scene = cf.drilling.Drilling(
        laid,
        cf.drilling.TopDrive(40 * cf.units.rpm, 2900.0, cf.drilling.PI(38e3, 100e3)),
        hole=cf.well.Borehole(path, cf.well.HoleSection(2500.0, 0.2159, 0.3)),
        friction=cf.drilling.WallFriction(0.3, 0.195, 1.0, of_rotation=True),
        drag=cf.drilling.ViscousDrag(0.1),
    )

    def wall_force(md):
        return np.where(md < 2270, *weights) * np.sin(np.interp(md, [500.0, 1600.0], [0.0, np.pi / 3]))

    return scene, wall_force


def run(model, until):
    """(times, rows) of a model that advances from rest to a time (s)."""
    rows = model.advance(round(until / model.dt))
    return rows[:, 0], rows


def imbalance(rows):
    """The largest part of the work that the books of energy miss."""
    kept, work, *lost = (
        rows[:, [COLUMN[name] for name in names]].sum(axis=1)
        for names in (["kinetic", "strain"], ["work_of_drive"], ["lost_at_bit", "lost_at_wall", "lost_in_mud"])
    )
    return np.abs(kept - work + lost[0]).max() / np.abs(work).max()


class Turn:
    """Slowly to an angle within a time, and then back by another angle within the same time."""

    def __init__(self, there, back, within):
        self.there, self.back, self.within = there, back, within
        self.jumps = (within, 2 * within)

    def __call__(self, t):
        angle = self.there if t < self.within else -self.back if t < 2 * self.within else 0.0
        return angle / self.within * (1 - np.cos(2 * np.pi * t / self.within))


def starts_of(t, speed, half=20 * cf.units.rpm):
    """Times where the lower end turns with half the speed of the drive after it has been at rest."""
    found, resting = [], True
    for now, rate in zip(t, speed, strict=True):
        if rate <= 0:
            resting = True
        elif resting and rate > half:
            resting = False
            found.append(now)
    return np.array(found)
