"""Through how many files of the package `cf.solve` runs: whoever follows it in a debugger reads these."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial
ROOT = Path(__file__).parent.parent
#: Most files whose functions run in the first call, with compiled code at hand, and in one like it afterwards.
FIRST, AGAIN = 61, 35
COLUMN = f"""
import sys
import cosserat_fenicsx as cf

steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), steel, name="column")
P = cf.euler_load(rod)
loads = [cf.Force(rod.end, (0, 0, -P)), cf.Moment(rod.end, (0, 0.2 * P, 0))]
scene = cf.Scene(rods=[rod], supports=[cf.Clamp(rod.start)], loads=loads)
solve, files = cf.solve, set()


def look(frame, event, argument):
    file = frame.f_code.co_filename
    if event == "call" and file.startswith({str(ROOT / "cosserat_fenicsx")!r}):
        while frame and frame.f_code.co_name != "<module>":
            frame = frame.f_back
        if frame.f_code is here:  # not what an import runs
            files.add(file)


here = sys._getframe().f_code
for _ in range(2):
    sys.setprofile(look)
    solve(scene, load_factors=[0.5, 0.9, 1.0, 1.5], tol=1e-6)
    sys.setprofile(None)
    print(*sorted(files), sep="\\n", end="\\n\\n")
    files.clear()
"""


def test_few_files():
    for _ in range(2):  # the first time compiles what other tests have not
        done = subprocess.run([sys.executable, "-c", COLUMN], capture_output=True, encoding="utf-8", cwd=ROOT)
    first, again, _ = (part.split("\n") for part in done.stdout.split("\n\n"))
    assert len(first) <= FIRST and len(again) <= AGAIN, done.stdout + done.stderr
    assert len(first) > 20 and len(again) > 10
