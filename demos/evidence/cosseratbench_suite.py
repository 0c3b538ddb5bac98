"""A public suite of rods, cosseratbench: its scenarios solved by this package, judged by its metrics.

    python demos/evidence/cosseratbench_suite.py                   gets the suite with git, and runs it
    python demos/evidence/cosseratbench_suite.py --suite FOLDER    a copy of the suite that is there already

Writes out/cosseratbench.md: this package beside the results of other solvers that the suite keeps. The suite gives
scenarios (rods, ends, loads, durations) and judges where nodes are at equal time intervals. `Adapter` is its interface
of a solver; `solve` reads a scenario by its attributes alone, so that it needs no part of the suite.

Rods are straight when free of stress and stay on the line between their ends until they are moved to where they start.
Equilibria are solved as such, in one frame; motions begin with all nodes held where the scenario has them. What can
touch something is reported as unsupported by the suite, for want of `ROD_CONTACT`, `CYLINDER_CONTACT` or
`PLANE_CONTACT` of this adapter, which does not translate contacts to `RodContact`, `Cylinder` and `Plane`.
"""

import argparse
import importlib
import json
import math
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import numpy as np
from harness import in_words, record, table, write

import cosserat_fenicsx as cf

#: Where the suite is, and the state of it that this adapter is written for.
ADDRESS = "https://github.com/jakeryderv/cosseratbench"
COMMIT = "c44ae82d95d47d847fea5433ba18f108dfe3af28"
#: Positions (frames, nodes, 3), m, and directions d1 of elements (frames, elements, 3), for every rod.
Frames = namedtuple("Frames", "times positions directors")
DEGREE = 2
#: What its docs/findings.md tells of solvers and references that its kept results do not have.
FINDINGS = """
Its docs/findings.md adds: dismech has the pendulum's period to 1.4e-4 and its amplitude to 9e-6, and the catenary's sag
to 1.8e-4; crossing, the error of the lift is 5e-4 by MuJoCo, 3e-3 by PyElastica and 2.6e-2 by dismech. The reference of
the catenary has no bending stiffness, which lifts the sag by about 0.1 mm (4e-4 of it); that of the pendulum is linear,
2e-5 too fast for this swing; the twist is measured to about 0.5 %. Smaller numbers beyond these say nothing."""
# Time steps in a frame: of motions, and of states that a slow drive passes through.
_STEPS, _SLOW_STEPS = 20, 4


def solve(scenario, elements, frames):
    """Solve a scenario of the suite. scenario: with the attributes of the suite's `Scenario`. elements: of every rod.
    frames: how many. Returns Frames. Raises NotImplementedError: in words, what this adapter does not do."""
    if scenario.obstacles:
        raise NotImplementedError("obstacles")
    rods = [_rod(k, given, scenario) for k, given in enumerate(scenario.rods)]
    driven = any(rod.start_motion or rod.end_motion for rod in scenario.rods)
    alone = scenario.quasi_static and not driven
    return (_settled if alone else _moved)(scenario, rods, elements, frames)


def _rod(k, given, scenario):
    """The rod at rest: straight, from its first point towards its last, with d1 along the scenario's normal."""
    points = np.asarray(given.centerline, dtype=float)
    along = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
    for name, segment in (("start", points[1] - points[0]), ("end", points[-1] - points[-2])):
        if getattr(given, name).value == "clamped" and np.linalg.norm(np.cross(segment, along)) > 1e-3 * math.dist(
            segment, (0, 0, 0)
        ):
            raise NotImplementedError(f"a clamp at the {name} of a rod across the line between its ends")
    line = cf.Line(tuple(points[0]), tuple(points[0] + given.length * along), d1=tuple(given.normal))
    m = given.material
    material = cf.Material(m.youngs_modulus, m.youngs_modulus / (2 * m.shear_modulus) - 1, m.density)
    drag = 2 * scenario.slowest_frequency() if scenario.quasi_static else 0.0
    damping = cf.Damping(drag=drag) if drag else None
    return cf.Rod(line, cf.Circle(2 * given.radius), material, name=f"rod {k}", damping=damping)


