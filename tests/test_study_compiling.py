"""Ranks that need the same compiled forms at once, each in a case of its own: one compiles, the others wait for it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.serial, pytest.mark.slow]
ROOT = Path(__file__).parent.parent
PROGRAM = """
from conftest import COMM, column
import cosserat_fenicsx as cf
def tip(eta):
    rod, scene = column()
    return cf.solve(scene, [eta], elements=2, degree=2, model="planar").position(rod.end)[-1]
found = cf.study(tip, {"eta": [0.5] * 4})
if COMM.rank == 0:
    print(len({x.tobytes() for x in found.results}), "place;", len(found.failures), "failures")
"""


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun")
def test_an_empty_cache_of_forms(tmp_path):
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_COMM", "PMIX", "ORTE"))}
    paths = {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")]), "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run(
        ["mpirun", "--oversubscribe", "-n", "2", sys.executable, "-c", PROGRAM],
        capture_output=True, encoding="utf-8", timeout=300, env={**clean, **paths},
    )  # fmt: skip
    assert done.stdout == "1 place; 0 failures\n", done.stderr
    forms = list((tmp_path / "fenics").glob("libffcx_*.c"))
    assert forms and all(form.with_suffix(".c.cached").exists() for form in forms)
