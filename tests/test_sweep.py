"""The sweep over load factors in C, the continuation in Python, their step control and what they record."""

import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from conftest import column
from path_scenes import shallow_arch
from test_joints import star

import cosserat_fenicsx as cf
from cosserat_fenicsx.results.records import Records
from cosserat_fenicsx.statics.path.follower import Follower
from cosserat_fenicsx.statics.path.track import LIMITS, step_control

pytestmark = pytest.mark.serial
SECTION = cf.Stiffness(shear=(3e3, 5e3), axial=8e3, bending=(1.0, 2.5), torsion=0.7, mass=1.0)


@pytest.fixture
def swept(monkeypatch):
    """How many load factors were reached in C, one number for each run of it."""
    counts, sweep = [], Follower.sweep

    def counted(self, targets, *given, **more):
        end = yield from sweep(self, targets, *given, **more)
        counts.append(end[0])
        return end

    monkeypatch.setattr(Follower, "sweep", counted)
    return counts


def pushed(*loads, section=SECTION):
    """Pressed with a small eccentricity; its Euler load is 2.5."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section, name="column")
    more = [load(rod) for load in loads] or [cf.Moment(rod.end, (0.0, 0.05, 0))]
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0.0, 0, -2.0)), *more])


def hung():
    """The same column under its own weight and a permanent force."""
    return pushed(
        lambda rod: cf.Weight((0, 0.3, 0), permanent=True), lambda rod: cf.Force(rod.end, (0.2, 0, 0), permanent=True)
    )


def tied():
    return star((0.3, 1.0, -0.2))[1]


def buckling():
    """A straight column whose section has one Euler load at each of its axes."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), SECTION, name="column")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0.0, 0, -2.0))])


ETAS = np.linspace(0.2, 1.6, 15)
WAYS = {
    "load factors": (pushed(), ETAS, {}),
    "a range": (pushed(), (0.1, 1.6), {}),
    "there and back": (pushed(), [0.5, 0.2, 0.2, 0.9, 0.0, -0.5], {"model": "spatial"}),
    "small steps": (pushed(), [0.4, 0.8], {"steps": cf.StepControl(first=0.01, largest=0.05)}),
    "long steps": (pushed(), [1.0, 1.6], {"steps": cf.StepControl(first=2.0, smallest=0.01)}),
    "few iterations": (pushed(), ETAS, {"steps": cf.StepControl(max_iterations=4)}),
    "determinate": (pushed(), ETAS, {"model": "determinate"}),
    "displacement": (pushed(), ETAS[:5], {"formulation": "displacement", "model": "spatial"}),
    "inextensible": (pushed(section=cf.Stiffness((np.inf,) * 2, np.inf, (1.0, 2.5), 0.7)), ETAS[:5], {}),
    "along its length": (pushed(lambda rod: cf.LineForce(rod, (0.2, 0.3, -0.4))), ETAS[:7], {}),
    "followed": (pushed(lambda rod: cf.FollowerForce(rod.end, (0.3, 0.2, 0))), ETAS[:5], {}),
    "permanent loads": (hung(), ETAS[:7], {}),
    "hinge": (tied(), np.linspace(0.2, 1, 5), {}),
    "bifurcations": (buckling(), (0.0, 3.4), {"model": "spatial"}),
}


def without(monkeypatch, scene, etas, options):
    with monkeypatch.context() as patch:
        patch.setattr(Follower, "sweeps", property(lambda self: False))
        return cf.solve(scene, etas, **{"elements": 3, "degree": 3, **options})


def check_same(found, expected):
    for name in ("load_factors", "negative_modes", "steps", "iterations"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-9, err_msg=name)
    assert (found.model, found.control, len(found)) == (expected.model, expected.control, len(expected))
    assert [(e.kind, e.after) for e in found.events] == [(e.kind, e.after) for e in expected.events]
    for event, other in zip(found.events, expected.events, strict=True):
        assert event.load_factor == pytest.approx(other.load_factor, rel=1e-9)
    for rod in expected.scene.rods:
        for s in (0, 0.3 * rod.length, rod.length):
            for name in ("position", "rotation", "force", "moment"):
                values = getattr(expected, name)(rod.at(s))
                np.testing.assert_allclose(getattr(found, name)(rod.at(s)), values, rtol=0, atol=2e-9, err_msg=name)
    for support in expected.scene.supports:
        for a, b in zip(found.reaction(support), expected.reaction(support), strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=2e-9)


