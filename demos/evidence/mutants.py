"""How sharp the tests are: the share of small errors, put into the code at random, that the serial tests find.

    python demos/evidence/mutants.py                 120 errors, 20 in each part of the code (one to two hours)
    python demos/evidence/mutants.py --count 12 --seed 3
    python demos/evidence/mutants.py --quick         one error in a copy of a small file, against its own tests

An error (a "mutant") swaps an arithmetic operator or a comparison, changes a sign or a constant, or leaves out a
statement. It is killed when a test fails that passes without it, or when the tests take five times as long as they
should. Which tests run which lines, and how long each takes, is measured once, file by file of the tests, with coverage
(`pip install pytest-cov`). A mutant then meets the tests that run its line, the quickest first, then those that run
another line of its file (in C: of the folder's Python), up to the first that fails or to half a minute of tests: the
share of the whole suite is this or more. All in one process at a time. An interrupted run continues where it was.

Writes to out/: mutants_coverage.json, mutants.jsonl (each outcome, by seed and state of the code), mutants.md.
"""

import ast
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

from harness import command, table, write
from rich.progress import track

ROOT = Path(__file__).resolve().parents[2]
#: The parts of the code, by the beginnings of their files' names.
PARTS = {
    "forms": ("forms/",),
    "laws": ("cosserat_fenicsx/actions/", "cosserat_fenicsx/models/", "cosserat_fenicsx/drilling/"),
    "scene": ("cosserat_fenicsx/scene/", "cosserat_fenicsx/well/"),
    "results": ("cosserat_fenicsx/results/", "cosserat_fenicsx/statics/", "cosserat_fenicsx/dynamics/"),
    "stores": ("cosserat_fenicsx/storage/", "cosserat_fenicsx/studies/"),
    "C": (".c",),
}
ARITHMETIC = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*", ast.FloorDiv: "*", ast.Mod: "*"}
COMPARISONS = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==", ast.Is: "is not",
               ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in"}  # fmt: skip
#: The same for C, by patterns; comments and lines of the preprocessor are left alone.
IN_C = {
    "arithmetic": [(r"(?<=[\w)\]]) \+ (?=[\w(])", " - "), (r"(?<=[\w)\]]) - (?=[\w(])", " + "),
                   (r"(?<=[\w)\]]) \* (?=[\w(])", " / "), (r"(?<=[\w)\]]) / (?=[\w(])", " * ")],
    "comparison": [(r" < ", " <= "), (r" <= ", " < "), (r" > ", " >= "), (r" >= ", " > "), (r" == ", " != "),
                   (r" != ", " == "), (r" && ", " || "), (r" \|\| ", " && ")],
    "sign": [(r"(?<== )-(?=[\w(])", ""), (r"(?<=return )(?=[\w(])", "-"), (r"\+= ", "-= "), (r"-= ", "+= ")],
    "constant": [(r"(?<![\w.])([2-9]|\d+\.\d+)(?![\w.])", r"(\1 * 1.5)")],
    "statement": [(r"^\s+[\w\->\[\].*]+ [-+*/]?= [^;{]*;$", "    ;")],
}  # fmt: skip
#: Tests of what lies around the code, or of all of it at once: they run no line of their own, or take long.
LEFT_OUT = (
    "site", "published", "docs", "release", "ci", "services", "typing", "evidence", "gallery", "rank_fails",
    "animation", "demos", "house", "chart_layout",
)  # fmt: skip
#: The tests of a mutant may take this many times what they take without it, and as many seconds more.
TIMES, SECONDS = 5, 60
BUDGET = 30.0  # s, of the tests that a mutant meets


@dataclass(frozen=True)
class Mutant:
    """`old` at an offset of a file becomes `new`."""

    part: str
    file: str
    line: int
    kind: str
    offset: int
    old: str
    new: str


def mutants_in(part, file, text):
    """All mutants of a file."""
    return list((_of_c if file.endswith(".c") else _of_python)(part, file, text))


