"""Published problems (demos/benchmarks): each is solved and agrees with its printed numbers; no table has a blank."""

import importlib.util
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parent.parent / "demos" / "benchmarks"))
import manual
from harness import record

pytestmark = pytest.mark.serial
PROBLEMS = manual.load()
# The first problem of every chapter, for all releases of Debian; the others use dolfinx in no other way.
FIRST = {problem.chapter: name for name, problem in reversed(PROBLEMS.items())}.values()


@pytest.fixture(scope="module")
def results():
    """Of the problems that this process has solved: the `Row`s of each."""
    return {}


@pytest.mark.parametrize(
    "name", [name if name in FIRST else pytest.param(name, marks=pytest.mark.once) for name in PROBLEMS]
)
def test_it_agrees_with_its_published_numbers(name, results):
    found = results[name] = manual.solved(PROBLEMS[name], again=False)
    for row in found["rows"]:
        off = np.atleast_1d(np.abs(np.subtract(row["ours"], row["published"])))
        assert (off <= row["allowed"]).all(), f"{row['quantity']}: {row['ours']} for {row['published']}"
        assert (np.asarray(row["estimate"]) >= 0).all() and row["agrees"], row["quantity"]
        assert abs(row["difference"]) <= np.max(row["allowed"])


@pytest.mark.once
def test_the_tables_have_no_blank(results):
    """Of what this process has solved, or of one problem."""
    name = next(iter(PROBLEMS))
    found = results or {name: manual.solved(PROBLEMS[name])}
    lines = list(manual.text(PROBLEMS, found, record()))
    tables = [line for line in lines if line.startswith("|")]
    assert len(tables) >= sum(len(x["rows"]) for x in found.values()) + 2
    for line in tables:
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        assert len(cells) == manual.HEADS.count("|") + 1 and all(cells), line


@pytest.mark.once
def test_every_problem_says_where_it_comes_from():
    assert {x.chapter for x in PROBLEMS.values()} <= set(manual.CHAPTERS)
    for problem in PROBLEMS.values():
        assert min(map(len, (problem.title, problem.given, problem.source))) > 10, problem.name
    page = (manual.HERE.parents[1] / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    assert "<!-- benchmarks -->" in page


@pytest.mark.once
def test_a_run_that_is_broken_off_goes_on(tmp_path, monkeypatch, capsys):
    spec = importlib.util.spec_from_file_location("published_command", manual.HERE / "__main__.py")
    command = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(command)
    row = {"quantity": "length, m", "published": 1.0, "ours": 1.5, "estimate": 0.0, "allowed": 0.1,
           "because": "no reason"}  # fmt: skip
    found, asked = {"seconds": 0.25, "rows": [row | {"difference": 0.5, "agrees": False}]}, []

    def broken(problem, picture):
        asked.append(problem.name)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return found

    monkeypatch.setattr(command, "solved", broken)
    with pytest.raises(KeyboardInterrupt):
        command.main(out=tmp_path)
    assert len(json.loads((tmp_path / "benchmarks.json").read_text(encoding="utf-8"))["problems"]) == 2
    results = command.main(out=tmp_path)
    assert "goes on from" in capsys.readouterr().err and asked == [*list(PROBLEMS)[:3], *list(PROBLEMS)[2:]]
    assert list(results) == list(PROBLEMS)
    assert "**disagrees**" in (tmp_path / "benchmarks.md").read_text(encoding="utf-8")
