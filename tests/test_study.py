"""Studies: every case alone on its rank, the same results on any number of ranks, kept as they come."""

import io
import os
import time
from fractions import Fraction

import numpy as np
import pytest
from conftest import COMM, column
from mpi4py import MPI

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


@pytest.mark.ranks
def test_equal_results_on_any_number_of_ranks():
    cases = [{"eta": eta, "elements": n} for n in (2, 4) for eta in (0.3, 0.9, 1.2)]
    cases.append({"eta": 1.0, "elements": 0})
    together, alone = cf.study(tip, cases), cf.study(tip, cases, comm=MPI.COMM_SELF)
    assert all(map(equal, together.results, alone.results)) and together.results[0]["place"].shape == (3,)
    assert together.failures == alone.failures
    assert "elements = 0: expected a whole number above zero" in together.failures[0].why
    rod, scene = column()
    assert cf.solve(scene, [0.5], elements=2).comm == MPI.COMM_WORLD  # as before


@pytest.mark.ranks
def test_torque_and_drag():
    cases = [{"depth": depth, "friction": mu, "model": "soft"} for depth in (900.0, 2500.0) for mu in (0.1, 0.3)]
    together, alone = cf.study(hook_load, cases), cf.study(hook_load, cases, comm=MPI.COMM_SELF)
    assert not together.failures and all(map(equal, together.results, alone.results))


@pytest.mark.ranks
@pytest.mark.slow
def test_the_rod_in_contact():
    """It has a communicator of its own."""
    cases = {"depth": [650.0, 700.0, 900.0], "friction": [0.2], "model": ["rod"]}
    together, alone = cf.study(hook_load, cases), cf.study(hook_load, cases, comm=MPI.COMM_SELF)
    assert not together.failures and all(map(equal, together.results, alone.results))
    assert together.results[0]["model"] == "rod"


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


@pytest.mark.ranks
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
    ((_, why),) = cf.study(lambda i: value, [{"i": 0}]).failures
    assert why.startswith("SceneError: study.task") and "expected" in why


@pytest.mark.parametrize(
    ("task", "cases", "words"),
    [
        (3, [{"a": 1, "b": 1}], r"study\.task = 3: expected a function"),
        (product, [], r"study\.cases = \[\]: expected at least one case"),
        (product, {"a": [1], "b": []}, r"study\.cases\['b'\] = \[\]: expected at least one value"),
        (product, {"a": 1, "b": [1]}, r"study\.cases\['a'\] = 1: expected a list of values"),
        (product, {"a": "12", "b": [1]}, "expected a list of values"),
        (product, "ab", "expected dicts of arguments by name"),
        (product, [{"a": 1, "b": 1}, 3], r"study\.cases\[1\] = 3: expected dicts"),
        (product, {"a": [1], "c": [1]}, r"case 0 has the names a, c, .*expected the arguments of the task, \(a, b\)"),
    ],
)
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
    class Terminal(io.StringIO):
        def isatty(self):
            return True

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


def test_what_is_not_installed_is_no_failure_of_a_case():
    def needs(i):
        if i == 2:
            raise cf.InstallationError("no compiler")
        return i

    with pytest.raises(cf.InstallationError, match="no compiler"):
        cf.study(needs, {"i": range(5)})
