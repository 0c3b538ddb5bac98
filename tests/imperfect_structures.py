"""Symmetric structures with small imperfections, followed by `solve` and by small steps of fixed length.

The perfect structures have bifurcations and limit points. An imperfect one turns off sharply just before the
bifurcation, so that a long step may lead to another path. The truth is the path of the same equations on one mesh in
small steps of fixed length, halved where the direction of the path turns, and confirmed by steps of half the length.

As a script: python tests/imperfect_structures.py [how many] [first seed] (make imperfect).
"""

import math
import sys
import time
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

import cosserat_fenicsx as cf
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.statics.path.track import Track
from cosserat_fenicsx.statics.problem import record_of, solvers_of

_SMALLEST, _LARGEST = 1e-5, 3e-2
# Length of the steps of the truth: a share of its scale, which is that of rotations (rad), rod lengths, and of the load
# factor over the requested one. Steps are halved while an angle between chord and tangents is above the second number,
# and down to the third one, a share of their length, where negative modes change without a limit point.
STEP, _ANGLE, _SHORT, _MOST = 1e-2, 0.04, 2.0**-9, 6000
# Largest distance of a point from the true path, relative to the largest displacement and load factor; of the end; of
# the load factor of a limit point from the true one, relative to the requested one.
_BESIDE, _END, _LIMIT = 2e-3, 1e-4, 1e-4
_ELEMENTS = 8
CONTROLS = ("auto", "arc")


@dataclass
class Structure:
    """A scene, its largest load factor, the stations where paths are compared, and what it is."""

    kind: str
    imperfection: float
    scene: cf.Scene
    top: float
    stations: list


# -- structures ------------------------------------------------------------------------------------------------------


def _section(slenderness, length, sideways=100.0):
    """A section with EI = 1 in the plane of the structure, `sideways` out of it."""
    axial = (slenderness / length) ** 2
    return cf.Stiffness((axial / 3,) * 2, axial, (1.0, sideways), sideways)


def arch(draw, imperfection):
    """A circular arch, hinged or clamped, with a force on its crown that is inclined."""
    half, clamped, slenderness = draw.uniform(0.3, 1.2), draw.random() < 0.5, 10 ** draw.uniform(2.5, 3.5)
    R, axis = 1.0 / half, (0, 1, 0)
    curve = cf.Arc((0, 0, 0), (-R * np.sin(half), 0, R * np.cos(half)), 2 * half, axis)
    rod = cf.Rod(curve, _section(slenderness, 2.0))
    supports = [cf.Clamp(end) if clamped else cf.Hinge(end, axis) for end in (rod.start, rod.end)]
    crown = rod.at(rod.length / 2)
    load = cf.Force(crown, (imperfection, 0, -1.0))
    top = draw.uniform(5.0, 25.0) * (2.0 if clamped else 1.0)
    return Structure(
        f"{'clamped' if clamped else 'hinged'} arch {half:.2f} rad", imperfection,
        cf.Scene([rod], supports, [load]), top, [crown, rod.at(rod.length / 4)],
    )  # fmt: skip


def portal(draw, imperfection):
    """A portal frame, hinged or clamped, with forces on its columns and a part of one of them sideways."""
    span, clamped, axis = draw.uniform(0.6, 2.0), draw.random() < 0.5, (0, 1, 0)
    section = _section(10 ** draw.uniform(2.0, 3.0), 1.0)
    left = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1), d1=(0, 1, 0)), section, name="left")
    right = cf.Rod(cf.Line((span, 0, 0), (span, 0, 1), d1=(0, 1, 0)), section, name="right")
    beam = cf.Rod(cf.Line((0, 0, 1), (span, 0, 1), d1=(0, 1, 0)), section, name="beam")
    supports = [cf.Clamp(rod.start) if clamped else cf.Hinge(rod.start, axis) for rod in (left, right)]
    loads = [cf.Force(left.end, (imperfection, 0, -1.0)), cf.Force(right.end, (0, 0, -1.0))]
    joints = [cf.Joint(left.end, beam.start), cf.Joint(right.end, beam.end)]
    top = draw.uniform(0.6, 2.0) * (7.0 if clamped else 1.8)
    return Structure(
        f"{'clamped' if clamped else 'hinged'} portal, span {span:.2f}", imperfection,
        cf.Scene([left, right, beam], supports, loads, joints), top, [left.end, beam.at(span / 2)],
    )  # fmt: skip