def _of_c(part, file, text):
    start = 0
    for number, line in enumerate(text.splitlines(keepends=True), 1):
        code = line.partition("//")[0]
        if not re.match(r"\s*(#|/?\*)", code) and "/*" not in code:
            for kind, patterns in IN_C.items():
                for pattern, new in patterns:
                    for match in re.finditer(pattern, code.rstrip("\n")):
                        yield Mutant(part, file, number, kind, start + match.start(), match[0], match.expand(new))
        start += len(line)


def _of_python(part, file, text):
    tree, starts = ast.parse(text), [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def at(line, column):  # columns of ast count bytes
        return starts[line - 1] + len(text[starts[line - 1] : starts[line]].encode()[:column].decode())

    def source(node):
        begin = at(node.lineno, node.col_offset)
        return begin, text[begin : at(node.end_lineno, node.end_col_offset)]

    def between(left, right):
        begin = source(left)[0] + len(source(left)[1])
        return begin, text[begin : source(right)[0]]

    def mutant(node, kind, offset, old, new):
        return Mutant(part, file, node.lineno, kind, offset, old, new)

    for node in _nodes(tree):
        if isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
            begin, old = between(node.left, node.right)
            swapped = re.sub(r"\*\*|//|[-+*/%]", ARITHMETIC[type(node.op)], old, count=1)
            yield mutant(node, "arithmetic", begin, old, swapped)
        elif isinstance(node, ast.Compare) and len(node.ops) == 1:
            begin, old = between(node.left, node.comparators[0])
            sign = re.search(r"is not|not in|is|in|[<>=!]=?", old)
            if sign:
                yield mutant(node, "comparison", begin, old, old.replace(sign[0], COMPARISONS[type(node.ops[0])], 1))
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            begin, old = source(node)
            yield mutant(node, "sign", begin, old, f"({source(node.operand)[1]})")
        elif isinstance(node, ast.Return) and isinstance(node.value, ast.BinOp):
            begin, old = source(node.value)
            yield mutant(node, "sign", begin, old, f"-({old})")
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            begin, old = source(node)
            other = 1.5 * node.value if type(node.value) is float and node.value else node.value + 1
            yield mutant(node, "constant", begin, old, str(other))
        elif isinstance(node, ast.Assign | ast.AugAssign) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
        ):
            begin, old = source(node)
            yield mutant(node, "statement", begin, old, "pass")


