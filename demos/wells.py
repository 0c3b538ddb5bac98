"""The strings in wells of demos/wells/, and a cable in a conduit: each is solved and drawn, and numbers are compared
with what must come out.

python demos/wells.py                    all of them; writes to out/wells/NAME/
python demos/wells.py volve_f12          some
python demos/wells.py --quick            without pictures
"""

import math
from functools import partial
from pathlib import Path

import numpy as np
from conduit import FRICTION, pulled_cable
from known_numbers import Check, command, run_all
from mpi4py import MPI
from scipy.integrate import trapezoid
from stiff_and_soft import stiff_and_soft

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures.charts import draw_both

SCENES = Path(__file__).parent / "wells"


def well_p(scene, answers, sweep, folder):
    """Hook loads of five operations, and the torque while drilling."""
    loads = [1009059.16760857, 267741.24448960, 598614.87215726, 538614.87215726, 173041.37946106]
    found = [*(answer.hook_load for answer in answers), answers[3].surface_torque]
    yield Check("hook loads (N), torque (N m)", found, [*loads, 26414.94591394], 1e-4, "ODE at 1e-13")


def well_p_rod(scene, answers, sweep, folder):
    """Hook loads out, in and rotating."""
    known = [907306.0, 379920.4, 598622.0]
    yield Check(
        "hook loads (N)", [answer.hook_load for answer in answers], known, 20.0, "another program, 2 m elements"
    )


def volve_f12(scene, answers, sweep, folder):
    """Rotating, the hook load is the weight in mud of all parts times their heights on the axis less the weight on bit;
    the rod in contact, which leans on the wall, differs by some newtons."""
    drilling = answers[2]
    heights = [np.ptp(scene.hole.path.position([place.top, place.bottom])[:, 2]) for place in drilling.laid]
    mud = scene.mud
    weights = [place.component.mass * mud.gravity * (1 - mud.density / 7850) for place in drilling.laid]
    yield Check("hook load drilling (N)", drilling.hook_load, np.dot(weights, heights) - 80e3, 30.0, "balance")
    if folder is not None:
        stiff_and_soft(scene, drilling, folder / "stiff_and_soft.png")


def lock_up(scene, answers, sweep, folder):
    """The place where it locks up, from the bit at 5500 m."""
    yield Check("locked below (m)", 5500 - sweep.values["locked"][0, 0, -1], 5409.096127, 0.5, "closed form")


def assembly(scene, answers, sweep, folder):
    """Forces of the wall on bit and stabilisers, how far the bit is tilted, and where the collars come to lie on the
    low side."""
    (answer,) = answers
    points = [(md, force if side == "low" else -force) for md, end, force, side in answer.contacts if md == end]
    tangency, *blades = points[-4:]
    source = "strong form, by collocation"
    known = [-536.5363, 3384.2588, 7839.7727]
    yield Check("up on bit, blades (N)", [force for _, force in blades[::-1]], known, 0.05, source)
    rod = answer.solved.scene.rods[0]
    _, directors = answer.solved.path.sample(0, rod, np.array([1.0]))
    tilt = math.degrees(math.acos(min(1.0, directors[0, :, 2] @ scene.hole.path.tangent(answer.depth))))
    yield Check("tilt of the bit (degrees)", tilt, 0.0746971, 2e-6, source)
    yield Check("collars lie from (m above bit)", answer.depth - tangency[0], 23.07817, 2e-3, source)
    if folder is not None:
        draw_both(partial(answer.plot_from_side, length=40.0), folder / "assembly.png", MPI.COMM_WORLD)


def bent_motor(scene, answers, sweep, folder):
    """The side force of the bit by the beam of the rates of build, without friction, and by the exact rod."""
    (answer,), rates = answers, scene.builds(scene.operations[0])
    found, known = rates.bit_side_force, float(answer.bit_side_force[0])
    yield Check("side force by the beam (N)", found, known, 100.0, "exact rod, with friction")
    if folder is not None:
        draw_both(partial(answer.plot_from_side, length=25.0), folder / "bent_motor.png", MPI.COMM_WORLD)
        draw_both(rates.plot, folder / "build_rate.png", MPI.COMM_WORLD)


