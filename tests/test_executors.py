"""Studies by executors: new processes, threads, dask, mpi4py.futures; equal results, failures, killed workers."""

import os
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf
from cosserat_fenicsx.ranks import are_apart

pytestmark = [pytest.mark.serial, pytest.mark.once, pytest.mark.slow]
CASES = {"eta": [0.3, 0.6, -1.0, 0.9], "elements": [4]}


def tip(eta, elements):
    """The tip of a column; refuses negative loads."""
    if eta < 0:
        raise ZeroDivisionError("a negative load")
    rod, scene = column()
    return {"tip": cf.solve(scene, [0.5 * eta, eta], elements=elements).position(rod.end)[-1], "process": os.getpid()}


def killed(eta, elements):
    """The first case ends its process."""
    if eta == 0.3:
        os.kill(os.getpid(), signal.SIGKILL)
    return eta


def processes(found):
    """Of the cases that gave a result."""
    return [result["process"] for result in found.results if result]


def same(found, here):
    for one, other in zip(found.results, here.results, strict=True):
        np.testing.assert_array_equal(one and one["tip"], other and other["tip"])
    ((case, why),) = found.failures
    assert found.failures == here.failures and case == {"eta": -1.0, "elements": 4}
    assert why.startswith("ZeroDivisionError: a negative load (test_executors.py, line ")


@pytest.fixture(scope="module")
def here():
    return cf.study(tip, CASES)


def test_new_processes_give_the_same(here, tmp_path):
    found = cf.study(tip, CASES, workers=2, folder=tmp_path / "kept")
    same(found, here)
    assert os.getpid() not in processes(found)
    again = cf.study(tip, CASES, folder=tmp_path / "kept")  # nothing is left to compute, here or elsewhere
    assert processes(again) == processes(found)


@pytest.mark.parametrize("pool", [
    lambda: ThreadPoolExecutor(2), lambda: ProcessPoolExecutor(1, mp_context=get_context("spawn")),
], ids=["threads", "spawned processes"])  # fmt: skip
def test_pools_of_the_caller_give_the_same(pool, here):
    with pool() as executor:
        same(cf.study(tip, CASES, executor=executor), here)


def test_a_dask_cluster_gives_the_same(here):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        same(cf.study(tip, CASES, executor=client), here)


SCRIPT = """
import sys
sys.path.insert(0, {tests!r})
from mpi4py.futures import MPIPoolExecutor
import test_executors, cosserat_fenicsx as cf
if __name__ == "__main__":
    with MPIPoolExecutor() as executor:
        print(cf.study(test_executors.tip, test_executors.CASES, executor=executor).results[3]["tip"].tolist())
"""


def test_ranks_of_mpi4py_futures_give_the_same(here, tmp_path):
    mpirun = shutil.which("mpirun", path="/usr/bin") or pytest.skip("there is no mpirun")
    (tmp_path / "script.py").write_text(SCRIPT.format(tests=str(Path(__file__).parent)))
    words = [mpirun, "--oversubscribe", "--timeout", "120", "-n", "3", sys.executable, "-m", "mpi4py.futures"]
    ranks = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_COMM", "PMIX"))}
    done = subprocess.run([*words, tmp_path / "script.py"], capture_output=True, encoding="utf-8", env=ranks)
    assert done.stdout.strip() == str(here.results[3]["tip"].tolist()), done.stderr


def test_a_killed_worker_ends_the_study_and_keeps_what_is_done(tmp_path):
    with pytest.raises(RuntimeError, match=r"a worker of the executor ended at case \d or near it"):
        cf.study(killed, {"eta": [0.3, 0.6], "elements": [4]}, workers=1, folder=tmp_path / "kept")


@pytest.mark.parametrize(("task", "cases", "given", "words"), [
    (tip, CASES, {"workers": 0}, "study.workers = 0: expected"),
    (tip, CASES, {"executor": 3}, "expected a concurrent.futures.Executor or a dask Client"),
    (tip, CASES, {"executor": 3, "workers": 2}, "expected none with an executor"),
    (tip, {"eta": [lambda: 0.3], "elements": [4]}, {"workers": 1}, r"study.cases\[0\]: the executor cannot send it"),
    (lambda eta, elements: eta, CASES, {"workers": 2},
     "expected a function of a module, or an executor that takes others"),
])  # fmt: skip
def test_refusals(task, cases, given, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.study(task, cases, **given)


def test_threads_of_a_case_compute_alone():
    """As the case does: under mpirun they would wait for the other ranks."""

    def of_thread(k):
        with ThreadPoolExecutor(1) as executor:
            return float(executor.submit(are_apart).result())

    assert cf.study(of_thread, {"k": [1]}).results == [1.0] and not are_apart()


def test_cases_are_handed_out_while_others_run(monkeypatch):
    """Of many cases only some are given to the executor ahead."""
    from cosserat_fenicsx.studies import study as executors

    monkeypatch.setattr(executors, "_AHEAD", 3)
    with ThreadPoolExecutor(1) as executor:
        given = []
        monkeypatch.setattr(executor, "submit", lambda *x, submit=executor.submit: given.append(x) or submit(*x))
        found = cf.study(lambda k: float(len(given) - k), {"k": list(range(20))}, executor=executor)
    assert len(given) == 20 and max(found.results) <= 4
