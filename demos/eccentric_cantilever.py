"""The paper's verification problem: a steel column, clamped below, under a dead force eta P_cr and the moment of its
eccentricity e = L/100. Delta at eta = 0.9 is 2.20062 m; the secant formula, eq. (8), gives 3.8 % more.

    mpirun -n 2 python demos/eccentric_cantilever.py

Writes to out/: cantilever.xdmf and .h5 (every point, for ParaView), figure.png (delta against eta), rod.png.
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI
from rich.table import Table

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic
from cosserat_fenicsx.pictures import plot
from cosserat_fenicsx.results.tables import as_text, stability

L, DIAMETER, ECCENTRICITY = 20.0, 0.2, 0.2  # m
TABULATED = (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0, 1.1, 1.3, 1.5, 2.0)


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


def report(rod, path):
    """Print the table: this package, the exact rod and eq. (8)."""
    table = Table(title=f"{path.scene.title}: {path.model} model, {path.unknowns} unknowns")
    for heading in ("eta", "delta (m)", "exact delta (m)", "eq. (8) (m)", "relative error", "iterations", "stable"):
        table.add_column(heading, justify="right")
    delta, truth = path.displacement(rod.end)[:, 0], exact(rod, path.load_factors).delta
    secant = analytic.secant_delta(path.load_factors, ECCENTRICITY)
    for k, eta in enumerate(path.load_factors):
        table.add_row(
            f"{eta:g}",
            f"{delta[k]:.9f}",
            f"{truth[k]:.9f}",
            f"{secant[k]:.5f}" if np.isfinite(secant[k]) else "beyond its pole",
            f"{abs(delta[k] / truth[k] - 1):.1e}",
            str(path.iterations[k]),
            stability(path.negative_modes[k]),
        )
    return as_text(table), np.abs(delta / truth - 1).max()


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
    plot.chart(
        file,
        curves,
        xlabel=r"load factor $\eta = F / P_{cr}$",
        ylabel=r"transverse tip displacement $\delta$ (m)",
        title="Eccentrically compressed cantilever, e = L/100",
        ylim=(0, 18),
    )


def main(out="out", load_factors=TABULATED):
    """Solve, print, write and draw.

    Returns:
        (Path, largest relative error of delta).
    """
    out = Path(out)
    rod, scene = column()
    path = cf.solve(scene, list(load_factors), tol=1e-6)
    table, error = report(rod, path)
    path.write(out / "cantilever.xdmf")
    path.plot(out / "rod.png")
    if MPI.COMM_WORLD.rank == 0:
        draw(rod, path, out / "figure.png")
        print(table)
        print(f"written to {out}/: cantilever.xdmf, cantilever.h5, figure.png, rod.png")
    return path, error


if __name__ == "__main__":
    sys.exit(int(main()[1] > 1e-6))
