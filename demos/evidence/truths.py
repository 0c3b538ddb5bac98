"""What independent truths say: the error of each comparison that tests make with one, beside what is asked for.

    python demos/evidence/truths.py           all (a few minutes)
    python demos/evidence/truths.py --quick   tendons alone

The tests compare by the fixture `truth` of tests/conftest.py; closed forms and other programs are named in them. Writes
out/truths.md.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

from harness import command, in_words, table, write

ROOT = Path(__file__).resolve().parents[2]


def compared(only="", among="test_*.py"):
    """[(file of tests, problem, error, error asked for, why it is missed)], of the tests with a text in their names, in
    files whose names match a pattern. Raises RuntimeError: a test fails."""
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "found.xml"
        words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--truths", "-o",
                 "junit_family=xunit1", f"--junitxml={told}"]  # fmt: skip
        takes = re.compile(r"def test_\w+\([^)]*\btruth\b")  # other files need not be imported
        files = [file for file in sorted((ROOT / "tests").glob(among)) if takes.search(file.read_text("utf-8"))]
        words += [*map(str, files), *(["-k", only] if only else [])]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"truths: the tests fail:\n{done.stdout[-3000:]}")
        cases = ElementTree.parse(told).iter("testcase")
        rows = {}
        for case in cases:
            for found in case.iter("property"):
                if found.get("name") == "truth":
                    what, error, asked, why = json.loads(found.get("value"))
                    key = (case.get("classname").split(".")[1].removeprefix("test_"), what, asked, why)
                    rows[key] = max(error, rows.get(key, 0.0))
    return [(file, what, error, asked, why) for (file, what, asked, why), error in sorted(rows.items())]


def main(only="", out="out", among="test_*.py"):
    """Compare, write the table, and return its rows."""
    rows = compared(only, among)
    judged = [(file.replace("_", " "), what, f"{error:.1e}" if error <= asked else f"**{error:.1e}, missed**: {why}",
               f"{asked:g}") for file, what, error, asked, why in rows]  # fmt: skip
    lines = table("tests of | problem and quantity | error | asked at most", judged)
    missed = sum(error > asked for _, _, error, asked, _ in rows)
    print(write("truths", [*lines, "", f"{len(rows)} comparisons, {missed} missed. {in_words()}"], out))
    return rows


if __name__ == "__main__":
    command(__doc__, main, {"only": "tendons"})