def _held(given, rod, name, to):
    """Supports of an end that is moved from its place at rest `to` (3,) another one, m."""
    station, condition = getattr(rod, name), getattr(given, name).value
    if condition == "free":
        return []
    by = np.asarray(to) - rod.curve.position(np.array([station.s]))[0]
    if condition == "pinned" and name == "start":
        return [cf.Hinge(station, tuple(given.normal))]  # keeps the rod from spinning; it moves across the normal
    if condition == "pinned":
        return [cf.Prescribed(station, displacement=tuple(by))]
    if np.linalg.norm(by) < 1e-12:
        return [cf.Clamp(station)]
    return [cf.Prescribed(station, displacement=tuple(by), rotation=(0, 0, 0))]


def _loads(scenario, rods, permanent=False):
    """Point loads and weight."""
    loads = [
        cf.Force(getattr(rod, load.at.value), tuple(load.force), permanent=permanent)
        for given, rod in zip(scenario.rods, rods, strict=True)
        for load in given.loads
    ]
    return loads + ([cf.Weight(tuple(scenario.gravity), permanent=permanent)] if any(scenario.gravity) else [])


def _settled(scenario, rods, elements, frames):
    """Rods at rest: the loads first, then the ends to their places. All frames but the first show the equilibrium."""
    pairs = list(zip(scenario.rods, rods, strict=True))
    supports = [x for given, rod in pairs for name, point in (("start", given.centerline[0]),
                ("end", given.centerline[-1])) for x in _held(given, rod, name, point)]  # fmt: skip
    moved = any(isinstance(support, cf.Prescribed) for support in supports)
    scene = cf.Scene(rods, supports, _loads(scenario, rods, permanent=moved))
    path = cf.solve(scene, [1.0], elements=elements, degree=DEGREE)
    positions, directors = [], []
    for given, rod in pairs:
        nodes, d1 = _sampled(path, -1, rod, elements)
        first = given.nodes(elements)
        positions.append(np.array([first] + [nodes] * (frames - 1)))
        across = _across(first, np.tile(given.normal, (elements, 1)))
        directors.append(np.array([across] + [d1] * (frames - 1)))
    return Frames(np.linspace(0, scenario.duration, frames), positions, directors)


def _moved(scenario, rods, elements, frames):
    """Rods in motion from where the scenario has them, at rest; in quasi-static ones with a drag."""
    pins, supports = [], []
    for given, rod in zip(scenario.rods, rods, strict=True):
        places = given.nodes(elements)
        for name, k in (("start", 0), ("end", elements)):
            pins += _held(given, rod, name, places[k])
            motion = getattr(given, f"{name}_motion")
            supports += _driven(rod, name, motion) if motion else _held(given, rod, name, places[k])
        free = range(1, elements if given.end.value != "free" else elements + 1)
        s = rod.length * np.arange(elements + 1) / elements
        by = places - rod.curve.position(s)
        pins += [cf.Prescribed(rod.at(s[k]) if k < elements else rod.end, displacement=tuple(by[k])) for k in free]
    weight = [cf.Weight(tuple(scenario.gravity), permanent=True)] if any(scenario.gravity) else []
    mesh = {"elements": elements, "degree": DEGREE, "model": "spatial"}
    start = cf.solve(cf.Scene(rods, pins, weight), [1.0], **mesh)
    frame = scenario.duration / (frames - 1)
    dt = frame / (_SLOW_STEPS if scenario.quasi_static else _STEPS)
    scene = cf.Scene(rods, supports, _loads(scenario, rods))
    history = cf.simulate(scene, scenario.duration, dt=dt, save_every=frame, start=start, **mesh)
    found = [list(zip(*(_sampled(history, k, rod, elements) for k in range(frames)), strict=True)) for rod in rods]
    positions, directors = ([np.array(x[i]) for x in found] for i in (0, 1))
    return Frames(np.linspace(0, scenario.duration, frames), positions, directors)


def _driven(rod, name, motion):
    """Supports of a clamped end that a `Motion` of the suite moves and turns; it may slide along a direction."""
    station = getattr(rod, name)

    def through(values):
        rows = np.asarray(values, dtype=float)
        return lambda t: tuple(np.interp(t, motion.times, rows[:, i]) for i in range(3))

    if motion.slides_along is None:
        drive = {"displacement": through(motion.displacement), "rotation": through(motion.rotation)}
        return [cf.Prescribed(station, **drive)]
    if np.any(motion.displacement):
        raise NotImplementedError("an end that slides and is moved")
    across = np.linalg.svd(np.atleast_2d(motion.axis))[2][1:]
    turned = cf.Prescribed(station, rotation=through(motion.rotation))
    return [turned, *(cf.Roller(station, tuple(normal)) for normal in across)]


