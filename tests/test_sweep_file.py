"""The file of a sweep over depths: of which sweep it is, and lines that somebody has changed."""

import json
import warnings
import zlib
from dataclasses import dataclass

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.storage.rows import line_of
from cosserat_fenicsx.well import depth_sweep as module

pytestmark = pytest.mark.serial
PATH = cf.WellPath.from_survey([0, 500, 1000], [0, 0, 30], [0, 0, 0])
PIPE = cf.DrillPipe(size="5 in 19.50 lb/ft")
DEPTHS = [600.0, 800.0, 1000.0]


def hole(**given):
    return cf.Borehole(PATH, cf.HoleSection(1000.0, 0.2159, 0.2), **given)


def sweep(file, **given):
    given = {"hole": hole(), "string": cf.DrillString([PIPE]), "mud": cf.Mud(1200.0), "model": "soft", **given}
    return cf.depth_sweep(operations=[cf.TripOut()], depths=DEPTHS, file=file, progress=False, **given)


def test_every_part_of_the_hole_is_compared(tmp_path):
    """Also what only the rod depends on: hook loads by two stiffnesses of the wall differ by 1 %."""
    file = tmp_path / "sweep.jsonl"
    sweep(file, hole=hole(wall_stiffness=1e10))
    with pytest.raises(cf.SceneError, match=r"holds another sweep \(hole differs\)"):
        sweep(file, hole=hole(wall_stiffness=1e5))
    for name, other in {
        "string": cf.DrillString([cf.Collar(50.0, "NC46-65"), PIPE]), "mud": cf.Mud(1201.0), "friction": [0.3],
        "torque_convention": "fixed",
    }.items():  # fmt: skip
        given = {"hole": hole(wall_stiffness=1e10), name: other}
        with pytest.raises(cf.SceneError, match="holds another sweep|torque_convention") as refusal:
            sweep(file, **given)
        assert name in str(refusal.value)
    assert (sweep(file, hole=hole(wall_stiffness=1e10)).hook_load == sweep(None).hook_load).all()


@dataclass(frozen=True)
class Own(cf.Component):
    """A component of the user's own, with a field that the package does not know."""

    maker: str = ""


def test_components_of_the_users_own_are_compared_by_all_their_fields(tmp_path):
    strings = [cf.DrillString([Own(None, None, 200.0, 0.0635, maker=maker)]) for maker in ("one", "other")]
    sweep(tmp_path / "sweep.jsonl", string=strings[0], mud=None)
    with pytest.raises(cf.SceneError, match="string differs"):
        sweep(tmp_path / "sweep.jsonl", string=strings[1], mud=None)


def changed(row, **entries):
    """The line of another row, with the checksum that belongs to it."""
    return line_of({**row, **entries})


def without(row, name):
    return line_of({key: value for key, value in row.items() if key != name})


def nested():
    text = b'{"operation": ' + b"[" * 100_000
    return text + b', "crc32": %d}\n' % zlib.crc32(text)


DAMAGES = {
    "operation -1": lambda row, line: changed(row, operation=-1),
    "friction beyond": lambda row, line: changed(row, friction=1),
    "depth -1": lambda row, line: changed(row, depth=-1),
    "depth 1.0": lambda row, line: changed(row, depth=1.0),
    "depth true": lambda row, line: changed(row, depth=True),
    "depth 10^400": lambda row, line: changed(row, depth=10**400),
    "depth a list": lambda row, line: changed(row, depth=[1]),
    "load a text": lambda row, line: changed(row, hook_load="1e6"),
    "load true": lambda row, line: changed(row, hook_load=True),
    "load infinite": lambda row, line: changed(row, hook_load=float("inf")),
    "load 10^400": lambda row, line: changed(row, hook_load=10**400),
    "load missing": lambda row, line: without(row, "hook_load"),
    "rung 7": lambda row, line: changed(row, rung=7.0),
    "rung 0.5": lambda row, line: changed(row, rung=0.5),
    "error negative": lambda row, line: changed(row, error=-1.0),
    "note a number": lambda row, line: changed(row, note=5),
    "a load changed": lambda row, line: line.replace(b'"hook_load": ', b'"hook_load": 1'),
    "an index changed": lambda row, line: line.replace(b'"depth": 1', b'"depth": 0'),
    "checksum changed": lambda row, line: line[:-3] + b"}\n",
    "no checksum": lambda row, line: json.dumps(row).encode() + b"\n",
    "a list": lambda row, line: b"[0, 0, 1, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0]\n",
    "nested": lambda row, line: b"[" * 100_000 + b"\n",
    "nested, with a checksum": lambda row, line: nested(),
    "no UTF-8": lambda row, line: b"\xff\xfe\n",
    "empty": lambda row, line: b"\n",
    "a row of another depth put there": lambda row, line: b"",
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_lines_that_were_changed_are_computed_again(damage, tmp_path, monkeypatch):
    file, asked = tmp_path / "sweep.jsonl", []
    whole = sweep(file)
    head, *lines = file.read_bytes().splitlines(keepends=True)
    row = {name: value for name, value in json.loads(lines[1]).items() if name != "crc32"}
    lines[1] = DAMAGES[damage](row, lines[1])
    file.write_bytes(head + b"".join(lines))
    told = module.torque_and_drag
    monkeypatch.setattr(module, "torque_and_drag", lambda *a, **n: (asked.append(n["depth"]), told(*a, **n))[1])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", cf.SceneWarning)
        again = sweep(file)
    assert asked == [800.0] and (again.hook_load == whole.hook_load).all()
    assert len(said) == (lines[1] != b"") and all("line 3" in str(warning.message) for warning in said)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert (sweep(file).surface_torque == whole.surface_torque).all() and asked == [800.0]


@pytest.mark.parametrize("text", ["notes of mine", "notes\nof mine\n", '{"sweep": "0123456789abcdef"}\n', "\n", "[]\n",
                                  '{"format": 99, "sweep": {}, "crc32": 0}\n'])  # fmt: skip
def test_files_of_others_stay_as_they_are(text, tmp_path):
    file = tmp_path / "notes.txt"
    file.write_text(text)
    with pytest.raises(cf.SceneError, match="holds another sweep"):
        sweep(file)
    assert file.read_text() == text


def test_what_is_no_plain_file_is_refused(tmp_path):
    for name in ("/dev/null", tmp_path):
        with pytest.raises(cf.SceneError, match="expected a plain file"):
            sweep(name)


def test_a_sweep_that_was_ended_anywhere_goes_on(tmp_path):
    """However much of the file was written."""
    whole, file = sweep(tmp_path / "whole.jsonl"), tmp_path / "part.jsonl"
    data = (tmp_path / "whole.jsonl").read_bytes()
    for size in (0, 1, 40, data.index(b"\n"), data.index(b"\n") + 1, len(data) - 70, len(data) - 1):
        file.write_bytes(data[:size])
        assert (sweep(file).hook_load == whole.hook_load).all() and file.read_bytes() == data
    assert np.isfinite(whole.hook_load).all()