@pytest.mark.parametrize("name", WAYS)
def test_same_path_as_in_python(name, monkeypatch, swept):
    scene, etas, options = WAYS[name]
    found = cf.solve(scene, etas, elements=3, degree=3, **options)
    assert swept and sum(swept) > 0
    check_same(found, without(monkeypatch, scene, etas, options))


def test_arc_length_takes_over_at_a_limit_point(monkeypatch, swept):
    _, crown, scene = shallow_arch()
    etas = np.linspace(10, 40, 4)
    found = cf.solve(scene, etas, elements=3)
    other = without(monkeypatch, scene, etas, {"degree": 4})
    assert found.control == other.control == "arc" and swept[0] == 3 and len(found) == len(other) == 4
    np.testing.assert_allclose(found.displacement(crown), other.displacement(crown), atol=1e-7)
    assert found.negative_modes.tolist() == other.negative_modes.tolist()


def test_same_failure_as_in_python(monkeypatch):
    _, _, scene = shallow_arch()
    failures = []
    for run in (lambda: cf.solve(scene, [10.0, 40.0], elements=3, degree=3, control="load"),
                lambda: without(monkeypatch, scene, [10.0, 40.0], {"control": "load"})):  # fmt: skip
        with pytest.raises(cf.NotConverged) as failure:
            run()
        failures.append(failure.value)
    a, b = failures
    assert str(a) == str(b) and a.path.load_factors.tolist() == b.path.load_factors.tolist() == [10.0]


def test_the_first_step_of_a_slender_rod_in_a_new_problem(swept):
    """The residual of a scene is rounded as its own stiffness tells, not as that of the scene before."""
    stiff = cf.Stiffness(shear=(6e8, 6e8), axial=1.6e9, bending=(1.0, 2.5), torsion=0.8)
    for _ in range(2):
        path = cf.solve(pushed(section=stiff), [0.1, 0.2], elements=7, degree=2, model="spatial")
        assert path.iterations.max() <= 8 and path.steps[-1] <= 5


@pytest.mark.parametrize("scene", [pushed(), tied()], ids=["alone", "hinge"])
def test_ctrl_c_keeps_the_points_so_far(scene):
    """Also where the signal finds Python in the middle of what C has asked for."""
    etas = np.tile(np.linspace(0.1, 1.0, 100), 1000)
    cf.solve(scene, etas[:2], elements=2, model="spatial")
    sent = []

    def send():
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # whatever another test has left
    try:
        threading.Timer(0.4, send).start()
        with pytest.raises(cf.Interrupted) as end:
            cf.solve(scene, etas, elements=2, model="spatial")
    finally:
        signal.signal(signal.SIGINT, before)
    took = time.monotonic() - sent[0]
    path = end.value.path
    assert took < 0.2 and 10 < len(path) < len(etas)
    np.testing.assert_array_equal(path.load_factors, etas[: len(path)])
    assert np.isfinite(path.position(scene.rods[0].end)).all()


def test_threads_take_turns_in_petsc():
    """PETSc keeps reductions that have begun in one place for all threads; of scenes of one signature none is mixed."""

    def tip(force):
        scene = pushed(lambda rod: cf.Force(rod.end, (force, 0, 0)))
        return cf.solve(scene, np.linspace(0.1, 1.6, 200), elements=3, model="spatial").position(scene.rods[0].end)

    forces = (0.1, 0.2, 0.3)
    expected = [tip(force) for force in forces]
    assert np.abs(np.diff(expected, axis=0)).max() > 0.01
    with ThreadPoolExecutor(3) as threads:
        for found, given in zip(threads.map(tip, 6 * forces), 6 * expected, strict=True):
            np.testing.assert_allclose(found, given, atol=1e-11)


@pytest.mark.parametrize(
    ("step", "largest", "here", "wanted", "goal"),
    [
        (0.1, 9.0, 0.0, 1.0, 0.1),
        (0.1, 9.0, 0.0, -1.0, -0.1),
        (0.1, 9.0, 0.5, 0.62, 0.62),  # at most a fifth longer
        (0.1, 9.0, 0.5, 0.65, 0.575),  # two equal steps instead of a long and a short one
        (0.1, 0.05, 0.0, 1.0, 0.05),
        (0.1, 0.1, 0.0, 0.11, 0.055),
    ],
)
def test_where_a_step_ends(step, largest, here, wanted, goal):
    lib, control = step_control(step=step, largest=largest)
    assert lib.step_goal(control, here, wanted) == pytest.approx(goal, rel=1e-14)


