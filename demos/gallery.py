"""The scene files of this folder: each is solved and drawn, and a number is compared with what must come out.

python demos/gallery.py                    all of them; writes to out/: NAME.png
python demos/gallery.py cable soft_arm     some
python demos/gallery.py --quick            without pictures
"""

import math
from pathlib import Path

import numpy as np
from known_numbers import Check, command, run_all
from scipy.optimize import brentq

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic

SCENES = Path(__file__).parent
SHOOTING = "strong form, by shooting"
COLLOCATION = "strong form, by collocation"


def eccentric_cantilever(path):
    """Sideways displacement of the tip at eta = 0.9."""
    rod = path.scene.rod("column")
    k = rod.stiffness
    truth = analytic.reissner(0.9, 0.2, rod.length, bending=k.bending[1], axial=k.axial, shear=k.shear[0]).delta
    found = path.displacement(rod.end)[list(path.load_factors).index(0.9), 0]
    return Check("delta at eta = 0.9 (m)", found, truth, 2e-6, "strong form, by quadrature")


def bend_45(path):
    """Where the tip is, out of the plane of the bend."""
    tip = path.position("bend.end")[-1]
    return Check("tip (m)", tip, [47.15043857, 15.68480053, 53.47485879], 6e-6, SHOOTING)


def lees_frame(path):
    """The first limit point."""
    limits = [event.load_factor for event in path.events if event.kind == "limit"]
    return Check("first limit point (load factor)", limits[0], 1.854656, 2e-6, SHOOTING)


def tripod(path):
    """The three feet carry the load and the weight of the legs."""
    scene = path.scene
    one, two, three = (rod.length for rod in scene.rods)
    thin, thick = (math.pi / 4 * (D**2 - d**2) for D, d in ((0.04, 0.034), (0.05, 0.044)))
    mass = 2700.0 * (thin * (one + two + three - 0.9) + thick * 0.9)
    carried = sum(path.reaction(support)[0][-1] for support in scene.supports)
    return Check("the feet carry (N)", carried, [-400.0, -250.0, 3000.0 + 9.81 * mass], 1e-6, "balance of forces")


def helical_spring(path):
    """The force that pulls the spring out by 0.1 m."""
    pull = path.force("spring.end")[-1, 2]
    return Check("pull at 0.1 m (N)", pull, 122.677139, 1e-4, COLLOCATION)


def riser(path):
    """Where the pipe is in the water, half way along."""
    middle = path.position("riser@110.0")[-1]
    return Check("place of s = 110 m (m)", middle, [60.501911, 2.407577, -79.490041], 1.5e-4, COLLOCATION)


def cable(path):
    """The sag: an elastic catenary (Irvine, Cable Structures, 1981) of 103 m over 100 m."""
    rod = path.scene.rod("cable")
    length, span, EA, weight = rod.length, 100.0, rod.stiffness.axial, 9.81 * rod.stiffness.mass
    half = weight * length / 2

    def width(H):
        return 2 * H * (length / 2 / EA + math.asinh(half / H) / weight) - span

    H = brentq(width, 1.0, 1e5)
    sag = half * length / 4 / EA + (math.hypot(H, half) - H) / weight
    found = -path.displacement(rod.at(length / 2))[-1, 2]
    # bending makes the ends stiff over sqrt(EI/H), which lifts the middle by about w/H times the square of that
    return Check("sag (m)", found, sag, 2 * weight * rod.stiffness.bending[0] / H**2, "elastic catenary")


def soft_arm(path):
    """Where the tip is."""
    return Check("tip (m)", path.position("arm.end")[-1], [-0.167314786, 0, -0.215940389], 3e-7, COLLOCATION)


def folding_ring(path):
    """The diameter between the turned points shrinks to a third, 40 m to 40/3 m."""
    shift = path.displacement("left.end")[-1]
    return Check("shift of the turned end (m)", shift, [80 / 3, 0, 0], 1e-6, "three coils of a third of the radius")


#: The scenes, in the order of the gallery, with the load factors that are solved for (None: the file's) and drawn.
GALLERY = {
    eccentric_cantilever: (None, (0.5, 0.9, 1.0, 1.1, 1.5)),
    lees_frame: ((0.0, 2.0), (0.0, 1.2, 1.854, 2.0)),
    bend_45: (None, (0.25, 0.5, 1.0)),
    helical_spring: (None, (0.0, 0.5, 1.0)),
    riser: (None, (0.0, 0.5, 1.0)),
    cable: (None, (0.1, 0.5, 1.0)),
    soft_arm: (None, (0.25, 0.5, 0.75, 1.0)),
    tripod: (None, (1.0,)),
    folding_ring: (None, (0.0, 0.34, 0.58, 1.0)),
}


def run(demo, out="out"):
    """Solve a scene and draw it.

    Args:
        demo: a function of `GALLERY`; out: folder for its picture, or None.

    Returns:
        (Path, Check).
    """
    name = demo.__name__
    found = cf.read(SCENES / f"{name}.toml")
    scene, settings = found.scene, found.settings
    asked, drawn = GALLERY[demo]
    if asked is not None:
        settings["load_factors"] = asked
    path = cf.solve(scene, **settings)
    if out is not None:
        path.plot(Path(out) / f"{name}.png", [int(np.abs(path.load_factors - x).argmin()) for x in drawn])
    return path, demo(path)


def main(names=(), out="out"):
    """Run demos, and print their numbers and whether all are right; `names`: of demos, none for all; `out`: folder for
    pictures, or None. Returns a list of `Check`s."""

    def solved(demo):
        path, check = run(demo, out)
        return path.model, [check]

    return run_all("demos/gallery.py", "scene", "The gallery: what must come out", GALLERY, names, solved)


if __name__ == "__main__":
    command(__doc__, GALLERY, main, "out")
