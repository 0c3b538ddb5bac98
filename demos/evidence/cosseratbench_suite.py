"""A public suite of rods, cosseratbench: its scenarios solved by this package, judged by its metrics.

    python demos/evidence/cosseratbench_suite.py                   gets the suite with git, and runs it
    python demos/evidence/cosseratbench_suite.py --suite FOLDER    a copy of the suite that is there already

Writes out/cosseratbench.md: this package beside the results of other solvers that the suite keeps. The suite gives
scenarios (rods, ends, loads, durations) and judges where nodes are at equal time intervals. `Adapter` is its interface
of a solver; `solve` reads a scenario by its attributes alone, so that it needs no part of the suite.

Rods are straight when free of stress and stay on a line until they are moved to where they start. Equilibria are solved
as such, in one frame; motions begin with all nodes held where the scenario has them. Rods that can touch an obstacle or
each other are in motion, with a scheme that dissipates what its steps do not resolve. Surfaces are elastic; both
surfaces of a contact have the larger of their coefficients of friction. A `Cylinder` has no ends here: a rod that comes
to those of the suite's is reported as unsupported.
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
from scipy.spatial.transform import Rotation

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
to 1.8e-4; crossing, the error of the lift is 5e-4 by MuJoCo, 3e-3 by PyElastica and 2.6e-2 by dismech; pile, after 173
s and 18 s, rope of MuJoCo and PyElastica lies in coils of 10 and 16 cm, 1.5 diameters high, and dismech diverges.

The lift of crossing is measured at node 26 of 51 elements, half an element beside the crossing: the reference curve
itself has a lift_error of 5.4e-3 there, and leaves out shear, which the suite says is worth 1e-4 m. The slide of
capstan contains what the rope stretches as friction sets in; it does not creep afterwards. At 0.95 of the overhang that
holds it is 1.6 mm, at 1.1 the rope of this package slides off, as MuJoCo's. In pile the rope lands on its end, whose
node enters the floor by 2.1 radii at 0.09 s (PyElastica's by 2.0), since the floor's stiffness is per length; from 0.4
s on none is deeper than 0.03 radii.

The reference of the catenary has no bending stiffness, which lifts the sag by about 0.1 mm (4e-4 of it); that of the
pendulum is linear, 2e-5 too fast for this swing; the twist is measured to about 0.5 %. Smaller numbers beyond these say
nothing."""
# Time steps in a frame: of motions, and of states that a slow drive passes through.
_STEPS, _SLOW_STEPS = 20, 4
# Stiffness of rods' surfaces and of obstacles over that of two rods of the material that cross (Hertz); obstacles let
# rods in by about 1 % of a radius, and no node jumps on them; damping of impacts of rods, s/m.
_RODS, _WALLS, _IMPACT = 30.0, 0.1, 1.0
# Turn of a rod, rad, in a stage in which it is brought to where it starts.
_BEND = 0.4
# Elements in one of the suite's, of rods that touch: these bend around each other in a few radii.
_FINER = 2


def solve(scenario, elements, frames):
    """Solve a scenario of the suite. scenario: with the attributes of the suite's `Scenario`. elements: of every rod.
    frames: how many. Returns Frames. Raises NotImplementedError: in words, what this adapter does not do."""
    rods = [_rod(k, given, scenario) for k, given in enumerate(scenario.rods)]
    contacts = _contacts(scenario, rods)
    driven = any(rod.start_motion or rod.end_motion for rod in scenario.rods)
    if scenario.quasi_static and not driven and not contacts:
        return _settled(scenario, rods, elements, frames)
    found = _moved(scenario, rods, contacts, elements, frames)
    for cylinder in (given for given in scenario.obstacles if given.kind == "cylinder"):
        for given, nodes in zip(scenario.rods, found.positions, strict=True):
            away = nodes - np.asarray(cylinder.center)
            along = away @ cylinder.unit_axis
            across = np.linalg.norm(away - along[..., None] * cylinder.unit_axis, axis=2)
            if np.any((across < cylinder.radius + 2 * given.radius) & (np.abs(along) > cylinder.length / 2)):
                raise NotImplementedError("the ends of a cylinder")
    return found


