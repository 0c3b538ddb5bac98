"""Random drill-strings in motion, tried as a hostile specialist would: which invariants do not hold?

    python demos/evidence/random_strings.py            200 strings (an hour); writes out/random_strings.md
    python demos/evidence/random_strings.py --quick    one string

Strings of 0.3 to 6 km with all kinds of drives and laws of the bit, some with friction at the wall of a deviated hole,
drag, damping, or an autodriller. Each is moved by its model, with a third of the step, and by the other model where
both apply.
`LIMITS` says what is checked, and by how much it may be off. A ratio above 1 is a wrong number without a word, unless
the history has a caution; what a request is refused for is counted.
"""

import math
import tempfile
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from harness import command, table, write
from scipy.optimize import least_squares

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.stick_slip import cycle_of

D, BOTH, DURATION = cf.drilling, "axial and torsional", 12.0
PIPES, COLLARS = ("2 7/8 in 10.40 lb/ft", "4 in 14.00 lb/ft", "5 in 19.50 lb/ft"), ("NC31-41", "NC46-65", "NC56-80")
MODES, LONGEST = 12, 150.0  # most modes that are fitted to a motion, and its longest duration, s
LIMITS = {
    "energy is created": 1e-6,  # over all work
    "the scheme loses energy": 0.1,  # over all work
    "torque does not balance": 2e-3,  # impulse over that of the sizes of the torques
    "steady start moves": 1e-6,  # change of the bit's speed over it, before a wave has come back
    "growth differs from stability": 0.05,  # over the growth, or 0.1/s
    "motion fits no modes": 0.05,  # what modes near those of stability leave of a motion, over it
    "response at low frequency": 1e-3,  # over the slope of the torque that turns the string
    "resumed differs": 1e-300,
    "step's error above its estimate": 1.0,  # difference from a third of the step, over the estimate and 0.1 %
    "models differ": 1.0,  # over the estimates of both and 2 %
}


@dataclass(frozen=True)
class OwnPI(D.SampledControl):
    """A user's control: PI with a limit of the torque."""

    Kp: float
    Ki: float
    most: float
    sample: float = 0.02
    delay: float = 0.0

    def begin(self):
        return (0.0,)

    def torque(self, state, now):
        off = now.asked - now.speed
        torque = min(max(self.Kp * off + self.Ki * state[0], -self.most), self.most)
        return torque, state + self.sample * off * (abs(torque) < self.most)


