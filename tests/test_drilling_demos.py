"""The demos of drill-strings in motion: their numbers come out; damaged scene files are refused in words."""

import copy
import random
import sys
import tomllib
import warnings
from pathlib import Path

import pytest
from test_scene_fuzz import damaged

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.files import toml

pytestmark = pytest.mark.serial
DEMOS = Path(__file__).parent.parent / "demos"
FILES = sorted((DEMOS / "strings").glob("*.toml"))


@pytest.fixture
def demos_on_the_path(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(DEMOS), *sys.path])


def test_the_demos_give_their_numbers(demos_on_the_path, capsys):
    import strings
    from known_numbers import deviation

    names = {demo.__name__ for demo in strings.STRINGS} | {"stability_map"}
    assert names == {file.stem for file in FILES}
    for check in strings.main(out=None):
        assert deviation(check) <= check.allowed, check
    assert "Drill-strings in motion" in capsys.readouterr().out


def test_a_coarse_map_agrees_with_the_linear_theory(demos_on_the_path, capsys):
    import strings_map
    from known_numbers import deviation

    assert all(deviation(check) == 0 for check in strings_map.main(quick=True))
    told = capsys.readouterr().out
    assert "25 simulations of 120 s on 1 rank(s)" in told and "the bit oscillates in 12, a mode grows in 4" in told


def test_the_command_line_explains_them(capsys):
    for file in FILES:
        assert main(["explain", str(file)]) == 0
    told = capsys.readouterr().out
    for words in (
        "String, drill pipe: 3000 m, impedance 296.38 N m s/rad in torsion",
        "Model: axial and torsional: the hook moves.",
        "Motion: 120 s in 36234 steps of 0.003312 s, 305 places along the string.",
        "Drive: 40 rpm, PI(Kp=38000.0, Ki=100000.0), inertia 2900 kg m^2.",
        "Bit: none, the lower end is free.",
        "Stability at 20 speeds and 20 weights on bit.",
    ):
        assert words in told, words


@pytest.mark.parametrize("seed", range(3))
def test_damaged_files(seed, monkeypatch, tmp_path):
    chance, refused = random.Random(seed), 0
    tables = [tomllib.loads(file.read_text(encoding="utf-8")) for file in FILES]
    tables.append(tomllib.loads(_whole()))
    for _ in range(200):
        table = damaged(chance.choice(tables), chance)
        monkeypatch.setattr(toml.tomllib, "loads", lambda stream, table=table: copy.deepcopy(table))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", cf.SceneWarning)
            try:
                cf.read(FILES[0])
            except cf.SceneError as problem:
                refused += 1
                assert len(str(problem)) < 3000
    assert 60 < refused < 200


def _whole():
    from test_drilling_scenefile import FILE

    return FILE


@pytest.mark.slow
def test_the_command_line_maps_the_stability(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    assert main(["run", str(DEMOS / "strings" / "stability_map.toml"), "--duration", "5", "-o", str(tmp_path)]) == 0
    assert "20 speeds from 40 to 192 rpm" in capsys.readouterr().out
    assert {"stability.csv", "stability.png", "drilling.csv", "map.png"} <= {file.name for file in tmp_path.iterdir()}