def _rod(k, given, scenario):
    """The rod at rest: straight, with d1 along the scenario's normal, from its first point along a start that is
    clamped, else towards its last point."""
    points = np.asarray(given.centerline, dtype=float)
    along = points[1] - points[0] if given.start.value == "clamped" else points[-1] - points[0]
    along = along / np.linalg.norm(along)
    segment = points[-1] - points[-2]
    if given.end.value == "clamped" and np.linalg.norm(np.cross(segment, along)) > 1e-3 * np.linalg.norm(segment):
        raise NotImplementedError("a clamp at the end of a rod across its line at rest")
    line = cf.Line(tuple(points[0]), tuple(points[0] + given.length * along), d1=tuple(given.normal))
    m = given.material
    material = cf.Material(m.youngs_modulus, m.youngs_modulus / (2 * m.shear_modulus) - 1, m.density)
    drag = 2 * scenario.slowest_frequency() if scenario.quasi_static else 0.0
    damping = cf.Damping(drag=drag) if drag else None
    return cf.Rod(line, cf.Circle(2 * given.radius), material, name=f"rod {k}", damping=damping)


def _contacts(scenario, rods):
    """Obstacles, one for each rod, and the contact of rods with each other and with themselves."""
    loads, pairs = [], list(zip(scenario.rods, rods, strict=True))

    def hertz(given):
        m = given.material
        return m.youngs_modulus / (4 * (1 - (m.youngs_modulus / (2 * m.shear_modulus) - 1) ** 2))

    for obstacle in scenario.obstacles:
        for given, rod in pairs:
            surface = {"friction": max(obstacle.friction, given.friction), "rod": rod}
            surface |= {"stiffness": _WALLS * hertz(given), "stick": _WALLS * hertz(given)}
            if obstacle.kind == "plane":
                loads.append(cf.Plane(tuple(obstacle.point), tuple(obstacle.normal), **surface))
            elif obstacle.kind == "cylinder":
                loads.append(cf.Cylinder(tuple(obstacle.center), tuple(obstacle.axis), obstacle.radius, **surface))
            else:
                raise NotImplementedError(f"an obstacle that is a {obstacle.kind}")
    if len(rods) > 1 or scenario.self_contact:
        rough = {given.friction for given in scenario.rods}
        if len(rough) > 1:
            raise NotImplementedError("rods of different friction that touch each other")
        hard = _RODS * max(hertz(given) for given in scenario.rods)
        loads.append(cf.RodContact(stiffness=hard, damping=_IMPACT, friction=rough.pop(), itself=scenario.self_contact))
    return loads


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


def _moved(scenario, rods, contacts, elements, frames):
    """Rods in motion from where the scenario has them, at rest; in quasi-static ones with a drag."""
    own = elements * (_FINER if any(load.rods_touch for load in contacts) else 1)
    mesh = {"elements": own, "degree": DEGREE, "model": "spatial"}
    supports = []
    for given, rod in zip(scenario.rods, rods, strict=True):
        for name, place in (("start", given.centerline[0]), ("end", given.centerline[-1])):
            motion = getattr(given, f"{name}_motion")
            supports += _driven(rod, name, motion) if motion else _held(given, rod, name, place)
    # where rods may touch obstacles all nodes are held, so that none between others lies in one
    held = {"elements": DEGREE * own, "degree": 1, "model": "spatial"} if contacts else mesh
    start = cf.solve(_pinned(scenario, rods, contacts, held["elements"]), [1.0], **held)
    frame = scenario.duration / (frames - 1)
    dt = frame / (_SLOW_STEPS if scenario.quasi_static else _STEPS)
    scene = cf.Scene(rods, supports, [*_loads(scenario, rods), *contacts])
    scheme = {"scheme": "generalised-alpha", "rho_inf": 0.0} if scenario.quasi_static and contacts else {}
    history = cf.simulate(scene, scenario.duration, dt=dt, save_every=frame, start=start, **mesh, **scheme)
    found = [list(zip(*(_sampled(history, k, rod, elements) for k in range(frames)), strict=True)) for rod in rods]
    positions, directors = ([np.array(x[i]) for x in found] for i in (0, 1))
    return Frames(np.linspace(0, scenario.duration, frames), positions, directors)


