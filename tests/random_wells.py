"""Random wells, strings and operations through `torque_and_drag`: what answers, how accurately, and what it says.

As a script: python tests/random_wells.py [how many] [first seed] (make random-wells).

10 to 40 stations over 1 to 6 km, doglegs to 8 degrees per 30 m, inclination to 100 degrees, friction 0 to 0.5, pipe
from 2 3/8 to 6 5/8 in, a bit and stabilisers in every third string; three of the eight operations each. What the rod
answers is compared with the same rod solved from the start on four times the elements, in a wall of 1e11 N/m^2 (1e10 is
too soft for stabilisers, whose effect it may change by more than is estimated); what the soft string answers with the
rod.
"""

import math
import sys
import time
from collections import Counter
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

import cosserat_fenicsx as cf
from cosserat_fenicsx.units import inch
from cosserat_fenicsx.well.rod import rod_in_hole

#: Outer and inner diameter, tool joint (in), mass (kg/m), smallest and largest hole (in).
PIPES = {
    "2 3/8": (2.375, 1.815, 3.25, 10.3, 3.875, 4.75),
    "2 7/8": (2.875, 2.151, 4.0, 16.2, 4.75, 6.125),
    "3 1/2": (3.5, 2.764, 4.75, 20.6, 5.875, 6.75),
    "4": (4.0, 3.34, 5.25, 22.5, 6.125, 7.875),
    "4 1/2": (4.5, 3.826, 6.25, 27.0, 7.875, 8.5),
    "5": (5.0, 4.276, 6.5, 31.1, 8.5, 12.25),
    "5 1/2": (5.5, 4.778, 7.0, 36.0, 8.5, 12.25),
    "6 5/8": (6.625, 5.965, 8.25, 44.0, 9.875, 17.5),
}
OPERATIONS, FINER, STIFF, FINEST = 3, 4, 1e11, 8192
UNDER = (0.0, 0.0016, 0.0032, 0.0064, 0.0127)  # m, of stabilisers below the hole's diameter


class Drawn(NamedTuple):
    """A well with a string, and what is done."""

    name: str
    hole: cf.well.Borehole
    string: cf.well.DrillString
    mud: cf.well.Mud
    depth: float
    operations: list


def survey(rng):
    """Measured depths, inclinations and azimuths of a random walk of the direction."""
    count, length = int(rng.integers(10, 41)), rng.uniform(1000, 6000)
    md = np.append(0.0, np.cumsum(rng.uniform(0.3, 1.7, count - 1)))
    md *= length / md[-1]
    severity, left = math.radians(rng.choice([1.5, 3.0, 8.0])), rng.uniform(1.0, 8.0)
    t, directions = np.array([0.0, 0.0, 1.0]), [(0.0, rng.uniform(0, 360))]
    for part in np.diff(md):
        angle = 0.0 if rng.random() < 0.3 else rng.random() * min(severity * part / 30, math.radians(60), left)
        turned = None
        while turned is None or turned[2] < math.cos(math.radians(100)):
            aside = np.cross(t, rng.normal(size=3))
            turned = math.cos(angle) * t + math.sin(angle) * aside / np.linalg.norm(aside)
        t, left = turned / np.linalg.norm(turned), left - angle
        directions.append((math.degrees(math.acos(t[2])), math.degrees(math.atan2(t[1], t[0])) % 360))
    return md, *np.transpose(directions)


