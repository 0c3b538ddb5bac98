"""Folders of motions, strings, studies and sweeps: gone on with to the same digits, or refused in words."""

import errno
import gc
import json
import math
import os
import random
import shutil
import signal
import warnings

import numpy as np
import pytest
from ended_motions import CASES, SMALL, Stopped, assert_same, part_of, rows, run, stop_at
from fake_string import scene
from fake_string import use as use_pendulum
from moving_scenes import flying_in_a_plane, flying_in_space
from stored_users import USERS, at_write, copy, die, full, in_a_child, interrupt, mutated, use, written
from test_schemes import everything

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling import motion as drilling_loop
from cosserat_fenicsx.dynamics import time_loop
from cosserat_fenicsx.dynamics.schemes import SCHEMES
from cosserat_fenicsx.results.records import Instant
from cosserat_fenicsx.storage import files
from cosserat_fenicsx.storage.store import Store, holds, resume

pytestmark = pytest.mark.serial
MOTIONS = ("rods", "string")


@pytest.fixture(params=USERS)
def user(request, monkeypatch):
    use(monkeypatch)
    return USERS[request.param]


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Of every user: the folder of a whole run, of one that was ended in the middle, and of another computation; the
    digits of the whole one, and the number of its writes."""
    place, found = tmp_path_factory.mktemp("kept"), {}
    with pytest.MonkeyPatch.context() as patch:
        use(patch)
        for user in USERS.values():
            folders = {name: place / f"{user.call} {name}" for name in ("whole", "part", "other")}
            with pytest.MonkeyPatch.context() as inner:
                writes = at_write(inner, -1, die)
                digits = user.digits(user.begin(folders["whole"]))
            with pytest.MonkeyPatch.context() as inner, pytest.raises(cf.Interrupted):
                at_write(inner, len(writes) // 2, interrupt)
                user.begin(folders["part"])
            user.other(folders["other"])
            found[user.call] = {**folders, "digits": digits, "writes": len(writes)}
    return found


def quietly(action, *given):
    """What an action returns, and the warnings."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", cf.SceneWarning)
        return action(*given), [str(x.message) for x in said]


@pytest.mark.parametrize("moment", [0.0, 0.03, 0.2, 0.45, 0.71, 0.99])
def test_kill_9_at_any_write(moment, user, kept, tmp_path, monkeypatch):
    """It goes on to the same digits; before there is anything to go on with, the same call begins anew."""
    number = int(moment * kept[user.call]["writes"])
    with pytest.MonkeyPatch.context() as patch:
        at_write(patch, number, die)
        assert in_a_child(lambda: user.begin(tmp_path / "killed")) == signal.SIGKILL
    begun = holds(tmp_path / "killed") and (user.call not in ("simulate", "drilling.simulate") or
                                            (tmp_path / "killed" / "start.npz").exists())  # fmt: skip
    found, said = quietly(user.go_on if begun else user.begin, tmp_path / "killed")
    assert user.digits(found) == kept[user.call]["digits"]
    assert not any("damaged" in text for text in said)
    assert quietly(user.read, tmp_path / "killed")[1] == []


@pytest.mark.parametrize("moment", [0.1, 0.5, 0.8])
def test_ctrl_c_keeps_what_is_done(moment, user, kept, tmp_path):
    with pytest.MonkeyPatch.context() as patch, pytest.raises(cf.Interrupted, match="resume|the same call") as stop:
        at_write(patch, max(2, int(moment * kept[user.call]["writes"])), interrupt)
        user.begin(tmp_path / "one")
    assert len(stop.value.path) < len(user.read(kept[user.call]["whole"]))
    assert user.digits(user.go_on(tmp_path / "one")) == kept[user.call]["digits"]


@pytest.mark.parametrize("moment", [0.2, 0.8])
def test_a_full_disk_is_said_and_costs_nothing(moment, user, kept, tmp_path):
    said = r"cannot be written: No space left on device. Make room; \d+ (time|case|answer)s? of the .* are kept there,"
    with pytest.MonkeyPatch.context() as patch, pytest.raises(cf.NotStored, match=said) as stop:
        at_write(patch, int(moment * kept[user.call]["writes"]), full)
        user.begin(tmp_path / "one")
    assert len(stop.value.path) < len(user.read(kept[user.call]["whole"]))
    assert user.digits(user.go_on(tmp_path / "one")) == kept[user.call]["digits"]


