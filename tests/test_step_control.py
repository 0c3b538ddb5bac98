"""The decisions of step control, which the sweep in C and the continuation in Python share."""

import pytest

from cosserat_fenicsx.statics.path.track import LIMITS, step_control

pytestmark = pytest.mark.serial


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
    assert lib.step_growth(control, LIMITS.intended / 2.25, 2, 3) == pytest.approx(1.5)
    assert lib.step_growth(control, 1e-9, 2, LIMITS.easy) == 2.0
    assert lib.step_growth(control, 1e-9, 2, LIMITS.easy + 1) == 1.0
    assert lib.step_growth(control, 1e-9, 2, LIMITS.hard) == 0.5
    lib.accept_step(control, 0.05, 1.5)  # a step that was short to land on a load factor does not shorten the next
    assert control.step == 0.1
    lib.accept_step(control, 0.1, 0.7)
    assert control.step == pytest.approx(0.07)
    assert not lib.reject_step(control, 0.07) and control.step == pytest.approx(0.035)
    lib.accept_step(control, 0.035, 1.0)
    assert control.rejections == 1
    assert not lib.reject_step(control, 0.035) and lib.reject_step(control, 0.03) and control.rejections == 3
    lib.accept_step(control, 0.03, 1.0)
    lib.accept_step(control, 0.03, 1.0)
    assert control.rejections == 0 and lib.reject_step(control, 0.019)
