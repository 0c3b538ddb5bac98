"""Requests that are refused before the computation, and computations that end soon after Ctrl-C."""

import re
import signal
import subprocess
import sys
import time
import tracemalloc
import warnings
from pathlib import Path

import pytest
from conftest import column

import cosserat_fenicsx as cf

ROOT = Path(__file__).parent.parent
DEMO = ROOT / "demos" / "eccentric_cantilever.toml"


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize(
    ("command", "number"), [(["buckling", "--elements", "4000"], signal.SIGINT), (["modes"], signal.SIGTERM)]
)
def test_long_eigenproblems_end_soon_after_a_signal(command, number, tmp_path):
    """The column under its force alone, which has more load factors than under the moment of an eccentric one."""
    file = tmp_path / "column.toml"
    file.write_text(DEMO.read_text(encoding="utf-8").rpartition("[[loads]]")[0], encoding="utf-8")
    arguments = [sys.executable, "-m", "cosserat_fenicsx", *command, str(file), "--count", "3000"]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", cwd=ROOT)
    time.sleep(8)
    assert process.poll() is None, "it takes minutes"
    process.send_signal(number)
    out, err = process.communicate(timeout=15)
    assert (process.returncode, out, err) == (130, "", "cosserat: interrupted\n")


@pytest.mark.serial
def test_a_thread_that_waits_is_interrupted(monkeypatch):
    """At once, although the thread goes on; an exception in the thread is raised in the caller."""
    from cosserat_fenicsx import interrupts

    assert interrupts.interruptible(lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        interrupts.interruptible(lambda: 1 / 0)
    monkeypatch.setattr(interrupts, "_asked", True)
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupts.interruptible(lambda: time.sleep(5))
    assert time.monotonic() - began < 2


def motions(scene, **more):
    return cf.simulate(scene, 1.0, dt=0.1, **more)


@pytest.mark.parametrize("work", [cf.buckling, cf.modes, motions, lambda scene, **more: cf.solve(scene, [1.0], **more)])
def test_too_many_elements_are_refused_before_the_work(work):
    """With a message, and without allocating memory for all elements."""
    _, scene = column()
    tracemalloc.start()
    with pytest.raises(cf.SceneError, match="elements = 1000000000 on 1 rod.* expected at most 100000 per rod"):
        work(scene, elements=1_000_000_000)
    assert tracemalloc.get_traced_memory()[1] < 1e8
    tracemalloc.stop()
    with pytest.raises(cf.SceneError, match="degree = 1000000000: expected 1, 2, 3 or 4"):
        work(scene, degree=1_000_000_000)


@pytest.mark.serial
@pytest.mark.parametrize("more", [(), ("--duration", "1")])
@pytest.mark.parametrize("command", ["run", "explain"])
def test_the_command_line_refuses_both(command, more, tmp_path, capsys, monkeypatch):
    from cosserat_fenicsx import interrupts
    from cosserat_fenicsx.cli import main as cli

    monkeypatch.setattr(interrupts, "listen", lambda: None)  # signals belong to pytest
    assert cli.main([command, str(DEMO), "--elements", "1000000000", *more]) == 2
    assert "expected at most 100000 per rod" in capsys.readouterr().err
    file = tmp_path / "scene.toml"
    scene = re.sub(r"force = \[.*\]", "force = [0, 0, 1e30]", DEMO.read_text(encoding="utf-8"))
    file.write_text(scene, encoding="utf-8")
    assert cli.main([command, str(file), *more]) == 2
    words = "Force at column.end: 1e.30 N.* expected at most 1e.06 EA = 6.6e.15 N.*units"
    assert re.search(words, capsys.readouterr().err)


def test_enormous_loads_and_motions_are_refused_before_the_work():
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), steel)
    clamp, big = cf.Clamp(rod.start), (0, 0, 1e30)
    small = cf.Force(rod.end, (0, 0, 1.0))
    for supports, load, words in (
        ([clamp], cf.Force(rod.end, big), "Force at .*: 1e.30 N: expected at most 1e.06 EA = 6.6e.15 N"),
        ([clamp], cf.FollowerMoment(rod.end, big), "FollowerMoment at .*: 5e.28 N"),
        ([clamp], cf.LineForce(rod, big), "LineForce on .*: 2e.31 N"),
        ([clamp], cf.Weight((0, 0, 1e30)), "Weight: "),
        ([clamp], cf.Force(rod.end, big, permanent=True), "Force at .*: 1e.30 N"),
        ([clamp, cf.Prescribed(rod.end, displacement=big)], small, "displacement of 1e.30 m: expected at most 2e.07 m"),
        ([clamp, cf.Prescribed(rod.end, rotation=big)], small, "a rotation of 1e.30 rad: expected at most 1e.06 rad"),
    ):
        scene = cf.Scene([rod], supports, [load])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for work in (
                lambda: cf.solve(scene, [0.5, 1.0]), lambda: cf.modes(scene, load_factor=1.0),
                lambda: cf.buckling(scene), lambda: cf.simulate(scene, 1.0),
            ):  # fmt: skip
                with pytest.raises(cf.SceneError, match=words):
                    work()
    with pytest.raises(cf.SceneError, match="1 N times the load factor 1e.16: expected"):
        cf.solve(cf.Scene([rod], [clamp], [small]), [1e16])
    bent = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((1e5, 1e5), float("inf"), (1.0, 1.0), 1.0))
    with pytest.raises(cf.SceneError, match="expected at most 1e.15 EI/L.2 = 1e.15 N"):
        cf.solve(cf.Scene([bent], [cf.Clamp(bent.start)], [cf.Force(bent.end, big)]), [1.0])
