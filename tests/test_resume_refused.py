"""Motions written to a folder: damaged files, other scenes, and requests that are refused."""

import math

import pytest
from ended_motions import assert_same, part_of, rows, run
from moving_scenes import flying_in_a_plane, flying_in_space

import cosserat_fenicsx as cf
from cosserat_fenicsx.storage import files

pytestmark = pytest.mark.serial


def test_damaged_files(tmp_path, monkeypatch, never_ended):
    """A truncated file of states or a missing checkpoint only costs time; the message says what was lost."""
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
    for name in ("checkpoint.npz", "start.npz"):
        (folder / name).unlink()
    with pytest.raises(cf.SceneError, match="no checkpoint can be read"):
        cf.resume(folder, flying_in_space()[1])


def test_no_objects_are_read_from_a_file_of_states(tmp_path):
    """They would be pointers of another process, which crash this one."""
    folder = tmp_path / "motion"
    run("plane", folder)
    scene, states = flying_in_a_plane()[1], folder / "instants.npy"
    whole = states.read_bytes()
    for kind in (b"'|O'", b"'<U2'", b"'>f8'"):
        states.write_bytes(whole.replace(b"'<f8'", kind.ljust(5), 1))
        with pytest.raises(cf.SceneError, match="other columns than those of saved states|is damaged"):
            cf.read_history(folder, scene)


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
        "rods is '2 items'": cf.Scene([rod, cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), rod.section)], loads=scene.loads),
        "rods[0].curve.end is [0.0, 8.0, 1.0]": cf.Scene([longer]),
        "rods[0].section.bending is [500.0, 400.0]": cf.Scene([softer]),
        "rods[0].damping is": cf.Scene([damped]),
        "loads is '1 items'": cf.Scene([rod], loads=scene.loads[:1]),
        "loads[0].force.value is": cf.Scene(
            [rod], loads=[cf.Force(rod.start, cf.signals.Triangle((10, 0, 0), 0, 2.5, 5)), scene.loads[1]]
        ),
        "loads[0].station.s is 10.0": cf.Scene(
            [rod], loads=[cf.Force(rod.end, cf.signals.Triangle((20, 0, 0), 0, 2.5, 5)), scene.loads[1]]
        ),
        "supports is '1 items'": cf.Scene([rod], [cf.Pin(rod.start)], scene.loads),
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
    with pytest.raises(
        cf.SceneError, match=r"resume.scene = None: expected the scene of .* a function written in Python cannot be"
    ):
        cf.resume(folder)
    with pytest.raises(cf.SceneError, match=r"resume.scene = 3: expected a Scene"):
        cf.resume(folder, 3)
    with pytest.raises(cf.SceneError, match=r"resume.duration = 1: expected None or at least 3 s"):
        cf.resume(folder, scene, duration=1)
    with pytest.raises(cf.SceneError, match=r"simulate.folder = .*: it holds a motion already"):
        run("plane", folder)
    head = {**files.unsealed((folder / "stored.json").read_bytes()), "ranks": 2}
    (folder / "stored.json").write_bytes(files.sealed(head))
    with pytest.raises(cf.SceneError, match=r"computed by 2 rank\(s\), and here are 1"):
        cf.resume(folder, scene)


SECTION = cf.Stiffness((5e3, 5e3), 1e4, (50, 50), 40, mass=1.0, inertia=(0.01, 0.01, 0.02))
ROD = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), SECTION, name="rod")
HELD = [cf.Clamp(ROD.start)]
BEGUN = {"dt": 0.05, "elements": 1, "degree": 2}


def pushed(force):
    return cf.Scene([ROD], HELD, [cf.Force(ROD.end, force)])


def test_a_scene_that_changes_after_the_first_duration_is_another(tmp_path):
    """Scenes are compared over the longest duration requested so far, the present one included."""
    folder = tmp_path / "motion"
    first = pushed(lambda t: (0, 5.0, 0))
    cf.simulate(first, 1.0, folder=folder, **BEGUN)
    head = (folder / "stored.json").read_text()
    changes = {2.0: 1.0, 2.9: 2.5}
    for until, since in changes.items():
        other = pushed(lambda t, since=since: (0, 5.0 if t <= since else 50.0, 0))
        with pytest.raises(
            cf.SceneError, match=r"force at t = .* s is \[0.0, 50.0, 0.0\], where the motion has \[0.0, 5.0, 0.0\]"
        ):
            cf.resume(folder, other, duration=until)
        assert cf.resume(folder, other).times[-1] < until  # the same motion so far
        assert (folder / "stored.json").read_text() == head
        assert cf.resume(folder, first, duration=until).times[-1] == until
        with pytest.raises(cf.SceneError, match="the scene is not the one of the motion"):
            cf.resume(folder, other)
        head = (folder / "stored.json").read_text()


def test_what_differs_is_told_where_it_differs_most(tmp_path):
    """Not at half the duration, where the sine is zero up to rounding."""
    folder = tmp_path / "motion"
    cf.simulate(pushed(lambda t: (0, 5 * math.sin(4 * math.pi * t), 0)), 1.0, folder=folder, **BEGUN)
    with pytest.raises(cf.SceneError) as refusal:
        cf.resume(folder, pushed(lambda t: (0, 6 * math.sin(4 * math.pi * t), 0)))
    told, expected = (float(part.split(", ")[1]) for part in str(refusal.value).split("[")[-2:])
    assert told / expected == pytest.approx(1.2) and abs(told - expected) > 0.9
    assert len(cf.resume(folder, pushed(lambda t: (0, 5 * math.sin(4 * math.pi * t * (1 + 1e-12)), 0)))) == 21


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


LATE = {
    "load": pushed(lambda t: (0, 1.0, 0 if t < 2 else 5.0)),
    "motion": cf.Scene([ROD], [cf.Prescribed(ROD.start, lambda t: (0, 0.01 * t**2, max(0, t - 2) ** 3), (0, 0, 0))]),
    "plane": cf.Scene([ROD], HELD, [cf.Force(ROD.end, lambda t: (0, 0, 0 if t < 2 else 5.0))]),
}


@pytest.mark.parametrize("case", LATE)
def test_what_leaves_its_plane_later_is_refused_before_anything_is_written(tmp_path, case):
    folder = tmp_path / "motion"
    assert cf.simulate(LATE[case], 1.0, folder=folder, **BEGUN).model == "planar"
    before = contents(folder)
    with pytest.raises(
        cf.SceneError, match=r"resume.duration = 3: .* was computed in the x-y plane, and until then"
    ) as refusal:
        cf.resume(folder, LATE[case], duration=3.0)
    assert "a motion in space, by another simulate" in str(refusal.value) and "velocities" not in str(refusal.value)
    assert contents(folder) == before
    assert cf.resume(folder, LATE[case], duration=1.5).times[-1] == 1.5


def test_a_longer_duration_that_is_refused_leaves_no_trace(tmp_path):
    """A support that jumps later; too many steps."""
    folder = tmp_path / "motion"
    scene = cf.Scene([ROD], [cf.Prescribed(ROD.start, cf.signals.Step((0, 0.1, 0), 2.0), (0, 0, 0))])
    cf.simulate(scene, 1.0, folder=folder, **BEGUN)
    before = (folder / "stored.json").read_bytes()
    for until, words in ((3.0, "displacement jumps at t = 2 s, by 0.1 m"), (1e12, "expected at most 1e.09 steps")):
        with pytest.raises(cf.SceneError, match=words):
            cf.resume(folder, scene, duration=until)
    assert (folder / "stored.json").read_bytes() == before