def test_two_writers_are_refused(user, kept, tmp_path):
    folder = copy(kept[user.call]["part"], tmp_path / "one")
    busy = Store(folder, None).open()
    busy.hold()
    before = written(folder)
    with pytest.raises(cf.SceneError, match=f"another process is at work on this {user.what}: expected it to end"):
        user.go_on(folder)
    assert written(folder) == before
    busy.release()
    assert user.digits(user.go_on(folder)) == kept[user.call]["digits"]


def test_a_whole_one_is_read_and_gone_on_with_at_once(user, kept, tmp_path):
    folder = copy(kept[user.call]["whole"], tmp_path / "one")
    assert holds(folder) == user.what
    for action in (user.read, user.go_on):
        assert user.digits(action(folder)) == kept[user.call]["digits"]


def test_another_one_is_refused(user, kept, tmp_path):
    for other in USERS.values():
        folder = copy(kept[other.call]["whole"], tmp_path / "one")
        before = written(folder)
        with pytest.raises(cf.SceneError, match="already|and so another computation|it holds another") as refusal:
            (user.other if user is other else user.begin)(folder)
        assert written(folder) == before and str(folder) in str(refusal.value)


HEADS = [f"{name}.json" for name in ("stored", "motion", "drilling", "study")]
OWN = [(name, text) for name in HEADS for text in ("", "mine", '{"speed": 3}')]
OWN += [(name, "mine") for name in ("start.npz", "checkpoint.npz", "rows.0.jsonl", "instants.npy", "series.npy")]


@pytest.mark.parametrize(("name", "text"), OWN)
def test_files_of_the_users_own_stay_as_they_are(name, text, user, kept, tmp_path):
    (tmp_path / name).write_text(text)
    tables = {"simulate": ["instants.npy"], "drilling.simulate": ["series.npy"]}.get(user.call, [])
    ours = [*tables, *(["start.npz", "checkpoint.npz"] if tables else []), "rows.0.jsonl"]
    if name in HEADS or name in ours:
        with pytest.raises(cf.SceneError, match=name):
            user.begin(tmp_path)
        assert written(tmp_path) == {name: text.encode()}
    else:
        user.begin(tmp_path)
        assert (tmp_path / name).read_text() == text


def test_other_formats_are_refused_in_words(user, kept, tmp_path):
    folder = copy(kept[user.call]["part"], tmp_path / "one")
    head = {**files.unsealed((folder / "stored.json").read_bytes()), "format": 99}
    (folder / "stored.json").write_bytes(files.sealed(head))
    with pytest.raises(cf.SceneError, match="its format is 99: expected 6, that of this release"):
        user.go_on(folder)
    (folder / "stored.json").write_text(json.dumps(head))
    with pytest.raises(cf.SceneError, match="stored.json is damaged"):
        user.go_on(folder)
    (folder / "stored.json").rename(folder / "motion.json")
    with pytest.raises(cf.SceneError, match="by an earlier release, in another format|it holds motion.json"):
        user.go_on(folder)