def toggle(draw, imperfection):
    """Two inclined rods, rigidly joined at the loaded apex, hinged or clamped at their feet."""
    rise, clamped, axis = draw.uniform(0.05, 0.5), draw.random() < 0.5, (0, 1, 0)
    section = _section(10 ** draw.uniform(1.7, 2.7), 1.0)
    left = cf.Rod(cf.Line((-1, 0, 0), (0, 0, rise), d1=(0, 1, 0)), section, name="left")
    right = cf.Rod(cf.Line((0, 0, rise), (1, 0, 0), d1=(0, 1, 0)), section, name="right")
    feet = (left.start, right.end)
    supports = [cf.Clamp(foot) if clamped else cf.Hinge(foot, axis) for foot in feet]
    load = cf.Force(left.end, (imperfection, 0, -1.0))
    top = draw.uniform(0.8, 3.0) * 20.0 * rise
    return Structure(
        f"{'clamped' if clamped else 'hinged'} toggle, rise {rise:.2f}", imperfection,
        cf.Scene([left, right], supports, [load], [cf.Joint(left.end, right.start)]), top, [left.end, left.at(0.5)],
    )  # fmt: skip


def bent(draw, imperfection):
    """A column with a beam at its head (Roorda's frame), whose force is beside the axis: limit point or none."""
    axis = (0, 1, 0)
    section = _section(10 ** draw.uniform(2.0, 3.0), 1.0)
    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1), d1=(0, 1, 0)), section, name="column")
    beam = cf.Rod(cf.Line((0, 0, 1), (1, 0, 1), d1=(0, 1, 0)), section, name="beam")
    supports = [cf.Hinge(column.start, axis), cf.Hinge(beam.end, axis)]
    side = -1.0 if draw.random() < 0.5 else 1.0
    loads = [cf.Force(column.end, (0, 0, -1.0)), cf.Moment(column.end, (0, side * imperfection, 0))]
    top = draw.uniform(0.7, 1.6) * 14.0
    scene = cf.Scene([column, beam], supports, loads, [cf.Joint(column.end, beam.start)])
    return Structure(f"bent {side:+.0f}", imperfection, scene, top, [column.end, column.at(0.5)])


def strut(draw, imperfection):
    """A straight strut between two hinges, one of which slides, with a small force at mid-length."""
    section, axis = _section(10 ** draw.uniform(1.7, 3.0), 1.0), (0, 1, 0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1), d1=(0, 1, 0)), section)
    supports = [cf.Hinge(rod.start, axis), cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, axis)]
    loads = [cf.Force(rod.end, (0, 0, -1.0)), cf.Force(rod.at(0.5), (imperfection, 0, 0))]
    top = draw.uniform(0.8, 2.5) * np.pi**2
    return Structure("strut", imperfection, cf.Scene([rod], supports, loads), top, [rod.at(0.5), rod.at(0.25)])


def dome(draw, imperfection):
    """A shallow dome of 3 to 6 rods from a loaded apex to pinned or clamped feet, straight or curved."""
    legs, rise, clamped = int(draw.integers(3, 7)), draw.uniform(0.1, 0.4), draw.random() < 0.5
    section, curved = _section(10 ** draw.uniform(1.7, 2.5), 1.0, draw.choice([1.0, 3.0])), draw.random() < 0.5
    rods, angle = [], np.arctan(rise)
    for k in range(legs):
        c, s = np.cos(2 * np.pi * k / legs), np.sin(2 * np.pi * k / legs)
        across, foot = (-s, c, 0.0), (c, s, 0.0)
        if curved:  # an arc that is horizontal at the apex
            R = (1 + rise**2) / (2 * rise)
            curve = cf.Arc((0, 0, rise - R), (0, 0, rise), 2 * angle, across, d1=across)
        else:
            curve = cf.Line((0, 0, rise), foot, d1=across)
        rods.append(cf.Rod(curve, section, name=f"leg {k}"))
    joints = [cf.Joint(rods[0].start, rod.start) for rod in rods[1:]]
    supports = [cf.Clamp(rod.end) if clamped else cf.Pin(rod.end) for rod in rods]
    heading = draw.uniform(0, 2 * np.pi)
    push = imperfection * np.cos(heading), imperfection * np.sin(heading), -1.0
    load = cf.Force(rods[0].start, push)
    top = draw.uniform(1.0, 4.0) * 10.0 * legs * rise
    return Structure(
        f"{'clamped' if clamped else 'pinned'} dome of {legs} {'arcs' if curved else 'rods'}, rise {rise:.2f}",
        imperfection, cf.Scene(rods, supports, [load], joints), top, [rods[0].start, rods[1].at(0.5 * rods[1].length)],
    )  # fmt: skip


FAMILIES = (arch, portal, dome, toggle, bent, dome, arch, strut, dome, toggle)


def structure(seed):
    """The `Structure` of a seed; ten in a row are one of each of `FAMILIES`."""
    draw = np.random.default_rng(seed)
    imperfection = float(10 ** draw.uniform(math.log10(_SMALLEST), math.log10(_LARGEST)))
    return FAMILIES[seed % len(FAMILIES)](draw, imperfection)