def _nodes(tree):
    """The nodes of a syntax tree outside f-strings, in which ast gives no places."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, ast.JoinedStr):
            yield node
            yield from _nodes(node)


def tracked(root):
    """The files of a checkout, without what is built in it: names from its root."""
    built = {".git", ".venv", "out", "build", "dist", "__pycache__", "api", ".pytest_cache", ".ruff_cache"}
    found = []
    for folder, folders, files in os.walk(root):
        folders[:] = [name for name in folders if name not in built and not name.endswith(".egg-info")]
        links = [name for name in folders if (Path(folder) / name).is_symlink()]
        found += [str((Path(folder) / name).relative_to(root)) for name in (*files, *links)]
    return sorted(found)


def copied(root, place):
    """A copy of the checkout."""
    for name in tracked(root):
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(root / name, place / name, follow_symlinks=False)
    return place


def state_of(root):
    """A hash of the code and of its tests."""
    digest = hashlib.sha256()
    for name in tracked(root):
        if name.startswith(("cosserat_fenicsx/", "forms/", "tests/")) and (root / name).is_file():
            digest.update(name.encode() + (root / name).read_bytes())
    return digest.hexdigest()[:16]


def pytest_in(root, *words, limit=None, **variables):
    """(exit code, what is printed) of pytest in a checkout, or subprocess.TimeoutExpired after `limit`, s."""
    environment = {**os.environ, "PYTHONPATH": str(root), **variables}
    words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *words]
    done = subprocess.run(words, cwd=root, env=environment, timeout=limit, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def tests_of_lines(root, out):
    """({file: {line: tests}}, {test: s}): what each line is run by, and how long each test takes that passes."""
    kept, state = out / "mutants_coverage.json", state_of(root)
    if kept.exists() and (found := json.loads(kept.read_text(encoding="utf-8")))["state"] == state:
        return found["lines"], found["seconds"]
    from coverage import CoverageData

    lines, seconds = {}, {}
    words = ["--cov=cosserat_fenicsx", "--cov=forms", "--cov-context=test", "--cov-report=", "-rfE"]
    with tempfile.TemporaryDirectory() as place:
        copy = copied(root, Path(place).resolve())
        left_out = {f"test_{name}" for name in LEFT_OUT}
        files = [file for file in sorted((copy / "tests").glob("test_*.py")) if file.stem not in left_out]
        for file in track(files, "coverage"):
            # a process for each file: what a process keeps is run by its first test only
            name = str(file.relative_to(copy))
            said = pytest_in(
                copy, name, *words, "--durations=0", "--durations-min=0", COVERAGE_FILE=f"{file}.coverage"
            )[1]
            taken, passed = read_durations(said)
            seconds |= {test: taken[test] for test in passed}
            data = CoverageData(f"{file}.coverage")
            data.read()
            for measured in data.measured_files():
                of_file = lines.setdefault(str(Path(measured).relative_to(copy)), {})
                for number, contexts in data.contexts_by_lineno(measured).items():
                    tests = {context.rpartition("|")[0] for context in contexts} & passed
                    of_file.setdefault(str(number), []).extend(sorted(tests))
    out.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps({"state": state, "lines": lines, "seconds": seconds}), encoding="utf-8")
    return lines, seconds


def read_durations(said):
    """({test: s}, the tests that passed) of what pytest prints with --durations=0 -rfE."""
    taken, failed = Counter(), set(re.findall(r"^(?:FAILED|ERROR) (\S+::.*?)(?: - .*)?$", said, re.MULTILINE))
    for seconds, test in re.findall(r"^([\d.]+)s (?:call|setup|teardown) +(\S.*)$", said, re.MULTILINE):
        taken[test] += float(seconds)
    return taken, set(taken) - failed


def tests_for(mutant, lines, seconds):
    """The tests that a mutant meets, in order, at most BUDGET seconds of them. A function that keeps what it has made
    runs its lines in one test only: after the tests that run the line come those that run any line of the file. C is
    run by what runs the Python around it."""
    folder = str(Path(mutant.file).parent) + "/"
    around = [name for name in lines if name.startswith(folder)] if mutant.file.endswith(".c") else [mutant.file]
    by_line = lines.get(mutant.file, {})
    # A statement of several lines may be charged to its first ones.
    line = max((int(x) for x in by_line if int(x) <= mutant.line), default=0)
    of_line = set(by_line.get(str(line), ()))
    of_file = {test for name in around for tests in lines.get(name, {}).values() for test in tests} - of_line
    found, spent = [], 0.0
    for tests in (of_line, of_file):
        taken, cost = Counter(), {}
        for test in sorted(tests, key=lambda test: (seconds[test], test)):
            # the quickest first, but one file of tests after the other: tests of a file are alike
            taken[test.partition("::")[0]] += 1
            cost[test] = (seconds[test] + 0.01) * taken[test.partition("::")[0]]
        for test in sorted(cost, key=cost.get):
            if spent + seconds[test] <= BUDGET or not found:
                found.append(test)
                spent += seconds[test]
    return found


def verdict(mutant, copy, tests, seconds=0.0):
    """What becomes of a mutant in a copy of the checkout against tests that take `seconds`: ("killed", by which test),
    ("survived", "") or ("not run", "")."""
    if not tests:
        return "not run", ""
    file = copy / mutant.file
    text, stamp = file.read_text(encoding="utf-8"), file.stat().st_mtime_ns
    assert text[mutant.offset : mutant.offset + len(mutant.old)] == mutant.old, mutant
    file.write_text(text[: mutant.offset] + mutant.new + text[mutant.offset + len(mutant.old) :], encoding="utf-8")
    os.utime(file, (time.time(), time.time() + random.randrange(10**8)))  # Python compares times in whole seconds
    (copy / "asked.txt").write_text("\n".join(tests), encoding="utf-8")
    try:
        code, said = pytest_in(copy, "-x", "-rfE", "@asked.txt", limit=TIMES * seconds + SECONDS)
    except subprocess.TimeoutExpired:
        return "killed", "the limit of time"
    finally:
        file.write_text(text, encoding="utf-8")
        os.utime(file, ns=(stamp, stamp))
    killer = re.search(r"^(?:FAILED|ERROR) (\S+)", said, re.MULTILINE)
    return ("survived", "") if code == 0 else ("killed", killer[1] if killer else "a process that ends")


def chosen(root, count, seed):
    """`count` mutants, as many from each part, drawn at random."""
    numbers, found = random.Random(seed), []
    names = sorted(name for name in tracked(root) if name.endswith((".py", ".c")))
    for k, (part, beginnings) in enumerate(PARTS.items()):
        if part == "C":
            files = [name for name in names if name.startswith("cosserat_fenicsx/") and name.endswith(".c")]
        else:
            files = [name for name in names if name.startswith(beginnings) and name.endswith(".py")]
        every = [x for name in files for x in mutants_in(part, name, (root / name).read_text(encoding="utf-8"))]
        found += numbers.sample(every, count // len(PARTS) + (k < count % len(PARTS)))
    numbers.shuffle(found)  # what is done of a run that is broken off is a sample of all parts
    return found


def main(count=120, seed=0, out="out", root=ROOT, quick=False):
    """Print the share of mutants that are killed, by part, and write out/mutants.md; returns {mutant: verdict}."""
    if quick:
        return print(quickly())
    out = Path(out)
    lines, seconds = tests_of_lines(root, out)
    file, key, known = out / "mutants.jsonl", f"{seed} {count} {state_of(root)}", {}
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        row = json.loads(line)
        if row.pop("run") == key:
            told, by = row.pop("verdict"), row.pop("by")
            known[Mutant(**row)] = told, by
    mutants = chosen(root, count, seed)
    with file.open("a", encoding="utf-8") as stream, tempfile.TemporaryDirectory() as place:
        copy = copied(root, Path(place))
        (copy / "asked.txt").write_text("\n".join(seconds), encoding="utf-8")
        code, said = pytest_in(copy, "--collect-only", "-q", "@asked.txt")
        if code:  # it would kill every mutant
            sys.exit(f"pytest does not find the tests that were measured:\n{said[-2000:]}")
        for x in track([x for x in mutants if x not in known], "mutants"):
            tests = tests_for(x, lines, seconds)
            known[x] = told, by = verdict(x, copy, tests, sum(map(seconds.get, tests)))
            stream.write(json.dumps({"run": key, **asdict(x), "verdict": told, "by": by}) + "\n")
            stream.flush()
    return reported(
        mutants, known, f"`mutants.py --count {count} --seed {seed}`, state of the code {state_of(root)}.", out
    )


def reported(mutants, known, about, out):
    """Write what became of the mutants; returns {mutant: verdict}."""
    found = {x: known[x][0] for x in mutants}
    rows = []
    for part in (*PARTS, "all"):
        of_part = Counter(found[x] for x in found if part in (x.part, "all"))
        number, killed = of_part.total(), of_part["killed"]
        rows.append((part, number, killed, of_part["not run"], f"{100 * killed / max(number, 1):.0f}"))
    left = [f"- {x.file}:{x.line} ({x.kind}): {x.old!r} became {x.new!r}: {found[x]}" for x in found
            if found[x] != "killed"]  # fmt: skip
    heads = "part | mutants | killed | on lines that no test runs | killed (%)"
    print(write("mutants", [about, "", *table(heads, rows), *(["", *left] if left else [])], out))
    return found


def quickly(root=ROOT):
    """The verdicts of a mutant of scene/curves.py that its tests must find, and of the file as it is."""
    name = "cosserat_fenicsx/scene/curves.py"
    mutants = mutants_in("scene", name, (root / name).read_text(encoding="utf-8"))
    wrong = next(x for x in mutants if x.new.startswith("-(np.eye"))  # a rotation
    same = Mutant("scene", name, wrong.line, "none", wrong.offset, wrong.old, wrong.old)
    with tempfile.TemporaryDirectory() as place:
        copy = copied(root, Path(place))
        return [verdict(x, copy, ["tests/test_curves.py::test_helix"])[0] for x in (wrong, same)]


if __name__ == "__main__":
    numbers = {"count": {"type": int, "default": 120}, "seed": {"type": int, "default": 0}}
    command(__doc__, main, {"quick": True}, **numbers)
