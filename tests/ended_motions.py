"""Motions that are written to a folder, and ways to end them early."""

import numpy as np
import pytest
from moving_scenes import flying_in_a_plane, flying_in_space, flying_off_axis
from test_schemes import everything

import cosserat_fenicsx as cf
from cosserat_fenicsx.models.moving import Moving
from cosserat_fenicsx.storage.store import Store

SMALL = {"elements": 4, "degree": 2}
CASES = {
    "fixed": (flying_in_space, 5, {"dt": 0.05}),
    "adaptive": (flying_in_space, 5, {"tol": 1e-2}),
    "plane": (flying_in_a_plane, 3, {"dt": 0.02, "save_every": 0.25}),
    "plane, adaptive": (flying_in_a_plane, 1, {"tol": 1e-2, "save_every": 0.1}),
    "energy": (flying_in_space, 5, {"tol": 1e-1, "scheme": "energy"}),
    "triple-jump": (flying_in_space, 2, {"dt": 0.05, "scheme": "triple-jump"}),
    "eccentric": (flying_off_axis, 2, {"dt": 0.05}),
    "ties and damping": (everything, 0.5, {"dt": 0.01}),
}


class Stopped(Exception):
    """Raised to end a run."""


def stop_at(monkeypatch, step, apart, model=Moving):
    """Make the next run of a model raise `Stopped` in the middle of a step; `apart`: seconds between checkpoints."""
    accept, taken = model.accept, []

    def accept_or_stop(self, h):
        accept(self, h)
        taken.append(h)
        if len(taken) == step:
            monkeypatch.setattr(model, "accept", accept)
            raise Stopped

    monkeypatch.setattr(model, "accept", accept_or_stop)
    monkeypatch.setattr(Store, "APART", apart)
    monkeypatch.setattr(Store, "SELDOM", 0)


def run(case, folder=None):
    make, duration, more = CASES[case]
    return cf.simulate(make()[1], duration, folder=folder, **SMALL, **more)


def rows(folder):
    """The saved states, read with numpy alone."""
    return np.load(folder / "instants.npy", mmap_mode="r")


def assert_same(one, other):
    one, other = rows(one), rows(other)
    assert len(one) == len(other)
    for name in one.dtype.names:
        assert np.array_equal(one[name], other[name], equal_nan=one[name].dtype.kind == "f"), name


def part_of(case, folder, monkeypatch, step=25, apart=0.02):
    """Run a case until it is stopped; returns its scene."""
    stop_at(monkeypatch, step, apart)
    with pytest.raises(Stopped):
        run(case, folder)
    return CASES[case][0]()[1]
