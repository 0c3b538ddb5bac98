"""How sharp the tests are: the share of small errors, put into the code at random, that the serial tests find.

    python demos/evidence/mutants.py                 120 errors, 20 in each part of the code (hours)
    python demos/evidence/mutants.py --count 12 --seed 3
    python demos/evidence/mutants.py --quick         one error in a copy of a small file, against its own tests

An error (a "mutant") swaps an arithmetic operator or a comparison, changes a sign or a constant, or leaves out a
statement. It is killed when a test fails that passes without it, or when the tests take five times as long as they
should. Each mutant lives in a copy of the checkout; the tests that run its line are started first, then those that run
another line of its file, and for forms and C all: which these are is measured once, with coverage (`pip install
pytest-cov`). A run that was broken off goes on where it was: outcomes are kept in out/mutants.jsonl, by seed and state
of the code.
"""

import argparse
import ast
import concurrent.futures
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

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
#: The tests of a mutant may take this many times what they take without it, and as many seconds more.
TIMES, SECONDS = 5, 60


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
            other = node.value + 1 if type(node.value) is int else 1.5 * node.value
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


def surroundings(root):
    """The environment of a run of tests."""
    return {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}


def tests_of_lines(root, out):
    """({file: {line: tests}}, {test: s}): what each line is run by, and how long each test takes."""
    kept = out / "mutants_coverage.json"
    if kept.exists():
        found = json.loads(kept.read_text(encoding="utf-8"))
        if found["state"] == state_of(root):
            return found["lines"], found["seconds"]
    with tempfile.TemporaryDirectory() as place:
        copy = copied(root, Path(place))
        words = ["-m", "pytest", "-n", "2", "--dist", "worksteal", "-p", "no:cacheprovider", "--cov=cosserat_fenicsx"]
        words += ["--cov=forms", "--cov-context=test", "--cov-report=", "--durations=0", "--durations-min=0.001"]
        print("measuring which tests run which lines (the whole serial suite, once) ...", flush=True)
        piped = {"capture_output": True, "text": True}
        done = subprocess.run([sys.executable, *words], cwd=copy, env=surroundings(copy), **piped)
        print("\n".join(done.stdout.splitlines()[-1:]), flush=True)
        seconds = {}
        for line in done.stdout.splitlines():
            match = re.match(r"([\d.]+)s (?:call|setup) +(\S.*)", line)
            if match:
                seconds[match[2]] = seconds.get(match[2], 0.0) + float(match[1])
        from coverage import CoverageData

        data = CoverageData(str(copy / ".coverage"))
        data.read()
        lines = {}
        for file in data.measured_files():
            name = str(Path(file).resolve().relative_to(copy.resolve()))
            by_line = data.contexts_by_lineno(file)
            lines[name] = {number: sorted({context.partition("|")[0] for context in contexts} - {""})
                           for number, contexts in by_line.items()}  # fmt: skip
    out.mkdir(parents=True, exist_ok=True)
    found = {"state": state_of(root), "lines": lines, "seconds": seconds}
    kept.write_text(json.dumps(found), encoding="utf-8")
    return json.loads(json.dumps(lines)), seconds


def tests_for(mutant, lines, seconds):
    """The tests that run the line of a mutant, the quickest first, then the others that may notice it.

    A function that keeps what it has made runs its lines in one test only: the others are the tests that run any line
    of the file, and for forms and C, which are compiled and kept, all tests.
    """
    by_line = lines.get(mutant.file, {})
    # A statement of several lines may be charged to its first ones.
    line = max((int(x) for x in by_line if int(x) <= mutant.line), default=0)
    of_line = set(by_line.get(str(line), ()))
    of_file = {test for tests in by_line.values() for test in tests} - of_line
    others = set(seconds) - of_line - of_file if mutant.part in ("forms", "C") else set()

    def ordered(tests):
        return sorted(tests, key=lambda test: seconds.get(test, 0.0))

    return [*ordered(of_line), *ordered(of_file), *ordered(others)]


def verdict(mutant, root, tests, seconds=0.0):
    """ "killed", "survived" or "not run" of a mutant against tests that take `seconds`, in a copy of the checkout."""
    if not tests:
        return "not run"
    with tempfile.TemporaryDirectory() as place:
        copy = copied(root, Path(place))
        file = copy / mutant.file
        text = file.read_text(encoding="utf-8")
        assert text[mutant.offset : mutant.offset + len(mutant.old)] == mutant.old, mutant
        changed = text[: mutant.offset] + mutant.new + text[mutant.offset + len(mutant.old) :]
        file.write_text(changed, encoding="utf-8")
        (copy / "asked.json").write_text(json.dumps(tests), encoding="utf-8")
        options = ["-q", "-x", "-p", "no:cacheprovider"]
        code = f"import json, sys, pytest; sys.exit(pytest.main([*{options}, *json.load(open('asked.json'))]))"
        try:
            done = subprocess.run(
                [sys.executable, "-c", code], cwd=copy, env=surroundings(copy), timeout=TIMES * seconds + SECONDS,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return "killed"
        return "survived" if done.returncode == 0 else "killed"


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
    return found


def main(count=120, seed=0, root=ROOT, out=Path("out"), workers=2):
    """Print the share of mutants that are killed, by part; returns {mutant: verdict}."""
    lines, seconds = tests_of_lines(root, out)
    file, key, known = out / "mutants.jsonl", f"{seed} {count} {state_of(root)}", {}
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        row = json.loads(line)
        if row.pop("run") == key:
            told = row.pop("verdict")
            known[Mutant(**row)] = told
    mutants = chosen(root, count, seed)
    left = [x for x in mutants if x not in known]
    with concurrent.futures.ThreadPoolExecutor(workers) as pool, file.open("a", encoding="utf-8") as stream:
        running = {}
        for x in left:
            tests = tests_for(x, lines, seconds)
            running[pool.submit(verdict, x, root, tests, sum(seconds.get(test, 0.0) for test in tests))] = x
        try:
            for done in track(concurrent.futures.as_completed(running), "mutants", total=len(left)):
                x = running[done]
                known[x] = done.result()
                stream.write(json.dumps({"run": key, **asdict(x), "verdict": known[x]}) + "\n")
                stream.flush()
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    found = {x: known[x] for x in mutants}
    for x, told in found.items():
        if told != "killed":
            print(f"{told}: {x.file}:{x.line} ({x.kind}): {x.old!r} -> {x.new!r}")
    for part in PARTS:
        told = [found[x] for x in found if x.part == part]
        print(f"{part}: {told.count('killed')} of {len(told)} killed, {told.count('not run')} on lines no test runs")
    print(f"all: {list(found.values()).count('killed')} of {len(found)} killed")
    return found


def quick(root=ROOT):
    """The verdicts of a mutant of scene/curves.py that its tests must find, and of the file as it is."""
    name = "cosserat_fenicsx/scene/curves.py"
    mutants = mutants_in("scene", name, (root / name).read_text(encoding="utf-8"))
    wrong = next(x for x in mutants if x.new.startswith("-(np.eye"))  # a rotation
    same = Mutant("scene", name, wrong.line, "none", wrong.offset, wrong.old, wrong.old)
    return [verdict(x, root, ["tests/test_curves.py"]) for x in (wrong, same)]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one mutant of a small file")
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    print(quick()) if given.quick else main(given.count, given.seed)