@pytest.mark.parametrize(("place", "words"), [
    ("file", "expected a folder that can be written to"), (3, "expected the name of a folder"),
])  # fmt: skip
def test_places_that_are_no_folders(place, words, user, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(cf.SceneError, match=words):
        user.begin(place if place == 3 else tmp_path / place)
    with pytest.raises(cf.SceneError, match="no motion was found there|expected the name"):
        resume(tmp_path / "none")


@pytest.mark.parametrize("name", USERS)
def test_damaged_folders(name, kept, tmp_path, monkeypatch, request):
    """An error in words, or the same digits; what is read is what was stored, or an error in words."""
    use(monkeypatch)
    user, chance, refused = USERS[name], random.Random(name), 0
    told, count = kept[user.call], request.config.getoption("--mutations")
    for _ in range(count):
        folder = copy(told[chance.choice(("part", "part", "whole"))], tmp_path / "copy")
        sound = copy(folder, tmp_path / "sound")
        what = mutated(folder, chance, told["other"])
        try:
            if name in MOTIONS:
                found, expected = (user.digits(quietly(user.read, x)[0]) for x in (folder, sound))
                assert found == expected or "start.npz" in what or not written(folder) == written(sound), what
            found, said = quietly(user.go_on, folder)
            assert user.digits(found) == told["digits"], what
        except cf.SceneError as words:
            refused += 1
            assert len(str(words)) > 20, what
    assert 0 < refused < count


@pytest.mark.parametrize("user", ["study", "sweep"])
@pytest.mark.parametrize("change", ["changed", "of another case", "no row", "nested"])
def test_lines_that_were_changed_are_computed_again(change, user, kept, tmp_path, monkeypatch):
    user = USERS[user]
    folder = copy(kept[user.call]["whole"], tmp_path / "one")
    file, seed = folder / "rows.0.jsonl", files.unsealed((folder / "stored.json").read_bytes())["seed"]
    lines = file.read_bytes().splitlines(keepends=True)
    other = (kept[user.call]["other"] / "rows.0.jsonl").read_bytes().splitlines(keepends=True)
    lines[1] = {
        "changed": lines[1].replace(b"1", b"7", 1), "of another case": other[1], "no row": files.sealed({"a": 1}, seed),
        "nested": b"[" * 100_000 + b"\n",
    }[change]  # fmt: skip
    file.write_bytes(b"".join(lines))
    found, said = quietly(user.go_on, folder)
    assert user.digits(found) == kept[user.call]["digits"]
    assert len(said) == 1 and "rows.0.jsonl, line 2: " in said[0] and "left out, and computed again" in said[0]
    assert quietly(user.go_on, folder)[1] == []
    lines = file.read_bytes().splitlines(keepends=True)
    for row in ({"case": 99, "operation": 9}, {"case": -1, "operation": -1}, {"case": "a", "operation": [1]}):
        changed = {**files.unsealed(lines[0], seed), **row}
        file.write_bytes(b"".join([files.sealed(changed, seed), *lines[1:]]))
        found, said = quietly(user.go_on, folder)
        assert user.digits(found) == kept[user.call]["digits"] and "line 1: " in said[0]


PARTS = ("stepper", "schemes", "step_problem", "contact", "pace")
SOLVERS = tuple(f"cosserat_fenicsx.dynamics.{name}" for name in PARTS)


@pytest.mark.parametrize(("case", "apart"), [*((case, 0.02) for case in CASES), ("fixed", 0.0), ("adaptive", 1e9)])
def test_it_goes_on_to_the_same_digits(case, apart, tmp_path, monkeypatch, never_ended):
    """With some checkpoints, one at every step, and one at the start alone."""
    scene = part_of(case, tmp_path / "part", monkeypatch, step=25, apart=apart)
    before, seen = rows(tmp_path / "part").copy(), cf.read_history(tmp_path / "part", scene)
    cf.simulate(scene, 0.05, dt=0.05, **SMALL)  # the pooled solver now has another tangent
    history = cf.resume(tmp_path / "part", scene)
    assert_same(tmp_path / "part", never_ended(case))
    assert 0 < len(before) == len(seen) < len(history)  # a history read before does not grow
    assert rows(tmp_path / "part")[: len(before)].tobytes() == before.tobytes()
    assert history.times[-1] == CASES[case][1] and history.why == cf.read_history(never_ended(case), scene).why


@pytest.mark.parametrize("scheme", SCHEMES)
def test_everything_that_steps_depend_on_is_remembered(scheme, tmp_path, monkeypatch):
    """A smooth motion, where tangents are reused for many steps: all
    numbers in the solvers are those of an uninterrupted run."""
    section = cf.Stiffness((1e6, 1e6), 1e6, (1e3, 1e3), 1e3, mass=1.0, inertia=(1, 1, 2))
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, cf.signals.Sine((0, 0, 3.0), 0.05))])
    write, over, kept, motions = files.write_checkpoint, time_loop.TimeLoop.over, [], []

    def write_and_keep(file, *given):
        write(file, *given)
        kept.append(file.read_bytes())

    def over_and_keep(self, *more):
        motions.append(self)
        return over(self, *more)

    monkeypatch.setattr(time_loop.TimeLoop, "over", over_and_keep)
    monkeypatch.setattr(files, "write_checkpoint", write_and_keep)
    monkeypatch.setattr(Store, "APART", 0.0)
    monkeypatch.setattr(Store, "SELDOM", 0)
    asked = {"dt": 0.02, "scheme": scheme, "elements": 24, "degree": 2}
    cf.simulate(scene, 0.8, folder=tmp_path / "whole", **asked)
    expected = numbers_held(motions[-1])
    monkeypatch.setattr(files, "write_checkpoint", write)
    for k in (20, 30, 36, 38, 39):
        shutil.copytree(tmp_path / "whole", tmp_path / f"from {k}")
        (tmp_path / f"from {k}" / "checkpoint.npz").write_bytes(kept[k])
        cf.simulate(scene, 0.1, **asked)
        cf.resume(tmp_path / f"from {k}", scene)
        assert numbers_held(motions[-1]) == expected
        assert_same(tmp_path / f"from {k}", tmp_path / "whole")


