"""Motions that are written as they go: damaged files, other scenes, and what cannot be done."""

import json

import pytest
from ended_motions import assert_same, part_of, rows, run
from moving_scenes import flying_in_a_plane, flying_in_space

import cosserat_fenicsx as cf
from cosserat_fenicsx.storage import runfolder

pytestmark = pytest.mark.serial


def test_damaged_files(tmp_path, monkeypatch, never_ended):
    """A cut-off file of states and a checkpoint that is no more cost time alone; what is lost with them is said."""
    folder = tmp_path / "part"
    part_of("fixed", folder, monkeypatch)
    states = folder / "instants.npy"
    whole = states.read_bytes()
    states.write_bytes(whole[: -rows(folder).dtype.itemsize * 3 // 2])
    seen = cf.read_history(folder)
    assert 0 < len(seen) < 30
    cf.resume(folder)
    assert_same(folder, never_ended("fixed"))
    for damage in (b"", b"nonsense", (folder / "checkpoint.npz").read_bytes()[:-100]):
        states.write_bytes(whole)
        (folder / "checkpoint.npz").write_bytes(damage)
        cf.resume(folder)
        assert_same(folder, never_ended("fixed"))
    states.write_bytes(b"nonsense" + whole[8:])
    with pytest.raises(cf.SceneError, match=r"instants.npy is damaged .* expected saved states"):
        cf.read_history(folder)
    states.unlink()
    cf.resume(folder)
    assert_same(folder, never_ended("fixed"))
    (folder / "scene.pickle").write_bytes(b"nonsense")
    with pytest.raises(cf.SceneError, match=r"resume.scene = None: expected the scene of .* cannot be loaded here"):
        cf.resume(folder)
    assert len(cf.resume(folder, flying_in_space()[1])) == len(rows(folder))
    for name in ("checkpoint.npz", "start.npz"):
        (folder / name).unlink()
    with pytest.raises(cf.SceneError, match="nothing to go on from is left"):
        cf.resume(folder, flying_in_space()[1])
    (folder / "motion.json").write_text("{}")
    with pytest.raises(cf.SceneError, match=r"motion.json is damaged"):
        cf.resume(folder)


def test_another_scene_is_told_from_the_one_of_the_motion(tmp_path, monkeypatch):
    folder = tmp_path / "motion"
    rod, scene = flying_in_space()
    part_of("fixed", folder, monkeypatch)
    longer = cf.Rod(cf.Line((6, 0, 0), (0, 8, 1)), rod.section, name=rod.name)
    softer = cf.Rod(
        rod.curve, cf.Stiffness((1e4, 1e4), 1e4, (500, 400), 500, mass=1.0, inertia=(10, 10, 20)), name=rod.name
    )
    damped = cf.Rod(rod.curve, rod.section, name=rod.name, damping=cf.Damping(drag=1.0))
    others = {
        "number of rods is 2": cf.Scene([rod, cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), rod.section)], loads=scene.loads),
        "length (m) is 10.0498": cf.Scene([longer]),
        "J at s = 0 m is [500.0, 400.0, 500.0]": cf.Scene([softer]),
        "damping is 'Damping(": cf.Scene([damped]),
        "number of loads is 1": cf.Scene([rod], loads=scene.loads[:1]),
        "force at t = 2.5 s is [10.0, 0.0, 0.0]": cf.Scene(
            [rod], loads=[cf.Force(rod.start, cf.Triangle((10, 0, 0), 0, 2.5, 5)), scene.loads[1]]
        ),
        "station is ['spaghetti', 10.0]": cf.Scene(
            [rod], loads=[cf.Force(rod.end, cf.Triangle((20, 0, 0), 0, 2.5, 5)), scene.loads[1]]
        ),
        "number of supports is 1": cf.Scene([rod], [cf.Pin(rod.start)], scene.loads),
    }
    for words, other in others.items():
        with pytest.raises(cf.SceneError, match="the scene is not the one of the motion") as refusal:
            cf.resume(folder, other)
        assert words in str(refusal.value)


def test_what_cannot_be_done_is_said(tmp_path, monkeypatch):
    folder, scene = tmp_path / "motion", flying_in_a_plane()[1]
    with pytest.raises(cf.SceneError, match=r"no motion was found there .*: expected a folder that simulate"):
        cf.resume(folder)
    part_of("plane", folder, monkeypatch)
    with pytest.raises(cf.SceneError, match=r"resume.scene = None: expected the scene of .* \(a lambda"):
        cf.resume(folder)
    with pytest.raises(cf.SceneError, match=r"simulate.folder = 3: expected the name of a folder"):
        run("plane", 3)
    with pytest.raises(cf.SceneError, match=r"resume.scene = 3: expected a Scene"):
        cf.resume(folder, 3)
    with pytest.raises(cf.SceneError, match=r"resume.duration = 1: expected None or at least 3 s"):
        cf.resume(folder, scene, duration=1)
    with pytest.raises(cf.SceneError, match=r"simulate.folder = .*: it holds a motion already"):
        run("plane", folder)
    other = runfolder.RunFolder(folder, cf.read_history(folder, scene).comm)
    other.hold()
    other.open().extend(4)
    with pytest.raises(cf.SceneError, match="another process is at work on this motion"):
        cf.resume(folder, scene)
    other.release()
    head = json.loads((folder / "motion.json").read_text())
    (folder / "motion.json").write_text(json.dumps({**head, "ranks": 2}))
    with pytest.raises(cf.SceneError, match=r"computed by 2 rank\(s\), and here are 1"):
        cf.resume(folder, scene)
    (tmp_path / "file").write_text("")
    with pytest.raises(cf.SceneError, match=r"simulate.folder = .*: expected a folder that can be written to"):
        run("plane", tmp_path / "file")
