"""The drill-strings in motion of demos/strings/: each is simulated and drawn, and numbers are compared with what must
come out.

python demos/strings.py                    all of them; writes to out/strings/NAME/
python demos/strings.py stick_slip         some
python demos/strings.py --quick            without pictures
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from known_numbers import Check, command, run_all
from mpi4py import MPI

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.torsion import TorsionWaves
from cosserat_fenicsx.pictures.charts import draw_both

SCENES = Path(__file__).parent / "strings"
_WAVES = "characteristics, extrapolated"


def ends_at(scene, low, high):
    """The speed (rpm) between two above which the bit, from rest, no longer sticks after 170 s, to half a rpm."""
    while high - low > 0.5:
        middle = (low + high) / 2
        history = cf.drilling.simulate(scene.with_case(middle * cf.units.rpm), 200.0, save_every=0.02)
        low, high = (middle, high) if history.stick_slip(since=170.0).sticks else (low, middle)
    return (low + high) / 2


def stick_slip(found, history, folder):
    """Period, peak of the bit's speed, and extremes of the surface torque of the limit cycle; where it ends."""
    cycle = history.stick_slip(since=60.0)
    yield Check("period (s)", cycle.period, 6.0428, 2e-3, _WAVES)
    yield Check("peak bit speed (rad/s)", cycle.peak, 15.079234, 0.15, _WAVES)
    yield Check("surface torque (N m)", cycle.torque, [2062.859, 8571.097], 20.0, _WAVES)
    yield Check("stick-slip ends (rpm)", ends_at(found.scene, 80.0, 120.0), 98.0, 2.0, _WAVES)


def tuned_drive(found, history, folder):
    """What is left of the oscillation after a minute; no stick-slip, which ends at a lower speed."""
    cycle = history.stick_slip(since=60.0)
    yield Check("peak bit speed (rad/s)", cycle.peak, 6.627654, 0.02, _WAVES)
    yield Check("surface torque (N m)", cycle.torque, [4879.782, 5106.510], 5.0, _WAVES)
    yield Check("at rest (share of time)", cycle.stuck, 0.0, 0.0, "no stick-slip")
    yield Check("stick-slip ends (rpm)", ends_at(found.scene, 40.0, 60.0), 50.8, 2.0, _WAVES)


def off_bottom(found, history, folder):
    """When the lower end passes half the drive's speed after a rest, with the wall force of the weight alone: without
    that of the tension in the bend, which the history has; and the mean torque."""
    parts = found.scene.segments
    ends = np.cumsum([part.length for part in parts])
    weights = np.array([part.rhoA for part in parts]) * 9.81

    def across(md):
        inclination = np.radians(np.interp(md, [0, 500, 1600, 2500], [0, 0, 60, 60]))
        return weights[np.minimum(np.searchsorted(ends, md), len(parts) - 1)] * np.sin(inclination)

    model = TorsionWaves(found.scene, 1e-3, normal_force=across)
    rows = model.advance(round(25.0 / model.dt))
    t, bit, half = rows[:, 0], rows[:, 4], found.scene.drive.speed / 2
    passes = t[1:][(bit[1:] >= half) & (bit[:-1] < half)]
    starts = passes[np.diff(passes, prepend=0.0) > 1.0]
    yield Check("starts of the bit (s)", starts[:4], [5.40788, 10.78348, 16.60839, 22.48980], 0.02, _WAVES)
    loads = cf.well.torque_and_drag(
        found.scene.hole.with_friction(0.195),
        found.scene.string,
        cf.well.RotateOffBottom(),
        mud=found.scene.mud,
        model="soft",
        torque_convention="johancsik",
    )
    late = history.times > 10.0
    drag = found.scene.drag.torsion * sum(p.rhoJ * p.length for p in parts) * found.scene.drive.speed
    mean = float(history.surface_torque[late].mean())
    steady = loads.surface_torque + drag
    yield Check("mean torque over that of a steady rotation", mean / steady, 1.0, 0.1, "soft string")