def numbers_held(thing, before=""):
    """All numbers in the solvers of a motion, by attribute names."""
    found = {}
    for name, value in vars(thing).items():
        if isinstance(value, bool | int | float):
            found[before + name] = value
        elif hasattr(value, "__dict__") and type(value).__module__.startswith(SOLVERS):
            if name != "problem" or not before:
                found |= numbers_held(value, f"{before}{name}.")
    return found


def test_a_stored_history_answers_as_one_in_memory(tmp_path):
    rod, scene = everything()
    stored = cf.simulate(scene, 0.2, dt=0.01, folder=tmp_path / "motion", **SMALL)
    kept, again = cf.simulate(scene, 0.2, dt=0.01, **SMALL), cf.read_history(tmp_path / "motion")
    twin = next(x for x in again.scene.rods if x.name == rod.name)
    for history, same in ((stored, rod), (again, twin)):
        assert repr(history) == repr(kept)
        for name in ("times", "steps", "iterations", "kinetic", "strain", "energy", "work", "dissipated", "balance",
                     "linear_momentum", "angular_momentum", "along_axis"):  # fmt: skip
            assert (getattr(history, name) == getattr(kept, name)).all(), name
        for name in ("position", "displacement", "rotation", "rotation_angle", "force", "moment", "velocity",
                     "angular_velocity"):  # fmt: skip
            assert (getattr(history, name)(same.at(0.7)) == getattr(kept, name)(rod.at(0.7))).all(), name
        for name, values in kept.fields(7, rod).items():
            assert (history.fields(7, same)[name] == values).all(), name
    assert (stored.largest_displacement() == kept.largest_displacement()).all()
    assert (stored.at_points([3, 5]).position(rod.end) == kept.position(rod.end)[[3, 5]]).all()
    for history, name in ((kept, "kept"), (again, "again")):
        history.write(tmp_path / f"{name}.xdmf")
    assert (tmp_path / "kept.xdmf").read_text().replace("kept", "again") == (tmp_path / "again.xdmf").read_text()
    again.plot_energy(tmp_path / "energy.png")
    assert (tmp_path / "energy.png").stat().st_size > 10000


def test_none_of_its_states_stays_in_memory(tmp_path):
    def instants():
        gc.collect()
        return sum(type(x) is Instant for x in gc.get_objects())

    before = instants()
    history = run("adaptive", tmp_path / "motion")
    assert len(history) > 30 and instants() <= before
    history.position(history.scene.rods[0].end)
    assert instants() <= before and isinstance(history._all_rq, np.memmap)


def test_a_checkpoint_that_cannot_be_written_leaves_the_one_before(tmp_path, monkeypatch, never_ended):
    replace, done = os.replace, []

    def full(source, target):
        done.append(target)
        if len(done) > 5:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(source, target)

    monkeypatch.setattr(os, "replace", full)
    monkeypatch.setattr(Store, "APART", 0.0)
    monkeypatch.setattr(Store, "SELDOM", 0)
    with pytest.raises(cf.NotStored, match="No space left on device"):
        run("fixed", tmp_path / "part")
    monkeypatch.setattr(os, "replace", replace)
    assert sorted(x.name for x in (tmp_path / "part").iterdir()) == sorted(
        x.name for x in never_ended("fixed").iterdir()
    )
    cf.resume(tmp_path / "part")
    assert_same(tmp_path / "part", never_ended("fixed"))


