"""A whole drill-string as an exact rod in a well that builds and turns, with stick-slip of the bit.

python demos/curved_string.py              about a minute; writes to out/curved_string/
"""

from pathlib import Path

import numpy as np

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures.charts import draw_both


def scene():
    """300 m of pipe and collars under a drive that runs up to 4 rad/s, with 20 kN on a bit that sticks."""
    md = np.arange(0.0, 301.0, 10.0)
    build = np.clip((md - 60.0) / 30.0, 0.0, None)
    path = cf.well.WellPath.from_survey(md, np.minimum(8.0 * build, 50.0), 5.0 * build)
    hole = cf.well.Borehole(path, cf.well.HoleSection(300.0, 0.2159, 0.25), wall_stiffness=1e8)
    pipe, collar = cf.well.DrillPipe(size="5 in 19.50 lb/ft"), cf.well.Collar(length=40.0, size="NC46-65")
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(2500.0, 1000.0, 2.0), weight=20e3, inertia=10.0)
    return cf.drilling.Drilling(
        cf.well.DrillString((cf.well.Bit(diameter=0.2159), collar, pipe)),
        cf.drilling.TopDrive(lambda t: 4.0 * min(t, 1.0)),
        bit,
        hole,
        mud=cf.well.Mud(1200.0),
        drag=cf.drilling.ViscousDrag(0.3, 0.3),
    )


def main(out="out/curved_string", duration=4.0, elements=45):
    """Simulate it, print what is measured, and draw it; the `DrillingHistory`."""
    mixed = cf.drilling.mixed_scene(scene(), depth=30.0)
    mesh = {"elements": elements, "degree": 2}
    motion = cf.simulate(mixed.scene, duration, dt=2e-3, start=mixed.rest(**mesh), save_every=0.01, **mesh)
    found = mixed.as_drilling(motion)
    print(found)
    print(f"energy balance off by {np.abs(motion.balance).max():.2g} J of {motion.dissipated[-1]:.5g} J dissipated")
    Path(out).mkdir(parents=True, exist_ok=True)
    draw_both(found.plot, Path(out) / "curved_string.png", motion.comm)
    return found


if __name__ == "__main__":
    main()
