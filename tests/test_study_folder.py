"""Studies that are kept in a folder: gone on with after a break, refused where they are others."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import COMM
from mpi4py import MPI

import cosserat_fenicsx as cf

ROOT = Path(__file__).parent.parent
LIMIT, CALLS, STOPS, COUNT, MUD = 3, [], [], 0, cf.well.Mud(1200.0)
CASES = {"i": range(12)}
PROGRAM = """
import sys, time
import cosserat_fenicsx as cf
def task(i):
    print(i, flush=True)
    time.sleep(0.05)
    if i == 2:
        raise ValueError("two")
    return {"third": i / 3, "array": [i, 0.1 * i]}
found = cf.study(task, {"i": range(30)}, folder=sys.argv[1])
print(found)
"""


def third(i):
    CALLS.append(i)
    if i in STOPS:
        raise KeyboardInterrupt
    if i == LIMIT:
        raise ValueError("three")
    return i / LIMIT


def lines_in(folder):
    return [line for file in sorted(Path(folder).glob("rows.*.jsonl")) for line in file.read_bytes().splitlines()]


@pytest.mark.serial
def test_killed_and_gone_on_with(tmp_path):
    """Every case is computed once but for the one that was broken off, and the table is that of an unbroken run."""
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)

    def run(folder, **given):
        return subprocess.Popen(
            [sys.executable, program, tmp_path / folder], stdout=subprocess.PIPE, encoding="utf-8",
            env={**os.environ, "PYTHONPATH": str(ROOT)}, **given,
        )  # fmt: skip

    broken, begun = run("broken"), []
    for line in broken.stdout:
        begun.append(int(line))
        if len(begun) == 8:
            broken.send_signal(signal.SIGKILL)
            break
    begun += map(int, broken.communicate()[0].split())
    assert broken.returncode == -signal.SIGKILL
    with open(tmp_path / "broken" / "rows.0.jsonl", "a") as stream:
        stream.write('{"case": 20, "attempt": 1, "seco')  # as by a kill in the middle of writing
    after, whole = run("broken").communicate()[0], run("whole").communicate()[0]
    begun += [int(line) for line in after.splitlines() if line.isdigit()]
    assert sorted(begun) in (list(range(30)), sorted([*range(30), 7]))
    assert after.partition("30 cases")[2] == whole.partition("30 cases")[2] != ""
    assert "case 2 failed: ValueError: two" in after


@pytest.mark.ranks
def test_all_ranks_go_on_with_what_one_has_begun(tmp_path_all):
    if COMM.rank == 0:
        STOPS.append(7)
        with pytest.raises(cf.Interrupted, match="after 7 cases"):
            cf.study(third, CASES, folder=tmp_path_all, comm=MPI.COMM_SELF)
        STOPS.clear()
    COMM.barrier()
    CALLS.clear()
    found = cf.study(third, CASES, folder=tmp_path_all)
    assert sorted(sum(COMM.allgather(CALLS), [])) == [7, 8, 9, 10, 11]
    assert found.results == [0.0, 1 / 3, 2 / 3, None, 4 / 3, 5 / 3, 2.0, 7 / 3, 8 / 3, 3.0, 10 / 3, 11 / 3]
    assert COMM.allgather(found.failures) == [found.failures] * COMM.size and len(found.failures) == 1
    CALLS.clear()
    again = cf.study(third, CASES, folder=tmp_path_all)
    assert sum(COMM.allgather(CALLS), []) == [] and again.results == found.results
    assert again.failures == found.failures and (again.seconds == found.seconds).all()


@pytest.mark.ranks
def test_failures_are_tried_again_where_this_is_asked_for(tmp_path_all):
    STOPS.append("nothing")

    def task(i):
        if i in (1, 2) and len(STOPS) < i + 1:
            raise OSError(f"{len(STOPS)}")
        return i

    cases = {"i": range(4)}
    assert [why[:10] for _, why in cf.study(task, cases, folder=tmp_path_all).failures] == ["OSError: 1"] * 2
    STOPS.append("more")
    for retry in (True, False):
        found = cf.study(task, cases, folder=tmp_path_all, retry=retry)
        assert found.results == [0, 1, None, 3] and [why[:10] for _, why in found.failures] == ["OSError: 2"]
    STOPS.clear()
    COMM.barrier()
    assert len(lines_in(tmp_path_all)) == 6


@pytest.mark.ranks
@pytest.mark.parametrize("damage", [b"{}", b"[1]", b"\xff", b'{"case": 99, "attempt": 1, "seconds": 1, "result": 0}'])
def test_lines_that_no_study_wrote_are_left_out(damage, tmp_path_all):
    found = cf.study(third, CASES, folder=tmp_path_all)
    COMM.barrier()
    if COMM.rank == 0:
        file = sorted(tmp_path_all.glob("rows.*.jsonl"))[0]
        lines = file.read_bytes().splitlines()
        file.write_bytes(b"\n".join([damage, *lines[1:]]) + b"\n")
    COMM.barrier()
    CALLS.clear()
    assert cf.study(third, CASES, folder=tmp_path_all).results == found.results
    assert len(sum(COMM.allgather(CALLS), [])) == 1


def fourth(i):
    return i / 4


def pressure(depth):
    return heaviness() * depth


def heaviness():
    return 9.81 * MUD.density


@pytest.mark.ranks
def test_another_study_is_refused(tmp_path_all, monkeypatch):
    cf.study(third, CASES, folder=tmp_path_all)
    COMM.barrier()

    def refused(task, cases, words):
        with pytest.raises(cf.SceneError, match=rf"it holds another study, expected the same call, .*: {words}"):
            cf.study(task, cases, folder=tmp_path_all)

    refused(fourth, CASES, "task: function is '.*fourth', where the study has '.*third'")
    refused(third, {"i": range(13)}, "cases: number is 13, where the study has 12")
    refused(third, {"i": [*range(11), 0.5]}, r"cases\[11\]\['i'\] is 0.5, where the study has 11")
    with monkeypatch.context() as changed:
        changed.setattr(sys.modules[__name__], "LIMIT", 5)
        refused(third, CASES, "the code of task, or something that it uses, was changed")
        changed.setattr(fourth, "__qualname__", "third")
        refused(fourth, CASES, "the code of task, or .* changed")
    assert len(cf.study(third, CASES, folder=tmp_path_all)) == 12


@pytest.mark.ranks
def test_what_a_task_does_not_use_is_not_compared(tmp_path_all, monkeypatch):
    """Numbers that have the name of an attribute, or that the task itself counts with, may be others at every call."""
    here = sys.modules[__name__]
    for number in (1, 2):
        monkeypatch.setattr(here, "real", number + COMM.rank, raising=False)
        assert cf.study(counted, CASES, folder=tmp_path_all / "counted").results == list(range(12))
        monkeypatch.setattr(here, "LIMIT", 3 + COMM.rank)  # each rank may have its own: that of rank 0 is kept
        assert len(cf.study(third, CASES, folder=tmp_path_all / "third")) == 12


def counted(i):
    global COUNT
    COUNT += 1
    return i.real


@pytest.mark.ranks
def test_what_a_task_uses_is_compared(tmp_path_all, monkeypatch):
    cf.study(pressure, {"depth": [1.0]}, folder=tmp_path_all)
    COMM.barrier()
    here = sys.modules[__name__]
    for name, other in (("MUD", cf.well.Mud(1300.0)), ("heaviness", lambda: 9.80665 * MUD.density)):
        with monkeypatch.context() as changed, pytest.raises(cf.SceneError, match="or something that it uses"):
            changed.setattr(here, name, other)
            cf.study(pressure, {"depth": [1.0]}, folder=tmp_path_all)
    assert cf.study(pressure, {"depth": [1.0]}, folder=tmp_path_all).results == [9.81 * 1200.0]


@pytest.mark.ranks
def test_what_cannot_be_compared_is_refused_with_a_folder_alone(tmp_path_all):
    for task, cases in ((lambda x: 1, [{"x": object()}]), (Call(), [{"x": 1}])):
        assert cf.study(task, cases).results == [1]
        with pytest.raises(cf.SceneError, match="cannot be compared with what the folder holds: expected numbers"):
            cf.study(task, cases, folder=tmp_path_all)


class Call:
    def __call__(self, x):
        return 1


@pytest.mark.ranks
def test_parts_of_scenes_are_compared(tmp_path_all):
    def weight(mud, operation):
        return mud.density

    cases = {"mud": [cf.well.Mud(1200.0), cf.well.Mud(1300.0)], "operation": [cf.well.TripIn()]}
    assert cf.study(weight, cases, folder=tmp_path_all).results == [1200.0, 1300.0]
    COMM.barrier()
    with pytest.raises(cf.SceneError, match=r"cases\[1\]\['mud'\].density is 1400"):
        cf.study(weight, {**cases, "mud": [cf.well.Mud(1200.0), cf.well.Mud(1400.0)]}, folder=tmp_path_all)


@pytest.mark.ranks
def test_places_that_cannot_be_written_to(tmp_path_all):
    if COMM.rank == 0:
        (tmp_path_all / "file").write_text("")
    COMM.barrier()
    with pytest.raises(cf.SceneError, match="expected a folder that can be written to"):
        cf.study(third, CASES, folder=tmp_path_all / "file")


@pytest.mark.serial
def test_one_process_at_a_time(tmp_path):
    def within(i):
        cf.study(third, CASES, folder=tmp_path)

    ((_, why),) = cf.study(within, {"i": [1]}, folder=tmp_path).failures
    assert why == f"SceneError: {tmp_path}: another process is at work on this study: expected it to end first"