def test_a_complete_motion_stays_as_it_is_and_may_be_prolonged(tmp_path, monkeypatch, never_ended):
    """Steps of 0.05 s: the extended motion equals one of that duration from the start. By the default tolerance too."""
    scene = flying_in_space()[1]
    short = cf.simulate(scene, 2, dt=0.05, folder=tmp_path / "short", **SMALL)
    stamps = {file.name: file.stat().st_mtime_ns for file in (tmp_path / "short").iterdir()}
    again = cf.resume(tmp_path / "short")
    assert repr(again) == repr(short) and (again.energy == short.energy).all()
    assert {file.name: file.stat().st_mtime_ns for file in (tmp_path / "short").iterdir()} == stamps
    free = cf.simulate(scene, 0.02, folder=tmp_path / "free", elements=1, degree=2)
    assert (cf.read_history(tmp_path / "free").times == free.times).all()
    assert cf.resume(tmp_path / "free", duration=0.04).times[-1] == 0.04
    stop_at(monkeypatch, 20, 0.0)
    with pytest.raises(Stopped):
        cf.resume(tmp_path / "short", duration=5)
    longer, whole = cf.resume(tmp_path / "short"), cf.read_history(never_ended("fixed"))
    np.testing.assert_allclose(longer.times, whole.times, rtol=1e-14)
    np.testing.assert_allclose(longer._all_rq, whole._all_rq, atol=1e-11)
    with pytest.raises(cf.SceneError, match="at least 5 s"):
        cf.resume(tmp_path / "short", duration=3)


def test_a_lost_motion_keeps_what_is_done(tmp_path):
    rod, _ = flying_in_space()
    torn = cf.Scene([rod], loads=[cf.Force(rod.end, cf.signals.Step((1e9, 0, 0), start=0.2))])
    with pytest.raises(cf.NotConverged) as lost:
        cf.simulate(torn, 1, dt=0.05, folder=tmp_path / "torn", **SMALL)
    times = lost.value.path.times
    with pytest.raises(cf.NotConverged) as again:
        cf.resume(tmp_path / "torn")
    assert 0.2 < times[-1] < 1 and (again.value.path.times == times).all()


def test_damaged_files(tmp_path, monkeypatch, never_ended):
    """A truncated file of states or a missing checkpoint only costs time; the message says what was lost. Objects in a
    file of states would be pointers of another process, which crash this one."""
    folder = tmp_path / "part"
    part_of("fixed", folder, monkeypatch, apart=1e9)
    states, point = folder / "instants.npy", folder / "checkpoint.npz"
    whole, kept = states.read_bytes(), point.read_bytes()
    lost = whole[: -rows(folder).dtype.itemsize * 3 // 2]
    for left, checkpoint in ((lost, kept), (whole, b""), (whole, b"nonsense"), (whole, kept[:-100]), (None, kept)):
        states.unlink() if left is None else states.write_bytes(left)
        point.write_bytes(checkpoint)
        assert left != lost or 0 < len(cf.read_history(folder)) < 30
        cf.resume(folder)
        assert_same(folder, never_ended("fixed"))
    whole = states.read_bytes()
    for damaged in (
        b"nonsense" + whole[8:],
        *(whole.replace(b"'<f8'", kind.ljust(5), 1) for kind in (b"'|O'", b"'<U2'", b"'>f8'")),
    ):
        states.write_bytes(damaged)
        with pytest.raises(cf.SceneError, match="other columns than those of saved states|instants.npy is damaged"):
            cf.read_history(folder)
    for name in ("instants.npy", "checkpoint.npz", "start.npz"):
        (folder / name).unlink()
    with pytest.raises(cf.SceneError, match="no checkpoint can be read"):
        cf.resume(folder, flying_in_space()[1])


def test_a_table_is_cut(tmp_path):
    table = files.Table(tmp_path / "rows.npy", _any_row)
    table.put(np.arange(10.0).reshape(5, 2))
    table.cut(3)
    np.testing.assert_array_equal(table.rows, np.arange(6.0).reshape(3, 2))
    table.put(np.full((1, 2), 7.0))
    assert np.load(table.file)[:, 1].tolist() == [1, 3, 5, 7]


def _any_row(dtype, shape):
    return True


def test_another_scene_is_told_from_the_one_of_the_motion(tmp_path, monkeypatch):
    rod, scene = flying_in_space()
    part_of("fixed", tmp_path / "motion", monkeypatch)

    def changed(curve=rod.curve, section=rod.section, **more):
        return cf.Scene([cf.Rod(curve, section, name=rod.name, **more)])

    def pushed(station, *size):
        return cf.Scene([rod], loads=[cf.Force(station, cf.signals.Triangle(size, 0, 2.5, 5)), scene.loads[1]])

    soft = cf.Stiffness((1e4, 1e4), 1e4, (500, 400), 500, mass=1.0, inertia=(10, 10, 20))
    for words, other in {
        "rods is '2 items'": cf.Scene([rod, cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), rod.section)], loads=scene.loads),
        "rods[0].curve.end is [0.0, 8.0, 1.0]": changed(cf.Line((6, 0, 0), (0, 8, 1))),
        "rods[0].section.bending is [500.0, 400.0]": changed(section=soft),
        "rods[0].damping is": changed(damping=cf.Damping(drag=1.0)),
        "loads is '1 items'": cf.Scene([rod], loads=scene.loads[:1]),
        "loads[0].force.value is": pushed(rod.start, 10, 0, 0),
        "loads[0].station.s is 10.0": pushed(rod.end, 20, 0, 0),
        "supports is '1 items'": cf.Scene([rod], [cf.Pin(rod.start)], scene.loads),
    }.items():
        with pytest.raises(cf.SceneError, match="the scene is not the one of the motion") as refusal:
            cf.resume(tmp_path / "motion", other)
        assert words in str(refusal.value)


