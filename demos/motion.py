"""Seven motions, each a scene file in demos/motions/, with a picture and a number that is checked.

    python demos/motion.py                          all of them
    mpirun -n 2 python demos/motion.py spin_up      one, on two processes
    python demos/motion.py --quick                  without pictures, and shorter where the check allows it
    python demos/motion.py --film spin_up           also writes a film, spin_up.gif

Writes to out/: NAME.png (shapes over time and the track of a station, the curve with the number, energies).
"""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
from known_numbers import Check, command, run_all
from motion_chart import Curve, Shapes, draw
from scipy.integrate import solve_ivp

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic
from cosserat_fenicsx.dynamics.start import before

SCENES = Path(__file__).parent / "motions"


def flying_spaghetti_2d(history):
    """Where both ends are at t = 15 s. The load's jump excites fast waves: codes agree to 0.03 m."""
    rod = history.scene.rod("spaghetti")
    ends = np.concatenate([history.position(rod.start)[-1], history.position(rod.end)[-1]])
    check = Check(
        "both ends at 15 s (m)", ends, [25.61, 2.97, 0, 35.365, 5.147, 0], 0.03, "32 P2 elements, dt 0.0025 s"
    )
    return check, Shapes("xy", rod.start), _momentum(history)


def flying_spaghetti_3d(history):
    """Where both ends are at t = 10 s."""
    rod = history.scene.rod("spaghetti")
    ends = np.concatenate([history.position(rod.start)[-1], history.position(rod.end)[-1]])
    truth = [40.6910, 0.1578, -3.0316, 40.4784, 8.5541, 1.6810]
    check = Check("both ends at 10 s (m)", ends, truth, 3e-3, "32 P2 elements, dt 0.0025 s")
    return check, Shapes("xyz", rod.start), _momentum(history)


def right_angle_cantilever(history):
    """Where the tip is at t = 10 s."""
    tip = history.scene.rod("arm").end
    check = Check("tip at 10 s (m)", history.position(tip)[-1], [10.0048, 8.0299, 4.4631], 3e-3, "32 P2 elements")
    moved = history.displacement(tip)
    lines = [(f"{axis} of the tip", history.times, moved[:, i]) for i, axis in enumerate("xyz")]
    return check, Shapes("xyz", tip), Curve("time (s)", "displacement (m)", lines)


def spin_up(history):
    """The stretch of the spinning blade by the centrifugal force: rho A omega^2 L^3/(3 EA)."""
    tip, turn = history.scene.rod("blade").end, history.scene.supports[0].rotation
    angle = np.array([turn(t)[2] for t in history.times])
    x, y, _ = history.position(tip).T
    out, lag = x * np.cos(angle) + y * np.sin(angle) - 10.0, y * np.cos(angle) - x * np.sin(angle)
    steady = history.times > 15.0
    check = Check("mean extension after 15 s (m)", np.mean(out[steady]), 5.14e-4, 5e-6, "rho A omega^2 L^3/(3 EA)")
    lines = [("tip, behind the hub", history.times, lag), ("tip, along the blade, 100 times", history.times, 100 * out)]
    return check, Shapes("xy", tip, until=9.0), Curve("time (s)", "displacement (m)", lines)


def damped_column(history):
    """The decay rate of the amplitude: tau omega^2/2, omega from `cf.modes`."""
    rod = history.scene.rod("column")
    omega = 2 * math.pi * cf.modes(before(history.scene), 1).frequencies[0]
    t, x = history.times, history.displacement(rod.end)[:, 0]
    tops, heights = _tops(t, x)
    late = tops > 2 * math.pi / omega  # the higher modes have decayed after a period
    rate, height = np.polyfit(tops[late], np.log(heights[late]), 1)
    expected = rod.damping.time * omega**2 / 2
    check = Check("rate of decay (1/s)", -rate, expected, 1e-2 * expected, "tau omega^2/2")
    hull = np.exp(height - expected * t)
    lines = [("tip", t, x), ("exp(-tau omega^2 t/2)", t, hull, "k--"), (None, t, -hull, "k--")]
    return check, Shapes("xz", rod.end, stretched=True), Curve("time (s)", "displacement (m)", lines)


def whirling_shaft(history):
    """The speed of the largest whirl in the run-up, against Jeffcott's rotor with the first frequency of `cf.modes`.

    It is above the critical speed, since at 60 rad/s^2 the whirl needs time to grow.
    """
    shaft, drive = history.scene.rod("shaft"), history.scene.supports[0].rotation
    omega = 2 * math.pi * cf.modes(before(history.scene), 1).frequencies[0]
    middle = shaft.at(0.5)
    r = np.linalg.norm(history.displacement(middle)[:, 1:], axis=1)
    speed = history.angular_velocity(shaft.start)[:, 0]
    stiffness = 768 / 7 * shaft.stiffness.bending[0] / shaft.length**3  # clamped and pinned, at the middle
    eccentricity = 1e-3 * omega**2 / stiffness  # times the disc's mass of 1 kg over the effective mass
    rotor = _jeffcott(history.times, omega, shaft.damping.drag, lambda t: drive(t)[0], eccentricity)
    found, expected = _tops(speed, r), _tops(speed, rotor)
    largest = [tops[np.argmax(sizes)] for tops, sizes in (found, expected)]
    check = Check("speed of the largest whirl (rad/s)", *largest, 1e-2 * omega, "Jeffcott's rotor and cf.modes")
    lines = [("middle of the shaft", speed, 1e3 * r), ("Jeffcott's rotor", speed, 1e3 * rotor, "k--")]
    lines.append(("first frequency", [omega, omega], [0, 1e3 * r.max()], "r:"))
    return check, Shapes("xyz", middle, stretched=True), Curve("speed (rad/s)", "radius of whirl (mm)", lines)


