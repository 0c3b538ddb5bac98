"""Torsional waves of a drill-string by a first-order upwind scheme, as the open literature publishes it.

The scheme of U. J. F. Aarsnes & R. J. Shor, J. Pet. Sci. Eng. 163 (2018) 712, doi:10.1016/j.petrol.2018.01.011, written
anew: cells of pipe and of collars, the Riemann invariants om + M/Z and om - M/Z by first-order upwind differences and
Euler's explicit rule at a Courant number of 0.99, drag as a source; the invariants at the change of section from
continuous speed and torque. Published with 1000 cells. Theirs is a bit off bottom; here an inertia with a law of torque
is added by Euler's rule, which holds the bit where the static torque stops it within the step.

Not taken over are two slips of the published program, which are no property of the scheme: a factor pi too many in the
second moment of the collars, and a drag that is multiplied by dt twice, so that it depends on the number of cells. It
runs in C, with the flags of this package's own C, so that languages are not compared.
"""

from pathlib import Path

import numpy as np

from cosserat_fenicsx.algebra.building import module

COURANT = 0.99


def run(scene, cells, duration):
    """The motion of a stiff drive, pipe and collars, and a bit with inertia. scene: a `Drilling` of two segments.
    cells: in all. duration: s. Returns (times, bit speeds, surface torques), (n,) each: s, rad/s, N m."""
    ffi, lib = module(Path(__file__).with_suffix(".c"))
    pipe, collars = scene.segments
    first = round(cells * pipe.length / (pipe.length + collars.length))
    counts, parts = (first, cells - first), (pipe, collars)
    dt = COURANT * min(part.length / n / part.torsional_speed for part, n in zip(parts, counts, strict=True))
    s = ffi.new("upwind *")
    s.cells, s.dt, s.drag, s.top = counts, dt, scene.drag.torsion, scene.drive.signal()(0.0)
    s.courant = [part.torsional_speed * dt * n / part.length for part, n in zip(parts, counts, strict=True)]
    s.impedance = [part.torsional_impedance for part in parts]
    law = scene.bit.law
    s.still, s.turning, s.decay, s.inertia = law.static, law.dynamic, law.speed, scene.bit.inertia
    down, up = np.zeros((2, cells))
    steps = int(np.ceil(duration / dt))
    speed, torque = np.empty((2, steps))
    s.down, s.up, speeds, torques = (ffi.cast("double *", x.ctypes.data) for x in (down, up, speed, torque))
    lib.march(s, steps, speeds, torques)
    return dt * np.arange(1, steps + 1), speed, torque
