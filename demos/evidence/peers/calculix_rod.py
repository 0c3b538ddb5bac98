"""CalculiX: quadratic beams with reduced integration (B32R), which it expands into solid elements; see `speak`.

Clamped and loaded ends are solids too, which causes an error of about 2e-3 of the deflection at the load factor 0.9 on
any mesh. The sample is the whole program, which has no warm state: reading the input deck is a small part of it. Every
load factor is a separate step, in which the program chooses increments. Displacements are printed with seven digits.
"""

import itertools
import math
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from speak import Stopped, serve

PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "ccx"


def deck(problem, configuration):
    """The input deck, as text."""
    n, L, R = configuration["elements"], problem["length"], problem["radius"]
    lines = ["*NODE"]
    for i, s in enumerate(_places(L, n)):
        x, y = (R * math.sin(s / R), R * (1 - math.cos(s / R))) if R else (s, 0.0)
        lines.append(f"{i + 1},{x:.15g},{y:.15g},0.")
    lines.append("*ELEMENT,TYPE=B32R,ELSET=ROD")
    lines += [f"{i + 1},{2 * i + 1},{2 * i + 2},{2 * i + 3}" for i in range(n)]
    tip = 2 * n + 1
    E, nu = problem["E"], problem["nu"]
    lines += [f"*NSET,NSET=TIP\n{tip}", f"*MATERIAL,NAME=M\n*ELASTIC\n{E:.15g},{nu:.15g}"]
    lines += ["*BEAM SECTION,ELSET=ROD,MATERIAL=M,SECTION=RECT", f"{problem['width']:.15g},{problem['height']:.15g}"]
    lines += ["0.,0.,1.", "*BOUNDARY", "1,1,6"]
    controls = f"*CONTROLS,PARAMETERS=FIELD\n{configuration['tol']:g},{configuration['tol']:g}"
    loads = [*problem["force"], *problem["moment"]]
    for factor in problem["load_factors"]:
        lines += [
            "*STEP,NLGEOM,INC=200",
            "*STATIC",
            f"{1 / configuration.get('substeps', 1):g},1.,1e-4,1.",
            controls,
            "*CLOAD",
        ]
        lines += [f"{tip},{i + 1},{factor * load:.15g}" for i, load in enumerate(loads) if load]
        lines += ["*NODE PRINT,NSET=TIP,FREQUENCY=1000", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def _places(L, n):
    """Arc lengths of the nodes. Half an element at the clamp and at the tip is stiff, so the end elements are short."""
    ends = [0.0, *(L * (1.5e-3 + 0.997 * i / (n - 2)) for i in range(n - 1)), L]
    return [s for a, b in itertools.pairwise(ends) for s in (a, (a + b) / 2)] + [L]


def prepare(problem, configuration):
    text = deck(problem, configuration)

    def solve():
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "rod.inp").write_text(text, encoding="ascii")
            silent = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
            process = subprocess.Popen([PROGRAM, "rod"], cwd=folder, **silent)
            said = process.stdout.read()
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            printed = Path(folder, "rod.dat")
            found = printed.read_text(encoding="ascii") if printed.exists() else ""
        rows = re.findall(r"displacements.*?time\s+\S+\s+\d+\s+(\S+)\s+(\S+)\s+(\S+)", found, re.DOTALL)
        if len(rows) < len(problem["load_factors"]):
            wrong = re.search(r"\*ERROR.*", said)
            reached = problem["load_factors"][len(rows) - 1] if rows else 0
            raise Stopped(f"beyond the load factor {reached:g}: {wrong[0] if wrong else 'no convergence'}")
        return [[float(x) for x in row] for row in rows], used.ru_utime + used.ru_stime

    return solve


def version():
    said = subprocess.run(
        [PROGRAM, "-v"], check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ).stdout
    return re.search(r"[Vv]ersion\s+(\S+)", said)[1]


if __name__ == "__main__":
    serve(prepare, {"calculix": version()})
