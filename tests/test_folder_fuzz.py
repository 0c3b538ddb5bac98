"""Folders of motions that are damaged in many ways: the motion, or words, never another exception."""

import json
import random
import shutil
import warnings

import pytest
from conftest import column
from test_scene_fuzz import damaged

import cosserat_fenicsx as cf
from cosserat_fenicsx.dynamics import resuming

pytestmark = pytest.mark.serial


class Computes(Exception):
    """Raised where a resumed motion would begin its first step."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """The folder of a motion, whose scene is stored there; half of its states are missing."""
    folder = tmp_path_factory.mktemp("fuzz") / "part"
    rod, scene = column()
    pull = cf.Force(rod.end, cf.Table([0, 0.1, 1], [(0, 0, 0), (1e4, 0, 0), (0, 0, 0)]))
    scene = cf.Scene([rod], scene.supports, [pull, cf.Foundation(rod, 1e3)], title="pulled")
    whole = cf.simulate(scene, 0.2, dt=0.01, save_every=0.02, elements=2, degree=2, folder=folder)
    states = folder / "instants.npy"
    states.write_bytes(states.read_bytes()[: -len(whole) // 2 * whole._file.rows.dtype.itemsize])
    return folder


@pytest.fixture(autouse=True)
def no_steps(monkeypatch):
    def over(*given):
        raise Computes

    monkeypatch.setattr(resuming.TimeLoop, "over", over)


def read_all(folder):
    """What a user would do first."""
    history = cf.read_history(folder)
    if len(history):
        rod = history.scene.rods[0]
        history.fields(-1)
        history.position(rod.end), history.force(rod.start), history.velocity(rod.end), history.balance
    resuming.resume(folder, progress=False)


def check(folder, numbers="error"):
    """Whether it is refused, in words; `numbers`: what to do about warnings of numbers that overflow."""
    with warnings.catch_warnings():
        warnings.simplefilter(numbers, RuntimeWarning)
        try:
            read_all(folder)
        except Computes:
            return False
        except cf.SceneError as refusal:
            assert len(str(refusal)) > 20
            return True
    return False


@pytest.mark.parametrize("name", ["motion.json", "scene.json"])
def test_damaged_json(name, sound, tmp_path):
    folder = shutil.copytree(sound, tmp_path / "copy")
    whole, chance, refused = json.loads((sound / name).read_text()), random.Random(7), 0
    for _ in range(60):
        table = damaged(whole, chance)
        (folder / name).write_text(json.dumps(table))
        shutil.copy(sound / "instants.npy", folder)
        refused += check(folder)
    assert 20 < refused < 60


def test_damaged_bytes(sound, tmp_path):
    """Truncated, overwritten and doubled."""
    chance = random.Random(3)
    for name in ("motion.json", "scene.json", "instants.npy", "checkpoint.npz", "start.npz"):
        folder, whole = shutil.copytree(sound, tmp_path / name), (sound / name).read_bytes()
        for _ in range(3):
            place = chance.randrange(min(len(whole), chance.choice((100, 10**9))))
            other = bytes(chance.randrange(256) for _ in range(chance.choice((1, 4, 40))))
            bad = chance.choice((whole[:place], whole[:place] + other + whole[place + len(other) :], whole[:place] * 2))
            (folder / name).write_bytes(bad)
            check(folder, "ignore")  # numbers of states that are overwritten are read as they are
