"""What every folder guarantees, whatever it holds: motions of rods and of strings, studies, sweeps.

`--mutations 200` damages as many folders of each of the four.
"""

import json
import random
import signal
import warnings

import pytest
from stored_users import USERS, at_write, copy, die, full, in_a_child, interrupt, mutated, use, written

import cosserat_fenicsx as cf
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


@pytest.mark.parametrize("name", ["stored.json", "motion.json", "drilling.json", "study.json", "start.npz",
                                  "checkpoint.npz", "rows.0.jsonl", "instants.npy", "series.npy"])  # fmt: skip
@pytest.mark.parametrize("text", ["", "mine", '{"speed": 3}'])
def test_files_of_the_users_own_stay_as_they_are(name, text, user, kept, tmp_path):
    (tmp_path / name).write_text(text)
    tables = {"simulate": ["instants.npy"], "drilling.simulate": ["series.npy"]}.get(user.call, [])
    ours = [*tables, *(["start.npz", "checkpoint.npz"] if tables else []), "rows.0.jsonl"]
    if name.endswith(".json") or name in ours:
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
    with pytest.raises(cf.SceneError, match="its format is 99: expected 4, that of this release"):
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
