"""The strings in wells of demos/wells/: each is solved and drawn, and numbers are compared with what must come out.

python demos/wells.py                    all of them; writes to out/wells/NAME/
python demos/wells.py volve_f12          some
python demos/wells.py --quick            without pictures
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from known_numbers import Check, chosen, report, verdict

import cosserat_fenicsx as cf

SCENES = Path(__file__).parent / "wells"


def well_p(scene, answers, sweep):
    """Hook loads of five operations, and the torque while drilling."""
    loads = [1009059.16760857, 267741.24448960, 598614.87215726, 538614.87215726, 173041.37946106]
    found = [*(answer.hook_load for answer in answers), answers[3].surface_torque]
    return Check("hook loads (N), torque (N m)", found, [*loads, 26414.94591394], 1e-4, "ODE at 1e-13")


def volve_f12(scene, answers, sweep):
    """Rotating, the hook load is the weight in mud of all parts times their heights on the axis less the weight on bit;
    the rod in contact, which leans on the wall, differs by some newtons."""
    drilling = answers[2]
    heights = [np.ptp(scene.hole.path.position([place.top, place.bottom])[:, 2]) for place in drilling.laid]
    mud = scene.mud
    weights = [place.component.mass * mud.gravity * (1 - mud.density / 7850) for place in drilling.laid]
    return Check("hook load drilling (N)", drilling.hook_load, np.dot(weights, heights) - 80e3, 30.0, "balance")


def lock_up(scene, answers, sweep):
    """The place where it locks up, from the bit at 5500 m."""
    return Check("locked below (m)", 5500 - sweep.values["locked"][0, 0, -1], 5409.096127, 0.5, "closed form")


#: The scenes.
WELLS = (well_p, volve_f12, lock_up)


def run(demo, out="out/wells"):
    """Solve a scene and draw it.

    Args:
        demo: a function of `WELLS`; out: folder for its pictures, or None.

    Returns:
        (answers, Check).
    """
    scene = cf.read_well(SCENES / f"{demo.__name__}.toml")
    answers, sweep = scene.answers(), scene.depth_sweep()
    if out is not None:
        folder = Path(out) / demo.__name__
        folder.mkdir(parents=True, exist_ok=True)
        for answer in answers:
            name = answer.operation.name.replace(" ", "_")
            answer.plot(folder / f"{name}.png")
            answer.plot_3d(folder / f"{name}_3d.png")
        if sweep is not None:
            sweep.plot(folder / "depth_sweep.png")
    return answers, demo(scene, answers, sweep)


def main(names=(), out="out/wells"):
    """Run demos, and print their numbers and whether all are right.

    Args:
        names: of demos; none for all.
        out: folder for pictures, or None.

    Returns:
        list of `Check`s.
    """
    found = {demo.__name__: run(demo, out) for demo in chosen("demos/wells.py", "well", WELLS, names)}
    rows = [(name, answers[-1].model, check) for name, (answers, check) in found.items()]
    print(report("Strings in wells: what must come out", rows))
    return [check for _, check in found.values()]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="; ".join(demo.__name__ for demo in WELLS))
    parser.add_argument("--quick", action="store_true", help="without pictures")
    options = parser.parse_args()
    checks = main(options.names, None if options.quick else "out/wells")
    sys.exit(verdict(checks))
