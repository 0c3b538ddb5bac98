"""What was asked of contact, stages, complex modes and rods that act, beside what is found.

    python demos/evidence/targets.py           all (some minutes)
    python demos/evidence/targets.py --quick   measures one cost alone, that of a changed curvature, once

Errors are the largest of rows of the table of `make truths`, as it stands in the documentation. Costs are measured
here: ratios of processor times of runs that take turns in one process, medians. Targets whose numbers are made by other
commands, or by tests, are named with these. Writes out/targets.md.
"""

import math
import re
from collections import namedtuple
from pathlib import Path

import numpy as np
from harness import command, in_turns, in_words, table, write

import cosserat_fenicsx as cf

TRUTHS = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "truths.md"
#: A target: its part; what is asked; rows of the truths (a regular expression), a function of (runs) that returns a
#: number, or in words where the number is; the largest number allowed (None: in words); what is said of it, such as why
#: it is missed; missed: where a verdict in words is that.
Target = namedtuple("Target", "part asked found most said missed", defaults=("", False))
POINTS = np.linspace(0.0, 1.0, 21)


def arm(*loads, stages=()):
    section = cf.Stiffness((3e3, 3e3), 5e3, (0.02, 0.02), 0.016)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 0.3)), section, name="arm")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [load(rod) for load in loads], stages=stages)


def pulled(rod):
    return cf.Force(rod.end, (0.05, -0.03, -0.1))


def over(dear, cheap, runs):
    """Ratio of the processor times of two tasks, the median of runs that take turns; the first ones compile."""
    dear(), cheap()
    times = in_turns((dear, cheap), runs)
    return float(np.median(times[:, 0] / times[:, 1]))


def of_stages(elements):
    """A function of runs: two loads in two stages over the same in one, at as many points."""

    def cost(runs):
        rod = arm().rods[0]
        loads = cf.Force(rod.end, (0.05, 0, 0)), cf.Force(rod.end, (0, 0.05, -0.1))
        clamp, half = [cf.Clamp(rod.start)], POINTS[::2]
        apart = cf.Scene([rod], clamp, stages=[cf.Stage([load], load_factors=half) for load in loads])
        how = {"elements": elements, "model": "spatial"}
        together = cf.Scene([rod], clamp, loads)
        return over(lambda: cf.solve(apart, **how), lambda: cf.solve(together, POINTS, **how), runs)

    return cost


def of_acting(load):
    """A function of runs: the arm with what acts over the arm without it, at as many points, on 8 elements."""

    def cost(runs):
        scenes = arm(pulled, load), arm(pulled)
        tasks = (lambda scene=scene: cf.solve(scene, POINTS[1:], elements=8, model="spatial") for scene in scenes)
        return over(*tasks, runs)

    return cost


def estimates():
    """Estimates over errors of the eigenvalues of Beck's column (truths by another program) on 4 and 8 elements, where
    errors are above rounding."""
    exact = {10.0: [5.17578505732j, 18.5865406058j, 57.8508704062j],
             21.0: [-2.12520036617 + 10.9373182007j, 2.12520036617 + 10.9373182007j, 53.297504332j]}  # fmt: skip
    section = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 1.0), 1.0, mass=1.0, inertia=(1e-7, 1e-7, 2e-7))
    rod, found = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), section), []
    for load, values in exact.items():
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.FollowerForce(rod.end, (0, 0, -load))])
        modes = cf.modes(scene, 6, load_factor=1.0, tol=1e-4)
        at = np.abs(modes.eigenvalues[:, None] - values).argmin(axis=0)
        off = np.abs(modes.eigenvalues[at] / values - 1)
        found += (modes.error[at] / off)[off > 1e-8].tolist()
    return found


def ring_touches(runs):
    """How far from 4.444285764935019 N, by shooting, a ring of the length 1 m that is pulled begins to touch itself."""
    R, force, share = 1 / (2 * math.pi), 4.444285764935019, 1e-4
    section = cf.Stiffness((math.inf,) * 2, math.inf, (1e-3,) * 2, 1e-3)
    halves = [cf.Rod(cf.Arc((0, 0, 0), (-R, 0, 0), turn), section, name=name)
              for name, turn in (("a", -math.pi), ("b", math.pi))]  # fmt: skip
    (a, b), touch = halves, cf.RodContact(radius=0.03, exclude=0.4955)
    joints = [cf.Joint(a.start, b.start), cf.Joint(a.end, b.end)]
    scene = cf.Scene(halves, [cf.Clamp(a.start)], [touch, cf.Force(a.end, (1.0, 0, 0))], joints=joints)
    path = cf.solve(scene, [2.0, force * (1 - share), force * (1 + share)], elements=32)
    before, after = (len(path[k].contacts(touch)) for k in (1, 2))
    return share if after > before == 0 else math.inf