def test_which_steps_are_accepted():
    """Near the predictor, else not far from it, along the path, and not farther than the predicted increment."""
    lib, control = step_control()
    near, off = 0.9 * LIMITS.slight, 2 * LIMITS.slight
    assert lib.judge_step(control, 2, near, -1.0, 1.0, 9.0) == lib.ACCEPTED
    assert lib.judge_step(control, 2, off, 1.0, 1.0, 1.0) == lib.ACCEPTED
    assert lib.judge_step(control, 2, off, -1.0, 1.0, 1.0) == lib.OPPOSITE
    assert lib.judge_step(control, 2, off, 1.0, 1.0, 1.1) == lib.UNSURE
    assert lib.judge_step(control, 1, off, 1.0, 1.0, 0.5) == lib.UNSURE
    assert lib.judge_step(control, 1, 4 * LIMITS.intended, 1.0, 1.0, 0.5) == lib.UNSURE and control.shrink == 0.5
    assert lib.judge_step(control, 2, 9 * LIMITS.intended, 1.0, 1.0, 0.5) == lib.TOO_FAR
    assert control.shrink == pytest.approx(1 / 3)


def test_how_long_the_next_step_is():
    lib, control = step_control(step=0.1, smallest=0.01, largest=9.0, shrink=0.5, patience=3)
    assert lib.step_growth(control, LIMITS.intended / 2.25, 2, 3, False) == pytest.approx(1.5)
    assert [lib.step_growth(control, 1e-9, 2, LIMITS.easy, linear) for linear in (False, True)] == [2.0, LIMITS.first]
    assert lib.step_growth(control, 1e-9, 2, LIMITS.easy + 1, True) == 1.0
    assert lib.step_growth(control, 1e-9, 2, LIMITS.hard, True) == 0.5
    lib.accept_step(control, 0.05, 1.5)  # a step that was short to land on a load factor does not shorten the next
    assert control.step == 0.1
    lib.accept_step(control, 0.1, 0.7)
    assert control.step == pytest.approx(0.07)
    assert not lib.reject_step(control, 0.07) and control.step == pytest.approx(0.035)
    lib.accept_step(control, 0.035, 1.0)
    assert control.rejections == 1 and lib.step_growth(control, 1e-9, 2, 3, True) == 2.0
    assert not lib.reject_step(control, 0.035) and lib.reject_step(control, 0.03) and control.rejections == 3
    lib.accept_step(control, 0.03, 1.0)
    lib.accept_step(control, 0.03, 1.0)
    assert control.rejections == 0 and lib.reject_step(control, 0.019)


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_one_by_one_and_many_at_once(model, monkeypatch):
    rod, scene = column()
    etas, given, append = [0.2, 0.4, 0.6, 0.8, 1.0], [], cf.Path.append
    monkeypatch.setattr(Follower, "sweeps", False)
    monkeypatch.setattr(cf.Path, "append", lambda path, record: (given.append(record), append(path, record)))
    single = cf.solve(scene, etas, model=model, elements=3)
    mixed = single.at_points([])
    append(mixed, given[0])
    mixed.extend(Records.of(given[1:3]))
    assert mixed.load_factors.tolist() == etas[:3] and mixed.position(rod.end).shape == (3, 3)
    mixed.extend(Records.of(given[3:4]))
    append(mixed, given[4])
    for found in (mixed, mixed.at_points(range(5)), mixed[3:].with_points(mixed[:3], np.arange(5) < 3)):
        assert len(found) == 5
        for name in ("load_factors", "negative_modes", "iterations", "steps"):
            np.testing.assert_array_equal(getattr(found, name), getattr(single, name))
        for query in ("position", "rotation", "force", "moment"):
            np.testing.assert_array_equal(getattr(found, query)(rod.at(7.0)), getattr(single, query)(rod.at(7.0)))
        np.testing.assert_array_equal(found.reaction(rod.start), single.reaction(rod.start))
