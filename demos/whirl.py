"""An eccentric collar is spun up in its hole: forward whirl, contact, backward rolling; numbers that must come out.

python demos/whirl.py               writes to out/whirl/: orbit.png, whirl.png, campbell.png
python demos/whirl.py --film        also whirl.gif, the clearance enlarged
python demos/whirl.py --quick       without pictures

In the run-up the collar whirls forward with the drive, further and further out. Below its critical speed it touches
the wall, slides there and bounces, until friction turns the whirl round: the collar then rolls backward round the hole
without slip, at minus contact radius over clearance times the speed of the drive.
"""

import argparse
import sys
from functools import partial
from pathlib import Path

import numpy as np
from known_numbers import Check, report, verdict
from mpi4py import MPI
from scipy.integrate import solve_ivp
from whirling_collar import ARM, CLEARANCE, DRAG, EI, LENGTH, MESH, MUD_MASS, OFFSET, STEEL_MASS, spun_up

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures.charts import draw_both

#: Drive, friction of the wall, and duration of the run-up and of the whole.
SPEED, FRICTION, RUN_UP, DURATION = 130 * cf.units.rpm, 0.5, 6.0, 11.0


def first_contact(turn):
    """The time (s) when the middle of the collar reaches the wall in a run-up, by the first mode of the linear beam.

    Its mass centres c = w + k u, u = e exp(i angle), k = (4/pi) of the share of the steel in the mass, obey
    (c' + d w/m)' = -omega^2 w, m and d mass and drag per length.

    Args:
        turn: the rotation over time, a signal.
    """
    mass = STEEL_MASS + MUD_MASS
    square, drag = EI * (np.pi / LENGTH) ** 4 / mass, DRAG / mass

    def middle(t, c):
        return c - 4 / np.pi * STEEL_MASS / mass * OFFSET * np.exp(1j * turn(t)[2])

    def rates(t, state):
        c, p = state
        w = middle(t, c)
        return [p - drag * w, -square * w]

    def outside(t, state):
        return abs(middle(t, state[0])) - CLEARANCE

    outside.terminal = True
    start = [-middle(0.0, 0.0), 0j]
    return float(solve_ivp(rates, (0, RUN_UP), start, events=outside, rtol=1e-9, atol=1e-12).t_events[0][0])


def main(out="out/whirl", film=False, duration=DURATION, run_up=RUN_UP):
    """Simulate the run-up and draw it.

    Args:
        duration, run_up: of the simulation and of the run-up (s); after 6 s of it the collar rolls from 8 s on.
        out: folder for pictures, or None; film: whether to write a film there.

    Returns:
        [Check].
    """
    collar, wall, scene = spun_up(SPEED, run_up, FRICTION)
    history = cf.simulate(scene, duration, dt=1e-3, save_every=4e-3, **MESH)
    middle = collar.at(LENGTH / 2)
    orbit, late = history.orbit(middle), history.whirl(middle, since=duration - 1.0)
    reached = orbit.times[np.argmax(orbit.radius > CLEARANCE)]
    expected = first_contact(scene.supports[0].rotation)
    free = (orbit.times > expected - 1.0) & (orbit.times < expected - 0.1)
    before = history.at_points(np.flatnonzero(free)).whirl(middle)
    rolling = -ARM / CLEARANCE
    checks = [
        Check("ratio of whirl to spin before contact", before.ratio, 1.0, 0.05, "unbalance"),
        Check("first contact (s)", reached, expected, 0.02, "first mode of the beam"),
        Check("ratio of whirl to spin at the end", late.ratio, rolling, -0.01 * rolling, "rolling without slip"),
    ]
    if MPI.COMM_WORLD.rank == 0:
        print(report("Whirl: what must come out", [("collar", history.model, check) for check in checks]))
        print(late)
    if out is not None:
        for name in ("orbit", "whirl", "campbell"):
            draw_both(
                partial(getattr(history, f"plot_{name}"), middle, wall), Path(out) / f"{name}.png", MPI.COMM_WORLD
            )
        if film:
            turned = np.flatnonzero((history.times > 6.0) & (history.times < 8.2))
            history.at_points(turned).animate(Path(out) / "whirl.gif", enlarge=60, speed=0.2, fps=15)
    return checks


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="without pictures")
    parser.add_argument("--film", action="store_true", help="also a film")
    options = parser.parse_args()
    sys.exit(verdict(main(None if options.quick else "out/whirl", options.film)))