def draw(seed):
    """The `Drawn` of a seed."""
    rng = np.random.default_rng(seed)
    path = cf.well.WellPath.from_survey(*survey(rng), degrees=True)
    name = str(rng.choice(list(PIPES)))
    outer, inner, joint, mass, least, most = PIPES[name]
    size, diameter, friction = (outer / 5) ** 2, rng.uniform(least, most) * inch, rng.uniform(0, 0.5)
    sections = [cf.well.HoleSection(path.length, diameter, friction)]
    if rng.random() < 0.5:
        casing = cf.well.HoleSection(
            path.length * rng.uniform(0.2, 0.8), diameter * rng.uniform(1.0, 1.3), 0.7 * friction
        )
        sections.insert(0, casing)
    body = min(joint * inch, 0.85 * diameter)
    tube = {"outer_diameter": body, "inner_diameter": 0.35 * body}
    parts = [cf.well.Bit(diameter)] if seed % 3 == 0 else []
    for _ in range(int(rng.integers(0, 4)) if parts else 0):
        parts += [
            cf.well.Stabiliser(rng.uniform(1, 2), max(body, diameter - rng.choice(UNDER)), **tube),
            cf.well.Collar(rng.uniform(2, 20), **tube),
        ]
    parts += [cf.well.Collar(rng.uniform(20, 150), **tube)] if rng.random() < 0.6 else []
    pipe = cf.well.DrillPipe(
        outer_diameter=outer * inch, inner_diameter=inner * inch, tool_joint=joint * inch, mass=mass
    )
    weight, torque, speed, rpm = rng.uniform(0, 100e3) * size, rng.uniform(0, 5e3) * size, *rng.uniform(0.02, 2, 2)
    known = [
        cf.well.TripOut(float(rng.choice([0.0, -100e3 * size]))),
        cf.well.TripIn(),
        cf.well.RotateOffBottom(),
        cf.well.Static(),
        cf.well.RotaryDrilling(weight, torque),
        cf.well.Sliding(weight, torque),
        cf.well.Ream(speed, 60 * rpm),
        cf.well.BackReam(speed, 60 * rpm),
    ]
    operations = [known[i] for i in rng.choice(len(known), OPERATIONS, replace=False)]
    depth = path.length * (1.0 if rng.random() < 0.5 else rng.uniform(0.5, 1.0))
    told = f"{name} in{', assembly' if len(parts) > 1 else ''}, {depth:.0f} m, {len(path.md)} stations"
    mud = cf.well.Mud(rng.uniform(900, 2000))
    return Drawn(told, cf.well.Borehole(path, sections), cf.well.DrillString([*parts, pipe]), mud, depth, operations)


def compare(drawn, operation):
    """One answer.

    Returns:
        (what happened, seconds of processor time, Newton steps, {quantity: (estimated error, true error)}).
    """
    given = {"mud": drawn.mud, "depth": drawn.depth, "progress": False}
    began = time.process_time()
    with patch.object(rod_in_hole, "solve_in_hole", wraps=rod_in_hole.solve_in_hole) as asked:
        try:
            answer = cf.well.torque_and_drag(drawn.hole, drawn.string, operation, **given)
        except (cf.SceneError, cf.NotConverged) as refusal:
            return f"refused: {refusal}", time.process_time() - began, 0, {}
    spent = time.process_time() - began
    said = answer.model + ("" if answer.enough else ", not enough")
    try:
        if answer.model == "rod":
            (place, named), found = asked.call_args, answer.solved
            count = min(FINEST, FINER * found.path.elements[0])
            true = rod_in_hole.solve_in_hole(
                *place, **{**named, "elements": count, "wall_stiffness": STIFF, "work": None}
            )
            errors = {
                name: (error, abs(getattr(found, name) - getattr(true, name))) for name, error in found.errors.items()
            }
            return said, spent, found.steps, errors
        if answer.enough:
            true = cf.well.torque_and_drag(drawn.hole, drawn.string, operation, **given, model="rod")
            told = (answer.error + answer.model_error) * np.abs(answer.tension).max() + true.solved.errors["hook_load"]
            return said, spent, 0, {"hook_load": (told, abs(answer.hook_load - true.hook_load))}
    except cf.NotConverged as unknown:
        said += f"; nothing to compare with: {unknown}"
    return said, spent, 0, {}


def main(count=100, first=0):
    """Compare so many wells, and print a line for each answer."""
    kinds, ratios, took, above = Counter(), [], [], []
    print("seed, well: operation: what happened; s; Newton steps; true error/estimate of each quantity")
    for seed in range(first, first + count):
        drawn = draw(seed)
        for operation in drawn.operations:
            said, seconds, steps, errors = compare(drawn, operation)
            shares = {name: true / told for name, (told, true) in errors.items()}
            kinds[said.partition(":")[0]] += 1
            took += [(seconds, steps)] if steps else []
            ratios += shares.values()
            above += [f"{seed} {operation.name}: {name} {x:.2g}" for name, x in shares.items() if x > 1]
            told = ", ".join(f"{name} {x:.2g}" for name, x in shares.items())
            print(f"{seed}, {drawn.name}: {operation.name}: {said}; {seconds:.2f}; {steps}; {told}", flush=True)
    print("\n" + "\n".join(f"{number} {kind}" for kind, number in kinds.most_common()))
    print(f"true error over estimate: median {np.median(ratios):.2g}, above 1 in {len(above)} of {len(ratios)}")
    print("\n".join(above))
    if took:
        seconds, steps = np.median(took, axis=0)
        print(f"of the rod: median {seconds:.2f} s, {steps:.0f} Newton steps, at most {max(took)[0]:.2f} s")
    return kinds, above


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