def draw(seed):
    """The `Drilling` of a seed."""
    rng = np.random.default_rng(seed)
    length, kind, time = 300 * 20 ** rng.random(), int(rng.integers(3)), 1e-5 * float(rng.random() < 0.25)
    collar = cf.well.Collar(length * rng.uniform(0.02, 0.2), size=COLLARS[kind], damping_time=time)
    string = cf.well.DrillString([collar, cf.well.DrillPipe(size=PIPES[kind], damping_time=time)])
    segments = D.Drilling(string, D.TopDrive(1.0), depth=length).segments
    size, inertia, omega = (400, 2e3, 5e3)[kind] * rng.uniform(0.2, 1.5), rng.uniform(500, 4000), rng.uniform(2, 20)
    weight, falls, speed = segments[-1].weight * collar.length * rng.uniform(0.2, 0.9), *rng.uniform([0.3, 1], [1, 10])
    Kp = segments[0].torsional_impedance * 10 ** rng.uniform(-0.5, 1)
    Ki, sample = inertia * rng.uniform(0.5, 3) ** 2, float(rng.choice([0.01, 0.02, 0.05]))
    drive = [
        lambda: D.TopDrive(omega), lambda: D.TopDrive(omega, control=D.Matched()),
        lambda: D.TopDrive(omega, inertia, D.PI(Kp, Ki)),
        lambda: D.TopDrive(omega, inertia, D.SoftSpeed(string, inertia, length)),
        lambda: D.TopDrive(omega, inertia, OwnPI(Kp, Ki, 4 * size, sample, float(rng.choice([0.0, 0.03])))),
        lambda: D.TopDrive(None, inertia, D.Motor(1.2 * size, size / 40)),
        lambda: D.TopDrive(None, inertia, D.TorqueOverTime(cf.signals.Ramp(1.5 * size, 0.0, 3.0), sample)),
        lambda: D.TopDrive(cf.signals.Ramp(omega, 0.0, 4.0), inertia, D.SoftTorque(string, inertia, length)),
    ][rng.integers(8)]()  # fmt: skip
    law = [
        lambda: D.Stribeck(size, falls * size, speed), lambda: D.Stribeck(size, falls * size),
        lambda: D.Stribeck(10 * size / weight, 10 * falls * size / weight, speed, radius=0.1),
        lambda: D.TableLaw((0.0, 0.3 * speed, speed, 4 * speed), (size, falls * size, falls * size, 0.9 * size)),
        lambda: D.Rational(size, speed), lambda: D.RateLaw(weight / 3e-3, size),
        lambda: D.Cutting(0.1, 60e6, rng.uniform(0.4, 1.0), int(rng.integers(2, 7))),
    ][rng.integers(7)]()  # fmt: skip
    given = {"drag": D.ViscousDrag(rng.uniform(0, 0.3), rng.uniform(0, 0.3))} if rng.random() < 0.7 else {}
    if rng.random() < 0.4:
        stations = length * np.array([0, 0.2, 0.5, 1]), [0, 0, *[rng.uniform(5, 60)] * 2], [0] * 4
        section = cf.well.HoleSection(length, (0.15, 0.2, 0.3)[kind], rng.uniform(0, 0.35))
        given["hole"] = cf.well.Borehole(cf.well.WellPath.from_survey(*stations), section)
        given["mud"] = cf.well.Mud(rng.uniform(1000, 1800))
        given["friction"] = rng.choice([None, D.WallFriction(rng.uniform(0.2, 0.4), 0.2, rng.uniform(0.1, 1.0))])
    if law.drills and rng.random() < 0.3:
        given["hook"] = D.Hook(rng.choice([5e6, math.inf]), autodriller=D.Autodriller(weight, 1e-8, 1e-8))
    bit = D.BitOnRock(law, weight, rng.choice([0.0, 20.0, 200.0])) if rng.random() < 0.95 else None
    return D.Drilling(string, drive, bit, depth=length, **given)


def moved(scene, until=DURATION, **more):
    return D.simulate(scene, until, **{"save_every": 0.01, "progress": False, **more})


def cycle(motion):
    """Period, peak, least and largest torque of the second half, and the sizes that shares of them are of."""
    found = np.array(cycle_of(motion.rows, DURATION / 2))
    return found, np.array([*np.abs(found[:2]), *[np.abs(found[2:]).max()] * 2])


def says(motion):
    """Whether a motion says that its numbers depend on the step, or by more than its estimate of errors."""
    return motion.stick_slip().irregular or any("beyond `errors`" in x for x in motion.why)


