"""The paper's verification problem: a steel column, clamped below, under a dead force eta P_cr and the moment of its
eccentricity e = L/100. Delta at eta = 0.9 is 2.20062 m; the secant formula, eq. (8), gives 3.8 % more.

    mpirun -n 2 python demos/eccentric_cantilever.py
    python demos/eccentric_cantilever.py --formulation multiplier --degree 2 --elements 8

Solves it in four ways, from the paper's eq. (1) on (r, q) with a multiplier to the model that the package chooses by
itself, or with --formulation in one of them. Writes to out/: cantilever.xdmf and .h5 (every point, for ParaView),
figure.png (delta against eta), rod.png.
"""

import argparse
import sys
import textwrap
import time
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from rich.table import Table

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic
from cosserat_fenicsx.pictures.charts import draw_both, draw_chart, empty_figure, legend
from cosserat_fenicsx.results.path import stability
from cosserat_fenicsx.results.screen import as_text

L, DIAMETER, ECCENTRICITY = 20.0, 0.2, 0.2  # m
TABULATED = (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0, 1.1, 1.3, 1.5, 2.0)
COMPARED = (0.5, 0.9, 1.0, 1.5, 2.0)


class Way(NamedTuple):
    """One way to solve the problem: a heading, arguments of `solve`, and why it exists."""

    heading: str
    arguments: dict
    reason: str


def ways(degree=2, elements=8, tol=1e-6):
    """The four ways, by the name of the option --formulation."""
    mesh = {"model": "spatial", "degree": degree, "elements": elements}
    return {
        "multiplier": Way(
            f"P{degree} (r, q), multiplier",
            {"formulation": "multiplier", **mesh},
            "The unknowns are r, q and a multiplier at every node that holds |q| = 1; what eq. (1) says of n and m is "
            "then the first variation of the strain energy under this constraint.",
        ),
        "displacement": Way(
            f"P{degree} (r, q), eq. (1)",
            {"formulation": "displacement", **mesh},
            "Eq. (1) to the letter: n and m by the law from r and q, tested with virtual displacements and small "
            "rotations, and |q| = 1 as the equation of phi_qa. Newton's method needs many iterations, since the rod "
            "is far stiffer in stretch than in bending.",
        ),
        "mixed": Way(
            f"P{degree} (r, q), mixed",
            {"formulation": "mixed", **mesh},
            "The same discrete solution, with the contact force n carried at the Gauss points from one iteration to "
            "the next: half the iterations a step, and longer steps. It is the package's default.",
        ),
        "auto": Way(
            "auto, with an error bar",
            {"tol": tol},
            "The package's own choice of model and mesh, the mesh refined until the estimated error is below "
            f"{tol:g}. Its seconds are those of all meshes; its iterations and steps correct, on the last mesh, what "
            "a coarser one has found.",
        ),
    }


def column(diameter=DIAMETER, rigid=False):
    """The paper's rod and scene; `rigid` makes it inextensible and unshearable."""
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    section = cf.Circle(diameter)
    if rigid:
        k = section.stiffness(steel)
        section = cf.Stiffness(shear=(np.inf, np.inf), axial=np.inf, bending=k.bending, torsion=k.torsion)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, L)), section, steel, name="column")
    P = cf.euler_load(rod)
    scene = cf.Scene(
        rods=[rod],
        supports=[cf.Clamp(rod.start)],
        loads=[cf.Force(rod.end, (0, 0, -P)), cf.Moment(rod.end, (0, P * ECCENTRICITY, 0))],
        title="Eccentrically compressed cantilever",
    )
    return rod, scene


def exact(rod, eta):
    """The exact extensible, shearable rod, solved by quadrature."""
    k = rod.stiffness
    return analytic.reissner(eta, ECCENTRICITY, L, bending=k.bending[1], axial=k.axial, shear=k.shear[0])


def relative_errors(rod, path):
    """delta (m), the exact rod's, and the relative error, at every point."""
    delta, truth = path.displacement(rod.end)[:, 0], exact(rod, path.load_factors).delta
    return delta, truth, np.abs(delta / truth - 1)


def timed(scene, load_factors, arguments):
    """(path, seconds) of a call of `solve`; one before it compiles the code that is needed."""
    cf.solve(scene, list(load_factors), **arguments)
    began = time.perf_counter()
    return cf.solve(scene, list(load_factors), **arguments), time.perf_counter() - began


