"""Published problems of motion and of dynamic stability: flutter, flights, a spin-up, a pendulum, a top, a blade."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from modes import charted
from problem import Row, problem
from scipy.special import ellipk

import cosserat_fenicsx as cf
from cosserat_fenicsx.parts import ForcePerLength
from cosserat_fenicsx.scene.action import vector
from cosserat_fenicsx.scene.rod import RodOrName

SCENES = Path(__file__).parents[1] / "motions"


@dataclass(frozen=True)
class FollowerLineForce(cf.LineAction):
    """A force per length along the tangent of the moving rod, N/m."""

    rod: RodOrName
    force: ForcePerLength

    follows = True

    def data(self, rod, s):
        return (vector(self.force * rod.curve.frame(s)[:, :, 2], "N/m"),)

    @staticmethod
    def work(point, test, f):
        import ufl

        return ufl.dot(point.R * f, test.phi_r)


def exponents(samples, step, count):
    """The exponents s (1/s) of a sum of exponentials exp(s t), (channels, times), by the matrix pencil method.

    Those of the trapezoidal rule, which the steps of small motions obey, are turned back to those in time.
    """
    rows = samples.shape[1] // 2
    window = np.lib.stride_tricks.sliding_window_view
    hankel = np.concatenate([window(channel, samples.shape[1] - rows + 1) for channel in samples], axis=1)
    basis = np.linalg.svd(hankel, full_matrices=False)[0][:, :count]
    z = np.linalg.eigvals(np.linalg.lstsq(basis[:-1], basis[1:], rcond=None)[0])
    return 2 / step * (z - 1) / (z + 1)


def first_two(load, elements, dt=5e-3):
    """The two lowest circular frequencies of a clamped column of 1 m, EI = 1, 1 kg/m, under follower loads, squared.

    Args:
        load: a function of the rod that returns them. elements: of degree 4. dt: s.
    """
    section = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 1.0), 1.0, mass=1.0, inertia=(1e-7,) * 3)
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section, name="column")
    kick = cf.InitialVelocity(rod, lambda s: (0, 1e-4 * s**2, 0), lambda s: (0, 0, 2e-4 * s))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [load(rod)], velocities=[kick])
    history = cf.simulate(scene, 4.0, dt=dt, start=1.0, elements=elements)
    found = exponents(np.array([history.displacement(rod.at(s))[:, 1] for s in (0.5, 1.0)]), dt, 8)
    return np.sort(found.imag[found.imag > 0])[:2] ** 2


def flutter(load, near, elements):
    """The load at which the two lowest frequencies meet, and that frequency.

    The square of the difference of their squares is smooth in the load and zero there: a parabola through three loads.

    Returns:
        [load, frequency], the squares of the frequencies (3, 2) at the three loads, these loads.
    """
    loads = near * np.array([0.96, 0.98, 0.996])
    pairs = np.array([first_two(lambda rod, P=P: load(rod, P), elements) for P in loads])
    curve = np.polyfit(loads, np.diff(pairs)[:, 0] ** 2, 2)
    critical = np.roots(curve)[np.argmin(np.abs(np.roots(curve) - near))].real
    return np.array([critical, math.sqrt(np.polyval(np.polyfit(loads, pairs.mean(axis=1), 2), critical))]), pairs, loads


def fluttering(title, load, published, allowed):
    """Rows and picture of a column of follower loads; published: the load and the frequency, or the load alone."""
    (found, pairs, loads), (coarse, _, _) = (flutter(load, published[0], elements) for elements in (6, 4))
    names = ("flutter load, EI/L^2 (of a load per length, EI/L^3)", "frequency there, sqrt(EI/(m L^4))")
    rows = [
        Row(name, value, ours, abs(ours - rough), allowed, "digits printed; the extrapolation")
        for name, value, ours, rough in zip(names, published, found, coarse, strict=False)
    ]
    lines = [(f"frequency {k + 1}", loads, np.sqrt(pairs[:, k]), "o-") for k in (0, 1)]
    lines.append(("published", [published[0]] * 2, [np.sqrt(pairs).min(), np.sqrt(pairs).max()], "k--"))
    return rows, charted(f"{title}, EI = 1, L = 1 (-)", "circular frequency (rad/s)", lines)


_BY_MOTION = (
    "Linear buckling and the count of negative modes say nothing on flutter: small motions are simulated at three "
    "loads below it, their frequencies identified, and extrapolated to where they meet."
)


@problem(
    "Beck's column",
    "motion",
    "Beck, Z. angew. Math. Phys. 3 (1952) 225, doi:10.1007/BF02008828: 20.05; more digits by Bolotin's equation",
    "clamped column, compressed by a force that follows its tip",
    _BY_MOTION,
)
def beck_column():
    return fluttering("force", lambda rod, P: cf.FollowerForce(rod.end, (0, 0, -P)), (20.05095, 11.01556), 1e-3)


@problem(
    "Column under distributed follower loads",
    "motion",
    "Leipholz, Z. angew. Math. Phys. 13 (1962) 581: 40.05 EI/L^3",
    "clamped column, compressed by a uniform load per length along its tangent",
    _BY_MOTION + " The load is an action of ten lines in this file.",
)
def leipholz_column():
    return fluttering("load per length", lambda rod, q: FollowerLineForce(rod, -q), (40.05,), 6e-3)


def from_file(name, **settings):
    """The motion of a scene file of demos/motions."""
    found = cf.read(SCENES / f"{name}.toml")
    return cf.simulate(found.scene, **{**found.motion, **settings})


def ends(history):
    """(6,) where both ends of the first rod are at last, m."""
    rod = history.scene.rods[0]
    return np.concatenate([history.position(rod.start)[-1], history.position(rod.end)[-1]])


def tracked(history, station, axes):
    """Draws where a station goes."""
    lines = [(axis, history.times, history.position(station)[:, "xyz".index(axis)], "-") for axis in axes]
    return charted("time (s)", f"position of {station} (m)", lines)


def shapes(history, axes, count=9):
    """Draws the first rod at times of equal distance, projected along the third axis."""
    (i, j), rod = ("xyz".index(axis) for axis in axes), history.scene.rods[0]
    lines = []
    for t in np.linspace(0, history.times[-1], count):
        k = int(np.argmin(np.abs(history.times - t)))
        line, _ = history.sample(k, rod, np.linspace(0, 1, 101))
        lines.append((f"{history.times[k]:.3g} s", line[:, i], line[:, j], "-"))
    return charted(f"{axes[0]} (m)", f"{axes[1]} (m)", lines)


_EXUDYN = (
    "Simo & Vu-Quoc print figures alone. The positions beside ours were computed by Exudyn with {} elements, under "
    "generalised alpha."
)


@problem(
    "Flying spaghetti in a plane",
    "motion",
    "Simo & Vu-Quoc, J. Appl. Mech. 53 (1986) 855, doi:10.1115/1.3171871; momentum: the impulse of the load",
    "free rod of 10 m, EA = GA = 1e4 N, EI = 500 N m^2, 1 kg/m, 10 kg m; 8 N and -80 N m at one end for 2.5 s",
    _EXUDYN.format(40) + " The loads jump and excite fast waves: programs agree to 0.03 m, not better.",
)
def flying_spaghetti_2d():
    history = from_file("flying_spaghetti_2d")
    finer = from_file("flying_spaghetti_2d", dt=0.01)
    found = ends(history)
    published = np.array([25.619, 2.988, 0.0, 35.382, 5.131, 0.0])
    rows = [
        Row("both ends at 15 s, m", published, found, np.abs(found - ends(finer)), 0.03, "fast waves"),
        Row("linear momentum along x, N s", 20.0, history.linear_momentum[-1, 0], 0.0, 1e-9, "rounding"),
        Row("change of angular momentum in flight, N m s", 0.0, np.ptp(history.angular_momentum[200:, 2]), 0.0, 1e-8,
            "rounding"),
    ]  # fmt: skip
    return rows, shapes(history, "xy")


@problem(
    "Flying spaghetti in space",
    "motion",
    "Simo & Vu-Quoc, Comput. Methods Appl. Mech. Eng. 66 (1988) 125, doi:10.1016/0045-7825(88)90073-4; momentum: the "
    "impulse of the load",
    "the same rod; 20 N and (0, -200, -100) N m at one end, triangles over 5 s",
    _EXUDYN.format(80),
)
def flying_spaghetti_3d():
    history = from_file("flying_spaghetti_3d")
    finer = from_file("flying_spaghetti_3d", dt=0.00625, save_every=10.0)
    found = ends(history)
    published = np.array([40.6913, 0.1571, -3.0312, 40.4797, 8.5540, 1.6814])
    rows = [
        Row("both ends at 10 s, m", published, found, np.abs(found - ends(finer)), 3e-3, "steps of both programs"),
        Row("linear momentum along x, N s", 50.0, history.linear_momentum[-1, 0], 0.0, 1e-9, "rounding"),
        Row("change of angular momentum in flight, N m s", 0.0,
            np.ptp(history.angular_momentum[history.times >= 5.0], axis=0).max(), 0.0, 1e-8, "rounding"),
    ]  # fmt: skip
    return rows, shapes(history, "xz")


@problem(
    "Spin-up of a blade",
    "motion",
    "Kane, Ryan & Banerjee, J. Guid. Control Dyn. 10 (1987) 139, doi:10.2514/3.20195; Simo & Vu-Quoc, J. Appl. Mech. "
    "53 (1986) 855: steady extension 5.14e-4 m, rho A omega^2 L^3/(3 EA)",
    "blade of 10 m, EA = 2.8e7 N, GA = 1e7 N, EI = 1.4e4 N m^2, 1.2 kg/m; to 6 rad/s in 15 s",
)
def spin_up():
    settings = {"dt": 0.05, "elements": 2, "duration": 17.0}
    results = [from_file("spin_up", **{**settings, "dt": dt}) for dt in (0.05, 0.025)]
    means = []
    for history in results:
        tip, turn = history.scene.rods[0].end, history.scene.supports[0].rotation
        angle = np.array([turn(t)[2] for t in history.times])
        x, y, _ = history.position(tip).T
        out, lag = x * np.cos(angle) + y * np.sin(angle) - 10.0, y * np.cos(angle) - x * np.sin(angle)
        means.append(np.mean(out[history.times > 15.0]))
    row = Row("mean extension after 15 s, m", 5.14e-4, means[0], abs(means[0] - means[1]), 5e-6, "digits printed")
    lines = [("behind the hub", history.times, lag, "-"), ("along the blade, 100 times", history.times, 100 * out, "-")]
    return [row], charted("time (s)", "displacement of the tip (m)", lines)


@problem(
    "Pendulum with a large swing",
    "motion",
    "Legendre (1825): period 4 K(sin(a/2)) sqrt(2 L/(3 g)) of a rod that swings by a to either side",
    "rigid rod of 2 m, 2 kg/m, on a hinge, let go at 120 degrees from its lowest position",
)
def large_swing():
    L, start, g = 2.0, math.radians(120), 9.81
    period = 4 * ellipk(math.sin(start / 2) ** 2) * math.sqrt(2 * L / (3 * g))
    section = cf.Stiffness((1e8, 1e8), 1e8, (1e7, 1e7), 1e7, mass=2.0, inertia=(1e-6,) * 3)
    rod = cf.Rod(cf.Line((0, 0, 0), (L * math.sin(start), 0, -L * math.cos(start))), section, name="rod")
    scene = cf.Scene([rod], [cf.Hinge(rod.start, (0, 1, 0))], [cf.Weight((0, 0, -g))])
    found = []
    for steps in (400, 800):
        history = cf.simulate(scene, period, dt=period / steps, elements=1, degree=2)
        t, x = history.times, history.position(rod.end)[:, 0]
        k = np.flatnonzero(x[:-1] * x[1:] < 0)
        lowest = t[k] - x[k] * (t[k + 1] - t[k]) / (x[k + 1] - x[k])
        found.append(2 * (lowest[1] - lowest[0]))
    row = Row("period, s", period, found[1], abs(found[1] - found[0]), 2e-5 * period, "steps of 1/800 of the period")
    return [row], tracked(history, rod.end, "xz")


@problem(
    "Heavy top",
    "motion",
    "Bruels, Cardona & Arnold, Mech. Mach. Theory 48 (2012) 121, doi:10.1016/j.mechmachtheory.2011.07.017; position by "
    "steps of 2 us in kynema, tests/.../dynamic_heavy_top.cpp",
    "15 kg, 0.234375, 0.46875, 0.234375 kg m^2, 1 m off its ball joint; 150 rad/s about its axis, -4.61538 across",
    "A rigid body: an arm with 1e9 N and N m^2 and no mass stands for it.",
)
def heavy_top():
    arm = cf.Stiffness((1e9, 1e9), 1e9, (1e9, 1e9), 1e9, mass=1e-6, inertia=(1e-7,) * 3)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 1, 0), d1=(1, 0, 0)), arm, name="arm")
    body = cf.PointMass(rod.end, 15.0, (0.234375, 0.234375, 0.46875))
    spin = cf.InitialVelocity(rod, angular=(0, 150.0, -4.61538))
    scene = cf.Scene([rod], [cf.Pin(rod.start)], [body, cf.Weight((0, 0, -9.81))], velocities=[spin])
    moved = []
    for dt in (2e-3, 1e-3):
        history = cf.simulate(scene, 2.0, dt=dt, elements=1, degree=1)
        moved.append(history.displacement(rod.end)[-1])
    published = np.array([-0.150416985652933, -1.724164450779749, -0.673023460701136])
    row = Row("displacement of the mass centre at 2 s, m", published, moved[1], np.abs(moved[1] - moved[0]), 5e-4,
              "tolerance of kynema's test")  # fmt: skip
    return [row], tracked(history, rod.end, "xyz")


#: BeamDyn's tip along the load, m, at these times, s.
BLADE = {0.005: 0.020925423564558, 0.02: 0.19856414954624, 0.05: 0.76836577300452, 0.1: 2.0534850126406,
         0.13: 2.3454958661714, 0.2: 1.1064712884566, 0.39: 2.3022958928457}  # fmt: skip


@problem(
    "Composite blade under a sudden load",
    "motion",
    "Wang, Sprague, Jonkman, Johnson & Jonkman, Wind Energy 20 (2017) 1439, doi:10.1002/we.2101; BeamDyn's motion in "
    "kynema, tests/.../dynamic_beam_5nodes_0pt005s_beamdyn.csv",
    "10 in, coupled 6 x 6 stiffness and mass per length as printed there, 150 lb across the tip from t = 0 on",
    "BeamDyn's record is of one element of 5 nodes and steps of 5 ms, which damp the fast waves: with the same mesh, "
    "steps and full numerical damping it is met but for 0.03 in; the converged motion is up to 0.034 in off.",
)
def composite_blade():
    stiffness = np.diag([88.56e3, 38.78e3, 1368.17e3, 59.12e3, 141.47e3, 16.96e3])
    stiffness[3, 4] = stiffness[4, 3] = -0.370e3
    stiffness[3, 5] = stiffness[5, 3] = 17.61e3
    stiffness[4, 5] = stiffness[5, 4] = -0.351e3
    section = cf.Stiffness(matrix=stiffness, mass=8.538e-2, inertia=(0.40972e-2, 1.0336e-2, 1.44332e-2))
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0), d1=(0, 1, 0)), section, name="blade")
    load = cf.Force(rod.end, cf.signals.Step((0, 0, 150.0)))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [load])
    alpha = {"dt": 5e-3, "elements": 1, "degree": 4, "scheme": "generalised-alpha", "rho_inf": 0.0}
    histories = [cf.simulate(scene, 0.4, **settings) for settings in (
        alpha, {**alpha, "elements": 2}, {"dt": 1.25e-3, "elements": 4}, {"dt": 6.25e-4, "elements": 8})]  # fmt: skip
    times, published = np.array(list(BLADE)), np.array(list(BLADE.values()))
    same, other, coarse, fine = (np.interp(times, h.times, h.displacement(rod.end)[:, 2]) for h in histories)
    rows = [
        Row("tip, one element, steps of 5 ms, in", published, same, np.abs(same - other), 0.035,
            "BeamDyn's start and damping are not in the record's source"),
        Row("tip, converged, in", published, fine, np.abs(fine - coarse), 0.04, "the record is not converged"),
    ]  # fmt: skip
    lines = [("BeamDyn", times, published, "ko")]
    lines += [(name, h.times, h.displacement(rod.end)[:, 2], "-") for name, h in
              (("one element, 5 ms", histories[0]), ("8 elements, 0.6 ms", histories[3]))]  # fmt: skip
    return rows, charted("time (s)", "displacement of the tip along the load (in)", lines)
