"""Studies: every case alone on its rank, kept as they come, gone on with after a break."""

import os
import sys
import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from conftest import COMM, column
from mpi4py import MPI
from test_requests import Terminal

import cosserat_fenicsx as cf
from cosserat_fenicsx import progress as module

FACTOR = 3.0


def product(a, b):
    if (a, b) == (2, 20):
        raise ZeroDivisionError("two and twenty")
    return {"product": FACTOR * a * b, "pair": [a, b], "name": f"{a} by {b}", "a": -a}


def tip(eta, elements):
    """The tip of a column, on one rank however many there are."""
    rod, scene = column()
    path = cf.solve(scene, [0.5 * eta, eta], elements=elements)
    assert path.comm.size == 1
    return {"place": path.position(rod.end)[-1], "stable": path.stable[-1], "model": path.model}


def hook_load(depth, friction, model):
    path = cf.well.WellPath.from_survey([0, 600, 1200, 2500], [0, 0, 50, 50], [0, 0, 120, 120])
    hole = cf.well.Borehole(path, cf.well.HoleSection(2500.0, 0.2159, friction))
    string = cf.well.DrillString([cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    answer = cf.well.torque_and_drag(
        hole, string, cf.well.RotateOffBottom(), mud=cf.well.Mud(1200.0), depth=depth, model=model, tol=1e-2
    )
    return {"hook load": answer.hook_load, "torque": answer.surface_torque, "model": answer.model}


def equal(a, b):
    """Whether results are equal to the last digit."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(equal(a[name], b[name]) for name in a)
    return type(a) is type(b) and np.array_equal(a, b)


@pytest.mark.ranks
def test_a_grid_in_its_order():
    found = cf.study(product, {"a": [1, 2], "b": (10, 20, 30)})
    assert [(case["a"], case["b"]) for case in found.cases] == [(1, 10), (1, 20), (1, 30), (2, 10), (2, 20), (2, 30)]
    assert [result and result["product"] for result in found.results] == [30.0, 60.0, 90.0, 60.0, None, 180.0]
    ((case, why),) = found.failures
    assert case == {"a": 2, "b": 20} and why.startswith("ZeroDivisionError: two and twenty (test_study.py, line ")
    assert found.done.all() and len(found) == 6 and (found.seconds >= 0).all()
    assert f"case 4 failed: {why}" in str(found) and "6 cases, 6 done, 1 failed" in str(found)
    assert COMM.allgather(str(found)) == [str(found)] * COMM.size


@pytest.mark.ranks
def test_all_ranks_compute_and_longer_cases_do_not_hold_up_the_others():
    def where(i):
        time.sleep(0.4 if i == 0 else 0.02)
        return COMM.rank

    found = cf.study(where, ({"i": i} for i in range(6 * COMM.size)))
    assert set(found.results) == set(range(COMM.size))
    assert COMM.size == 1 or found.results.count(found.results[0]) == 1


COLUMNS = [*({"eta": eta, "elements": n} for n in (2, 4) for eta in (0.3, 0.9, 1.2)), {"eta": 1.0, "elements": 0}]
SOFT = [{"depth": depth, "friction": mu, "model": "soft"} for depth in (900.0, 2500.0) for mu in (0.1, 0.3)]
EXACT = {"depth": [620.0, 650.0], "friction": [0.2], "model": ["rod"]}


@pytest.mark.slow
@pytest.mark.ranks
@pytest.mark.parametrize(("task", "cases"), [
    (tip, COLUMNS), (hook_load, SOFT), pytest.param(hook_load, EXACT, marks=pytest.mark.slow),
], ids=["column", "soft string", "rod in contact"])  # fmt: skip
def test_equal_results_on_any_number_of_ranks(task, cases):
    """The rod in contact has a communicator of its own; afterwards all ranks work together as before."""
    together, alone = cf.study(task, cases), cf.study(task, cases, comm=MPI.COMM_SELF)
    assert all(map(equal, together.results, alone.results)) and together.failures == alone.failures
    whys = [why for _, why in together.failures]
    assert len(whys) == (cases is COLUMNS) and all("elements = 0: expected a whole number above" in x for x in whys)
    assert cf.solve(column()[1], [0.5], elements=2).comm == MPI.COMM_WORLD


@pytest.mark.ranks
def test_a_case_cannot_ask_for_the_other_ranks():
    def asks(eta):
        return cf.solve(column()[1], [eta], elements=2, comm=MPI.COMM_WORLD).load_factors

    found = cf.study(asks, {"eta": [0.5, 0.6, 0.7]})
    if COMM.size > 1:
        assert "expected None or MPI.COMM_SELF within a study" in found.failures[2].why
    else:
        assert found.results[2] == [0.7]


def test_a_task_that_changes_its_arguments_does_not_change_those_of_other_cases():
    given = np.array([1.0, 2.0])

    def changing(numbers, array, more):
        numbers.append(more)
        array *= more
        return [sum(numbers), *array]

    study = cf.study(changing, {"numbers": [[1, 2], [4]], "array": [given], "more": [10, 20]})
    expected = [[total + more, more, 2 * more] for total in (3, 4) for more in (10, 20)]
    assert np.array(study.results).tolist() == expected
    assert study.cases[0]["numbers"] == [1, 2] and given.tolist() == [1.0, 2.0]


def test_a_study_within_a_case():
    def sums(n):
        return sum(cf.study(lambda k: k, {"k": range(1, n + 1)}).results)

    assert cf.study(sums, {"n": [1, 2, 3, 4]}).results == [1, 3, 6, 10]


@pytest.mark.serial
@pytest.mark.parametrize(
    "value",
    [1.0 / 3.0, 7, True, None, "text", np.nan, -np.inf, 1 - 2j, np.float32(0.1), [1.5, np.nan], np.eye(2, dtype=int),
     np.array([1j, np.nan]), np.array([["a", "bc"]]), np.zeros((0, 3)), np.array(2.0), Fraction(1, 4)],
)  # fmt: skip
def test_values_to_the_last_digit(value, tmp_path_all):
    def gives(i):
        return {"value": value}

    for found in (cf.study(gives, [{"i": 0}], folder=tmp_path_all), cf.study(gives, [{"i": 0}], folder=tmp_path_all)):
        assert not found.failures
        np.testing.assert_array_equal(found.results[0]["value"], value)
        if isinstance(value, np.ndarray) and value.ndim:
            assert found.results[0]["value"].dtype == value.dtype and found.results[0]["value"].shape == value.shape


@pytest.mark.parametrize(
    "value", [object(), [[1], [1, 2]], {"a": {"b": 1}}, {1: 2}, [object()], np.ma.array([1], mask=[1])]
)
def test_results_that_cannot_be_kept_are_failures(value):
    """But what is not installed is no failure of a case."""
    ((_, why),) = cf.study(lambda i: value, [{"i": 0}]).failures
    assert why.startswith("SceneError: study.task") and "expected" in why

    def needs(i):
        raise cf.InstallationError("no compiler")

    with pytest.raises(cf.InstallationError, match="no compiler"):
        cf.study(needs, [{"i": 0}])


@pytest.mark.serial
@pytest.mark.parametrize(("task", "cases", "words"), [
    (3, [{"a": 1, "b": 1}], r"study\.task = 3: expected a function"),
    (product, [], r"study\.cases = \[\]: expected at least one case"),
    (product, {"a": [1], "b": []}, r"study\.cases\['b'\] = \[\]: expected at least one value"),
    (product, {"a": 1, "b": [1]}, r"study\.cases\['a'\] = 1: expected a list of values"),
    (product, {"a": "12", "b": [1]}, "expected a list of values"),
    (product, "ab", "expected dicts of arguments by name"),
    (product, [{"a": 1, "b": 1}, 3], r"study\.cases\[1\] = 3: expected dicts"),
    (product, {"a": [1], "c": [1]}, r"case 0 has the names a, c, .*expected the arguments of the task, \(a, b\)"),
])  # fmt: skip
def test_refusals(task, cases, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.study(task, cases)


@pytest.mark.ranks
@pytest.mark.skipif(COMM.size == 1, reason="needs several ranks")
def test_ranks_with_other_cases_are_refused():
    with pytest.raises(cf.SceneError, match="differ between ranks"):
        cf.study(product, {"a": [COMM.rank], "b": [1]})


@pytest.mark.ranks
def test_the_study_alone_shows_progress(capsys):
    def solves(eta):
        return cf.solve(column()[1], [eta], elements=2, progress=True).error[0]

    cf.study(solves, {"eta": [0.1, 0.2, 0.3]}, progress=True)
    said = capsys.readouterr().err
    assert ("study: 3 of 3 cases, " in said) == (COMM.rank == 0)
    assert "load factor" not in said


@pytest.mark.ranks
def test_a_bar_in_a_terminal(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(module.sys, "stderr", screen)
    monkeypatch.setattr(module, "_PATIENCE", 0.0)
    monkeypatch.setattr(module, "_REDRAWN", 0.01)
    cf.study(lambda i: time.sleep(0.05), {"i": range(4 * COMM.size)})
    assert (f" of {4 * COMM.size} cases" in screen.getvalue()) == (COMM.rank == 0)


@pytest.mark.ranks
def test_an_interrupt_of_one_rank_ends_all_and_says_how_to_go_on(tmp_path_all):
    def stops(i):
        time.sleep(0.02)
        if i == 5:
            raise KeyboardInterrupt
        return i

    with pytest.raises(cf.Interrupted, match=r"cases, which .* they are kept in .*, and the same call") as stop:
        cf.study(stops, {"i": range(40)}, folder=tmp_path_all)
    found = stop.value.path
    assert 5 <= len(found) < 5 + 4 * COMM.size and not found.done[5] and found.results[:5] == [0, 1, 2, 3, 4]
    assert COMM.allgather(found.results) == [found.results] * COMM.size
    with pytest.raises(cf.Interrupted, match="with a folder they would be kept"):
        cf.study(stops, {"i": range(5, 40)})


@pytest.mark.ranks
def test_a_full_disk_ends_all_ranks(tmp_path_all, monkeypatch):
    from cosserat_fenicsx.storage.store import Store

    keep = Store.keep

    def full(self, row, *more):
        if row["case"] == 3:
            raise OSError(28, os.strerror(28))
        keep(self, row, *more)

    monkeypatch.setattr(Store, "keep", full)
    with pytest.raises(cf.NotStored, match="No space left on device") as stop:
        cf.study(lambda i: i, {"i": range(400)}, folder=tmp_path_all)
    assert stop.value.path.done[:3].all()


ROOT = Path(__file__).parent.parent
LIMIT, CALLS, STOPS, COUNT, MUD = 3, [], [], 0, cf.well.Mud(1200.0)
CASES = {"i": range(12)}


def third(i):
    CALLS.append(i)
    if i in STOPS:
        raise KeyboardInterrupt
    if i == LIMIT:
        raise ValueError("three")
    return i / LIMIT


def lines_in(folder):
    return [line for file in sorted(Path(folder).glob("rows.*.jsonl")) for line in file.read_bytes().splitlines()]


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
def test_failures_are_tried_again_where_this_is_asked_for(tmp_path_all, capsys):
    STOPS.append("nothing")

    def task(i):
        if i in (1, 2) and len(STOPS) < i + 1:
            raise OSError(f"{len(STOPS)}")
        return i

    cases = {"i": range(4)}
    assert [why[:10] for _, why in cf.study(task, cases, folder=tmp_path_all).failures] == ["OSError: 1"] * 2
    STOPS.append("more")
    for retry in (True, False):
        found = cf.study(task, cases, folder=tmp_path_all, retry=retry, progress=True)
        assert ("study: 4 of 4 cases, 1 failed" in capsys.readouterr().err) == (COMM.rank == 0)
        assert found.results == [0, 1, None, 3] and [why[:10] for _, why in found.failures] == ["OSError: 2"]
    STOPS.clear()
    COMM.barrier()
    assert len(lines_in(tmp_path_all)) == 6


@pytest.mark.serial
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


def weight(mud, operation):
    return mud.density


@pytest.mark.ranks
def test_another_study_is_refused(tmp_path_all, monkeypatch):
    """By its cases, parts of scenes among them, by its task, and by what this uses."""
    muds = {"mud": [cf.well.Mud(1200.0), cf.well.Mud(1300.0)], "operation": [cf.well.TripIn()]}
    given = {third: CASES, pressure: {"depth": [1.0]}, weight: muds}
    if COMM.rank == 0:
        (tmp_path_all / "file").write_text("")
    for task, cases in given.items():
        cf.study(task, cases, folder=tmp_path_all / task.__name__)
    COMM.barrier()
    with pytest.raises(cf.SceneError, match="expected a folder that can be written to"):
        cf.study(third, CASES, folder=tmp_path_all / "file")

    def refused(task, cases, words, folder="third"):
        with pytest.raises(cf.SceneError, match=rf"it holds another study, expected the same call, .*: {words}"):
            cf.study(task, cases, folder=tmp_path_all / folder)

    refused(fourth, CASES, "task: function is '.*fourth', where the study has '.*third'")
    refused(third, {"i": range(13)}, "cases: number is 13, where the study has 12")
    refused(third, {"i": [*range(11), 0.5]}, r"cases\[11\]\['i'\] is 0.5, where the study has 11")
    others = [cf.well.Mud(1200.0), cf.well.Mud(1400.0)]
    refused(weight, {**muds, "mud": others}, r"cases\[1\]\['mud'\].density is 1400", "weight")
    here = sys.modules[__name__]
    for task, name, other in ((third, "LIMIT", 5), (pressure, "MUD", cf.well.Mud(1300.0)),
                              (pressure, "heaviness", lambda: 9.80665 * MUD.density)):  # fmt: skip
        with monkeypatch.context() as changed:
            changed.setattr(here, name, other)
            words = "the code of task, or something that it uses, was changed"
            refused(task, given[task], words, task.__name__)
            changed.setattr(fourth, "__qualname__", "third")
            refused(fourth, CASES, "the code of task, or .* changed")
    assert len(cf.study(third, CASES, folder=tmp_path_all / "third")) == 12
    assert cf.study(pressure, given[pressure], folder=tmp_path_all / "pressure").results == [9.81 * 1200.0]


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


def test_what_cannot_be_compared_is_refused_with_a_folder_alone(tmp_path_all):
    for task, cases in ((lambda x: 1, [{"x": object()}]), (Call(), [{"x": 1}])):
        assert cf.study(task, cases).results == [1]
        with pytest.raises(cf.SceneError, match="cannot be compared with what the folder holds: expected numbers"):
            cf.study(task, cases, folder=tmp_path_all)


class Call:
    def __call__(self, x):
        return 1