def off_in(motion):
    """{what: how far a motion is off}: energy, torque, resumed, with a third of the step, which its estimate of errors
    by twice and half the step has not seen. That motion has a row for every step: rows 10 ms apart miss its peaks."""
    scene = motion.scene
    work = sum(np.abs(np.nan_to_num(getattr(motion, f"work_of_{x}"))).max() for x in ("drive", "hook", "weight"))
    yield "energy is created", max(0.0, motion.balance[-1]) / max(work, 1e-9)
    yield "the scheme loses energy", max(0.0, -motion.balance[-1]) / max(work, 1e-9)
    fine = moved(scene, model=motion.model, dt=motion.dt / 3, save_every=None)
    (here, size), (there, _) = cycle(motion), cycle(fine)
    off = np.abs(here - there) / (np.array(motion.errors) + 1e-3 * size + 1e-6)
    if not says(motion):
        yield "step's error above its estimate", np.nanmax(off, initial=0.0)
    with tempfile.TemporaryDirectory() as place:
        moved(scene, DURATION / 2, model=motion.model, folder=f"{place}/m")
        again = cf.resume(f"{place}/m", duration=DURATION, scene=scene, progress=False)
    yield "resumed differs", float(np.nanmax(np.abs(again.rows - motion.rows)))
    if scene.hole is None and scene.drag is None:
        short = moved(scene, 3.0, model=motion.model, save_every=None)
        ends = np.cumsum([x.length for x in scene.segments])
        x = (np.arange(20000) + 0.5) * ends[-1] / 20000
        inertia = np.array([x.rhoJ for x in scene.segments])[np.searchsorted(ends, x)] * ends[-1] / 20000
        # speeds and torques are means over steps; the speed of a bit with inertia above waves is not
        rows, mean = short.times <= short.profile_times[-1] + 1e-9, short.mean_times
        turning = inertia @ np.interp(x, short.depths, short.speed[-1])
        of_bit = short.times if mean[0] == 0 else mean
        turning += scene.bit.inertia * np.interp(mean[rows][-1], of_bit, short.bit_speed) if scene.bit else 0.0
        torques = short.surface_torque[rows], -short.torque_on_bit[rows]
        handed, whole = (
            y[0] * mean[0] + np.diff(mean[rows]) @ (y[1:] + y[:-1]) / 2 for y in (sum(torques), sum(map(abs, torques)))
        )
        yield "torque does not balance", abs(handed - turning) / whole


def off_in_small_motions(scene, speed):
    """{what: how far}: steady start, growth of a small disturbance, response at a low frequency."""
    steady, travel = replace(scene, start="steady"), sum(x.length / x.torsional_speed for x in scene.segments)
    still = moved(steady, 2.0)
    yield "steady start moves", float(np.ptp(still.bit_speed[still.times < travel])) / speed
    if not (scene.bit and scene.bit.law.drills):
        low, high = (
            moved(replace(steady, drive=D.TopDrive(speed * x)), 0.2).surface_torque[-1] for x in (0.999, 1.001)
        )
        slope = (high - low) / (0.002 * speed)
        scale = max(abs(slope), 1e-3 * abs(high) / speed, 1e-6 * scene.segments[0].torsional_impedance)
        found = D.frequency_response(replace(scene, drive=D.TopDrive(speed)), [1e-5], unstable=True)
        yield "response at low frequency", abs(found.impedance[0].real - slope) / scale
    yield from off_in_growth(steady, speed)