def test_what_cannot_be_done_is_said(tmp_path, monkeypatch):
    folder, scene = tmp_path / "motion", flying_in_a_plane()[1]

    def refused(words, call, *given, **more):
        with pytest.raises(cf.SceneError, match=words):
            call(*given, **more)

    refused("no motion was found there .*: expected a folder that simulate", cf.resume, folder)
    part_of("plane", folder, monkeypatch)
    refused("resume.scene = None: expected the scene of .* a function written in Python cannot be", cf.resume, folder)
    refused("resume.scene = 3: expected a Scene", cf.resume, folder, 3)
    refused("resume.duration = 1: expected None or at least 3 s", cf.resume, folder, scene, duration=1)
    refused("simulate.folder = .*: it holds a motion already", run, "plane", folder)
    head = {**files.unsealed((folder / "stored.json").read_bytes()), "ranks": 2}
    (folder / "stored.json").write_bytes(files.sealed(head))
    refused(r"computed by 2 rank\(s\), and here are 1", cf.resume, folder, scene)


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


LATE = {
    "load": pushed(lambda t: (0, 1.0, 0 if t < 2 else 5.0)),
    "motion": cf.Scene([ROD], [cf.Prescribed(ROD.start, lambda t: (0, 0.01 * t**2, max(0, t - 2) ** 3), (0, 0, 0))]),
    "plane": cf.Scene([ROD], HELD, [cf.Force(ROD.end, lambda t: (0, 0, 0 if t < 2 else 5.0))]),
}


@pytest.mark.parametrize("case", LATE)
def test_what_leaves_its_plane_later_is_refused_before_anything_is_written(tmp_path, case):
    folder = tmp_path / "motion"
    assert cf.simulate(LATE[case], 1.0, folder=folder, **BEGUN).model == "planar"
    before = written(folder)
    with pytest.raises(
        cf.SceneError, match=r"resume.duration = 3: .* was computed in the x-y plane, and until then"
    ) as refusal:
        cf.resume(folder, LATE[case], duration=3.0)
    assert "a motion in space, by another simulate" in str(refusal.value) and "velocities" not in str(refusal.value)
    assert written(folder) == before
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


def test_functions_of_time_are_compared_by_their_values(tmp_path, monkeypatch):
    use_pendulum(monkeypatch)

    def moving(factor):
        return scene(drive=cf.drilling.TopDrive(lambda t: factor * min(t, 5.0)))

    cf.drilling.simulate(moving(1.0), 2.0, folder=tmp_path / "one")
    for given, words in (((), "expected the scene of .* a function written in Python cannot be stored"),
                         ((moving(1.001),), r"drive.speed at t = .* s is .*, where the motion has")):  # fmt: skip
        with pytest.raises(cf.SceneError, match=words):
            cf.resume(tmp_path / "one", *given)
    assert len(cf.resume(tmp_path / "one", moving(1.0), duration=3.0)) == 300


def test_checkpoints_are_seldom(tmp_path, monkeypatch):
    """A fiftieth of the time at most, and not more often than the limit."""
    use_pendulum(monkeypatch)
    written, write = [], files.write_checkpoint
    monkeypatch.setattr(files, "write_checkpoint", lambda *args: (written.append(1), write(*args)))
    monkeypatch.setattr(drilling_loop, "CHUNK", 10)
    cf.drilling.simulate(scene(), 10.0, folder=tmp_path / "one")
    assert len(written) == 3  # at the start, which is kept twice, and at the end
