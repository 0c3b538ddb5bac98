"""Folders whose data were changed: what was changed is noticed, and computed again or refused in words."""

import json
import shutil
import warnings

import numpy as np
import pytest
from ended_motions import assert_same, part_of, rows
from fake_string import scene, use

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling import folder as drilling_folder
from cosserat_fenicsx.drilling.history import COLUMNS
from cosserat_fenicsx.storage import checkpoints

pytestmark = pytest.mark.serial
AGAIN = "the motion is (computed|continued) from its start"


def members(file):
    with np.load(file) as stored:
        return {name: stored[name] for name in stored.files}


def rewritten(file, **changes):
    """Change members of a checkpoint, and leave its checksum as it was; None removes one."""
    data = {**members(file), **changes}
    np.savez(file, **{name: value for name, value in data.items() if value is not None})


def with_its_checksum(file, change):
    """Change the dict of a checkpoint, and give it the checksum that belongs to it."""
    memory = checkpoints.read(file)
    memory.pop(checkpoints.CHECKSUM)
    change(memory)
    checkpoints.write(file, memory)


def changed_byte(file, place):
    data = bytearray(file.read_bytes())
    data[place] ^= 16
    file.write_bytes(data)


# -- drill-strings in motion -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def strings(tmp_path_factory):
    """The folders of a motion of 5 s, and of the same for 10 s."""
    folder = tmp_path_factory.mktemp("strings")
    with pytest.MonkeyPatch.context() as patch:
        use(patch)
        for name, duration in (("part", 5.0), ("whole", 10.0)):
            cf.simulate_drilling(scene(), duration, folder=folder / name, profile_every=0.5, progress=False)
    return folder


def bytes_of(folder):
    return [(folder / name).read_bytes() for name in ("series.f64", "profiles.f64")]


def memory_of(name, value):
    """A change of what the model remembers: an entry of another value, or removed."""

    def change(memory):
        memory["model"].pop(name)
        if value is not None:
            memory["model"][name] = value

    return lambda folder: with_its_checksum(folder / "checkpoint.npz", change)


def top_of(name, value):
    def change(memory):
        memory.pop(name)
        if value is not None:
            memory[name] = value

    return lambda folder: with_its_checksum(folder / "checkpoint.npz", change)