# -- truth -----------------------------------------------------------------------------------------------------------


@dataclass
class Truth:
    """The path in small steps: its points, [(kind, smallest, largest load factor)] of its events, whether it ended at
    the requested load factor."""

    path: Path
    events: list = field(default_factory=list)
    reached: bool = False


class NoTruth(Exception):
    """The small steps do not follow the path, or not twice the same."""


def small_steps(given, length, elements=_ELEMENTS):
    """The `Truth` of a structure in steps of a length."""
    with solvers_of(given.scene, Layout.of(given.scene, elements)) as (problem, newton, stability):
        track, truth = Track(problem, newton, stability, 12), Truth(Path.of(problem.model))
        inner, weight = problem.model.inner, given.top**-2

        def angle(a, b):
            def product(u, v):
                return inner(u[0], v[0]) + weight * u[1] * v[1]

            return math.acos(min(product(a, b) / math.sqrt(product(a, a) * product(b, b)), 1.0))

        def record(point):
            truth.path.append(record_of(problem, point.load_factor, point.negative_modes, 0, 0))

        track.begin_here()
        here = track.here
        track.set_tangent(here, track.slope(), (0 * here.numbers[0], 1.0), weight)
        record(here)
        step, before = length / 16, None
        for _ in range(_MOST):
            ahead = [values + step * rate for values, rate in zip(here.numbers, _rates(before, here), strict=True)]
            solved = track.on_plane(ahead, here.load_factor + step * here.rise, here.along, weight * here.rise)
            point = None
            if solved.converged:
                point = track.point(solved)
                chord = point.numbers[0] - here.numbers[0], point.load_factor - here.load_factor
                track.set_tangent(point, track.bordered.slope, chord, weight)
                sharp = max(angle((x.along, x.rise), chord) for x in (here, point)) > _ANGLE
                if sharp or (_bifurcates(here, point) and step > _SHORT * length):
                    point = None
            if point is None:
                step /= 2
                if step < length * 2.0**-18:
                    raise NoTruth(f"steps became too small at the load factor {here.load_factor:.6g}")
                continue
            truth.events += _events_between(here, point, step)
            if (here.load_factor - given.top) * (point.load_factor - given.top) <= 0:
                share = (given.top - here.load_factor) / (point.load_factor - here.load_factor)
                guess = [a + share * (b - a) for a, b in zip(here.numbers, point.numbers, strict=True)]
                solved = track.at_load(guess, given.top)
                if not solved.converged:
                    raise NoTruth("the requested load factor was not met")
                record(track.point(solved))
                truth.reached = True
                return truth
            record(point)
            (before, here), last = (here, point), step
            here.arc, step = last, min(2 * step, length)
        return truth


def _rates(before, here):
    """Rates of all numbers along the path: the tangent, and for the contact force those of the last step."""
    if before is None:
        return [here.along, *(0 * values for values in here.numbers[1:])]
    return [here.along, *((b - a) / here.arc for a, b in zip(before.numbers[1:], here.numbers[1:], strict=True))]


def _bifurcates(a, b):
    """Whether negative modes change otherwise than at a limit point between two neighbouring points."""
    return abs(b.negative_modes - a.negative_modes) != (a.rise * b.rise < 0)


def _events_between(a, b, step):
    """[(kind, smallest, largest load factor)] of the events between two neighbouring points."""
    found, changes = [], abs(b.negative_modes - a.negative_modes)
    ends = sorted((a.load_factor, b.load_factor))
    if a.rise * b.rise < 0:  # Hermite's cubic of the load factor
        t = np.linspace(0, 1, 201)
        eta = (a.load_factor * (1 + 2 * t) * (1 - t) ** 2 + b.load_factor * t**2 * (3 - 2 * t)
               + step * (a.rise * t * (1 - t) ** 2 - b.rise * t**2 * (1 - t)))  # fmt: skip
        extremum = eta.max() if a.rise > 0 else eta.min()
        found.append(("limit", extremum, extremum))
        changes = abs(changes - 1)
    return found + [("bifurcation", *ends)] * changes


def truth_of(given):
    """The `Truth` of a structure that steps of two lengths agree on.

    Raises:
        NoTruth: they do not.
    """
    coarse = small_steps(given, STEP)
    fine = small_steps(given, STEP / 2)
    if not fine.reached:
        raise NoTruth("the path does not reach the load factor")
    said = differences(coarse.path, [kind for kind, *_ in coarse.events], _levels(coarse), fine, given)
    if said:
        raise NoTruth(f"two lengths of the steps differ: {said}")
    return fine