def stopped_block(found, history, folder):
    """What the hook bears beyond the weight: of the wave in the pipe, and with that reflected at the collars."""
    weight = sum(part.weight * part.length for part in found.scene.segments)
    t, beyond = history.times, history.hook_load - weight
    first, second = (beyond[(t > a) & (t < b)].mean() for a, b in ((0.1, 1.1), (1.19, 1.245)))
    yield Check(
        "hook load beyond the weight (kN)",
        [first / 1e3, second / 1e3],
        [136.846523, 326.805338],
        1.5,
        "staircase, exact",
    )


def four_discs(found, history, folder):
    """When the bit starts, and the peak after two minutes, from where on the motion is close to its limit cycle."""
    source = "events located, tight tolerances"
    starts = history.stick_slip(since=160.0).starts
    yield Check("starts of the bit (s)", starts[:4], [167.506348, 175.812006, 184.118502, 192.425637], 0.01, source)
    yield Check("peak bit speed (rad/s)", history.stick_slip(since=120.0).peak, 6.694377, 2e-3, source)


def autodriller(found, history, folder):
    """The weight by the hook on its way to the one that is asked for, and there."""
    weight = sum(part.weight * part.length for part in found.scene.segments) - history.hook_load
    at = np.interp([20.0, 100.0, 200.0], history.mean_times, weight) / 1e3
    yield Check("weight by the hook (kN)", at, [16.008978, 108.202469, 114.449216], 0.1, "delayed equations")
    yield Check("in the end (kN)", weight[-1] / 1e3, 100.0, 0.6, "the weight asked for")


def mud_motor(found, history, folder):
    """Speed and pressure of the motor while it runs; what it is while it stalls."""
    scene, motor = found.scene, found.scene.motor
    below = scene.drag.torsion * sum(part.rhoJ * part.length for part in scene.turned)
    runs, torque = history.times < 19.0, history.torque_on_bit + below * history.bit_speed
    known = [motor.speed(torque[runs].mean()), motor.pressure(torque[runs].mean()) / 1e5]
    given = [history.motor_speed[runs].mean(), history.pressure[runs].mean() / 1e5]
    yield Check("speed (rad/s) and pressure (bar) of the motor", given, known, 1e-3, "its law")
    yield Check("stalls (share of the last 20 s)", history.stalled[history.times > 40.0].mean(), 1.0, 0.0, "its law")
    if folder is not None:
        steady = replace(motor, flow="2400 l/min")
        curve = cf.well.power_curve(steady, ["1200 l/min", "1800 l/min", "2400 l/min"])
        draw_both(curve.plot, folder / "power_curve.png", MPI.COMM_WORLD)


def oscillation_tool(found, history, folder):
    """The mean pull at the hook with the tool at work."""
    pull = history.mean("hook_load", periods=160, frequency=16.0)
    yield Check("mean pull (kN)", pull / 1e3, 49.041609, 0.7, "elements of its own, 2000")


STRINGS = (stick_slip, tuned_drive, off_bottom, stopped_block, four_discs, autodriller, mud_motor, oscillation_tool)


def run(demo, out="out/strings"):
    """Simulate a scene and draw it.

    Args:
        demo: a function of `STRINGS`; out: folder for its pictures, or None.

    Returns:
        (the model's name, [Check]).
    """
    folder = None if out is None else Path(out) / demo.__name__
    found = cf.read(SCENES / f"{demo.__name__}.toml")
    history = found.run()
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        draw_both(history.plot, folder / "drilling.png", MPI.COMM_WORLD)
        if len(history.depths) > 10:
            draw_both(history.plot_map, folder / "map.png", MPI.COMM_WORLD)
        draw_both(history.plot_energy, folder / "energy.png", MPI.COMM_WORLD)
        if history.bit_speed.any():
            draw_both(history.plot_phase, folder / "phase.png", MPI.COMM_WORLD)
    return history.model, list(demo(found, history, folder))


def main(names=(), out="out/strings"):
    """Run demos, and print their numbers and whether all are right; `names`: of demos, none for all; `out`: folder for
    pictures, or None. Returns a list of `Check`s."""
    return run_all(
        "demos/strings.py",
        "string",
        "Drill-strings in motion: what must come out",
        STRINGS,
        names,
        partial(run, out=out),
    )


if __name__ == "__main__":
    command(__doc__, STRINGS, main, "out/strings")