def _pinned(scenario, rods, contacts, count):
    """A scene that holds `count` + 1 equidistant points of every rod where the scenario has them, bent in stages."""
    share, pairs, weight = np.arange(count + 1) / count, list(zip(scenario.rods, rods, strict=True)), scenario.gravity
    now = [rod.curve.position(rod.length * share) for rod in rods]
    places = [_outside(contacts, rod, rod.length * share, given.nodes(count)) for given, rod in pairs]
    turns = [_turns(*both) for both in zip(places, now, strict=True)]
    stages = max(1, *(math.ceil(np.linalg.norm(found[1], axis=1).sum() / _BEND) for found in turns))
    supports = [[cf.Clamp(rod.start) if given.start.value == "clamped" else cf.Hinge(rod.start, tuple(given.normal))
                 for given, rod in pairs]] + [[] for _ in range(stages - 1)]  # fmt: skip
    for k, (given, rod) in enumerate(pairs):
        ends_held = given.end.value == "clamped"
        if ends_held and stages > 1:
            raise NotImplementedError("a rod with a clamped end that starts bent")
        supports[0] += _held(given, rod, "end", places[k][-1]) if ends_held else []
        stations = [*(rod.at(rod.length * x) for x in share[1:-1]), *([] if ends_held else [rod.end])]
        for stage, pins in enumerate(supports, 1):
            before, now[k] = now[k], places[k] if stage == stages else _bent(*turns[k], stage / stages)
            pins += [cf.Prescribed(x, displacement=tuple(by))
                     for x, by in zip(stations, now[k][1:] - before[1:], strict=False)]  # fmt: skip
    loads = [cf.Weight(tuple(weight), permanent=True)] if any(weight) else []
    return cf.Scene(rods, supports[0], loads, stages=[cf.Stage(supports=pins) for pins in supports[1:]])


def _outside(contacts, rod, s, points):
    """Points (n, 3) of a rod at arc lengths s, moved out of obstacles: a polyline cuts round ones a little."""
    for load in contacts:
        if load.gaps is not None and load.acts_on(rod):
            gap, normal = load.gaps(rod, s, points)
            points = points + np.maximum(-gap, 0.0)[:, None] * normal
    return points


def _turns(nodes, line):
    """((first node (3,), direction (3,) of a line of nodes, lengths (n,) of segments between nodes (n + 1, 3)),
    rotation vectors (n, 3) from that direction to the first segment, and from each segment to the next one, in axes
    that the segments carry without twist)."""
    along = np.diff(nodes, axis=0)
    lengths = np.linalg.norm(along, axis=1)
    along = np.vstack([line[1] - line[0], along])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    axes = np.cross(along[:-1], along[1:])
    sines = np.linalg.norm(axes, axis=1)
    angles = np.arctan2(sines, np.sum(along[:-1] * along[1:], axis=1))
    frame, turns = Rotation.identity(), []
    for turn in axes * (angles / np.maximum(sines, np.finfo(float).tiny))[:, None]:
        turns.append(frame.inv().apply(turn))
        frame = Rotation.from_rotvec(turn) * frame
    return (nodes[0], along[0], lengths), np.array(turns)


def _bent(first, turns, share):
    """The nodes (n + 1, 3) of what `_turns` has taken apart, bent by a share of its turns."""
    place, along, lengths = first
    frame, tangents = Rotation.identity(), []
    for turn in turns:
        frame = frame * Rotation.from_rotvec(share * turn)
        tangents.append(frame.apply(along))
    return place + np.vstack([np.zeros(3), np.cumsum(lengths[:, None] * tangents, axis=0)])


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
    diverged = importlib.import_module("cosseratbench.solver").Diverged
    trajectory = importlib.import_module("cosseratbench.trajectory").Trajectory

    class Adapter:
        name, backend_version = "cosserat_fenicsx", cf.__version__
        capabilities = frozenset(capability)

        def run(self, scenario, *, n_elements, n_frames):
            try:
                found = solve(scenario, n_elements, n_frames)
            except cf.NotConverged as error:
                raise diverged(str(error)) from error
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