def comparison(rod, scene, chosen):
    """Text: the chosen ways side by side, and one sentence on each."""
    table = Table(title=f"{scene.title}: the same equilibria, each column a way to find them")
    table.add_column("")
    columns = []
    for way in chosen:
        path, seconds = timed(scene, COMPARED, way.arguments)
        delta, _, error = relative_errors(rod, path)
        table.add_column(way.heading, justify="right")
        columns.append(
            [
                path.model,
                f"P{path.degree}, {path.elements[0]}",
                str(path.unknowns),
                str(path.iterations.sum()),
                str(path.steps[-1]),
                f"{seconds:.3f}",
                *(f"{d:.7f}  {e:.0e}" for d, e in zip(delta, error, strict=True)),
            ]
        )
    heads = ["model", "degree, elements", "unknowns", "Newton iterations", "steps of the continuation", "seconds, warm"]
    heads += [f"delta (m), error at eta = {eta:g}" for eta in COMPARED]
    for head, *cells in zip(heads, *columns, strict=True):
        table.add_row(head, *cells)
    sentences = [f"{way.heading}: {way.reason}" for way in chosen]
    if "tol" in chosen[-1].arguments:
        sentences.append(f"It took this model: {'; '.join(path.why)}.")
    return "\n".join([as_text(table), *(textwrap.fill(each, 118, subsequent_indent="  ") for each in sentences), ""])


def report(rod, path):
    """Print the table: this package, the exact rod and eq. (8)."""
    table = Table(title=f"{path.scene.title}: {path.model} model, {path.unknowns} unknowns")
    for heading in ("eta", "delta (m)", "exact delta (m)", "eq. (8) (m)", "relative error", "iterations", "stable"):
        table.add_column(heading, justify="right")
    delta, truth, error = relative_errors(rod, path)
    secant = analytic.secant_delta(path.load_factors, ECCENTRICITY)
    for k, eta in enumerate(path.load_factors):
        table.add_row(
            f"{eta:g}",
            f"{delta[k]:.9f}",
            f"{truth[k]:.9f}",
            f"{secant[k]:.5f}" if np.isfinite(secant[k]) else "beyond its pole",
            f"{error[k]:.1e}",
            str(path.iterations[k]),
            stability(path.negative_modes[k]),
        )
    return as_text(table), error.max()


def draw(rod, path, file):
    """delta against eta: this package, the exact rod, the elastica, eq. (8) up to its pole."""
    eta = np.concatenate([np.linspace(0.005, 0.9, 60), np.linspace(0.905, path.load_factors[-1], 120)])
    below = np.linspace(0, 0.999, 400)
    curves = [
        (below, analytic.secant_delta(below, ECCENTRICITY), "secant formula, eq. (8), pole at 1",
         {"color": "tab:red", "ls": "--"}),
        (eta, analytic.elastica(eta, ECCENTRICITY, L).delta, "elastica (inextensible)",
         {"color": "tab:orange", "lw": 5, "alpha": 0.4}),
        (eta, exact(rod, eta).delta, "exact rod (extensible, shearable)", {"color": "black", "lw": 1}),
        (path.load_factors, path.displacement(rod.end)[:, 0], "cosserat_fenicsx",
         {"color": "tab:blue", "marker": "o", "ls": ""}),
    ]  # fmt: skip

    def chart():
        figure = empty_figure(8, 5.5)
        axes = figure.subplots()
        for x, y, label, style in curves:
            axes.plot(x, y, label=label, **style)
        axes.set(xlabel=r"load factor $\eta = F / P_{cr}$", ylabel=r"transverse tip displacement $\delta$ (m)")
        axes.set_ylim(0, 18)
        legend(axes)
        figure.suptitle("Eccentrically compressed cantilever, e = L/100")
        return figure

    draw_both(partial(draw_chart, chart), file)


def main(out="out", load_factors=TABULATED, formulation=None, **mesh):
    """Compare, solve, print, write and draw.

    Args:
        out: directory of the files.
        load_factors: of the table and the files.
        formulation: a name of `ways`; None for all four side by side, the table and files by the last, "auto".
        mesh: degree, elements and tol as in `ways`.

    Returns:
        (Path, largest relative error of delta).
    """
    out, every = Path(out), ways(**mesh)
    rod, scene = column()
    compared = comparison(rod, scene, list(every.values()) if formulation is None else [every[formulation]])
    path = cf.solve(scene, list(load_factors), **every[formulation or "auto"].arguments)
    table, error = report(rod, path)
    path.write(out / "cantilever.xdmf")
    path.plot(out / "rod.png")
    if MPI.COMM_WORLD.rank == 0:
        draw(rod, path, out / "figure.png")
        print(compared)
        print(table)
        print(f"written to {out}/: cantilever.xdmf, cantilever.h5, figure.png, rod.png")
    return path, error


def options(arguments=None):
    """The options of the command line, as arguments of `main`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--formulation", choices=list(ways()), help="solve in this way alone [all four, side by side]")
    parser.add_argument("--degree", type=int, default=2, help="of r and q, 1 to 4; not for auto [2]")
    parser.add_argument("--elements", type=int, default=8, help="along the column; not for auto [8]")
    parser.add_argument("--tol", type=float, default=1e-6, help="of auto: largest estimated relative error [1e-6]")
    parser.add_argument("-o", "--out", default="out", metavar="DIR", help="directory of the files [out]")
    return vars(parser.parse_args(arguments))


if __name__ == "__main__":
    try:
        found, off = main(**options())
    except cf.SceneError as error:
        sys.exit(f"error: {error}")
    if np.isfinite(found.error).all() and off > found.error.max():
        sys.exit(f"the error of delta, {off:.1e}, is above its estimate, {found.error.max():.1e}")