def helix(scene, answers, sweep, folder):
    """Turns, wall force and shortening between 200 and 460 m, where the compression is F."""
    (answer,) = answers
    solved, (EI, _) = answer.solved, scene.string.components[1].stiffness.bending
    inside = (solved.s > 200) & (solved.s < 460)
    s, F, r = solved.s[inside], -solved.tension[inside], answer.clearance[inside]
    source = "Lubinski et al. (1962)"
    turns = np.ptp(np.unwrap(solved.side[inside])) / (2 * np.pi)
    yield Check("turns", turns, trapezoid(np.sqrt(F / (2 * EI)), s) / (2 * np.pi), 2e-3, f"{source}: sqrt(F/(2 EI))")
    wall = trapezoid(solved.side_force[inside], s)
    yield Check("wall force (N)", wall, trapezoid(r * F**2 / (4 * EI), s), 10.0, f"{source}: r F^2/(4 EI)")
    shorter = 1e3 * (np.ptp(s) - np.ptp(solved.position[inside, 2]))
    yield Check("shortening (mm)", shorter, 1e3 * trapezoid(r**2 * F / (4 * EI), s), 3e-3, f"{source}: r^2 F/(4 EI)")
    yield Check("negative modes", solved.negative_modes, 0, 0, "a helix is stable")


def strength(scene, answers, sweep, folder):
    """What premium S-135 pipe bears, by the tables of API; its utilisation at the surface; where a helix begins."""
    drilling, _ = answers
    use = scene.strength.of(drilling)["strength"]
    pipe, api = use.strengths[-1], "API RP 7G, tables of premium drill pipe"
    yield Check("tension at yield (klbf)", pipe.tension / cf.units.kip, 560.764, 1e-3, api)
    yield Check("torque at yield (ft-lbf)", pipe.torque / cf.units.ft_lbf, 58113.0, 1.0, api)
    yield Check("collapse (psi)", float(pipe.collapse()) / cf.units.psi, 10029.0, 1.0, "API Bulletin 5C3")
    stress = math.hypot(drilling.hook_load / pipe.area, math.sqrt(3) * drilling.surface_torque / pipe.torque * 0.577
                        * pipe.yield_strength)  # fmt: skip
    yield Check("utilisation at the surface", use.von_mises[0], stress / pipe.yield_strength, 1e-12, "von Mises")
    if folder is not None:
        draw_both(partial(use.plot, units="field"), folder / "strength.png", MPI.COMM_WORLD)


def cable_in_conduit(folder):
    """A cable of 12 mm is pulled round a bend of 90 degrees in a conduit of 32 mm: from end to end its tension grows by
    exp(mu times the angle that it turns by); its little bending stiffness changes that by about EI/(T R^2)."""
    path, near, far = pulled_cable()
    sizes = np.linalg.norm([near, far], axis=1)
    angle = math.acos(-near @ far / sizes.prod())
    if folder is not None:
        path.plot(folder / "cable.png", [1], color="tension")
    check = Check("tension grows", sizes[1] / sizes[0], math.exp(FRICTION * angle), 1.5e-3, "capstan: exp(mu angle)")
    return path.model, [check]


#: The scenes of the folder, and those in other tubes.
WELLS = well_p, well_p_rod, volve_f12, lock_up, assembly, bent_motor, helix, strength
TUBES = (cable_in_conduit,)


def run(demo, out="out/wells"):
    """Solve a scene and draw it.

    Args:
        demo: a function of `WELLS` or `TUBES`; out: folder for its pictures, or None.

    Returns:
        (the model's name, [Check]).
    """
    folder = None if out is None else Path(out) / demo.__name__
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    if demo in TUBES:
        return demo(folder)
    scene = cf.read(SCENES / f"{demo.__name__}.toml")
    answers, sweep = scene.run(), scene.swept()
    if folder is not None:
        for answer in answers:
            name = answer.operation.name.replace(" ", "_")
            draw_both(answer.plot, folder / f"{name}.png", MPI.COMM_WORLD)
            answer.plot_3d(folder / f"{name}_3d.png")
        if sweep is not None:
            draw_both(sweep.plot, folder / "depth_sweep.png", MPI.COMM_WORLD)
    return answers[-1].model, list(demo(scene, answers, sweep, folder))


def main(names=(), out="out/wells"):
    """Run demos, and print their numbers and whether all are right; `names`: of demos, none for all; `out`: folder for
    pictures, or None. Returns a list of `Check`s."""
    return run_all(
        "demos/wells.py", "well", "Strings in wells: what must come out", (*WELLS, *TUBES), names, partial(run, out=out)
    )


if __name__ == "__main__":
    command(__doc__, (*WELLS, *TUBES), main, "out/wells")