def rod_is_dragged(runs):
    """How far from (sqrt 2 - 1) mu w L, across the end of a stiff rod on a plane, it begins to slide: 61 nodes."""
    w, mu, L, share = 10.0, 0.5, 2.0, 1e-3
    rod = cf.Rod(cf.Line((0, 0, 0), (L, 0, 0)), cf.Stiffness((1e7, 1e7), 1e7, (1e6, 1e6), 1e6))
    floor = cf.Plane((0, 0, 0), (0, 0, 1), friction=mu, contact_radius=0.0)
    loads = [floor, cf.Spring(rod.start, rotational=1e-3), cf.LineForce(rod, (0, 0, -w), permanent=True),
             cf.Force(rod.start, (0, (math.sqrt(2) - 1) * mu * w * L, 0))]  # fmt: skip
    path = cf.solve(cf.Scene([rod], [], loads), [0.5, 0.9, 0.99, 1 - share, 1 + share], elements=15)
    moved = np.abs(path.displacement(rod.start)[:, 1])
    return share if moved[-2] < 1e-5 < 1e-2 < moved[-1] else math.inf


def of_crossings(runs):
    """Cost of a contact in a motion of 32 rods that fall across 32 others, over that with 10 across 10."""

    def falls(count, radius=0.005, apart=0.06):
        section, length = cf.Stiffness((1e4, 1e4), 1e4, (1.0, 1.0), 1.0, mass=0.1, inertia=(1e-6,) * 3), count * apart
        places = apart * (np.arange(count) + 0.5)
        lower = [cf.Rod(cf.Line((0, y, 0), (length, y, 0)), section) for y in places]
        upper = [cf.Rod(cf.Line((x, 0, 2 * radius), (x, length, 2 * radius)), section) for x in places]
        fall = [cf.InitialVelocity(rod, linear=(0, 0, -0.1)) for rod in upper]
        touch = cf.RodContact(radius=radius, stiffness=1e7)
        scene = cf.Scene([*lower, *upper], [], [touch], velocities=fall)
        return lambda: cf.simulate(scene, 3e-4, dt=1e-4, elements=count, degree=2)

    return over(falls(32), falls(10), min(runs, 3)) / 3.2**2


def of_nodes_on_a_plane(runs):
    """Cost of a contact of a rod on a plane, of which an end is lifted: 9961 nodes that touch, over that of 961."""

    def lies(elements):
        rod = cf.Rod(cf.Line((0, 0, 0), (0.1 * elements, 0, 0)), cf.Stiffness((1e4, 1e4), 1e4, (1.0, 1.0), 1.0))
        loads = [cf.Plane((0, 0, 0), (0, 0, 1), contact_radius=0.0), cf.LineForce(rod, (0, 0, -1), permanent=True),
                 cf.Force(rod.end, (0, 0, 0.5))]  # fmt: skip
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
        return lambda: cf.solve(scene, 1.0, elements=elements)

    return over(lies(2500), lies(250), min(runs, 3)) * 961 / 9961