def _sampled(result, k, rod, elements):
    """Nodes (elements + 1, 3), m, and d1 of the elements between them across these, at row k of a result."""
    x = np.linspace(0, 1, 2 * elements + 1)
    line, directors = result.sample(k if k >= 0 else len(result) + k, rod, x)
    return line[::2], _across(line[::2], directors[1::2, :, 0])


def _across(nodes, directions):
    """Unit vectors next to `directions` (n, 3) across the segments between nodes (n + 1, 3)."""
    along = np.diff(nodes, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = directions - np.sum(directions * along, axis=1, keepdims=True) * along
    return across / np.linalg.norm(across, axis=1, keepdims=True)


# -- the suite ---------------------------------------------------------------------------------------------------------


def obtained(out):
    """The folder of the suite at `COMMIT`, which git gets where it is not there yet."""
    folder = Path(out) / f"cosseratbench-{COMMIT[:7]}"
    if not (folder / "src").exists():
        words = [["clone", "--no-checkout", ADDRESS, str(folder)], ["-C", str(folder), "checkout", "--quiet", COMMIT]]
        try:
            for given in words:
                subprocess.run(["git", *given], check=True, capture_output=True, text=True)
        except (OSError, subprocess.CalledProcessError) as error:
            said = getattr(error, "stderr", "") or error
            sys.exit(
                f"cosseratbench cannot be had from {ADDRESS}: {str(said).strip()}\nWith network access, `git clone "
                f"{ADDRESS}` and `git checkout {COMMIT[:7]}` in it; then `--suite FOLDER`."
            )
    return folder


def adapter():
    """The solver that the suite runs; its modules must be on the path."""
    capability = importlib.import_module("cosseratbench.solver").Capability
    trajectory = importlib.import_module("cosseratbench.trajectory").Trajectory

    class Adapter:
        name, backend_version = "cosserat_fenicsx", cf.__version__
        capabilities = frozenset({capability.STRETCH, capability.SHEAR})

        def run(self, scenario, *, n_elements, n_frames):
            found = solve(scenario, n_elements, n_frames)
            return trajectory(found.times, tuple(found.positions), tuple(found.directors))

    return Adapter()


def told(outcome, missing, failure, metrics):
    """A result in a cell."""
    if missing:
        return f"unsupported: needs {', '.join(missing)}"
    if failure:
        return f"diverged: {failure}"
    return ", ".join(f"{name} {value:.2g}" for name, value in metrics.items()) or outcome


def kept(folder, experiment):
    """Rows of what the suite keeps of other solvers on the default case of an experiment."""
    for file in sorted((folder / "results-0.2" / experiment / "default").glob("*/result.json")):
        found = json.loads(file.read_text(encoding="utf-8"))
        seconds = "-" if found["wall_time"] is None else f"{found['wall_time']:.2g}"
        cell = told(found["outcome"], found["missing"], found["failure"], found["metrics"])
        yield experiment, found["solver"], found["n_elements"], seconds, cell


def main(out="out", suite=None):
    """Run all experiments of the suite, and write the table. out: folder. suite: a folder with the suite, or None to
    get it. Returns The table, Markdown."""
    folder = Path(suite) if suite else obtained(out)
    sys.path.insert(0, str(folder / "src"))
    run, solver, rows = importlib.import_module("cosseratbench.experiment").run, adapter(), []
    for file in sorted((folder / "src" / "cosseratbench" / "experiments").glob("[a-z]*.py")):
        experiment = getattr(importlib.import_module(f"cosseratbench.experiments.{file.stem}"), file.stem)
        found = run(experiment, solver)
        seconds = "-" if found.wall_time is None else f"{found.wall_time:.2g}"
        cell = told(found.outcome, found.missing, found.failure, found.metrics)
        rows += [(file.stem, solver.name, found.n_elements, seconds, cell), *kept(folder, file.stem)]
    state = "a copy at hand of its scenarios, metrics and results (--suite)" if suite else f"commit {COMMIT[:7]}"
    lines = [
        f"{in_words(record())}. [cosseratbench]({ADDRESS}), {state}; rods of this package by elements of degree "
        f"{DEGREE}. The rows of other solvers are those that the suite keeps, with the times of its author's machine.",
        "",
        *table("experiment | solver | elements | s | metrics of the suite", rows),
        FINDINGS,
    ]
    return write("cosseratbench", lines, out)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", help="a folder with the suite")
    print(main(suite=parser.parse_args().suite))
