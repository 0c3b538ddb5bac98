"""The demos of whirl in a hole: their numbers come out."""

import sys
from pathlib import Path

import numpy as np
import pytest
from rolling_collar import COLLAR

pytestmark = pytest.mark.serial


@pytest.fixture(autouse=True)
def demos_on_the_path(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(Path(__file__).parent.parent / "demos"), *sys.path])


def test_the_least_friction_of_rolling():
    """At 100 rpm that of the reference; at 30 rpm no wall is needed, which would have to pull."""
    from whirling_collar import least_friction

    assert least_friction(100 * np.pi / 30) == pytest.approx(COLLAR["rolling_friction"], rel=1e-6)
    assert least_friction(30 * np.pi / 30) == np.inf


@pytest.mark.slow
def test_a_collar_turns_from_forward_to_backward_whirl(capsys):
    import whirl
    from known_numbers import deviation

    for check in whirl.main(out=None, duration=9.0):
        assert deviation(check) <= check.allowed, check
    assert "backward whirl at -5" in capsys.readouterr().out


@pytest.mark.slow
def test_a_coarse_map_agrees_with_the_theory(capsys):
    import whirl_map
    from known_numbers import deviation

    assert all(deviation(check) == 0 for check in whirl_map.main(quick=True))
    told = capsys.readouterr().out
    assert "4 simulations of 2.5 s on 1 rank(s)" in told and "rolling backward in 2" in told
