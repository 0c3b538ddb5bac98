"""Fixtures, and support of mpirun: only one rank reports, and no rank waits for one that has failed."""

import gc
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

# Compiling takes half the time, and running not noticeably longer on a few elements; what measures speed unsets it.
os.environ.setdefault("COSSERAT_FENICSX_CFLAGS", "-O1")

import numpy as np
import pytest
from mpi4py import MPI

import cosserat_fenicsx as cf
from cosserat_fenicsx.ranks import end_all

COMM = MPI.COMM_WORLD
DEMOS = Path(__file__).parent.parent / "demos"
sys.path += [str(DEMOS), str(DEMOS / "evidence")]


def pytest_addoption(parser):
    parser.addoption("--tangles", type=int, default=2, help="random tangles of rods that touch")
    parser.addoption("--mutations", type=int, default=12, help="damaged folders of each kind of computation")
    parser.addoption("--truths", action="store_true", help="only what is compared with independent truths by `truth`")


def pytest_generate_tests(metafunc):
    if "tangle" in metafunc.fixturenames:
        metafunc.parametrize("tangle", range(metafunc.config.getoption("--tangles")))


@pytest.hookimpl(trylast=True)
def pytest_configure(config):
    if COMM.rank != 0:
        config.pluginmanager.get_plugin("terminalreporter")._tw._file = open(os.devnull, "w")  # noqa: SIM115


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes():
    """Workers get the environment that this process began with: MPI has changed it behind Python's back."""
    for line in subprocess.run(["env", "-0"], capture_output=True, check=True).stdout.split(b"\0"):
        name = os.fsdecode(line.partition(b"=")[0])
        if name and name not in os.environ:
            os.unsetenv(name)
    for name, value in os.environ.items():
        os.putenv(name, value)


def pytest_ignore_collect(collection_path, config):
    """True, or None: nothing is imported of a file that was not asked for by name and whose tests are all skipped."""
    named = any(collection_path.name in argument for argument in config.args)
    if COMM.size > 1 and collection_path.match("test_*.py") and not named:
        text = collection_path.read_text(encoding="utf-8")
        serial = re.search(r"^pytestmark = .*\.serial\b", text, re.M)
        return bool(serial or COMM.size > 2 and "mark.ranks" not in text) or None
    return None


def pytest_collection_modifyitems(config, items):
    if config.getoption("--truths"):
        items[:] = [item for item in items if "truth" in item.fixturenames]
    if COMM.size > 1:
        for item in items:
            if "serial" in item.keywords:
                item.add_marker(pytest.mark.skip(reason="needs one process"))
            elif COMM.size > 2 and "ranks" not in item.keywords:
                item.add_marker(pytest.mark.skip(reason="does not depend on the number of ranks"))


def pytest_collection_finish():
    """What is imported stays: Python need not look through it again and again for what could be freed."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    report = (yield).get_result()
    if COMM.size > 1 and report.failed:
        print(
            f"\nrank {COMM.rank} of {COMM.size}: {item.nodeid} failed\n{report.longreprtext}",
            file=sys.stderr,
            flush=True,
        )
        end_all()


@pytest.fixture
def truth(record_property):
    """Compare with an independent truth, and record a row for `make truths` (demos/evidence/truths.py)."""

    def compare(what, found, exact, asked, *, of=None, most=None, why=""):
        """Assert that numbers are those of a truth.

        Args:
            what: the problem and the quantity. found, exact: numbers of the same shape.
            asked: the largest error that is asked for, over `of`: a scale, None for each exact number's own size.
            most: the largest error that the test allows, where what is asked for is missed; why: that is so.
        """
        exact = np.asarray(exact)
        scale = np.abs(exact) if of is None else of
        error = float(np.max(np.abs(np.asarray(found) - exact) / scale))
        record_property("truth", json.dumps([what, error, asked, why]))
        assert error <= (most or asked), (what, found, exact)

    return compare


def computing(process):
    """Wait until a process of the command line has all of its compiled code."""
    while "cosserat_chain" not in Path(f"/proc/{process.pid}/maps").read_text():
        time.sleep(0.02)


@pytest.fixture
def tmp_path_all(tmp_path):
    """A temporary folder that all ranks share."""
    return Path(COMM.bcast(str(tmp_path)))


def refused(words):
    """For `with`: a `SceneError` whose message contains these words."""
    return pytest.raises(cf.SceneError, match=re.escape(words))


def refuses(cases, how=lambda given: given()):
    """A test that calls `how` with what each case {name: (given, words)} gives, which is refused in these words."""

    @pytest.mark.parametrize("case", cases)
    def test(case):
        given, words = cases[case]
        with refused(words):
            how(given)

    return test


def column(*, length=20.0, diameter=0.2, eccentricity=0.2, arm=False, section=None, E=210e9):
    """The paper's column with its unit load P_cr; returns (rod, scene)."""
    steel = cf.Material(E=E, nu=0.3, density=7850.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, length)), section or cf.Circle(diameter), steel, name="column")
    P = cf.euler_load(rod)
    if arm:
        loads = [cf.EccentricForce(rod.end, (0, 0, -P), (eccentricity, 0))]
    else:
        loads = [cf.Force(rod.end, (0, 0, -P)), cf.Moment(rod.end, (0, P * eccentricity, 0))]
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], loads)


@pytest.fixture(scope="session")
def reference():
    """tests/reference/eccentric_cantilever.json by eta: strong form, 40 digits, confirmed to 2e-11 by collocation."""
    file = Path(__file__).parent / "reference" / "eccentric_cantilever.json"
    return {point["eta"]: point for point in json.loads(file.read_text(encoding="utf-8"))["points"]}


@pytest.fixture(scope="session")
def never_ended(tmp_path_factory):
    """The folder of a case that was computed without interruption."""
    from ended_motions import run

    folder, made = tmp_path_factory.mktemp("whole"), {}

    def of(case):
        if case not in made:
            made[case] = run(case, folder / case)
        return folder / case

    return of