def _jeffcott(times, omega, drag, angle, eccentricity):
    """Radius of the whirl w = c - u, where c'' + drag c' + omega^2 c = omega^2 u, u = eccentricity exp(i angle)."""

    def unbalance(t):
        return eccentricity * np.exp(1j * angle(t))

    def rates(t, state):
        c, v = state
        return [v, omega**2 * (unbalance(t) - c) - drag * v]

    found = solve_ivp(rates, (0, times[-1]), [unbalance(0.0), 0j], t_eval=times, rtol=1e-8, atol=1e-12)
    return np.abs(found.y[0] - [unbalance(t) for t in times])


def released_column(history):
    """The conserved energy of the released column: the work of a
    slowly growing load up to the start, by the exact rod."""
    rod, eta = history.scene.rod("column"), history._records[0].load_factor
    P, e, k = float(cf.euler_load(rod)), 0.2, rod.stiffness
    held = _stored(eta, lambda x: _yielded(x, P, e, rod.length, k))
    off = history.energy[np.argmax(np.abs(history.energy - held))]
    check = Check("energy, farthest off (J)", off, held, 1e-4 * held, "work on the exact rod")
    x, _, z = history.displacement(rod.end).T
    lines = [("x of the tip", history.times, x), ("z of the tip", history.times, z)]
    return check, Shapes("xz", rod.end, until=3.0), Curve("time (s)", "displacement (m)", lines)


def _yielded(eta, P, e, length, k):
    """The work of the force P and the moment P e on the displacements
    at load factors eta, J: shortening and rotation."""
    tip = analytic.reissner(eta, e, length, bending=k.bending[1], axial=k.axial, shear=k.shear[0])
    return P * (tip.shortening + e * tip.tip_rotation)


def _stored(eta, yielded):
    """eta A(eta) minus the integral of A from 0, by Gauss quadrature in parts, since A rises steeply at 1."""
    x, w = np.polynomial.legendre.leggauss(12)
    marks = np.append(np.arange(0, eta, 0.05), eta)
    whole = sum((b - a) / 2 * (w @ yielded((a + b) / 2 + (b - a) / 2 * x)) for a, b in pairwise(marks))
    return float(eta * yielded(eta) - whole)


#: Demos, with their settings in quick runs.
DEMOS = {
    flying_spaghetti_2d: {},
    flying_spaghetti_3d: {},
    right_angle_cantilever: {},
    spin_up: {"dt": 0.05, "elements": 2, "duration": 17.0},
    damped_column: {"duration": 12.0},
    whirling_shaft: {"duration": 3.3, "dt": 4e-3, "elements": 2, "degree": 3},
    released_column: {"duration": 1.0},
}


def _momentum(history):
    """The momenta that the loads produce, constant in free flight."""
    momentum = history.angular_momentum
    shown = np.abs(momentum).max(axis=0) > 1e-6 * np.abs(momentum).max()
    lines = [(axis, history.times, momentum[:, i]) for i, axis in enumerate("xyz") if shown[i]]
    return Curve("time (s)", "angular momentum (kg m²/s)", lines)


def _tops(t, x):
    """Times and values of the extrema of x, by parabolas through three points."""
    size = np.abs(x)
    k = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    a, b, c = size[k - 1], size[k], size[k + 1]
    shift = (a - c) / (2 * (a - 2 * b + c))
    return t[k] + shift * (t[k + 1] - t[k]), b - (a - c) * shift / 4


def run(demo, out=None, *, quick=False, film=False):
    """Simulate a demo, and draw it if a folder is given.

    Args:
        demo: one of `DEMOS`.
        out: a folder, or None.
        quick: shorter.
        film: whether to write NAME.gif.

    Returns:
        (History, Check).
    """
    name = demo.__name__
    found = cf.read(SCENES / f"{name}.toml")
    scene, settings = found.scene, found.motion
    history = cf.simulate(scene, **{**settings, **(DEMOS[demo] if quick else {})})
    check, shapes, curve = demo(history)
    if out is not None:
        draw(history, Path(out) / f"{name}.png", shapes, curve)
        if film:
            history.animate(Path(out) / f"{name}.gif")
    return history, check


def main(names=(), out="out", *, quick=False, film=False):
    """Run demos, and print their numbers and whether all are right; `names`: of demos, none for all; `out`: folder for
    pictures, or None; `quick`, `film`: see `run`. Returns a list of `Check`s."""

    def solved(demo):
        history, check = run(demo, out, quick=quick, film=film)
        return history.model, [check], history.steps[-1]

    return run_all("demos/motion.py", "demo", "Motions: what must come out", DEMOS, names, solved, ["steps"])


if __name__ == "__main__":
    command(__doc__, DEMOS, lambda names, out, film: main(names, out, quick=out is None, film=film), "out",
            film="also NAME.gif")  # fmt: skip
