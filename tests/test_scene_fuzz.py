"""Scene files that are damaged in many ways: a scene or words, never another exception."""

import copy
import random
import tomllib
import warnings
from pathlib import Path

import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.files import toml

pytestmark = [pytest.mark.serial, pytest.mark.once]
FILES = sorted((Path(__file__).parent.parent / "demos").glob("**/*.toml"))
VALUES = [
    [], {}, "", "x", "column.end", True, 0, -1, 1e308, -1e308, 1e-308, float("nan"), float("inf"), 10**400, [0, 0, 0],
    [1e300] * 3, [1, 2], [[]], {"type": []}, {"type": "Circle"}, "é\u0000", 5e-324, ["a"] * 3, None, [10**400] * 3,
    "rod@1e400", "column@-1", "column@nan",
]  # fmt: skip


def places(table, place=()):
    """The keys that lead to every value of nested tables and lists."""
    if place:
        yield place
    inside = table.items() if isinstance(table, dict) else enumerate(table) if isinstance(table, list) else ()
    for key, value in inside:
        yield from places(value, (*place, key))


def damaged(table, chance):
    """A copy with one to three keys deleted, renamed or doubled, or values replaced or scaled."""
    table = copy.deepcopy(table)
    for _ in range(chance.choice((1, 1, 2, 3))):
        *way, key = chance.choice(list(places(table)) or [()])
        inner = table
        for step in way:
            inner = inner[step]
        how = chance.choice(("replace", "replace", "delete", "rename", "double", "scale"))
        number = type(inner[key]) in (int, float) and abs(inner[key]) < 1e150
        if how == "delete":
            del inner[key]
        elif how == "rename" and isinstance(inner, dict):
            inner[chance.choice(("typ", "forc", f"{key}s", "", str(key).upper()))] = inner.pop(key)
        elif how == "double" and isinstance(inner, list):
            inner.append(copy.deepcopy(inner[key]))
        elif how == "scale" and number:
            inner[key] *= chance.choice((1e-12, 1e12, -1, 1e150))
        else:
            inner[key] = copy.deepcopy(chance.choice(VALUES))
        if not table:
            break
    return table


@pytest.mark.parametrize("seed", range(4))
def test_damaged_files(seed, monkeypatch):
    chance, refused = random.Random(seed), 0
    tables = {file: tomllib.loads(file.read_text(encoding="utf-8")) for file in FILES}
    for _ in range(200):
        file = chance.choice(FILES)
        table = damaged(tables[file], chance)
        monkeypatch.setattr(toml.tomllib, "loads", lambda stream, table=table: copy.deepcopy(table))
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            try:
                found = cf.read(file)
                if isinstance(found, cf.RodScene):
                    assert found.scene.cautions is not None and found.scene.flatness
            except cf.SceneError as problem:
                refused += 1
                assert len(str(problem)) < 3000
    assert 20 < refused < 200