def _levels(truth):
    return [(low + high) / 2 for _, low, high in truth.events]


# -- comparison ------------------------------------------------------------------------------------------------------


def differences(path, kinds, levels, truth, given, *, whole=True):
    """How a path differs from the truth, in words; empty where it does not.

    Args:
        path: the path; kinds, levels: the kinds and load factors of its events.
        whole: whether it claims to reach the requested load factor.
    """
    said, true = [], truth.path
    u, u_true = (np.concatenate([x.displacement(at) for at in given.stations], axis=1) for x in (path, true))
    size = np.abs(u_true).max()
    points = np.column_stack([u / size, path.load_factors / given.top])
    line = np.column_stack([u_true / size, true.load_factors / given.top])
    off = np.array([_distance(point, line) for point in points])
    if off.max(initial=0.0) > _BESIDE:
        k = int(np.argmax(off > _BESIDE))
        said.append(f"point {k} of {len(off)} (load factor {path.load_factors[k]:.5g}) is {off[k]:.1e} off the path")
    if whole and np.abs(points[-1] - line[-1]).max() > _END:
        said.append(f"the end is {np.abs(points[-1] - line[-1]).max():.1e} off")
    if whole and path.negative_modes[-1] != true.negative_modes[-1]:
        said.append(f"{path.negative_modes[-1]} negative modes at the end instead of {true.negative_modes[-1]}")
    true_events = truth.events if whole else truth.events[: len(kinds)]
    if kinds != [kind for kind, *_ in true_events]:
        said.append(f"events {_listed(kinds, levels)} instead of {_listed(*zip(*((k, a) for k, a, _ in true_events)))}"
                    if true_events else f"events {_listed(kinds, levels)} instead of none")  # fmt: skip
    else:
        for level, (kind, low, high) in zip(levels, true_events, strict=True):
            room = _LIMIT * given.top
            if not low - room <= level <= high + room:
                said.append(f"{kind} at {level:.6g} instead of {low:.6g} to {high:.6g}")
    return "; ".join(said)


def _listed(kinds, levels):
    return ", ".join(f"{kind} {level:.5g}" for kind, level in zip(kinds, levels, strict=True)) or "none"


def _distance(point, line):
    """Smallest distance of a point from a polyline."""
    a, c = line[:-1], np.diff(line, axis=0)
    t = np.clip(((point - a) * c).sum(axis=1) / np.maximum((c * c).sum(axis=1), 1e-300), 0, 1)
    return float(np.linalg.norm(a + t[:, None] * c - point, axis=1).min())


def outcome(given, truth, control, **arguments):
    """(verdict, words, seconds of processor time) of `solve`; the verdict is "right", "in words" or "wrong"."""
    began, refusal = time.process_time(), None
    try:
        path = cf.solve(given.scene, (0.0, given.top), control=control, **arguments)
    except cf.NotConverged as stop:
        path, refusal = stop.path, stop
    spent = time.process_time() - began
    kinds, levels = ([getattr(event, name) for event in path.events] for name in ("kind", "load_factor"))
    off = differences(path, kinds, levels, truth, given, whole=refusal is None)
    told = [said for said in path.why if "negative modes go" in said or "not listed" in said]
    if refusal is not None:  # words that say what happened
        right = not off or "changed to another branch" in str(refusal)
        right = right and ("the path is closed" not in str(refusal))
        return ("in words" if right else "wrong"), f"{refusal} {off}".strip(), spent
    if off:
        return ("in words" if told else "wrong"), "; ".join([off, *told]), spent
    return "right", "", spent


def main(count=60, first=0):
    kinds, spent, without = Counter(), 0.0, 0
    print("seed  structure, imperfection: control, verdict, s, what happened")
    for seed in range(first, first + count):
        given = structure(seed)
        try:
            truth = truth_of(given)
        except NoTruth as error:
            without += 1
            print(f"{seed:4d}  {given.kind}, {given.imperfection:.1e}: no truth: {error}", flush=True)
            continue
        told = _listed([k for k, *_ in truth.events], _levels(truth))
        print(
            f"{seed:4d}  {given.kind}, {given.imperfection:.1e}, to {given.top:.4g}: {told}; {len(truth.path)} points"
        )
        for control in CONTROLS:
            verdict, words, seconds = outcome(given, truth, control)
            kinds[f"{control} | {verdict}"] += 1
            spent += seconds
            print(f"        {control} {verdict} {seconds:.2f} {words[:400]}", flush=True)
    for kind, number in sorted(kinds.items()):
        print(f"{number:5d}  {kind}")
    print(f"{without:5d}  no truth")
    print(f"processor time of solve: {spent:.1f} s")
    return kinds


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