def off_in_growth(steady, speed):
    """How far the growth of a small disturbance is from that of `stability`. The modes that lead are fitted to the
    second half of a motion, long enough for others to fade by exp(-10), or exp(-16) where the bit cuts: a drive hardly
    disturbs axial modes; where they make up 95 % of it, they count."""
    found = D.stability(steady, [speed])
    growth, frequency = found.growth[0, 0], found.frequency[0, 0]
    order = np.argsort(np.where(np.isfinite(growth), -growth, np.inf))
    growth, frequency = (x[order][np.isfinite(growth[order])] for x in (growth, frequency))
    if not len(growth):
        raise cf.NotConverged("growth is not compared: no modes were found")
    fades = np.append(growth[1 : MODES + 1], growth[0] - 2)[:MODES]  # of all but the first, the first two, ...
    slowest = np.minimum.accumulate(np.where(frequency < 0.05, 1.0, frequency))[: len(fades)]
    apart = 16 if steady.bit and steady.bit.law.drills else 10
    durations = 2 + np.maximum(apart / np.maximum(growth[0] - fades, 1e-9), 4 / slowest)
    until, count = durations.min(), int(durations.argmin()) + 1
    if until > LONGEST or not -14 < growth[0] * until < 30:
        raise cf.NotConverged("growth is not compared: the leading modes are too close together, or fade too fast")
    share = min(1e-3, 1e-3 * math.exp(-growth[0] * until))
    for again in (True, False):  # what is left at the end decides how large the disturbance may be
        size = share * speed
        bump = cf.signals.Table([0, 0.5, 0.75, 1], [speed, speed, speed + size, speed])
        motion = moved(replace(steady, drive=replace(steady.drive, speed=bump)), until)
        largest = np.abs(motion.bit_speed - speed).max() / speed
        if not again or growth[0] <= 0 or largest > 1e-4:
            break
        share = min(1e-3, share * 1e-3 / max(largest, 1e-300))
    times = motion.times if motion.mean_times[0] == 0 else motion.mean_times
    late = times > until / 2
    t, y = times[late] - until / 2, (motion.bit_speed[late] - speed) / size

    def waves(modes):
        found = np.exp((modes[:count] + 2j * np.pi * modes[count:]) * t[:, None])
        return np.column_stack([found.real, found.imag])

    def missing(modes):
        return waves(modes) @ np.linalg.lstsq(waves(modes), y, rcond=None)[0] - y

    fitted = least_squares(missing, np.concatenate([growth[:count], frequency[:count]]), max_nfev=30)
    left = np.linalg.norm(fitted.fun) / np.linalg.norm(y)
    yield "motion fits no modes", left
    if left < LIMITS["motion fits no modes"]:
        strong = np.linalg.lstsq(waves(fitted.x), y, rcond=None)[0].reshape(2, count)
        k = np.hypot(*strong).argmax()
        yield "growth differs from stability", abs(fitted.x[k] - growth[k]) / max(abs(growth[k]), 0.1)


def tried(seed):
    """([(what, ratio to its limit)], [refusals]) of a seed."""
    scene, found, refused = draw(seed), [], []

    def take(function, *asked):
        try:
            found.extend((what, value / LIMITS[what]) for what, value in function(*asked))
        except (cf.SceneError, cf.NotConverged) as problem:
            refused.append(f"{function.__name__}: {problem}")

    def pair():
        motions.append(moved(scene, check=True))
        if motions[0].model != BOTH:
            motions.append(moved(scene, model=BOTH, check=True))
            (a, size), (b, _) = map(cycle, motions)
            told = sum(np.array(x.errors) for x in motions) + 0.02 * size
            if not any(map(says, motions)):
                yield "models differ", np.nanmax(np.abs(a - b) / told, initial=0.0)

    motions = []
    take(pair)
    for motion in motions:
        take(off_in, motion)
    if isinstance(scene.drive.speed, float) and not (scene.drive.control.sampled or scene.hook):
        take(off_in_small_motions, scene, scene.drive.speed)
    return found, refused


def main(quick=False, count=200, first=0, out="out"):
    """Try a number of strings from the seed `first` on, print what is off, and write random_strings.md. Returns [(seed,
    what, ratio to its limit)], and [what was refused]."""
    rows, refusals = [], []
    for seed in [62] if quick else range(first, first + count):
        found, refused = tried(seed)
        rows, refusals = rows + [(seed, *x) for x in found], refusals + refused
        for what, ratio in found:
            if not ratio <= 1:
                scene = draw(seed)
                print(f"{seed}: {what}, {ratio:.3g} of its limit: {scene.drive.control}, {scene.bit}", flush=True)
    cells = []
    for what in LIMITS:
        ratios = [x[2] for x in rows if x[1] == what]
        cells.append((what, len(ratios), sum(not x <= 1 for x in ratios), f"{max(ratios, default=math.nan):.2g}"))
    kinds = Counter(text.partition(": expected")[0] for text in refusals)
    lines = [*table("what | motions | off | largest ratio to its limit", cells), "", "Refused:", ""]
    print(write("random_strings", [*lines, *(f"- {n} times: {kind}" for kind, n in kinds.most_common())], out))
    return rows, refusals


if __name__ == "__main__":
    command(__doc__, main, {"quick": True}, count={"type": int, "default": 200}, first={"type": int, "default": 0})