MODES, STAGES, ACTION, CONTACT = "complex modes", "stages", "rods that act", "contact"
#: Why a given tension costs more.
_TENSION = (
    "its steps are taken in C, as without it (before that 3.1, helical 3.8). The rest is in C too: forms that have the "
    "tendon's energy, and 53 iterations in place of 41 (helical: 42)"
)
#: How far contacts of rods go.
_PAIRS = (
    "one solution serves the contacts that have no rod in common; with the response to each contact apart it was 2.2. "
    "1e4 contacts of 100 rods across 100 take 2.1 GB, and 49 s for three steps. At rest 1024 take 41 s; factors of "
    "the sparse tangent of a square grid grow faster. Detection takes as long as some iterations, not 5 %"
)
TARGETS = (
    Target(MODES, "eigenvalues, 8 P4 elements", r"complex modes .*(Beck's column under|rotating cantilever)", 1e-7),
    Target(MODES, "loads of flutter", r"complex modes .*load of flutter", 1e-6),
    Target(MODES, "whirl, P4 on 8 elements", r"complex modes .*Timoshenko", 2e-8),
    Target(MODES, "swept blade, Hz, P4 on 8 elements", r"complex modes .*swept", 2e-6),
    Target(MODES, "largest estimate over the error, Beck's column at 10 and 21", lambda runs: max(estimates()), 100.0,
           "all truths: 1 to 160 ([Vibrations](../vibrations.md)), on the safe side"),
    Target(MODES, "largest error over the estimate, as above", lambda runs: 1 / min(estimates()), 1.25),
    Target(MODES, "1e4 unknowns 0.5 s, 1e5 unknowns 8 s", "`scaling.py`, [table](cost.md#how-the-cost-grows)", None),
    Target(MODES, "blades of Epps and Chandra within 3 % or 1 Hz", "[Benchmarks](../benchmarks.md)", None),
    Target("errors", "estimates of moments over errors in 0.8 to 30",
           "0.8 to 18, `make random` ([table](accuracy.md#is-the-error-estimate-right)); tests/test_tolerance.py", None,
           "at a `tol` of 1e-2, where two meshes show no order, forces alone may be estimated hundreds of times too "
           "large"),
    Target(STAGES, "ring: unstable at 2 pi sqrt(3) EI/GJ", r"stages .*ring", 1e-5),
    Target(STAGES, "order of loads on a buckled column", r"stages .*buckled column", 1e-8),
    Target(STAGES, "cost over one stage, 20 points, 8 elements", of_stages(8), 1.2,
           "each stage sets up its problem and corrects its first point, 1.5 ms, of which no part is large"),
    Target(STAGES, "the same, 64 elements", of_stages(64), 1.2, "see above"),
    Target(ACTION, "all truths of rods that act", r"^\| (actuation|tendons) \|", 1e-8),
    Target(ACTION, "tendons of given length", r"tendon lengths .*(end \(m\)|over its own)", 1e-8,
           "frequencies are compared with rods whose tendons are rods, to 1e-6"),
    Target(ACTION, "tendons with friction: end, tension along it", r"tendon friction .*(end \(m\)|along it)", 1e-8),
    Target(ACTION, "tendons with friction: tension at the other end", r"tendon friction .*other end", 1e-8,
           "the tension is found at Gauss points, and extrapolated to the end of the rod"),
    Target(ACTION, "cost of a changed curvature", of_acting(lambda rod: cf.Actuation(rod, curvature=(0, 2.0, 0))), 1.3),
    Target(ACTION, "cost of a tendon", of_acting(lambda rod: cf.Tendon(rod, (0.01, 0), 4.0)), 1.3, _TENSION),
    Target(ACTION, "cost of a helical tendon",
           of_acting(lambda rod: cf.Tendon(rod, cf.Helical(0.01, 0.3), 4.0)), 1.3, _TENSION),
    Target(ACTION, "cost of a tendon of given length",
           of_acting(lambda rod: cf.Tendon(rod, (0.01, 0), shortening=0.002)), 1.3,
           "its tension is an unknown of a bordered row, and steps are taken in Python"),
    Target(ACTION, "cost of a tendon with friction",
           of_acting(lambda rod: cf.Tendon(rod, (0.01, 0), 4.0, friction=0.3)), 1.3,
           "each place feels all turns before it: GMRES in each iteration, and steps are taken in Python"),
    Target(CONTACT, "1: crossing rods, force", r"rod contact .*crossing", 1e-6),
    Target(CONTACT, "2: stiff capstan slips within 1e-3", r"obstacles .*stiff capstan", 1e-3,
           "held at 0.999 and lost at 1.001 of the limit, on 20 elements around the bollard"),
    Target(CONTACT, "2: heavy capstan, 200 nodes", r"obstacles .*heavy capstan, 200", 1e-3,
           "tension at which it slips, by shooting"),
    Target(CONTACT, "2: heavy capstan, 800 nodes", r"obstacles .*heavy capstan, 800", 1e-4),
    Target(CONTACT, "3: level end, M^2 = 2 w EI h", r"obstacles .*level end", 1e-5,
           "the place of lift-off to the distance of nodes, by the same test"),
    Target(CONTACT, "3: ring that stands on a plane, height", r"obstacles .*ring that stands on a plane, height", 1e-5,
           "the place of lift-off to the distance of nodes, by the same test"),
    Target(CONTACT, "4: bar pulled", r"obstacles .*plane, end", 1e-6),
    Target(CONTACT, "4: bar released, degree=1", r"obstacles .*released, linear elements", 1e-6,
           "ends of elements at the edges of slip in the states asked for, elsewhere in those between"),
    Target(CONTACT, "4: the same, degree 4, the default", r"obstacles .*released, end", 1e-6,
           "the edge of slip goes back through elements, in which what is before it overshoots; in one step, to an end "
           "of an element, the error is 7e-11"),
    Target(CONTACT, "4: stiff rod that is dragged, (sqrt 2 - 1) mu w L, 60 nodes", rod_is_dragged, 1e-3),
    Target(CONTACT, "5: ring that touches itself, force", r"rod contact .*ring", 1e-5),
    Target(CONTACT, "5: the pull at which it touches", ring_touches, 1e-4),
    Target(CONTACT, "6: two beams, one on a bed, force for a deflection", r"rod contact .*two beams, one on", 1e-4),
    Target(CONTACT, "6: the same, concentrated forces", r"rod contact .*two beams, concentrated", 1e-2,
           "by moments over 0.1 m, since forces of nodes next to each other alternate"),
    Target(CONTACT, "6: the same, sum of contact forces", r"rod contact .*two beams, sum", 1e-10),
    Target(CONTACT, "7: knots without friction", "`make knot`, [Tie a knot](../obstacles.md#tie-a-knot)", None),
    Target(CONTACT, "7: knots with friction up to 0.3", "no equilibrium", None,
           "contacts of a line are at nodes, and where strands slide from one to the next no state is found", True),
    Target(CONTACT, "8: bars, momenta 1e-10, energy 1e-8", "asserted by tests/test_rods_in_motion.py", None),
    Target(CONTACT, "8: bars, speeds and spins", r"rods in motion .*bars", 1e-3),
    Target(CONTACT, "8: stops of sliding rods, on a plane 1e-4", "asserted by tests/test_obstacles.py", None),
    Target(CONTACT, "8: stops of sliding rods, on other rods", r"rods in motion .*slides to rest", 1e-4,
           "the way; steps of 1 ms in a stop of 0.17 s, on elastic rails. Shorter steps were not tried"),
    Target(CONTACT, "9: cost of a contact on a plane, 1e4 over that of 1e3", of_nodes_on_a_plane, 2.0),
    Target(CONTACT, "9: cost of a contact of rods, 1024 over that of 100", of_crossings, 2.0, _PAIRS),
    Target(CONTACT, "10: Michell's ring, where it buckles", r"stages .*ring", 1e-3),
    Target(CONTACT, "10: the ring falls onto itself", "refused in words", None,
           "no branch is followed where rods touch; a motion was not tried", True),
    Target(CONTACT, "nothing passes through anything: 300 random tangles", "`make tangles`", None),
    Target(CONTACT, "public scenarios: error and time of other programs",
           "`make cosseratbench`, [table](../tables/cosseratbench.md)", None,
           "errors are below theirs, or below what the references tell; the pile takes 440 s, MuJoCo 173 s, PyElastica "
           "18 s, and capstan eight times PyElastica's time at a slide of 1/600: each step settles contacts of nodes "
           "exactly", True),
)  # fmt: skip


