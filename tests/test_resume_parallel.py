"""Motions written to a folder, on one rank or many: an error on one rank ends all, and the motion can be continued."""

import errno
import os

import numpy as np
import pytest
from conftest import COMM
from moving_scenes import right_angle

import cosserat_fenicsx as cf
from cosserat_fenicsx.models.moving import Moving
from cosserat_fenicsx.storage.store import Store

pytestmark = pytest.mark.ranks

ASKED = {"duration": 2, "dt": 0.05, "elements": 4, "degree": 2}


class Stopped(Exception):
    """Raised to end a run."""


def test_it_goes_on(tmp_path_all, monkeypatch):
    arm, scene = right_angle()
    whole = cf.simulate(scene, **ASKED)
    accept, taken = Moving.accept, []

    def accept_or_stop(self, h):
        accept(self, h)
        taken.append(h)
        if len(taken) == 25:
            raise Stopped

    monkeypatch.setattr(Moving, "accept", accept_or_stop)
    monkeypatch.setattr(Store, "APART", 0.02)
    monkeypatch.setattr(Store, "SELDOM", 0)
    with pytest.raises(Stopped):
        cf.simulate(scene, **ASKED, folder=tmp_path_all / "motion")
    history = cf.resume(tmp_path_all / "motion")
    assert len(history) == len(whole) == 41
    tip = history.scene.rods[1].end
    np.testing.assert_allclose(history.position(tip), whole.position(arm.end), atol=1e-9)
    np.testing.assert_allclose(history.energy, whole.energy, rtol=1e-9)
    assert history.comm.allreduce(len(cf.read_history(tmp_path_all / "motion"))) == 41 * COMM.size


def test_a_full_disk_ends_all_ranks(tmp_path_all, monkeypatch):
    """Only rank 0 writes, and only half of a state."""
    pwrite, written = os.pwrite, []

    def until_full(file, data, place):
        written.append(len(data))
        if len(written) == 30:
            return pwrite(file, data[: len(data) // 2], place)
        if len(written) > 30:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return pwrite(file, data, place)

    _, scene = right_angle()
    monkeypatch.setattr(os, "pwrite", until_full)
    with pytest.raises(cf.NotStored, match="No space left on device") as stop:
        cf.simulate(scene, **ASKED, folder=tmp_path_all / "motion")
    saved = len(stop.value.path)
    assert saved == 14 == len(np.load(tmp_path_all / "motion" / "instants.npy", mmap_mode="r"))
    monkeypatch.setattr(os, "pwrite", pwrite)
    COMM.barrier()
    assert len(cf.resume(tmp_path_all / "motion")) == 41


def test_a_folder_that_cannot_be_made_is_said_on_all_ranks(tmp_path_all):
    if COMM.rank == 0:
        (tmp_path_all / "file").write_text("")
    COMM.barrier()
    with pytest.raises(cf.SceneError, match="expected a folder that can be written to"):
        cf.simulate(right_angle()[1], **ASKED, folder=tmp_path_all / "file")