CHANGES = {
    "a number of the checkpoint": lambda folder: rewritten(folder / "checkpoint.npz", **{"model/speed": np.array(3.0)}),
    "a number of the rows in it": lambda folder: rewritten(folder / "checkpoint.npz", rows=np.array(7)),
    "its checksum": lambda folder: rewritten(folder / "checkpoint.npz", crc32=np.array(5)),
    "a number of the series": lambda folder: changed_byte(folder / "series.f64", 1001),
    "a number of the profiles": lambda folder: changed_byte(folder / "profiles.f64", 77),
    "rows missing": lambda folder: (folder / "series.f64").write_bytes((folder / "series.f64").read_bytes()[:1000]),
    "model missing": top_of("model", None),
    "model a number": top_of("model", 3.0),
    "rows missing in the checkpoint": top_of("rows", None),
    "rows negative": top_of("rows", -1),
    "rows a text": top_of("rows", "many"),
    "rows an array": top_of("rows", np.arange(3)),
    "profiles 0.5": top_of("profiles", 0.5),
    "sums missing": top_of("sums", None),
    "sums a number": top_of("sums", 1),
    "sums of arrays": top_of("sums", {"series.f64": np.zeros(3), "profiles.f64": np.zeros(3)}),
    "speed missing": memory_of("speed", None),
    "speed a text": memory_of("speed", "fast"),
    "speed an array": memory_of("speed", np.zeros(3)),
    "speed a dict": memory_of("speed", {"a": 1}),
    "delayed of another length of one": memory_of("delayed", np.zeros(1)),
    "delayed of three": memory_of("delayed", np.zeros(3)),
    "delayed missing": memory_of("delayed", None),
    "delayed a number": memory_of("delayed", 0.0),
    "delayed of texts": memory_of("delayed", np.array(["a"] * 10)),
    "counts a number": memory_of("counts", 1),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_string_goes_on_to_the_same_digits(change, strings, tmp_path, monkeypatch):
    use(monkeypatch)
    folder = shutil.copytree(strings / "part", tmp_path / "copy")
    CHANGES[change](folder)
    if change.startswith("a number of the") and "checkpoint" not in change and "in it" not in change:
        with pytest.raises(
            cf.SceneError, match="its numbers are not those that were written.*resume_drilling computes"
        ):
            cf.read_drilling(folder)
    with pytest.warns(cf.SceneWarning, match=AGAIN):
        cf.resume_drilling(folder, duration=10.0, progress=False)
    assert bytes_of(folder) == bytes_of(strings / "whole")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(cf.read_drilling(folder)) == 1000


ROW = 8 * len(COLUMNS)
UNREADABLE = {
    "a row taken out": lambda file: file.write_bytes(file.read_bytes()[:ROW] + file.read_bytes()[2 * ROW :]),
    "a byte taken out": lambda file: file.write_bytes(file.read_bytes()[:777] + file.read_bytes()[778:]),
    "zeros at the end": lambda file: file.write_bytes(file.read_bytes() + bytes(3 * ROW)),
    "the last rows again": lambda file: file.write_bytes(file.read_bytes() + file.read_bytes()[-3 * ROW :]),
    "missing": lambda file: file.unlink(),
}


@pytest.mark.parametrize("change", UNREADABLE)
def test_rows_that_are_not_those_of_the_motion_are_not_read(change, strings, tmp_path, monkeypatch):
    use(monkeypatch)
    folder = shutil.copytree(strings / "part", tmp_path / "copy")
    UNREADABLE[change](folder / "series.f64")
    with pytest.raises(cf.SceneError, match="series.f64"):
        cf.read_drilling(folder)


def test_rows_of_a_motion_that_is_being_computed_again_are_read(strings, tmp_path, monkeypatch):
    use(monkeypatch, stops_at=100)
    folder = shutil.copytree(strings / "part", tmp_path / "copy")
    changed_byte(folder / "series.f64", 1001)
    with pytest.warns(cf.SceneWarning, match=AGAIN), pytest.raises(cf.Interrupted):
        cf.resume_drilling(folder, progress=False)
    assert len(cf.read_drilling(folder)) <= 100


def test_folders_without_checksums_are_gone_on_with_in_words(strings, tmp_path, monkeypatch):
    use(monkeypatch)
    folder = shutil.copytree(strings / "part", tmp_path / "copy")
    sums = {name: None for name in members(folder / "checkpoint.npz") if name.startswith("sums/")}
    rewritten(folder / "checkpoint.npz", crc32=None, **sums)
    with pytest.warns(cf.SceneWarning, match="checkpoint.npz has no checksum, as those of earlier releases"):
        cf.resume_drilling(folder, duration=10.0, progress=False)
    assert bytes_of(folder) == bytes_of(strings / "whole")


def places(data, before=""):
    for name, value in data.items():
        yield before + name
        if isinstance(value, dict) and name != "scene":
            yield from places(value, f"{before}{name}.")


def test_drilling_json(strings, tmp_path, monkeypatch):
    """Every entry missing, or of another kind: the motion, or words."""
    use(monkeypatch)
    folder, refused = shutil.copytree(strings / "part", tmp_path / "copy"), 0
    head = json.loads((folder / "drilling.json").read_text(encoding="utf-8"))
    for place in places(head):
        *way, last = place.split(".")
        for value in ("missing", None, "deep", -1, 0.5, True, [], [1, "a"], {}, 1e308, 10**400):
            changed = json.loads(json.dumps(head))
            inner = changed
            for key in way:
                inner = inner[key]
            inner.pop(last)
            if value != "missing":
                inner[last] = value
            (folder / "drilling.json").write_text(json.dumps(changed), encoding="utf-8")
            for read in (cf.read_drilling, drilling_folder_resumed):
                try:
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore", cf.SceneWarning)
                        read(folder)
                except cf.SceneError as words:
                    refused += 1
                    assert len(str(words)) > 20
    assert refused > 150


def drilling_folder_resumed(folder):
    """What `resume_drilling` does before the first step."""
    kept = drilling_folder.DrillingFolder(folder).open()
    from cosserat_fenicsx.drilling.simulate import _running, check_arguments

    check_arguments(kept.scene(), kept.asked, kept.head["asked"]["dt"], kept.head["asked"]["elements"])
    _running(kept, kept.scene())


# -- motions of rods -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """The folder of a motion that was stopped, with a checkpoint after its start."""
    folder = tmp_path_factory.mktemp("rods") / "part"
    with pytest.MonkeyPatch.context() as patch:
        part_of("fixed", folder, patch, apart=0.0)
    assert checkpoints.read(folder / "checkpoint.npz")["states"]["rows"] > 5
    return folder


def of_rank(way, value):
    """A change of an entry of the checkpoint of rank 0, with its checksum."""

    def change(memory):
        *inner, last = way.split("/")
        place = memory
        for name in inner:
            place = place[name]
        place.pop(last)
        if value is not None:
            place[last] = value

    return lambda folder: with_its_checksum(folder / "checkpoint.npz", change)


def state_changed(folder):
    states = np.load(folder / "instants.npy", mmap_mode="r+")
    states["rq"][3, 0, 1] += 1e-9
    states.flush()


OF_RODS = {
    "a state": state_changed,
    "a number of the checkpoint": lambda folder: rewritten(folder / "checkpoint.npz", **{"0/t": np.array(0.3)}),
    "t missing": of_rank("0/t", None),
    "t a text": of_rank("0/t", "late"),
    "saved negative": of_rank("0/saved", -1),
    "saved an array": of_rank("0/saved", np.zeros(2)),
    "nodes missing": of_rank("0/nodes", None),
    "h missing": of_rank("0/h", None),
    "h a text": of_rank("0/h", "a"),
    "stepper a number": of_rank("0/stepper", 1.0),
    "newton missing": of_rank("0/stepper/newton", None),
    "x of one number": of_rank("0/stepper/problem/x", np.zeros(1)),
    "x of three numbers": of_rank("0/stepper/problem/x", np.zeros(3)),
    "books missing": of_rank("0/stepper/books", None),
    "past of texts": of_rank("0/stepper/books", np.array(["a", "b"])),
    "rank missing": of_rank("0", None),
    "rank a number": of_rank("0", 1),
    "states missing": of_rank("states", None),
    "states a number": of_rank("states", 4),
}


@pytest.mark.parametrize("change", OF_RODS)
def test_rods_go_on_to_the_same_digits(change, part, tmp_path, never_ended):
    folder = shutil.copytree(part, tmp_path / "copy")
    OF_RODS[change](folder)
    if change == "a state":
        with pytest.raises(cf.SceneError, match="saved states are not those that were written"):
            cf.read_history(folder)
    with pytest.warns(cf.SceneWarning, match=AGAIN):
        cf.resume(folder, progress=False)
    assert_same(folder, never_ended("fixed"))
    with warnings.catch_warnings():
        warnings.simplefilter("error", cf.SceneWarning)
        assert len(cf.read_history(folder)) == len(rows(never_ended("fixed")))


def test_motions_without_checksums_are_gone_on_with_in_words(part, tmp_path, never_ended):
    folder = shutil.copytree(part, tmp_path / "copy")
    for name in ("checkpoint.npz", "start.npz"):
        rewritten(folder / name, crc32=None, **{"states/rows": None, "states/crc32": None})
    with pytest.warns(cf.SceneWarning, match="checkpoint.npz has no checksum, as those of earlier releases"):
        cf.resume(folder, progress=False)
    assert_same(folder, never_ended("fixed"))


# -- studies ---------------------------------------------------------------------------------------------------------


def third(i):
    return {"third": i / 3, "array": [i, 2 * i]}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda line: line.replace(b"0.333", b"0.444"), "line 2: its checksum is that of other data"),
        (lambda line: json.dumps({**json.loads(line), "result": {"dict": 3}}).encode(), "line 2: "),
        (lambda line: line.partition(b', "crc32"')[0] + b"}", "has lines without a checksum"),
    ],
)
def test_outcomes_of_studies(change, words, tmp_path):
    cf.study(third, {"i": range(4)}, folder=tmp_path, progress=False)
    file = next(tmp_path.glob("outcomes.*.jsonl"))
    lines = file.read_bytes().splitlines()
    lines[1] = change(lines[1])
    file.write_bytes(b"\n".join(lines) + b"\n")
    with pytest.warns(cf.SceneWarning, match=words):
        found = cf.study(third, {"i": range(4)}, folder=tmp_path, progress=False)
    assert [x["third"] for x in found.results] == [0, 1 / 3, 2 / 3, 1]