def largest(pattern):
    """The largest error of the rows of the truths that contain a regular expression; a LookupError without one."""
    truths, _, _ = TRUTHS.read_text("utf-8").partition("<!-- /truths -->")  # the table of targets follows
    rows = [line for line in truths.splitlines() if line.startswith("| ")]
    found = [float(re.search(r"[\d.]+e[-+]\d+", row.split(" | ")[2])[0]) for row in rows if re.search(pattern, row)]
    if not found:
        raise LookupError(f"{TRUTHS}: no row has {pattern!r}")
    return max(found)


def judged(target, runs):
    """The cells of a row, and whether the target is missed."""
    number, missed = target.found, target.missed
    if callable(target.found):
        value = target.found(runs)
        number, missed = f"{value:.1e}" if target.most < 1e-2 else f"{value:.2f}", value > target.most
    elif target.most is not None:
        value = largest(target.found)
        number, missed = f"{value:.1e}", value > target.most
    most = "" if target.most is None else f"{target.most:g}"
    return (target.part, target.asked, most, f"**{number}, missed**" if missed else number,
            target.said if missed or target.most is None or not callable(target.found) else ""), missed  # fmt: skip


def main(runs=7, targets=TARGETS, out="out"):
    """Measure, write the table, and return whether each target is missed."""
    found = [judged(target, runs) for target in targets]
    heads = "part | asked | at most | found | why it is missed, or what else is to be said"
    lines = table(heads, [row for row, _ in found])
    missed = [bad for _, bad in found]
    told = f"{len(found)} targets, {sum(missed)} missed. Costs are medians of {runs} run(s) in turn. {in_words()}"
    print(write("targets", [*lines, "", told], out))
    return missed


if __name__ == "__main__":
    quick = tuple(target for target in TARGETS if not callable(target.found) or "curvature" in target.asked)
    command(__doc__, main, {"runs": 1, "targets": quick})
