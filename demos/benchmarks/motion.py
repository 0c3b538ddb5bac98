"""Published problems of motion and of dynamic stability: flutter, flights, a spin-up, a pendulum, a top, a blade."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from curves import charted
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


def exponents(scene, stations, duration, dt, count, *, after=0.0, every=1, **settings):
    """The exponents s (1/s) of small motions along y, sums of exp(s t), by the matrix pencil method.

    Those of the trapezoidal rule, which the steps of small motions obey, are turned back to those in time.

    Args:
        stations: that are watched, `every` so many steps from the time `after` on, s. count: of exponents.
        settings: of `simulate`.
    """
    history = cf.simulate(scene, duration, dt=dt, save_every=every * dt, **settings)
    first = round(after / (every * dt))
    samples = np.array([history.displacement(station)[first:, 1] for station in stations])
    rows = samples.shape[1] // 2
    window = np.lib.stride_tricks.sliding_window_view
    hankel = np.concatenate([window(channel, samples.shape[1] - rows + 1) for channel in samples], axis=1)
    basis = np.linalg.svd(hankel, full_matrices=False)[0][:, :count]
    z = np.linalg.eigvals(np.linalg.lstsq(basis[:-1], basis[1:], rcond=None)[0]) ** (1 / every)
    found = 2 / dt * (z - 1) / (z + 1)
    found = found[found.imag > 0]
    return found[np.argsort(found.imag)][:2]


def column(load, P, elements):
    """The two lowest exponents of a clamped column of 1 m, EI = 1, 1 kg/m, under a follower load of size P."""
    section = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 1.0), 1.0, mass=1.0, inertia=(1e-7,) * 3)
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section, name="column")
    kick = cf.InitialVelocity(rod, lambda s: (0, 1e-4 * s**2, 0), lambda s: (0, 0, 2e-4 * s))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [load(rod, P)], velocities=[kick])
    return exponents(scene, [rod.at(0.5), rod.end], 4.0, 5e-3, 8, every=2, start=1.0, elements=elements)


def two_links(P, hinge, damping=0.0):
    """The two exponents of Ziegler's pendulum: links of 1 m, 2 kg between them, 1 kg at the tip, springs of 1 N m/rad.

    Args:
        P: the follower force, N. hinge: length of the two soft pieces of the rod that stand for springs, m.
        damping: of the springs, over their stiffness, s.
    """
    soft, stiff = (cf.Stiffness((1e6, 1e6), 1e6, (EI, EI), 1.0, mass=1e-6, inertia=(1e-8,) * 3) for EI in (hinge, 1e5))
    pieces = [(hinge, soft), (1.0, stiff), (1.0 + hinge, soft), (None, stiff)]
    line = cf.Line((0, 0, 0), (2 + hinge / 2, 0, 0))
    rod = cf.Rod(line, pieces, name="pendulum", damping=cf.Damping(time=damping) if damping else None)
    masses = [cf.PointMass(rod.at(1 + hinge / 2), 2.0), cf.PointMass(rod.end, 1.0)]
    push = cf.Force(rod.end, cf.signals.Step((0, 1e-3, 0), 0.0, 0.5))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.FollowerForce(rod.end, (0, 0, -P)), push, *masses])
    stations = [rod.at(1 + hinge / 2), rod.end]
    return exponents(scene, stations, 40.0, 0.05, 4, after=1.0, every=2, elements=4, degree=2)


def meeting(pair_at, near):
    """Where the two frequencies meet: the square of the difference of their squares is smooth in the load, and zero.

    Args:
        pair_at: a function of the load, which gives two exponents. near: the load, roughly.

    Returns:
        [load, frequency], the frequencies (3, 2) at three loads below it, these loads.
    """
    loads = near * np.array([0.92, 0.96, 0.99])
    pairs = np.array([pair_at(P).imag for P in loads])
    curve = np.polyfit(loads, np.diff(pairs**2)[:, 0] ** 2, 2)
    load = np.roots(curve)[np.argmin(np.abs(np.roots(curve) - near))].real
    return np.array([load, math.sqrt(np.polyval(np.polyfit(loads, (pairs**2).mean(axis=1), 2), load))]), pairs, loads


def fluttering(fine, coarse, published, allowed, because, label):
    """Rows and picture; fine, coarse: functions of the load; published: [load, frequency], or the load alone."""
    (found, pairs, loads), (rough, _, _) = meeting(fine, published[0]), meeting(coarse, published[0])
    rows = [
        Row(name, value, ours, abs(ours - other), allowed, because)
        for name, value, ours, other in zip((label, "frequency there, rad/s"), published, found, rough, strict=False)
    ]
    lines = [(f"frequency {k + 1}", loads, pairs[:, k], "o-") for k in (0, 1)]
    lines.append(("published", [published[0]] * 2, [pairs.min(), pairs.max()], "k--"))
    return rows, charted(label, "circular frequency (rad/s)", lines)


_BY_MOTION = (
    "Linear buckling and the count of negative modes say nothing on flutter: small motions are simulated at three "
    "loads below it, their frequencies identified, and extrapolated to where they meet."
)


@problem(
    "Beck's column",
    "motion",
    "Beck, Z. angew. Math. Phys. 3 (1952) 225, doi:10.1007/BF02008828: 20.05; more digits by his frequency equation",
    "clamped column of EI = 1, L = 1, m = 1, compressed by a force that follows its tip",
    _BY_MOTION,
)
def beck_column():
    fine, coarse = (
        lambda P, n=n: column(lambda rod, P: cf.FollowerForce(rod.end, (0, 0, -P)), P, n) for n in (6, 4)
    )  # fmt: skip
    because = "digits printed; the extrapolation"
    return fluttering(fine, coarse, (20.05095, 11.01556), 1e-3, because, "flutter load, EI/L^2 (-)")


@problem(
    "Column under distributed follower loads",
    "motion",
    "Leipholz, Z. angew. Math. Phys. 13 (1962) 581: 40.05 EI/L^3",
    "clamped column of EI = 1, L = 1, m = 1, compressed by a uniform load per length along its tangent",
    _BY_MOTION + " The load is an action of ten lines in this file.",
)
def leipholz_column():
    fine, coarse = (lambda q, n=n: column(lambda rod, q: FollowerLineForce(rod, -q), q, n) for n in (6, 4))
    return fluttering(fine, coarse, (40.05,), 6e-3, "digits printed", "flutter load per length, EI/L^3 (-)")


@problem(
    "Ziegler's pendulum",
    "motion",
    "Ziegler, Ing.-Arch. 20 (1952) 49, doi:10.1007/BF00536796: 7/2 - sqrt(2) = 2.086 without damping, 41/28 = 1.464 "
    "with little damping, which destabilises; numbers of Herrmann & Jong, J. Appl. Mech. 32 (1965) 592",
    "two rigid links of 1 m, springs of 1 N m/rad, masses of 2 and 1 kg, a force that follows the tip; equal dampers",
    _BY_MOTION + " With damping the load is where the decay of the slower motion changes its sign.",
)
def ziegler_pendulum():
    exact, near, found = np.array([3.5 - math.sqrt(2), 41 / 28]), np.array([1.44, 1.46, 1.48]), []
    for hinge in (0.02, 0.01):
        (load, _), pairs, loads = meeting(lambda P, hinge=hinge: two_links(P, hinge), exact[0])
        decay = [two_links(P, hinge, 0.01)[0].real for P in near]
        found.append([load, np.polyval(np.polyfit(decay, near, 2), 0.0)])
    ours = 2 * np.array(found[1]) - found[0]
    row = Row("flutter loads without and with damping, c/l (-)", exact, ours, np.abs(ours - found[1]), 1e-3,
              "springs are hinges of 20 and 10 mm, extrapolated to no length")  # fmt: skip
    lines = [(f"frequency {k + 1}, hinges of 10 mm", loads, pairs[:, k], "o-") for k in (0, 1)]
    lines.append(("published, springs", [exact[0]] * 2, [pairs.min(), pairs.max()], "k--"))
    return [row], charted("force, c/l (-)", "circular frequency (rad/s)", lines)


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


def shapes(history, axes, count=6):
    """Draws the first rod at times of equal distance, projected along the third axis."""
    (i, j), rod = ("xyz".index(axis) for axis in axes), history.scene.rods[0]
    lines = []
    for t in np.linspace(0, history.times[-1], count):
        k = int(np.argmin(np.abs(history.times - t)))
        line, _ = history.sample(k, rod, np.linspace(0, 1, 101))
        lines.append((f"{history.times[k]:.3g} s", line[:, i], line[:, j], "-"))
    return charted(f"{axes[0]} (m)", f"{axes[1]} (m)", lines, equal=True)


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
    return rows, shapes(history, "xy")


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
    "Heavy symmetric top",
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
